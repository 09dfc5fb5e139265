// blend_collect.frag for numbered triangles: drivers take triangles apart for shaders that know of
// gl_PrimitiveID at all.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#extension GL_EXT_buffer_reference2 : require

#define HG_COLLECT
#define HG_PRIMITIVE 0u
#include "lib/alpha_mask.glsl"
