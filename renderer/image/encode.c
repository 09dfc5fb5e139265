#include "renderer/image/encode.h"

#include <stdio.h>
#include <string.h>

#include "base/alloc.h"
#include "renderer/image/decode.h"
#include "renderer/image/oiio.h"
#include "renderer/image/pixels.h"
#include "renderer/image/png.h"

// ---- attributes of PNG: all of them are text ----------------------------------------------------

struct text_attributes {
    struct hg_image_attribute *list; // owned
    char (*texts)[400];              // owned; of those that are not text already
};

static void write_attribute_text(const struct hg_image_attribute *a, char *text, size_t size)
{
    size_t at = 0, count = a->type == HG_ATTR_MAT4 ? 16 : 1;
    if (a->type == HG_ATTR_INT)
        snprintf(text, size, "%d", a->integer);
    else if (a->type == HG_ATTR_RATIO)
        snprintf(text, size, "%d/%u", a->integer, (unsigned)a->count);
    else if (a->type == HG_ATTR_COUNT)
        snprintf(text, size, "%u", (unsigned)a->count);
    else
        for (size_t i = 0; i < count && at < size; i++)
            at +=
                (size_t)snprintf(text + at, size - at, i ? " %.9g" : "%.9g", (double)a->floats[i]);
}

static bool make_text_attributes(
    struct text_attributes *out, const struct hg_image_attribute *attributes, size_t count)
{
    if (count == 0)
        return true;
    out->list = hg_calloc(count, sizeof *out->list);
    out->texts = hg_calloc(count, sizeof *out->texts);
    if (out->list == NULL || out->texts == NULL)
        return false;
    for (size_t i = 0; i < count; i++) {
        out->list[i] = attributes[i];
        if (attributes[i].type == HG_ATTR_STRING)
            continue;
        write_attribute_text(&attributes[i], out->texts[i], sizeof out->texts[i]);
        out->list[i].type = HG_ATTR_STRING;
        out->list[i].string = out->texts[i];
    }
    return true;
}

static void finish_text_attributes(struct text_attributes *t)
{
    hg_free(t->list);
    hg_free(t->texts);
}

// ---- files -------------------------------------------------------------------------------------

static enum hg_status encode_file(
    const struct hg_oiio_encode *e, struct hg_writer *out, struct hg_error *err)
{
    const enum hg_status status = strcmp(e->format, "png") == 0 ? hg_png_encode(e, out, err)
                                                                : hg_oiio_encode_image(e, out, err);
    if (status == HG_OK && out->failed)
        return hg_error_set(err, HG_E_NOMEM, e->name, NULL, "no room for the file");
    return status;
}

static enum hg_status no_memory(const struct hg_oiio_encode *e, struct hg_error *err)
{
    return hg_error_set(err, HG_E_NOMEM, e->name, NULL, "no memory to decode or encode");
}

static struct hg_oiio_encode describe(const char *format, enum hg_oiio_type type,
    const struct hg_image *image, const struct hg_image_encode *params)
{
    return (struct hg_oiio_encode){
        .format = format,
        .name = format,
        .width = image->width,
        .height = image->height,
        .channels = params->opaque ? 3 : 4,
        .type = type,
        .attributes = params->attributes,
        .attribute_count = params->attribute_count,
        .pixel_type = hg_decode_type(image->format),
        .pixel_stride_bytes = hg_pixel_bytes(image->format),
        .pixels = image->pixels,
    };
}

static enum hg_status encode_png(const struct hg_image *image, const struct hg_image_encode *params,
    struct hg_writer *out, struct hg_error *err)
{
    const enum hg_oiio_type type = params->file == HG_IMAGE_PNG16 ? HG_OIIO_U16 : HG_OIIO_U8;
    struct hg_oiio_encode e = describe("png", type, image, params);
    struct text_attributes texts = {0};
    const bool made = make_text_attributes(&texts, params->attributes, params->attribute_count);
    e.attributes = texts.list;
    const enum hg_status status = made ? encode_file(&e, out, err) : no_memory(&e, err);
    finish_text_attributes(&texts);
    return status;
}

// EXR stores associated alpha by definition of the format.
static enum hg_status encode_exr(const struct hg_image *image, const struct hg_image_encode *params,
    struct hg_writer *out, struct hg_error *err)
{
    const bool half = params->file == HG_IMAGE_EXR_HALF;
    struct hg_oiio_encode e = describe("openexr", half ? HG_OIIO_HALF : HG_OIIO_F32, image, params);
    const size_t count = (size_t)image->width * image->height;
    const bool clamp = half && !hg_pixels_fit_half(image->pixels, count * 4);
    float *copy = NULL;
    if (clamp || !params->opaque) {
        copy = hg_calloc(count * 4, sizeof *copy);
        if (copy == NULL)
            return no_memory(&e, err);
        memcpy(copy, image->pixels, count * 4 * sizeof *copy);
        e.pixels = copy;
    }
    if (!params->opaque)
        hg_pixels_associate(copy, count);
    if (copy != NULL && half)
        hg_pixels_clamp_to_half(copy, count * 4);
    const enum hg_status status = encode_file(&e, out, err);
    hg_free(copy);
    return status;
}

static bool format_fits(enum hg_image_file file, enum hg_pixel_format format)
{
    switch (file) {
    case HG_IMAGE_PNG8:
    case HG_IMAGE_JPEG:
        return format == HG_PIXEL_RGBA8;
    case HG_IMAGE_PNG16:
        return format == HG_PIXEL_RGBA16 || format == HG_PIXEL_RGBA32F;
    case HG_IMAGE_EXR_HALF:
    case HG_IMAGE_EXR_FLOAT:
        return format == HG_PIXEL_RGBA32F;
    }
    return false;
}

enum hg_status hg_image_encode(const struct hg_image *image, const struct hg_image_encode *params,
    struct hg_writer *out, struct hg_error *err)
{
    if (!image->pixels || !format_fits(params->file, image->format))
        return hg_error_set(
            err, HG_E_INVAL, "image", "format", "this kind of file needs another pixel format");
    int quality = params->quality ? params->quality : 90;
    if (quality < 1 || quality > 100)
        return hg_error_set(err, HG_E_INVAL, "image", "quality", "%d is not in 1..100", quality);
    struct hg_image_encode complete = *params;
    complete.quality = quality;
    if (params->file == HG_IMAGE_JPEG)
        return hg_jpeg_encode(image, &complete, out, err);
    return params->file == HG_IMAGE_PNG8 || params->file == HG_IMAGE_PNG16
               ? encode_png(image, params, out, err)
               : encode_exr(image, params, out, err);
}
