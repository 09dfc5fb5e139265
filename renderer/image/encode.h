// encode.h - file writers that do not go through OpenImageIO.
// Floor 1, private to renderer/image. Thread-safe.
#ifndef HG_RENDERER_IMAGE_ENCODE_H
#define HG_RENDERER_IMAGE_ENCODE_H

#include "renderer/image/image.h"

// JPEG from RGBA8 through libjpeg-turbo; quality 1..100. HG_E_NOMEM, HG_E_LIMIT, HG_E_IO.
enum hg_status hg_jpeg_encode(const struct hg_image *image, int quality, struct hg_writer *out,
    struct hg_error *err) HG_MUST_CHECK;

#endif
