// sample_blocks.h - how many samples the pixels of a settled picture get, by blocks of them.
// Floor 0, shared by C and GLSL.
#ifndef HG_SHADERS_SHARED_SAMPLE_BLOCKS_H
#define HG_SHADERS_SHARED_SAMPLE_BLOCKS_H

#include "shared/types.h"

#define HG_SAMPLE_BLOCK_PX 4 // side of a block: what CPU devices shade or leave out together

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
    (((width_px) + HG_SAMPLE_BLOCK_PX - 1u) / HG_SAMPLE_BLOCK_PX)

#endif
