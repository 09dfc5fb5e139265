// transport.c - urls to sockets, and private workers.
#include <arpa/inet.h>
#include <errno.h>
#include <fcntl.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <signal.h>
#include <spawn.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <sys/wait.h>
#include <unistd.h>

#include "base/alloc.h"
#include "base/clock.h"
#include "base/file.h"
#include "client/lib/conn.h"

extern char **environ;

// ---- sockets -----------------------------------------------------------------------------------

static enum hg_status status_of_connect(int error_number)
{
    if (error_number == EACCES || error_number == EPERM)
        return HG_E_PERM;
    return error_number == ENOMEM ? HG_E_NOMEM : HG_E_CLOSED;
}

static enum hg_status dial_unix(struct helio *h, const char *path, struct hg_error *err)
{
    struct sockaddr_un sa = {.sun_family = AF_UNIX};
    if (!*path || strlen(path) >= sizeof sa.sun_path)
        return hg_error_set(err, HG_E_INVAL, h->url, NULL, "a socket path has 1 to %zu bytes",
            sizeof sa.sun_path - 1);
    memcpy(sa.sun_path, path, strlen(path));
    h->fd = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
    if (h->fd < 0)
        return hg_error_set(
            err, hg_status_from_errno(errno), h->url, NULL, "no socket: %s", strerror(errno));
    // A connect to a unix socket is made or refused at once, but a full backlog would block.
    fcntl(h->fd, F_SETFL, O_NONBLOCK);
    if (connect(h->fd, (struct sockaddr *)&sa, sizeof sa))
        return hg_error_set(
            err, status_of_connect(errno), h->url, NULL, "cannot connect: %s", strerror(errno));
    h->state = HELIO_GREETING;
    return HG_OK;
}

// Begins a connect to h->address or one of its successors.
static enum hg_status dial_next(struct helio *h, int last_error)
{
    for (; h->address; h->address = h->address->ai_next) {
        int one = 1;
        unsigned lost_ms = 60000;
        h->fd = socket(h->address->ai_family, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
        if (h->fd < 0) {
            last_error = errno;
            continue;
        }
        setsockopt(h->fd, IPPROTO_TCP, TCP_NODELAY, &one, sizeof one);
        setsockopt(h->fd, SOL_SOCKET, SO_KEEPALIVE, &one, sizeof one);
        setsockopt(h->fd, IPPROTO_TCP, TCP_USER_TIMEOUT, &lost_ms, sizeof lost_ms);
        if (!connect(h->fd, h->address->ai_addr, h->address->ai_addrlen)) {
            h->state = HELIO_GREETING;
            return HG_OK;
        }
        if (errno == EINPROGRESS) {
            h->state = HELIO_CONNECTING;
            return HG_OK;
        }
        last_error = errno;
        close(h->fd);
        h->fd = -1;
    }
    return hg_client_fail(
        h, status_of_connect(last_error), NULL, "cannot connect: %s", strerror(last_error));
}

static enum hg_status dial_tcp(struct helio *h, const char *address, struct hg_error *err)
{
    char host[256];
    const char *colon = strrchr(address, ':');
    size_t length = colon ? (size_t)(colon - address) : 0;
    bool bracketed = length >= 2 && address[0] == '[' && address[length - 1] == ']';
    if (!length || !colon[1] || length >= sizeof host)
        return hg_error_set(err, HG_E_INVAL, h->url, NULL, "expected tcp:HOST:PORT");
    snprintf(host, sizeof host, "%.*s", (int)(bracketed ? length - 2 : length),
        address + (bracketed ? 1 : 0));
    struct addrinfo hints = {.ai_socktype = SOCK_STREAM, .ai_flags = AI_ADDRCONFIG};
    int failed = getaddrinfo(host, colon + 1, &hints, &h->addresses);
    if (failed) { // AI_ADDRCONFIG hides the loopback of machines without a network
        hints.ai_flags = 0;
        failed = getaddrinfo(host, colon + 1, &hints, &h->addresses);
    }
    if (failed) {
        h->addresses = NULL;
        return hg_error_set(err, failed == EAI_SERVICE ? HG_E_INVAL : HG_E_CLOSED, h->url, NULL,
            "cannot find the host: %s", gai_strerror(failed));
    }
    h->address = h->addresses;
    enum hg_status status = dial_next(h, ECONNREFUSED);
    if (status)
        hg_client_failed(h, err);
    return status;
}

enum hg_status hg_client_dial(struct helio *h, const char *url, struct hg_error *err)
{
    static const struct {
        const char *prefix;
        enum hg_status (*dial)(struct helio *h, const char *rest, struct hg_error *err);
    } schemes[] = {
        {"unix://", dial_unix}, {"unix:", dial_unix}, {"tcp://", dial_tcp}, {"tcp:", dial_tcp}};
    for (size_t i = 0; i < sizeof schemes / sizeof *schemes; i++) {
        size_t n = strlen(schemes[i].prefix);
        if (strncmp(url, schemes[i].prefix, n) == 0)
            return schemes[i].dial(h, url + n, err);
    }
    return hg_error_set(err, HG_E_INVAL, url, NULL, "expected unix:PATH or tcp:HOST:PORT");
}

enum hg_status hg_client_dial_continue(struct helio *h)
{
    struct pollfd p = {.fd = h->fd, .events = POLLOUT};
    if (poll(&p, 1, 0) <= 0)
        return HG_E_AGAIN;
    int error_number = 0;
    socklen_t size = sizeof error_number;
    if (getsockopt(h->fd, SOL_SOCKET, SO_ERROR, &error_number, &size))
        error_number = errno;
    if (!error_number)
        return HG_OK;
    close(h->fd);
    h->fd = -1;
    h->address = h->address->ai_next;
    enum hg_status status = dial_next(h, error_number);
    return status || h->state != HELIO_CONNECTING ? status : HG_E_AGAIN;
}

// ---- private workers ---------------------------------------------------------------------------

// HELIO_WORKER, or ../libexec/helio-worker beside the running program.
static void find_worker(const char *given, char *path, size_t size)
{
    const char *env = getenv("HELIO_WORKER");
    if (given || (env && *env)) {
        snprintf(path, size, "%s", given ? given : env);
        return;
    }
    char self[3072];
    ssize_t n = readlink("/proc/self/exe", self, sizeof self - 1);
    self[n > 0 ? n : 0] = 0;
    for (int i = 0; i < 2; i++) { // the program's name, then its folder's
        char *slash = strrchr(self, '/');
        if (slash)
            *slash = 0;
    }
    snprintf(path, size, "%s/libexec/helio-worker", self);
}

static enum hg_status build_argv(const char *path, const char *const *args, const char ***out)
{
    size_t count = 0;
    while (args && args[count])
        count++;
    const char **argv = hg_calloc(count + 4, sizeof *argv);
    *out = argv;
    if (!argv)
        return HG_E_NOMEM;
    argv[0] = path;
    argv[1] = "--fd";
    argv[2] = "3";
    for (size_t i = 0; i < count; i++)
        argv[i + 3] = args[i];
    return HG_OK;
}

// The worker gets its socket as 3 and the standard streams; a process group of its own, so that
// Ctrl-C reaches only the client; default signals.
static int spawn_with_socket(const char *path, const char **argv, int fd, pid_t *pid)
{
    posix_spawn_file_actions_t actions;
    posix_spawnattr_t attributes;
    sigset_t all, none;
    int failed = posix_spawn_file_actions_init(&actions);
    if (failed)
        return failed;
    failed = posix_spawnattr_init(&attributes);
    if (failed) {
        posix_spawn_file_actions_destroy(&actions);
        return failed;
    }
    sigfillset(&all);
    sigemptyset(&none);
    posix_spawnattr_setsigdefault(&attributes, &all);
    posix_spawnattr_setsigmask(&attributes, &none);
    posix_spawnattr_setpgroup(&attributes, 0);
    posix_spawnattr_setflags(
        &attributes, POSIX_SPAWN_SETSIGDEF | POSIX_SPAWN_SETSIGMASK | POSIX_SPAWN_SETPGROUP);
    failed = posix_spawn_file_actions_adddup2(&actions, fd, 3);
    if (!failed)
        failed = posix_spawn_file_actions_addclosefrom_np(&actions, 4);
    if (!failed)
        failed = posix_spawn(pid, path, &actions, &attributes, (char *const *)argv, environ);
    posix_spawnattr_destroy(&attributes);
    posix_spawn_file_actions_destroy(&actions);
    return failed;
}

enum hg_status hg_client_spawn(
    struct helio *h, const struct helio_options *options, struct hg_error *err)
{
    char path[4096];
    const char **argv;
    int pair[2];
    find_worker(options->worker, path, sizeof path);
    if (build_argv(path, options->worker_args, &argv))
        return hg_error_set(err, HG_E_NOMEM, h->url, NULL, "no memory for its arguments");
    if (socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, pair)) {
        hg_free(argv);
        return hg_error_set(
            err, hg_status_from_errno(errno), h->url, NULL, "no socket pair: %s", strerror(errno));
    }
    int failed = spawn_with_socket(path, argv, pair[1], &h->worker_pid);
    hg_free(argv);
    close(pair[1]);
    if (failed) {
        close(pair[0]);
        h->worker_pid = 0;
        return hg_error_set(
            err, HG_E_WORKER, path, NULL, "cannot start the worker: %s", strerror(failed));
    }
    fcntl(pair[0], F_SETFL, O_NONBLOCK);
    h->fd = pair[0];
    h->state = HELIO_GREETING;
    return HG_OK;
}

static void describe_end(int how, char *text, size_t size)
{
    if (WIFSIGNALED(how))
        snprintf(
            text, size, "was killed by signal %d (%s)", WTERMSIG(how), strsignal(WTERMSIG(how)));
    else
        snprintf(text, size, "ended with exit code %d", WEXITSTATUS(how));
}

bool hg_client_reap(struct helio *h, uint64_t wait_ns, char *text, size_t size)
{
    bool kill_after = !text; // the last call, from helio_destroy
    uint64_t end_ns = hg_clock_now_ns() + wait_ns, step_ns = 200 * 1000;
    int how = 0;
    if (!h->worker_pid)
        return false;
    for (;;) {
        pid_t got = waitpid(h->worker_pid, &how, WNOHANG);
        if (got != 0) {
            h->worker_pid = 0;
            if (text && got > 0)
                describe_end(how, text, size);
            else if (text)
                snprintf(text, size, "ended");
            return true;
        }
        if (hg_clock_now_ns() >= end_ns)
            break;
        hg_clock_sleep_ns(step_ns);
        step_ns = step_ns < 10 * 1000 * 1000 ? step_ns * 2 : step_ns;
    }
    if (!kill_after)
        return false;
    kill(h->worker_pid, SIGKILL);
    while (waitpid(h->worker_pid, &how, 0) < 0 && errno == EINTR)
        ;
    h->worker_pid = 0;
    return true;
}
