// shade.glsl - all of shade.frag and shade_flat.frag, which differ in where words of the frame come
// from (lib/flat.glsl).
#ifndef HG_LIB_SHADE_GLSL
#define HG_LIB_SHADE_GLSL

layout(constant_id = 0) const uint hg_variant = 0u; // 0 opaque, 1 opaque behind layers, 2 layer
// 0: radiance, to be accumulated; else a picture at once, with the curve of this number less one.
layout(constant_id = 4) const uint hg_picture = 0u;
layout(constant_id = 3) const bool hg_background = false; // where nothing is; the depth test chooses

#define HG_TEXTURE_STOCHASTIC     true
#define HG_TEXTURE_NOTE           true
#define HG_ENVIRONMENT_STOCHASTIC true

#include "lib/frame.glsl"
#include "lib/tables.glsl"
#ifdef HG_FRAME_FLAT
#include "lib/flat.glsl"
#endif
#include "lib/vertex.glsl"
#include "lib/facet.glsl"
#include "lib/texture.glsl"
#include "lib/material.glsl"
#include "lib/brdf.glsl"
#include "lib/light.glsl"
#include "lib/environment.glsl"
#include "lib/resolve.glsl"

layout(set = 0, binding = HG_BIND_VISIBILITY) uniform usampler2D hg_visibility;
layout(set = 0, binding = HG_BIND_COLOR_A) uniform sampler2D hg_front;

layout(early_fragment_tests) in; // also where samples are counted
layout(location = 0) out vec4 out_color;

vec4 background()
{
    if (hg_frame.background_mode == HG_BACKGROUND_MODE_NONE)
        return vec4(0.0);
    if (hg_frame.background_mode == HG_BACKGROUND_MODE_COLOR)
        return vec4(hg_frame.background_color, 1.0);
    vec3 ray = hg_frame.camera.forward_ws;
    if (hg_frame.camera.orthographic == 0u)
        ray = hg_frame.camera.ray_origin_ws + gl_FragCoord.x * hg_frame.camera.ray_x_ws +
            gl_FragCoord.y * hg_frame.camera.ray_y_ws;
    // Off the middle a pixel is a smaller angle; `ray` is 1 deep.
    float lod = 0.0;
    if (HG_HAS(HG_FEATURE_SKY_MIPS)) {
        hg_texture_xi = hg_random3(uvec2(gl_FragCoord.xy), 1u).xy;
        lod = hg_frame.textures.background_lod - 0.5 * log2(dot(ray, ray));
    }
    return vec4(hg_environment_seen(ray, lod), 1.0);
}

vec4 surface(uvec2 id)
{
    // One bilinear lookup per texture and sample. The first sample, which is what moving pictures
    // show, chooses between mips only; later ones spread along the footprint as well, so that the
    // accumulated image is filtered anisotropically.
    vec3 xi = hg_random3(uvec2(gl_FragCoord.xy), 1u);
    hg_texture_xi = xi.xy;
    hg_environment_xi = xi.z;
    if (hg_frame.sample_index == 0u)
        hg_texture_most_taps = 1.0;
    hg_vertex v = hg_fetch_surface(id.x - 1u, id.y, gl_FragCoord.xy);
    hg_surface s = hg_material_evaluate(v);
    float alpha = hg_variant == 2u ? s.alpha : 1.0;
    if (s.unlit)
        return vec4(s.base_color + s.emissive, 1.0) * alpha;
    vec3 view = -hg_frame.camera.forward_ws;
    if (hg_frame.camera.orthographic == 0u)
        view = normalize(hg_frame.camera.eye_ws - v.position_ws);
    hg_brdf b = hg_brdf_make(s.base_color, s.metallic, s.roughness, s.f0, s.normal, view);
    vec3 radiance = s.emissive + hg_environment_brdf(b, s.occlusion);
    radiance += hg_light_brdf(b, v.position_ws, s.geometric_normal, gl_FragCoord.xy, v.depth);
    return vec4(radiance, 1.0) * alpha;
}

void main()
{
#ifdef HG_FRAME_FLAT
    hg_flat_receive();
#endif
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    hg_texture_counts = hg_progress_waits(pixel);
    vec4 color;
    if (hg_background)
        color = background();
    else
        color = surface(texelFetch(hg_visibility, pixel, 0).xy);
    // One broken or boundless sample must not spoil the mean.
    color = clamp(color, 0.0, 65504.0);
    if (any(isnan(color)))
        color = vec4(0.0, 0.0, 0.0, 1.0);
    if (hg_variant == 1u) {
        vec4 front = texelFetch(hg_front, pixel, 0);
        color = front + (1.0 - front.a) * color;
    }
    if (HG_HAS(HG_FEATURE_STREAM)) {
        if (!hg_background || HG_HAS(HG_FEATURE_SKY_PAGES))
            hg_texture_report(pixel);
        if (hg_variant == 2u)
            hg_progress_spoil(pixel);
        else if (!hg_progress_take(pixel))
            color = vec4(0.0);
    }
    out_color = hg_picture > 0u ? hg_resolve(color, hg_frame.exposure, hg_picture - 1u) : color;
}

#endif
