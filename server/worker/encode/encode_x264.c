#include "server/worker/encode/encode_x264.h"

#include <string.h>
#include <x264.h>

#include "base/alloc.h"
#include "server/worker/encode/h264.h"
#include "server/worker/encode/yuv.h"

struct x264 {
    x264_t *encoder;
    struct hg_yuv yuv;
    int64_t frames;
};

void hg_x264_close(void *state)
{
    struct x264 *s = state;
    if (s->encoder)
        x264_encoder_close(s->encoder);
    hg_yuv_finish(&s->yuv);
    hg_free(s);
}

// Constant quantiser, which frames change; key frames on demand; no B-frames, no lookahead.
static bool fill_params(x264_param_t *p, const struct x264 *s, uint8_t quality)
{
    if (x264_param_default_preset(p, "superfast", "zerolatency") != 0)
        return false;
    p->i_log_level = X264_LOG_NONE;
    p->i_threads = p->i_lookahead_threads = 1;
    p->b_sliced_threads = 0;
    p->i_width = (int)s->yuv.width;
    p->i_height = (int)s->yuv.height;
    p->i_csp = s->yuv.full_chroma ? X264_CSP_I444 : X264_CSP_I420;
    p->i_bitdepth = 8;
    p->b_vfr_input = 0;
    p->i_fps_num = 30;
    p->i_fps_den = 1;
    p->i_keyint_max = X264_KEYINT_MAX_INFINITE;
    p->i_scenecut_threshold = 0;
    p->i_frame_reference = 1;
    p->b_annexb = p->b_repeat_headers = 1;
    p->rc.i_rc_method = X264_RC_CRF; // with CQP pictures may not leave the first quantiser
    p->rc.f_rf_constant = (float)hg_h264_quantiser(quality);
    p->rc.i_aq_mode = X264_AQ_NONE;
    p->rc.b_mb_tree = 0;
    p->vui.b_fullrange = 0;
    p->vui.i_colorprim = 1; // BT.709
    p->vui.i_transfer = 13; // sRGB
    p->vui.i_colmatrix = 1; // BT.709
    return x264_param_apply_profile(p, s->yuv.full_chroma ? "high444" : "high") == 0;
}

enum hg_status hg_x264_open(const struct encode_request *first, void **state, struct hg_error *err)
{
    const struct hgp_frame *f = &first->frame;
    const bool full_chroma = f->encoding == HGP_encoding_H264_444;
    struct x264 *s = hg_calloc(1, sizeof *s);
    x264_param_t params;
    *state = NULL;
    if (!s || hg_yuv_create(f->width, f->height, HG_H264_LEAST_PX, full_chroma, &s->yuv)) {
        hg_free(s);
        return hg_error_set(err, HG_E_NOMEM, "x264", NULL, "no memory");
    }
    if (fill_params(&params, s, first->quality))
        s->encoder = x264_encoder_open(&params);
    if (!s->encoder) {
        hg_x264_close(s);
        return hg_error_set(err, HG_E_UNSUPPORTED, "x264", "size",
            "the encoder does not take pictures of %ux%u px", f->width, f->height);
    }
    *state = s;
    return HG_OK;
}

static void fill_picture(struct x264 *s, const struct encode_request *request, x264_picture_t *in)
{
    x264_picture_init(in);
    in->img.i_csp = s->yuv.full_chroma ? X264_CSP_I444 : X264_CSP_I420;
    in->img.i_plane = 3;
    for (int i = 0; i < 3; i++) {
        in->img.plane[i] = s->yuv.planes[i];
        in->img.i_stride[i] = (int)s->yuv.strides[i];
    }
    in->i_pts = s->frames++;
    in->i_type = request->key_frame ? X264_TYPE_IDR : X264_TYPE_AUTO;
    in->i_qpplus1 = 1 + hg_h264_quantiser(request->quality);
}

enum hg_status hg_x264_encode(void *state, const struct encode_request *request,
    struct encode_output *out, struct hg_error *err)
{
    struct x264 *s = state;
    x264_picture_t in, coded;
    x264_nal_t *nals = NULL;
    int count = 0;
    hg_yuv_convert(&s->yuv, request->pixels->data, request->frame.width, request->frame.height);
    fill_picture(s, request, &in);
    const int size = x264_encoder_encode(s->encoder, &nals, &count, &in, &coded);
    if (size <= 0 || count < 1)
        return hg_error_set(err, HG_E_INTERNAL, "x264", NULL, "the encoder failed");
    hg_write_bytes(&out->data, nals[0].p_payload, (size_t)size); // NALs lie behind each other
    out->depends = !coded.b_keyframe;
    if (!out->depends)
        hg_h264_codec(nals[0].p_payload, (size_t)size, out->codec);
    return HG_OK;
}
