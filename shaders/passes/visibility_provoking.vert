// visibility.vert for numbered triangles: their positions are vertices of a buffer, so that nothing
// changes from draw to draw that the driver would have to look at.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#extension GL_EXT_buffer_reference2 : require

#include "lib/frame.glsl"
#include "lib/vertex.glsl"

layout(location = 0) in vec3 in_position;
layout(location = 0) flat out uvec2 out_draw; // and vertex

void main()
{
    out_draw = uvec2(gl_InstanceIndex, gl_VertexIndex);
    mat4x3 world = hg_world_at(hg_draw_at(gl_InstanceIndex).instance);
    gl_Position = hg_clip_position(hg_relative_position(world, in_position));
    gl_PointSize = 1.0;
}
