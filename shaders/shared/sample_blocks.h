// sample_blocks.h - how many samples the pixels of a settled picture get, by blocks of them.
// Floor 0, shared by C and GLSL.
#ifndef HG_SHADERS_SHARED_SAMPLE_BLOCKS_H
#define HG_SHADERS_SHARED_SAMPLE_BLOCKS_H

#include "shared/types.h"

// Sides of a block: what CPU devices with vectors of eight shade or leave out together.
#define HG_SAMPLE_BLOCK_WIDTH  4
#define HG_SAMPLE_BLOCK_HEIGHT 2

#define HG_SAMPLE_BLOCK_DEPTH_BITS 0x0d800000u // HG_UNLIT_TILES_DEPTH, where there are enough

#ifndef __STDC__
layout(buffer_reference, scalar, buffer_reference_align = 4) readonly buffer hg_sample_counts {
    uint v[]; // [rows][columns of blocks] samples that are enough
};
#endif

struct hg_gpu_sample_blocks {
    HG_PTR(hg_sample_counts) counts;
    HG_UINT columns; // of blocks
    HG_UINT number;  // index of the one that is drawn
};
HG_SHARED_SIZE(hg_gpu_sample_blocks, 16);

#define HG_SAMPLE_BLOCK_COLUMNS(width_px)                                                          \
    (((width_px) + HG_SAMPLE_BLOCK_WIDTH - 1u) / HG_SAMPLE_BLOCK_WIDTH)
#define HG_SAMPLE_BLOCK_ROWS(height_px)                                                            \
    (((height_px) + HG_SAMPLE_BLOCK_HEIGHT - 1u) / HG_SAMPLE_BLOCK_HEIGHT)
#ifndef __STDC__
#define HG_SAMPLE_BLOCK_OF(pixel)                                                                  \
    (uvec2(pixel) / uvec2(HG_SAMPLE_BLOCK_WIDTH, HG_SAMPLE_BLOCK_HEIGHT))
#endif

#endif
