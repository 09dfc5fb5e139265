// Positions only. gl_InstanceIndex is the draw.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#extension GL_EXT_buffer_reference2 : require

#include "lib/frame.glsl"
#include "lib/vertex.glsl"

layout(location = 0) flat out uint out_draw;

void main()
{
    out_draw = gl_InstanceIndex;
    gl_Position = hg_fetch_position(gl_InstanceIndex, gl_VertexIndex);
    gl_PointSize = 1.0;
}
