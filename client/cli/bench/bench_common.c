#include "client/cli/bench/bench_common.h"

#include <errno.h>
#include <fcntl.h>
#include <ftw.h>
#include <libgen.h>
#include <limits.h>
#include <signal.h>
#include <spawn.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>
#include <unistd.h>

#include "base/clock.h"
#include "base/file.h"
#include "base/program.h"

extern char **environ;

enum { WAIT_NS = 10000000, ARGS = 32 };
#define START_NS  60000000000u
#define STOP_NS   10000000000u // until a daemon that does not end is killed
#define AGAIN_NS  500000000u   // signals that come close to each other may arrive as one
#define PATIENT_S 600.0

uint64_t hg_bench_wait_ns(const struct hg_cli *cli)
{
    const double s = cli->options->has_timeout ? cli->options->timeout : PATIENT_S;
    return (uint64_t)(s * 1e9);
}

enum hg_status hg_bench_scene_find(
    struct hg_bench_scene *scene, const char *name, struct hg_error *err)
{
    char full[PATH_MAX], folder[PATH_MAX];
    const size_t length = strlen(name);
    *scene = (struct hg_bench_scene){0};
    if (length > 0 && length < sizeof scene->path && name[length - 1] == ':') {
        memcpy(scene->path, name, length);
        return HG_OK;
    }
    if (!realpath(name, full))
        return hg_error_set(
            err, hg_status_from_errno(errno), name, NULL, "cannot be read: %s", strerror(errno));
    memcpy(folder, full, sizeof folder);
    snprintf(scene->path, sizeof scene->path, "%s", full);
    snprintf(scene->folder, sizeof scene->folder, "%s", dirname(folder));
    return HG_OK;
}

// ---- the daemon ---------------------------------------------------------------------------------

static enum hg_status make_folder(struct hg_bench_daemon *d, struct hg_error *err)
{
    const char *temp = getenv("TMPDIR");
    snprintf(d->folder, sizeof d->folder, "%s/helio-bench-XXXXXX", temp && *temp ? temp : "/tmp");
    if (mkdtemp(d->folder)) {
        snprintf(d->url, sizeof d->url, "unix:%s/sock", d->folder);
        return HG_OK;
    }
    enum hg_status status = hg_error_set(
        err, hg_status_from_errno(errno), d->folder, NULL, "cannot be made: %s", strerror(errno));
    d->folder[0] = 0;
    return status;
}

static enum hg_status spawn_daemon(struct hg_bench_daemon *d, const char *tokens,
    const char *cache_dir, const char *const *more, struct hg_error *err)
{
    char cache[128], file[128];
    snprintf(cache, sizeof cache, "%s/cache", d->folder);
    snprintf(file, sizeof file, "%s/tokens", d->folder);
    hg_program_path("HELIOD", "../bin/heliod", d->program, sizeof d->program);
    const char *argv[ARGS] = {d->program, "--listen", d->url, "--cache-dir",
        cache_dir ? cache_dir : cache, "--sandbox", "best-effort", "--log", "error"};
    int count = 9;
    if (tokens) {
        enum hg_status status = hg_file_write_atomic(file, tokens, strlen(tokens), err);
        if (status)
            return status;
        argv[count++] = "--tokens";
        argv[count++] = file;
        argv[count++] = "--require-token";
    }
    while (more && *more && count < ARGS - 1)
        argv[count++] = *more++;
    posix_spawn_file_actions_t quiet; // who waits for our output does not wait for the daemon
    int failed = posix_spawn_file_actions_init(&quiet);
    if (!failed)
        failed = posix_spawn_file_actions_addopen(&quiet, 1, "/dev/null", O_WRONLY, 0);
    if (!failed)
        failed = posix_spawn(&d->pid, d->program, &quiet, NULL, (char *const *)argv, environ);
    posix_spawn_file_actions_destroy(&quiet);
    if (!failed)
        return HG_OK;
    d->pid = 0;
    return hg_error_set(err, HG_E_WORKER, d->program, NULL, "cannot start: %s", strerror(failed));
}

// The guard's process: calls only what a fork of a program with threads may call.
static _Noreturn void watch_over(pid_t daemon, int fd)
{
    char byte;
    ssize_t n;
    signal(SIGINT, SIG_IGN);
    signal(SIGTERM, SIG_IGN);
    dup2(fd, 0);
    close_range(1, ~0u, 0);
    while ((n = read(0, &byte, 1)) < 0 && errno == EINTR)
        ;
    for (int i = 0; n == 0 && i < 2 && kill(daemon, SIGTERM) == 0; i++)
        usleep(AGAIN_NS / 1000);
    if (n == 0)
        kill(daemon, SIGKILL);
    _exit(0);
}

// A byte in the pipe: the daemon ended as it should. Its end without one: we did, before it.
static enum hg_status guard(struct hg_bench_daemon *d, struct hg_error *err)
{
    int ends[2];
    if (pipe2(ends, O_CLOEXEC))
        return hg_error_set(err, hg_status_from_errno(errno), d->program, NULL,
            "no pipe to watch over it: %s", strerror(errno));
    d->guard_pid = fork();
    if (d->guard_pid == 0)
        watch_over(d->pid, ends[0]);
    close(ends[0]);
    d->guard_fd = ends[1];
    if (d->guard_pid > 0)
        return HG_OK;
    close(ends[1]);
    d->guard_pid = 0;
    return hg_error_set(err, hg_status_from_errno(errno), d->program, NULL,
        "nothing to watch over it: %s", strerror(errno));
}

static void dismiss_guard(struct hg_bench_daemon *d)
{
    if (!d->guard_pid)
        return;
    const bool told = write(d->guard_fd, "", 1) == 1;
    close(d->guard_fd);
    if (told)
        waitpid(d->guard_pid, NULL, 0);
    d->guard_pid = 0;
}

static bool has_ended(struct hg_bench_daemon *d)
{
    if (waitpid(d->pid, NULL, WNOHANG) == 0)
        return false;
    d->pid = 0; // its number may be another process's now
    return true;
}

static enum hg_status await_daemon(
    struct hg_bench_daemon *d, const char *token, struct hg_error *err)
{
    const struct helio_options options = {.url = d->url, .token = token};
    const uint64_t until_ns = hg_clock_now_ns() + START_NS;
    enum hg_status status;
    struct helio *h;
    while ((status = helio_connect(&options, &h, err)) && hg_clock_now_ns() < until_ns &&
           !has_ended(d) && !hg_cli_is_stopped())
        hg_clock_sleep_ns(WAIT_NS);
    helio_destroy(h);
    return status;
}

enum hg_status hg_bench_daemon_start(struct hg_bench_daemon *d, const char *tokens,
    const char *token, const char *cache_dir, const char *const *more, struct hg_error *err)
{
    *d = (struct hg_bench_daemon){0};
    enum hg_status status = make_folder(d, err);
    if (!status)
        status = spawn_daemon(d, tokens, cache_dir, more, err);
    if (!status)
        status = guard(d, err);
    return status ? status : await_daemon(d, token, err);
}

static int remove_one(const char *path, const struct stat *st, int kind, struct FTW *at)
{
    (void)st;
    (void)kind;
    (void)at;
    return remove(path);
}

void hg_bench_daemon_stop(struct hg_bench_daemon *d)
{
    const uint64_t until_ns = hg_clock_now_ns() + STOP_NS;
    uint64_t next_ns = 0;
    for (int sent = 0; d->pid && !has_ended(d); hg_clock_sleep_ns(WAIT_NS)) {
        const uint64_t now_ns = hg_clock_now_ns();
        if (now_ns < next_ns)
            continue;
        kill(d->pid, now_ns > until_ns ? SIGKILL : SIGTERM); // the second does not wait for clients
        next_ns = now_ns + (sent++ ? AGAIN_NS : WAIT_NS);
    }
    dismiss_guard(d);
    if (d->folder[0])
        nftw(d->folder, remove_one, 16, FTW_DEPTH | FTW_PHYS);
    *d = (struct hg_bench_daemon){0};
}

// ---- numbers ------------------------------------------------------------------------------------

static int compare_ns(const void *a, const void *b)
{
    const int64_t x = *(const int64_t *)a, y = *(const int64_t *)b;
    return x < y ? -1 : x > y;
}

static double at_share(const int64_t *ns, uint32_t count, uint32_t percent)
{
    const uint32_t i = (uint32_t)((uint64_t)count * percent / 100);
    return count ? (double)ns[i < count ? i : count - 1] * 1e-6 : 0.0;
}

json_t *hg_bench_percentiles(int64_t *ns, uint32_t count)
{
    qsort(ns, count, sizeof *ns, compare_ns);
    return json_pack("{s:f, s:f, s:f, s:f, s:i}", "p50", at_share(ns, count, 50), "p95",
        at_share(ns, count, 95), "p99", at_share(ns, count, 99), "max", at_share(ns, count, 100),
        "count", (int)count);
}
