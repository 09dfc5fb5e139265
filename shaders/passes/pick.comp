// Surface points of a rectangle of a visibility buffer, for picking.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#extension GL_EXT_buffer_reference2 : require

#include "lib/frame.glsl"
#include "lib/vertex.glsl"
#include "shared/pass_io.h"
#include "shared/pick.h"

layout(local_size_x = 8, local_size_y = 8) in;

HG_PICK_IO(HG_IO_DECLARE)

layout(buffer_reference, scalar) writeonly buffer hg_pick_ref
{
    hg_gpu_pick v[];
};
layout(push_constant, scalar) uniform hg_push
{
    hg_pick_ref target; // [height][width], zeros
    uint x, y, width, height;
} push;

void main()
{
    uvec2 here = gl_GlobalInvocationID.xy;
    if (here.x >= push.width || here.y >= push.height)
        return;
    uvec2 pixel = here + uvec2(push.x, push.y);
    uint at = here.y * push.width + here.x;
    uvec2 id = texelFetch(hg_visibility, ivec2(pixel), 0).xy;
    if (id.x == 0u)
        return;
    hg_vertex v = hg_fetch_triangle(id.x - 1u, id.y, vec2(pixel) + 0.5);
    push.target.v[at].draw_plus_one = id.x;
    push.target.v[at].triangle = id.y;
    push.target.v[at].position_ws = v.position_ws;
    push.target.v[at].distance = hg_frame.camera.orthographic != 0u
        ? v.depth
        : length(v.position_ws - hg_frame.camera.eye_ws);
    push.target.v[at].depth = v.depth;
    push.target.v[at].normal_ws = v.front ? v.normal_ws : -v.normal_ws;
    push.target.v[at].uv = v.uv0;
}
