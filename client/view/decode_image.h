// decode_image.h - JPEG files to pixels, for whole frames and for tiles of them. Private to
// decode*.c. Floor 6 (client).
#ifndef HG_CLIENT_VIEW_DECODE_IMAGE_H
#define HG_CLIENT_VIEW_DECODE_IMAGE_H

#include <stddef.h>
#include <stdint.h>

#include "base/status.h"
#include "protocol/hgp.h"

// Where in a picture: RGBA, 8 bit.
struct hg_view_area {
    uint8_t *pixels;
    uint32_t width, height; // px
    size_t pitch;           // bytes from a row to the next
};

// *jpeg: a decoder of libturbojpeg that is made with the first file; the caller's. HG_E_FORMAT:
// damaged, or not of the area's size.
enum hg_status hg_view_decode_jpeg(void **jpeg, const struct hgp_bytes *file,
    const struct hg_view_area *area, struct hg_error *err) HG_MUST_CHECK;
// "frame", "data", the reason.
enum hg_status hg_view_decode_fail(struct hg_error *err, enum hg_status status, const char *reason);

#endif
