#include "server/broker/state/takeover.h"

#include <errno.h>
#include <spawn.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>
#include <unistd.h>

#include "base/alloc.h"
#include "base/clock.h"
#include "server/broker/state/handover.h"
#include "server/broker/notify.h"

extern char **environ;

enum { MOST_LINKS = 1025, EXIT_START = 4 };

static const char inherited_name[] = "HELIOD_INHERITED";

void hg_takeover_stop(struct hg_takeover *t)
{
    t->deadline_ns = 0;
    t->all.conns->quiet = false;
}

static void give_up(struct hg_takeover *t, const char *reason)
{
    hg_log_write(HG_LOG_ERROR, HG_LOG_MAIN, HG_E_STATE, 0,
        "no new program takes over, everything goes on: %s", reason);
    hg_audit_write(t->audit, "takeover", NULL, HG_E_STATE, reason);
    hg_takeover_stop(t);
    hg_notify_send("READY=1");
}

// Where the state log cannot be written clients would wait for nothing: all of it must be durable.
static bool give_up_on_disk(struct hg_takeover *t)
{
    const enum hg_status status = hg_state_log_refusal(*t->state);
    char reason[160];
    if (!status)
        return false;
    snprintf(reason, sizeof reason, "the state log cannot be written (state-dir): %s",
        hg_status_text(status));
    give_up(t, reason);
    return true;
}

// The program as it is on the disk now: it must at least start, and like the configuration.
void hg_takeover_begin(struct hg_takeover *t)
{
    char *args[1024];
    int count = 0;
    if (t->check_pid || t->deadline_ns || t->all.sessions->draining)
        return;
    while (count < t->argc && count + 2 < (int)(sizeof args / sizeof *args)) {
        args[count] = t->argv[count];
        count++;
    }
    args[count++] = (char *)"--check-config";
    args[count] = NULL;
    hg_notify_send(
        "RELOADING=1\nMONOTONIC_USEC=%llu", (unsigned long long)(hg_clock_now_ns() / 1000));
    int rc = posix_spawnp(&t->check_pid, args[0], NULL, NULL, args, environ);
    if (rc) {
        t->check_pid = 0;
        give_up(t, strerror(rc));
    }
}

void hg_takeover_checked(struct hg_takeover *t, int status)
{
    t->check_pid = 0;
    if (t->all.sessions->draining)
        return;
    if (!WIFEXITED(status) || WEXITSTATUS(status)) {
        give_up(t, "its --check-config fails");
        return;
    }
    if (give_up_on_disk(t))
        return;
    hg_info(MAIN, "a new program takes over as soon as nothing is under way");
    t->hurried = false;
    t->deadline_ns = t->loop->now_ns + t->all.sessions->options->drain_timeout_ns;
    t->all.conns->quiet = true;
}

// Returns only when the state cannot be saved.
static void exec_successor(struct hg_takeover *t)
{
    struct hg_error err = {0};
    char text[4096 + 128];
    int fd;
    if (hg_handover_save(&t->all, &fd, &err)) {
        give_up(t, err.reason);
        return;
    }
    // The log's thread ends with all written; from here on there is no way back.
    hg_loop_remove(t->loop, t->state_news);
    hg_state_log_close(*t->state);
    hg_audit_write(t->audit, "takeover", NULL, HG_OK, NULL);
    hg_handover_keep_open(&t->all);
    hg_launcher_keep_open(t->launcher);
    hg_cache_folder_keep_open(t->cache);
    const struct hg_options *o = t->all.sessions->options;
    snprintf(text, sizeof text, "%d:%u:%d:%d:%d:%s:%s", fd, t->all.sessions->pool->count,
        t->launcher->fd, (int)t->launcher->pid, t->cache->lock_fd, o->isolation, o->cache_dir);
    setenv(inherited_name, text, 1);
    execvp(t->argv[0], t->argv);
    hg_log_write(
        HG_LOG_ERROR, HG_LOG_MAIN, HG_E_IO, 0, "cannot start %s: %s", t->argv[0], strerror(errno));
    _exit(EXIT_START);
}

void hg_takeover_step(struct hg_takeover *t)
{
    bool late = t->loop->now_ns >= t->deadline_ns;
    if (give_up_on_disk(t))
        return;
    const bool shed = hg_handover_shed(&t->all, false);
    if (!shed && hg_handover_is_quiet(&t->all)) {
        if (!hg_handover_shed(&t->all, true)) // their sessions are parked first
            exec_successor(t);
    } else if (late && t->hurried) {
        give_up(t, "edits or workers are still busy (drain-timeout)");
    } else if (late) { // edits that began have as long again
        t->hurried = true;
        t->deadline_ns = t->loop->now_ns + t->all.sessions->options->drain_timeout_ns;
        hg_handover_hurry(&t->all);
    }
}

// Workers are what they are, and where they are: neither can change under them.
static enum hg_status keep_options(struct hg_takeover *t, int lock_fd, const char *isolation,
    const char *cache_dir, struct hg_options *o)
{
    if (!hg_cache_folder_inherit(t->cache, o, cache_dir, lock_fd))
        return HG_E_NOMEM;
    if (strcmp(o->isolation, isolation) == 0)
        return HG_OK;
    char *kept = hg_strdup(isolation);
    if (!kept)
        return HG_E_NOMEM;
    hg_warn(MAIN, "isolation stays %s: to make it %s needs a restart", isolation, o->isolation);
    hg_free(o->isolation);
    o->isolation = kept;
    return HG_OK;
}

enum hg_status hg_takeover_find(
    struct hg_takeover *t, struct hg_options *options, struct hg_error *err)
{
    const char *text = getenv(inherited_name);
    char isolation[16];
    enum hg_status status = HG_OK;
    int launcher_fd, launcher_pid, lock_fd, path = 0, found = 0;
    t->inherited_links = 0;
    if (text)
        found = sscanf(text, "%d:%u:%d:%d:%d:%15[a-z]:%n", &t->inherited_fd, &t->inherited_links,
            &launcher_fd, &launcher_pid, &lock_fd, isolation, &path);
    if (found < 2)
        t->inherited_fd = -1;
    if (found >= 4) // not that of a program that started another one
        *t->launcher = (struct hg_launcher){.fd = launcher_fd, .pid = launcher_pid};
    if (t->inherited_links > MOST_LINKS) // nothing that we have written
        t->inherited_links = MOST_LINKS;
    if (path)
        status = keep_options(t, lock_fd, isolation, text + path, options);
    unsetenv(inherited_name);
    return status ? hg_error_set(err, status, "SIGUSR2", NULL, "no memory") : HG_OK;
}

enum hg_status hg_takeover_inherit(struct hg_takeover *t, struct hg_error *err)
{
    if (t->inherited_fd < 0)
        return HG_OK;
    enum hg_status status = hg_handover_load(&t->all, t->inherited_fd, err);
    if (!status)
        hg_info(MAIN, "took over %u sessions", t->all.sessions->count);
    return status;
}
