#include "renderer/image/encode.h"

#include "renderer/image/oiio.h"

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
    return hg_oiio_encode(image, params, out, err);
}
