// decode.c - frames to pixels.
#include "client/view/decode.h"

#include <string.h>
#include <turbojpeg.h>
#include <zstd.h>

#include "base/alloc.h"

static enum hg_status fail(struct hg_error *err, enum hg_status status, const char *reason)
{
    return hg_error_set(err, status, "frame", "data", "%s", reason);
}

static enum hg_status make_room(
    struct hg_view_pixels *out, const struct hgp_frame *frame, struct hg_error *err)
{
    const size_t bytes = (size_t)frame->width * frame->height * 4; // 16384 x 16384 at most
    out->width = out->height = 0;
    if (hg_grow(&out->data, &out->capacity, bytes, 1))
        return fail(err, HG_E_NOMEM, "no memory for its pixels");
    return HG_OK;
}

static enum hg_status decode_zstd(struct hg_view_decoder *d, const struct hgp_bytes *data,
    uint8_t *dst, size_t bytes, struct hg_error *err)
{
    if (!d->zstd)
        d->zstd = ZSTD_createDCtx();
    if (!d->zstd)
        return fail(err, HG_E_NOMEM, "no memory for zstd");
    const size_t got = ZSTD_decompressDCtx(d->zstd, dst, bytes, data->data, data->size);
    if (ZSTD_isError(got))
        return fail(err, HG_E_FORMAT, ZSTD_getErrorName(got));
    return got == bytes ? HG_OK : fail(err, HG_E_FORMAT, "zstd data of another size");
}

static enum hg_status decode_jpeg(
    struct hg_view_decoder *d, const struct hgp_frame *frame, uint8_t *dst, struct hg_error *err)
{
    int width, height, sampling, space;
    if (!d->jpeg)
        d->jpeg = tjInitDecompress();
    if (!d->jpeg)
        return fail(err, HG_E_NOMEM, "no memory for JPEG");
    // The header first: the picture must not be larger than the room for it.
    if (tjDecompressHeader3(
            d->jpeg, frame->data.data, frame->data.size, &width, &height, &sampling, &space))
        return fail(err, HG_E_FORMAT, tjGetErrorStr2(d->jpeg));
    if (width != (int)frame->width || height != (int)frame->height)
        return fail(err, HG_E_FORMAT, "a JPEG of another size");
    if (tjDecompress2(
            d->jpeg, frame->data.data, frame->data.size, dst, width, 0, height, TJPF_RGBA, 0) &&
        tjGetErrorCode(d->jpeg) == TJERR_FATAL)
        return fail(err, HG_E_FORMAT, tjGetErrorStr2(d->jpeg));
    return HG_OK;
}

enum hg_status hg_view_decode(struct hg_view_decoder *d, const struct hgp_frame *frame,
    struct hg_view_pixels *out, struct hg_error *err)
{
    const size_t bytes = (size_t)frame->width * frame->height * 4;
    enum hg_status status = make_room(out, frame, err);
    if (status)
        return status;
    switch (frame->encoding) {
    case HGP_encoding_RAW_RGBA8:
        if (frame->data.size != bytes)
            return fail(err, HG_E_FORMAT, "raw pixels of another size");
        memcpy(out->data, frame->data.data, bytes);
        break;
    case HGP_encoding_ZSTD_RGBA8:
        status = decode_zstd(d, &frame->data, out->data, bytes, err);
        break;
    case HGP_encoding_JPEG:
        status = decode_jpeg(d, frame, out->data, err);
        break;
    default:
        status = fail(err, HG_E_UNSUPPORTED, "an encoding that this viewer does not show");
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
    *d = (struct hg_view_decoder){0};
}

void hg_view_pixels_finish(struct hg_view_pixels *pixels)
{
    hg_free(pixels->data);
    *pixels = (struct hg_view_pixels){0};
}
