// encode.h - JPEG through libjpeg-turbo's own interface: faster than through OpenImageIO.
// Floor 1, private to renderer/image. Thread-safe.
#ifndef HG_RENDERER_IMAGE_ENCODE_H
#define HG_RENDERER_IMAGE_ENCODE_H

#include "renderer/image/image.h"

// JPEG from RGBA8 through libjpeg-turbo; params->quality 1..100; text attributes become comments.
// HG_E_NOMEM, HG_E_LIMIT, HG_E_IO.
enum hg_status hg_jpeg_encode(const struct hg_image *image, const struct hg_image_encode *params,
    struct hg_writer *out, struct hg_error *err) HG_MUST_CHECK;

// Decodes to RGBA8 (alpha 1, *decoded true), or leaves *decoded false when the file is of a kind
// that needs OpenImageIO (CMYK, or a header that is not understood). `limits` is complete.
// HG_E_FORMAT, HG_E_LIMIT, HG_E_NOMEM. A file that is cut short shows what was there.
enum hg_status hg_jpeg_decode(const struct hg_image_bytes *file,
    const struct hg_image_limits *limits, struct hg_image *out, bool *decoded,
    struct hg_error *err) HG_MUST_CHECK;

#endif
