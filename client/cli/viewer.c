#include "client/cli/viewer.h"

#include <math.h>
#include <string.h>

#include "base/clock.h"
#include "client/cli/cli.h"

enum { CREDIT = 32, PINGS = 8, TURN_POSES = 300, WAIT_NS = 50000000 };

const char *const hg_viewer_stage_names[HG_VIEWER_STAGES] = {
    "uplink", "input", "wait", "render", "read", "encode", "output", "downlink"};

// ---- opening ------------------------------------------------------------------------------------

static enum hg_status take_offset(struct hg_viewer *v, struct hg_error *err)
{
    v->rtt_ns = UINT64_MAX;
    for (int i = 0; i < PINGS; i++) {
        struct helio_message *answer;
        uint64_t rtt_ns;
        enum hg_status status = helio_ping(v->h, &rtt_ns, err); // the library notes the round trip
        const uint64_t begin_ns = hg_clock_now_ns();
        if (!status)
            status = helio_call_for(
                v->h, HGP_T_clock_query, &(struct hgp_clock_query){0}, HGP_T_clock, &answer, err);
        if (status)
            return status;
        const uint64_t took_ns = answer->received_ns - begin_ns;
        if (took_ns < v->rtt_ns) {
            v->rtt_ns = took_ns;
            v->offset_ns = (int64_t)answer->body->clock.time_ns - (int64_t)(begin_ns + took_ns / 2);
        }
        helio_message_free(answer);
    }
    return HG_OK;
}

static enum hg_status open_view(struct hg_viewer *v, struct hg_error *err)
{
    const struct hg_viewer_options *o = &v->options;
    const struct hgp_view_set set = {.view = HG_VIEWER_VIEW,
        .has_width = true,
        .width = o->width,
        .has_height = true,
        .height = o->height,
        .has_mode = true,
        .mode = o->path ? HGP_render_mode_PATH : HGP_render_mode_REALTIME,
        .has_gi = o->plain,
        .gi = HGP_gi_NONE,
        .has_exposure_mode = o->plain,
        .exposure_mode = HGP_exposure_mode_FIXED,
        .has_encoding = true,
        .encoding = o->encoding,
        .has_names = true,
        .names = 1,
        .has_max_fps = true,
        .max_fps = 1000,
        .has_target_fps = true,
        .target_fps = o->target_fps};
    enum hg_status status = helio_call_for(v->h, HGP_T_view_set, &set, HGP_T_ok, NULL, err);
    if (status)
        return status;
    v->fit = (struct hgp_view_camera){.view = HG_VIEWER_VIEW};
    return helio_camera_fit(v->h,
        &(struct hgp_view_fit){.view = HG_VIEWER_VIEW, .has_turntable = true, .turntable = true},
        &v->fit, err);
}

static enum hg_status open_scene(struct hg_viewer *v, struct hg_error *err)
{
    const struct hg_viewer_options *o = &v->options;
    struct hgp_asset_loaded loaded;
    enum hg_status status =
        helio_scene_open(v->h, o->scene_name ? o->scene_name : "", &v->scene, err);
    if (status || v->scene.existed)
        return status;
    if (o->build)
        return o->build(v, err);
    return helio_load(
        v->h, (uint32_t)v->scene.first_id, o->asset ? o->asset : "demo:", &loaded, err);
}

static enum hg_status subscribe(struct hg_viewer *v, struct hg_error *err)
{
    const struct hgp_subscribe ask = {.view = HG_VIEWER_VIEW, .credit_frames = CREDIT};
    return helio_call_for(v->h, HGP_T_subscribe, &ask, HGP_T_ok, NULL, err);
}

// The fitted camera, turned about the vertical axis through its target.
static struct hgp_view_camera pose_camera(const struct hg_viewer *v, uint64_t seq)
{
    struct hgp_view_camera camera = v->fit;
    const uint32_t turn = v->options.poses > 1 ? v->options.poses : TURN_POSES;
    const double angle = 6.283185307179586 * (double)(seq % turn) / (double)turn;
    const double x = (double)(v->fit.eye[0] - v->fit.target[0]),
                 z = (double)(v->fit.eye[2] - v->fit.target[2]);
    camera.view = HG_VIEWER_VIEW;
    camera.input_seq = seq;
    camera.eye[0] = v->fit.target[0] + (float)(cos(angle) * x + sin(angle) * z);
    camera.eye[2] = v->fit.target[2] + (float)(cos(angle) * z - sin(angle) * x);
    return camera;
}

// Sends the next pose.
static enum hg_status send_pose(struct hg_viewer *v, struct hg_error *err)
{
    const struct hgp_view_camera camera = pose_camera(v, v->seq + 1);
    const uint64_t now_ns = hg_clock_now_ns();
    enum hg_status status = helio_send(v->h, HGP_T_view_camera, &camera, NULL, err);
    if (status == HG_E_AGAIN)
        return HG_OK; // the network takes nothing: a later one will do
    if (status)
        return status;
    v->seq++;
    v->sent_ns[v->seq % HG_VIEWER_POSES] = now_ns;
    v->settled = false;
    if (v->options.poses_per_s > 0) {
        const uint64_t step_ns = (uint64_t)(1e9 / v->options.poses_per_s);
        const uint64_t due_ns = v->next_pose_ns + step_ns;
        v->next_pose_ns = due_ns > now_ns ? due_ns : now_ns + step_ns;
    }
    return HG_OK;
}

enum hg_status hg_viewer_open(struct hg_viewer *v, struct hg_error *err)
{
    const struct helio_options options = {.url = v->options.url,
        .token = v->options.token,
        .scene = v->options.scene_name,
        .timeout_ns = v->options.timeout_ns,
        .max_receive_bytes = 64 << 20};
    enum hg_status status = helio_connect(&options, &v->h, err);
    if (status == HG_E_TIMEOUT)
        return hg_error_set(err, status, v->options.url, NULL, "no session within %g s",
            (double)v->options.timeout_ns * 1e-9);
    if (status)
        return status;
    helio_set_timeout(v->h, v->options.timeout_ns);
    static const struct {
        const char *asks;
        enum hg_status (*step)(struct hg_viewer *v, struct hg_error *err);
    } steps[] = {{"the daemon's clock", take_offset}, {"the scene", open_scene},
        {"a view of it", open_view}, {"a first pose", send_pose}, {"frames", subscribe}};
    for (size_t i = 0; i < sizeof steps / sizeof *steps && !status; i++) {
        status = steps[i].step(v, err);
        if (status == HG_E_TIMEOUT)
            return hg_error_set(err, status, v->options.url, NULL, "no answer within %g s about %s",
                (double)v->options.timeout_ns * 1e-9, steps[i].asks);
    }
    return status;
}

void hg_viewer_close(struct hg_viewer *v)
{
    helio_destroy(v->h);
    v->h = NULL;
}

enum hg_status hg_viewer_hide(struct hg_viewer *v, bool hidden, struct hg_error *err)
{
    const struct hgp_view_set set = {.view = HG_VIEWER_VIEW, .has_hidden = true, .hidden = hidden};
    return helio_call_for(v->h, HGP_T_view_set, &set, HGP_T_ok, NULL, err);
}

// ---- poses --------------------------------------------------------------------------------------

static bool is_pose_due(const struct hg_viewer *v, uint64_t now_ns)
{
    return v->options.poses_per_s > 0 ? now_ns >= v->next_pose_ns : v->shown_seq >= v->seq;
}

// ---- frames -------------------------------------------------------------------------------------

static void measure(struct hg_viewer *v, const struct helio_message *message)
{
    const struct hgp_frame *f = &message->body->frame;
    const uint64_t sent_ns = v->sent_ns[f->input_seq % HG_VIEWER_POSES];
    const int64_t server[] = {(int64_t)f->input_ns, (int64_t)f->taken_ns,
        (int64_t)f->render_begin_ns, (int64_t)f->render_end_ns, (int64_t)f->encode_begin_ns,
        (int64_t)f->encode_end_ns, (int64_t)f->sent_ns};
    struct hg_viewer_sample s = {.seq = f->input_seq,
        .shown_ns = message->received_ns,
        .latency_ns = message->received_ns - sent_ns,
        .bytes = message->size_bytes};
    int64_t before = (int64_t)sent_ns;
    for (int i = 0; i < HG_VIEWER_STAGES - 1; i++) {
        const int64_t at = server[i] - v->offset_ns;
        s.stage_ns[i] = at - before;
        before = at;
    }
    s.stage_ns[HG_VIEWER_DOWNLINK] = (int64_t)message->received_ns - before;
    v->sample_count++;
    if (v->on_sample)
        v->on_sample(v->user, &s);
}

static enum hg_status take_frame(
    struct hg_viewer *v, const struct helio_message *message, struct hg_error *err)
{
    const struct hgp_frame *f = &message->body->frame;
    v->frames++;
    v->bytes += message->size_bytes;
    v->stale += f->input_seq < v->shown_seq;
    if (f->input_seq > v->shown_seq && f->input_seq <= v->seq) {
        v->shown_seq = f->input_seq;
        measure(v, message);
    }
    v->settled = f->settled && f->lossless && f->input_seq == v->seq;
    if (v->settled)
        memcpy(v->hash, f->hash, sizeof v->hash);
    return helio_taken(v->h, message, err);
}

static bool has_enough(const struct hg_viewer *v)
{
    return v->enough > 0 && v->sample_count >= v->enough;
}

static enum hg_status take_all(struct hg_viewer *v, struct hg_error *err)
{
    struct helio_message *message;
    enum hg_status status = helio_process(v->h, err);
    while (!status && !has_enough(v) && !(status = helio_next(v->h, &message, err))) {
        if (message->type == HGP_T_frame && !message->request)
            status = take_frame(v, message, err);
        else if (message->type == HGP_T_error) // of a camera, or of a picture that failed
            status = hg_cli_error_of(&message->body->error, err);
        helio_message_free(message);
    }
    return status == HG_E_AGAIN ? HG_OK : status;
}

static enum hg_status wait_some(struct hg_viewer *v, uint64_t until_ns, struct hg_error *err)
{
    const uint64_t now_ns = hg_clock_now_ns();
    if (now_ns >= until_ns)
        return HG_OK;
    const uint64_t left_ns = until_ns - now_ns;
    const enum hg_status status = helio_wait(v->h, left_ns < WAIT_NS ? left_ns : WAIT_NS, err);
    return status == HG_E_TIMEOUT ? HG_OK : status;
}

enum hg_status hg_viewer_run(
    struct hg_viewer *v, uint64_t until_ns, bool moves, struct hg_error *err)
{
    enum hg_status status = HG_OK;
    while (!status && hg_clock_now_ns() < until_ns) {
        status = take_all(v, err);
        if (has_enough(v))
            return status;
        if (!status && moves && is_pose_due(v, hg_clock_now_ns()))
            status = send_pose(v, err);
        const bool timed = moves && v->options.poses_per_s > 0 && v->next_pose_ns < until_ns;
        if (!status)
            status = wait_some(v, timed ? v->next_pose_ns : until_ns, err);
    }
    return status;
}

enum hg_status hg_viewer_await(
    struct hg_viewer *v, bool settled, uint64_t timeout_ns, struct hg_error *err)
{
    const uint64_t until_ns = hg_clock_now_ns() + timeout_ns;
    for (;;) {
        enum hg_status status = take_all(v, err);
        if (status || (settled ? v->settled : v->shown_seq >= v->seq))
            return status;
        if (hg_cli_is_stopped())
            return hg_error_set(err, HG_E_CANCELLED, "frame", NULL, "interrupted");
        if (hg_clock_now_ns() >= until_ns)
            return hg_error_set(err, HG_E_TIMEOUT, "frame", NULL,
                "no %s frame of pose %llu within %.0f s (%llu frames came, the newest of pose "
                "%llu)",
                settled ? "settled" : "first", (unsigned long long)v->seq,
                (double)timeout_ns * 1e-9, (unsigned long long)v->frames,
                (unsigned long long)v->shown_seq);
        status = wait_some(v, until_ns, err);
        if (status)
            return status;
    }
}
