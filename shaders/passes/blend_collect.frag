// Appends the fragments of blended surfaces to the lists of their pixels.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#extension GL_EXT_buffer_reference2 : require

#define HG_COLLECT
#define HG_PRIMITIVE gl_PrimitiveID
#include "lib/alpha_mask.glsl"
