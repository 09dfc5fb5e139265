// Depth of opaque casters. gl_InstanceIndex is the draw.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#extension GL_EXT_buffer_reference2 : require

#include "lib/frame.glsl"
#include "lib/vertex.glsl"
#include "lib/shadow.glsl"

void main()
{
    gl_Position = hg_shadow_position(gl_InstanceIndex, gl_VertexIndex);
    gl_PointSize = 1.0;
}
