// frames.c - helio render: from the settled view to files, one or many, taken up where they were
// left.
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/alloc.h"
#include "base/clock.h"
#include "client/cli/render/frames.h"

bool hg_cli_frame_name(const char *pattern, int32_t frame, char *dst, size_t size)
{
    const char *slash = strrchr(pattern, '/'), *file = slash ? slash + 1 : pattern;
    const char *at = strrchr(file, '#');
    if (at) {
        while (at > file && at[-1] == '#')
            at--;
        int width = (int)strspn(at, "#");
        snprintf(dst, size, "%.*s%0*d%s", (int)(at - pattern), pattern, width, frame, at + width);
        return true;
    }
    at = strrchr(file, '%');
    size_t digits = at ? strspn(at + 1, "0123456789") : 0;
    if (!at || digits > 2 || at[1 + digits] != 'd' || (digits && at[1] != '0'))
        return false;
    int width = digits ? atoi(at + 1) : 1;
    snprintf(dst, size, "%.*s%0*d%s", (int)(at - pattern), pattern, width, frame, at + digits + 2);
    return true;
}

void hg_cli_frame_drop_film(struct hg_cli_render *r, const char *name)
{
    hg_cli_checkpoint_remove(HGP_checkpoint_kind_FILM, name);
    r->film = (struct hg_cli_film_kept){0};
}

// A picture that is being made.
struct making {
    const char *name;
    const uint8_t *job; // [32]
    bool wanted;        // written to its file
    uint64_t begin_ns;
};

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
    const uint8_t *data;
    size_t size;
    if (frame->encoding != r->format.encoding || !frame->data.size)
        return hg_error_set(err, HG_E_FORMAT, "frame", "encoding",
            "the server sent another encoding than the one asked for");
    enum hg_status status = join_parts(r, frame, &data, &size, err);
    if (status)
        return status;
    status = hg_cli_frame_note(r, frame, name, took_ns, err);
    if (status)
        return status;
    r->doing = HG_CLI_DOING_ARGUMENTS;
    status = hg_cli_check_no_folder(name, err);
    if (status)
        return status;
    r->doing = HG_CLI_DOING_OUTPUT;
    status = hg_cli_write_output(name, data, size, err);
    if (status)
        return status;
    if (hg_cli_is_path(r->o))
        hg_cli_frame_drop_film(r, name);
    return HG_OK;
}

// What the next picture of a series needs is there before the picture itself is: a process that
// finds the one finds the other.
static bool keep_history(struct hg_cli_render *r, const char *name, const uint8_t job[32])
{
    const struct hg_cli_kept kept = {&r->cli, HGP_checkpoint_kind_HISTORY, name, job, 0, 0};
    struct hg_error err = {0};
    uint32_t samples;
    enum hg_status status = hg_cli_checkpoint_save(&kept, HG_CLI_PATIENCE_S, &samples, &err);
    if (status && !hg_cli_is_stopped()) {
        hg_cli_progress_say(&r->cli.progress, "%s.history: cannot be written: %s", name,
            err.reason[0] ? err.reason : hg_status_text(status));
    }
    return status == HG_OK;
}

// The picture is here: what it leaves behind, and its file.
static enum hg_status take_frame(struct hg_cli_render *r, const struct hgp_frame *frame,
    const struct making *making, struct hg_error *err)
{
    r->doing = HG_CLI_DOING_INPUT; // what is wrong with the picture came from the files
    enum hg_status status = hg_cli_check_warnings(&r->cli, err);
    if (status)
        return status;
    r->doing = HG_CLI_DOING_RENDER;
    const uint64_t now = hg_clock_now_ns(), took_ns = now - making->begin_ns;
    if (!r->first_frame_ns)
        r->first_frame_ns = now - r->cli.begin_ns;
    if (r->series && !r->streams)
        r->series->kept = keep_history(r, making->name, making->job);
    if (!making->wanted)
        return HG_OK;
    status = write_frame(r, frame, making->name, took_ns, err);
    if (!status)
        hg_cli_frame_note_light(r, frame, making->name);
    hg_cli_progress_frame(&r->cli.progress, took_ns);
    if (!status)
        hg_cli_progress_output(&r->cli.progress, making->name, took_ns);
    return status;
}

enum hg_status hg_cli_frame_make(struct hg_cli_render *r, const char *name, const uint8_t job[32],
    bool wanted, bool *again, struct hg_error *err)
{
    const struct making making = {name, job, wanted, hg_clock_now_ns()};
    struct helio_message *answer;
    *again = false;
    hg_cli_progress_stage(&r->cli.progress, "rendering");
    enum hg_status status = hg_cli_frame_resume(r, name, job, err);
    if (status)
        goto stopped;
    status = hg_cli_frame_wait(r, name, job, &answer, err);
    if (status)
        goto stopped;
    *again = hg_cli_series_is_lost(r);
    if (!*again && r->series)
        r->series->losses = hg_cli_frame_losses(r);
    if (!*again)
        status = take_frame(r, &answer->body->frame, &making, err);
    helio_message_free(answer);
    return status;
stopped:
    hg_cli_frame_leave_checkpoint(r, name, job);
    return status;
}

// A frame that is not there yet, or is not good.
enum hg_status hg_cli_frame_check(struct hg_cli_render *r, const char *name, const uint8_t job[32],
    bool *there, struct hg_error *err)
{
    *there = false;
    enum hg_status status =
        r->o->skip_existing ? hg_cli_frame_check_existing(r, name, job, there, err) : HG_OK;
    if (!status && *there) {
        r->skipped++;
        hg_cli_progress_frame(&r->cli.progress, 0);
        hg_cli_progress_output(&r->cli.progress, name, 0);
    }
    return status;
}

static enum hg_status render_frame(struct hg_cli_render *r, const char *name, struct hg_error *err)
{
    uint8_t job[32];
    bool there = false, again;
    r->doing = HG_CLI_DOING_RENDER;
    enum hg_status status = hg_cli_frame_ask_job(r, NULL, job, err);
    if (status)
        return status;
    status = hg_cli_frame_check(r, name, job, &there, err);
    if (status || there)
        return status;
    return hg_cli_frame_make(r, name, job, true, &again, err);
}

enum hg_status hg_cli_frame_set_time(struct hg_cli_render *r, double time_s, struct hg_error *err)
{
    r->doing = HG_CLI_DOING_RENDER;
    return hg_cli_animations_pose(&r->cli, r->cli.scene.first_id, &r->loaded.chosen, time_s, err);
}

// Frames that are averaged must not have the same noise: each one has a seed of its own. So have
// those whose noise is not to stand still.
static enum hg_status set_seed(struct hg_cli_render *r, uint32_t index, struct hg_error *err)
{
    struct hgp_view_set view = {.view = HG_CLI_VIEW,
        .has_seed = true,
        .seed = r->o->seed + (uint32_t)hg_cli_frame_at(r, index),
        .has_series_s = r->o->denoise && r->list.count > 1,
        .series_s = hg_cli_series_s(r, index)};
    if (!r->o->denoise && !r->o->animate_seed)
        return HG_OK;
    return helio_call_for(r->cli.h, HGP_T_view_set, &view, HGP_T_ok, NULL, err);
}

static enum hg_status set_turn(struct hg_cli_render *r, int32_t frame, struct hg_error *err)
{
    struct hgp_view_camera camera;
    if (!r->turntable.frames)
        return HG_OK;
    hg_cli_turntable_camera(&r->turntable, frame, &camera);
    camera.input_seq = ++r->turntable.start.input_seq;
    return hg_cli_frame_camera(r, &camera, err);
}

void hg_cli_frame_file(const struct hg_cli_render *r, int32_t frame, char *dst, size_t size)
{
    if (!hg_cli_frame_name(r->output, frame, dst, size))
        snprintf(dst, size, "%s", r->output);
}

enum hg_status hg_cli_frame_check_files(const struct hg_cli_render *r, struct hg_error *err)
{
    char name[4096];
    enum hg_status status = HG_OK;
    for (uint32_t i = 0; i < r->list.count && !status && !r->streams; i++) {
        hg_cli_frame_file(r, hg_cli_frame_at(r, i), name, sizeof name);
        status = hg_cli_check_no_folder(name, err);
    }
    return status;
}

int32_t hg_cli_frame_at(const struct hg_cli_render *r, uint32_t index)
{
    return r->list.numbers[index];
}

uint32_t hg_cli_frame_count(const struct hg_cli_render *r)
{
    return r->list.count;
}

enum hg_status hg_cli_frame_go_to(struct hg_cli_render *r, uint32_t index, struct hg_error *err)
{
    const int32_t frame = hg_cli_frame_at(r, index);
    enum hg_status status =
        hg_cli_frame_set_time(r, r->o->has_at ? r->o->at : frame / hg_cli_fps(r->o), err);
    if (!status)
        status = set_turn(r, frame, err);
    return status ? status : set_seed(r, index, err);
}

// All pictures of a series have the exposure of the first one, whichever of them are there already
// and the process that renders the others.
static enum hg_status meter_series(struct hg_cli_render *r, struct hg_error *err)
{
    const struct hgp_exposure_query query = {.view = HG_CLI_VIEW};
    struct helio_message *answer;
    if (!hg_cli_meters_exposure(r))
        return HG_OK;
    enum hg_status status = hg_cli_frame_go_to(r, 0, err);
    if (status)
        return status;
    hg_cli_progress_stage(&r->cli.progress, "metering the exposure");
    status = helio_call_for(r->cli.h, HGP_T_exposure_query, &query, HGP_T_exposure, &answer, err);
    if (status)
        return status;
    const struct hgp_view_set view = {.view = HG_CLI_VIEW,
        .has_exposure_mode = true,
        .exposure_mode = HGP_exposure_mode_FIXED,
        .has_exposure_ev = true,
        .exposure_ev = answer->body->exposure.exposure_ev};
    helio_message_free(answer);
    r->light.metered = true;
    r->light.ev = view.exposure_ev;
    if (r->light.ev != 0 && !r->o->claim) // those that share the frames meter the same one
        hg_cli_progress_say(&r->cli.progress,
            "the exposure, %.3g stops, is metered at frame %d; other commands of the same series "
            "need "
            "--exposure=%.9g",
            (double)r->light.ev, hg_cli_frame_at(r, 0), (double)r->light.ev);
    return helio_call_for(r->cli.h, HGP_T_view_set, &view, HGP_T_ok, NULL, err);
}

enum hg_status hg_cli_frame_render(struct hg_cli_render *r, uint32_t i, struct hg_error *err)
{
    char name[4096];
    if (r->series)
        return hg_cli_series_render_frame(r, i, err);
    hg_cli_frame_file(r, hg_cli_frame_at(r, i), name, sizeof name);
    enum hg_status status = hg_cli_frame_go_to(r, i, err);
    return status ? status : render_frame(r, name, err);
}

static enum hg_status render_all_frames(struct hg_cli_render *r, struct hg_error *err)
{
    const uint32_t count = hg_cli_frame_count(r);
    enum hg_status status = HG_OK;
    hg_cli_progress_frames(&r->cli.progress, count);
    for (uint32_t i = 0; i < count && !status; i++) {
        r->next = i;
        hg_cli_progress_begin_frame(&r->cli.progress, hg_cli_frame_at(r, i), i + 1);
        status = hg_cli_frame_render(r, i, err);
    }
    r->next = status ? r->next : count;
    for (uint32_t i = 0; i < count && !status && r->series; i++)
        hg_cli_series_drop_history(r, i);
    return status;
}

enum hg_status hg_cli_render_frames(struct hg_cli_render *r, struct hg_error *err)
{
    const struct hg_cli_options *o = r->o;
    if (r->list.count == 0) {
        hg_cli_progress_frames(&r->cli.progress, 1);
        bool moves = (o->has_shutter || o->has_shutter_s || (r->planes >> HGP_plane_MOTION & 1)) &&
                     r->loaded.animations > 0;
        enum hg_status status =
            o->has_at || moves || o->has_animation ? hg_cli_frame_set_time(r, o->at, err) : HG_OK;
        return status ? status : render_frame(r, r->output, err);
    }
    if (r->list.count > 1 && !r->turntable.frames && r->loaded.animations == 0)
        hg_cli_progress_say(&r->cli.progress,
            "nothing moves in these %u frames: the scene has no animation, and the camera stays "
            "where it is",
            r->list.count);
    if (hg_cli_is_series(r)) {
        r->series = hg_calloc(1, sizeof *r->series + (size_t)hg_cli_frame_count(r) * 32);
        if (!r->series)
            return hg_error_set(err, HG_E_NOMEM, "--frames", NULL, "no memory for so many");
    }
    enum hg_status status = meter_series(r, err);
    if (status)
        return status;
    return r->o->claim ? hg_cli_frames_share(r, err) : render_all_frames(r, err);
}

// 2.3 s, 3 min 20 s, 2 h 5 min.
static void format_time(uint64_t ns, char *dst, size_t size)
{
    const double seconds = (double)ns / 1e9;
    const unsigned whole = (unsigned)seconds;
    if (seconds < 60)
        snprintf(dst, size, "%.1f s", seconds);
    else if (whole < 3600)
        snprintf(dst, size, "%u min %u s", whole / 60, whole % 60);
    else
        snprintf(dst, size, "%u h %u min", whole / 3600, whole / 60 % 60);
}

void hg_cli_render_summary(struct hg_cli_render *r)
{
    struct hg_cli_progress *p = &r->cli.progress;
    char took[32], first[4096], last[4096];
    if (p->mode == HG_CLI_PROGRESS_JSON)
        return;
    format_time(hg_clock_now_ns() - r->cli.begin_ns, took, sizeof took);
    if (r->list.count == 0) {
        if (p->outputs.skipped)
            hg_cli_progress_say(p, "%s was there already", r->output);
        else
            hg_cli_progress_say(p, "wrote %s (%u x %u) in %s", r->output,
                r->o->has_region ? r->o->region.width : r->size.width,
                r->o->has_region ? r->o->region.height : r->size.height, took);
        return;
    }
    hg_cli_frame_file(r, hg_cli_frame_at(r, 0), first, sizeof first);
    hg_cli_frame_file(r, hg_cli_frame_at(r, hg_cli_frame_count(r) - 1), last, sizeof last);
    if (p->outputs.skipped)
        hg_cli_progress_say(p, "wrote %u of %u frames, %s to %s, in %s; %u were there already%s",
            p->outputs.written, hg_cli_frame_count(r), first, last, took, p->outputs.skipped,
            r->o->claim ? " or are of other commands" : "");
    else
        hg_cli_progress_say(p, "wrote %u frame%s, %s to %s, in %s", p->outputs.written,
            p->outputs.written == 1 ? "" : "s", first, last, took);
}

// What renders the frames that are not there, with the exposure of those that are.
static void say_rest(struct hg_cli_render *r)
{
    struct hg_cli_progress *p = &r->cli.progress;
    const uint32_t written = p->outputs.written;
    const char *frames = written == 1 ? "frame is" : "frames are";
    char rest[1024], exposure[32] = "";
    if (r->o->claim) { // others may be at the rest
        hg_cli_progress_say(p, "%u %s written; the same command goes on", written, frames);
        return;
    }
    hg_frame_list_text(r->list.numbers + r->next, r->list.count - r->next, rest, sizeof rest);
    if (r->light.metered)
        snprintf(exposure, sizeof exposure, " --exposure=%.9g", (double)r->light.ev);
    if (r->series || strstr(rest, "..."))
        hg_cli_progress_say(p,
            "%u %s written; the same command with --skip-existing renders the rest", written,
            frames);
    else
        hg_cli_progress_say(
            p, "%u %s written; --frames %s%s renders the rest", written, frames, rest, exposure);
}

void hg_cli_render_stopped(struct hg_cli_render *r)
{
    struct hg_cli_progress *p = &r->cli.progress;
    if (r->series || (r->next > 0 && r->next < r->list.count))
        say_rest(r);
    if (r->film.is_left)
        hg_cli_progress_say(p, "stopped early; the same command with --resume goes on from there");
    else if (r->film.failed)
        hg_cli_progress_say(p, "nothing of the film was kept");
}
