// Light that paths asked for, once it is known what lies between: nothing, something opaque, or
// surfaces with holes, one after the other.
//
// First opaque surfaces have been looked for, then the next one of the others.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#extension GL_EXT_buffer_reference2 : require

#define HG_TEXTURE_STOCHASTIC true
#define HG_TEXTURE_NOTE       true

#include "lib/frame.glsl"
#include "lib/tables.glsl"
#include "lib/vertex.glsl"
#include "lib/texture.glsl"
#include "lib/material.glsl"
#include "lib/path.glsl"
#include "lib/hit.glsl"
#include "lib/bsdf.glsl"

layout(local_size_x = HG_PATH_GROUP) in;

// 0: after the test for opaque surfaces; 1: at the next masked or blended one, 2: there is none.
layout(constant_id = 0) const uint kind = 0u;

// Share of light from straight behind that a smooth pane lets through: what paths that run into it
// are multiplied with.
vec3 through_pane(hg_vertex v, vec3 direction)
{
    hg_surface s = hg_material_evaluate(v);
    s.normal *= dot(s.normal, s.geometric_normal) < 0.0 ? -1.0 : 1.0;
    hg_bsdf b = hg_bsdf_make(s, -direction, 1.0);
    if (s.transmission <= 0.0 || !b.thin || !b.delta || s.unlit)
        return vec3(0.0);
    return hg_bsdf_facet(b, b.v_ts.z).transmitted * b.through_v;
}

// Transmittance of the surface.
vec3 let_through(uint slot, hg_gpu_ray ray, hg_gpu_hit hit)
{
    vec2 cone = hg_path_unpack_cone(hg_path_get(HG_PATH_CONE, slot));
    uvec2 pixel = hg_path_pixel(slot);
    uint kept = floatBitsToUint(hg_path_get(HG_PATH_FLAGS, slot)), steps = kept & HG_PATH_STEPS_MASK;
    // By few samples the path spreads widely from the first surface on; rays to lights do not.
    if (HG_PATH_CAN(HG_PATH_GATHERS) && bitfieldExtract(kept, HG_PATH_BOUNCE_SHIFT, 9) == 1u)
        cone.y = 0.0;
    uvec3 bits = hg_hash3(uvec3(pixel, hg_path_number(slot) * 1024u + steps +
        (hg_frame.seed + (hg_path.status.v[slot] >> HG_PATH_ALPHA_MASK_SHIFT) + 1u) * 0x9e3779b1u));
    hg_texture_xi = vec2(bits.xy >> 8u) * (1.0 / 16777216.0);
    hg_path_time = ray.time;
    hg_vertex v = hg_fetch_hit(hit, ray.direction_ws, cone.x + cone.y * hit.t);
    uint flags = HG_MATERIAL_AT(v.material, flags);
    float alpha = 1.0;
    if ((flags & (HG_MATERIAL_BLEND | HG_MATERIAL_MASK)) != 0u)
        alpha = clamp(hg_material_alpha(v.material, v), 0.0, 1.0);
    if ((flags & HG_MATERIAL_MASK) != 0u)
        alpha = alpha >= HG_MATERIAL_AT(v.material, alpha_cutoff) ? 1.0 : 0.0;
    vec3 pane = vec3(0.0);
    if (HG_HAS(HG_FEATURE_TRANSMISSION) && (ray.mask & HG_RAY_STRAIGHT) != 0u &&
        (flags & HG_MATERIAL_TRANSMITS) != 0u)
        pane = through_pane(v, ray.direction_ws);
    return 1.0 - alpha + alpha * pane;
}

// The light is on its way's end: it counts.
void arrive(uint slot, vec3 light)
{
    uint flags = floatBitsToUint(hg_path_get(HG_PATH_FLAGS, slot));
    uint bounce = bitfieldExtract(flags, HG_PATH_BOUNCE_SHIFT, 9), group = 0u;
    if (HG_PATH_CAN(HG_PATH_CATCHER) && (flags & HG_PATH_CATCHES) != 0u) {
        uint lit = hg_path_out(hg_path.planes[HG_PATH_PLANE_CATCHER]) + HG_PATH_CATCHER_LIT;
        hg_path_set(lit, slot,
            hg_path_get(lit, slot) + dot(light, vec3(0.2126, 0.7152, 0.0722)));
        return;
    }
    uint lamp = 0u; // 1 + its number
    if (HG_PATH_CAN(HG_PATH_LAMPS) && bounce == 1u)
        lamp = push.second != 0u ? uint(hg_path_get(hg_path.split + HG_PATH_SPLIT_SUN, slot))
            : (flags & HG_PATH_ASKS_LAMP) != 0u ? bitfieldExtract(flags, HG_PATH_LAMP_SHIFT, 4) + 1u : 0u;
    if (HG_PATH_CAN(HG_PATH_GATHERS) && bounce == 1u && push.second != 0u && lamp == 0u) {
        hg_path_add_sun(HG_PATH_GUIDE_SEEN_SUN, slot, dot(light, vec3(0.2126, 0.7152, 0.0722)));
        return;
    }
    if (HG_PATH_CAN(HG_PATH_LAMPS) && lamp > 0u) {
        lamp--;
        float sixteenths = floor(16.0 * dot(light, vec3(0.2126, 0.7152, 0.0722)) + 0.5);
        hg_path_add(hg_path_out(hg_path.planes[HG_PATH_PLANE_LAMPS] + lamp), slot, HG_PATH_LAMP_SEEN * sixteenths);
        return;
    }
    if (HG_PATH_CAN(HG_PATH_GROUPS))
        group = bitfieldExtract(floatBitsToUint(hg_path_get(hg_path.split + HG_PATH_SPLIT_GROUPS, slot)),
            push.second != 0u ? 8 : 0, 8);
    hg_path_light(slot, bounce, 1u + push.second, group, light);
    if (HG_PATH_CAN(HG_PATH_GATHERS) && bounce == 1u && (flags & HG_PATH_ASKS_SKY) != 0u)
        hg_path_add_sky(HG_PATH_GUIDE_SEEN_SKY, slot, 1u, light);
}

void main()
{
    uint i = gl_GlobalInvocationID.x;
    if (i >= push.count)
        return;
    uint slot = push.list.v[i], at = slot + push.second * hg_path.capacity;
    uint pending = push.second != 0u ? HG_PATH_PENDING_SUN : HG_PATH_PENDING;
    vec3 light = hg_path_get3(pending, slot);
    bool over = true;
    if (kind == 2u) {
        arrive(slot, light);
    } else if (kind == 0u) {
        bool blocked = hg_path.blocked.v[slot] != 0u;
        uint mask = hg_path.shadow_rays.v[at].mask;
        over = blocked || hg_path.has_alpha_mask == 0u || (mask & HG_RAY_OPAQUE) == 0u;
        if (over && !blocked)
            arrive(slot, light);
        if (!over)
            hg_path.shadow_rays.v[at].mask = (mask & HG_RAY_STRAIGHT) | HG_RAY_MASK | HG_RAY_BLEND;
    } else {
        hg_gpu_ray ray = hg_path.shadow_rays.v[at];
        hg_gpu_hit hit = hg_path.shadow_hits.v[slot];
        bool more = hit.draw != HG_HIT_NONE;
        vec3 share = vec3(1.0);
        if (more)
            share = let_through(slot, ray, hit);
        hg_texture_report(hg_path_pixel(slot));
        if (hg_texture_coarser != 0u)
            return; // once more
        if (more && share != vec3(1.0))
            hg_path_set3(pending, slot, light * share);
        uint passed = (hg_path.status.v[slot] >> HG_PATH_ALPHA_MASK_SHIFT) + 1u;
        over = !more || share == vec3(0.0) || passed >= HG_PATH_MOST_ALPHA_MASKS;
        if (!more)
            arrive(slot, light);
        else
            hg_path.shadow_rays.v[at].t_min = hit.t * (1.0 + 1e-6);
        hg_path.status.v[slot] = (hg_path.status.v[slot] & ((1u << HG_PATH_ALPHA_MASK_SHIFT) - 1u)) |
            (passed << HG_PATH_ALPHA_MASK_SHIFT);
    }
    if (over)
        hg_path.status.v[slot] &=
            ((1u << HG_PATH_ALPHA_MASK_SHIFT) - 1u) & ~(HG_PATH_SHADOW << push.second);
}
