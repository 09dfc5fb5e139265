// resolve.glsl - premultiplied radiance to what a picture holds: straight alpha, exposure, tone
// curve, encoding.
#ifndef HG_LIB_RESOLVE_GLSL
#define HG_LIB_RESOLVE_GLSL

#include "lib/tonemap.glsl"

#define HG_RESOLVE_LINEAR 0xffu // no curve, no encoding

// curve: HG_TONEMAP_OP_* or HG_RESOLVE_LINEAR; a constant, as software rasterisers run both sides
// of a branch. backdrop: linear display colour in place of what is transparent, where its alpha is 1.
vec4 hg_resolve(vec4 mean, float exposure, uint curve, vec4 backdrop)
{
    float alpha = clamp(mean.a, 0.0, 1.0);
    if (alpha > 0.9999)
        alpha = 1.0;
    vec3 radiance = alpha > 0.0 ? mean.rgb / alpha : vec3(0.0);
    radiance *= exposure;
    vec3 shown = curve == HG_RESOLVE_LINEAR ? radiance : hg_tonemap(radiance, curve);
    if (backdrop.a > 0.0) {
        shown = mix(backdrop.rgb, shown, alpha);
        alpha = 1.0;
    }
    return vec4(curve == HG_RESOLVE_LINEAR ? shown : hg_srgb_encode(shown), alpha);
}

#endif
