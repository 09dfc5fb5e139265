#include "server/worker/view/view_output.h"

#include <stdio.h>
#include <string.h>

#include "base/alloc.h"
#include "base/clock.h"
#include "server/worker/encode/frame_depth.h"
#include "server/worker/encode/frame_metadata.h"
#include "server/worker/view/view_codec.h"
#include "server/worker/view/view_rate.h"

static struct reply_to reply_to(
    const struct render_state *s, const struct session *session, uint32_t request)
{
    return (struct reply_to){.w = s->w, .channel = session->channel, .request = request};
}

// A picture that lacks textures is not passed on in silence.
static void send_failed_textures(struct view_slot *view, struct reply_to to)
{
    const uint32_t failed = hg_view_failed_textures(view->view);
    if (failed == view->progress.failed_textures_sent)
        return;
    view->progress.failed_textures_sent = failed;
    if (failed == 0)
        return;
    char text[96];
    snprintf(text, sizeof text, "%u of the images cannot be read and are drawn white", failed);
    hg_reply_notice(
        to, &(struct hgp_notice){
                .code = HG_E_IO, .what = hgp_str_make("textures"), .reason = hgp_str_make(text)});
}

// Nor is one that lacks primitives. While points are not baked they have no discs yet.
static void send_untraced(struct view_slot *view, struct reply_to to)
{
    struct hg_untraced now, *sent = &view->progress.untraced_sent;
    char lines[48] = "", points[64] = "", text[160];
    if (view->settings.params.mode != HG_MODE_PATH || !view->progress.info.settled)
        return;
    hg_view_untraced(view->view, &now);
    const bool is_known = now.lines == sent->lines && now.points == sent->points;
    *sent = now;
    if (is_known || now.lines + now.points == 0)
        return;
    if (now.lines > 0)
        snprintf(
            lines, sizeof lines, "%u primitive%s of lines", now.lines, now.lines > 1 ? "s" : "");
    if (now.points > 0)
        snprintf(points, sizeof points, "%u primitive%s of points without discs", now.points,
            now.points > 1 ? "s" : "");
    snprintf(text, sizeof text, "path-traced pictures leave out %s%s%s", lines,
        lines[0] && points[0] ? " and " : "", points);
    hg_reply_notice(to, &(struct hgp_notice){.code = HG_E_UNSUPPORTED,
                            .what = hgp_str_make("geometry"),
                            .reason = hgp_str_make(text)});
}

static struct hgp_frame describe_frame(const struct view_slot *view, enum hgp_encoding encoding)
{
    const struct hg_view_params *p = &view->settings.params;
    const struct hg_frame_info *info = &view->progress.info;
    return (struct hgp_frame){
        .view = view->number,
        .number = info->number,
        .scene_revision = info->scene_revision,
        .input_seq = info->input_seq,
        .width = info->width,
        .height = info->height,
        .encoding = encoding,
        .samples = info->samples,
        .missing_pages = info->missing_pages,
        .missing_clusters = info->missing_clusters,
        .settled = info->settled,
        .has_mip_bias = info->mip_bias > 0,
        .mip_bias = info->mip_bias,
        .has_error_px = info->error_px > hg_view_params_filled(p).error_px,
        .error_px = info->error_px,
        .has_mode = p->mode == HG_MODE_PATH,
        .mode = HGP_render_mode_PATH,
        .has_noise = info->noise > 0,
        .noise = info->noise,
        .has_exposure_ev = p->exposure_mode != HG_EXPOSURE_FIXED,
        .exposure_ev = info->exposure_ev,
        .has_input_ns = view->progress.input.daemon_ns > 0,
        .input_ns = view->progress.input.daemon_ns,
        .has_taken_ns = view->progress.input.worker_ns > 0,
        .taken_ns = view->progress.input.worker_ns,
        .has_render_begin_ns = true,
        .render_begin_ns = view->progress.began_ns,
        .has_render_end_ns = true,
        .render_end_ns = view->progress.stepped_ns,
    };
}

static enum hg_pixel_format format_of(const struct render_state *s, enum hgp_encoding encoding)
{
    return hg_encode_queue_encoder(s->w->encoders, encoding)->pixels;
}

static enum hg_status fill_request(struct render_state *s, struct session *session,
    struct view_slot *view, struct encode_request *request, struct hg_error *err)
{
    const uint64_t start = hg_clock_now_ns();
    enum hg_status status = hg_view_lend_pixels(
        view->view, format_of(s, request->frame.encoding), &request->pixels, err);
    if (status)
        return status;
    request->read_ns = hg_clock_now_ns() - start;
    request->info = view->progress.info;
    request->is_legend = view->settings.params.debug_view != HG_DEBUG_OFF;
    request->opaque = view->settings.params.background != HG_BACKGROUND_NONE;
    send_failed_textures(view, request->to);
    send_untraced(view, request->to);
    hg_frame_depth_attach(session, view, request);
    return hg_frame_metadata_attach(s, session, view, request, err);
}

// There is room in the view's stream.
static enum hg_status queue_frame(struct render_state *s, struct session *session,
    struct view_slot *view, const struct frame_wait *what, struct hg_error *err)
{
    struct encode_request *request = hg_calloc(1, sizeof *request);
    if (!request)
        return hg_error_set(err, HG_E_NOMEM, "frame", NULL, "no memory");
    request->to = reply_to(s, session, what->request);
    request->quality = what->quality;
    request->parts = what->parts;
    memcpy(request->metadata.rate, what->rate, sizeof request->metadata.rate);
    request->bitrate = view->control.now.bitrate && !what->request ? view->control.now.bitrate
                                                                   : view->subscription.bitrate;
    request->key_frame = !what->request && view->subscription.key_frame;
    request->due_ns = what->request ? 0 : hg_rate_encoded_ns(view);
    request->frame = describe_frame(view, what->encoding);
    request->frame.settled &= what->settled || what->request; // one without loss is still to come
    enum hg_status status = fill_request(s, session, view, request, err);
    if (status) {
        hg_encode_request_destroy(request);
        return status;
    }
    view->subscription.key_frame &= what->request != 0;
    hg_encode_stream_push(view->encoder, request);
    return HG_OK;
}

uint32_t hg_output_formats(const struct render_state *s, const struct view_slot *view)
{
    const struct view_subscription *sub = &view->subscription;
    uint32_t formats = hg_view_slot_is_watched(view) ? 1u << format_of(s, sub->motion) : 0;
    for (const struct frame_wait *it = view->waits; it; it = it->next)
        formats |= it->exposure ? 0 : 1u << format_of(s, it->encoding);
    return formats;
}

// A wait that is newer than a step in motion may need pixels that the step did not keep.
static bool has_pixels(
    const struct render_state *s, const struct view_slot *view, enum hgp_encoding encoding)
{
    return hg_view_has_pixels(view->view, format_of(s, encoding));
}

// False: it is not metered yet.
static bool answer_exposure(const struct view_slot *view, const struct reply_to to)
{
    const struct hg_frame_info *info = &view->progress.info;
    const bool is_auto = view->settings.params.exposure_mode == HG_EXPOSURE_AUTO;
    const struct hgp_exposure answer = {
        .mode = is_auto ? HGP_exposure_mode_AUTO : HGP_exposure_mode_FIXED,
        .exposure_ev = info->exposure_ev};
    if (is_auto && !info->metered)
        return false;
    hg_reply_send(to, HGP_T_exposure, &answer);
    return true;
}

static void deliver_waits(struct render_state *s, struct session *session, struct view_slot *view)
{
    bool room = true;
    for (struct frame_wait **link = &view->waits; *link;) {
        struct frame_wait *wait = *link;
        const struct reply_to to = reply_to(s, session, wait->request);
        if (wait->exposure && answer_exposure(view, to)) {
            *link = wait->next;
            hg_free(wait);
            continue;
        }
        if (wait->exposure || (wait->settled && !view->progress.info.settled)) {
            hg_rate_send_progress(view, wait, to);
            link = &wait->next;
            continue;
        }
        room = room && hg_encode_stream_has_room(view->encoder);
        if (!room || !has_pixels(s, view, wait->encoding)) {
            link = &wait->next;
            continue;
        }
        struct hg_error err = {0};
        if (queue_frame(s, session, view, wait, &err))
            hg_reply_error(to, &err);
        *link = wait->next;
        hg_free(wait);
    }
}

static void deliver_subscription(
    struct render_state *s, struct session *session, struct view_slot *view, uint64_t heard_ns)
{
    const uint64_t now_ns = hg_clock_now_ns();
    if (!hg_rate_wants(view) || now_ns < hg_rate_due_ns(view, heard_ns) ||
        !hg_encode_stream_has_room(view->encoder))
        return;
    struct view_subscription *sub = &view->subscription;
    hg_codec_choose(s, view);
    hg_codec_tell(s, session, view);
    const struct hg_frame_info *info = &view->progress.info;
    const uint64_t rest_ns =
        info->settled && sub->sent_number != info->number
            ? hg_control_rest_ns(&view->control, (uint64_t)info->width * info->height)
            : 0;
    const struct frame_wait what = {
        .settled = info->settled && !rest_ns,
        .encoding = info->settled && !rest_ns ? sub->still_encoding : sub->motion,
        .quality = view->control.now.quality ? view->control.now.quality : sub->quality,
    };
    if (!has_pixels(s, view, what.encoding))
        return;
    struct hg_error err = {0};
    if (queue_frame(s, session, view, &what, &err))
        hg_output_fail(s, session, view, &err);
    else
        hg_rate_sent(view, hg_clock_now_ns() - now_ns);
    sub->still_due_ns = rest_ns ? now_ns + rest_ns : 0;
}

void hg_output_deliver(
    struct render_state *s, struct session *session, struct view_slot *view, uint64_t heard_ns)
{
    deliver_waits(s, session, view);
    deliver_subscription(s, session, view, heard_ns);
}

void hg_output_fail(struct render_state *s, struct session *session, struct view_slot *view,
    const struct hg_error *err)
{
    view->progress.failed = true;
    view->progress.failed_revision = session->scene->scene->revision;
    if (!view->waits) // a subscription: tell once, then rest until something changes
        hg_reply_error(reply_to(s, session, 0), err);
    while (view->waits) {
        struct frame_wait *wait = view->waits;
        hg_reply_error(reply_to(s, session, wait->request), err);
        view->waits = wait->next;
        hg_free(wait);
    }
}
