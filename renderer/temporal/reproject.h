// reproject.h - where samples were in the picture before. Private to renderer/temporal. Pure.
#ifndef HG_RENDERER_TEMPORAL_REPROJECT_H
#define HG_RENDERER_TEMPORAL_REPROJECT_H

#include "renderer/temporal/temporal.h"

// A matrix of `to_previous`, from the number of a sample and its depth to pixels of the output:
// [4 of x, y, depth, w][x of sample, y of sample, depth, 1].
struct hg_temporal_way {
    float to[4][4];
    float px[2][2]; // where the sample is now, px: scale and offset of its number
};
void hg_temporal_way_make(const struct hg_temporal_picture *picture, const double matrix[16],
    uint32_t width, uint32_t height, struct hg_temporal_way *out);

// Where a sample was not to be seen, `x` of its motion.
#define HG_TEMPORAL_LOST 1e9f

struct hg_temporal_motion_row {
    float *x, *y;  // [samples] px of the output
    float *expect; // depth that the picture before shows if it shows the same
    float *depth;  // of the sample now
};
// Row y of the picture. ways: one per matrix.
void hg_temporal_motion_fill(const struct hg_temporal_picture *picture,
    const struct hg_temporal_way *ways, uint32_t y, struct hg_temporal_motion_row *out);

#endif
