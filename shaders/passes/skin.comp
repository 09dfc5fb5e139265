// Poses one skinned or morphed part: morph targets in object space, then linear blend skinning.
// One invocation per vertex; writes the position and vertex streams that the draws read.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#extension GL_EXT_buffer_reference : require

#include "lib/octahedral.glsl"
#include "shared/geometry.h"

layout(local_size_x = HG_DEFORM_GROUP) in;

layout(buffer_reference, scalar, buffer_reference_align = 8) readonly buffer hg_deform_ref
{
    hg_gpu_deform v;
};
layout(push_constant, scalar) uniform hg_push
{
    hg_deform_ref job;
};

vec3 delta(uint offset, uint vertex)
{
    uint at = offset + vertex * 3u;
    return vec3(job.v.targets.v[at], job.v.targets.v[at + 1u], job.v.targets.v[at + 2u]);
}

// Weighted mean of the joint matrices of a vertex. glTF 2.0 section 3.7.3.3.
mat4x3 joint_matrix(uint vertex)
{
    mat4x3 m = mat4x3(0.0);
    uint count = job.v.joint_sets * 4u;
    for (uint i = 0u; i < count; i++) {
        uint at = vertex * count + i;
        float weight = job.v.weights.v[at];
        uint pair = job.v.joints.v[at >> 1];
        uint joint = (at & 1u) != 0u ? pair >> 16 : pair & 0xffffu;
        if (weight != 0.0)
            m += weight * job.v.matrices.v[joint];
    }
    return m;
}

void main()
{
    uint vertex = gl_GlobalInvocationID.x;
    if (vertex >= job.v.vertex_count)
        return;
    uint flags = job.v.flags;
    vec3 position = job.v.positions.v[vertex];
    hg_gpu_vertex o = job.v.vertices.v[vertex];
    vec3 normal = (flags & HG_DEFORM_NORMALS) != 0u ? hg_decode_normal(o.normal) : vec3(0, 0, 1);
    vec4 tangent = (flags & HG_DEFORM_TANGENTS) != 0u ? hg_decode_tangent(o.tangent) : vec4(1, 0, 0, 1);
    for (uint i = 0u; i < job.v.morph_count; i++) {
        hg_gpu_morph morph = job.v.morphs.v[i];
        if (morph.positions != HG_DEFORM_ABSENT)
            position += morph.weight * delta(morph.positions, vertex);
        if (morph.normals != HG_DEFORM_ABSENT)
            normal += morph.weight * delta(morph.normals, vertex);
        if (morph.tangents != HG_DEFORM_ABSENT)
            tangent.xyz += morph.weight * delta(morph.tangents, vertex);
    }
    if (job.v.joint_sets > 0u) {
        mat4x3 m = joint_matrix(vertex);
        position = m * vec4(position, 1.0);
        // Inverse transpose times the determinant: normals stay outside, and so do bitangents on their side, after
        // the sign of mirrored draws.
        vec3 n = cross(m[1], m[2]) * normal.x + cross(m[2], m[0]) * normal.y +
            cross(m[0], m[1]) * normal.z;
        float sign = (dot(m[0], cross(m[1], m[2])) < 0.0) != ((flags & HG_DEFORM_MIRRORED) != 0u) ? -1.0 : 1.0;
        normal = n * sign;
        tangent = vec4(mat3(m) * tangent.xyz, tangent.w * sign);
    }
    job.v.out_positions.v[vertex] = position;
    if ((flags & HG_DEFORM_NORMALS) != 0u)
        o.normal = hg_encode_normal(normal);
    if ((flags & HG_DEFORM_TANGENTS) != 0u)
        o.tangent = hg_encode_tangent(tangent);
    job.v.out_vertices.v[vertex] = o;
}
