// png.h - PNG files written by libpng (rows.h reads them).
// Floor 1, private to renderer/image. Thread-safe; no state.
#ifndef HG_RENDERER_IMAGE_PNG_H
#define HG_RENDERER_IMAGE_PNG_H

#include "renderer/image/oiio.h"

// Appends the file's bytes to `out` (which may fail for want of room: the caller checks it): sRGB,
// straight alpha, attributes that are text. From U8, U16 or F32 (0..1) to U8 or U16. HG_E_INVAL,
// HG_E_NOMEM, HG_E_IO.
enum hg_status hg_png_encode(
    const struct hg_oiio_encode *image, struct hg_writer *out, struct hg_error *err) HG_MUST_CHECK;

#endif
