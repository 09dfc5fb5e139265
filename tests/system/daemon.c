#include "tests/system/daemon.h"

#include <arpa/inet.h>
#include <errno.h>
#include <fcntl.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <setjmp.h>
#include <signal.h>
#include <spawn.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cmocka.h>

#include "base/clock.h"
#include "tests/support/folder.h"

enum { PATIENCE_MS = 200000, STEP_NS = 5000000 };

extern char **environ;

static uint64_t deadline_after(int ms)
{
    return hg_clock_now_ns() + (uint64_t)ms * 1000000u;
}

static void path_in(const struct daemon *d, const char *name, char *path, size_t size)
{
    snprintf(path, size, "%s/%s", d->folder, name);
}

// ---- the daemon ---------------------------------------------------------------------------------

void daemon_init(struct daemon *d)
{
    *d = (struct daemon){0};
    assert_true(test_folder_make(d->folder, "daemon"));
    const char *build = getenv("HELIO_BUILD_DIR");
    assert_non_null(build);
    char text[512];
    snprintf(text, sizeof text, "%s/bin/heliod", build);
    d->args[d->arg_count++] = strdup(text);
    snprintf(text, sizeof text, "unix:%s/sock", d->folder);
    daemon_option(d, "listen", text);
    const char *cache = getenv("HELIO_TEST_CACHE");
    snprintf(text, sizeof text, "%s/cache", d->folder);
    daemon_option(d, "cache-dir", cache ? cache : text);
    const char *worker = getenv("HELIO_TEST_WORKER");
    snprintf(text, sizeof text, "%s/tests/fake_worker", build);
    daemon_option(d, "worker", worker ? worker : text);
    daemon_option(d, "log", "debug");
    daemon_option(d, "isolation", "shared");
    // The fake worker writes beside the daemon. Others are confined as far as the kernel allows.
    daemon_option(d, "sandbox", worker ? "best-effort" : "off");
}

void daemon_init_tokens(struct daemon *d)
{
    static const char tokens[] = "# who may do what\n"
                                 "view-token-1 view anna\n"
                                 "edit-token-1 edit bert\n"
                                 "admin-token-1 admin\n";
    char path[160];
    daemon_init(d);
    daemon_write(d, "tokens", tokens);
    snprintf(path, sizeof path, "%s/tokens", d->folder);
    daemon_option(d, "tokens", path);
    daemon_option(d, "listen", "tcp:127.0.0.1:0");
}

void daemon_option(struct daemon *d, const char *name, const char *value)
{
    char text[640];
    if (value)
        snprintf(text, sizeof text, "--%s=%s", name, value);
    else
        snprintf(text, sizeof text, "--%s", name);
    assert_true(d->arg_count < 63);
    d->args[d->arg_count++] = strdup(text);
}

// A failed test jumps over daemon_finish: nothing may stay behind.
static pid_t running;
static char running_folder[TEST_FOLDER_MAX];

static void kill_running(void)
{
    if (!running)
        return;
    kill(running, SIGKILL);
    waitpid(running, NULL, 0);
    if (!test_folder_remove(running_folder))
        fprintf(stderr, "cannot remove %s\n", running_folder);
    running = 0;
}

void daemon_watch(struct daemon *d)
{
    static bool registered;
    if (!registered)
        atexit(kill_running);
    registered = true;
    kill_running();
    running = d->pid;
    snprintf(running_folder, sizeof running_folder, "%s", d->folder);
}

static void spawn_daemon(struct daemon *d)
{
    posix_spawn_file_actions_t actions;
    char log[128], out[128];
    path_in(d, "log", log, sizeof log);
    path_in(d, "out", out, sizeof out);
    setenv("HELIO_FAKE_DIR", d->folder, 1);
    posix_spawn_file_actions_init(&actions);
    posix_spawn_file_actions_addopen(&actions, 1, out, O_WRONLY | O_CREAT | O_TRUNC, 0600);
    posix_spawn_file_actions_addopen(&actions, 2, log, O_WRONLY | O_CREAT | O_APPEND, 0600);
    if (d->passed_fd) {
        posix_spawn_file_actions_adddup2(&actions, d->passed_fd, 3);
        setenv("LISTEN_FDS", "1", 1);
    }
    // LISTEN_PID must be the daemon's own number, which only the child knows.
    char *args[70] = {"/bin/sh", "-c", "export LISTEN_PID=$$; exec \"$@\"", "sh"};
    memcpy(args + 4, d->args, sizeof d->args[0] * (size_t)d->arg_count);
    assert_int_equal(posix_spawn(&d->pid, args[0], &actions, NULL, args, environ), 0);
    posix_spawn_file_actions_destroy(&actions);
    unsetenv("LISTEN_FDS");
    if (!running || strcmp(running_folder, d->folder) != 0) // of a test that failed
        daemon_watch(d);
}

void daemon_start(struct daemon *d)
{
    char port_file[128];
    path_in(d, "port", port_file, sizeof port_file);
    daemon_option(d, "port-file", port_file);
    spawn_daemon(d);
    uint64_t deadline_ns = deadline_after(PATIENCE_MS);
    while (!daemon_has_file(d, "port")) { // written when it listens
        int status;
        if (waitpid(d->pid, &status, WNOHANG) == d->pid) {
            running = running == d->pid ? 0 : running;
            d->pid = 0;
            char *log = daemon_read(d, "log"); // its end: a message has 1 KiB
            size_t length = strlen(log);
            fail_msg("heliod ended at start (status 0x%x):\n%s", status,
                length > 900 ? log + length - 900 : log);
        }
        assert_true(hg_clock_now_ns() < deadline_ns);
        hg_clock_sleep_ns(STEP_NS);
    }
    char *text = daemon_read(d, "port");
    d->port = atoi(text);
    free(text);
}

void daemon_begin(struct daemon *d)
{
    daemon_init(d);
    daemon_start(d);
}

int daemon_run(struct daemon *d)
{
    spawn_daemon(d);
    return daemon_wait(d);
}

void daemon_signal(struct daemon *d, int number)
{
    assert_int_equal(kill(d->pid, number), 0);
}

int daemon_wait(struct daemon *d)
{
    uint64_t deadline_ns = deadline_after(PATIENCE_MS);
    int status;
    while (waitpid(d->pid, &status, WNOHANG) != d->pid) {
        if (hg_clock_now_ns() > deadline_ns)
            fail_msg("heliod does not end:\n%s", daemon_read(d, "log"));
        hg_clock_sleep_ns(STEP_NS);
    }
    running = running == d->pid ? 0 : running;
    d->pid = 0;
    if (!WIFEXITED(status))
        fail_msg("heliod crashed (signal %d):\n%s", WTERMSIG(status), daemon_read(d, "log"));
    return WEXITSTATUS(status);
}

void daemon_reap(struct daemon *d)
{
    assert_int_equal(waitpid(d->pid, NULL, 0), d->pid);
    running = running == d->pid ? 0 : running;
    d->pid = 0;
    char path[160];
    path_in(d, "port", path, sizeof path);
    unlink(path);
}

void daemon_finish(struct daemon *d)
{
    bool crashed = false;
    if (d->pid) {
        int status;
        crashed = waitpid(d->pid, &status, WNOHANG) == d->pid;
        kill(d->pid, SIGKILL);
        waitpid(d->pid, NULL, 0);
    }
    if (strcmp(running_folder, d->folder) == 0)
        running = 0;
    if (crashed)
        fprintf(stderr, "%s\n", daemon_read(d, "log"));
    for (int i = 0; i < d->arg_count; i++)
        free(d->args[i]);
    // A worker whose daemon was killed may still be writing its last file.
    for (int tries = 0; !test_folder_remove(d->folder) && tries < 100; tries++)
        hg_clock_sleep_ns(STEP_NS);
    assert_false(crashed);
}

void daemon_write(struct daemon *d, const char *name, const char *text)
{
    char path[160];
    path_in(d, name, path, sizeof path);
    int fd = open(path, O_WRONLY | O_CREAT | O_TRUNC, 0600);
    assert_true(fd >= 0);
    assert_int_equal(write(fd, text, strlen(text)), strlen(text));
    close(fd);
}

size_t daemon_file_size(struct daemon *d, const char *name)
{
    char path[160];
    struct stat st;
    path_in(d, name, path, sizeof path);
    return stat(path, &st) == 0 ? (size_t)st.st_size : 0;
}

bool daemon_has_file(struct daemon *d, const char *name)
{
    char path[160];
    path_in(d, name, path, sizeof path);
    return access(path, F_OK) == 0;
}

char *daemon_read(struct daemon *d, const char *name)
{
    char path[160];
    path_in(d, name, path, sizeof path);
    size_t size = daemon_file_size(d, name);
    char *text = calloc(size + 1, 1);
    int fd = open(path, O_RDONLY);
    if (fd >= 0) {
        ssize_t n = read(fd, text, size);
        text[n > 0 ? n : 0] = 0;
        close(fd);
    }
    return text;
}

void daemon_wait_log(struct daemon *d, const char *wanted)
{
    uint64_t deadline_ns = deadline_after(PATIENCE_MS);
    for (;;) {
        char *text = daemon_read(d, "log");
        bool found = strstr(text, wanted) != NULL;
        if (!found && hg_clock_now_ns() > deadline_ns)
            fail_msg("the log never says '%s':\n%s", wanted, text);
        free(text);
        if (found)
            return;
        hg_clock_sleep_ns(STEP_NS);
    }
}

// "worker PID ready" of the newest worker in the log.
pid_t daemon_worker(struct daemon *d, pid_t other_than)
{
    uint64_t deadline_ns = deadline_after(PATIENCE_MS);
    for (;;) {
        char *text = daemon_read(d, "log");
        pid_t pid = 0;
        for (char *at = text; (at = strstr(at, "msg=\"worker ")); at++) {
            int value, end = 0;
            if (sscanf(at, "msg=\"worker %d ready%n", &value, &end) == 1 && end)
                pid = value;
        }
        if (!pid || pid == other_than) {
            if (hg_clock_now_ns() > deadline_ns)
                fail_msg("no (new) worker:\n%s", text);
            pid = 0;
        }
        free(text);
        if (pid)
            return pid;
        hg_clock_sleep_ns(STEP_NS);
    }
}

uint64_t daemon_allowed(uint64_t bytes)
{
#if defined(__SANITIZE_THREAD__) || defined(__SANITIZE_ADDRESS__)
    return bytes * 5 + (UINT64_C(512) << 20); // shadow memory, quarantine
#else
    return bytes;
#endif
}

double daemon_cpu_s(pid_t pid)
{
    char path[64], line[1024] = "";
    unsigned long user = 0, kernel = 0;
    snprintf(path, sizeof path, "/proc/%d/stat", (int)pid);
    FILE *file = fopen(path, "re");
    assert_non_null(file);
    assert_non_null(fgets(line, sizeof line, file));
    fclose(file);
    const char *rest = strrchr(line, ')');
    assert_non_null(rest);
    assert_int_equal(
        sscanf(rest + 1, " %*c %*d %*d %*d %*d %*d %*u %*u %*u %*u %*u %lu %lu", &user, &kernel),
        2);
    return (double)(user + kernel) / (double)sysconf(_SC_CLK_TCK);
}

uint64_t daemon_rss_bytes(struct daemon *d)
{
    char path[64];
    unsigned long long size, resident = 0;
    snprintf(path, sizeof path, "/proc/%d/statm", (int)d->pid);
    FILE *file = fopen(path, "r");
    assert_non_null(file);
    assert_int_equal(fscanf(file, "%llu %llu", &size, &resident), 2);
    fclose(file);
    return resident * (uint64_t)sysconf(_SC_PAGESIZE);
}

// ---- connections --------------------------------------------------------------------------------

void peer_connect(struct peer *p, struct daemon *d, bool tcp)
{
    struct sockaddr_un sun = {.sun_family = AF_UNIX};
    struct sockaddr_in sin = {.sin_family = AF_INET,
        .sin_port = htons((uint16_t)d->port),
        .sin_addr.s_addr = htonl(INADDR_LOOPBACK)};
    *p = (struct peer){.next_request = 1};
    path_in(d, "sock", sun.sun_path, sizeof sun.sun_path);
    p->fd = socket(tcp ? AF_INET : AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
    assert_true(p->fd >= 0);
    const struct sockaddr *name = tcp ? (void *)&sin : (void *)&sun;
    const int on = 1; // small messages do not wait for the answers to those before
    if (tcp)
        setsockopt(p->fd, IPPROTO_TCP, TCP_NODELAY, &on, sizeof on);
    if (connect(p->fd, name, tcp ? sizeof sin : sizeof sun) != 0)
        fail_msg("cannot connect: %s", strerror(errno));
}

void peer_raw(struct peer *p, const void *data, size_t size)
{
    for (size_t done = 0; done < size;) {
        ssize_t n = send(p->fd, (const char *)data + done, size - done, MSG_NOSIGNAL);
        if (n <= 0)
            return; // the daemon may have closed already; the answer tells
        done += (size_t)n;
    }
}

static void send_message(struct peer *p, enum hgp_type type, uint32_t request, const void *message)
{
    struct hg_writer w = {0};
    struct hgp_fault fault = {0};
    if (hgp_encode(&w, 1, (struct hgp_envelope){type, request, 0}, message, &fault))
        fail_msg("cannot encode: %s %s", fault.field, fault.reason);
    peer_raw(p, w.data, w.size);
    hg_writer_finish(&w);
}

uint32_t peer_send(struct peer *p, enum hgp_type type, const void *message)
{
    uint32_t request = p->next_request++;
    send_message(p, type, request, message);
    return request;
}

void peer_tell(struct peer *p, enum hgp_type type, const void *message)
{
    send_message(p, type, 0, message);
}

// False: closed, or nothing within the time.
static bool read_all(struct peer *p, void *data, size_t size, int timeout_ms)
{
    uint64_t deadline_ns = deadline_after(timeout_ms);
    for (size_t done = 0; done < size;) {
        struct pollfd poll_fd = {p->fd, POLLIN, 0};
        uint64_t now_ns = hg_clock_now_ns();
        int left = now_ns < deadline_ns ? (int)((deadline_ns - now_ns) / 1000000) : 0;
        if (poll(&poll_fd, 1, left) <= 0)
            return false;
        ssize_t n = recv(p->fd, (char *)data + done, size - done, 0);
        if (n <= 0)
            return false;
        done += (size_t)n;
    }
    return true;
}

bool peer_next_within(struct peer *p, int timeout_ms)
{
    uint8_t header[HGP_HEADER_BYTES];
    struct hgp_fault fault = {0};
    free(p->payload);
    p->payload = NULL;
    hg_arena_finish(&p->arena);
    if (!read_all(p, header, sizeof header, timeout_ms))
        return false;
    assert_int_equal(hgp_header_decode(header, sizeof header, UINT32_MAX, &p->header), HG_OK);
    assert_int_equal(p->header.channel, 0);
    p->payload = malloc(p->header.length + 1u);
    assert_non_null(p->payload);
    if (!read_all(p, p->payload, p->header.length, PATIENCE_MS))
        fail_msg("the stream ends inside a message");
    if (hgp_decode(1, p->header.type, hg_reader_make(p->payload, p->header.length), &p->arena,
            &p->m, &fault))
        fail_msg("the daemon sent nonsense: %s %s", fault.field, fault.reason);
    if (p->header.type != HGP_T_limited)
        return true;
    snprintf(
        p->limit, sizeof p->limit, "%.*s", (int)p->m.limited.limit.size, p->m.limited.limit.data);
    p->retry_after_ms = p->m.limited.retry_after_ms;
    return peer_next_within(p, PATIENCE_MS); // the error that it is of
}

bool peer_next(struct peer *p)
{
    struct pollfd poll_fd = {p->fd, POLLIN, 0};
    if (poll(&poll_fd, 1, PATIENCE_MS) == 0)
        fail_msg("the daemon is silent");
    return peer_next_within(p, PATIENCE_MS);
}

static void next_final(struct peer *p, uint32_t request)
{
    do
        if (!peer_next(p))
            fail_msg("the daemon closed the connection instead of answering");
    while (p->header.request != request || p->header.type == HGP_T_progress ||
           (p->header.type == HGP_T_notice && request));
}

void peer_answer(struct peer *p, uint32_t request, enum hgp_type type)
{
    next_final(p, request);
    if (p->header.type == HGP_T_error && type != HGP_T_error)
        fail_msg("refused: %.*s %.*s: %.*s", (int)p->m.error.what.size, p->m.error.what.data,
            (int)p->m.error.where.size, p->m.error.where.data, (int)p->m.error.reason.size,
            p->m.error.reason.data);
    assert_int_equal(p->header.type, type);
}

void peer_error(struct peer *p, uint32_t request, enum hg_status status)
{
    next_final(p, request);
    assert_int_equal(p->header.type, HGP_T_error);
    if (p->m.error.code != status)
        fail_msg("error %u, not %u: %.*s", p->m.error.code, status, (int)p->m.error.reason.size,
            p->m.error.reason.data);
}

void peer_call(struct peer *p, enum hgp_type type, const void *message, enum hgp_type answer)
{
    peer_answer(p, peer_send(p, type, message), answer);
}

void peer_refused(struct peer *p, enum hgp_type type, const void *message, enum hg_status status)
{
    peer_error(p, peer_send(p, type, message), status);
}

void peer_hello(struct peer *p)
{
    peer_raw(p, HGP_PREFACE, HGP_PREFACE_BYTES);
    peer_tell(p, HGP_T_hello,
        &(struct hgp_hello){
            .version_min = 1, .version_max = 1, .client = hgp_str_make("system test")});
    assert_true(peer_next(p));
    assert_int_equal(p->header.type, HGP_T_welcome);
    p->session = p->m.welcome.session;
}

void peer_auth(struct peer *p, const char *token)
{
    peer_tell(p, HGP_T_auth, &(struct hgp_auth){.token = hgp_str_make(token)});
}

void peer_open(struct peer *p, struct daemon *d)
{
    peer_connect(p, d, false);
    peer_hello(p);
    assert_false(p->m.welcome.auth_required);
}

void peer_enter(struct peer *p, struct daemon *d, const char *token)
{
    peer_connect(p, d, true);
    peer_hello(p);
    peer_auth(p, token);
    assert_true(peer_next(p));
    assert_int_equal(p->header.type, HGP_T_auth_ok);
}

bool peer_says(const struct peer *p, const char *text)
{
    const struct hgp_str *reason = &p->m.error.reason;
    return memmem(reason->data, reason->size, text, strlen(text)) != NULL;
}

void peer_scene(struct peer *p, const char *name)
{
    peer_call(p, HGP_T_scene_open, &(struct hgp_scene_open){.name = hgp_str_make(name)},
        HGP_T_scene_opened);
    p->first_id = p->m.scene_opened.first_id;
}

void peer_open_scene(struct peer *p, struct daemon *d, const char *name)
{
    peer_open(p, d);
    peer_scene(p, name);
}

bool peer_has_upload(struct peer *p, const uint8_t hash[32])
{
    struct hgp_content content;
    memcpy(content.hash, hash, 32);
    peer_call(p, HGP_T_upload_query, &(struct hgp_upload_query){.contents = {&content, 1}},
        HGP_T_upload_have);
    return p->m.upload_have.have.items[0].value;
}

void peer_view(struct peer *p, uint32_t view, uint32_t width, uint32_t height)
{
    peer_call(p, HGP_T_view_set,
        &(struct hgp_view_set){
            .view = view, .has_width = true, .width = width, .has_height = true, .height = height},
        HGP_T_ok);
}

void peer_open_view(struct peer *p, struct daemon *d, uint32_t width, uint32_t height)
{
    peer_open_scene(p, d, "");
    peer_view(p, 1, width, height);
}

void peer_close(struct peer *p)
{
    if (p->fd >= 0)
        close(p->fd);
    p->fd = -1;
    free(p->payload);
    p->payload = NULL;
    hg_arena_finish(&p->arena);
}

void peer_end(struct peer *p)
{
    while (peer_next(p))
        ;
    char byte;
    assert_true(recv(p->fd, &byte, 1, MSG_DONTWAIT) <= 0 && errno != EAGAIN);
}

// ---- metrics ------------------------------------------------------------------------------------

double daemon_metric(struct daemon *d, const char *name)
{
    enum { MOST = 1 << 17 };
    static const char get[] =
        "GET /metrics HTTP/1.1\r\nHost: 127.0.0.1\r\nConnection: close\r\n\r\n";
    struct peer p = {0};
    char *text = calloc(MOST, 1), line[256];
    size_t size = 0;
    assert_non_null(text);
    peer_connect(&p, d, true);
    peer_raw(&p, get, sizeof get - 1);
    for (ssize_t n; size < MOST - 1 && (n = read(p.fd, text + size, MOST - 1 - size)) > 0;)
        size += (size_t)n;
    peer_close(&p);
    snprintf(line, sizeof line, "\n%s ", name);
    const char *at = strstr(text, line);
    if (!at)
        fail_msg("no metric %s in: %.300s", name, text);
    const double value = strtod(at + strlen(line), NULL);
    free(text);
    return value;
}
