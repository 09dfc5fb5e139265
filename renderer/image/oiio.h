// oiio.h - what the rest of this room needs from OpenImageIO, callable from C.
// Floor 1, private to renderer/image. Thread-safe. No exception leaves oiio.cpp.
#ifndef HG_RENDERER_IMAGE_OIIO_H
#define HG_RENDERER_IMAGE_OIIO_H

#include "renderer/image/image.h"

#ifdef __cplusplus
extern "C" {
#endif

// `format` is OpenImageIO's name of the reader; `limits` is complete (no zero field).
enum hg_status hg_oiio_probe(const void *data, size_t size, const char *name, const char *format,
    struct hg_image_info *out, struct hg_error *err) HG_MUST_CHECK;
enum hg_status hg_oiio_read(const void *data, size_t size, const char *name, const char *format,
    enum hg_pixel_format pixels, const struct hg_image_limits *limits, struct hg_image *out,
    struct hg_error *err) HG_MUST_CHECK;
// PNG and EXR files. The image has the pixel format the file needs (checked by the caller).
enum hg_status hg_oiio_encode(const struct hg_image *image, const struct hg_image_encode *params,
    struct hg_writer *out, struct hg_error *err) HG_MUST_CHECK;

#ifdef __cplusplus
}
#endif

#endif
