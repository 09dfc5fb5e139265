#include "client/view/decode_video.h"

#ifdef HG_HAVE_AOM
#include <aom/aom_decoder.h>
#include <aom/aomdx.h>
#endif
#ifdef HG_HAVE_OPENH264
#include <wels/codec_api.h>
#endif

#include "base/alloc.h"
#include "client/view/decode_image.h"
#include "client/view/yuv_rgb.h"

struct hg_view_video {
    enum hgp_encoding encoding;
    uint32_t width, height; // px, of its frames
    uint64_t number;        // of the newest frame
    bool is_whole;          // false: the next frame has to be a key frame
#ifdef HG_HAVE_OPENH264
    ISVCDecoder *h264;
#endif
#ifdef HG_HAVE_AOM
    aom_codec_ctx_t av1;
    bool has_av1;
#endif
};

// What a decoder has made of a frame: planes of its own, until the next one.
struct decoded {
    struct hg_view_planes planes;
    uint32_t width, height; // px; at least those of the frame
};

bool hg_view_video_decodes(enum hgp_encoding encoding)
{
#ifdef HG_HAVE_OPENH264
    if (encoding == HGP_encoding_H264)
        return true;
#endif
#ifdef HG_HAVE_AOM
    if (encoding == HGP_encoding_AV1)
        return true;
#endif
    return false;
}

// ---- H.264 --------------------------------------------------------------------------------------

#ifdef HG_HAVE_OPENH264
static bool open_h264(struct hg_view_video *v)
{
    const SDecodingParam params = {
        .sVideoProperty = {sizeof params.sVideoProperty, VIDEO_BITSTREAM_AVC},
        .eEcActiveIdc = ERROR_CON_DISABLE};
    int quiet = WELS_LOG_QUIET;
    if (WelsCreateDecoder(&v->h264))
        return false;
    (*v->h264)->SetOption(v->h264, DECODER_OPTION_TRACE_LEVEL, &quiet);
    return (*v->h264)->Initialize(v->h264, &params) == 0;
}

static void close_h264(struct hg_view_video *v)
{
    if (!v->h264)
        return;
    (*v->h264)->Uninitialize(v->h264);
    WelsDestroyDecoder(v->h264);
    v->h264 = NULL;
}

// The picture of these data. The decoder keeps pictures back to put them in order, which is the
// order they come in here; told that no more comes it gives them out.
static bool take_h264(
    ISVCDecoder *d, const struct hgp_bytes *data, unsigned char *planes[3], SBufferInfo *info)
{
    int ends = 1, goes_on = 0;
    if ((*d)->DecodeFrameNoDelay(d, data->data, (int)data->size, planes, info))
        return false;
    if (info->iBufferStatus == 1)
        return true;
    (*d)->SetOption(d, DECODER_OPTION_END_OF_STREAM, &ends);
    const bool failed = (*d)->FlushFrame(d, planes, info);
    (*d)->SetOption(d, DECODER_OPTION_END_OF_STREAM, &goes_on);
    return !failed && info->iBufferStatus == 1;
}

static enum hg_status decode_h264(struct hg_view_video *v, const struct hgp_frame *frame,
    struct decoded *out, struct hg_error *err)
{
    unsigned char *planes[3] = {NULL, NULL, NULL};
    SBufferInfo info = {0};
    if (!v->h264 && !open_h264(v))
        return hg_view_decode_fail(err, HG_E_NOMEM, "no memory for a decoder of H.264");
    if (!take_h264(v->h264, &frame->data, planes, &info))
        return hg_view_decode_fail(err, HG_E_FORMAT, "damaged H.264");
    const SSysMEMBuffer *buffer = &info.UsrData.sSystemBuffer;
    *out = (struct decoded){.planes = {planes[0], planes[1], planes[2], (size_t)buffer->iStride[0],
                                (size_t)buffer->iStride[1]},
        .width = (uint32_t)buffer->iWidth,
        .height = (uint32_t)buffer->iHeight};
    return HG_OK;
}
#endif

// ---- AV1 ----------------------------------------------------------------------------------------

#ifdef HG_HAVE_AOM
// Of a key frame: its size is known before memory is taken.
static enum hg_status open_av1(
    struct hg_view_video *v, const struct hgp_frame *frame, struct hg_error *err)
{
    enum { PADDING_PX = 64 };
    const struct hgp_bytes *data = &frame->data;
    aom_codec_stream_info_t info = {0};
    if (aom_codec_peek_stream_info(aom_codec_av1_dx(), data->data, data->size, &info) ||
        info.w > frame->width + PADDING_PX || info.h > frame->height + PADDING_PX)
        return hg_view_decode_fail(err, HG_E_FORMAT, "an AV1 key frame of another size");
    const aom_codec_dec_cfg_t config = {.threads = 2, .allow_lowbitdepth = 1};
    if (!v->has_av1)
        v->has_av1 = !aom_codec_dec_init(&v->av1, aom_codec_av1_dx(), &config, 0);
    return v->has_av1 ? HG_OK
                      : hg_view_decode_fail(err, HG_E_NOMEM, "no memory for a decoder of AV1");
}

static void close_av1(struct hg_view_video *v)
{
    if (v->has_av1)
        aom_codec_destroy(&v->av1);
    v->has_av1 = false;
}

static enum hg_status decode_av1(struct hg_view_video *v, const struct hgp_frame *frame,
    struct decoded *out, struct hg_error *err)
{
    const enum hg_status status = frame->has_depends ? HG_OK : open_av1(v, frame, err);
    const aom_image_t *image = NULL, *next;
    aom_codec_iter_t at = NULL;
    if (status)
        return status;
    if (!v->has_av1 || aom_codec_decode(&v->av1, frame->data.data, frame->data.size, NULL))
        return hg_view_decode_fail(err, HG_E_FORMAT, "damaged AV1");
    while ((next = aom_codec_get_frame(&v->av1, &at)))
        image = next;
    if (!image || image->fmt != AOM_IMG_FMT_I420)
        return hg_view_decode_fail(err, HG_E_FORMAT, "AV1 without a picture of 4:2:0, 8 bit");
    *out = (struct decoded){.planes = {image->planes[0], image->planes[1], image->planes[2],
                                (size_t)image->stride[0], (size_t)image->stride[1]},
        .width = image->d_w,
        .height = image->d_h};
    return HG_OK;
}
#endif

// ---- either -------------------------------------------------------------------------------------

static void close_decoders(struct hg_view_video *v)
{
#ifdef HG_HAVE_OPENH264
    close_h264(v);
#endif
#ifdef HG_HAVE_AOM
    close_av1(v);
#endif
}

static enum hg_status begin(
    struct hg_view_video *v, const struct hgp_frame *frame, struct hg_error *err)
{
    const bool alike =
        v->encoding == frame->encoding && v->width == frame->width && v->height == frame->height;
    if (frame->has_depends)
        return v->is_whole && alike && v->number + frame->depends == frame->number
                   ? HG_OK
                   : hg_view_decode_fail(err, HG_E_FORMAT, "the frame before it was lost");
    if (!alike || !v->is_whole)
        close_decoders(v);
    v->encoding = frame->encoding;
    v->width = frame->width;
    v->height = frame->height;
    return HG_OK;
}

static enum hg_status decode(struct hg_view_video *v, const struct hgp_frame *frame,
    struct decoded *out, struct hg_error *err)
{
#ifdef HG_HAVE_OPENH264
    if (frame->encoding == HGP_encoding_H264)
        return decode_h264(v, frame, out, err);
#endif
#ifdef HG_HAVE_AOM
    if (frame->encoding == HGP_encoding_AV1)
        return decode_av1(v, frame, out, err);
#endif
    (void)v, (void)out;
    return hg_view_decode_fail(err, HG_E_UNSUPPORTED, "a video codec that was not built in");
}

enum hg_status hg_view_video_decode(struct hg_view_video **video, const struct hgp_frame *frame,
    struct hg_view_pixels *out, struct hg_error *err)
{
    struct decoded decoded = {0};
    if (!*video)
        *video = hg_calloc(1, sizeof **video);
    struct hg_view_video *v = *video;
    if (!v)
        return hg_view_decode_fail(err, HG_E_NOMEM, "no memory for video");
    enum hg_status status = begin(v, frame, err);
    v->is_whole = false;
    if (!status)
        status = decode(v, frame, &decoded, err);
    if (!status && (decoded.width < frame->width || decoded.height < frame->height))
        status = hg_view_decode_fail(err, HG_E_FORMAT, "video of another size");
    if (!status && hg_view_rgb_of_planes(&decoded.planes, frame->width, frame->height, out->data))
        status = hg_view_decode_fail(err, HG_E_NOMEM, "no memory for its pixels");
    if (status)
        return status;
    v->is_whole = true;
    v->number = frame->number;
    return HG_OK;
}

void hg_view_video_destroy(struct hg_view_video *v)
{
    if (!v)
        return;
    close_decoders(v);
    hg_free(v);
}
