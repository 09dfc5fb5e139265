// decode.h - images decoded whole by OpenImageIO: limits, channels, conversion to RGBA.
// Floor 1, private to renderer/image. Thread-safe.
#ifndef HG_RENDERER_IMAGE_DECODE_H
#define HG_RENDERER_IMAGE_DECODE_H

#include "renderer/image/image.h"
#include "renderer/image/oiio.h"

// `format` is OpenImageIO's name of the reader; `limits` is complete (no zero member).
enum hg_status hg_decode_probe(const struct hg_image_bytes *file, const char *format,
    struct hg_image_info *out, struct hg_error *err) HG_MUST_CHECK;
enum hg_status hg_decode_image(const struct hg_image_bytes *file, const char *format,
    enum hg_pixel_format pixels, const struct hg_image_limits *limits, struct hg_image *out,
    struct hg_error *err) HG_MUST_CHECK;
// Decodes all pixels of all parts and discards them; see hg_image_examine.
enum hg_status hg_decode_examine(const struct hg_image_bytes *file, const char *format,
    const char *key, const struct hg_image_limits *limits, struct hg_image_summary *out,
    struct hg_error *err) HG_MUST_CHECK;

// How many of the file's first channels are read: grey, grey + alpha, RGB or RGBA.
int hg_decode_channels(const struct hg_oiio_header *header);
bool hg_decode_has_alpha(const struct hg_oiio_header *header);
enum hg_oiio_type hg_decode_type(enum hg_pixel_format format);
// From hg_decode_channels channels of `count` pixels, tightly packed, to straight RGBA in place.
void hg_decode_finish_pixels(
    const struct hg_oiio_header *header, void *pixels, size_t count, enum hg_pixel_format format);

#endif
