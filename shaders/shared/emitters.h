// emitters.h - the tables that light sampling reads. Floor 0, shared by C and GLSL (scalar layout).
//
// Emitters are in three tables: directional lights, the environment, and a light tree over
// everything that has a place (point and spot lights, emissive triangles). Filled by
// renderer/light/emitters/emitters.h, read by lib/emitters.glsl.
#ifndef HG_SHADERS_SHARED_EMITTERS_H
#define HG_SHADERS_SHARED_EMITTERS_H

#include "shared/light.h"
#include "shared/types.h"

#define HG_EMITTER_MAX_DEPTH 31          // steps from the root to a leaf
#define HG_EMITTER_NONE      0xffffffffu // a leaf that the tree does not hold
#define HG_EMITTER_IS_LEAF   0x80000000u // hg_gpu_light_node.child
#define HG_EMITTER_IS_LIGHT  0x80000000u // hg_gpu_emitter_leaf.count
#define HG_EMITTER_SUNS      16u         // most directional lights that are weighed one by one

// hg_emitter_sample.group: what the light came from.
#define HG_EMITTER_GROUP_ENVIRONMENT 0u
#define HG_EMITTER_GROUP_PUNCTUAL    1u
#define HG_EMITTER_GROUP_EMISSIVE    2u
#define HG_EMITTER_GROUPS            3u

// Kinds of emitters in the scene; code for absent kinds is left out by specialisation.
// Bits that leave room for others in a specialisation constant.
#define HG_EMITTER_KIND_TREE  0x010000u // lights in the tree
#define HG_EMITTER_KIND_SUN   0x020000u // directional lights
#define HG_EMITTER_KIND_SUNS  0x040000u // more than one of them
#define HG_EMITTER_KIND_IMAGE 0x080000u // an environment with an image
#define HG_EMITTER_KIND_PLAIN 0x100000u // an environment without one
#define HG_EMITTER_KIND_SIZED 0x4000000u // lights with a size
#define HG_EMITTER_KIND_ALL   0x41f0000u

// Bounds of the light that leaves a set of emitters: it starts in the box, within theta_e of normals
// that lie within theta_o of the axis, and ends at the range.
// Source: Conty Estevez and Kulla 2018, "Importance Sampling of Many Lights with Adaptive Tree
// Splitting", section 4.
struct hg_gpu_light_node {
    HG_VEC3 min, max;
    float power;        // sum over the emitters of their greatest radiant intensity (luminance)
    float inv_range_sq; // 1 / range^2 of the farthest reaching one, 0 = infinite
    HG_UINT axis;       // octahedral, 2 x snorm16
    // cos theta_o as 16 bits of (cos + 1) / 2, cos theta_e as 15, bit 31: emits equally to both
    // sides
    HG_UINT angles;
    HG_UINT child; // HG_EMITTER_IS_LEAF | leaf, or the first of two neighbours
};
HG_SHARED_SIZE(hg_gpu_light_node, 44);

// A punctual light, or a run of triangles of one draw.
struct hg_gpu_emitter_leaf {
    HG_UINT draw;         // lights: index in `lights`
    HG_UINT primitive;    // first triangle, as in hits
    HG_UINT first_weight; // of several triangles: their place in `weights`
    HG_UINT count;        // triangles, or HG_EMITTER_IS_LIGHT
};
HG_SHARED_SIZE(hg_gpu_emitter_leaf, 16);

// Consecutive emissive triangles of one draw; (1 << shift) of them per leaf.
struct hg_gpu_emitter_piece {
    HG_UINT first_primitive, count, first_leaf, shift;
};
HG_SHARED_SIZE(hg_gpu_emitter_piece, 16);

#ifndef __STDC__
layout(buffer_reference, scalar, buffer_reference_align = 4) readonly buffer hg_light_node_list {
    hg_gpu_light_node v[];
};
layout(buffer_reference, scalar, buffer_reference_align = 4) readonly buffer hg_emitter_leaf_list {
    hg_gpu_emitter_leaf v[];
};
layout(buffer_reference, scalar, buffer_reference_align = 4) readonly buffer hg_emitter_piece_list {
    hg_gpu_emitter_piece v[];
};
layout(buffer_reference, scalar, buffer_reference_align = 4) readonly buffer hg_emitter_words {
    uint v[];
};
layout(buffer_reference, scalar, buffer_reference_align = 4) readonly buffer hg_emitter_floats {
    float v[];
};
layout(buffer_reference, scalar, buffer_reference_align = 16) readonly buffer hg_emitter_quads {
    vec4 v[];
};
layout(buffer_reference, scalar, buffer_reference_align = 4) readonly buffer hg_emitter_cells { // their words
    float v[];
};
#endif

// Embedded by value in the uniform block of passes that sample lights.
struct hg_gpu_emitters {
    HG_PTR(hg_light_node_list) nodes;       // [node_count], root first
    HG_PTR(hg_emitter_leaf_list) leaves;    // [leaf_count]
    HG_PTR(hg_emitter_words) trails;        // [leaf_count] way from the root, one bit per step from
                                            // bit 0 (1: second child); HG_EMITTER_NONE
    HG_PTR(hg_emitter_words) weights;       // two 16-bit sums per word: of the triangles of a leaf
                                            // up to and with this one, of 65535
    HG_PTR(hg_emitter_piece_list) pieces;   // by draw, then primitive
    HG_PTR(hg_emitter_words) draw_pieces;   // [draw_count + 1] first piece of each draw
    HG_PTR(hg_lights_ref) lights;           // directional ones first
    HG_PTR(hg_lights_ref) lights_before;    // the same when the shutter opens; `lights` if it does not
    HG_PTR(hg_emitter_floats) directional;  // [directional_count] shares of illuminance, summed up
    HG_PTR(hg_emitter_quads) environment;   // see renderer/light/env/env_warp.h
    HG_UINT node_count, leaf_count, draw_count;
    HG_UINT directional_count;
    float directional_lux;                  // luminance of all directional lights
    HG_UINT environment_kind;               // HG_ENV_KIND_*, NONE also when it is black
    HG_UINT environment_levels;             // the finest grid is (2 << levels) x (1 << levels)
    float environment_mean;                 // luminance per unit of hg_gpu_lighting.env_color
    HG_PTR(hg_light_node_list) lamp_nodes;  // [lamp_node_count] tree over the lights with a size and a
                                            // place, that rays may meet; its leaves: their numbers among
                                            // lights with a place
    HG_UINT lamp_node_count, first_lamp_leaf; // leaf of the first light that has a place
    HG_UINT sized_suns;                     // directional lights with a size
    HG_VEC3 sky_sun_ws;                     // towards the sun of a sky, which is the first light, unit
    float sky_sun_cos;                      // of the angle within which the image of the sky has it drawn,
                                            // which lights nothing; 2: there is none
    HG_UINT reserved;
};
HG_SHARED_SIZE(hg_gpu_emitters, 152);

#endif
