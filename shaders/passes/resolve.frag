// Sum of samples to a pixel. Premultiplied radiance in, straight alpha out.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#extension GL_EXT_buffer_reference2 : require

#include "shared/pass_io.h"
#include "shared/texture.h"
#include "lib/resolve.glsl"

layout(constant_id = 0) const uint hg_curve = 0u; // of hg_resolve
layout(constant_id = 1) const bool hg_counted = false; // pixels have different numbers of samples

HG_RESOLVE_IO(HG_IO_DECLARE)
layout(push_constant, scalar) uniform hg_push
{
    hg_pixel_progress progress;
    float scale; // 1 / samples
    float exposure;
    uint width; // px
    vec4 backdrop; // of hg_resolve
} push;

layout(location = 0) out vec4 out_color;

void main()
{
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    float scale = push.scale;
    vec4 sum = texelFetch(hg_accumulated, pixel, 0);
    if (hg_counted) {
        uint samples = push.progress.v[uint(pixel.y) * push.width + uint(pixel.x)] &
            HG_PROGRESS_SAMPLES_MASK;
        scale = 1.0 / float(max(samples, 1u));
        if (samples == 0u)
            sum = texelFetch(hg_fallback, pixel, 0);
    }
    out_color = hg_resolve(sum * scale, push.exposure, hg_curve, push.backdrop);
}
