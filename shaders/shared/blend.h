// blend.h - per-pixel lists of blended surfaces. Floor 0, shared by C and GLSL (scalar layout).
//
// A pixel's word in `heads` is the number of its first node, 0 = none. Node 0 is no surface: its
// `next` counts the nodes that were asked for, which may be more than there is room for, and its
// `draw` the fragments in every HG_BLEND_COUNTED-th pixel of each side, with a node or without.
#ifndef HG_SHADERS_SHARED_BLEND_H
#define HG_SHADERS_SHARED_BLEND_H

#include "shared/types.h"

struct hg_gpu_blend_node {
    HG_UINT next;            // node behind it, once the list is sorted; 0 = none
    HG_UINT draw, primitive; // as the visibility buffer holds them
    HG_FLOAT depth;          // reversed, as the depth buffer holds it
};
HG_SHARED_SIZE(hg_gpu_blend_node, 16);

#define HG_BLEND_MAX_LAYERS 256  // that are shaded of one pixel
#define HG_BLEND_MAX_SORTED 1024 // that are sorted: drivers end shaders that loop for too long

#define HG_BLEND_COUNTED 8 // a power of two

// What the sort tells the host of a sample.
struct hg_gpu_blend_report {
    HG_UINT nodes;     // that were asked for; of areas the most of one
    HG_UINT fragments; // that were counted
    HG_UINT too_deep;  // not 0: some pixel has more layers than are sorted or shaded
};
HG_SHARED_SIZE(hg_gpu_blend_report, 12);

#ifndef __STDC__
layout(buffer_reference, scalar, buffer_reference_align = 4) buffer hg_blend_heads
{
    uint v[];
};
layout(buffer_reference, scalar, buffer_reference_align = 16) buffer hg_blend_nodes
{
    hg_gpu_blend_node v[];
};
layout(buffer_reference, scalar, buffer_reference_align = 4) buffer hg_blend_reports
{
    hg_gpu_blend_report v[];
};
#endif

// Part of the frame block.
struct hg_gpu_blend_lists {
    HG_PTR(hg_blend_heads) heads; // [height][width]
    HG_PTR(hg_blend_nodes) nodes; // [capacity]
    HG_UINT capacity;
    HG_UINT reserved;
};
HG_SHARED_SIZE(hg_gpu_blend_lists, 24);

#endif
