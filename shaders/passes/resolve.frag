// Sum of samples to a pixel. Premultiplied radiance in, straight alpha out.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require

#include "shared/bindings.h"
#include "lib/tonemap.glsl"

layout(constant_id = 0) const uint hg_linear = 0u; // 1: no tone curve, no encoding

layout(set = 0, binding = HG_BIND_COLOR_A) uniform sampler2D hg_accumulated;
layout(push_constant, scalar) uniform hg_push
{
    float scale; // 1 / samples
    float exposure;
    uint tonemap;
} push;

layout(location = 0) out vec4 out_color;

void main()
{
    vec4 sum = texelFetch(hg_accumulated, ivec2(gl_FragCoord.xy), 0) * push.scale;
    float alpha = clamp(sum.a, 0.0, 1.0);
    if (alpha > 0.9999)
        alpha = 1.0;
    vec3 radiance = alpha > 0.0 ? sum.rgb / alpha : vec3(0.0);
    radiance *= push.exposure;
    out_color.a = alpha;
    if (hg_linear == 1u)
        out_color.rgb = radiance;
    else
        out_color.rgb = hg_srgb_encode(hg_tonemap(radiance, push.tonemap));
}
