#include <string.h>
#include <turbojpeg.h>

#include "base/alloc.h"
#include "renderer/image/encode.h"

enum { max_jpeg_side_px = 65500 };

// Attributes become comments "name=value" behind the JFIF header, which is 20 bytes long.
static void write_commented(struct hg_writer *out, const unsigned char *bytes, size_t size,
    const struct hg_image_encode *params)
{
    static const size_t head = 20;
    size_t first = size > head && bytes[2] == 0xff && bytes[3] == 0xe0 ? head : 2;
    hg_write_bytes(out, bytes, first);
    for (size_t i = 0; i < params->attribute_count; i++) {
        const struct hg_image_attribute *a = &params->attributes[i];
        size_t name = strlen(a->name), value = a->type == HG_ATTR_STRING ? strlen(a->string) : 0;
        size_t length = 2 + name + 1 + value;
        if (!value || length > 0xffff)
            continue;
        const uint8_t mark[4] = {0xff, 0xfe, (uint8_t)(length >> 8), (uint8_t)length};
        hg_write_bytes(out, mark, sizeof mark);
        hg_write_bytes(out, a->name, name);
        hg_write_u8(out, '=');
        hg_write_bytes(out, a->string, value);
    }
    hg_write_bytes(out, bytes + first, size - first);
}

static enum hg_status compress(tjhandle handle, const struct hg_image *image,
    const struct hg_image_encode *params, struct hg_writer *out, struct hg_error *err)
{
    int quality = params->quality;
    int subsampling = quality >= 90 || params->full_chroma ? TJSAMP_444 : TJSAMP_420;
    unsigned long capacity = tjBufSize((int)image->width, (int)image->height, subsampling);
    unsigned char *bytes = hg_calloc(capacity, 1);
    if (!bytes)
        return hg_error_set(err, HG_E_NOMEM, "jpeg", NULL, "no memory for %lu bytes", capacity);
    unsigned long size = capacity;
    int rc = tjCompress2(handle, image->pixels, (int)image->width, 0, (int)image->height, TJPF_RGBX,
        &bytes, &size, subsampling, quality, TJFLAG_NOREALLOC);
    if (rc == 0)
        write_commented(out, bytes, size, params);
    hg_free(bytes);
    if (rc)
        return hg_error_set(err, HG_E_IO, "jpeg", NULL, "%s", tjGetErrorStr2(handle));
    return out->failed ? hg_error_set(err, HG_E_NOMEM, "jpeg", NULL, "no room for the file")
                       : HG_OK;
}

enum hg_status hg_jpeg_encode(const struct hg_image *image, const struct hg_image_encode *params,
    struct hg_writer *out, struct hg_error *err)
{
    if (image->width > max_jpeg_side_px || image->height > max_jpeg_side_px)
        return hg_error_set(err, HG_E_LIMIT, "jpeg", "size", "%ux%u is larger than a JPEG can be",
            image->width, image->height);
    tjhandle handle = tjInitCompress();
    if (!handle)
        return hg_error_set(err, HG_E_NOMEM, "jpeg", NULL, "no memory for the encoder");
    enum hg_status st = compress(handle, image, params, out, err);
    tjDestroy(handle);
    return st;
}

static enum hg_status decode_pixels(
    tjhandle handle, const struct hg_image_bytes *file, struct hg_image *out, struct hg_error *err)
{
    int rc = tjDecompress2(handle, file->data, file->size, out->pixels, (int)out->width, 0,
        (int)out->height, TJPF_RGBA, TJFLAG_ACCURATEDCT | TJFLAG_LIMITSCANS);
    if (rc && tjGetErrorCode(handle) != TJERR_WARNING)
        return hg_error_set(err, HG_E_FORMAT, file->name, NULL, "%s", tjGetErrorStr2(handle));
    return HG_OK;
}

enum hg_status hg_jpeg_decode(const struct hg_image_bytes *file,
    const struct hg_image_limits *limits, struct hg_image *out, bool *decoded, struct hg_error *err)
{
    int width, height, subsampling, colors;
    *out = (struct hg_image){0};
    *decoded = false;
    tjhandle handle = tjInitDecompress();
    if (!handle)
        return hg_error_set(err, HG_E_NOMEM, file->name, NULL, "no memory for the decoder");
    enum hg_status st = HG_OK;
    if (tjDecompressHeader3(
            handle, file->data, file->size, &width, &height, &subsampling, &colors) == 0 &&
        colors != TJCS_CMYK && colors != TJCS_YCCK) {
        *decoded = true;
        st = hg_image_create((uint32_t)width, (uint32_t)height, HG_PIXEL_RGBA8, limits, out);
        if (st)
            hg_error_set(
                err, st, file->name, "size", "%dx%d px: %s", width, height, hg_status_text(st));
        else
            st = decode_pixels(handle, file, out, err);
    }
    if (st)
        hg_image_finish(out);
    tjDestroy(handle);
    return st;
}
