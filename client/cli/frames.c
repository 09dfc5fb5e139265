// frames.c - helio render: from the settled view to files, one or many, taken up where they were
// left.
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/alloc.h"
#include "base/clock.h"
#include "base/file.h"
#include "base/sha256.h"
#include "base/utf8.h"
#include "client/cli/render.h"

enum {
    PART_BYTES = 16 << 20, // of a file that is sent to be verified
    PATIENCE_S = 120,      // for the film of a view that is stopped in the middle of a step
};

#define EXISTING_BYTES (UINT64_C(4) << 30) // a larger file is not verified, but made again

bool hg_cli_frame_name(const char *pattern, uint32_t frame, char *dst, size_t size)
{
    const char *slash = strrchr(pattern, '/'), *file = slash ? slash + 1 : pattern;
    const char *at = strrchr(file, '#');
    if (at) {
        while (at > file && at[-1] == '#')
            at--;
        int width = (int)strspn(at, "#");
        snprintf(dst, size, "%.*s%0*u%s", (int)(at - pattern), pattern, width, frame, at + width);
        return true;
    }
    at = strrchr(file, '%');
    size_t digits = at ? strspn(at + 1, "0123456789") : 0;
    if (!at || digits > 2 || at[1 + digits] != 'd' || (digits && at[1] != '0'))
        return false;
    int width = digits ? atoi(at + 1) : 1;
    snprintf(dst, size, "%.*s%0*u%s", (int)(at - pattern), pattern, width, frame, at + digits + 2);
    return true;
}

static bool is_path(const struct hg_cli_render *r)
{
    return r->o->mode && strcmp(r->o->mode, "path") == 0;
}

// ---- what is noted of a frame ------------------------------------------------------------------

static void set_hash(json_t *object, const char *key, const uint8_t hash[32])
{
    char hex[HG_SHA256_HEX];
    hg_sha256_hex(hash, hex);
    json_object_set_new(object, key, json_string(hex));
}

static enum hg_status note_frame(struct hg_cli_render *r, const struct hgp_frame *frame,
    const char *name, uint64_t total_ns, struct hg_error *err)
{
    json_t *stages = json_array();
    for (uint32_t i = 0; i < frame->stages.count; i++) {
        const struct hgp_stage_time *s = &frame->stages.items[i];
        json_array_append_new(
            stages, json_pack("{s:o?, s:f}", "name",
                        json_stringn(s->name.data ? s->name.data : "", s->name.size), "ms",
                        (double)s->ns / 1e6));
    }
    char file[4200]; // names are bytes, JSON is UTF-8
    snprintf(file, sizeof file, "%s", name);
    hg_utf8_clean(file);
    json_t *o = json_pack("{s:s, s:I, s:I, s:I, s:I, s:I, s:b, s:b, s:I, s:f, s:o}", "file", file,
        "width", (json_int_t)frame->width, "height", (json_int_t)frame->height, "samples",
        (json_int_t)frame->samples, "missing_pages", (json_int_t)frame->missing_pages,
        "missing_clusters", (json_int_t)frame->missing_clusters, "settled", frame->settled,
        "lossless", frame->lossless, "bytes",
        (json_int_t)(frame->has_size ? frame->size : frame->data.size), "total_ms",
        (double)total_ns / 1e6, "stages", stages);
    if (!o || json_array_append_new(r->frames, o))
        return hg_error_set(err, HG_E_NOMEM, "statistics", NULL, "no memory");
    r->last = o;
    if (frame->has_mode)
        json_object_set_new(
            o, "mode", json_string(frame->mode == HGP_render_mode_PATH ? "path" : "realtime"));
    if (frame->has_noise)
        json_object_set_new(o, "noise", json_real((double)frame->noise));
    if (frame->has_job)
        set_hash(o, "job", frame->job);
    if (frame->has_hash)
        set_hash(o, "hash", frame->hash);
    return HG_OK;
}

// ---- jobs and files that are there already -----------------------------------------------------

// Only files that may be met again are worth looking at the whole scene for.
static bool wants_job(const struct hg_cli_render *r)
{
    return is_path(r) || r->o->has_frames || r->o->skip_existing;
}

// after: job of the picture that this one depends on, or NULL.
static enum hg_status ask_job(
    struct hg_cli_render *r, const uint8_t *after, uint8_t job[32], struct hg_error *err)
{
    struct helio_message *answer;
    struct hgp_job_query query = {
        .view = HG_CLI_VIEW,
        .has_encoding = true,
        .encoding = r->format.encoding,
        .has_quality = true,
        .quality = r->format.quality,
        .has_after = after != NULL,
    };
    if (after)
        memcpy(query.after, after, 32);
    memset(job, 0, 32);
    r->replaced = r->cli.progress.replaced;
    if (!wants_job(r))
        return HG_OK;
    enum hg_status status =
        helio_call_for(r->cli.h, HGP_T_job_query, &query, HGP_T_job, &answer, err);
    if (status)
        return status;
    memcpy(job, answer->body->job.hash, 32);
    helio_message_free(answer);
    return HG_OK;
}

// NULL: the file is whole and of this job. Else why it is made again; "" when there is none.
static const char *why_not(const char *json, const uint8_t job[32])
{
    char hex[HG_SHA256_HEX];
    hg_sha256_hex(job, hex);
    json_t *told = json_loads(json, 0, NULL);
    const char *of = json_string_value(json_object_get(told, "job"));
    const char *why = !of                    ? "does not say what it was made from"
                      : strcmp(of, hex) != 0 ? "was made from something else"
                                             : NULL;
    json_decref(told);
    return why;
}

// What the worker finds in a file, all of which is sent to it.
static enum hg_status examine(struct hg_cli_render *r, const uint8_t *data, size_t size,
    struct helio_message **answer, struct hg_error *err)
{
    enum hg_status status = HG_OK;
    size_t at = 0;
    for (; !status && size - at > PART_BYTES; at += PART_BYTES) {
        const struct hgp_image_query part = {.data = {data + at, PART_BYTES},
            .has_offset = true,
            .offset = at,
            .has_size = true,
            .size = size};
        status = helio_call_for(r->cli.h, HGP_T_image_query, &part, HGP_T_ok, NULL, err);
    }
    const struct hgp_image_query last = {.data = {data + at, (uint32_t)(size - at)},
        .has_offset = at > 0,
        .offset = at,
        .has_size = at > 0,
        .size = size};
    return status ? status
                  : helio_call_for(r->cli.h, HGP_T_image_query, &last, HGP_T_json, answer, err);
}

// Does `name` hold what this command would write? The worker decodes all of it.
static enum hg_status check_existing(struct hg_cli_render *r, const char *name,
    const uint8_t job[32], bool *good, struct hg_error *err)
{
    uint8_t *data;
    size_t size;
    struct helio_message *answer = NULL;
    struct hg_error wrong = {0};
    *good = false;
    enum hg_status status = hg_file_read(name, EXISTING_BYTES, &data, &size, &wrong);
    if (status == HG_E_NOTFOUND)
        return HG_OK;
    if (!status) {
        status = examine(r, data, size, &answer, &wrong);
        hg_free(data);
    }
    const char *why = wrong.reason;
    if (!status) {
        char *text = hg_strndup(answer->body->json.text.data ? answer->body->json.text.data : "",
            answer->body->json.text.size);
        why = text ? why_not(text, job) : "no memory to look at it";
        *good = why == NULL;
        hg_free(text);
        helio_message_free(answer);
    } else if (status != HG_E_FORMAT && status != HG_E_TRUNCATED && status != HG_E_LIMIT &&
               status != HG_E_UNSUPPORTED) {
        *err = wrong;
        return status;
    }
    if (!*good) {
        char clean[300];
        hg_cli_clean(clean, sizeof clean, why, strlen(why));
        hg_cli_progress_clear(&r->cli.progress);
        fprintf(stderr, "helio: %s: %s; it is made again\n", name, clean);
    }
    return HG_OK;
}

// Pictures that depend on those before. A picture's job holds that of the one before, so files that
// are there already are of this series or are made again. Pictures that are left as they are do not
// bring the view their history: it comes from OUT.history, or they are made once more.
struct hg_cli_series {
    uint32_t held;     // the view has the history of picture held - 1; 0: of none
    uint32_t replaced; // workers, when it got it: another one has none
    bool kept;         // the history of picture held - 1 is in its file
    uint8_t job[][32];
};

static bool is_lost(const struct hg_cli_render *r)
{
    return r->series && r->series->held > 0 && r->series->replaced != r->cli.progress.replaced;
}

// ---- waiting for a frame -----------------------------------------------------------------------

// One more part of a frame's data.
static void take_part(
    struct hg_writer *parts, const struct hgp_frame_part *part, struct hg_error *err)
{
    if (part->offset == 0)
        hg_writer_finish(parts);
    if (part->offset != parts->size)
        hg_error_set(err, HG_E_FORMAT, "frame", "offset", "parts do not fit together");
    hg_write_bytes(parts, part->data.data, part->data.size);
    if (parts->failed)
        hg_error_set(err, HG_E_NOMEM, "frame", NULL, "no memory for its parts");
}

// Messages that came: progress and notices are shown; true when the frame or its error is there.
static bool take_messages(
    struct hg_cli_render *r, uint32_t request, struct helio_message **frame, struct hg_error *err)
{
    struct hg_cli *cli = &r->cli;
    struct helio_message *m;
    struct hg_error ignored;
    while (helio_next(cli->h, &m, &ignored) == HG_OK) {
        bool ours = m->request == request;
        if (m->type == HGP_T_progress && ours)
            hg_cli_on_progress(&cli->progress, &m->body->progress);
        else if (m->type == HGP_T_frame_part && ours)
            take_part(&r->parts, &m->body->frame_part, err);
        else if (m->type == HGP_T_drain)
            r->closes_s = fmax(m->body->drain.deadline_ms / 1e3, 0.1);
        else if (m->type == HGP_T_notice)
            hg_cli_on_notice(&cli->progress, &m->body->notice);
        else if (m->type == HGP_T_error) // ours, or of a message that nobody waited for: a camera
            hg_cli_error_of(&m->body->error, err);
        if (ours && m->type == HGP_T_frame) {
            *frame = m;
            return true;
        }
        helio_message_free(m);
        if (err->status)
            return true;
    }
    return false;
}

static uint64_t add_s(uint64_t ns, double s)
{
    return s > 1e9 ? UINT64_MAX : ns + (uint64_t)(s * 1e9);
}

static struct hg_cli_kept film_of(struct hg_cli_render *r, const char *name, const uint8_t job[32])
{
    return (struct hg_cli_kept){
        &r->cli, HGP_checkpoint_kind_FILM, name, job, .least = r->kept_samples};
}

static enum hg_status save_film(
    struct hg_cli_render *r, const char *name, const uint8_t job[32], struct hg_error *err)
{
    const struct hg_cli_kept kept = film_of(r, name, job);
    uint32_t samples;
    enum hg_status status = hg_cli_checkpoint_save(&kept, PATIENCE_S, &samples, err);
    if (status == HG_OK) {
        r->left_checkpoint = true;
        r->kept_samples = samples;
    }
    return status;
}

static enum hg_status load_film(
    struct hg_cli_render *r, const char *name, const uint8_t job[32], struct hg_error *err)
{
    const struct hg_cli_kept kept = film_of(r, name, job);
    uint32_t samples = 0;
    enum hg_status status = hg_cli_checkpoint_load(&kept, &samples, err);
    r->kept_samples = samples; // 0: what is there is of no use
    if (!status && samples) {
        hg_cli_progress_clear(&r->cli.progress);
        fprintf(stderr, "helio: %s: goes on from %u samples\n", name, samples);
    }
    return status;
}

// A disk that takes no film is no reason to end: the picture is smaller, and may find room.
static enum hg_status save_interval(
    struct hg_cli_render *r, const char *name, const uint8_t job[32], struct hg_error *err)
{
    struct hg_error wrong = {0};
    enum hg_status status = save_film(r, name, job, &wrong);
    switch (status) {
    case HG_OK:
    case HG_E_STATE: // nothing worth keeping yet
        return HG_OK;
    case HG_E_NOSPACE:
    case HG_E_PERM:
    case HG_E_NOTFOUND:
    case HG_E_IO:
    case HG_E_NOMEM:
    case HG_E_LIMIT:
        hg_cli_progress_clear(&r->cli.progress);
        fprintf(stderr, "helio: %s.checkpoint: %s; the rendering goes on\n", name,
            wrong.reason[0] ? wrong.reason : hg_status_text(status));
        return HG_OK;
    default:
        *err = wrong;
        return status;
    }
}

// A worker that took the place of another knows no job, and begins the picture anew but for what
// was kept of it.
static enum hg_status go_on(
    struct hg_cli_render *r, const char *name, const uint8_t job[32], struct hg_error *err)
{
    uint8_t same[32];
    if (r->replaced == r->cli.progress.replaced)
        return HG_OK;
    enum hg_status status = ask_job(r, NULL, same, err);
    if (!status && is_path(r) && r->left_checkpoint)
        status = load_film(r, name, job, err);
    return status;
}

// The settled frame; on the way there the film is written to OUT.checkpoint in intervals.
static enum hg_status wait_frame(struct hg_cli_render *r, const char *name, const uint8_t job[32],
    struct helio_message **frame, struct hg_error *err)
{
    const struct hg_cli_options *o = r->o;
    struct hg_cli *cli = &r->cli;
    struct hgp_frame_request request = {
        .view = HG_CLI_VIEW,
        .settled = true,
        .has_encoding = true,
        .encoding = r->format.encoding,
        .has_quality = true,
        .quality = r->format.quality,
        .has_parts = true,
        .parts = true,
    };
    uint32_t id;
    *frame = NULL;
    hg_writer_finish(&r->parts);
    enum hg_status status = go_on(r, name, job, err);
    if (!status)
        status = helio_send(cli->h, HGP_T_frame_request, &request, &id, err);
    uint64_t now = hg_clock_now_ns();
    uint64_t deadline = o->has_timeout ? add_s(now, o->timeout) : UINT64_MAX;
    double every = o->has_checkpoint ? o->checkpoint : 1e12;
    uint64_t save = add_s(now, every);
    struct hg_error told = {0};
    while (!status && !take_messages(r, id, frame, &told)) {
        status = go_on(r, name, job, err);
        if (status)
            break;
        now = hg_clock_now_ns();
        if (r->closes_s > 0 && is_path(r)) { // at once, and as long as it lasts
            save = now;
            every = fmin(every, r->closes_s / 4);
        }
        r->closes_s = 0;
        uint64_t until = save < deadline ? save : deadline;
        status = helio_wait(cli->h,
            until == UINT64_MAX ? HELIO_NO_TIMEOUT
            : until > now       ? until - now
                                : 0,
            err);
        now = hg_clock_now_ns();
        if (status == HG_E_TIMEOUT && now < deadline)
            status = HG_OK;
        if (status || now < save)
            continue;
        status = save_interval(r, name, job, err);
        save = add_s(hg_clock_now_ns(), every);
    }
    if (!status && told.status) {
        status = told.status;
        *err = told;
        if (strcmp(told.what, "camera") == 0)
            r->doing = HG_CLI_DOING_ARGUMENTS;
    }
    return status;
}

// What comes from a worker that was not told of the job is asked for once more.
static enum hg_status wait_whole_frame(struct hg_cli_render *r, const char *name,
    const uint8_t job[32], struct helio_message **frame, struct hg_error *err)
{
    for (;;) {
        const uint32_t replaced = r->replaced;
        const enum hg_status status = wait_frame(r, name, job, frame, err);
        if (status || replaced == r->cli.progress.replaced || is_lost(r))
            return status;
        helio_message_free(*frame);
        *frame = NULL;
    }
}

// What a command that is stopped leaves of the frame it was at.
static void leave_checkpoint(struct hg_cli_render *r, const char *name, const uint8_t job[32])
{
    struct hg_error err = {0};
    if (!is_path(r) || !hg_cli_is_stopped())
        return;
    enum hg_status status = save_film(r, name, job, &err);
    if (status && status != HG_E_STATE)
        fprintf(stderr, "helio: %s.checkpoint: cannot be written: %s\n", name,
            err.reason[0] ? err.reason : hg_status_text(status));
}

static enum hg_status resume(
    struct hg_cli_render *r, const char *name, const uint8_t job[32], struct hg_error *err)
{
    if (!r->o->resume && !r->left_checkpoint)
        return HG_OK;
    enum hg_status status = load_film(r, name, job, err);
    r->left_checkpoint |= !status && r->kept_samples > 0;
    return status;
}

// ---- frames ------------------------------------------------------------------------------------

static void drop_film(struct hg_cli_render *r, const char *name)
{
    hg_cli_checkpoint_remove(HGP_checkpoint_kind_FILM, name);
    r->left_checkpoint = false;
    r->kept_samples = 0;
}

// All of a frame's data, behind the parts that came before; they live as long as both.
static enum hg_status join_parts(struct hg_cli_render *r, const struct hgp_frame *frame,
    const uint8_t **data, size_t *size, struct hg_error *err)
{
    struct hg_writer *w = &r->parts;
    *data = frame->data.data;
    *size = frame->data.size;
    if (!frame->has_size)
        return HG_OK;
    hg_write_bytes(w, frame->data.data, frame->data.size);
    *data = w->data;
    *size = w->size;
    if (w->failed)
        return hg_error_set(err, HG_E_NOMEM, "frame", NULL, "no memory for its parts");
    return w->size == frame->size
               ? HG_OK
               : hg_error_set(err, HG_E_FORMAT, "frame", "size", "parts do not fit together");
}

static enum hg_status write_frame(struct hg_cli_render *r, const struct hgp_frame *frame,
    const char *name, uint64_t took_ns, struct hg_error *err)
{
    enum hg_status status = HG_OK;
    if (frame->encoding != r->format.encoding || !frame->data.size)
        status = hg_error_set(err, HG_E_FORMAT, "frame", "encoding",
            "the server sent another encoding than the one asked for");
    const uint8_t *data = NULL;
    size_t size = 0;
    if (!status)
        status = join_parts(r, frame, &data, &size, err);
    if (!status)
        status = note_frame(r, frame, name, took_ns, err);
    if (!status) {
        r->doing = HG_CLI_DOING_OUTPUT;
        status = hg_file_write_atomic(name, data, size, err);
    }
    if (!status && is_path(r))
        drop_film(r, name);
    return status;
}

// What the next picture of a series needs is there before the picture itself is: whoever finds the
// one finds the other.
static bool keep_history(struct hg_cli_render *r, const char *name, const uint8_t job[32])
{
    const struct hg_cli_kept kept = {&r->cli, HGP_checkpoint_kind_HISTORY, name, job, 0};
    struct hg_error err = {0};
    uint32_t samples;
    enum hg_status status = hg_cli_checkpoint_save(&kept, PATIENCE_S, &samples, &err);
    if (status && !hg_cli_is_stopped()) {
        hg_cli_progress_clear(&r->cli.progress);
        fprintf(stderr, "helio: %s.history: cannot be written: %s\n", name,
            err.reason[0] ? err.reason : hg_status_text(status));
    }
    return status == HG_OK;
}

// *again: the picture was made without the history that it needs, and is nobody's.
static enum hg_status make_frame(struct hg_cli_render *r, const char *name, const uint8_t job[32],
    bool wanted, bool *again, struct hg_error *err)
{
    struct helio_message *answer;
    *again = false;
    uint64_t begin = hg_clock_now_ns();
    hg_cli_progress_stage(&r->cli.progress, "rendering");
    enum hg_status status = resume(r, name, job, err);
    if (!status)
        status = wait_whole_frame(r, name, job, &answer, err);
    if (status) {
        leave_checkpoint(r, name, job);
        return status;
    }
    if (is_lost(r)) {
        *again = true;
        helio_message_free(answer);
        return HG_OK;
    }
    if (r->series)
        r->series->replaced = r->cli.progress.replaced;
    r->doing = HG_CLI_DOING_INPUT; // what is wrong with the picture came from the files
    status = hg_cli_check_warnings(&r->cli, err);
    if (!status) {
        r->doing = HG_CLI_DOING_RENDER;
        uint64_t now = hg_clock_now_ns();
        if (!r->first_frame_ns)
            r->first_frame_ns = now - r->cli.begin_ns;
        if (r->series)
            r->series->kept = keep_history(r, name, job);
        if (wanted)
            status = write_frame(r, &answer->body->frame, name, now - begin, err);
        if (wanted)
            hg_cli_progress_frame(&r->cli.progress, now - begin);
    }
    helio_message_free(answer);
    return status;
}

// A frame that is not there yet, or is not good.
static enum hg_status check_frame(struct hg_cli_render *r, const char *name, const uint8_t job[32],
    bool *there, struct hg_error *err)
{
    *there = false;
    enum hg_status status = r->o->skip_existing ? check_existing(r, name, job, there, err) : HG_OK;
    if (!status && *there) {
        r->skipped++;
        hg_cli_progress_frame(&r->cli.progress, 0);
    }
    return status;
}

static enum hg_status render_frame(struct hg_cli_render *r, const char *name, struct hg_error *err)
{
    uint8_t job[32];
    bool there = false, again;
    r->doing = HG_CLI_DOING_RENDER;
    enum hg_status status = ask_job(r, NULL, job, err);
    if (!status)
        status = check_frame(r, name, job, &there, err);
    return status || there ? status : make_frame(r, name, job, true, &again, err);
}

static enum hg_status set_time(struct hg_cli_render *r, double time_s, struct hg_error *err)
{
    struct hgp_animation_set animation = {
        .asset = r->cli.scene.first_id, .animation = -1, .time_s = time_s};
    r->doing = HG_CLI_DOING_RENDER;
    return helio_call_for(r->cli.h, HGP_T_animation_set, &animation, HGP_T_ok, NULL, err);
}

// Frames that are averaged must not have the same noise: each one has a seed of its own.
static enum hg_status set_seed(struct hg_cli_render *r, uint32_t frame, struct hg_error *err)
{
    struct hgp_view_set view = {.view = HG_CLI_VIEW, .has_seed = true, .seed = r->o->seed + frame};
    if (!r->o->denoise)
        return HG_OK;
    return helio_call_for(r->cli.h, HGP_T_view_set, &view, HGP_T_ok, NULL, err);
}

static void name_frame(const struct hg_cli_render *r, uint32_t frame, char *dst, size_t size)
{
    if (!hg_cli_frame_name(r->o->output, frame, dst, size))
        snprintf(dst, size, "%s", r->o->output);
}

static uint32_t frame_at(const struct hg_cli_render *r, uint32_t index)
{
    return r->o->frames.first + index * r->o->frames.step;
}

static uint32_t frame_count(const struct hg_cli_render *r)
{
    const struct hg_cli_frames *f = &r->o->frames;
    return (f->last - f->first) / f->step + 1;
}

static enum hg_status go_to(struct hg_cli_render *r, uint32_t index, struct hg_error *err)
{
    const uint32_t frame = frame_at(r, index);
    const double fps = r->o->has_fps ? r->o->fps : 24;
    enum hg_status status = set_time(r, frame / fps, err);
    return status ? status : set_seed(r, frame, err);
}

// ---- series ------------------------------------------------------------------------------------

static bool is_series(const struct hg_cli_render *r)
{
    return is_path(r) && r->o->denoise && r->o->has_frames && frame_count(r) > 1;
}

static enum hg_status ask_series_job(struct hg_cli_render *r, uint32_t i, struct hg_error *err)
{
    uint8_t(*job)[32] = r->series->job;
    enum hg_status status = go_to(r, i, err);
    return status ? status : ask_job(r, i > 0 ? job[i - 1] : NULL, job[i], err);
}

// The newest history in a file that is of use for picture i.
static enum hg_status load_history(struct hg_cli_render *r, uint32_t i, struct hg_error *err)
{
    struct hg_cli_series *s = r->series;
    char name[4096];
    uint32_t samples = 0;
    for (uint32_t j = i; j > s->held; j--) {
        name_frame(r, frame_at(r, j - 1), name, sizeof name);
        const struct hg_cli_kept kept = {
            &r->cli, HGP_checkpoint_kind_HISTORY, name, s->job[j - 1], 0};
        enum hg_status status = hg_cli_checkpoint_load(&kept, &samples, err);
        if (status)
            return status;
        if (samples) {
            s->held = j;
            return HG_OK;
        }
    }
    return HG_OK;
}

static void drop_history(const struct hg_cli_render *r, uint32_t i)
{
    char name[4096];
    name_frame(r, frame_at(r, i), name, sizeof name);
    hg_cli_checkpoint_remove(HGP_checkpoint_kind_HISTORY, name);
}

static enum hg_status make_series_frame(
    struct hg_cli_render *r, uint32_t i, bool wanted, bool *again, struct hg_error *err)
{
    char name[4096];
    name_frame(r, frame_at(r, i), name, sizeof name);
    enum hg_status status = make_frame(r, name, r->series->job[i], wanted, again, err);
    if (status || *again)
        return status;
    r->series->held = i + 1;
    if (!wanted)
        drop_film(r, name);
    if (i > 0 && r->series->kept)
        drop_history(r, i - 1);
    return HG_OK;
}

// A view whose worker was replaced has lost its history, and may show picture i without: it looks
// elsewhere, gets what was kept, and comes back.
static enum hg_status restore(struct hg_cli_render *r, uint32_t i, struct hg_error *err)
{
    struct hg_cli_series *s = r->series;
    enum hg_status status = HG_OK;
    while (!status && is_lost(r)) {
        s->held = 0;
        s->replaced = r->cli.progress.replaced;
        status = go_to(r, i > 0 ? i - 1 : i, err);
        if (!status)
            status = load_history(r, i, err);
        if (!status && s->held == 0 && i > 0) // what it has may be of the wrong picture
            status = hg_error_set(err, HG_E_WORKER, "history", NULL,
                "the worker was replaced, and what the next frame depends on was not kept");
        if (!status)
            status = ask_series_job(r, i, err);
    }
    return status;
}

// The view gets the history that picture i is averaged with.
static enum hg_status reach(struct hg_cli_render *r, uint32_t i, struct hg_error *err)
{
    struct hg_cli_series *s = r->series;
    enum hg_status status = restore(r, i, err);
    if (!status && s->held < i)
        status = load_history(r, i, err);
    if (status || s->held == i)
        return status;
    hg_cli_progress_clear(&r->cli.progress);
    fprintf(stderr,
        "helio: frames %u to %u are made again, unwritten: the next one depends on them\n",
        frame_at(r, s->held), frame_at(r, i - 1));
    while (!status && s->held < i) {
        bool again;
        status = ask_series_job(r, s->held, err);
        if (!status)
            status = make_series_frame(r, s->held, false, &again, err);
        if (!status)
            status = restore(r, i, err);
    }
    return status ? status : ask_series_job(r, i, err);
}

static enum hg_status render_series_frame(struct hg_cli_render *r, uint32_t i, struct hg_error *err)
{
    char name[4096];
    bool there = false;
    name_frame(r, frame_at(r, i), name, sizeof name);
    enum hg_status status = ask_series_job(r, i, err);
    if (!status)
        status = check_frame(r, name, r->series->job[i], &there, err);
    if (status || there)
        return status;
    for (bool again = true; !status && again;) {
        status = reach(r, i, err);
        if (!status)
            status = make_series_frame(r, i, true, &again, err);
    }
    return status;
}

// ---- all ---------------------------------------------------------------------------------------

static enum hg_status render_numbered(struct hg_cli_render *r, uint32_t i, struct hg_error *err)
{
    char name[4096];
    if (r->series)
        return render_series_frame(r, i, err);
    name_frame(r, frame_at(r, i), name, sizeof name);
    enum hg_status status = go_to(r, i, err);
    return status ? status : render_frame(r, name, err);
}

static enum hg_status render_all_frames(struct hg_cli_render *r, struct hg_error *err)
{
    const uint32_t count = frame_count(r);
    enum hg_status status = HG_OK;
    hg_cli_progress_frames(&r->cli.progress, count);
    for (uint32_t i = 0; i < count && !status; i++) {
        r->next_frame = frame_at(r, i);
        snprintf(
            r->cli.progress.prefix, sizeof r->cli.progress.prefix, "frame %u of %u", i + 1, count);
        status = render_numbered(r, i, err);
    }
    for (uint32_t i = 0; i < count && !status && r->series; i++)
        drop_history(r, i);
    return status;
}

enum hg_status hg_cli_render_frames(struct hg_cli_render *r, struct hg_error *err)
{
    const struct hg_cli_options *o = r->o;
    if (!o->has_frames) {
        bool moves =
            (o->has_shutter || (r->planes >> HGP_plane_MOTION & 1)) && r->loaded.animations > 0;
        enum hg_status status = o->has_at || moves ? set_time(r, o->at, err) : HG_OK;
        return status ? status : render_frame(r, o->output, err);
    }
    if (is_series(r)) {
        r->series = hg_calloc(1, sizeof *r->series + (size_t)frame_count(r) * 32);
        if (!r->series)
            return hg_error_set(err, HG_E_NOMEM, "--frames", NULL, "no memory for so many");
    }
    return render_all_frames(r, err);
}

void hg_cli_render_stopped(const struct hg_cli_render *r)
{
    const struct hg_cli_frames *f = &r->o->frames;
    if (r->series)
        fprintf(stderr,
            "helio: %zu frames are written; the same command with --skip-existing renders the "
            "rest\n",
            json_array_size(r->frames));
    else if (r->o->has_frames && r->next_frame > f->first)
        fprintf(stderr, "helio: %zu frames are written; --frames %u-%u:%u renders the rest\n",
            json_array_size(r->frames), r->next_frame, f->last, f->step);
    if (r->left_checkpoint)
        fprintf(
            stderr, "helio: stopped early; the same command with --resume goes on from there\n");
}

// ---- statistics --------------------------------------------------------------------------------

static void set_ms(json_t *object, const char *key, uint64_t ns)
{
    json_object_set_new(object, key, json_real((double)ns / 1e6));
}

// The worker's statistics, with the newest frame's provenance and the client's own times.
enum hg_status hg_cli_render_stats(struct hg_cli_render *r, struct hg_error *err)
{
    json_t *stats;
    r->doing = HG_CLI_DOING_RENDER;
    enum hg_status status = hg_cli_stats(&r->cli, &stats, err);
    if (status)
        return status;
    json_t *frame = json_object_get(stats, "frame");
    if (!json_is_object(frame)) {
        frame = json_object();
        json_object_set_new(stats, "frame", frame);
    }
    if (r->last)
        json_object_update_missing(frame, r->last);
    json_t *client = json_object();
    set_ms(client, "connect_ms", r->cli.connect_ns);
    set_ms(client, "load_ms", r->load_ns);
    set_ms(client, "first_frame_ms", r->first_frame_ns);
    set_ms(client, "total_ms", hg_clock_now_ns() - r->cli.begin_ns);
    json_object_set_new(client, "uploaded_bytes", json_integer((json_int_t)r->upload_bytes));
    json_object_set_new(client, "skipped_frames", json_integer(r->skipped));
    json_object_set_new(client, "embedded", json_boolean(r->cli.embedded));
    json_object_set_new(client, "version", json_string(HELIO_VERSION));
    json_object_set_new(stats, "client", client);
    json_object_set(stats, "frames", r->frames);
    char *text = json_dumps(stats, JSON_INDENT(2) | JSON_REAL_PRECISION(9));
    json_decref(stats);
    if (!text)
        return hg_error_set(err, HG_E_NOMEM, "statistics", NULL, "no memory");
    size_t length = strlen(text);
    text[length] = '\n'; // over the terminator, which is not written
    r->doing = HG_CLI_DOING_OUTPUT;
    status = hg_file_write_atomic(r->o->stats_file, text, length + 1, err);
    free(text);
    return status;
}
