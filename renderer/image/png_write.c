// png_write.c - see png.h. Rows go in without filters, at a low level of compression: pictures are
// encoded while a client waits.
#include <math.h>
#include <png.h>
#include <setjmp.h>
#include <string.h>

#include "base/alloc.h"
#include "renderer/image/png.h"

enum { COMPRESSION_LEVEL = 3 };

struct png_output {
    const struct hg_oiio_encode *image;
    struct hg_writer *out;
    png_structp png;
    png_infop info;
    uint8_t *row;     // owned, as it is stored
    png_text *texts;  // owned
    char reason[256]; // of libpng's error
};

static _Noreturn void on_error(png_structp png, png_const_charp text)
{
    struct png_output *o = png_get_error_ptr(png);
    snprintf(o->reason, sizeof o->reason, "libpng: %s", text);
    png_longjmp(png, 1);
}

static void on_warning(png_structp png, png_const_charp text)
{
    (void)png;
    (void)text;
}

static void on_write(png_structp png, png_bytep data, size_t size)
{
    struct png_output *o = png_get_io_ptr(png);
    hg_write_bytes(o->out, data, size);
}

static void on_flush(png_structp png)
{
    (void)png;
}

// ---- rows --------------------------------------------------------------------------------------

static uint16_t sample_16(const struct hg_oiio_encode *e, const uint8_t *pixel, size_t channel)
{
    if (e->pixel_type == HG_OIIO_F32) {
        const float value = ((const float *)(const void *)pixel)[channel] * 65535.0f;
        return value > 0 ? (uint16_t)fminf(rintf(value), 65535.0f) : 0; // also of NaN
    }
    return e->pixel_type == HG_OIIO_U16 ? ((const uint16_t *)(const void *)pixel)[channel]
                                        : (uint16_t)(pixel[channel] * 257);
}

static uint8_t sample_8(const struct hg_oiio_encode *e, const uint8_t *pixel, size_t channel)
{
    return e->pixel_type == HG_OIIO_U8
               ? pixel[channel]
               : (uint8_t)((sample_16(e, pixel, channel) * 255u + 32767u) / 65535u);
}

static void make_row(const struct hg_oiio_encode *e, uint32_t y, uint8_t *row)
{
    const uint8_t *pixel =
        (const uint8_t *)e->pixels + (size_t)y * e->width * e->pixel_stride_bytes;
    const size_t channels = e->channels;
    if (e->type == HG_OIIO_U8 && e->pixel_type == HG_OIIO_U8 && e->pixel_stride_bytes == channels) {
        memcpy(row, pixel, (size_t)e->width * channels);
        return;
    }
    for (uint32_t x = 0; x < e->width; x++, pixel += e->pixel_stride_bytes)
        for (size_t c = 0; c < channels; c++) {
            if (e->type == HG_OIIO_U8) {
                *row++ = sample_8(e, pixel, c);
                continue;
            }
            const uint16_t v = sample_16(e, pixel, c); // stored with the high byte first
            *row++ = (uint8_t)(v >> 8);
            *row++ = (uint8_t)v;
        }
}

// ---- the file ----------------------------------------------------------------------------------

static void put_texts(struct png_output *o)
{
    int count = 0;
    for (size_t i = 0; i < o->image->attribute_count; i++) {
        const struct hg_image_attribute *a = &o->image->attributes[i];
        if (a->type != HG_ATTR_STRING || !a->string || !*a->string)
            continue;
        o->texts[count++] = (png_text){.compression = PNG_TEXT_COMPRESSION_NONE,
            .key = (png_charp)(uintptr_t)a->name,
            .text = (png_charp)(uintptr_t)a->string,
            .text_length = strlen(a->string)};
    }
    if (count)
        png_set_text(o->png, o->info, o->texts, count);
}

static void put_file(struct png_output *o)
{
    const struct hg_oiio_encode *e = o->image;
    static const int types[] = {PNG_COLOR_TYPE_GRAY, PNG_COLOR_TYPE_GRAY_ALPHA, PNG_COLOR_TYPE_RGB,
        PNG_COLOR_TYPE_RGB_ALPHA};
    png_set_write_fn(o->png, o, on_write, on_flush);
    png_set_user_limits(o->png, PNG_UINT_31_MAX, PNG_UINT_31_MAX);
    png_set_compression_level(o->png, COMPRESSION_LEVEL);
    png_set_filter(o->png, PNG_FILTER_TYPE_BASE, PNG_NO_FILTERS);
    png_set_IHDR(o->png, o->info, e->width, e->height, e->type == HG_OIIO_U8 ? 8 : 16,
        types[e->channels - 1], PNG_INTERLACE_NONE, PNG_COMPRESSION_TYPE_DEFAULT,
        PNG_FILTER_TYPE_DEFAULT);
    png_set_sRGB_gAMA_and_cHRM(o->png, o->info, PNG_sRGB_INTENT_PERCEPTUAL);
    put_texts(o);
    png_write_info(o->png, o->info);
    for (uint32_t y = 0; y < e->height; y++) {
        make_row(e, y, o->row);
        png_write_row(o->png, o->row);
    }
    png_write_end(o->png, o->info);
}

static enum hg_status write_file(struct png_output *o, struct hg_error *err)
{
    if (setjmp(png_jmpbuf(o->png)))
        return hg_error_set(err, HG_E_IO, o->image->name, NULL, "%s", o->reason);
    put_file(o);
    return HG_OK;
}

enum hg_status hg_png_encode(
    const struct hg_oiio_encode *e, struct hg_writer *out, struct hg_error *err)
{
    if (e->channels < 1 || e->channels > 4 || !e->width || !e->height)
        return hg_error_set(err, HG_E_INVAL, e->name, NULL, "no picture of 1 to 4 channels");
    struct png_output o = {.image = e,
        .out = out,
        .row = hg_calloc(e->width, (size_t)e->channels * (e->type == HG_OIIO_U8 ? 1 : 2)),
        .texts = hg_calloc(e->attribute_count + 1, sizeof *o.texts)};
    o.png = png_create_write_struct(PNG_LIBPNG_VER_STRING, &o, on_error, on_warning);
    o.info = o.png ? png_create_info_struct(o.png) : NULL;
    const enum hg_status status =
        o.row && o.texts && o.info
            ? write_file(&o, err)
            : hg_error_set(err, HG_E_NOMEM, e->name, NULL, "no memory to decode or encode");
    if (o.png)
        png_destroy_write_struct(&o.png, &o.info);
    hg_free(o.row);
    hg_free(o.texts);
    return status;
}
