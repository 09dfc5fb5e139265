// png.h - PNG by libpng: what scenes and pictures are made of is read and written without the
// libraries that OpenImageIO brings (oiio_module.h). The same headers, targets and pictures as
// there. Floor 1, private to renderer/image. One thread at a time per input.
#ifndef HG_RENDERER_IMAGE_PNG_H
#define HG_RENDERER_IMAGE_PNG_H

#include "renderer/image/oiio.h"

struct hg_png_input;

// As hg_oiio_open. Palettes, few bits and transparent colours are expanded; 16 bits stay.
// HG_E_FORMAT (with libpng's reason), HG_E_LIMIT (2 GiB of pixels, unless large), HG_E_NOMEM.
enum hg_status hg_png_open(FILE *file, const struct hg_image_bytes *bytes, bool large,
    struct hg_png_input **out, struct hg_error *err) HG_MUST_CHECK;
void hg_png_close(struct hg_png_input *input); // accepts NULL
const struct hg_oiio_header *hg_png_get_header(const struct hg_png_input *input);
// The value of a text chunk before the pixels, cut to size_bytes; "" when there is none.
void hg_png_read_text(
    const struct hg_png_input *input, const char *key, char *text, size_t size_bytes);
// `count` rows from row y on: NATIVE, U8, U16 or F32. Rows are decoded in order, so going back
// begins anew; the whole of an interlaced picture is decoded and kept (2 GiB at most: HG_E_LIMIT).
enum hg_status hg_png_read_rows(struct hg_png_input *input, uint32_t y, uint32_t count,
    const struct hg_oiio_target *target, struct hg_error *err) HG_MUST_CHECK;

// Appends the file's bytes to `out` (which may fail for want of room: the caller checks it): sRGB,
// straight alpha, attributes that are text. From U8, U16 or F32 (0..1) to U8 or U16. HG_E_NOMEM,
// HG_E_IO.
enum hg_status hg_png_encode(
    const struct hg_oiio_encode *image, struct hg_writer *out, struct hg_error *err) HG_MUST_CHECK;

#endif
