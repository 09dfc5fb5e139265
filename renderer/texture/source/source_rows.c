// source_rows.c - images as rows from the top. See source.h.
#include <string.h>

#include "base/alloc.h"
#include "renderer/texture/source/source.h"
#include "renderer/texture/source/udim.h"

// One of three: a file or bytes, a set of files, pixels.
struct hg_source_rows {
    struct hg_source_info info;
    enum hg_pixel_format format;
    struct hg_image_reader *reader;
    struct hg_udim_rows *udim;
    const struct hg_image *pixels; // borrowed
    uint32_t y;
};

enum hg_status hg_source_rows_open(const struct hg_image_source *source,
    const struct hg_source_info *info, struct hg_source_rows **out, struct hg_error *err)
{
    *out = NULL;
    struct hg_source_rows *r = hg_calloc(1, sizeof *r);
    if (r == NULL)
        return hg_error_set(err, HG_E_NOMEM, source->label, NULL, "no memory to read it");
    r->info = *info;
    r->format = info->is_float ? HG_PIXEL_RGBA32F : HG_PIXEL_RGBA8;
    enum hg_status status = HG_OK;
    if (info->udim_columns > 0) {
        status = hg_udim_rows_open(source->path, info, &r->udim, err);
    } else if (source->encoded != NULL || source->path != NULL) {
        status = hg_source_open_file(source, info, &r->reader, err);
    } else {
        r->pixels = &source->pixels;
        r->format = source->pixels.format;
    }
    if (status == HG_OK)
        *out = r;
    else
        hg_source_rows_close(r);
    return status;
}

void hg_source_rows_close(struct hg_source_rows *rows)
{
    if (rows == NULL)
        return;
    hg_image_reader_close(rows->reader);
    hg_udim_rows_close(rows->udim);
    hg_free(rows);
}

enum hg_pixel_format hg_source_rows_format(const struct hg_source_rows *rows)
{
    return rows->format;
}

uint64_t hg_source_rows_bytes(const struct hg_source_rows *rows)
{
    if (rows->reader != NULL)
        return hg_image_reader_info(rows->reader)->row_buffer_bytes;
    return rows->udim != NULL ? hg_udim_rows_bytes(rows->udim) : 0;
}

enum hg_status hg_source_rows_next(
    struct hg_source_rows *r, uint32_t count, void *pixels, struct hg_error *err)
{
    if (count > r->info.height - r->y)
        return hg_error_set(err, HG_E_INVAL, "image", NULL, "no more rows");
    enum hg_status status = HG_OK;
    if (r->reader != NULL) {
        status = hg_image_reader_rows(r->reader, r->format, count, pixels, err);
    } else if (r->udim != NULL) {
        status = hg_udim_rows_next(r->udim, count, pixels, err);
    } else {
        const size_t row = (size_t)r->info.width * hg_pixel_bytes(r->format);
        memcpy(pixels, (const uint8_t *)r->pixels->pixels + r->y * row, count * row);
    }
    r->y += count;
    return status;
}

enum hg_status hg_source_rows_skip(
    struct hg_source_rows *r, uint32_t count, void *pixels, struct hg_error *err)
{
    enum hg_status status = HG_OK;
    if (r->udim != NULL) {
        for (uint32_t i = 0; i < count && status == HG_OK; i++)
            status = hg_source_rows_next(r, 1, pixels, err);
        return status;
    }
    if (count > r->info.height - r->y)
        return hg_error_set(err, HG_E_INVAL, "image", NULL, "no more rows");
    if (r->reader != NULL)
        hg_image_reader_skip(r->reader, count);
    r->y += count;
    return status;
}

enum hg_status hg_source_rows_check(const struct hg_source_rows *r, struct hg_error *err)
{
    if (r->udim != NULL)
        return hg_udim_rows_check(r->udim, err);
    if (r->reader != NULL && !hg_image_reader_is_unchanged(r->reader))
        return hg_error_set(
            err, HG_E_HASH, "image", NULL, "the file was changed while it was read");
    return HG_OK;
}
