// decode.c - frames to pixels.
#include "client/view/decode.h"

#include <string.h>
#include <turbojpeg.h>
#include <zstd.h>

#include "base/alloc.h"
#include "client/view/decode_image.h"
#include "client/view/decode_tiles.h"
#include "client/view/decode_video.h"

static enum hg_status make_room(
    struct hg_view_pixels *out, const struct hgp_frame *frame, struct hg_error *err)
{
    const size_t bytes = (size_t)frame->width * frame->height * 4; // 16384 x 16384 at most
    out->width = out->height = 0;
    if (hg_grow(&out->data, &out->capacity, bytes, 1))
        return hg_view_decode_fail(err, HG_E_NOMEM, "no memory for its pixels");
    return HG_OK;
}

static enum hg_status decode_zstd(struct hg_view_decoder *d, const struct hgp_bytes *data,
    uint8_t *dst, size_t bytes, struct hg_error *err)
{
    if (!d->zstd)
        d->zstd = ZSTD_createDCtx();
    if (!d->zstd)
        return hg_view_decode_fail(err, HG_E_NOMEM, "no memory for zstd");
    const size_t got = ZSTD_decompressDCtx(d->zstd, dst, bytes, data->data, data->size);
    if (ZSTD_isError(got))
        return hg_view_decode_fail(err, HG_E_FORMAT, ZSTD_getErrorName(got));
    return got == bytes ? HG_OK
                        : hg_view_decode_fail(err, HG_E_FORMAT, "zstd data of another size");
}

size_t hg_view_codecs(uint8_t out[HG_VIEW_CODECS_MAX])
{
    static const enum hgp_encoding known[] = {HGP_encoding_H264, HGP_encoding_AV1,
        HGP_encoding_TILES_JPEG, HGP_encoding_JPEG_444, HGP_encoding_JPEG};
    size_t count = 0;
    for (size_t i = 0; i < sizeof known / sizeof *known; i++)
        if (i > 1 || hg_view_video_decodes(known[i]))
            out[count++] = (uint8_t)known[i];
    return count;
}

bool hg_view_is_stream(enum hgp_encoding encoding)
{
    return encoding == HGP_encoding_TILES || encoding == HGP_encoding_TILES_JPEG ||
           encoding == HGP_encoding_H264 || encoding == HGP_encoding_H264_444 ||
           encoding == HGP_encoding_AV1;
}

enum hg_status hg_view_decode(struct hg_view_decoder *d, const struct hgp_frame *frame,
    struct hg_view_pixels *out, struct hg_error *err)
{
    const size_t bytes = (size_t)frame->width * frame->height * 4;
    enum hg_status status = make_room(out, frame, err);
    if (status)
        return status;
    const struct hg_view_area area = {
        out->data, frame->width, frame->height, 4 * (size_t)frame->width};
    switch (frame->encoding) {
    case HGP_encoding_RAW_RGBA8:
        if (frame->data.size != bytes)
            return hg_view_decode_fail(err, HG_E_FORMAT, "raw pixels of another size");
        memcpy(out->data, frame->data.data, bytes);
        break;
    case HGP_encoding_ZSTD_RGBA8:
        status = decode_zstd(d, &frame->data, out->data, bytes, err);
        break;
    case HGP_encoding_JPEG:
    case HGP_encoding_JPEG_444:
        status = hg_view_decode_jpeg(&d->jpeg, &frame->data, &area, err);
        break;
    case HGP_encoding_TILES:
    case HGP_encoding_TILES_JPEG:
        status = hg_view_tiles_decode(&d->tiles, &d->jpeg, frame, out, err);
        break;
    case HGP_encoding_H264:
    case HGP_encoding_AV1:
        status = hg_view_video_decode(&d->video, frame, out, err);
        break;
    default:
        status = hg_view_decode_fail(
            err, HG_E_UNSUPPORTED, "an encoding that this viewer does not show");
    }
    if (status)
        return status;
    out->width = frame->width;
    out->height = frame->height;
    return HG_OK;
}

void hg_view_decoder_finish(struct hg_view_decoder *d)
{
    if (d->jpeg)
        tjDestroy(d->jpeg);
    ZSTD_freeDCtx(d->zstd);
    hg_view_tiles_destroy(d->tiles);
    hg_view_video_destroy(d->video);
    *d = (struct hg_view_decoder){0};
}

void hg_view_pixels_finish(struct hg_view_pixels *pixels)
{
    hg_free(pixels->data);
    *pixels = (struct hg_view_pixels){0};
}
