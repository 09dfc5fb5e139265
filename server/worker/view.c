// view.c - views: their parameters, the frames they owe, and whose turn it is to render.
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "base/alloc.h"
#include "base/clock.h"
#include "base/log.h"
#include "server/worker/serve.h"

enum {
    STEP_TARGET_NS = 50 * 1000 * 1000,
    MAX_SAMPLES_PER_STEP = 16,
    PROGRESS_NS = 200 * 1000 * 1000
};
// A batch left open does not stop other people's frames for longer than this.
static const uint64_t batch_patience_ns = 2000000000u;

// ---- messages -----------------------------------------------------------------------------------

static uint64_t pixels_of(const struct hg_view_params *p)
{
    return (uint64_t)(p->width ? p->width : 1280) * (p->height ? p->height : 720);
}

static enum hg_status check_quota(const struct request *r, const struct view_slot *changed,
    const struct hg_view_params *params, struct hg_error *err)
{
    uint64_t total = pixels_of(params);
    for (const struct view_slot *it = r->session->views; it; it = it->next)
        if (it != changed)
            total += pixels_of(&it->params);
    if (total > r->session->max_pixels)
        return hg_error_set(err, HG_E_LIMIT, "view_set", "width",
            "%llu pixels are more than this session's %llu", (unsigned long long)total,
            (unsigned long long)r->session->max_pixels);
    return HG_OK;
}

static void overlay_params(struct hg_view_params *p, const struct hgp_view_set *m)
{
    if (m->has_width)
        p->width = m->width;
    if (m->has_height)
        p->height = m->height;
    if (m->has_tonemap)
        p->tonemap = (enum hg_tonemap)m->tonemap;
    if (m->has_exposure_ev)
        p->exposure_ev = m->exposure_ev;
    if (m->has_background)
        p->background = (enum hg_background)m->background;
    if (m->has_background_color)
        memcpy(p->background_color, m->background_color, sizeof p->background_color);
    if (m->has_samples)
        p->samples = m->samples;
    if (m->has_seed)
        p->seed = m->seed;
    if (m->has_debug_view)
        p->debug = (enum hg_debug_view)m->debug_view;
    if (m->has_error_px)
        p->error_px = m->error_px;
    if (m->has_target_ms)
        p->target_ms = m->target_ms;
    if (m->has_mode)
        p->mode = (enum hg_render_mode)m->mode;
    if (m->has_trace)
        p->trace = (enum hg_view_trace)m->trace;
    if (m->has_max_bounces)
        p->max_bounces = m->max_bounces;
    if (m->has_noise)
        p->noise = m->noise;
    if (m->has_time_limit_s)
        p->time_s = m->time_limit_s;
    if (m->has_denoise)
        p->denoise = (enum hg_view_denoise)m->denoise;
    if (m->has_frame_s)
        p->frame_s = m->frame_s;
    if (m->has_shutter_open)
        p->shutter_open = m->shutter_open;
    if (m->has_shutter_close)
        p->shutter_close = m->shutter_close;
    if (m->has_series_s)
        p->series_s = m->series_s;
    if (m->has_filter)
        p->filter = (enum hg_filter)m->filter;
    if (m->has_filter_radius_px)
        p->filter_radius_px = m->filter_radius_px;
    if (m->has_clamp_indirect)
        p->clamp_indirect = m->clamp_indirect;
}

static enum hg_status overlay_planes(
    struct hg_view_params *p, uint32_t *mattes, const struct hgp_view_set *m, struct hg_error *err)
{
    return m->has_planes ? film_planes(m->planes, &p->planes, mattes, err) : HG_OK;
}

static void overlay_delivery(struct view_slot *view, const struct hgp_view_set *m)
{
    if (m->has_encoding)
        view->encoding = m->encoding;
    if (m->has_still_encoding)
        view->still_encoding = m->still_encoding;
    if (m->has_quality)
        view->quality = m->quality;
    if (m->has_max_fps)
        view->max_fps = m->max_fps;
}

static enum hg_status create_view(
    const struct request *r, uint32_t number, struct view_slot **out, struct hg_error *err)
{
    enum hg_status status = serve_need_renderer(r->s, err);
    if (status)
        return status;
    struct view_slot *view = hg_calloc(1, sizeof *view);
    if (!view)
        return hg_error_set(err, HG_E_NOMEM, "view_set", NULL, "no memory for a view");
    status = hg_view_create(r->s->renderer, r->session->scene->scene, &view->view, err);
    if (status) {
        hg_free(view);
        return status;
    }
    view->number = number;
    view->encoding = HGP_encoding_JPEG;
    view->still_encoding = HGP_encoding_ZSTD_RGBA8;
    view->quality = 80;
    view->max_fps = 60;
    view->next = r->session->views;
    r->session->views = view;
    atomic_fetch_add(&r->s->w->view_count, 1);
    *out = view;
    return HG_OK;
}

void view_set(const struct request *r)
{
    const struct hgp_view_set *m = &r->message->view_set;
    struct hg_error err = {0};
    struct view_slot *view = session_find_view(r->session, m->view), *made = NULL;
    struct hg_view_params params = view ? view->params : (struct hg_view_params){0};
    enum hg_status status = HG_OK;
    overlay_params(&params, m);
    uint32_t mattes = view ? view->mattes : 0;
    status = overlay_planes(&params, &mattes, m, &err);
    params.mattes = mattes;
    if (!status)
        status = check_quota(r, view, &params, &err);
    if (!status && !view)
        status = create_view(r, m->view, &made, &err);
    if (made)
        view = made;
    if (!status)
        status = hg_view_set_params(view->view, &params, &err);
    if (status) {
        if (made)
            view_slot_destroy(r->s, r->session, made);
        serve_fail(r, &err);
        return;
    }
    view->params = params;
    view->mattes = mattes;
    view->changed = true;
    overlay_delivery(view, m);
    serve_ok(r);
}

void view_close(const struct request *r)
{
    struct view_slot *view = session_need_view(r, r->message->view_close.view);
    if (!view)
        return;
    struct hg_error err = {0};
    hg_error_set(&err, HG_E_CANCELLED, "view", NULL, "the view was closed");
    for (struct frame_wait *wait = view->waits; wait; wait = wait->next)
        link_send_error(r->s->w, r->channel, wait->request, &err);
    view_slot_destroy(r->s, r->session, view);
    serve_ok(r);
}

static void overlay_camera(struct hg_view_camera *c, const struct hgp_view_camera *m)
{
    c->input_seq = m->input_seq;
    if (m->has_eye)
        memcpy(c->eye, m->eye, sizeof c->eye);
    if (m->has_target)
        memcpy(c->target, m->target, sizeof c->target);
    if (m->has_up)
        memcpy(c->up, m->up, sizeof c->up);
    if (m->has_kind)
        c->orthographic = m->kind == HGP_camera_kind_ORTHOGRAPHIC;
    if (m->has_vfov_rad)
        c->vfov_rad = m->vfov_rad;
    if (m->has_half_height)
        c->half_height = m->half_height;
    if (m->has_near)
        c->near = m->near;
    if (m->has_far)
        c->far = m->far;
    if (m->has_lens_radius)
        c->lens_radius = m->lens_radius;
    if (m->has_focus_distance)
        c->focus_distance = m->focus_distance;
    c->moves = m->has_next_eye || m->has_next_target;
    memcpy(c->next_eye, m->has_next_eye ? m->next_eye : c->eye, sizeof c->next_eye);
    memcpy(c->next_target, m->has_next_target ? m->next_target : c->target, sizeof c->next_target);
    memset(c->next_up, 0, sizeof c->next_up);
    if (m->has_next_up)
        memcpy(c->next_up, m->next_up, sizeof c->next_up);
}

void view_camera(const struct request *r)
{
    const struct hgp_view_camera *m = &r->message->view_camera;
    struct view_slot *view = session_need_view(r, m->view);
    if (!view)
        return;
    struct hg_error err = {0};
    struct hg_view_camera camera = view->camera;
    uint64_t node = m->has_camera ? m->camera : 0;
    overlay_camera(&camera, m);
    if (node)
        hg_scene_update(r->session->scene->scene);
    enum hg_status status = node ? hg_view_set_camera_node(view->view, node, &camera, &err)
                                 : hg_view_set_camera(view->view, &camera, &err);
    if (status) {
        serve_fail(r, &err);
        return;
    }
    view->camera = camera;
    view->camera_node = node;
    view->camera_node_revision = r->session->scene->scene->revision;
    view->changed = true;
    serve_ok(r);
}

void view_frame_request(const struct request *r)
{
    const struct hgp_frame_request *m = &r->message->frame_request;
    struct view_slot *view = session_need_view(r, m->view);
    if (!view)
        return;
    struct frame_wait *wait = hg_calloc(1, sizeof *wait);
    if (!wait) {
        struct hg_error err = {0};
        hg_error_set(&err, HG_E_NOMEM, "frame_request", NULL, "no memory");
        serve_fail(r, &err);
        return;
    }
    wait->request = r->id;
    wait->settled = m->settled;
    wait->parts = m->has_parts && m->parts;
    wait->encoding = m->has_encoding ? m->encoding
                     : m->settled    ? view->still_encoding
                                     : view->encoding;
    wait->quality = m->has_quality ? m->quality : view->quality;
    struct frame_wait **end = &view->waits;
    while (*end)
        end = &(*end)->next;
    *end = wait;
    view->failed = false;
}

void view_subscribe(const struct request *r)
{
    struct view_slot *view = session_need_view(r, r->message->subscribe.view);
    if (!view)
        return;
    view->credit = r->message->subscribe.credit_frames;
    view->sent_number = 0;
    view->fresh = true;
    view->failed = false;
    serve_ok(r);
}

void view_credit(const struct request *r)
{
    struct view_slot *view = session_need_view(r, r->message->credit.view);
    if (view && view->credit < UINT32_MAX - 1024)
        view->credit += r->message->credit.frames;
}

// ---- frames -------------------------------------------------------------------------------------

static float asked_error_px(const struct hg_view_params *p)
{
    return p->error_px > 0 ? p->error_px : 1;
}

// A picture that lacks textures is not passed on in silence.
static void tell_failures(
    struct serve *s, struct session *session, struct view_slot *view, uint32_t request)
{
    const uint32_t failed = hg_view_failed_textures(view->view);
    if (failed == view->told_failures)
        return;
    view->told_failures = failed;
    if (failed == 0)
        return;
    char text[96];
    snprintf(text, sizeof text, "%u of the images cannot be read and are drawn white", failed);
    link_send(s->w, session->channel, request, HGP_T_notice,
        &(struct hgp_notice){
            .code = HG_E_IO, .what = hgp_str_make("textures"), .reason = hgp_str_make(text)});
}

static enum hg_status queue_frame(struct serve *s, struct session *session, struct view_slot *view,
    const struct frame_wait *what, struct hg_error *err)
{
    struct encode_job *job = hg_calloc(1, sizeof *job);
    if (!job)
        return hg_error_set(err, HG_E_NOMEM, "frame", NULL, "no memory");
    uint64_t start = hg_clock_now_ns();
    enum hg_status status =
        hg_view_read_pixels(view->view, encode_pixel_format(what->encoding), &job->pixels, err);
    if (status) {
        encode_job_destroy(job);
        return status;
    }
    tell_failures(s, session, view, what->request);
    const struct hg_frame_info *info = &view->info;
    job->channel = session->channel;
    job->request = what->request;
    job->quality = what->quality;
    job->parts = what->parts;
    job->opaque = view->params.background != HG_BACKGROUND_NONE;
    job->info = *info;
    job->read_ns = hg_clock_now_ns() - start;
    job->frame = (struct hgp_frame){
        .view = view->number,
        .number = info->number,
        .scene_revision = info->scene_revision,
        .input_seq = info->input_seq,
        .width = info->width,
        .height = info->height,
        .encoding = what->encoding,
        .samples = info->samples,
        .missing_pages = info->missing_pages,
        .missing_clusters = info->missing_clusters,
        .settled = info->settled,
        .has_mip_bias = info->mip_bias > 0,
        .mip_bias = info->mip_bias,
        .has_error_px = info->error_px > asked_error_px(&view->params),
        .error_px = info->error_px,
        .has_mode = view->params.mode == HG_MODE_PATH,
        .mode = HGP_render_mode_PATH,
        .has_noise = info->noise > 0,
        .noise = info->noise,
    };
    status = film_attach(s, session, view, job, err);
    if (status) {
        encode_job_destroy(job);
        return status;
    }
    while ((status = hg_queue_push(&s->w->encode, job)) == HG_E_AGAIN)
        hg_clock_sleep_ns(500000); // at most a few frames are under way; the encoder is catching up
    if (status)
        encode_job_destroy(job);
    return HG_OK;
}

static void send_stage(struct serve *s, struct session *session, struct frame_wait *wait,
    const struct hgp_progress *progress)
{
    link_send_lossy(s->w, session->channel, wait->request, HGP_T_progress, progress);
}

// Bakes in the background, as long as they run; counted since the frame was asked for.
static void send_baking(
    struct serve *s, struct session *session, struct view_slot *view, struct frame_wait *wait)
{
    struct hg_baking b;
    hg_view_baking(view->view, &b);
    // A bake that is given up counts no more.
    if (!wait->began || wait->baked_before > b.texels_done)
        wait->baked_before = b.texels_done;
    wait->began = true;
    wait->most_baking = b.mesh_parts > wait->most_baking ? b.mesh_parts : wait->most_baking;
    if (b.texels_done < b.texels_total)
        send_stage(s, session, wait,
            &(struct hgp_progress){.stage = hgp_str_make("baking textures"),
                .done = b.texels_done - wait->baked_before,
                .total = b.texels_total - wait->baked_before});
    if (b.mesh_parts > 0)
        send_stage(s, session, wait,
            &(struct hgp_progress){.stage = hgp_str_make("baking meshes"),
                .done = wait->most_baking - b.mesh_parts,
                .total = wait->most_baking});
}

// How many samples a settled frame will have, as far as can be told: what the parameters allow, or
// what fits into the time limit, or what brings the error down to the one asked for. Samples of a
// path-traced picture that goes on from a checkpoint are compared with the time of all its runs.
static uint32_t expected_samples(const struct view_slot *view)
{
    const struct hg_view_params *p = &view->params;
    const struct hg_frame_info *info = &view->info;
    double total = p->samples ? p->samples : 32, n = info->samples;
    double spent_s = (double)(info->spent_ns > 0 ? info->spent_ns : view->spent_ns) * 1e-9;
    if (p->time_s > 0 && n > 0 && spent_s > 0)
        total = fmin(total, n * (double)p->time_s / spent_s);
    if (p->noise > 0 && info->noise > 0) // falls with the square root
        total = fmin(total,
            n * (double)info->noise * (double)info->noise / ((double)p->noise * (double)p->noise));
    return (uint32_t)fmax(ceil(total), n);
}

static void send_progress(
    struct serve *s, struct session *session, struct view_slot *view, struct frame_wait *wait)
{
    uint64_t now = hg_clock_now_ns();
    uint32_t missing = view->info.missing_pages + view->info.missing_clusters;
    wait->most_missing = missing > wait->most_missing ? missing : wait->most_missing;
    if (now - wait->progress_sent_ns < PROGRESS_NS)
        return;
    wait->progress_sent_ns = now;
    send_baking(s, session, view, wait);
    struct hgp_progress progress = {.stage = hgp_str_make("samples"),
        .done = view->info.samples,
        .total = expected_samples(view)};
    if (missing)
        progress = (struct hgp_progress){.stage = hgp_str_make("streaming"),
            .done = wait->most_missing - missing,
            .total = wait->most_missing};
    send_stage(s, session, wait, &progress);
}

static void answer_waits(struct serve *s, struct session *session, struct view_slot *view)
{
    for (struct frame_wait **link = &view->waits; *link;) {
        struct frame_wait *wait = *link;
        if (wait->settled && !view->info.settled) {
            send_progress(s, session, view, wait);
            link = &wait->next;
            continue;
        }
        struct hg_error err = {0};
        if (queue_frame(s, session, view, wait, &err))
            link_send_error(s->w, session->channel, wait->request, &err);
        *link = wait->next;
        hg_free(wait);
    }
}

static void fail_waits(
    struct serve *s, struct session *session, struct view_slot *view, const struct hg_error *err)
{
    view->failed = true;
    view->failed_revision = session->scene->scene->revision;
    if (!view->waits) // a subscription: tell once, then rest until something changes
        link_send_error(s->w, session->channel, 0, err);
    while (view->waits) {
        struct frame_wait *wait = view->waits;
        link_send_error(s->w, session->channel, wait->request, err);
        view->waits = wait->next;
        hg_free(wait);
    }
}

// First frame of a new state at once, then at doubling sample counts, then the settled one.
static bool subscription_wants(const struct view_slot *view)
{
    const struct hg_frame_info *info = &view->info;
    if (!view->credit || !view->stepped || view->sent_number == info->number)
        return false;
    return view->fresh || info->samples <= view->sent_samples ||
           info->samples >= 2 * view->sent_samples || info->settled;
}

static uint64_t subscription_due_ns(const struct view_slot *view)
{
    return view->sent_ns + (uint64_t)(1e9 / (double)view->max_fps);
}

static void serve_subscription(struct serve *s, struct session *session, struct view_slot *view)
{
    if (!subscription_wants(view) || hg_clock_now_ns() < subscription_due_ns(view))
        return;
    struct hg_error err = {0};
    struct frame_wait what = {
        .encoding = view->info.settled ? view->still_encoding : view->encoding,
        .quality = view->quality,
    };
    if (queue_frame(s, session, view, &what, &err)) {
        fail_waits(s, session, view, &err);
        return;
    }
    view->credit--;
    view->sent_ns = hg_clock_now_ns();
    view->sent_number = view->info.number;
    view->sent_samples = view->info.samples;
    view->fresh = false;
}

// ---- stepping -----------------------------------------------------------------------------------

static bool is_stale(const struct session *session, const struct view_slot *view)
{
    return !view->stepped || view->changed ||
           view->info.scene_revision != session->scene->scene->revision;
}

// A step that failed would fail again: it waits for another state or another request.
static bool rests(const struct session *session, const struct view_slot *view)
{
    return view->failed && !view->changed &&
           view->failed_revision == session->scene->scene->revision;
}

static uint32_t samples_per_step(const struct view_slot *view)
{
    uint64_t n = view->step_ns ? STEP_TARGET_NS / view->step_ns : 1;
    return n < 1 ? 1 : n > MAX_SAMPLES_PER_STEP ? MAX_SAMPLES_PER_STEP : (uint32_t)n;
}

// All who wait want the settled frame, and nobody watches.
static bool is_final(const struct view_slot *view)
{
    bool final = view->waits != NULL && view->credit == 0;
    for (const struct frame_wait *it = view->waits; it; it = it->next)
        final &= it->settled;
    return final;
}

// The time limit of realtime views; path-traced ones keep to it themselves. A picture with
// something missing is not settled, nor is one whose planes are yet to come.
static void keep_to_time(struct view_slot *view)
{
    const struct hg_view_params *p = &view->params;
    struct hg_frame_info *info = &view->info;
    if (p->mode == HG_MODE_REALTIME && !p->planes && p->time_s > 0 && info->samples > 0 &&
        !info->missing_pages && !info->missing_clusters &&
        (double)view->spent_ns * 1e-9 >= (double)p->time_s)
        info->settled = true;
}

static enum hg_status step(
    struct session *session, struct view_slot *view, uint32_t samples, struct hg_error *err)
{
    struct hg_scene *scene = session->scene->scene;
    enum hg_status status = HG_OK;
    if (view->camera_node && view->camera_node_revision != scene->revision) {
        hg_scene_update(scene);
        status = hg_view_set_camera_node(view->view, view->camera_node, &view->camera, err);
        view->camera_node_revision = scene->revision;
    }
    // A failed step leaves no info behind: what comes after it is a new state, too.
    const bool restarted = is_stale(session, view);
    view->fresh |= restarted;
    uint64_t start = hg_clock_now_ns();
    hg_view_set_final(view->view, is_final(view));
    if (!status)
        status = hg_view_step(view->view, samples, &view->info, err);
    view->changed = false;
    if (status)
        return status;
    uint64_t took_ns = hg_clock_now_ns() - start;
    view->spent_ns = restarted ? took_ns : view->spent_ns + took_ns;
    view->step_ns = took_ns / samples;
    view->stepped = true;
    keep_to_time(view);
    return HG_OK;
}

enum hg_status view_refresh(
    struct serve *s, struct session *session, struct view_slot *view, struct hg_error *err)
{
    (void)s;
    session_publish(session);
    return is_stale(session, view) ? step(session, view, 1, err) : HG_OK;
}

static bool batch_holds(const struct session *session)
{
    const struct scene_slot *scene = session->scene;
    return scene->open_batches && hg_clock_now_ns() - scene->batch_started_ns < batch_patience_ns;
}

// Must the view render now? A view that only waits for its frame rate says until when.
static bool has_work(const struct session *session, const struct view_slot *view, uint64_t *wait_ns)
{
    if (rests(session, view))
        return false;
    if (!view->waits && !view->credit)
        return false;
    if (batch_holds(session)) {
        *wait_ns = *wait_ns < batch_patience_ns ? *wait_ns : batch_patience_ns;
        return false;
    }
    if (view->waits || is_stale(session, view) || !view->info.settled)
        return true;
    if (!subscription_wants(view))
        return false;
    uint64_t now = hg_clock_now_ns(), due = subscription_due_ns(view);
    if (now >= due)
        return true;
    *wait_ns = *wait_ns < due - now ? *wait_ns : due - now;
    return false;
}

static void work(struct serve *s, struct session *session, struct view_slot *view)
{
    struct hg_error err = {0};
    enum hg_status status = HG_OK;
    view->failed = false;
    session_publish(session); // a batch may be open for too long
    if (is_stale(session, view) || !view->info.settled)
        status = step(session, view, samples_per_step(view), &err);
    if (status == HG_E_DEVICE_LOST) {
        // Only a new process gets a clean device; the broker replays the journal into it.
        link_lose_device(s->w, &err);
        return;
    }
    if (status) {
        hg_fault(FRAME, status, "%s: %s", err.what, err.reason);
        fail_waits(s, session, view, &err);
        return;
    }
    answer_waits(s, session, view);
    serve_subscription(s, session, view);
}

bool view_step_next(struct serve *s, uint64_t *wait_ns)
{
    struct session *chosen_session = NULL;
    struct view_slot *chosen = NULL;
    bool passed_turn = s->turn == NULL, chosen_after_turn = false;
    *wait_ns = UINT64_MAX;
    // The first view with work after the one that went last, else the first of all.
    for (struct session *session = s->sessions; session; session = session->next)
        for (struct view_slot *view = session->views; view; view = view->next) {
            bool candidate = !chosen || (passed_turn && !chosen_after_turn);
            if (candidate && has_work(session, view, wait_ns)) {
                chosen = view;
                chosen_session = session;
                chosen_after_turn = passed_turn;
            }
            passed_turn |= view == s->turn;
        }
    if (!chosen)
        return false;
    s->turn = chosen;
    work(s, chosen_session, chosen);
    return true;
}
