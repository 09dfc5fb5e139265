// Farthest depth (reversed: the smallest) of blocks. hg_level 0: of pixels, 1: of blocks.
// Source: Greene, Kass and Miller 1993, "Hierarchical Z-Buffer Visibility".
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#extension GL_EXT_buffer_reference2 : require

layout(constant_id = 3) const uint hg_level = 0u;

#include "lib/frame.glsl"
#include "lib/vertex.glsl"
#include "shared/cluster.h"

layout(push_constant, scalar) uniform hg_push
{
    hg_gpu_occlusion job;
};

layout(local_size_x = 8, local_size_y = 8) in;

void main()
{
    uvec2 pixels = uvec2(job.width, job.height), block = gl_GlobalInvocationID.xy;
    uvec2 fine = (pixels + HG_OCCLUSION_BLOCK - 1u) / HG_OCCLUSION_BLOCK;
    uvec2 wide = (fine + HG_OCCLUSION_WIDE - 1u) / HG_OCCLUSION_WIDE;
    uint step = hg_level == 0u ? uint(HG_OCCLUSION_BLOCK) : uint(HG_OCCLUSION_WIDE);
    uvec2 source = hg_level == 0u ? pixels : fine, target = hg_level == 0u ? fine : wide;
    if (any(greaterThanEqual(block, target)))
        return;
    uvec2 first = block * step, end = min(first + step, source);
    float least = 1.0;
    for (uint y = first.y; y < end.y; y++) {
        for (uint x = first.x; x < end.x; x++) {
            float value;
            if (hg_level == 0u)
                value = job.depth.v[y * source.x + x];
            else
                value = job.blocks.v[y * source.x + x];
            least = min(least, value);
        }
    }
    uint base = hg_level == 0u ? 0u : fine.x * fine.y;
    job.blocks.v[base + block.y * target.x + block.x] = least;
}
