// material.glsl - from a surface point to what the lighting needs.
//
// Include lib/frame.glsl, lib/vertex.glsl and lib/texture.glsl first.
//
// Specular antialiasing: a still view averages jittered samples, which integrates the variation of
// normals between texels exactly. What a mip has averaged away within its texels widens the lobe:
// alpha of a normal map is 1 - sqrt of what its squared width gains (renderer/texture/source/mip_stream.h).
#ifndef HG_LIB_MATERIAL_GLSL
#define HG_LIB_MATERIAL_GLSL

#include "lib/texture.glsl"
#include "lib/vertex.glsl"
#include "shared/material.h"

// A constant, for passes that do not want to know all: 1 without normal maps, 0 the base colour alone.
#ifndef HG_MATERIAL_DETAIL
#define HG_MATERIAL_DETAIL 2u
#endif

// Normal maps are filtered over whole pixels, whatever hg_texture_share is.
#ifndef HG_MATERIAL_COARSE_NORMALS
#define HG_MATERIAL_COARSE_NORMALS false
#endif

struct hg_surface {
    vec3 base_color; // linear
    float alpha;     // 1 unless the material blends; masked texels are 0 or 1
    vec3 normal;     // shading normal, unit, towards the eye's side
    float metallic;
    vec3 geometric_normal; // of the triangle, unit, towards the eye's side
    float roughness;       // perceptual
    vec3 emissive;
    float occlusion; // 0..1, strength applied; for indirect light only
    float f0;        // dielectric reflectance at normal incidence
    bool unlit;      // the colour is base_color + emissive
    bool front;      // seen from the front side: from outside of closed surfaces
    // KHR_materials_*; what a scene has none of (HG_FEATURE_*) is constant.
    float ior, specular;
    vec3 specular_color;
    float clearcoat, clearcoat_roughness; // perceptual
    vec3 clearcoat_normal;                // as `normal`
    vec3 sheen_color;
    float sheen_roughness; // perceptual
    float transmission;
    float thickness;  // metres in the space of the mesh; 0: thin-walled
    vec3 attenuation; // absorption of the volume behind, 1 / m of world space
    float dispersion; // 20 / Abbe number
    float iridescence, iridescence_ior, iridescence_nm; // thickness of the film
    float anisotropy;
    vec3 tangent; // along which the surface is rough, unit, not always orthogonal to the normal
    float diffuse_transmission;
    vec3 diffuse_transmission_color;
};

// Coordinates of a slot whose transform has these rows, for looking up in its texture.
hg_texture_place hg_material_place_by(hg_gpu_texture t, vec3 r0, vec3 r1, hg_vertex v)
{
    bool second = (t.bits & HG_TEX_UV1) != 0u;
    vec2 uv = second ? v.uv1 : v.uv0;
    vec2 dx = second ? v.uv1_dx : v.uv0_dx, dy = second ? v.uv1_dy : v.uv0_dy;
    if ((t.bits & HG_TEX_TRANSFORM) != 0u) {
        uv = vec2(dot(r0, vec3(uv, 1.0)), dot(r1, vec3(uv, 1.0)));
        dx = vec2(dot(r0.xy, dx), dot(r1.xy, dx));
        dy = vec2(dot(r0.xy, dy), dot(r1.xy, dy));
    }
    return hg_texture_find(t, uv, dx, dy);
}

// Coordinates of a slot at a surface point, for looking up in its texture.
hg_texture_place hg_material_place(hg_gpu_texture t, uint material, uint slot, hg_vertex v)
{
    if (!HG_HAS(HG_FEATURE_SAMPLERS))
        return hg_texture_find(t, v.uv0, v.uv0_dx, v.uv0_dy);
    bool second = (t.bits & HG_TEX_UV1) != 0u;
    vec2 uv = second ? v.uv1 : v.uv0;
    vec2 dx = second ? v.uv1_dx : v.uv0_dx, dy = second ? v.uv1_dy : v.uv0_dy;
    if ((t.bits & HG_TEX_TRANSFORM) != 0u) {
        uint at = slot * 6u;
        vec3 r0 = vec3(HG_MATERIAL_AT(material, transforms[at]),
            HG_MATERIAL_AT(material, transforms[at + 1u]),
            HG_MATERIAL_AT(material, transforms[at + 2u]));
        vec3 r1 = vec3(HG_MATERIAL_AT(material, transforms[at + 3u]),
            HG_MATERIAL_AT(material, transforms[at + 4u]),
            HG_MATERIAL_AT(material, transforms[at + 5u]));
        uv = vec2(dot(r0, vec3(uv, 1.0)), dot(r1, vec3(uv, 1.0)));
        dx = vec2(dot(r0.xy, dx), dot(r1.xy, dx));
        dy = vec2(dot(r0.xy, dy), dot(r1.xy, dy));
    }
    return hg_texture_find(t, uv, dx, dy);
}

// A slot's texel, white where it has no texture. colour: the slot holds sRGB files. The pool is
// known from that (float images aside), so that only one is sampled.
vec4 hg_material_sample(uint material, uint slot, bool colour, hg_vertex v)
{
    hg_gpu_texture t = hg_material_texture_at(material, slot);
    if (!HG_HAS(HG_FEATURE_SHAPES)) { // place and address are worked out once for all slots
        hg_gpu_texture shape = hg_material_texture_at(material, HG_MATERIAL_BASE_COLOR);
        t.size = shape.size;
        t.bits = shape.bits;
    }
    hg_texture_place p = hg_material_place(t, material, slot, v);
    p.note = slot;
    vec4 texel = vec4(1.0);
    if (colour)
        texel = hg_texture_fetch_colour(t, p);
    else
        texel = hg_texture_fetch(hg_pages_linear, t, p);
    if (HG_HAS(HG_FEATURE_FLOAT)) {
        if (bitfieldExtract(t.bits, HG_TEX_POOL_SHIFT, 2) == HG_POOL_FLOAT)
            texel = hg_texture_fetch(hg_pages_float, t, p);
    }
    return (HG_MATERIAL_AT(material, flags) & HG_MATERIAL_HAS(slot)) != 0u ? texel : vec4(1.0);
}

// Base colour alone, for alpha tests of depth-only passes. Alpha is linear in both views of the
// pool, and the one that is not sRGB is twice as fast on software rasterisers.
float hg_material_alpha(uint material, hg_vertex v)
{
    float alpha = HG_MATERIAL_AT(material, base_color.w) * v.color.w;
    if (HG_HAS(HG_FEATURE_TEXTURES))
        alpha *= hg_material_sample(material, HG_MATERIAL_BASE_COLOR, false, v).w;
    return alpha;
}

// --- KHR_materials_* -----------------------------------------------------------------------------

#ifndef HG_NO_LOBES // for passes of which there are two: what is compiled costs time even if unused
// Texels of the slots that have textures, white elsewhere. One lookup per round of the loop, so
// that absent slots cost nothing on devices that run both sides of branches.
void hg_lobes_sample(uint index, uint flags, hg_vertex v, inout vec4 texels[HG_LOBES_SLOTS])
{
    uint left = flags & HG_LOBES_TEXTURES;
    while (left != 0u) { // at most once per slot
        uint slot = uint(findLSB(left));
        left &= left - 1u;
        hg_gpu_texture t = hg_frame.geometry.lobes.v[index].slots[slot];
        vec3 r0 = vec3(1.0, 0.0, 0.0), r1 = vec3(0.0, 1.0, 0.0);
        if (HG_HAS(HG_FEATURE_SAMPLERS)) {
            for (uint k = 0u; k < 3u; k++) {
                r0[k] = hg_frame.geometry.lobes.v[index].transforms[slot * 6u + k];
                r1[k] = hg_frame.geometry.lobes.v[index].transforms[slot * 6u + 3u + k];
            }
        }
        hg_texture_place p = hg_material_place_by(t, r0, r1, v);
        p.note = HG_TEXTURE_NO_NOTE;
        vec4 texel = hg_texture_fetch(hg_pages_linear, t, p);
        if (slot < HG_LOBES_SRGB_SLOTS)
            texel = hg_texture_fetch_colour(t, p);
        if (HG_HAS(HG_FEATURE_FLOAT)) {
            if (bitfieldExtract(t.bits, HG_TEX_POOL_SHIFT, 2) == HG_POOL_FLOAT)
                texel = hg_texture_fetch(hg_pages_float, t, p);
        }
        texels[slot] = texel;
    }
}

#endif

// No lobes but the base's.
void hg_lobes_none(inout hg_surface s, vec3 coat_normal, vec3 tangent)
{
    s.ior = 1.5;
    s.specular = 1.0;
    s.specular_color = vec3(1.0);
    s.clearcoat = s.clearcoat_roughness = 0.0;
    s.clearcoat_normal = coat_normal;
    s.sheen_color = vec3(0.0);
    s.sheen_roughness = 0.0;
    s.transmission = s.thickness = s.dispersion = 0.0;
    s.attenuation = vec3(0.0);
    s.iridescence = s.iridescence_nm = 0.0;
    s.iridescence_ior = 1.3;
    s.anisotropy = 0.0;
    s.tangent = tangent;
    s.diffuse_transmission = 0.0;
    s.diffuse_transmission_color = vec3(1.0);
}

#ifndef HG_NO_LOBES
#define HG_LOBE_AT(field) hg_frame.geometry.lobes.v[i].field

// Fills in what hg_gpu_lobes of the material say. side: -1 where the back is seen.
void hg_lobes_evaluate(hg_vertex v, float side, inout hg_surface s)
{
    uint number = HG_MATERIAL_AT(v.material, lobes);
    if (number == 0u)
        return;
    uint i = number - 1u, flags = HG_LOBE_AT(flags);
    vec4 texels[HG_LOBES_SLOTS];
    for (uint k = 0u; k < HG_LOBES_SLOTS; k++)
        texels[k] = vec4(1.0);
    if (HG_HAS(HG_FEATURE_LOBE_TEXTURES))
        hg_lobes_sample(i, flags, v, texels);
    s.ior = HG_LOBE_AT(ior);
    vec3 bitangent = cross(v.normal_ws, v.tangent_ws.xyz) * v.tangent_ws.w;
    if (HG_HAS(HG_FEATURE_SPECULAR)) {
        s.specular = HG_LOBE_AT(specular) * texels[HG_LOBES_SPECULAR].a;
        s.specular_color = HG_LOBE_AT(specular_color) * texels[HG_LOBES_SPECULAR_COLOR].rgb;
    }
    if (HG_HAS(HG_FEATURE_CLEARCOAT)) {
        s.clearcoat = HG_LOBE_AT(clearcoat) * texels[HG_LOBES_CLEARCOAT].r;
        s.clearcoat_roughness =
            HG_LOBE_AT(clearcoat_roughness) * texels[HG_LOBES_CLEARCOAT_ROUGHNESS].g;
        if ((flags & HG_LOBES_HAS(HG_LOBES_CLEARCOAT_NORMAL)) != 0u) {
            vec3 n = texels[HG_LOBES_CLEARCOAT_NORMAL].xyz * 2.0 - 1.0;
            n.xy *= HG_LOBE_AT(clearcoat_normal_scale);
            n = v.tangent_ws.xyz * n.x + bitangent * n.y + v.normal_ws * n.z;
            s.clearcoat_normal = n * (inversesqrt(max(dot(n, n), 1e-20)) * side);
        }
    }
    if (HG_HAS(HG_FEATURE_SHEEN)) {
        s.sheen_color = HG_LOBE_AT(sheen_color) * texels[HG_LOBES_SHEEN_COLOR].rgb;
        s.sheen_roughness = HG_LOBE_AT(sheen_roughness) * texels[HG_LOBES_SHEEN_ROUGHNESS].a;
    }
    if (HG_HAS(HG_FEATURE_TRANSMISSION)) {
        s.transmission = HG_LOBE_AT(transmission) * texels[HG_LOBES_TRANSMISSION].r;
        s.dispersion = HG_LOBE_AT(dispersion);
    }
    if (HG_HAS(HG_FEATURE_TRANSMISSION) || HG_HAS(HG_FEATURE_DIFFUSE_TRANSMISSION)) {
        s.thickness = HG_LOBE_AT(thickness) * texels[HG_LOBES_THICKNESS].g;
        s.attenuation = HG_LOBE_AT(thickness) > 0.0 ? HG_LOBE_AT(attenuation) : vec3(0.0);
    }
    if (HG_HAS(HG_FEATURE_IRIDESCENCE)) {
        s.iridescence = HG_LOBE_AT(iridescence) * texels[HG_LOBES_IRIDESCENCE].r;
        s.iridescence_ior = HG_LOBE_AT(iridescence_ior);
        s.iridescence_nm = mix(HG_LOBE_AT(iridescence_min), HG_LOBE_AT(iridescence_max),
            texels[HG_LOBES_IRIDESCENCE_THICKNESS].g);
    }
    if (HG_HAS(HG_FEATURE_ANISOTROPY)) {
        vec2 d = HG_LOBE_AT(anisotropy_direction);
        s.anisotropy = HG_LOBE_AT(anisotropy);
        if ((flags & HG_LOBES_HAS(HG_LOBES_ANISOTROPY)) != 0u) {
            vec3 texel = texels[HG_LOBES_ANISOTROPY].xyz;
            vec2 t = texel.xy * 2.0 - 1.0;
            d = vec2(d.x * t.x - d.y * t.y, d.y * t.x + d.x * t.y);
            s.anisotropy *= texel.z;
        }
        d = dot(d, d) > 1e-8 ? normalize(d) : vec2(1.0, 0.0);
        s.tangent = v.tangent_ws.xyz * d.x + bitangent * d.y;
    }
    if (HG_HAS(HG_FEATURE_DIFFUSE_TRANSMISSION)) {
        s.diffuse_transmission =
            HG_LOBE_AT(diffuse_transmission) * texels[HG_LOBES_DIFFUSE_TRANSMISSION].a;
        s.diffuse_transmission_color = HG_LOBE_AT(diffuse_transmission_color) *
            texels[HG_LOBES_DIFFUSE_TRANSMISSION_COLOR].rgb;
    }
}

#endif

// --- surfaces ------------------------------------------------------------------------------------

// Straight-line code: absent slots of a material cost a lookup that is thrown away, slots that no
// material of the scene uses cost nothing (HG_HAS).
hg_surface hg_material_evaluate(hg_vertex v)
{
    uint flags = HG_MATERIAL_AT(v.material, flags);
    vec4 base_texel = vec4(1.0), normal_texel = vec4(1.0), mr_texel = vec4(1.0);
    vec3 emissive_texel = vec3(1.0);
    float occlusion = 1.0;
    if (HG_HAS(HG_FEATURE_TEXTURES)) {
        base_texel = hg_material_sample(v.material, HG_MATERIAL_BASE_COLOR, true, v);
        if (HG_MATERIAL_DETAIL > 1u) {
            float share = hg_texture_share;
            hg_texture_share = HG_MATERIAL_COARSE_NORMALS ? 1.0 : share;
            normal_texel = hg_material_sample(v.material, HG_MATERIAL_NORMAL, false, v);
            hg_texture_share = share;
        }
        if (HG_MATERIAL_DETAIL > 0u)
            mr_texel = hg_material_sample(v.material, HG_MATERIAL_MR, false, v);
    }
    if (HG_HAS(HG_FEATURE_EMISSIVE) && HG_MATERIAL_DETAIL > 0u)
        emissive_texel = hg_material_sample(v.material, HG_MATERIAL_EMISSIVE, true, v).rgb;
    if (HG_HAS(HG_FEATURE_OCCLUSION) && HG_MATERIAL_DETAIL > 0u)
        occlusion = hg_material_sample(v.material, HG_MATERIAL_OCCLUSION, false, v).r;
    if (HG_HAS(HG_FEATURE_UNCOMMON) && (flags & HG_MATERIAL_PACKED_ORM) != 0u)
        occlusion = mr_texel.r;

    hg_surface s;
    float side = v.front ? 1.0 : -1.0;
    vec4 base = HG_MATERIAL_AT(v.material, base_color) * v.color * base_texel;
    s.base_color = base.rgb;
    s.alpha = (flags & HG_MATERIAL_BLEND) != 0u ? clamp(base.a, 0.0, 1.0) : 1.0;
    if ((flags & HG_MATERIAL_MASK) != 0u)
        s.alpha = base.a >= HG_MATERIAL_AT(v.material, alpha_cutoff) ? 1.0 : 0.0;
    s.metallic = HG_MATERIAL_AT(v.material, metallic) * mr_texel.b;
    s.roughness = HG_MATERIAL_AT(v.material, roughness) * mr_texel.g;
    s.f0 = HG_MATERIAL_F0;
    s.emissive = vec3(0.0);
    s.occlusion = 1.0;
    if (HG_HAS(HG_FEATURE_EMITS))
        s.emissive = HG_MATERIAL_AT(v.material, emissive) * emissive_texel;
    if (HG_HAS(HG_FEATURE_UNCOMMON)) {
        s.f0 = HG_MATERIAL_AT(v.material, f0);
        s.occlusion = 1.0 + HG_MATERIAL_AT(v.material, occlusion_strength) * (occlusion - 1.0);
    }
    bool no_normals = HG_HAS(HG_FEATURE_VERTICES) &&
        (v.flags & (HG_DRAW_POINTS | HG_DRAW_LINES | HG_DRAW_DISCS)) != 0u &&
        (v.flags & HG_DRAW_NORMALS) == 0u;
    s.unlit = (HG_HAS(HG_FEATURE_UNCOMMON) && (flags & HG_MATERIAL_UNLIT) != 0u) || no_normals; // glTF 2.0 section 3.7.2.1
    s.geometric_normal = v.geometric_ws * side;
    s.normal = v.normal_ws;
    if (HG_MATERIAL_DETAIL > 1u && (flags & HG_MATERIAL_HAS(HG_MATERIAL_NORMAL)) != 0u) {
        vec3 n = normal_texel.xyz * 2.0 - 1.0;
        float scale = 1.0;
        if (HG_HAS(HG_FEATURE_UNCOMMON))
            scale = HG_MATERIAL_AT(v.material, normal_scale);
        float lost = (1.0 - normal_texel.a) * scale;
        float width2 = s.roughness * s.roughness * s.roughness * s.roughness + lost * lost;
        s.roughness = lost == 0.0 ? s.roughness : sqrt(sqrt(min(width2, 1.0)));
        n.xy *= scale;
        vec3 bitangent = cross(v.normal_ws, v.tangent_ws.xyz) * v.tangent_ws.w;
        n = v.tangent_ws.xyz * n.x + bitangent * n.y + v.normal_ws * n.z;
        s.normal = n * inversesqrt(max(dot(n, n), 1e-20));
    }
    s.normal *= side;
    s.front = v.front;
    hg_lobes_none(s, v.normal_ws * side, v.tangent_ws.xyz);
#ifndef HG_NO_LOBES
    if (HG_HAS(HG_FEATURE_LOBES) && HG_MATERIAL_DETAIL > 0u)
        hg_lobes_evaluate(v, side, s);
#endif
    return s;
}

#endif
