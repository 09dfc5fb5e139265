#include "renderer/image/decode.h"

#include <stdio.h>
#include <string.h>

#include "base/alloc.h"
#include "renderer/image/exr.h"
#include "renderer/image/input.h"
#include "renderer/image/pixels.h"

enum { BAND_ROWS = 64 }; // decoded at once when a file is examined

static uint64_t at_least_1(uint64_t value)
{
    return value ? value : 1;
}

// pixel_bytes: of a decoded pixel.
static enum hg_status check_limits(const struct hg_oiio_header *h, const char *name,
    uint64_t pixel_bytes, const struct hg_image_limits *l, struct hg_error *err)
{
    const uint64_t width = (uint64_t)h->width, height = (uint64_t)h->height;
    const uint64_t pixels = width * height;
    if (width > l->max_side_px || height > l->max_side_px)
        return hg_error_set(err, HG_E_LIMIT, name, "size", "%dx%d px is more than %u a side",
            h->width, h->height, l->max_side_px);
    if (pixels > l->max_pixels || pixels > l->max_bytes / pixel_bytes)
        return hg_error_set(
            err, HG_E_LIMIT, name, "size", "%dx%d px is more than allowed", h->width, h->height);
    if (h->channels > HG_OIIO_MAX_CHANNELS)
        return hg_error_set(err, HG_E_LIMIT, name, "channels", "%d is more than %d", h->channels,
            HG_OIIO_MAX_CHANNELS);
    // The decoder holds one whole tile or row.
    const uint64_t tile = (uint64_t)(h->tile_width > 1 ? h->tile_width : 1) *
                          (uint64_t)(h->tile_height > 1 ? h->tile_height : 1);
    if (tile > l->max_pixels || tile > l->max_bytes / at_least_1(h->pixel_bytes))
        return hg_error_set(err, HG_E_LIMIT, name, "tile", "%dx%d px is more than allowed",
            h->tile_width, h->tile_height);
    return HG_OK;
}

int hg_decode_channels(const struct hg_oiio_header *h)
{
    if (h->channels >= 4 && h->alpha_channel == 3)
        return 4;
    if (h->channels >= 3 && h->alpha_channel != 1)
        return 3;
    return h->channels >= 2 && h->alpha_channel == 1 ? 2 : 1;
}

bool hg_decode_has_alpha(const struct hg_oiio_header *h)
{
    const int channels = hg_decode_channels(h);
    return channels == 2 || channels == 4;
}

enum hg_oiio_type hg_decode_type(enum hg_pixel_format format)
{
    switch (format) {
    case HG_PIXEL_RGBA8:
        return HG_OIIO_U8;
    case HG_PIXEL_RGBA16:
        return HG_OIIO_U16;
    case HG_PIXEL_RGBA32F:
        break;
    }
    return HG_OIIO_F32;
}

void hg_decode_finish_pixels(
    const struct hg_oiio_header *h, void *pixels, size_t count, enum hg_pixel_format format)
{
    hg_pixels_expand(pixels, count, format, hg_decode_channels(h));
    if (hg_decode_has_alpha(h) && !h->straight_alpha)
        hg_pixels_unassociate(pixels, count, format);
}

enum hg_status hg_decode_probe(const struct hg_image_bytes *file, const char *format,
    struct hg_image_info *out, struct hg_error *err)
{
    struct hg_input *input;
    enum hg_status status = hg_input_open(NULL, file, format, false, &input, err);
    if (status != HG_OK)
        return status;
    const struct hg_oiio_header *h = hg_input_get_header(input);
    *out = (struct hg_image_info){.width = (uint32_t)h->width,
        .height = (uint32_t)h->height,
        .channels = (uint32_t)h->channels,
        .is_float = h->is_float,
        .is_16bit = h->is_16bit};
    snprintf(out->file_format, sizeof out->file_format, "%s", format);
    hg_input_close(input);
    return HG_OK;
}

static enum hg_status read_image(struct hg_input *input, enum hg_pixel_format format,
    const struct hg_image_limits *limits, struct hg_image *out, struct hg_error *err)
{
    const struct hg_oiio_header *h = hg_input_get_header(input);
    const char *name = hg_input_name(input);
    enum hg_status status = check_limits(h, name, hg_pixel_bytes(format), limits, err);
    if (status != HG_OK)
        return status;
    status = hg_image_create((uint32_t)h->width, (uint32_t)h->height, format, limits, out);
    if (status != HG_OK)
        return hg_error_set(
            err, status, name, "size", "no memory for %dx%d px", h->width, h->height);
    const struct hg_oiio_target target = {
        hg_decode_type(format), hg_decode_channels(h), out->pixels};
    status = hg_input_read_image(input, 0, &target, err);
    if (status != HG_OK)
        return status;
    hg_decode_finish_pixels(h, out->pixels, (size_t)out->width * out->height, format);
    out->has_alpha = hg_decode_has_alpha(h);
    return HG_OK;
}

enum hg_status hg_decode_image(const struct hg_image_bytes *file, const char *format,
    enum hg_pixel_format pixels, const struct hg_image_limits *limits, struct hg_image *out,
    struct hg_error *err)
{
    struct hg_input *input;
    enum hg_status status = hg_input_open(NULL, file, format, false, &input, err);
    if (status == HG_OK)
        status = read_image(input, pixels, limits, out, err);
    hg_input_close(input);
    if (status != HG_OK)
        hg_image_finish(out);
    return status;
}

// ---- examining ---------------------------------------------------------------------------------

static enum hg_status read_bands(struct hg_input *input, int part, const struct hg_oiio_header *h,
    void *rows, struct hg_error *err)
{
    const struct hg_oiio_target target = {HG_OIIO_NATIVE, h->channels, rows};
    if (h->tile_width != 0)
        return hg_input_read_image(input, part, &target, err);
    enum hg_status status = HG_OK;
    for (int y = 0; status == HG_OK && y < h->height; y += BAND_ROWS) {
        const int count = h->height - y < BAND_ROWS ? h->height - y : BAND_ROWS;
        status = hg_input_read_rows(input, part, (uint32_t)y, (uint32_t)count, &target, err);
    }
    return status;
}

// As stored, without conversion: decoding checks the data.
static enum hg_status examine_part(
    struct hg_input *input, int part, const struct hg_oiio_header *h, struct hg_error *err)
{
    const uint64_t bytes = h->tile_width != 0 ? h->image_bytes : h->row_bytes * BAND_ROWS;
    void *rows = bytes <= SIZE_MAX ? hg_calloc((size_t)at_least_1(bytes), 1) : NULL;
    if (rows == NULL)
        return hg_error_set(
            err, HG_E_NOMEM, hg_input_name(input), NULL, "no memory to decode or encode");
    const enum hg_status status = read_bands(input, part, h, rows, err);
    hg_free(rows);
    return status;
}

static enum hg_status examine_parts(struct hg_input *input, const struct hg_image_limits *limits,
    struct hg_image_summary *out, struct hg_error *err)
{
    enum hg_status status = HG_OK;
    for (int part = 0; status == HG_OK && part < HG_EXR_MAX_PARTS; part++) {
        struct hg_oiio_header header;
        status = hg_input_part_header(input, part, &header, err);
        if (status == HG_E_NOTFOUND)
            return HG_OK;
        if (status == HG_OK)
            status = check_limits(&header, hg_input_name(input), 1, limits, err);
        if (status == HG_OK)
            status = examine_part(input, part, &header, err);
        out->parts++;
    }
    return status;
}

static enum hg_status examine(struct hg_input *input, const char *key,
    const struct hg_image_limits *limits, struct hg_image_summary *out, struct hg_error *err)
{
    const struct hg_oiio_header *h = hg_input_get_header(input);
    enum hg_status status =
        check_limits(h, hg_input_name(input), at_least_1(h->pixel_bytes), limits, err);
    if (status != HG_OK)
        return status;
    out->width = (uint32_t)h->width;
    out->height = (uint32_t)h->height;
    status = hg_input_read_text(input, key, out->value, sizeof out->value, err);
    return status != HG_OK ? status : examine_parts(input, limits, out, err);
}

enum hg_status hg_decode_examine(const struct hg_image_bytes *file, const char *format,
    const char *key, const struct hg_image_limits *limits, struct hg_image_summary *out,
    struct hg_error *err)
{
    struct hg_input *input;
    snprintf(out->file_format, sizeof out->file_format, "%s", format);
    enum hg_status status = hg_input_open(NULL, file, format, false, &input, err);
    if (status == HG_OK)
        status = examine(input, key, limits, out, err);
    hg_input_close(input);
    return status;
}
