// Facets of one draw (shared/triangle_cache.h), one invocation per triangle.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#extension GL_EXT_buffer_reference2 : require

layout(constant_id = 0) const uint hg_variant = 0u;

#include "lib/frame.glsl"
#include "lib/vertex.glsl"
#include "shared/triangle_cache.h"

layout(local_size_x = HG_TRIANGLE_CACHE_GROUP) in;
layout(push_constant, scalar) uniform hg_push
{
    hg_gpu_facet_push job;
};

uint corner_normal(mat4x3 world, float handed, uint word)
{
    vec3 n = hg_decode_normal(word);
    // The cofactor matrix is the inverse transpose times the determinant.
    n = (cross(world[1], world[2]) * n.x + cross(world[2], world[0]) * n.y +
            cross(world[0], world[1]) * n.z) * handed;
    return dot(n, n) > 0.0 ? hg_encode_normal(n) : word;
}

uint corner_tangent(mat4x3 world, float handed, uint word)
{
    vec4 t = hg_decode_tangent(word);
    return hg_encode_tangent(vec4(mat3(world) * t.xyz, t.w * handed));
}

void main()
{
    uint triangle = gl_GlobalInvocationID.x;
    if (triangle >= job.count)
        return;
    hg_gpu_draw d = hg_draw_at(job.draw);
    hg_gpu_part part = hg_part_at(d.part);
    mat4x3 world = hg_world_at(d.instance);
    uint i0 = part.indices.v[triangle * 3u], i1 = part.indices.v[triangle * 3u + 1u];
    uint i2 = part.indices.v[triangle * 3u + 2u];
    vec3 p0 = part.positions.v[i0];
    vec3 e1 = mat3(world) * (part.positions.v[i1] - p0);
    vec3 e2 = mat3(world) * (part.positions.v[i2] - p0);
    vec3 n = cross(e1, e2);
    float area2 = dot(n, n), inverse = area2 > 0.0 ? 1.0 / area2 : 0.0;
    hg_gpu_vertex a0 = part.vertices.v[i0], a1 = part.vertices.v[i1], a2 = part.vertices.v[i2];
    float handed = (d.flags & HG_DRAW_MIRRORED) != 0u ? -1.0 : 1.0;

    hg_gpu_facet f;
    p0 = world * vec4(p0, 1.0);
    f.x = p0.x;
    f.y = p0.y;
    f.z = p0.z;
    f.g1 = cross(e2, n) * inverse;
    f.g2 = cross(n, e1) * inverse;
    f.uv = a0.uv;
    f.uv1 = a1.uv - a0.uv;
    f.uv2 = a2.uv - a0.uv;
    f.normals[0] = corner_normal(world, handed, a0.normal);
    f.normals[1] = corner_normal(world, handed, a1.normal);
    f.normals[2] = corner_normal(world, handed, a2.normal);
    f.tangents[0] = corner_tangent(world, handed, a0.tangent);
    f.tangents[1] = corner_tangent(world, handed, a1.tangent);
    f.tangents[2] = corner_tangent(world, handed, a2.tangent);
    if ((d.flags & HG_DRAW_TANGENTS) == 0u) {
        float scale = 1.0 / max(max(dot(e1, e1), dot(e2, e2)), 1e-30);
        vec4 t = hg_direction_of_u(e1 * scale, e2 * scale, f.uv1, f.uv2);
        uint word = hg_encode_tangent(t);
        f.tangents[0] = word;
        f.tangents[1] = word;
        f.tangents[2] = word;
    }
    f.reserved = 0u;
    f.unused[0] = 0u;
    f.unused[1] = 0u;
    job.facets.v[job.first + triangle] = f;
}
