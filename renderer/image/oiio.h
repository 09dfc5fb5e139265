// oiio.h - OpenImageIO, callable from C.
// Floor 1, private to renderer/image. Thread-safe. No exception leaves oiio.cpp.
#ifndef HG_RENDERER_IMAGE_OIIO_H
#define HG_RENDERER_IMAGE_OIIO_H

#include <stdio.h>

#include "renderer/image/exr.h"
#include "renderer/image/image.h"
#include "renderer/image/reader.h"

#ifdef __cplusplus
extern "C" {
#endif

// `format` is OpenImageIO's name of the reader; `limits` is complete (no zero field).
enum hg_status hg_oiio_probe(const struct hg_image_bytes *file, const char *format,
    struct hg_image_info *out, struct hg_error *err) HG_MUST_CHECK;
enum hg_status hg_oiio_read(const struct hg_image_bytes *file, const char *format,
    enum hg_pixel_format pixels, const struct hg_image_limits *limits, struct hg_image *out,
    struct hg_error *err) HG_MUST_CHECK;
// PNG and EXR files. The image has the pixel format the file needs (checked by the caller).
enum hg_status hg_oiio_encode(const struct hg_image *image, const struct hg_image_encode *params,
    struct hg_writer *out, struct hg_error *err) HG_MUST_CHECK;

// An OpenEXR file of one part; what the caller checked fits together.
enum hg_status hg_oiio_encode_part(const uint32_t size_px[2], const struct hg_exr_part *part,
    struct hg_writer *out, struct hg_error *err) HG_MUST_CHECK;
// Decodes all pixels of all parts and forgets them; see hg_image_examine.
enum hg_status hg_oiio_examine(const struct hg_image_bytes *file, const char *format,
    const char *key, const struct hg_image_limits *limits, struct hg_image_told *out,
    struct hg_error *err) HG_MUST_CHECK;

struct hg_oiio_reader; // see reader.h

// Of a file, which stays the caller's and must outlive the reader, or of bytes (file NULL), whose
// data must; bytes->name is used in messages.
enum hg_status hg_oiio_reader_open(FILE *file, const struct hg_image_bytes *bytes,
    const char *format, uint32_t max_side_px, struct hg_oiio_reader **out,
    struct hg_error *err) HG_MUST_CHECK;
void hg_oiio_reader_close(struct hg_oiio_reader *reader); // accepts NULL
const struct hg_image_reader_info *hg_oiio_reader_info(const struct hg_oiio_reader *reader);
enum hg_status hg_oiio_reader_rows(struct hg_oiio_reader *reader, enum hg_pixel_format format,
    uint32_t count, void *pixels, struct hg_error *err) HG_MUST_CHECK;
void hg_oiio_reader_skip(struct hg_oiio_reader *reader, uint32_t count);
enum hg_status hg_oiio_reader_rect(struct hg_oiio_reader *reader, const struct hg_image_rect *rect,
    enum hg_pixel_format format, void *pixels, uint64_t *bytes, struct hg_error *err) HG_MUST_CHECK;

#ifdef __cplusplus
}
#endif

#endif
