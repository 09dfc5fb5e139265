// Surface points at given pixels of given triangles: the tests of the geometry room.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#extension GL_EXT_buffer_reference2 : require

layout(constant_id = 0) const uint hg_variant = 0u; // 1: from facets

#include "lib/frame.glsl"
#include "lib/vertex.glsl"
#include "lib/triangle_cache.glsl"

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
    hg_vertex v;
    if (hg_variant == 1u)
        v = hg_fetch_facet(q.draw, q.triangle, q.pixel);
    else
        v = hg_fetch_triangle(q.draw, q.triangle, q.pixel);
    answers.v[i] = answer(v.position_ws, v.normal_ws, v.geometric_ws, v.tangent_ws, v.color, v.uv0,
        v.uv0_dx, v.uv0_dy, v.uv1, v.depth, v.front ? 1.0 : 0.0);
}
