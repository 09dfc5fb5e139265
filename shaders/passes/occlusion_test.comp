// Which candidates are not hidden behind what the first phase drew. One invocation per candidate.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#extension GL_EXT_buffer_reference2 : require

#include "lib/frame.glsl"
#include "lib/vertex.glsl"
#include "shared/cluster.h"

layout(push_constant, scalar) uniform hg_push
{
    hg_gpu_occlusion job;
};

layout(local_size_x = HG_CLUSTER_GROUP) in;

// Farthest depth in the pixels [low, high]; 0 when too many would have to be looked at.
float farthest(uvec2 low, uvec2 high)
{
    uvec2 pixels = uvec2(job.width, job.height);
    uvec2 size = (pixels + HG_OCCLUSION_BLOCK - 1u) / HG_OCCLUSION_BLOCK;
    uvec2 first = low / HG_OCCLUSION_BLOCK, last = high / HG_OCCLUSION_BLOCK;
    uint base = 0u;
    if (any(greaterThan(last - first, uvec2(HG_OCCLUSION_REACH)))) {
        base = size.x * size.y;
        size = (size + HG_OCCLUSION_WIDE - 1u) / HG_OCCLUSION_WIDE;
        first /= HG_OCCLUSION_WIDE;
        last /= HG_OCCLUSION_WIDE;
    }
    if (any(greaterThan(last - first, uvec2(HG_OCCLUSION_REACH))))
        return 0.0;
    float least = 1.0;
    for (uint y = first.y; y <= last.y; y++)
        for (uint x = first.x; x <= last.x; x++)
            least = min(least, job.blocks.v[base + y * size.x + x]);
    return least;
}

bool is_visible(hg_gpu_candidate c)
{
    if (c.extent.x < 0.0)
        return true;
    mat4x3 world = hg_world_at(hg_draw_at(c.draw).instance);
    vec2 low = vec2(1e30), high = vec2(-1e30), size = vec2(job.width, job.height);
    float nearest = 0.0;
    for (uint i = 0u; i < 8u; i++) {
        vec3 side = vec3((i & 1u) != 0u ? 1.0 : -1.0, (i & 2u) != 0u ? 1.0 : -1.0,
            (i & 4u) != 0u ? 1.0 : -1.0);
        vec4 p = hg_clip_position(hg_relative_position(world, c.center + side * c.extent));
        if (p.w <= 1e-10 || p.z >= p.w)
            return true; // at the near plane or behind the eye
        vec2 at = (p.xy / p.w + 1.0) * (0.5 * size);
        low = min(low, at);
        high = max(high, at);
        nearest = max(nearest, p.z / p.w);
    }
    low = max(floor(low) - 1.0, vec2(0.0));
    high = min(ceil(high) + 1.0, size - 1.0);
    if (any(greaterThan(low, high)))
        return false;
    return nearest + 1e-4 * nearest >= farthest(uvec2(low), uvec2(high));
}

void main()
{
    uint at = gl_GlobalInvocationID.x;
    if (at >= job.candidate_count)
        return;
    hg_gpu_candidate c = job.candidates.v[at];
    uint visible = is_visible(c) ? 1u : 0u;
    job.visible.v[at] = visible;
    if (c.command != HG_CLUSTER_NONE)
        job.commands.v[c.command].instance_count = visible;
}
