// frame_wait.c - helio render: waiting for a settled frame, with its film kept on the way.
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/clock.h"
#include "client/cli/render/frames.h"

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

// A daemon that is about to end its sessions.
static void note_drain(struct hg_cli_render *r, const struct hgp_drain *drain)
{
    char reason[260];
    hg_cli_clean(reason, sizeof reason, drain->reason.data, drain->reason.size);
    hg_cli_progress_say(&r->cli.progress, "the session ends in %.0f s%s%s",
        (double)drain->deadline_ms / 1e3, reason[0] ? ": " : "", reason);
    r->daemon.closes_ns = hg_clock_now_ns() + (uint64_t)drain->deadline_ms * 1000000;
    r->daemon.has_said = true;
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
            note_drain(r, &m->body->drain);
        else if (m->type == HGP_T_notice)
            hg_cli_on_notice(&cli->progress, &m->body->notice);
        else if (m->type == HGP_T_error) // ours, or of a message without an answer: a camera
            helio_message_error(cli->h, m, err);
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

static uint64_t min_ns(uint64_t a, uint64_t b)
{
    return a < b ? a : b;
}

// Of the whole picture.
static uint32_t total_samples(const struct hg_cli_render *r)
{
    struct hgp_view_set view;
    hg_cli_render_view(r, &view);
    return view.has_samples ? view.samples
                            : (uint32_t)atoi(hgp_view_params[HGP_VIEW_samples].standard);
}

static struct hg_cli_kept film_of(struct hg_cli_render *r, const char *name, const uint8_t job[32])
{
    return (struct hg_cli_kept){&r->cli, HGP_checkpoint_kind_FILM, name, job,
        .least = r->film.samples > 0 ? r->film.samples : 1, .total = total_samples(r)};
}

static enum hg_status save_film(
    struct hg_cli_render *r, const char *name, const uint8_t job[32], struct hg_error *err)
{
    const struct hg_cli_kept kept = film_of(r, name, job);
    uint32_t samples;
    enum hg_status status = hg_cli_checkpoint_save(&kept, HG_CLI_PATIENCE_S, &samples, err);
    r->film.failed = status && status != HG_E_STATE; // nothing worth keeping yet
    if (status)
        return status;
    r->film.is_left = true;
    r->film.samples = samples;
    return HG_OK;
}

static enum hg_status load_film(
    struct hg_cli_render *r, const char *name, const uint8_t job[32], struct hg_error *err)
{
    const struct hg_cli_kept kept = film_of(r, name, job);
    uint32_t samples = 0;
    enum hg_status status = hg_cli_checkpoint_load(&kept, &samples, err);
    r->film.samples = samples; // 0: what is there is of no use
    if (!status && samples)
        hg_cli_progress_say(&r->cli.progress, "%s: goes on from %u samples", name, samples);
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
    case HG_E_STATE:
        return HG_OK;
    case HG_E_NOSPACE:
    case HG_E_PERM:
    case HG_E_NOTFOUND:
    case HG_E_IO:
    case HG_E_NOMEM:
    case HG_E_LIMIT:
        hg_cli_progress_say(&r->cli.progress, "%s.checkpoint: %s; the rendering goes on", name,
            wrong.reason[0] ? wrong.reason : hg_status_text(status));
        return HG_OK;
    default:
        *err = wrong;
        return status;
    }
}

// A view that was lost and made again knows no job, and begins the picture again but for what was
// kept of it.
static enum hg_status go_on(
    struct hg_cli_render *r, const char *name, const uint8_t job[32], struct hg_error *err)
{
    uint8_t same[32];
    if (r->daemon.losses == hg_cli_frame_losses(r))
        return HG_OK;
    enum hg_status status = hg_cli_frame_ask_job(r, NULL, same, err);
    if (status || !hg_cli_is_path(r->o) || !r->film.is_left)
        return status;
    return load_film(r, name, job, err);
}

// A frame that is waited for.
struct waiting {
    struct hg_cli_render *r;
    const char *name;
    const uint8_t *job;   // [32]
    uint64_t deadline_ns; // UINT64_MAX = none
    uint64_t save_ns;     // when its film is kept next
    double save_every_s;
};

static struct waiting begin_waiting(
    struct hg_cli_render *r, const char *name, const uint8_t job[32])
{
    const struct hg_cli_options *o = r->o;
    const uint64_t now = hg_clock_now_ns();
    const double every_s = o->has_checkpoint ? o->checkpoint : 1e12;
    return (struct waiting){.r = r,
        .name = name,
        .job = job,
        .deadline_ns = o->has_timeout ? add_s(now, o->timeout) : UINT64_MAX,
        .save_ns = add_s(now, every_s),
        .save_every_s = every_s};
}

// While the daemon is about to stop the film is kept as long as it lasts: at once when that is
// said, then in quarters of the time that is left, of the frames that follow, too.
static void heed_drain(struct waiting *w)
{
    struct hg_cli_daemon *daemon = &w->r->daemon;
    struct helio_info info;
    helio_get_info(w->r->cli.h, &info);
    if (!info.draining) // it goes on after all
        daemon->closes_ns = 0;
    if (!daemon->closes_ns || !hg_cli_is_path(w->r->o) || w->r->streams)
        return;
    const uint64_t now = hg_clock_now_ns();
    const double left_s = daemon->closes_ns > now ? (double)(daemon->closes_ns - now) / 1e9 : 0;
    w->save_every_s = fmin(w->save_every_s, fmax(left_s / 4, 0.1));
    w->save_ns = daemon->has_said ? now : min_ns(w->save_ns, add_s(now, w->save_every_s));
    daemon->has_said = false;
}

// Until something comes, or the film is to be kept, which is done then.
static enum hg_status wait_on(struct waiting *w, struct hg_error *err)
{
    enum hg_status status = go_on(w->r, w->name, w->job, err);
    if (status)
        return status;
    heed_drain(w);
    const uint64_t now = hg_clock_now_ns();
    const uint64_t until = min_ns(w->save_ns, w->deadline_ns);
    status = helio_wait(w->r->cli.h,
        until == UINT64_MAX ? HELIO_NO_TIMEOUT
        : until > now       ? until - now
                            : 0,
        err);
    const uint64_t after = hg_clock_now_ns();
    if (status && (status != HG_E_TIMEOUT || after >= w->deadline_ns))
        return status;
    if (after < w->save_ns)
        return HG_OK;
    status = save_interval(w->r, w->name, w->job, err);
    w->save_ns = add_s(hg_clock_now_ns(), w->save_every_s);
    return status;
}

// The frames per second of a series as a ratio: whole numbers, those of NTSC (24000/1001), or
// thousandths.
static void add_rate(const struct hg_cli_render *r, struct hgp_frame_request *m)
{
    const double fps = hg_cli_fps(r->o), ntsc = round(fps * 1.001);
    const bool is_ntsc = fabs(ntsc / 1.001 - fps) < 0.005 && fabs(fps - round(fps)) > 1e-6;
    const bool is_whole = fabs(fps - round(fps)) <= 1e-6;
    m->has_rate_numerator = r->list.count > 0;
    m->rate_numerator = (uint32_t)(is_whole ? round(fps) : round((is_ntsc ? ntsc : fps) * 1000));
    m->has_rate_denominator = m->has_rate_numerator;
    m->rate_denominator = is_whole ? 1 : is_ntsc ? 1001 : 1000;
}

// The settled frame, or NULL: its request was lost with the connection. On the way there the film
// is written to OUT.checkpoint in intervals.
static enum hg_status wait_frame(struct hg_cli_render *r, const char *name, const uint8_t job[32],
    struct helio_message **frame, struct hg_error *err)
{
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
    if (request.encoding == HGP_encoding_EXR_HALF || request.encoding == HGP_encoding_EXR_FLOAT)
        add_rate(r, &request);
    uint32_t id;
    *frame = NULL;
    hg_writer_finish(&r->parts);
    enum hg_status status = go_on(r, name, job, err);
    if (status)
        return status;
    status = hg_cli_send(&r->cli, HGP_T_frame_request, &request, &id, err);
    if (status)
        return status;
    const uint32_t connection = hg_cli_frame_connection(r);
    struct waiting waiting = begin_waiting(r, name, job);
    struct hg_error told = {0};
    while (!take_messages(r, id, frame, &told)) {
        if (hg_cli_frame_connection(r) != connection) {
            hg_cli_progress_say(&r->cli.progress, "%s: requested again on a new connection", name);
            return HG_OK;
        }
        status = wait_on(&waiting, err);
        if (status)
            return status;
    }
    if (!told.status)
        return HG_OK;
    *err = told;
    if (strcmp(told.what, "camera") == 0)
        r->doing = HG_CLI_DOING_ARGUMENTS;
    return told.status;
}

// Frames that are lost, or of a worker that does not know the job, are requested again.
enum hg_status hg_cli_frame_wait(struct hg_cli_render *r, const char *name, const uint8_t job[32],
    struct helio_message **frame, struct hg_error *err)
{
    for (;;) {
        const uint32_t losses = r->daemon.losses;
        enum hg_status status = wait_frame(r, name, job, frame, err);
        if (status) {
            status = hg_cli_wait_for_pixels(&r->cli, status, err);
            if (status)
                return status;
            continue;
        }
        if (losses == hg_cli_frame_losses(r) || hg_cli_series_is_lost(r))
            return HG_OK;
        helio_message_free(*frame);
        *frame = NULL;
    }
}

// What a command that is stopped leaves of the frame it was at.
void hg_cli_frame_leave_checkpoint(struct hg_cli_render *r, const char *name, const uint8_t job[32])
{
    struct hg_error err = {0};
    if (!hg_cli_is_path(r->o) || !hg_cli_is_stopped() || r->streams)
        return;
    enum hg_status status = save_film(r, name, job, &err);
    if (status && status != HG_E_STATE)
        hg_cli_progress_say(&r->cli.progress, "%s.checkpoint: cannot be written: %s", name,
            err.reason[0] ? err.reason : hg_status_text(status));
}

static enum hg_status set_samples(struct hg_cli_render *r, uint32_t samples, struct hg_error *err)
{
    const struct hgp_view_set view = {.view = HG_CLI_VIEW, .has_samples = true, .samples = samples};
    return helio_call_for(r->cli.h, HGP_T_view_set, &view, HGP_T_ok, NULL, err);
}

// The number of samples determines their pattern, so a film of another number cannot go on; it is
// too much work to be replaced unasked.
static enum hg_status check_total(
    struct hg_cli_render *r, const char *name, const uint8_t job[32], struct hg_error *err)
{
    struct hg_cli_checkpoint_head head;
    uint8_t its[32];
    const uint32_t total = total_samples(r);
    if (!hg_cli_checkpoint_look(HGP_checkpoint_kind_FILM, name, &head) || !head.samples ||
        head.total == total || memcmp(head.job, job, sizeof head.job) == 0)
        return HG_OK;
    enum hg_status status = set_samples(r, head.total, err);
    if (!status)
        status = hg_cli_frame_ask_job(r, NULL, its, err);
    if (!status)
        status = set_samples(r, total, err);
    if (status || memcmp(head.job, its, sizeof its) != 0) // of another picture anyway
        return status;
    r->doing = HG_CLI_DOING_ARGUMENTS;
    return hg_error_set(err, HG_E_INVAL, "--resume", NULL,
        "%s.checkpoint holds %u of the %u samples of this picture, and their pattern depends on "
        "the total: continue with --samples %u, or render %u from the start without --resume",
        name, head.samples, head.total, head.total, total);
}

enum hg_status hg_cli_frame_resume(
    struct hg_cli_render *r, const char *name, const uint8_t job[32], struct hg_error *err)
{
    if (!r->o->resume && !r->film.is_left)
        return HG_OK;
    enum hg_status status = check_total(r, name, job, err);
    if (!status)
        status = load_film(r, name, job, err);
    r->film.is_left |= !status && r->film.samples > 0;
    return status;
}
