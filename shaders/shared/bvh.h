// bvh.h - the two-level tree of the compute backend of renderer/trace/. Floor 0, shared by C and
// GLSL (scalar layout).
//
// Binary nodes of 32 bytes hold the boxes of both children on a grid of 16 bits per axis over the
// whole tree: a box reaches from origin + lo * step to origin + hi * step and is rounded outwards by
// more than the traversal's own rounding. Triangles lie in the order of leaves.
#ifndef HG_SHADERS_SHARED_BVH_H
#define HG_SHADERS_SHARED_BVH_H

#include "shared/ray.h"
#include "shared/types.h"

// A child: the index of a node, or a leaf of 1..8 triangles (of instances: 1).
#define HG_BVH_LEAF        0x80000000u
#define HG_BVH_COUNT_SHIFT 28 // bits 28..30: triangles - 1
#define HG_BVH_FIRST       0x0fffffffu
#define HG_BVH_NONE        0xffffffffu // the root of a tree of nothing
#define HG_BVH_LEAF_MOST   4           // triangles
#define HG_BVH_DEPTH       56          // of one tree; two are walked at once
#define HG_BVH_STEPS       4194304     // of a walk: bounded whatever the tree holds
#define HG_BVH_GROUP       64          // rays per workgroup

struct hg_gpu_bvh_node {
    HG_UINT x0, y0, z0; // of the first child: lo | hi << 16
    HG_UINT x1, y1, z1;
    HG_UINT child0, child1;
};
HG_SHARED_SIZE(hg_gpu_bvh_node, 32);

struct hg_gpu_bvh_triangle {
    HG_VEC3 p0, p1, p2;
    HG_UINT primitive; // as in hits
    HG_UINT owner;     // flat: draw | HG_RAY_* << 28; else HG_RAY_ALL << 28
};
HG_SHARED_SIZE(hg_gpu_bvh_triangle, 44);

struct hg_gpu_bvh_corners { // at the opening of the shutter
    HG_VEC3 p0, p1, p2;
};
HG_SHARED_SIZE(hg_gpu_bvh_corners, 36);

#ifndef __STDC__
layout(buffer_reference, scalar, buffer_reference_align = 4) readonly buffer hg_bvh_nodes {
    hg_gpu_bvh_node v[];
};
layout(buffer_reference, scalar, buffer_reference_align = 4) readonly buffer hg_bvh_triangles {
    hg_gpu_bvh_triangle v[];
};
layout(buffer_reference, scalar, buffer_reference_align = 4) readonly buffer hg_bvh_openings {
    hg_gpu_bvh_corners v[];
};
#endif

#define HG_BVH_MOVES   0x1u // the matrix is another one at the opening of the shutter
#define HG_BVH_DEFORMS 0x2u // the corners are

struct hg_gpu_bvh_instance {
    HG_PTR(hg_bvh_nodes) nodes;
    HG_PTR(hg_bvh_triangles) triangles;
    HG_PTR(hg_bvh_openings) openings; // of HG_BVH_DEFORMS
    HG_MAT4X3 to_object;              // unless it moves; then
    HG_MAT4X3 world, previous;        // object to world at both ends
    HG_VEC3 origin, step;             // of the grid, object space
    HG_UINT root, draw, mask, flags;  // draw: added to that of a triangle's owner
};
HG_SHARED_SIZE(hg_gpu_bvh_instance, 208);

#ifndef __STDC__
layout(buffer_reference, scalar, buffer_reference_align = 4) readonly buffer hg_bvh_instances {
    hg_gpu_bvh_instance v[];
};
layout(buffer_reference, scalar, buffer_reference_align = 4) writeonly buffer hg_blocked_list {
    uint v[];
};
#endif

// Push constants of passes/trace_bvh.comp.
struct hg_gpu_bvh_wave {
    HG_PTR(hg_ray_list) rays;
    HG_PTR(hg_hit_list) hits;
    HG_PTR(hg_blocked_list) blocked;
    HG_PTR(hg_bvh_nodes) nodes; // over instances
    HG_PTR(hg_bvh_instances) instances;
    HG_PTR(hg_ray_slots) list; // which rays; 0: the first `count`
    HG_VEC3 origin, step;
    HG_UINT root, count;
};
HG_SHARED_SIZE(hg_gpu_bvh_wave, 80);

#endif
