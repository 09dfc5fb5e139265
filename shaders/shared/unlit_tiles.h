// unlit_tiles.h - which parts of a picture no punctual light reaches, found before they are shaded.
// Floor 0, shared by C and GLSL. Used by renderer/passes/unlit_tiles.c.
#ifndef HG_SHADERS_SHARED_UNLIT_TILES_H
#define HG_SHADERS_SHARED_UNLIT_TILES_H

#include "shared/types.h"

#define HG_UNLIT_TILES_CELL_PX     8 // side of a cell
#define HG_UNLIT_TILES_TEXELS      8  // of the atlas, side of a square of level 0 of the pyramid
#define HG_UNLIT_TILES_LEVELS      5  // each of half the side; a square of the last is no larger than a map
#define HG_UNLIT_TILES_GROUP       64 // invocations
#define HG_UNLIT_TILES_MOST_LIGHTS 64 // more are not looked at one by one

#define HG_UNLIT_TILES_DEPTH       0x1p-100f // reversed: behind every surface, in front of the background

// What is drawn over the unlit tiles, and how many there are.
struct hg_gpu_unlit_head {
    HG_UINT vertex_count, instance_count, first_vertex, first_instance; // of vkCmdDrawIndirect
    HG_UINT unlit;                                                      // cells
};

#ifndef __STDC__
layout(buffer_reference, scalar) buffer hg_unlit_tiles_head_ref
{
    hg_gpu_unlit_head v;
};
layout(buffer_reference, scalar) buffer hg_unlit_tiles_word_ref
{
    uint v[];
};
layout(buffer_reference, scalar) buffer hg_unlit_tiles_level_ref
{
    float v[];
};
layout(buffer_reference, scalar) buffer hg_unlit_tiles_run_ref
{
    uvec2 v[];
};
#endif

struct hg_gpu_unlit {
    HG_PTR(hg_unlit_tiles_head_ref) head;
    HG_PTR(hg_unlit_tiles_word_ref) cells;    // [columns * rows] 1: unlit for sure
    HG_PTR(hg_unlit_tiles_run_ref) runs;      // (first | end << 16, row) in cells
    HG_PTR(hg_unlit_tiles_level_ref) levels;  // farthest depth (the least) in squares of the shadow atlas
    HG_UINT width, height;             // px
    HG_UINT columns, rows;             // cells
    HG_UINT atlas_px;                  // side of the shadow atlas
    HG_UINT level, first_x, first_y, side; // of the pyramid: the squares that are written
};

#endif
