#include "client/cli/progress.h"

#include <jansson.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

#include "base/clock.h"
#include "base/utf8.h"
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

void hg_cli_progress_begin_frame(struct hg_cli_progress *p, int32_t frame, uint32_t index)
{
    p->frame = frame;
    p->index = index;
}

void hg_cli_progress_frame(struct hg_cli_progress *p, uint64_t took_ns)
{
    p->frames_done += p->frames_done < p->frames;
    p->done = p->total = 0; // its samples are not those of the next one
    if (took_ns && p->frames_made++)
        p->frames_ns += took_ns;
    else if (took_ns)
        p->first_ns = took_ns;
    p->frame_begin_ns = hg_clock_now_ns();
}

// Share of the whole command that is done, 0 to 1; 0 while nothing is known.
static double share_done(const struct hg_cli_progress *p)
{
    const bool samples = strcmp(p->stage, "samples") == 0 && p->total > 0;
    const double part = samples ? (double)p->done / (double)p->total : 0;
    if (p->frames < 2)
        return p->frames_done ? 1 : part;
    const double share = ((double)p->frames_done + part) / p->frames;
    return share < 1 ? share : 1;
}

// ---- the JSON stream ---------------------------------------------------------------------------

// One object a line, in one call, so that lines of several processes do not mix. Takes `o`.
static void print_event(json_t *o)
{
    char *text = o ? json_dumps(o, JSON_COMPACT | JSON_REAL_PRECISION(6)) : NULL;
    if (text)
        fprintf(stderr, "%s\n", text);
    free(text);
    json_decref(o);
}

static void set_text(json_t *o, const char *key, const char *text)
{
    char clean[4200]; // names are bytes, JSON is UTF-8
    snprintf(clean, sizeof clean, "%s", text);
    hg_utf8_clean(clean);
    json_object_set_new(o, key, json_string(clean));
}

static json_t *make_event(const struct hg_cli_progress *p, const char *event)
{
    return json_pack(
        "{s:s, s:f}", "event", event, "elapsed_s", (double)(hg_clock_now_ns() - p->begin_ns) / 1e9);
}

static void set_frame(json_t *o, const struct hg_cli_progress *p)
{
    if (!p->index)
        return;
    json_object_set_new(o, "frame", json_integer(p->frame));
    json_object_set_new(o, "index", json_integer(p->index));
    json_object_set_new(o, "of", json_integer(p->frames));
}

static void print_progress_event(const struct hg_cli_progress *p, uint64_t now)
{
    json_t *o = make_event(p, "progress");
    set_text(o, "stage", p->stage);
    json_object_set_new(o, "done", json_integer((json_int_t)p->done));
    json_object_set_new(o, "total", json_integer((json_int_t)p->total));
    set_frame(o, p);
    json_object_set_new(o, "share", json_real(share_done(p)));
    const double left = hg_cli_progress_left(p, now);
    if (left >= 0)
        json_object_set_new(o, "left_s", json_real(left));
    print_event(o);
}

void hg_cli_progress_output(struct hg_cli_progress *p, const char *path, uint64_t took_ns)
{
    p->outputs.written += took_ns > 0;
    p->outputs.skipped += took_ns == 0;
    if (p->mode != HG_CLI_PROGRESS_JSON)
        return;
    json_t *o = make_event(p, took_ns ? "written" : "skipped");
    set_text(o, "path", path);
    set_frame(o, p);
    json_object_set_new(o, "share", json_real(share_done(p)));
    if (took_ns)
        json_object_set_new(o, "took_s", json_real((double)took_ns / 1e9));
    print_event(o);
}

void hg_cli_progress_end(struct hg_cli_progress *p, int exit_code)
{
    hg_cli_progress_warnings(p);
    hg_cli_progress_clear(p);
    if (p->mode != HG_CLI_PROGRESS_JSON)
        return;
    json_t *o = make_event(p, "end");
    json_object_set_new(o, "exit", json_integer(exit_code));
    json_object_set_new(o, "written", json_integer(p->outputs.written));
    json_object_set_new(o, "skipped", json_integer(p->outputs.skipped));
    json_object_set_new(o, "warnings", json_integer(p->warnings));
    print_event(o);
}

// ---- lines -------------------------------------------------------------------------------------

void hg_cli_progress_print(struct hg_cli_progress *p, const char *text)
{
    hg_cli_progress_clear(p);
    if (p->mode != HG_CLI_PROGRESS_JSON) {
        fprintf(stderr, "%s\n", text);
        return;
    }
    json_t *o = make_event(p, "note");
    set_text(o, "text", text);
    print_event(o);
}

void hg_cli_progress_say(struct hg_cli_progress *p, const char *format, ...)
{
    char text[4800] = "helio: ";
    const size_t prefix = p->mode == HG_CLI_PROGRESS_JSON ? 0 : strlen(text);
    va_list args;
    va_start(args, format);
    vsnprintf(text + prefix, sizeof text - prefix, format, args);
    va_end(args);
    if (!p->quiet || p->mode == HG_CLI_PROGRESS_JSON)
        hg_cli_progress_print(p, text);
}

void hg_cli_progress_error(struct hg_cli_progress *p, const struct hg_error *err, const char *text)
{
    if (p)
        hg_cli_progress_clear(p);
    if (!p || p->mode != HG_CLI_PROGRESS_JSON) {
        fprintf(stderr, "helio: %s\n", text);
        return;
    }
    json_t *o = make_event(p, "error");
    set_text(o, "status", hg_status_name(err->status));
    set_text(o, "what", err->what);
    set_text(o, "where", err->where);
    set_text(o, "reason", err->reason);
    set_text(o, "text", text);
    print_event(o);
}

static void print_line(struct hg_cli_progress *p, uint64_t now)
{
    if (now - p->begin_ns < second_ns)
        return;
    p->line_open = true;
    fprintf(stderr, "\r\033[K");
    if (p->index)
        fprintf(stderr, "%3.0f %%, frame %u of %u: ", 100 * share_done(p), p->index, p->frames);
    fprintf(stderr, "%s", p->stage);
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
    if (p->mode == HG_CLI_PROGRESS_NONE || !p->stage[0] ||
        (p->quiet && p->mode == HG_CLI_PROGRESS_LINE))
        return;
    if (p->shown_ns && !important && now - p->shown_ns < second_ns / 10)
        return;
    p->shown_ns = now;
    if (p->mode == HG_CLI_PROGRESS_JSON)
        print_progress_event(p, now);
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

void hg_cli_progress_warnings(struct hg_cli_progress *p)
{
    const uint32_t n = p->warnings - p->warnings_said;
    p->warnings_said = p->warnings;
    if (n == 0 || p->quiet || p->verbose || p->mode == HG_CLI_PROGRESS_JSON)
        return;
    hg_cli_progress_clear(p);
    if (n == 1)
        fprintf(stderr, "warning: %s\n", p->first_warning);
    else
        fprintf(stderr, "warning: %s; and %u more, which -v lists\n", p->first_warning, n - 1);
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
    const bool waits = strcmp(what, "state-dir") == 0; // for the daemon's disk
    char text[960];
    snprintf(text, sizeof text, "%s%s%s%s%s", what, what[0] ? ": " : "", where,
        where[0] ? ": " : "", reason);
    p->replaced += replaced;
    p->warnings += !replaced && !waits; // about the scene
    if (p->mode == HG_CLI_PROGRESS_JSON) {
        json_t *o = make_event(p, replaced || waits ? "note" : "warning");
        set_text(o, "what", what);
        set_text(o, "where", where);
        set_text(o, "reason", reason);
        set_text(o, "text", text);
        print_event(o);
    } else if (replaced || waits || p->verbose) {
        hg_cli_progress_clear(p);
        if (!p->quiet)
            fprintf(stderr, "warning: %s\n", text);
    } else if (p->warnings == p->warnings_said + 1) {
        snprintf(p->first_warning, sizeof p->first_warning, "%s", text);
    }
}

void hg_cli_on_message(void *user, const struct hgp_message *message)
{
    char from[132], text[1028];
    hg_cli_clean(from, sizeof from, message->from.data, message->from.size);
    hg_cli_clean(text, sizeof text, message->text.data, message->text.size);
    hg_cli_progress_say(user, "the administrator %s says: %s", from, text);
}

void hg_cli_on_idle(void *user, const struct hgp_idle_warning *warning)
{
    hg_cli_progress_say(
        user, "the daemon ends this idle session in %.0f s", (double)warning->remaining_ms / 1e3);
}
