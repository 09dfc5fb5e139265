#include "client/cli/progress.h"

#include <jansson.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

#include "base/clock.h"
#include "client/cli/cli.h"

static const uint64_t second_ns = 1000000000;

void hg_cli_progress_init(struct hg_cli_progress *p, const char *mode)
{
    *p = (struct hg_cli_progress){.begin_ns = hg_clock_now_ns()};
    if (mode && strcmp(mode, "json") == 0)
        p->mode = HG_CLI_PROGRESS_JSON;
    else if ((!mode || strcmp(mode, "auto") == 0) && isatty(STDERR_FILENO))
        p->mode = HG_CLI_PROGRESS_LINE;
}

static void print_json(
    const struct hg_cli_progress *p, const char *stage, uint64_t done, uint64_t total, uint64_t now)
{
    json_t *o = json_pack("{s:s, s:I, s:I, s:f}", "stage", stage, "done", (json_int_t)done, "total",
        (json_int_t)total, "elapsed_s", (double)(now - p->begin_ns) / 1e9);
    if (o && p->prefix[0])
        json_object_set_new(o, "of", json_string(p->prefix));
    char *text = o ? json_dumps(o, JSON_COMPACT | JSON_REAL_PRECISION(6)) : NULL;
    if (text)
        fprintf(stderr, "%s\n", text);
    free(text);
    json_decref(o);
}

void hg_cli_progress_update(
    struct hg_cli_progress *p, const char *stage, uint64_t done, uint64_t total)
{
    uint64_t now = hg_clock_now_ns();
    bool last = total && done >= total;
    if (p->mode == HG_CLI_PROGRESS_NONE)
        return;
    if (p->shown_ns && !last && now - p->shown_ns < second_ns / 10)
        return;
    if (p->mode == HG_CLI_PROGRESS_JSON) {
        p->shown_ns = now;
        print_json(p, stage, done, total, now);
        return;
    }
    if (now - p->begin_ns < second_ns)
        return;
    p->shown_ns = now;
    p->line_open = true;
    fprintf(stderr, "\r\033[K%s%s%s", p->prefix, p->prefix[0] ? ": " : "", stage);
    if (total)
        fprintf(stderr, " %3u %%", (unsigned)(100.0 * (double)done / (double)total));
    else if (done)
        fprintf(stderr, " %llu", (unsigned long long)done);
    fprintf(stderr, "  %.0f s", (double)(now - p->begin_ns) / 1e9);
    fflush(stderr);
}

void hg_cli_progress_clear(struct hg_cli_progress *p)
{
    if (p->line_open)
        fprintf(stderr, "\r\033[K");
    p->line_open = false;
}

void hg_cli_on_progress(void *user, const struct hgp_progress *progress)
{
    char stage[72];
    hg_cli_clean(stage, sizeof stage, progress->stage.data, progress->stage.size);
    hg_cli_progress_update(user, stage, progress->done, progress->total);
}

void hg_cli_on_notice(void *user, const struct hgp_notice *notice)
{
    char what[264], where[136], reason[520];
    hg_cli_clean(what, sizeof what, notice->what.data, notice->what.size);
    hg_cli_clean(where, sizeof where, notice->where.data, notice->where.size);
    hg_cli_clean(reason, sizeof reason, notice->reason.data, notice->reason.size);
    hg_cli_progress_clear(user);
    fprintf(stderr, "warning: %s%s%s%s%s\n", what, what[0] ? ": " : "", where, where[0] ? ": " : "",
        reason);
}
