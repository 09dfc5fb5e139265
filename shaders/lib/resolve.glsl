// resolve.glsl - premultiplied radiance to what a picture holds: straight alpha, exposure, tone
// curve, encoding.
#ifndef HG_LIB_RESOLVE_GLSL
#define HG_LIB_RESOLVE_GLSL

#include "lib/tonemap.glsl"

#define HG_RESOLVE_LINEAR 0xffu // no curve, no encoding

// curve: HG_TONEMAP_OP_* or HG_RESOLVE_LINEAR; a constant, as software rasterisers run both sides
// of a branch.
vec4 hg_resolve(vec4 mean, float exposure, uint curve)
{
    float alpha = clamp(mean.a, 0.0, 1.0);
    if (alpha > 0.9999)
        alpha = 1.0;
    vec3 radiance = alpha > 0.0 ? mean.rgb / alpha : vec3(0.0);
    radiance *= exposure;
    if (curve == HG_RESOLVE_LINEAR)
        return vec4(radiance, alpha);
    return vec4(hg_srgb_encode(hg_tonemap(radiance, curve)), alpha);
}

#endif
