#include "server/worker/encode/encode_av1.h"

#include <aom/aom_encoder.h>
#include <aom/aomcx.h>
#include <stdio.h>

#include "base/alloc.h"
#include "server/worker/encode/yuv.h"

enum { LEAST_PX = 16, SPEED = 10 };

struct av1 {
    aom_codec_ctx_t codec;
    bool is_open;
    aom_codec_enc_cfg_t config;
    struct hg_yuv yuv;
    aom_codec_pts_t frames;
};

// Quantiser 18..63 of a quality 1..100.
static int quantiser_of(uint8_t quality)
{
    return 63 - (45 * (quality - 1) + 49) / 99;
}

// ---- configuration string -----------------------------------------------------------------------

static uint64_t read_leb128(const uint8_t *data, size_t size, size_t *at)
{
    uint64_t value = 0;
    for (int i = 0; i < 8 && *at < size; i++) {
        const uint8_t byte = data[(*at)++];
        value |= (uint64_t)(byte & 127) << (7 * i);
        if (!(byte & 128))
            break;
    }
    return value;
}

// From the payload of a sequence header without timing information, as libaom writes it:
// seq_profile(3) still_picture(1) reduced(1) timing_info(1) initial_display_delay(1)
// operating_points_minus_1(5) operating_point_idc(12) seq_level_idx(5) seq_tier(1, level > 7).
static void describe(const uint8_t *p, char codec[ENCODER_CODEC_BYTES])
{
    const uint32_t bits = (uint32_t)p[0] << 24 | (uint32_t)p[1] << 16 | (uint32_t)p[2] << 8 | p[3];
    const uint32_t profile = bits >> 29, level = bits >> 3 & 31, tier = bits >> 2 & 1;
    (void)snprintf(codec, ENCODER_CODEC_BYTES, "av01.%u.%02u%c.08", (unsigned)profile,
        (unsigned)level, level > 7 && tier ? 'H' : 'M');
}

// "av01.0.05M.08" from the sequence header of a temporal unit; "" where there is none.
// Source: AV1 Codec ISO Media File Format Binding 1.2, section 5; AV1 bitstream, 5.3 and 5.5.
static void codec_string(const uint8_t *data, size_t size, char codec[ENCODER_CODEC_BYTES])
{
    enum { SEQUENCE_HEADER = 1 };
    codec[0] = 0;
    for (size_t at = 0; at < size;) {
        const uint8_t head = data[at];
        at += head & 4 ? 2 : 1; // extension
        const uint64_t length = head & 2 ? read_leb128(data, size, &at) : size - at;
        if (at > size || length > size - at)
            return;
        if ((head >> 3 & 15) == SEQUENCE_HEADER && length >= 4) {
            describe(data + at, codec);
            return;
        }
        at += length;
    }
}

// ---- encoder ------------------------------------------------------------------------------------

void hg_av1_close(void *state)
{
    struct av1 *s = state;
    if (s->is_open)
        aom_codec_destroy(&s->codec);
    hg_yuv_finish(&s->yuv);
    hg_free(s);
}

static void set_quantiser(struct av1 *s, uint8_t quality)
{
    s->config.rc_min_quantizer = s->config.rc_max_quantizer = (unsigned)quantiser_of(quality);
}

static bool fill_config(struct av1 *s, uint8_t quality)
{
    aom_codec_enc_cfg_t *c = &s->config;
    if (aom_codec_enc_config_default(aom_codec_av1_cx(), c, AOM_USAGE_REALTIME) != AOM_CODEC_OK)
        return false;
    c->g_w = s->yuv.width;
    c->g_h = s->yuv.height;
    c->g_threads = 1;
    c->g_lag_in_frames = 0;
    c->g_pass = AOM_RC_ONE_PASS;
    c->g_timebase = (aom_rational_t){1, 30};
    c->rc_end_usage = AOM_Q;
    c->kf_mode = AOM_KF_DISABLED; // on demand
    set_quantiser(s, quality);
    return true;
}

static bool set_controls(aom_codec_ctx_t *codec)
{
    static const struct control {
        int id, value;
    } controls[] = {
        {AOME_SET_CPUUSED, SPEED},
        {AV1E_SET_AQ_MODE, 0},
        {AV1E_SET_DELTAQ_MODE, 0},
        {AV1E_SET_ENABLE_TPL_MODEL, 0},
        {AV1E_SET_ENABLE_ORDER_HINT, 0},
        {AV1E_SET_ENABLE_OBMC, 0},
        {AV1E_SET_ENABLE_WARPED_MOTION, 0},
        {AV1E_SET_ENABLE_GLOBAL_MOTION, 0},
        {AV1E_SET_ENABLE_PALETTE, 0},
        {AV1E_SET_ENABLE_INTRABC, 0},
        {AV1E_SET_COLOR_PRIMARIES, AOM_CICP_CP_BT_709},
        {AV1E_SET_TRANSFER_CHARACTERISTICS, AOM_CICP_TC_SRGB},
        {AV1E_SET_MATRIX_COEFFICIENTS, AOM_CICP_MC_BT_709},
        {AV1E_SET_COLOR_RANGE, AOM_CR_STUDIO_RANGE},
        {AV1E_SET_CHROMA_SAMPLE_POSITION, AOM_CSP_VERTICAL},
    };
    for (size_t i = 0; i < sizeof controls / sizeof *controls; i++)
        if (aom_codec_control(codec, controls[i].id, controls[i].value) != AOM_CODEC_OK)
            return false;
    return true;
}

enum hg_status hg_av1_open(const struct encode_request *first, void **state, struct hg_error *err)
{
    const struct hgp_frame *f = &first->frame;
    struct av1 *s = hg_calloc(1, sizeof *s);
    *state = NULL;
    if (!s || hg_yuv_create(f->width, f->height, LEAST_PX, false, &s->yuv)) {
        hg_free(s);
        return hg_error_set(err, HG_E_NOMEM, "av1", NULL, "no memory");
    }
    s->is_open = fill_config(s, first->quality) &&
                 aom_codec_enc_init(&s->codec, aom_codec_av1_cx(), &s->config, 0) == AOM_CODEC_OK;
    if (!s->is_open || !set_controls(&s->codec)) {
        hg_av1_close(s);
        return hg_error_set(err, HG_E_UNSUPPORTED, "av1", "size",
            "the encoder does not take pictures of %ux%u px", f->width, f->height);
    }
    *state = s;
    return HG_OK;
}

static bool run(struct av1 *s, const struct encode_request *request)
{
    aom_image_t image;
    const unsigned before = s->config.rc_min_quantizer;
    set_quantiser(s, request->quality);
    if (s->config.rc_min_quantizer != before &&
        aom_codec_enc_config_set(&s->codec, &s->config) != AOM_CODEC_OK)
        return false;
    // Planes and strides are set below; wrapping only fills in the rest.
    if (!aom_img_wrap(&image, AOM_IMG_FMT_I420, s->yuv.width, s->yuv.height, 1, s->yuv.planes[0]))
        return false;
    for (int i = 0; i < 3; i++) {
        image.planes[i] = s->yuv.planes[i];
        image.stride[i] = (int)s->yuv.strides[i];
    }
    return aom_codec_encode(&s->codec, &image, s->frames++, 1,
               request->key_frame ? AOM_EFLAG_FORCE_KF : 0) == AOM_CODEC_OK;
}

enum hg_status hg_av1_encode(void *state, const struct encode_request *request,
    struct encode_output *out, struct hg_error *err)
{
    struct av1 *s = state;
    const aom_codec_cx_pkt_t *packet;
    aom_codec_iter_t iterator = NULL;
    hg_yuv_convert(&s->yuv, request->pixels->data, request->frame.width, request->frame.height);
    const bool done = run(s, request);
    out->depends = true;
    while (done && (packet = aom_codec_get_cx_data(&s->codec, &iterator))) {
        if (packet->kind != AOM_CODEC_CX_FRAME_PKT)
            continue;
        hg_write_bytes(&out->data, packet->data.frame.buf, packet->data.frame.sz);
        out->depends &= !(packet->data.frame.flags & AOM_FRAME_IS_KEY);
    }
    if (!done || (!out->data.size && !out->data.failed))
        return hg_error_set(err, HG_E_INTERNAL, "av1", NULL, "the encoder failed");
    if (!out->depends && !out->data.failed)
        codec_string(out->data.data, out->data.size, out->codec);
    return HG_OK;
}
