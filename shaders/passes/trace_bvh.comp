// A wave of rays through the two-level tree: nearest hits, or whether there are any.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#extension GL_EXT_buffer_reference : require
#extension GL_EXT_buffer_reference_uvec2 : require

#include "lib/bvh.glsl"

layout(constant_id = 0) const uint any = 0u;
layout(local_size_x = HG_BVH_GROUP) in;
layout(push_constant, scalar) uniform hg_push
{
    hg_gpu_bvh_wave wave;
};

void main()
{
    uint at = gl_GlobalInvocationID.x;
    if (at >= wave.count)
        return;
    if (uvec2(wave.list) != uvec2(0u))
        at = wave.list.v[at];
    hg_gpu_hit hit;
    bool found = hg_bvh_trace(wave, wave.rays.v[at], any != 0u, hit);
    if (any != 0u)
        wave.blocked.v[at] = found ? 1u : 0u;
    else
        wave.hits.v[at] = hit;
}
