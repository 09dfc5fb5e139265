// geometry.h - draws, instances and vertices as shaders read them. Floor 0, shared by C and GLSL
// (scalar layout).
//
// A draw is one part of one instance. Raster passes draw with firstInstance = index of the first
// draw of a range: gl_InstanceIndex is the draw. Positions have a stream of their own (depth-only
// passes read nothing else); what shading needs always is one 16-byte vertex; the second uv set and
// colours are in a third stream that most parts do not have. Skinned and morphed instances have
// parts of their own, whose streams are written by passes/skin.comp.
//
// "World space" here is world space less the origin of the geometry room (geometry.h).
#ifndef HG_SHADERS_SHARED_GEOMETRY_H
#define HG_SHADERS_SHARED_GEOMETRY_H

#include "shared/material.h"
#include "shared/types.h"

// hg_gpu_draw.flags
#define HG_DRAW_MASK         0x0001u
#define HG_DRAW_BLEND        0x0002u // or transmissive; neither: opaque
#define HG_DRAW_DOUBLE_SIDED 0x0004u
#define HG_DRAW_MIRRORED     0x0008u // negative determinant: winding is reversed
#define HG_DRAW_LINES        0x0010u
#define HG_DRAW_POINTS       0x0020u // neither: triangles
#define HG_DRAW_NORMALS      0x0040u // the part has normals
#define HG_DRAW_TANGENTS     0x0080u // the part has tangents
#define HG_DRAW_UV1          0x0100u // extra stream holds a second uv set
#define HG_DRAW_COLOR8       0x0200u // extra stream holds RGBA8 colours
#define HG_DRAW_COLOR16      0x0400u // extra stream holds RGBA16 colours
#define HG_DRAW_LOD          0x0800u // `indices` of the part is a list of parts, its chunks
#define HG_DRAW_HIDDEN       0x2000u // of a view's own table: it does not show it
#define HG_DRAW_DISCS        0x1000u // triangles are the discs of points; unlit without normals

// `extra` of such a part: the level of each chunk.
// Primitives of such draws: chunk << HG_LOD_SHIFT | primitive of the chunk.
#define HG_LOD_SHIFT 14

struct hg_gpu_draw {
    HG_UINT part, instance, material;
    HG_UINT flags; // HG_DRAW_*
};
HG_SHARED_SIZE(hg_gpu_draw, 16);

struct hg_gpu_instance {
    HG_MAT4X3 world;    // object to world
    HG_MAT4X3 previous; // of the pose before
    HG_UINT node;       // index for picking (hg_geometry_node)
    HG_UINT reserved[3];
};
HG_SHARED_SIZE(hg_gpu_instance, 112);

// Normal and tangent are octahedral; see hg_octahedral_decode in lib/vertex.glsl.
struct hg_gpu_vertex {
    HG_UINT normal;  // 2 x snorm16
    HG_UINT tangent; // snorm16 x, then 15-bit y in bits 16..30 and the sign of w in bit 31
    HG_VEC2 uv;
};
HG_SHARED_SIZE(hg_gpu_vertex, 16);

#ifndef __STDC__
layout(buffer_reference, scalar, buffer_reference_align = 4) readonly buffer hg_position_stream {
    vec3 v[];
};
layout(buffer_reference, scalar, buffer_reference_align = 4) readonly buffer hg_vertex_stream {
    hg_gpu_vertex v[];
};
layout(buffer_reference, scalar, buffer_reference_align = 4) readonly buffer hg_word_stream {
    uint v[];
};
#endif

struct hg_gpu_part {
    HG_PTR(hg_word_stream) indices;       // [primitives * 3, 2 or 1]
    HG_PTR(hg_position_stream) positions; // [vertices]
    HG_PTR(hg_vertex_stream) vertices;    // [vertices]
    HG_PTR(hg_word_stream) extra;         // [vertices][uv1 2 words][colour 1 or 2 words] as flagged
};
HG_SHARED_SIZE(hg_gpu_part, 32);

#ifndef __STDC__
layout(buffer_reference, scalar, buffer_reference_align = 4) readonly buffer hg_draw_list {
    hg_gpu_draw v[];
};
layout(buffer_reference, scalar, buffer_reference_align = 4) readonly buffer hg_instance_list {
    hg_gpu_instance v[];
};
layout(buffer_reference, scalar, buffer_reference_align = 8) readonly buffer hg_part_list {
    hg_gpu_part v[];
};
#endif

// Where instances and deformed parts are at another time (renderer/geometry/pose_snapshot.h).
#ifndef __STDC__
layout(buffer_reference, scalar, buffer_reference_align = 4) readonly buffer hg_world_list {
    mat4x3 v[];
};
#endif
struct hg_gpu_pose_snapshot {
    HG_PTR(hg_world_list) worlds; // [instances]
    HG_PTR(hg_part_list) parts;   // [parts]; positions and vertices of deformed ones
};
HG_SHARED_SIZE(hg_gpu_pose_snapshot, 16);

// Part of hg_gpu_frame.
struct hg_gpu_geometry {
    HG_PTR(hg_draw_list) draws;
    HG_PTR(hg_instance_list) instances;
    HG_PTR(hg_part_list) parts;
    HG_PTR(hg_material_list) materials;
    HG_PTR(hg_lobes_list) lobes; // 0 where no material has any
    HG_UINT draw_count, instance_count, part_count, material_count;
};
HG_SHARED_SIZE(hg_gpu_geometry, 56);

// One skinned or morphed part of one node, input of passes/skin.comp.
#define HG_DEFORM_NORMALS   0x1u
#define HG_DEFORM_TANGENTS  0x2u
#define HG_DEFORM_MIRRORED  0x4u // the draw is HG_DRAW_MIRRORED, which turns normals around once more
#define HG_DEFORM_GROUP     64 // vertices per workgroup

#ifndef __STDC__
layout(buffer_reference, scalar, buffer_reference_align = 4) readonly buffer hg_float_stream {
    float v[];
};
layout(buffer_reference, scalar, buffer_reference_align = 4) readonly buffer hg_joint_matrices {
    mat4x3 v[];
};
layout(buffer_reference, scalar, buffer_reference_align = 4) writeonly buffer hg_position_out {
    vec3 v[];
};
layout(buffer_reference, scalar, buffer_reference_align = 4) writeonly buffer hg_vertex_out {
    hg_gpu_vertex v[];
};
#endif

// A morph target whose weight is not zero. Offsets in floats from hg_gpu_deform.targets, of
// [vertices] xyz; HG_DEFORM_ABSENT: none.
#define HG_DEFORM_ABSENT 0xffffffffu
struct hg_gpu_morph {
    float weight;
    HG_UINT positions, normals, tangents;
};
HG_SHARED_SIZE(hg_gpu_morph, 16);

#ifndef __STDC__
layout(buffer_reference, scalar, buffer_reference_align = 4) readonly buffer hg_morph_list {
    hg_gpu_morph v[];
};
#endif

struct hg_gpu_deform {
    HG_PTR(hg_position_stream) positions; // rest pose
    HG_PTR(hg_vertex_stream) vertices;
    HG_PTR(hg_word_stream) joints;        // [vertices][joint_sets * 2] words of 2 x u16
    HG_PTR(hg_float_stream) weights;      // [vertices][joint_sets * 4]
    HG_PTR(hg_joint_matrices) matrices;   // [joints]
    HG_PTR(hg_float_stream) targets;      // deltas of all morph targets
    HG_PTR(hg_morph_list) morphs;         // [morph_count]
    HG_PTR(hg_position_out) out_positions;
    HG_PTR(hg_vertex_out) out_vertices;
    HG_UINT vertex_count, joint_sets, morph_count, flags;
};
HG_SHARED_SIZE(hg_gpu_deform, 88);

#endif
