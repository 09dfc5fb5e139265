// Surface points at given pixels of given triangles: the tests of the geometry room.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#extension GL_EXT_buffer_reference2 : require

#include "lib/frame.glsl"
#include "lib/vertex.glsl"

layout(local_size_x = 64) in;

struct query {
    uint draw, triangle;
    vec2 pixel;
};
struct answer {
    vec3 position, normal, geometric;
    vec4 tangent, color;
    vec2 uv0, uv0_dx, uv0_dy, uv1;
    float depth, front;
};
layout(buffer_reference, scalar) readonly buffer queries_ref
{
    query v[];
};
layout(buffer_reference, scalar) writeonly buffer answers_ref
{
    answer v[];
};
layout(push_constant, scalar) uniform hg_push
{
    queries_ref queries;
    answers_ref answers;
    uint count;
};

void main()
{
    uint i = gl_GlobalInvocationID.x;
    if (i >= count)
        return;
    query q = queries.v[i];
    hg_vertex v = hg_fetch_triangle(q.draw, q.triangle, q.pixel);
    answers.v[i] = answer(v.position_ws, v.normal_ws, v.geometric_ws, v.tangent_ws, v.color, v.uv0,
        v.uv0_dx, v.uv0_dy, v.uv1, v.depth, v.front ? 1.0 : 0.0);
}
