// Radiance of the surface that the visibility buffer holds at each pixel, or of the background.
// For scenes whose materials have lobes besides metallic-roughness (KHR_materials_*).
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#extension GL_EXT_buffer_reference2 : require

#include "lib/shade.glsl"
