#include "client/lib/private_worker.h"

#include <errno.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include "base/alloc.h"
#include "base/clock.h"
#include "base/file.h"
#include "base/program.h"

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

enum hg_status hg_client_worker_start(
    const char *given, const char *const *args, pid_t *pid, int *fd, struct hg_error *err)
{
    static const char what[] = "private worker";
    char path[4096];
    const char **argv;
    int pair[2];
    *pid = 0;
    *fd = -1;
    if (given)
        snprintf(path, sizeof path, "%s", given);
    else
        hg_program_path("HELIO_WORKER", "helio-worker", path, sizeof path);
    if (build_argv(path, args, &argv))
        return hg_error_set(err, HG_E_NOMEM, what, NULL, "no memory for its arguments");
    if (socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, pair)) {
        hg_free(argv);
        return hg_error_set(
            err, hg_status_from_errno(errno), what, NULL, "no socket pair: %s", strerror(errno));
    }
    // Beside the socket the worker has the standard streams, and nothing else.
    const int failed = hg_program_spawn(path, argv, (const int[2]){pair[1], 3}, 4, pid);
    hg_free(argv);
    close(pair[1]);
    if (failed) {
        close(pair[0]);
        // A program that is not there, or none, will not be there the next time.
        const bool permanent =
            failed == ENOENT || failed == EACCES || failed == ENOEXEC || failed == ENOTDIR;
        return hg_error_set(err, permanent ? HG_E_UNSUPPORTED : HG_E_WORKER, path, NULL,
            "cannot start the worker: %s", strerror(failed));
    }
    *fd = pair[0];
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

bool hg_client_worker_reap(pid_t *pid, uint64_t wait_ns, char *text, size_t size)
{
    uint64_t end_ns = hg_clock_now_ns() + wait_ns, step_ns = 200 * 1000;
    int how = 0;
    while (*pid) {
        pid_t got = waitpid(*pid, &how, WNOHANG);
        if (got != 0) {
            *pid = 0;
            if (got > 0)
                describe_end(how, text, size);
            else
                snprintf(text, size, "ended");
            return true;
        }
        if (hg_clock_now_ns() >= end_ns)
            break;
        hg_clock_sleep_ns(step_ns);
        step_ns = step_ns < 10 * 1000 * 1000 ? step_ns * 2 : step_ns;
    }
    return false;
}

void hg_client_worker_stop(pid_t *pid, uint64_t wait_ns)
{
    char text[96];
    int how;
    if (!*pid || hg_client_worker_reap(pid, wait_ns, text, sizeof text))
        return;
    kill(*pid, SIGKILL);
    while (waitpid(*pid, &how, 0) < 0 && errno == EINTR)
        ;
    *pid = 0;
}
