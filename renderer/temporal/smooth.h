// smooth.h - a single sample per pixel, smoothed along its edges. Private to renderer/temporal.
// Pure.
#ifndef HG_RENDERER_TEMPORAL_SMOOTH_H
#define HG_RENDERER_TEMPORAL_SMOOTH_H

#include <stdbool.h>
#include <stdint.h>

// Which pixels of row y stand out from one above, below, left or right: marks[width], else 0.
// scratch: [3][width + 2].
void hg_temporal_smooth_mark(
    const uint8_t *rgba, const uint32_t size[2], uint32_t y, int32_t *scratch, int32_t *marks);

// The pixel (x, y) of a picture of [height][width][4] as an edge through it would cover it: how far
// its ends are along the row or the column of most contrast says where it crosses the pixel. False:
// no edge, *out is not written.
// Source: the idea of Lottes 2009, "FXAA"; Reshetov 2009, "Morphological Antialiasing".
// Only of pixels that are marked.
bool hg_temporal_smooth(
    const uint8_t *rgba, const uint32_t size[2], uint32_t x, uint32_t y, uint8_t out[4]);

#endif
