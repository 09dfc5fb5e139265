#include "server/worker/view/view_messages.h"

#include <string.h>

#include "base/alloc.h"
#include "server/worker/encode/frame_key.h"
#include "server/worker/encode/frame_planes.h"
#include "server/worker/view/view_codec.h"
#include "server/worker/view/view_fit.h"
#include "server/worker/view/view_memory.h"
#include "server/worker/view/view_params.h"
#include "server/worker/view/view_rate.h"

// An exposure is automatic until a message says one, or says where it comes from.
static void choose_exposure(
    const struct hgp_view_set *m, const struct view_slot *view, struct hg_view_params *params)
{
    const bool is_said = m->has_exposure_mode || (view && view->settings.has_exposure_mode);
    if (!view && !m->has_exposure_mode)
        params->exposure_mode = HG_EXPOSURE_AUTO;
    if (m->has_exposure_ev && !is_said)
        params->exposure_mode = HG_EXPOSURE_FIXED;
}

// Without global illumination pictures in motion are those of one sample, as ever, unless a
// message says otherwise.
static void choose_temporal(
    const struct hgp_view_set *m, const struct view_slot *view, struct hg_view_params *params)
{
    if (!m->has_temporal && !(view && view->settings.has_temporal))
        params->temporal = params->gi != HG_GI_NONE ? HG_TEMPORAL_AUTO : HG_TEMPORAL_NONE;
}

// The parameters that a view has after the message; what that leaves out stays.
static enum hg_status next_params(const struct request *r, const struct view_slot *view,
    struct hg_view_params *params, struct hg_error *err)
{
    const struct hgp_view_set *m = &r->message->view_set;
    *params = view ? view->settings.params : (struct hg_view_params){0};
    hg_view_params_apply(params, m);
    choose_exposure(m, view, params);
    if (!view && !m->has_gi)
        params->gi = HG_GI_AUTO;
    if (!view && !m->has_reflections)
        params->reflections = HG_REFLECTIONS_AUTO;
    choose_temporal(m, view, params);
    return m->has_planes ? hg_frame_planes_decode(m->planes, &params->planes, &params->mattes, err)
                         : HG_OK;
}

#define OVERLAY_U8(field)    view->subscription.field = m->field
#define OVERLAY_U32(field)   view->subscription.field = m->field
#define OVERLAY_F32(field)   view->subscription.field = m->field
#define OVERLAY_ENUM(field)  view->subscription.field = m->field
#define OVERLAY_BYTES(field) hg_codec_set_list(view, m->field)

static void overlay_delivery(struct view_slot *view, const struct hgp_view_set *m)
{
#define HGP_VIEW_DELIVERY(kind, field, ...)                                                        \
    if (m->has_##field)                                                                            \
        OVERLAY_##kind(field);
#include "protocol/view_params.def"
}

// The client does not have the depth of the state that it has been sent: the frame comes once more.
static void begin_depth(struct view_slot *view, const struct hgp_view_set *m)
{
    if (!m->has_depth || !m->depth)
        return;
    view->subscription.fresh = true;
    view->subscription.sent_number = 0;
}

// Encodings that are chosen by name must be there; of a list those that are not are skipped.
static enum hg_status check_encodings(const struct request *r, struct hg_error *err)
{
    const struct hgp_view_set *m = &r->message->view_set;
    enum hg_status status =
        m->has_encoding ? hg_codec_check(r->s, m->encoding, "view_set", err) : HG_OK;
    if (!status && m->has_still_encoding)
        status = hg_codec_check(r->s, m->still_encoding, "view_set", err);
    return status;
}

static enum hg_status set_view(const struct request *r, struct hg_error *err)
{
    const struct hgp_view_set *m = &r->message->view_set;
    struct view_slot *view = hg_view_slot_find(r->session, m->view);
    const bool is_new = !view;
    struct hg_view_params params;
    enum hg_status status = check_encodings(r, err);
    if (!status)
        status = next_params(r, view, &params, err);
    if (status)
        return status;
    status = hg_render_state_need_renderer(r->s, err);
    if (!status)
        status = hg_view_memory_check(r->s, r->session, view, &params, err);
    if (!status && is_new)
        status = hg_view_slot_create(r->s, r->session, m->view, &view, err);
    if (status)
        return status;
    status = hg_view_set_params(view->view, &params, err);
    if (status) {
        if (is_new)
            hg_view_slot_destroy(r->s, r->session, view);
        return status;
    }
    if (params.width != view->settings.params.width ||
        params.height != view->settings.params.height)
        hg_codec_resized(view);
    view->settings.params = params;
    view->settings.has_exposure_mode |= m->has_exposure_mode;
    view->settings.has_temporal |= m->has_temporal;
    view->settings.changed = true;
    if (!view->settings.camera_given)
        view->settings.camera_revision = UINT64_MAX; // fitted to another aspect
    overlay_delivery(view, m);
    begin_depth(view, m);
    hg_codec_choose(r->s, view);
    return HG_OK;
}

void hg_handle_view_set(const struct request *r)
{
    struct hg_error err = {0};
    if (set_view(r, &err)) {
        hg_reply_error(r->to, &err);
        return;
    }
    hg_request_ok(r);
    hg_codec_tell(r->s, r->session, hg_view_slot_find(r->session, r->message->view_set.view));
}

void hg_handle_view_close(const struct request *r)
{
    struct view_slot *view = hg_request_view(r, r->message->view_close.view);
    if (!view)
        return;
    struct hg_error err = {0};
    hg_error_set(&err, HG_E_CANCELLED, "view", NULL, "the view was closed");
    for (struct frame_wait *wait = view->waits; wait; wait = wait->next)
        hg_reply_error((struct reply_to){r->s->w, r->to.channel, wait->request}, &err);
    hg_view_slot_destroy(r->s, r->session, view);
    hg_request_ok(r);
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

void hg_handle_view_camera(const struct request *r)
{
    const struct hgp_view_camera *m = &r->message->view_camera;
    struct view_slot *view = hg_request_view(r, m->view);
    if (!view)
        return;
    struct hg_error err = {0};
    struct hg_view_camera camera = view->settings.camera;
    uint64_t node = m->has_camera ? m->camera : 0;
    enum hg_status status = HG_OK;
    if (!view->settings.camera_given && !node && !(m->has_eye && m->has_target))
        status = hg_view_fit_fill(r->session, view, &camera, &err);
    overlay_camera(&camera, m);
    if (node)
        hg_scene_update(r->session->scene->scene);
    if (!status)
        status = node ? hg_view_set_camera_node(view->view, node, &camera, &err)
                      : hg_view_set_camera(view->view, &camera, &err);
    if (status) {
        hg_reply_error(r->to, &err);
        return;
    }
    if (node)
        hg_view_fit_note_blind(r, view, node);
    view->settings.camera = camera;
    view->settings.camera_node = node;
    view->settings.camera_given = true;
    view->settings.input =
        (struct view_input){m->has_received_ns ? m->received_ns : 0, r->received_ns};
    view->settings.camera_revision = r->session->scene->scene->revision;
    view->settings.changed = true;
    hg_request_ok(r);
}

// A wait behind those that are there. NULL: no memory, which is answered.
static struct frame_wait *add_wait(
    const struct request *r, struct view_slot *view, const char *what)
{
    struct frame_wait *wait = hg_calloc(1, sizeof *wait), **end = &view->waits;
    if (!wait) {
        struct hg_error err = {0};
        hg_error_set(&err, HG_E_NOMEM, what, NULL, "no memory");
        hg_reply_error(r->to, &err);
        return NULL;
    }
    while (*end)
        end = &(*end)->next;
    *end = wait;
    wait->request = r->to.request;
    view->progress.failed = false;
    return wait;
}

void hg_handle_frame_request(const struct request *r)
{
    const struct hgp_frame_request *m = &r->message->frame_request;
    struct view_slot *view = hg_request_view(r, m->view);
    struct hg_error err = {0};
    if (view && m->has_encoding && hg_codec_check(r->s, m->encoding, "frame_request", &err)) {
        hg_reply_error(r->to, &err);
        return;
    }
    struct frame_wait *wait = view ? add_wait(r, view, "frame_request") : NULL;
    if (!wait)
        return;
    wait->settled = m->settled;
    wait->parts = m->has_parts && m->parts;
    wait->encoding = m->has_encoding ? m->encoding
                     : m->settled    ? view->subscription.still_encoding
                                     : view->subscription.motion;
    wait->quality = m->has_quality ? m->quality : view->subscription.quality;
    wait->rate[0] = m->has_rate_numerator ? m->rate_numerator : 0;
    wait->rate[1] = m->has_rate_denominator ? m->rate_denominator : 1;
}

void hg_handle_frame_cancel(const struct request *r)
{
    const struct hgp_frame_cancel *m = &r->message->frame_cancel;
    // The daemon sends it without a request id: the view may have been closed since.
    struct view_slot *view =
        r->to.request ? hg_request_view(r, m->view) : hg_view_slot_find(r->session, m->view);
    if (!view)
        return;
    struct frame_wait **link = &view->waits;
    while (*link && (*link)->request != m->request)
        link = &(*link)->next;
    struct frame_wait *wait = m->request ? *link : NULL;
    if (wait) {
        struct hg_error err = {0};
        hg_error_set(&err, HG_E_CANCELLED, wait->exposure ? "exposure_query" : "frame_request",
            NULL, "cancelled by the client");
        hg_reply_error((struct reply_to){r->s->w, r->to.channel, wait->request}, &err);
        *link = wait->next;
        hg_free(wait);
    }
    hg_request_ok(r);
}

void hg_handle_exposure_query(const struct request *r)
{
    struct view_slot *view = hg_request_view(r, r->message->exposure_query.view);
    if (!view)
        return;
    const struct hg_view_params *p = &view->settings.params;
    if (p->exposure_mode != HG_EXPOSURE_AUTO || p->debug_view != HG_DEBUG_OFF) {
        const struct hgp_exposure answer = {
            .mode = HGP_exposure_mode_FIXED, .exposure_ev = hg_view_params_ev(p)};
        hg_reply_send(r->to, HGP_T_exposure, &answer);
        return;
    }
    struct frame_wait *wait = add_wait(r, view, "exposure_query");
    if (wait)
        wait->exposure = wait->settled = true;
}

void hg_handle_subscribe(const struct request *r)
{
    const struct hgp_subscribe *m = &r->message->subscribe;
    struct view_slot *view = hg_request_view(r, m->view);
    if (!view)
        return;
    hg_rate_subscribe(view, m->credit_frames);
    hg_request_ok(r);
}

void hg_handle_credit(const struct request *r)
{
    struct view_slot *view = hg_request_view(r, r->message->credit.view);
    if (view)
        hg_rate_add_credit(view, r->message->credit.frames);
}

// Of a client without a daemon in between.
void hg_handle_taken(const struct request *r)
{
    const struct hgp_taken *m = &r->message->taken;
    struct view_slot *view = hg_request_view(r, m->view);
    if (!view)
        return;
    hg_rate_add_credit(view, 1);
    hg_rate_delivered(view, &(struct hg_control_delivery){.number = m->number,
                                .at_ns = r->received_ns,
                                .begun_ns = m->begun_ns,
                                .received_ns = m->received_ns,
                                .rtt_ns = m->rtt_ns});
}

void hg_handle_delivered(const struct request *r)
{
    const struct hgp_delivered *m = &r->message->delivered;
    struct view_slot *view = hg_view_slot_find(r->session, m->view);
    if (view) // else it was closed meanwhile
        hg_rate_delivered(view, &(struct hg_control_delivery){.number = m->number,
                                    .at_ns = m->at_ns,
                                    .begun_ns = m->begun_ns,
                                    .received_ns = m->received_ns,
                                    .rtt_ns = m->rtt_ns});
}

void hg_handle_key_frame(const struct request *r)
{
    const struct hgp_key_frame *m = &r->message->key_frame;
    struct view_slot *view = hg_request_view(r, m->view);
    if (!view)
        return;
    if (m->has_failed)
        hg_codec_refuse(view, m->failed);
    hg_codec_choose(r->s, view);
    view->subscription.key_frame = true;
    view->subscription.fresh = true;
    view->subscription.sent_number = 0;
    hg_request_ok(r);
    hg_codec_tell(r->s, r->session, view);
}

void hg_handle_job_query(const struct request *r)
{
    const struct hgp_job_query *m = &r->message->job_query;
    struct view_slot *view = hg_request_view(r, m->view);
    struct hgp_job answer = {.scene_revision = r->session->scene->scene->revision};
    struct hg_error err = {0};
    if (!view)
        return;
    view->frame_key.encoding = m->has_encoding ? m->encoding : view->subscription.still_encoding;
    view->frame_key.quality = m->has_quality ? m->quality : view->subscription.quality;
    memset(view->frame_key.after, 0, sizeof view->frame_key.after);
    if (m->has_after)
        memcpy(view->frame_key.after, m->after, sizeof view->frame_key.after);
    const struct frame_format format = {view->frame_key.encoding, view->frame_key.quality};
    if (hg_view_fit_follow(r->session, view, &err) ||
        hg_frame_key_make(r->s, r->session, view, format, answer.hash, &err)) {
        hg_reply_error(r->to, &err);
        return;
    }
    view->frame_key.asked = true;
    hg_reply_send(r->to, HGP_T_job, &answer);
}
