#include <setjmp.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cmocka.h>

#include "base/alloc.h"
#include "base/clock.h"
#include "server/broker/broker.h"
#include "tests/system/forked_daemon.h"

enum { PATIENCE_MS = 30000 };

static int run(struct daemon *d, const struct forked_daemon_options *o)
{
    struct hg_options options;
    struct hg_error err;
    char log[128];
    snprintf(log, sizeof log, "%s/log", d->folder);
    if (!freopen(log, "a", stderr) || !freopen("/dev/null", "w", stdout))
        return 99;
    hg_log_set_sink(hg_log_sink_logfmt, (void *)(intptr_t)STDERR_FILENO);
    hg_alloc_fail_at(o->fail_at);
    if (hg_options_parse(d->arg_count, d->args, &options, &err))
        return 98;
    if (options.log && hg_log_configure(options.log, &err))
        return 96;
    return hg_broker_run(&options, d->arg_count, d->args);
}

void forked_daemon_begin(struct daemon *d, const struct forked_daemon_options *options)
{
    char port[128];
    snprintf(port, sizeof port, "%s/port", d->folder);
    daemon_option(d, "port-file", port);
    setenv("HELIO_FAKE_DIR", d->folder, 1);
    pid_t pid = fork();
    assert_true(pid >= 0);
    if (!pid) {
        int code = run(d, options);
        uint64_t count = hg_alloc_count();
        if (options->count_fd &&
            write(options->count_fd, &count, sizeof count) != (ssize_t)sizeof count)
            code = 97;
        _exit(code);
    }
    d->pid = pid;
    daemon_watch(d);
}

bool forked_daemon_listens(struct daemon *d)
{
    for (int tries = 0; tries < PATIENCE_MS; tries++) {
        siginfo_t info = {0};
        if (waitid(P_PID, (id_t)d->pid, &info, WEXITED | WNOHANG | WNOWAIT) == 0 && info.si_pid)
            return false; // refused to start
        if (daemon_has_file(d, "port"))
            return true;
        hg_clock_sleep_ns(1000000);
    }
    fail_msg("neither listening nor ended");
    return false;
}
