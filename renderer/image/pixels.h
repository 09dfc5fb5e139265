// pixels.h - in-place conversion of decoded pixels: channels to RGBA, alpha, range of halves.
// Floor 1, private to renderer/image. Pure; any thread.
#ifndef HG_RENDERER_IMAGE_PIXELS_H
#define HG_RENDERER_IMAGE_PIXELS_H

#include "renderer/image/image.h"

// Expands `count` tightly packed pixels of `channels` (1 grey, 2 grey and alpha, 3 RGB, 4 RGBA) to
// RGBA, alpha 1 where there is none. `pixels` has room for `count` pixels of `format`.
void hg_pixels_expand(void *pixels, size_t count, enum hg_pixel_format format, int channels);

// Associated (premultiplied) to straight alpha: colour / alpha, rounded to nearest and clamped for
// integers. Pixels with alpha <= 0 or >= 1 stay.
void hg_pixels_unassociate(void *pixels, size_t count, enum hg_pixel_format format);

// Straight to associated alpha, RGBA32F.
void hg_pixels_associate(float *pixels, size_t count);

// Whether none of the values is beyond the largest half, 65504. NaN is within.
bool hg_pixels_fit_half(const float *values, size_t count);
// Clamps to +-65504: infinities in a file would spread in every blur. NaN stays.
void hg_pixels_clamp_to_half(float *values, size_t count);

#endif
