// source.c - see source.h.
#include <string.h>

#include "base/alloc.h"
#include "base/file.h"
#include "renderer/texture/mip_stream.h"
#include "renderer/texture/source.h"

#define FILE_LIMIT_BYTES (1ull << 31)

static enum hg_status check_size(
    const struct hg_source_info *info, const char *label, struct hg_error *err)
{
    if (info->width == 0 || info->height == 0)
        return hg_error_set(err, HG_E_FORMAT, label, NULL, "the image is empty");
    if (info->width > HG_MIPS_SIDE_PX || info->height > HG_MIPS_SIDE_PX)
        return hg_error_set(err, HG_E_LIMIT, label, NULL, "%u x %u texels, %u are allowed",
            info->width, info->height, HG_MIPS_SIDE_PX);
    return HG_OK;
}

static enum hg_status identify_pixels(
    const struct hg_image *image, struct hg_source_info *out, struct hg_error *err)
{
    struct hg_sha256 *h = hg_sha256_create();
    if (h == NULL)
        return hg_error_set(err, HG_E_NOMEM, NULL, NULL, "no memory to hash pixels");
    const uint32_t head[3] = {image->width, image->height, (uint32_t)image->format};
    hg_sha256_update(h, head, sizeof head);
    hg_sha256_update(h, image->pixels, image->size_bytes);
    hg_sha256_end(h, out->hash);
    out->width = image->width;
    out->height = image->height;
    out->is_float = image->format != HG_PIXEL_RGBA8;
    return HG_OK;
}

static enum hg_status identify_tiles(
    const struct hg_image_tiles *tiles, struct hg_source_info *out, struct hg_error *err)
{
    struct hg_sha256 *h = hg_sha256_create();
    if (h == NULL)
        return hg_error_set(err, HG_E_NOMEM, NULL, NULL, "no memory to hash an id");
    const uint32_t head[4] = {tiles->width, tiles->height, (uint32_t)tiles->format, UINT32_MAX};
    hg_sha256_update(h, head, sizeof head);
    hg_sha256_update(h, tiles->id, sizeof tiles->id);
    hg_sha256_end(h, out->hash);
    out->width = tiles->width;
    out->height = tiles->height;
    out->is_float = tiles->format != HG_PIXEL_RGBA8;
    return HG_OK;
}

static enum hg_status identify_bytes(const void *data, size_t size, const char *label,
    struct hg_source_info *out, struct hg_error *err)
{
    struct hg_image_info info;
    enum hg_status status = hg_image_probe_memory(data, size, label, &info, err);
    if (status == HG_OK && hg_sha256(data, size, out->hash) != HG_OK)
        status = hg_error_set(err, HG_E_NOMEM, label, NULL, "no memory to hash the file");
    out->width = info.width;
    out->height = info.height;
    out->is_float = info.is_float;
    return status;
}

enum hg_status hg_source_identify(
    const struct hg_image_source *source, struct hg_source_info *out, struct hg_error *err)
{
    memset(out, 0, sizeof *out);
    enum hg_status status;
    if (source->encoded != NULL) {
        status =
            identify_bytes(source->encoded->data, source->encoded->size, source->label, out, err);
    } else if (source->path != NULL) {
        uint8_t *data;
        size_t size;
        status = hg_file_read(source->path, FILE_LIMIT_BYTES, &data, &size, err);
        if (status == HG_OK) {
            status = identify_bytes(data, size, source->label, out, err);
            hg_free(data);
        }
    } else if (source->tiles != NULL) {
        status = identify_tiles(source->tiles, out, err);
    } else if (source->pixels.pixels != NULL) {
        status = identify_pixels(&source->pixels, out, err);
    } else {
        status = hg_error_set(err, HG_E_NOTFOUND, source->label, NULL, "the image has no data");
    }
    if (status == HG_OK)
        status = check_size(out, source->label, err);
    if (status != HG_OK)
        memset(out, 0, sizeof *out);
    return status;
}

enum hg_status hg_source_decode(const struct hg_image_source *source,
    const struct hg_source_info *info, const struct hg_image_limits *limits,
    const struct hg_image **view, struct hg_image *owned, struct hg_error *err)
{
    memset(owned, 0, sizeof *owned);
    *view = NULL;
    const enum hg_pixel_format format = info->is_float ? HG_PIXEL_RGBA32F : HG_PIXEL_RGBA8;
    enum hg_status status = HG_OK;
    if (source->encoded != NULL)
        status = hg_image_read_memory(source->encoded->data, source->encoded->size, source->label,
            format, limits, owned, err);
    else if (source->path != NULL)
        status = hg_image_read_file(source->path, format, limits, owned, err);
    if (status != HG_OK)
        return status;
    *view = owned->pixels != NULL ? owned : &source->pixels;
    if ((*view)->width == info->width && (*view)->height == info->height)
        return HG_OK;
    *view = NULL;
    hg_image_finish(owned);
    return hg_error_set(
        err, HG_E_FORMAT, source->label, NULL, "the image changed while it was read");
}
