// Positions only. gl_InstanceIndex is the draw.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#extension GL_EXT_buffer_reference2 : require

#include "lib/frame.glsl"
#include "lib/vertex.glsl"
#include "shared/cluster.h"

layout(push_constant, scalar) uniform hg_push
{
    hg_gpu_item item;
};

layout(location = 0) flat out uvec2 out_draw; // and vertex

void main()
{
    out_draw = uvec2(gl_InstanceIndex, gl_VertexIndex);
    mat4x3 world = hg_world_at(hg_draw_at(gl_InstanceIndex).instance);
    vec3 p = item.positions.v[gl_VertexIndex];
    gl_Position = hg_clip_position(hg_relative_position(world, p));
    gl_PointSize = 1.0;
}
