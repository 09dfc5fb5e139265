// environment.glsl - light from far away: background, diffuse and specular image-based lighting.
//
// Include lib/frame.glsl first. Everything is prefiltered by renderer/light/env/environment.c; rotation
// and intensity are applied here. Directions are in world space, unit length.
#ifndef HG_LIB_ENVIRONMENT_GLSL
#define HG_LIB_ENVIRONMENT_GLSL

#include "lib/brdf.glsl"

// Passes that look at a field of probes (lib/probes.glsl) before they ask for ambient light.
#ifdef HG_ENVIRONMENT_PROBES
#include "lib/probes.glsl"
#define HG_AMBIENT_PROBES HG_HAS2(HG_FEATURE2_PROBES)
#else
#define HG_AMBIENT_PROBES false
#endif
#ifndef HG_LIB_PROBES_GLSL
const vec3 hg_probes_irradiance = vec3(0.0), hg_probes_behind = vec3(0.0);
const vec3 hg_probes_surfaces = vec3(0.0);
const float hg_probes_sky = 1.0;
#endif

// true: one level of the prefiltered cube per lookup, chosen by hg_environment_xi, so that
// accumulated samples converge to the blend of two. Half the price.
#ifndef HG_ENVIRONMENT_STOCHASTIC
#define HG_ENVIRONMENT_STOCHASTIC false
#endif

float hg_environment_xi = 0.5; // in [0, 1); set by the pass before it samples

layout(set = 0, binding = HG_BIND_ENV_SPECULAR) uniform samplerCube hg_env_specular;
layout(set = 0, binding = HG_BIND_ENV_RADIANCE) uniform sampler2D hg_env_radiance;

// World direction to the image's own frame: the inverse of the rotation about +y.
vec3 hg_environment_rotate(vec3 d)
{
    float c = hg_frame.lighting.env_rotation_cos, s = hg_frame.lighting.env_rotation_sin;
    return vec3(c * d.x - s * d.z, d.y, s * d.x + c * d.z);
}

// Place of a direction of any length in the image:
// u = atan2(z, x) / 2 pi + 0.5, v = 0.5 - asin(y) / pi.
vec2 hg_environment_uv(vec3 dir_ws)
{
    vec3 d = hg_environment_rotate(dir_ws);
    return vec2(atan(d.z, d.x) * (0.5 * HG_INV_PI) + 0.5,
        0.5 - atan(d.y, length(d.xz)) * HG_INV_PI); // asin has 4 digits on some devices
}

// Radiance of an image that has no pages (skies), for the background and for rays that miss.
vec3 hg_environment_radiance(vec3 dir_ws)
{
    if (hg_frame.lighting.env_kind != HG_ENV_KIND_IMAGE)
        return hg_frame.lighting.env_color;
    vec2 uv = hg_environment_uv(dir_ws);
    return textureLod(hg_env_radiance, uv, 0.0).rgb * hg_frame.lighting.env_color;
}

#ifdef HG_LIB_TEXTURE_GLSL
// The same where the image may have pages (include lib/texture.glsl first); lod: of the ray's
// footprint, in texels of the image along v. Towards the poles texels are narrower; the samples of a
// pixel, which are spread over it, average them. One bilinear lookup, whose mip is chosen by
// hg_texture_xi.x. For passes whose features are those of a background (HG_FEATURE_FLOAT and
// HG_FEATURE_SKY_*).
vec3 hg_environment_seen(vec3 dir_ws, float lod)
{
    hg_gpu_texture t = hg_frame.textures.background;
    if (!HG_HAS(HG_FEATURE_SKY_PAGES) ||
        (HG_HAS(HG_FEATURE_SKY_PLAIN) && (t.bits & HG_TEX_PRESENT) == 0u))
        return hg_environment_radiance(normalize(dir_ws));
    float last = float(bitfieldExtract(t.bits, HG_TEX_MIPS_SHIFT, 5)) - 1.0;
    if (HG_HAS(HG_FEATURE_STREAM))
        lod += hg_frame.textures.bias;
    hg_texture_place p;
    p.uv = clamp(hg_environment_uv(dir_ws), 0.0, 1.0);
    p.size = hg_texture_size(t);
    p.mip = 0u;
    if (HG_HAS(HG_FEATURE_SKY_MIPS))
        p.mip = uint(min(floor(clamp(lod, 0.0, last) + hg_texture_xi.x), last));
    p.blend = 0.0;
    p.nearest = false;
    p.note = 0u;
    vec3 at = hg_texture_address(t, p, p.mip);
    return textureLod(hg_pages_float, at, 0.0).rgb * hg_frame.lighting.env_color;
}
#endif

// Irradiance on a plane with this normal, over pi: what a white Lambert surface sends back.
// Octahedral map with a border of one texel, bilinear.
vec3 hg_environment_irradiance(vec3 n)
{
    if (hg_frame.lighting.env_kind != HG_ENV_KIND_IMAGE)
        return hg_frame.lighting.env_color;
    const uint pitch = HG_IRRADIANCE_SIZE + 2;
    vec2 p = hg_octahedral_encode(hg_environment_rotate(n)) * 0.5 + 0.5;
    p = p * float(HG_IRRADIANCE_SIZE) + 0.5;
    uvec2 i = uvec2(clamp(p, vec2(0.0), vec2(float(HG_IRRADIANCE_SIZE))));
    vec2 f = p - vec2(i);
    uint k = i.y * pitch + i.x;
    vec3 low = mix(hg_irradiance_at(k),
        hg_irradiance_at(k + 1u), f.x);
    vec3 high = mix(hg_irradiance_at(k + pitch),
        hg_irradiance_at(k + pitch + 1u), f.x);
    return mix(low, high, f.y) * hg_frame.lighting.env_color;
}

// Level of the prefiltered cube that holds this perceptual roughness. Steps of alpha are about
// equal in ratio, so that blends between levels stay close to the lobe in between.
float hg_environment_lod(float roughness)
{
    return hg_frame.lighting.env_specular_lods * roughness * (1.7 - 0.7 * roughness);
}

// Mean radiance under the GGX lobe about a mirror direction (n = v = r).
// Karis 2013, "Real Shading in Unreal Engine 4", eq. 9.
vec3 hg_environment_prefiltered(vec3 r, float roughness)
{
    if (hg_frame.lighting.env_kind != HG_ENV_KIND_IMAGE)
        return hg_frame.lighting.env_color;
    vec3 d = hg_environment_rotate(r);
    float lod = hg_environment_lod(roughness);
    if (HG_ENVIRONMENT_STOCHASTIC)
        lod = floor(lod + hg_environment_xi);
    return textureLod(hg_env_specular, d, lod).rgb * hg_frame.lighting.env_color;
}

// What is seen of an environment that is out of focus, in a direction of any length: the level of
// the prefiltered cube for a roughness of about 0.5. Skies have no sun in it.
#define HG_ENVIRONMENT_BLUR_LOD 4.0
vec3 hg_environment_blurred(vec3 dir_ws)
{
    if (hg_frame.lighting.env_kind != HG_ENV_KIND_IMAGE)
        return hg_frame.lighting.env_color;
    return textureLod(hg_env_specular, hg_environment_rotate(dir_ws), HG_ENVIRONMENT_BLUR_LOD).rgb *
        hg_frame.lighting.env_color;
}

// Share of the specular lobe that ambient occlusion leaves, from the share of the cosine lobe.
// Lagarde and de Rousiers 2014, "Moving Frostbite to PBR", listing 26.
float hg_specular_occlusion(float n_dot_v, float occlusion, float alpha)
{
    return clamp(pow(n_dot_v + occlusion, exp2(-16.0 * alpha - 1.0)) - 1.0 + occlusion, 0.0, 1.0);
}

// The same where a field of probes says how much of the environment is seen.
vec3 hg_environment_reflected(vec3 r, float roughness)
{
    if (!HG_AMBIENT_PROBES)
        return hg_environment_prefiltered(r, roughness);
    vec3 sky = hg_frame.lighting.env_kind == HG_ENV_KIND_NONE
        ? vec3(0.0)
        : hg_environment_prefiltered(r, roughness);
    return sky * hg_probes_sky + hg_probes_surfaces;
}

// Light reflected to the eye from the whole environment; occlusion 0..1 is the material's.
// Split sum (Karis 2013) with multiple scattering as in Fdez-Aguera 2019, "A Multiple-Scattering
// Microfacet Model for Real-Time Image Based Lighting"; in a white furnace what leaves a white
// surface is 1 for every roughness and metallic.
// With HG_FEATURE2_PROBES hg_probes_look was called: then the diffuse light is that of the field,
// which knows what the environment adds where it is seen, and the reflected environment is seen as
// much as the field says, in front of the light of surfaces that the field has in that direction.
vec3 hg_environment_brdf(hg_brdf b, float occlusion)
{
    bool probes = HG_AMBIENT_PROBES;
    if (hg_frame.lighting.env_kind == HG_ENV_KIND_NONE && !probes)
        return vec3(0.0);
    vec3 r = 2.0 * dot(b.n, b.v) * b.n - b.v;
    // Wide lobes lean from the mirror direction towards the normal (Lagarde and de Rousiers 2014,
    // section 4.9.3); by alpha^2, as three.js and Filament do.
    float r2 = b.roughness * b.roughness;
    vec3 r_lobe = normalize(mix(r, b.n, r2 * r2));
    float specular_occlusion = 1.0;
    if (occlusion < 1.0)
        specular_occlusion = hg_specular_occlusion(b.n_dot_v, occlusion, b.alpha);
    vec3 irradiance =
        (probes ? hg_probes_irradiance : hg_environment_irradiance(b.n)) * occlusion;
    vec3 radiance = hg_environment_reflected(r_lobe, b.roughness) * specular_occlusion;
    float miss = 1.0 - b.dfg_v.x - b.dfg_v.y;
    vec3 single = b.f0 * b.dfg_v.x + b.dfg_v.y;
    float e_dielectric = b.f0_dielectric * b.dfg_v.x + b.dfg_v.y + b.f_ms_dielectric * miss;
    return single * radiance + (b.f_ms * miss + b.diffuse * (1.0 - e_dielectric)) * irradiance;
}

#ifdef HG_LIB_BSDF_GLSL
// Direction in which the base reflects: the mirror's, for anisotropic ones about a facet that xi
// chooses among those that are tilted along the rough axis only; the roughness across it is left to
// the prefiltered images.
vec3 hg_environment_mirror(hg_bsdf b, vec2 xi)
{
    vec3 r = 2.0 * dot(b.base.n, b.base.v) * b.base.n - b.base.v;
    if (!HG_HAS(HG_FEATURE_ANISOTROPY) || b.alpha.x <= b.alpha.y)
        return r;
    vec2 alpha = vec2(sqrt(b.alpha.x * b.alpha.x - b.alpha.y * b.alpha.y), 1e-4);
    vec3 h = hg_sample_aniso_vndf(b.v_ts, alpha, xi);
    vec3 l = 2.0 * dot(b.v_ts, h) * h - b.v_ts;
    return normalize(b.t * l.x + b.s * l.y + b.base.n * abs(l.z));
}

// The mean over some facets: pictures in motion have one sample of a pixel, those at rest many.
#define HG_MIRROR_FACETS 8
vec3 hg_environment_mirrored(hg_bsdf b, vec2 xi)
{
    float r2 = b.base.roughness * b.base.roughness;
    bool brushed = HG_HAS(HG_FEATURE_ANISOTROPY) && HG_AMBIENT_PROBES && (hg_frame.flags & HG_FRAME_FINE) == 0u;
    int count = brushed ? HG_MIRROR_FACETS : 1;
    vec3 sum = vec3(0.0);
    for (int i = 0; i < count; i++) {
        vec2 at = fract(xi + float(i) * vec2(1.0 / float(HG_MIRROR_FACETS), 0.618034));
        vec3 r = hg_environment_mirror(b, at);
        sum += hg_environment_reflected(normalize(mix(r, b.base.n, r2 * r2)), b.base.roughness);
    }
    return sum / float(count);
}

// hg_environment_brdf for all lobes but transmission. xi: two random numbers of the sample.
vec3 hg_environment_bsdf(hg_bsdf b, float occlusion, vec2 xi)
{
    bool probes = HG_AMBIENT_PROBES;
    if (hg_frame.lighting.env_kind == HG_ENV_KIND_NONE && !probes)
        return vec3(0.0);
    float shade = 1.0;
    if (occlusion < 1.0)
        shade = hg_specular_occlusion(b.base.n_dot_v, occlusion, b.base.alpha);
    vec3 irradiance =
        (probes ? hg_probes_irradiance : hg_environment_irradiance(b.base.n)) * occlusion;
    vec3 radiance = hg_environment_mirrored(b, xi) * shade;
    vec3 sum = hg_bsdf_single_albedo(b, hg_bsdf_cosine(b, b.v_ts), b.below_v) * radiance;
    sum += (b.base.f_ms * b.several_v + b.base.diffuse * b.enter_v) * irradiance;
    if (HG_HAS(HG_FEATURE_DIFFUSE_TRANSMISSION))
        sum += b.behind * b.enter_v *
            (probes ? hg_probes_behind : hg_environment_irradiance(-b.base.n)) * occlusion;
    if (HG_HAS(HG_FEATURE_TRANSMISSION))
        sum += b.transmission * (b.glass_v * b.glass_front * b.through_v + b.held_v) * irradiance;
    if (HG_HAS(HG_FEATURE_SHEEN))
        sum += b.sheen * (b.sheen_albedo_v.y * b.coat_v) * irradiance;
    if (HG_HAS(HG_FEATURE_CLEARCOAT)) {
        vec3 coat = 2.0 * dot(b.coat_n, b.base.v) * b.coat_n - b.base.v;
        float c2 = b.coat_roughness * b.coat_roughness;
        coat = normalize(mix(coat, b.coat_n, c2 * c2));
        if (occlusion < 1.0)
            shade = hg_specular_occlusion(b.coat_n_dot_v, occlusion, b.coat_alpha);
        sum += hg_environment_reflected(coat, b.coat_roughness) * ((1.0 - b.coat_v) * shade);
    }
    return sum;
}
#endif

#ifdef HG_LIB_MATERIAL_GLSL
// The same for an evaluated material (include lib/material.glsl first).
vec3 hg_environment_light(hg_surface s, vec3 view_ws)
{
    return hg_environment_brdf(hg_surface_brdf(s, view_ws), s.occlusion);
}
#endif

#endif
