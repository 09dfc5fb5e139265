// Radiance of the surface that the visibility buffer holds at each pixel, or of the background.
// For devices on which uniform words are dear (lib/flat.glsl).
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#extension GL_EXT_buffer_reference2 : require

#define HG_FRAME_FLAT
#define HG_NO_LOBES
#include "lib/shade.glsl"
