// yuv_rgb.h - planes of video to display values: BT.709 matrix, limited range, 8 bit, 4:2:0 with
// chroma at the left luma samples (ITU-T H.264, E.2.1: chroma_loc 0), interpolated bilinearly. The
// way back of server/worker/encode/yuv.h. Floor 6 (client).
#ifndef HG_CLIENT_VIEW_YUV_RGB_H
#define HG_CLIENT_VIEW_YUV_RGB_H

#include <stddef.h>
#include <stdint.h>

#include "base/status.h"

// Planes of at least the picture's size, chroma of half of that, rounded up. Borrowed.
struct hg_view_planes {
    const uint8_t *y, *cb, *cr;
    size_t y_pitch, c_pitch; // bytes from a row to the next
};

// RGBA with alpha 255, rows without padding. HG_E_NOMEM: for two rows of chroma.
enum hg_status hg_view_rgb_of_planes(const struct hg_view_planes *planes, uint32_t width,
    uint32_t height, uint8_t *rgba) HG_MUST_CHECK;

#endif
