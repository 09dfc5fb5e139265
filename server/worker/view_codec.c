#include "server/worker/view_codec.h"

#include <string.h>

void hg_codec_set_list(struct view_slot *view, struct hgp_bytes codecs)
{
    struct view_codecs *list = &view->subscription.codecs;
    list->count = codecs.size < sizeof list->items ? codecs.size : sizeof list->items;
    if (list->count)
        memcpy(list->items, codecs.data, list->count);
    list->refused = list->slow = 0;
    list->told = -1;
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

// One that takes too long is left for the next one of the list, if that has more.
static void leave_slow(struct view_slot *view)
{
    struct view_subscription *sub = &view->subscription;
    if (sub->motion != sub->encoding && hg_control_encoder_is_slow(&view->control, sub->target_fps))
        sub->codecs.slow |= 1u << sub->motion;
}

static void choose(const struct render_state *s, struct view_slot *view)
{
    struct view_subscription *sub = &view->subscription;
    bool needs_alpha = view->settings.params.background == HG_BACKGROUND_NONE;
    sub->motion = sub->encoding;
    for (int pass = needs_alpha ? 0 : 1; pass < 2; pass++, needs_alpha = false)
        for (uint32_t i = 0; i < sub->codecs.count; i++)
            if (is_usable(s, view, sub->codecs.items[i], needs_alpha)) {
                sub->motion = (enum hgp_encoding)sub->codecs.items[i];
                return;
            }
}

void hg_codec_choose(const struct render_state *s, struct view_slot *view)
{
    leave_slow(view);
    choose(s, view);
    hg_control_set_encoding(&view->control, view->subscription.motion);
}

void hg_codec_tell(
    const struct render_state *s, const struct session *session, struct view_slot *view)
{
    struct view_subscription *sub = &view->subscription;
    if (!sub->codecs.count || sub->codecs.told == (int)sub->motion)
        return;
    sub->codecs.told = (int)sub->motion;
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
