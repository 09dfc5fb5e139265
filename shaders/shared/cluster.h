// cluster.h - runs of clusters that may be seen, and what draws of them read. Floor 0, shared by C
// and GLSL (scalar layout). See renderer/cull/culling.h.
#ifndef HG_SHADERS_SHARED_CLUSTER_H
#define HG_SHADERS_SHARED_CLUSTER_H

#include "shared/geometry.h"
#include "shared/types.h"

#define HG_CLUSTER_NONE  0xffffffffu
#define HG_CLUSTER_GROUP 64 // candidates per workgroup

// A run of triangles whose occlusion is tested.
struct hg_gpu_candidate {
    HG_UINT draw;
    HG_UINT command;        // whose instance count becomes 1 or 0; HG_CLUSTER_NONE: drawn already
    HG_VEC3 center, extent; // box, object space; extent < 0: not known, never hidden
};
HG_SHARED_SIZE(hg_gpu_candidate, 32);

struct hg_gpu_draw_command { // VkDrawIndexedIndirectCommand
    HG_UINT index_count, instance_count, first_index;
    HG_INT vertex_offset;
    HG_UINT first_instance;
};
HG_SHARED_SIZE(hg_gpu_draw_command, 20);

#ifndef __STDC__
layout(buffer_reference, scalar, buffer_reference_align = 4) readonly buffer hg_candidate_list {
    hg_gpu_candidate v[];
};
layout(buffer_reference, scalar, buffer_reference_align = 4) buffer hg_word_buffer {
    uint v[];
};
layout(buffer_reference, scalar, buffer_reference_align = 4) buffer hg_depth_buffer {
    float v[];
};
layout(buffer_reference, scalar, buffer_reference_align = 4) readonly buffer hg_id_list {
    uvec2 v[];
};
layout(buffer_reference, scalar, buffer_reference_align = 4) buffer hg_command_list {
    hg_gpu_draw_command v[];
};
#endif

// Push constants of the occlusion passes.
struct hg_gpu_occlusion {
    HG_PTR(hg_candidate_list) candidates;
    HG_PTR(hg_word_buffer) visible;   // [candidate_count] out
    HG_PTR(hg_command_list) commands; // out: instance counts
    HG_PTR(hg_depth_buffer) depth;    // [height][width] of the first phase
    HG_PTR(hg_depth_buffer) blocks;   // farthest depth of 8 x 8 pixels, then of 4 x 4 of those
    HG_UINT candidate_count, width, height, reserved;
};
HG_SHARED_SIZE(hg_gpu_occlusion, 56);

#define HG_OCCLUSION_BLOCK 8 // pixels
#define HG_OCCLUSION_WIDE  4 // blocks per block of the second level
#define HG_OCCLUSION_REACH 8 // blocks read by one test, per side

// Push constants of draws. Streams are those of the part or chunk that is drawn.
struct hg_gpu_item {
    HG_PTR(hg_position_stream) positions;
    HG_PTR(hg_vertex_stream) vertices;
    HG_PTR(hg_word_stream) extra;
    HG_PTR(hg_word_stream) primitives; // [primitives] what the visibility buffer holds of each
    HG_PTR(hg_depth_buffer) depth;     // second phase: depth of the first, [height][width]
    HG_PTR(hg_id_list) seen;           // and its visibility buffer
    HG_UINT width, reserved;
};
HG_SHARED_SIZE(hg_gpu_item, 56);

#endif
