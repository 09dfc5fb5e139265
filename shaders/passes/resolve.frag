// Sum of samples to a pixel. Premultiplied radiance in, straight alpha out.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#extension GL_EXT_buffer_reference2 : require

#include "shared/pass_io.h"
#include "shared/sample_blocks.h"
#include "shared/texture.h"
#include "lib/resolve.glsl"

layout(constant_id = 0) const uint hg_curve = 0u; // of hg_resolve
// Pixels have different numbers of samples. 1: each its own; 2: at most that of its block.
layout(constant_id = 1) const uint hg_counted = 0u;

HG_RESOLVE_IO(HG_IO_DECLARE)
layout(push_constant, scalar) uniform hg_push
{
    hg_pixel_progress progress;
    hg_sample_counts blocks;
    float scale; // 1 / samples
    float exposure;
    uint width;   // px
    uint columns; // of blocks
    uint samples;
    vec4 backdrop; // of hg_resolve
} push;

layout(location = 0) out vec4 out_color;

void main()
{
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    float scale = push.scale;
    vec4 sum = texelFetch(hg_accumulated, pixel, 0);
    if (hg_counted != 0u) {
        uint samples = push.samples;
        if ((hg_counted & 1u) != 0u)
            samples = push.progress.v[uint(pixel.y) * push.width + uint(pixel.x)] &
                HG_PROGRESS_SAMPLES_MASK;
        if ((hg_counted & 2u) != 0u) {
            uvec2 block = HG_SAMPLE_BLOCK_OF(pixel);
            samples = min(samples, push.blocks.v[block.y * push.columns + block.x]);
        }
        scale = 1.0 / float(max(samples, 1u));
        if ((hg_counted & 1u) != 0u && samples == 0u)
            sum = texelFetch(hg_fallback, pixel, 0);
    }
    out_color = hg_resolve(sum * scale, push.exposure, hg_curve, push.backdrop);
}
