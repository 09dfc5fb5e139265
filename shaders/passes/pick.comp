// Surface point of one pixel of a visibility buffer, for picking.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#extension GL_EXT_buffer_reference2 : require

#include "lib/frame.glsl"
#include "lib/vertex.glsl"
#include "shared/pass_io.h"
#include "shared/pick.h"

layout(local_size_x = 1) in;

HG_PICK_IO(HG_IO_DECLARE)

layout(buffer_reference, scalar) writeonly buffer hg_pick_ref
{
    hg_gpu_pick v;
};
layout(push_constant, scalar) uniform hg_push
{
    hg_pick_ref target;
    uint x, y;
} push;

void main()
{
    uvec2 id = texelFetch(hg_visibility, ivec2(push.x, push.y), 0).xy;
    push.target.v.draw_plus_one = id.x;
    if (id.x == 0u)
        return;
    hg_vertex v = hg_fetch_triangle(id.x - 1u, id.y, vec2(push.x, push.y) + 0.5);
    push.target.v.triangle = id.y;
    push.target.v.position_ws = v.position_ws;
    push.target.v.distance = hg_frame.camera.orthographic != 0u
        ? v.depth
        : length(v.position_ws - hg_frame.camera.eye_ws);
    push.target.v.normal_ws = v.front ? v.normal_ws : -v.normal_ws;
    push.target.v.uv = v.uv0;
}
