// loader_client.c - starts loaders, sends them requests, waits for what comes of it, and says in
// words what became of those that were killed.
#include "server/loader/loader_client.h"

#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <pthread.h>
#include <signal.h>
#include <stdio.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include "base/alloc.h"
#include "base/clock.h"
#include "base/file.h"
#include "base/isolate.h"
#include "base/log.h"
#include "base/program.h"
#include "server/loader/wire.h"

enum { TICK_MS = 20, LINK_FD = 3, START_MS = 60000 };

struct hg_isolated {
    int fd; // -1: it has ended
    char name[LOADER_NAME_BYTES];
};

static struct {
    int link; // to the spawner
    pthread_mutex_t lock;
    struct loader_options options;
    struct hg_isolate_ops ops;
} loaders = {.link = -1, .lock = PTHREAD_MUTEX_INITIALIZER};

// ---- the spawner -------------------------------------------------------------------------------

struct arguments {
    char path[4096], cpu[16], memory[16];
    const char *items[16];
};

static void make_arguments(struct arguments *a)
{
    const struct loader_options *o = &loaders.options;
    hg_program_path("HELIO_LOADER", "helio-loader", a->path, sizeof a->path);
    snprintf(a->cpu, sizeof a->cpu, "%u", o->cpu_s);
    snprintf(a->memory, sizeof a->memory, "%u", o->memory_mib);
    int n = 0;
    const char *const items[] = {
        a->path, "--cpu", a->cpu, "--memory", a->memory, "--sandbox", o->sandbox};
    for (size_t i = 0; i < sizeof items / sizeof *items; i++)
        a->items[n++] = items[i];
    if (o->log) {
        a->items[n++] = "--log";
        a->items[n++] = o->log;
    }
    a->items[n] = NULL;
}

// The child of the fork: waits until a loader is needed, and becomes helio-loader then. It has the
// link and the log, and ends with the worker.
static _Noreturn void wait_and_exec(const struct arguments *a, int fd, pid_t parent)
{
    prctl(PR_SET_NAME, "helio-loader");
    prctl(PR_SET_PDEATHSIG, SIGKILL);
    if (getppid() != parent || dup2(fd, LINK_FD) < 0 || close_range(LINK_FD + 1, ~0u, 0) != 0)
        _exit(1);
    struct pollfd link = {.fd = LINK_FD, .events = POLLIN};
    while (poll(&link, 1, -1) < 0 && errno == EINTR)
        ;
    // A link that was closed can be read from, too: nothing will be asked for.
    if ((link.revents & (POLLIN | POLLHUP)) == POLLIN)
        execv(a->path, (char *const *)a->items);
    _exit(1);
}

static enum hg_status receive_socket(int link, int *out)
{
    struct loader_spawned answer;
    _Alignas(struct cmsghdr) char control[CMSG_SPACE(sizeof(int))];
    struct iovec part = {&answer, sizeof answer};
    struct msghdr message = {.msg_iov = &part,
        .msg_iovlen = 1,
        .msg_control = control,
        .msg_controllen = sizeof control};
    struct pollfd ready = {.fd = link, .events = POLLIN};
    ssize_t n = -1;
    if (poll(&ready, 1, START_MS) == 1)
        n = recvmsg(link, &message, MSG_CMSG_CLOEXEC | MSG_DONTWAIT);
    const struct cmsghdr *head = n == sizeof answer ? CMSG_FIRSTHDR(&message) : NULL;
    if (n == sizeof answer && answer.error)
        return answer.error == EAGAIN ? HG_E_LIMIT : HG_E_WORKER;
    if (!head || head->cmsg_type != SCM_RIGHTS || head->cmsg_len != CMSG_LEN(sizeof(int)))
        return HG_E_WORKER;
    memcpy(out, CMSG_DATA(head), sizeof *out);
    return HG_OK;
}

static enum hg_status open_process(
    void *user, const char *name, struct hg_isolated **out, struct hg_error *err)
{
    (void)user;
    *out = hg_calloc(1, sizeof **out);
    if (!*out)
        return hg_error_set(err, HG_E_NOMEM, name, NULL, "no memory for a loader");
    (*out)->fd = -1;
    snprintf((*out)->name, sizeof(*out)->name, "%s", name);
    pthread_mutex_lock(&loaders.lock);
    enum hg_status status = send(loaders.link, "", 1, MSG_NOSIGNAL) == 1 ? HG_OK : HG_E_WORKER;
    if (!status)
        status = receive_socket(loaders.link, &(*out)->fd);
    pthread_mutex_unlock(&loaders.lock);
    if (!status)
        return HG_OK;
    hg_free(*out);
    *out = NULL;
    return hg_error_set(err, status, name, NULL,
        status == HG_E_LIMIT ? "too many files of foreign formats are open"
                             : "no process can be started to read it in (helio-loader)");
}

static void end_process(struct hg_isolated *p)
{
    if (p->fd >= 0)
        close(p->fd); // the spawner sees it and kills the process
    p->fd = -1;
}

static void close_process(struct hg_isolated *p)
{
    if (!p)
        return;
    end_process(p);
    hg_free(p);
}

// ---- requests ----------------------------------------------------------------------------------

static bool write_all(int fd, const uint8_t *data, size_t size)
{
    while (size) {
        ssize_t n = write(fd, data, size);
        if (n < 0 && errno == EINTR)
            continue;
        if (n <= 0)
            return false;
        data += n;
        size -= (size_t)n;
    }
    return true;
}

// A copy of the data in a file that is not changed any more. -1: no memory.
static int seal_copy(const struct hg_isolate_call *call)
{
    int fd = memfd_create("helio-data", MFD_CLOEXEC | MFD_ALLOW_SEALING);
    if (fd >= 0 && (!write_all(fd, call->data, call->data_size) ||
                       fcntl(fd, F_ADD_SEALS,
                           F_SEAL_WRITE | F_SEAL_GROW | F_SEAL_SHRINK | F_SEAL_SEAL) != 0)) {
        close(fd);
        return -1;
    }
    return fd;
}

static bool send_packet(
    const struct hg_isolated *p, const struct hg_isolate_call *call, const int fds[2], int count)
{
    struct loader_request head = {.op = call->op,
        .args_size = (uint32_t)call->args_size,
        .data_size = call->data_size,
        .has_data = call->data != NULL,
        .has_file = !call->data && call->file > 0};
    memcpy(head.name, p->name, sizeof head.name);
    _Alignas(struct cmsghdr) char control[CMSG_SPACE(2 * sizeof(int))] = {0};
    struct iovec parts[] = {
        {&head, offsetof(struct loader_request, args)}, {(void *)call->args, call->args_size}};
    struct msghdr message = {.msg_iov = parts,
        .msg_iovlen = 2,
        .msg_control = control,
        .msg_controllen = CMSG_SPACE((size_t)count * sizeof(int))};
    struct cmsghdr *rights = CMSG_FIRSTHDR(&message);
    rights->cmsg_level = SOL_SOCKET;
    rights->cmsg_type = SCM_RIGHTS;
    rights->cmsg_len = CMSG_LEN((size_t)count * sizeof(int));
    memcpy(CMSG_DATA(rights), fds, (size_t)count * sizeof(int));
    // A loader that has ended says so in its reply.
    return sendmsg(p->fd, &message, MSG_NOSIGNAL) > 0 || errno == EPIPE || errno == ECONNRESET;
}

// *result: the file that it is to be written to.
static enum hg_status send_request(const struct hg_isolated *p, const struct hg_isolate_call *call,
    int *result, struct hg_error *err)
{
    int fds[2], count = 0, copy = -1;
    bool sent = false;
    *result = memfd_create("helio-result", MFD_CLOEXEC | MFD_ALLOW_SEALING);
    if (call->data)
        fds[count++] = copy = seal_copy(call);
    else if (call->file > 0)
        fds[count++] = call->file;
    if (*result >= 0 && (!call->data || copy >= 0)) {
        fds[count++] = *result;
        sent = send_packet(p, call, fds, count);
    }
    if (copy >= 0)
        close(copy);
    if (sent)
        return HG_OK;
    if (*result >= 0)
        close(*result);
    *result = -1;
    return hg_error_set(err, HG_E_NOMEM, p->name, NULL, "no memory to read it in another process");
}

// ---- replies -----------------------------------------------------------------------------------

static enum hg_status describe_signal(int number, const char *name, struct hg_error *err)
{
    const struct loader_options *o = &loaders.options;
    if (number == SIGXCPU)
        return hg_error_set(err, HG_E_LIMIT, name, NULL,
            "reading it took more than %u s of processor time (loader-cpu)", o->cpu_s);
    if (number == SIGKILL)
        return hg_error_set(err, HG_E_LIMIT, name, NULL,
            "its reader was killed: processor time or memory ran out (loader-cpu, loader-memory)");
    return hg_error_set(err, HG_E_FORMAT, name, NULL,
        "the reader of its format crashed on it (signal %d, %s)", number, strsignal(number));
}

static enum hg_status describe_end(int how, const char *name, struct hg_error *err)
{
    if (WIFSIGNALED(how))
        return describe_signal(WTERMSIG(how), name, err);
    switch (WIFEXITED(how) ? WEXITSTATUS(how) : 0) {
    case LOADER_EXIT_MEMORY:
        return hg_error_set(err, HG_E_LIMIT, name, NULL,
            "reading it takes more than %u MiB of memory (loader-memory)",
            loaders.options.memory_mib);
    case LOADER_EXIT_SANDBOX:
        return hg_error_set(err, HG_E_UNSUPPORTED, name, NULL,
            "its reader cannot be confined on this machine; --sandbox best-effort goes without");
    default:
        return hg_error_set(err, HG_E_FORMAT, name, NULL,
            "the reader of its format crashed on it (exit code %d)", WEXITSTATUS(how));
    }
}

static enum hg_status describe_reply(
    const struct loader_reply *reply, const char *name, struct hg_error *err)
{
    if (reply->ended)
        return describe_end(reply->how, name, err);
    struct hg_error told = reply->err; // a stranger's words: cut, and made UTF-8 by hg_error_set
    told.what[sizeof told.what - 1] = told.where[sizeof told.where - 1] =
        told.reason[sizeof told.reason - 1] = 0;
    enum hg_status status = HG_E_FORMAT;
    if (reply->status == HG_E_LIMIT || reply->status == HG_E_NOMEM ||
        reply->status == HG_E_UNSUPPORTED || reply->status == HG_E_NOTFOUND)
        status = (enum hg_status)reply->status;
    return hg_error_set(
        err, status, name, told.where, "%s", told.reason[0] ? told.reason : hg_status_text(status));
}

// Maps what the loader has written, once it can change it no more.
static enum hg_status take_result(const struct hg_isolated *p, int result, uint64_t size,
    struct hg_isolate_result *out, struct hg_error *err)
{
    const bool sealed =
        fcntl(result, F_ADD_SEALS, F_SEAL_WRITE | F_SEAL_GROW | F_SEAL_SHRINK | F_SEAL_SEAL) == 0;
    const off_t end = lseek(result, 0, SEEK_END);
    if (!sealed || end < 0 || (uint64_t)end != size)
        return hg_error_set(
            err, HG_E_FORMAT, p->name, NULL, "the reader of its format broke the rules");
    out->size = (size_t)size;
    if (size == 0)
        return HG_OK;
    void *data = mmap(NULL, (size_t)size, PROT_READ, MAP_PRIVATE, result, 0);
    if (data == MAP_FAILED) {
        out->size = 0;
        return hg_error_set(err, HG_E_NOMEM, p->name, NULL, "no memory for what it holds");
    }
    out->data = data;
    return HG_OK;
}

static void release_result(struct hg_isolate_result *result)
{
    if (result->data)
        munmap((void *)result->data, result->size);
    *result = (struct hg_isolate_result){0};
}

static enum hg_status await_reply(struct hg_isolated *p, const struct hg_isolate_call *call,
    struct loader_reply *reply, struct hg_error *err)
{
    const double seconds = loaders.options.timeout_s;
    const uint64_t deadline_ns = hg_clock_now_ns() + (uint64_t)(seconds * 1e9);
    struct pollfd link = {.fd = p->fd, .events = POLLIN};
    while (poll(&link, 1, TICK_MS) <= 0) {
        if (hg_isolate_is_stopped() || (call->go_on && !call->go_on(call->user)))
            return hg_error_set(err, HG_E_CANCELLED, p->name, NULL, "cancelled");
        if (hg_clock_now_ns() > deadline_ns)
            return hg_error_set(err, HG_E_LIMIT, p->name, NULL,
                "reading it did not end within %g s (loader-timeout)", seconds);
    }
    ssize_t n = recv(p->fd, reply, sizeof *reply, MSG_DONTWAIT);
    if (n < 0 && errno == ECONNRESET) // it ended before it read the request; how comes behind that
        n = recv(p->fd, reply, sizeof *reply, MSG_DONTWAIT);
    if (n != sizeof *reply)
        return describe_end(0, p->name, err);
    return HG_OK;
}

static enum hg_status call_process(struct hg_isolated *p, const struct hg_isolate_call *call,
    struct hg_isolate_result *out, struct hg_error *err)
{
    struct loader_reply reply;
    int result;
    *out = (struct hg_isolate_result){0};
    if (p->fd < 0)
        return hg_error_set(err, HG_E_FORMAT, p->name, NULL, "its reader has ended");
    enum hg_status status = send_request(p, call, &result, err);
    bool lives = status == HG_OK;
    if (!status) {
        status = await_reply(p, call, &reply, err);
        lives = !status && !reply.ended;
    }
    if (!status && (reply.ended || reply.status))
        status = describe_reply(&reply, p->name, err);
    else if (!status)
        status = take_result(p, result, reply.size, out, err);
    if (result >= 0)
        close(result);
    if (!lives) {
        end_process(p);
        if (err && status != HG_E_CANCELLED)
            hg_warn(SCENE, "loader ended: %s: %s", err->what, err->reason);
    }
    return status;
}

// ---- starting ----------------------------------------------------------------------------------

enum hg_status hg_loader_start(const struct loader_options *options, struct hg_error *err)
{
    int pair[2];
    struct arguments arguments;
    loaders.options = *options;
    if (!options->cpu_s)
        loaders.options.cpu_s = LOADER_CPU_S;
    if (!options->memory_mib)
        loaders.options.memory_mib = LOADER_MEMORY_MIB;
    if (!(options->timeout_s > 0))
        loaders.options.timeout_s = LOADER_TIMEOUT_S;
    make_arguments(&arguments);
    if (access(arguments.path, X_OK) != 0)
        return hg_error_set(err, hg_status_from_errno(errno), arguments.path, NULL,
            "the program that reads foreign formats: %s", strerror(errno));
    const pid_t self = getpid();
    pid_t pid = -1;
    if (socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0, pair) == 0 && (pid = fork()) == 0)
        wait_and_exec(&arguments, pair[1], self);
    if (pid < 0)
        return hg_error_set(
            err, HG_E_WORKER, "helio-loader", NULL, "cannot start it: %s", strerror(errno));
    close(pair[1]);
    loaders.link = pair[0];
    loaders.ops = (struct hg_isolate_ops){.open = open_process,
        .call = call_process,
        .close = close_process,
        .release = release_result};
    hg_isolate_set(&loaders.ops);
    return HG_OK;
}
