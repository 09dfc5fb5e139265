// look_up.h - the history of a row of pixels. Private to renderer/temporal.
#ifndef HG_RENDERER_TEMPORAL_LOOK_UP_H
#define HG_RENDERER_TEMPORAL_LOOK_UP_H

#include "renderer/temporal/rows.h"

#define HG_TEMPORAL_BORDER 2 // px around the colours of a history, repeated

// A finished picture.
struct hg_temporal_past {
    uint16_t *color; // [height + 4][width + 4][4] encoded, premultiplied; a border of 2 px
    float *depth;    // [height][width] of the nearest of 3x3 samples
    uint8_t *weight; // [height][width] samples that it is made of, in 1/16; 0 = none; and 3 more
};

struct hg_temporal_found {
    float *color;           // [width][4] red, green, blue, alpha, as stored, 0..1
    float *weight;          // [width] samples, 0: no history
    float *part_x, *part_y; // between texels
    int32_t *texel;         // number in `color` of the first of 4x4
    int32_t *nearest;       // pixel of `depth` and `weight`, -1: outside
};

// Row y of the output; size: width and height. Catmull-Rom weights (Catmull and Rom 1974).
void hg_temporal_look_up(const struct hg_temporal_past *past, const uint32_t size[2], uint32_t y,
    const struct hg_temporal_about *about, struct hg_temporal_found *out);

// Colours of the history as hg_temporal_look_up finds them, of pixels with a weight; the second
// only where the processor has AVX2, with the same results.
void hg_temporal_filter_plain(const struct hg_temporal_past *past, size_t pitch, uint32_t width,
    const struct hg_temporal_found *out);
void hg_temporal_filter_avx2(const struct hg_temporal_past *past, size_t pitch, uint32_t width,
    const struct hg_temporal_found *out);

// Weights of histories that show the same surface, or what lay behind it; the second as above.
#define HG_TEMPORAL_DEPTH_REACH 0.03f // how much nearer the same surface may be stored, relative
#define HG_TEMPORAL_SLOPE_REACH 2.0f  // and in slopes of the surface itself
void hg_temporal_weigh_plain(const struct hg_temporal_past *past,
    const struct hg_temporal_about *about, uint32_t width, const struct hg_temporal_found *out);
void hg_temporal_weigh_avx2(const struct hg_temporal_past *past,
    const struct hg_temporal_about *about, uint32_t width, const struct hg_temporal_found *out);

#endif
