#include "server/worker/encode/encoder.h"

#include "renderer/image/zstd.h"
#include "server/worker/encode/encode_av1.h"
#include "server/worker/encode/encode_exr.h"
#include "server/worker/encode/encode_openh264.h"
#include "server/worker/encode/encode_tiles.h"
#include "server/worker/encode/encode_x264.h"
#include "server/worker/encode/h264.h"

static enum hg_status encode_raw(void *state, const struct encode_request *request,
    struct encode_output *out, struct hg_error *err)
{
    (void)state;
    (void)request;
    (void)out;
    (void)err;
    return HG_OK;
}

static enum hg_status encode_zstd(void *state, const struct encode_request *request,
    struct encode_output *out, struct hg_error *err)
{
    (void)state;
    return hg_zstd_encode(request->pixels->data, request->pixels->size, 1, &out->data, err);
}

// PNG and JPEG.
static enum hg_status encode_file(const struct encode_request *request, enum hg_image_file file,
    enum hg_pixel_format pixels, struct encode_output *out, struct hg_error *err)
{
    const struct hgp_frame *f = &request->frame;
    const struct hg_image_attribute made_from = {.name = ENCODE_FRAME_KEY_ATTRIBUTE,
        .type = HG_ATTR_STRING,
        .string = request->metadata.frame_key};
    struct hg_image image = {
        .width = f->width,
        .height = f->height,
        .format = pixels,
        .has_alpha = !request->opaque,
        .size_bytes = request->pixels->size,
        .pixels = request->pixels->data,
    };
    return hg_image_encode(&image,
        &(struct hg_image_encode){.file = file,
            .quality = request->quality,
            .opaque = request->opaque,
            .attributes = &made_from,
            .attribute_count = request->metadata.frame_key[0] != 0,
            .full_chroma = f->encoding == HGP_encoding_JPEG_444},
        &out->data, err);
}

static enum hg_status encode_png8(void *state, const struct encode_request *request,
    struct encode_output *out, struct hg_error *err)
{
    (void)state;
    return encode_file(request, HG_IMAGE_PNG8, HG_PIXEL_RGBA8, out, err);
}

static enum hg_status encode_png16(void *state, const struct encode_request *request,
    struct encode_output *out, struct hg_error *err)
{
    (void)state;
    return encode_file(request, HG_IMAGE_PNG16, HG_PIXEL_RGBA16, out, err);
}

static enum hg_status encode_jpeg(void *state, const struct encode_request *request,
    struct encode_output *out, struct hg_error *err)
{
    (void)state;
    return encode_file(request, HG_IMAGE_JPEG, HG_PIXEL_RGBA8, out, err);
}

static enum hg_status encode_exr_file(void *state, const struct encode_request *request,
    struct encode_output *out, struct hg_error *err)
{
    (void)state;
    return hg_encode_exr(request, &out->data, err);
}

static const struct encoder_ops encoders[ENCODER_COUNT] = {
    [HGP_encoding_RAW_RGBA8] = {"raw8", HG_PIXEL_RGBA8, true, .encode = encode_raw, .alpha = true,
        .motion = true},
    [HGP_encoding_RAW_RGBA32F] = {"raw32f", HG_PIXEL_RGBA32F, true, .encode = encode_raw,
        .alpha = true},
    [HGP_encoding_ZSTD_RGBA8] = {"zstd", HG_PIXEL_RGBA8, true, .encode = encode_zstd, .alpha = true,
        .motion = true},
    [HGP_encoding_PNG8] = {"png8", HG_PIXEL_RGBA8, true, .encode = encode_png8, .alpha = true,
        .motion = true},
    [HGP_encoding_PNG16] = {"png16", HG_PIXEL_RGBA16, true, .encode = encode_png16, .alpha = true},
    [HGP_encoding_JPEG] = {"jpeg", HG_PIXEL_RGBA8, false, .encode = encode_jpeg, .motion = true},
    [HGP_encoding_EXR_HALF] = {"exr", HG_PIXEL_RGBA32F, false, .encode = encode_exr_file,
        .alpha = true},
    [HGP_encoding_EXR_FLOAT] = {"exr32f", HG_PIXEL_RGBA32F, true, .encode = encode_exr_file,
        .alpha = true},
#ifdef HG_HAVE_X264
    [HGP_encoding_H264] = {"x264", HG_PIXEL_RGBA8, false, hg_x264_open, hg_x264_encode,
        hg_x264_close, .motion = true, .most_px = HG_H264_MOST_PX},
    [HGP_encoding_H264_444] = {"x264-444", HG_PIXEL_RGBA8, false, hg_x264_open, hg_x264_encode,
        hg_x264_close, .motion = true, .most_px = HG_H264_MOST_PX},
#elif defined(HG_HAVE_OPENH264)
    [HGP_encoding_H264] = {"openh264", HG_PIXEL_RGBA8, false, hg_openh264_open, hg_openh264_encode,
        hg_openh264_close, .motion = true, .most_px = HG_H264_MOST_PX},
#endif
#ifdef HG_HAVE_AOM
    [HGP_encoding_AV1] = {"av1", HG_PIXEL_RGBA8, false, hg_av1_open, hg_av1_encode, hg_av1_close,
        .motion = true, .most_px = HG_AV1_MOST_PX},
#endif
    [HGP_encoding_TILES] = {"tiles", HG_PIXEL_RGBA8, true, hg_tiles_open, hg_tiles_encode,
        hg_tiles_close, .motion = true, .alpha = true},
    [HGP_encoding_TILES_JPEG] = {"tiles-jpeg", HG_PIXEL_RGBA8, true, hg_tiles_open,
        hg_tiles_encode_jpeg, hg_tiles_close, .motion = true, .alpha = true,
        .shares = 1 + HGP_encoding_TILES},
    [HGP_encoding_JPEG_444] = {"jpeg444", HG_PIXEL_RGBA8, false, .encode = encode_jpeg,
        .motion = true},
};

const struct encoder_ops *hg_encoder_find(enum hgp_encoding encoding)
{
    const struct encoder_ops *ops = &encoders[encoding];
    return ops->name ? ops : NULL;
}
