#include "client/cli/progress.h"

#include <jansson.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

#include "base/clock.h"
#include "client/cli/cli.h"

enum { WARNINGS_SHOWN = 10 };

static const uint64_t second_ns = 1000000000;

void hg_cli_progress_init(struct hg_cli_progress *p, const char *mode)
{
    *p = (struct hg_cli_progress){.begin_ns = hg_clock_now_ns()};
    if (mode && strcmp(mode, "json") == 0)
        p->mode = HG_CLI_PROGRESS_JSON;
    else if ((!mode || strcmp(mode, "auto") == 0) && isatty(STDERR_FILENO))
        p->mode = HG_CLI_PROGRESS_LINE;
}

// Seconds that one sample takes, or negative. Other stages tell nothing about the frame.
static double sample_s(const struct hg_cli_progress *p, uint64_t now)
{
    if (strcmp(p->stage, "samples") != 0 || p->done <= p->stage_done || p->total < p->done)
        return -1;
    return (double)(now - p->stage_ns) / 1e9 / (double)(p->done - p->stage_done);
}

double hg_cli_progress_left(const struct hg_cli_progress *p, uint64_t now_ns)
{
    double sample = sample_s(p, now_ns);
    double left = sample < 0 ? -1 : sample * (double)(p->total - p->done);
    if (p->frames < 2)
        return left;
    double at_hand = (double)(now_ns - p->frame_begin_ns) / 1e9, each;
    if (p->frames_made > 1)
        each = (double)p->frames_ns / (p->frames_made - 1) / 1e9;
    else if (p->frames_made)
        each = left < 0 ? (double)p->first_ns / 1e9 : at_hand + left;
    else if (left >= 0)
        each = sample * (double)p->total;
    else
        return -1;
    if (left < 0)
        left = each > at_hand ? each - at_hand : 0;
    return left + each * (double)(p->frames - p->frames_done - 1);
}

void hg_cli_progress_frames(struct hg_cli_progress *p, uint32_t count)
{
    p->frames = count;
    p->frame_begin_ns = hg_clock_now_ns();
}

void hg_cli_progress_frame(struct hg_cli_progress *p, uint64_t took_ns)
{
    p->frames_done += p->frames_done < p->frames;
    if (took_ns && p->frames_made++)
        p->frames_ns += took_ns;
    else if (took_ns)
        p->first_ns = took_ns;
    p->frame_begin_ns = hg_clock_now_ns();
}

static void print_json(
    const struct hg_cli_progress *p, const char *stage, uint64_t done, uint64_t total, uint64_t now)
{
    json_t *o = json_pack("{s:s, s:I, s:I, s:f}", "stage", stage, "done", (json_int_t)done, "total",
        (json_int_t)total, "elapsed_s", (double)(now - p->begin_ns) / 1e9);
    if (o && p->prefix[0])
        json_object_set_new(o, "of", json_string(p->prefix));
    double left = hg_cli_progress_left(p, now);
    if (o && left >= 0)
        json_object_set_new(o, "left_s", json_real(left));
    char *text = o ? json_dumps(o, JSON_COMPACT | JSON_REAL_PRECISION(6)) : NULL;
    if (text)
        fprintf(stderr, "%s\n", text);
    free(text);
    json_decref(o);
}

static void print_line(struct hg_cli_progress *p, uint64_t now)
{
    if (now - p->begin_ns < second_ns)
        return;
    p->line_open = true;
    fprintf(stderr, "\r\033[K%s%s%s", p->prefix, p->prefix[0] ? ": " : "", p->stage);
    if (p->total)
        fprintf(stderr, " %3u %%", (unsigned)(100.0 * (double)p->done / (double)p->total));
    else if (p->done)
        fprintf(stderr, " %llu", (unsigned long long)p->done);
    fprintf(stderr, "  %.0f s", (double)(now - p->begin_ns) / 1e9);
    double left = hg_cli_progress_left(p, now);
    if (left >= 0)
        fprintf(stderr, ", %.0f s left", left);
    fflush(stderr);
}

static void show(struct hg_cli_progress *p, bool important)
{
    uint64_t now = hg_clock_now_ns();
    if (p->mode == HG_CLI_PROGRESS_NONE || !p->stage[0])
        return;
    if (p->shown_ns && !important && now - p->shown_ns < second_ns / 10)
        return;
    p->shown_ns = now;
    if (p->mode == HG_CLI_PROGRESS_JSON)
        print_json(p, p->stage, p->done, p->total, now);
    else
        print_line(p, now);
}

void hg_cli_progress_update(
    struct hg_cli_progress *p, const char *stage, uint64_t done, uint64_t total)
{
    bool changed = strcmp(p->stage, stage) != 0;
    snprintf(p->stage, sizeof p->stage, "%s", stage);
    bool begins = changed || done < p->done;
    // What comes before the first sample (shaders, structures) says nothing about the others.
    if (begins || (p->stage_waits && done > p->done)) {
        p->stage_ns = hg_clock_now_ns();
        p->stage_done = done;
        p->stage_waits = begins;
    }
    p->done = done;
    p->total = total;
    show(p, changed || (total && done >= total));
}

void hg_cli_progress_stage(struct hg_cli_progress *p, const char *stage)
{
    hg_cli_progress_update(p, stage, 0, 0);
}

void hg_cli_on_tick(void *user)
{
    show(user, false);
}

void hg_cli_progress_clear(struct hg_cli_progress *p)
{
    if (p->line_open)
        fprintf(stderr, "\r\033[K");
    p->line_open = false;
}

void hg_cli_progress_finish(struct hg_cli_progress *p)
{
    hg_cli_progress_clear(p);
    if (p->warnings > WARNINGS_SHOWN)
        fprintf(stderr, "warning: %u more; helio info --json lists them\n",
            p->warnings - WARNINGS_SHOWN);
    p->warnings = 0;
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
    struct hg_cli_progress *p = user;
    const bool replaced = notice->code == HG_E_WORKER && strcmp(what, "worker") == 0;
    p->replaced += replaced;
    if (!replaced && p->warnings++ >= WARNINGS_SHOWN) // the others are about the scene
        return;
    hg_cli_progress_clear(p);
    fprintf(stderr, "warning: %s%s%s%s%s\n", what, what[0] ? ": " : "", where, where[0] ? ": " : "",
        reason);
}
