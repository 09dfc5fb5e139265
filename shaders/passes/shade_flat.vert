// One triangle over the whole target that brings words of the frame along.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#extension GL_EXT_buffer_reference2 : require

#define HG_FLAT_SENDS

#include "lib/frame.glsl"
#include "lib/tables.glsl"
#include "lib/flat.glsl"

void main()
{
    hg_flat_send();
    vec2 corner = vec2(gl_VertexIndex & 1, gl_VertexIndex >> 1) * 4.0 - 1.0;
    gl_Position = vec4(corner, 0.0, 1.0);
}
