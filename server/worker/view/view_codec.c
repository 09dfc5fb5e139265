#include "server/worker/view/view_codec.h"

#include <string.h>

#include "base/clock.h"

#define SLOW_NS UINT64_C(5000000000) // until a slow one is tried again, the first time
#define WIDE    2.0                  // times the rate at which other frames than video were poor

enum { MOST_DOUBLINGS = 4 };

void hg_codec_set_list(struct view_slot *view, struct hgp_bytes codecs)
{
    struct view_codecs *list = &view->subscription.codecs;
    list->count = codecs.size < sizeof list->items ? codecs.size : sizeof list->items;
    if (list->count)
        memcpy(list->items, codecs.data, list->count);
    list->refused = list->slow = list->slow_times = 0;
    list->narrow_rate = 0;
    list->announced = -1;
}

void hg_codec_resized(struct view_slot *view)
{
    view->subscription.codecs.slow = view->subscription.codecs.slow_times = 0;
    hg_control_forget_encoder(&view->control);
}

void hg_codec_refuse(struct view_slot *view, uint8_t encoding)
{
    if (encoding < ENCODER_COUNT)
        view->subscription.codecs.refused |= 1u << encoding;
}

static bool is_usable(
    const struct render_state *s, const struct view_slot *view, uint8_t encoding, bool needs_alpha)
{
    const struct hg_view_params p = hg_view_params_filled(&view->settings.params);
    const struct view_codecs *list = &view->subscription.codecs;
    const uint32_t bad = list->refused | list->slow | hg_encode_stream_failed(view->encoder);
    if (encoding >= ENCODER_COUNT || bad >> encoding & 1)
        return false;
    const struct encoder_ops *ops =
        hg_encode_queue_encoder(s->w->encoders, (enum hgp_encoding)encoding);
    return ops && ops->motion && (ops->alpha || !needs_alpha) &&
           (!ops->most_px || (uint64_t)p.width * p.height <= ops->most_px);
}

// One that takes too long is left for the next one of the list, if that has more, and for a time:
// the machine may have been busy with other things.
static void leave_slow(struct view_slot *view)
{
    struct view_subscription *sub = &view->subscription;
    struct view_codecs *list = &sub->codecs;
    const uint64_t now_ns = hg_clock_now_ns();
    if (list->slow && now_ns >= list->slow_until_ns)
        list->slow = 0;
    if (sub->motion == sub->encoding || list->slow >> sub->motion & 1 ||
        !hg_control_encoder_is_slow(&view->control, sub->target_fps))
        return;
    list->slow |= 1u << sub->motion;
    list->slow_until_ns = now_ns + (SLOW_NS << list->slow_times);
    list->slow_times += list->slow_times < MOST_DOUBLINGS;
}

static bool is_video(enum hgp_encoding encoding)
{
    return encoding == HGP_encoding_H264 || encoding == HGP_encoding_H264_444 ||
           encoding == HGP_encoding_AV1;
}

// Video needs a fraction of what single pictures take.
static void note_network(struct view_slot *view)
{
    const struct view_subscription *sub = &view->subscription;
    struct view_codecs *list = &view->subscription.codecs;
    if (!is_video(sub->motion) && hg_control_is_narrow(&view->control, sub->target_fps))
        list->narrow_rate = view->control.rate;
    else if (view->control.rate > WIDE * list->narrow_rate)
        list->narrow_rate = 0;
}

// The first usable one of the list. False: none is.
static bool choose_first(
    const struct render_state *s, struct view_slot *view, bool needs_alpha, bool needs_video)
{
    struct view_subscription *sub = &view->subscription;
    for (uint32_t i = 0; i < sub->codecs.count; i++) {
        const uint8_t encoding = sub->codecs.items[i];
        if ((needs_video && !is_video((enum hgp_encoding)encoding)) ||
            !is_usable(s, view, encoding, needs_alpha))
            continue;
        sub->motion = (enum hgp_encoding)encoding;
        return true;
    }
    return false;
}

static void choose(const struct render_state *s, struct view_slot *view)
{
    struct view_subscription *sub = &view->subscription;
    const bool has_alpha = view->settings.params.background == HG_BACKGROUND_NONE;
    if ((has_alpha && choose_first(s, view, true, false)) ||
        (sub->codecs.narrow_rate > 0 && choose_first(s, view, false, true)) ||
        choose_first(s, view, false, false))
        return;
    sub->motion = sub->encoding;
}

void hg_codec_choose(const struct render_state *s, struct view_slot *view)
{
    leave_slow(view);
    note_network(view);
    choose(s, view);
    hg_control_set_encoding(&view->control, view->subscription.motion);
}

void hg_codec_tell(
    const struct render_state *s, const struct session *session, struct view_slot *view)
{
    struct view_subscription *sub = &view->subscription;
    if (!sub->codecs.count || sub->codecs.announced == (int)sub->motion)
        return;
    sub->codecs.announced = (int)sub->motion;
    hg_reply_send((struct reply_to){.w = s->w, .channel = session->channel}, HGP_T_view_codec,
        &(struct hgp_view_codec){.view = view->number, .encoding = sub->motion});
}

enum hg_status hg_codec_check(const struct render_state *s, enum hgp_encoding encoding,
    const char *what, struct hg_error *err)
{
    if (hg_encode_queue_encoder(s->w->encoders, encoding))
        return HG_OK;
    return hg_error_set(err, HG_E_UNSUPPORTED, what, "encoding",
        "this server was built without an encoder for %s",
        hgp_enum_name("encoding", (uint32_t)encoding));
}
