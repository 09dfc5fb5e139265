// What the rays of a wave have found: light that the path runs into, a ray to a light, and where
// the path goes on.
//
// A path whose textures are not all there writes nothing but that it waits.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#extension GL_EXT_buffer_reference2 : require

// 0: rays of all kinds; 1: all have left the scene; 2: none has. For devices that run both sides of
// branches. Of gathering paths 3: those that may end at what they met (lib/path_end.glsl); 4: those from the camera
// that look for directional lights alone.
layout(constant_id = 0) const uint kind = 0u;

#define HG_TEXTURE_STOCHASTIC true
#define HG_TEXTURE_NOTE       true
#define HG_MATERIAL_DETAIL    (kind == 4u ? 0u : kind == 3u ? 1u : 2u)

#include "lib/frame.glsl"
#include "lib/tables.glsl"
#include "lib/vertex.glsl"
#include "lib/texture.glsl"
#include "lib/material.glsl"
#include "lib/brdf.glsl"
#include "lib/shading_normal.glsl"
#include "lib/light.glsl"
#include "lib/path.glsl"
#define HG_PROBES_BETWEEN !HG_PATH_CAN(HG_PATH_GLASS)
#include "lib/probes.glsl"
#include "lib/environment.glsl"
#include "lib/hit.glsl"
#include "lib/bsdf.glsl"
#include "lib/path_media.glsl"

vec3 emitter_position(hg_gpu_draw d, hg_gpu_part part, uint vertex)
{
    vec3 p = part.positions.v[vertex];
    if (HG_PATH_CAN(HG_PATH_BLURS))
        p = HG_PATH_BETWEEN(hg_path_part_before(d, part).positions.v[vertex], p);
    return p;
}

// A punctual light at the time of the path: places on the straight line, directions between.
hg_gpu_light light_at(uint index)
{
    hg_gpu_light light = hg_path.emitters.lights.v[index];
    if (HG_PATH_CAN(HG_PATH_BLURS)) {
        hg_gpu_light before = hg_path.emitters.lights_before.v[index];
        light.position_ws = HG_PATH_BETWEEN(before.position_ws, light.position_ws);
        light.color = HG_PATH_BETWEEN(before.color, light.color);
        if (before.direction_ws != light.direction_ws)
            light.direction_ws =
                normalize(HG_PATH_BETWEEN(before.direction_ws, light.direction_ws));
        bool turns = HG_PATH_CAN(HG_EMITTER_KIND_SIZED) || HG_HAS2(HG_FEATURE2_LIGHT_TABLES);
        if (turns && before.axis_ws != light.axis_ws)
            light.axis_ws = normalize(HG_PATH_BETWEEN(before.axis_ws, light.axis_ws));
    }
    return light;
}

#define HG_EMITTERS hg_path.emitters
#define HG_EMITTER_LIGHT(index) light_at(index)
#define HG_EMITTER_KINDS hg_path_options
#define HG_EMITTER_APART HG_PATH_CAN(HG_PATH_SUNS_APART)
#define HG_EMITTER_WORLD(draw) hg_path_world((draw).instance)
#define HG_EMITTER_POSITION(draw, part, vertex) emitter_position(draw, part, vertex)
#define HG_EMITTER_TERMS(draw, world) hg_path_terms(draw, world)
#include "lib/emitters.glsl"

layout(local_size_x = HG_PATH_GROUP) in;

#define CANDIDATES     2u // lights of which one gets a ray
#define SEVERAL (HG_EMITTER_KIND_ALL & ~HG_EMITTER_KIND_SUN) // but a single directional light
#define ROULETTE_AFTER 3u // bounces
#define GLASS_ROULETTE_AFTER 8u
#define ROULETTE_LEAST 0.05
#define SPREAD_DIFFUSE 0.1 // radians that textures may be blurred by behind a diffuse surface

// A path as far as it has come.
struct path {
    uint slot, flags, steps, bounce;
    uvec2 media; // around the ray
    vec3 throughput;
    float pdf;
    vec3 normal; // of the surface it left
    hg_gpu_ray ray;
};

// Power heuristic for one sample of each. Veach 1997, section 9.2.4.
float mis(float pdf, float other)
{
    float a = pdf * pdf, b = other * other;
    return a > 0.0 ? a / (a + b) : 0.0;
}

// Weight of light that the path ran into, which lights would have been sampled for with `other`.
float weight_found(path p, float other, uint candidates)
{
    if (p.pdf <= 0.0) // the only way
        return 1.0;
    if ((hg_path.estimators & HG_PATH_USE_SURFACES) == 0u)
        return other > 0.0 ? 0.0 : 1.0;
    bool both = (hg_path.estimators & HG_PATH_USE_EMITTERS) != 0u;
    return both ? mis(p.pdf, float(candidates) * other) : 1.0;
}

vec3 clamped(vec3 radiance, uint bounce)
{
    float most = max(radiance.r, max(radiance.g, radiance.b));
    bool above = hg_path.clamp_indirect > 0.0 && bounce > 1u && most > hg_path.clamp_indirect / hg_path_branches();
    return hg_path_finite(above ? radiance * (hg_path.clamp_indirect / (hg_path_branches() * most)) : radiance);
}

#include "lib/path_motion.glsl"

// What the camera sees behind everything.
vec3 background(path p, vec3 direction)
{
    if (HG_BACKGROUND_IS_CLEAR(hg_frame.background_mode))
        return vec3(0.0);
    if (hg_frame.background_mode == HG_BACKGROUND_MODE_BLUR)
        return hg_environment_blurred(direction);
    if (hg_frame.background_mode == HG_BACKGROUND_MODE_COLOR)
        return hg_frame.background_color;
    if (hg_frame.camera.orthographic == 0u)
        hg_emitter_environment_lod = hg_frame.textures.background_lod;
    return hg_emitter_backdrop(direction) *
        weight_found(p, hg_emitter_pdf_environment(p.ray.origin_ws, p.normal, direction), CANDIDATES);
}

// First mask of a shadow ray: opaque surfaces.
uint first_mask(hg_emitter_sample e)
{
    return hg_path.has_alpha_mask != 0u ? e.mask & ~(HG_RAY_MASK | HG_RAY_BLEND) : e.mask;
}

#include "lib/path_lights.glsl"
#include "lib/path_features.glsl"
#include "lib/path_gather.glsl"
#include "lib/ground.glsl"

// The ray left the scene.
uint miss(path p)
{
    vec3 d = p.ray.direction_ws;
    vec3 radiance = vec3(0.0);
    if (HG_PATH_CAN(HG_PATH_GLASS) && p.bounce == 0u)
        return HG_PATH_DONE;
    float alpha = p.bounce == 0u && HG_BACKGROUND_IS_CLEAR(hg_frame.background_mode) ? 0.0 : 1.0;
    if (p.bounce == 0u)
        radiance = background(p, d);
    else
        radiance = hg_emitter_environment(d) *
            weight_found(p, hg_emitter_pdf_environment(p.ray.origin_ws, p.normal, d), CANDIDATES);
    if (hg_texture_coarser != 0u)
        return HG_PATH_WAITS;
    meet_lights(p, HG_EMITTER_FAR, p.throughput, p.media);
    vec3 light = clamped(p.throughput * radiance, p.bounce);
    hg_path_light(p.slot, p.bounce, 0u, HG_EMITTER_GROUP_ENVIRONMENT, light);
    if (HG_PATH_CAN(HG_PATH_GATHERS) && p.bounce == 1u)
        hg_gather_saw_sky(p, light);
    if (HG_PATH_CAN(HG_PATH_FOLLOWS) && (p.flags & HG_PATH_FOLLOWED) != 0u)
        hg_features_note(p.slot, hg_features_tint(p) * hg_features_light_color(radiance), HG_FEATURES_FAR, false);
    if (p.bounce == 0u && push.branch == 0u)
        hg_path_set(HG_PATH_OUT + 3u, p.slot, alpha);
    if (push.branch == 0u && HG_PATH_CAN(HG_PATH_MOTION) && HG_PATH_HAS(HG_PATH_PLANE_MOTION) &&
        (p.flags & HG_PATH_SEEN) == 0u) {
        vec4 far = vec4(p.ray.direction_ws, 0.0);
        put_motion(p.slot, far, far, far);
    }
    return HG_PATH_DONE;
}

// What the camera sees first; the first branch tells.
void note_seen(path p, hg_vertex v, hg_surface s, hg_gpu_hit hit)
{
    if (push.branch != 0u)
        return;
    hg_path_set(HG_PATH_OUT + 3u, p.slot, 1.0);
    hg_path_put3(HG_PATH_PLANE_ALBEDO, p.slot, s.base_color);
    hg_path_put3(HG_PATH_PLANE_NORMAL, p.slot, s.normal);
    hg_path_put3(HG_PATH_PLANE_GEOMETRIC_NORMAL, p.slot, s.geometric_normal);
    hg_path_put(HG_PATH_PLANE_HITS, p.slot, 1.0);
    hg_path_put(HG_PATH_PLANE_DEPTH, p.slot, v.depth);
    hg_path_put3(HG_PATH_PLANE_POSITION, p.slot, v.position_ws);
    uint node = hg_frame.geometry.instances.v[v.instance].node;
    if (HG_PATH_CAN(HG_PATH_MOTION) && HG_PATH_HAS(HG_PATH_PLANE_MOTION))
        put_motion(p.slot, position_at(HG_PATH_PREVIOUS, hit), position_at(HG_PATH_NOW, hit),
            position_at(HG_PATH_NEXT, hit));
    if (HG_PATH_HAS(HG_PATH_PLANE_MOVED)) {
        uint moved = hg_path_out(hg_path.planes[HG_PATH_PLANE_MOVED]);
        if (HG_PATH_CAN(HG_PATH_MOTION))
            hg_path_set3(moved + HG_PATH_MOVED_BY, p.slot,
                (position_at(HG_PATH_SHOWN, hit) - position_at(HG_PATH_NOW, hit)).xyz);
        hg_path_set(moved + HG_PATH_MOVED_WHAT, p.slot, float(node + 1u));
    }
    hg_path_put(HG_PATH_PLANE_OBJECT, p.slot, float(node + 1u));
    hg_path_put(HG_PATH_PLANE_MATERIAL, p.slot, float(v.material + 1u));
    hg_path_put(HG_PATH_PLANE_DRAWS, p.slot, float(hit.draw + 1u));
}

// What the denoiser is guided by.
void note_guide(path p, hg_bsdf b, hg_vertex v, hg_surface s)
{
    uint guide = hg_path_out(hg_path.planes[HG_PATH_PLANE_GUIDE]);
    vec3 scattering = HG_PATH_CAN(HG_PATH_GATHERS) ? hg_gather_scattering(b) : hg_features_scattering(b);
    hg_path_set3(guide + HG_PATH_GUIDE_ALBEDO, p.slot, scattering);
    hg_path_set3(guide + HG_PATH_GUIDE_REFLECTION, p.slot, hg_features_mirroring(b));
    hg_path_set3(guide + HG_PATH_GUIDE_NORMAL, p.slot, s.normal);
    hg_path_set(guide + HG_PATH_GUIDE_DEPTH, p.slot, log(max(v.depth, 1e-6)));
    bool cloth = HG_PATH_CAN(HG_PATH_GATHERS) &&
        ((HG_HAS(HG_FEATURE_SHEEN) && hg_max3(b.sheen) > 0.0) || hg_gather_scatters_through(b));
    hg_path_set(guide + HG_PATH_GUIDE_ROUGHNESS, p.slot, s.roughness + (cloth ? HG_PATH_GUIDE_CLOTH : 0.0));
    hg_path_set(guide + HG_PATH_GUIDE_HITS, p.slot, 1.0);
}

uint group_of(hg_emitter_sample e)
{
    if (e.group == HG_EMITTER_GROUP_ENVIRONMENT)
        return HG_EMITTER_GROUP_ENVIRONMENT;
    return (e.group == HG_EMITTER_GROUP_PUNCTUAL ? hg_path.light_groups.v[e.draw]
                                                 : hg_path.draw_marks.v[e.draw]) & HG_PATH_GROUP_MASK;
}

void note_group(uint slot, uint group, bool second)
{
    uint word = hg_path.split + HG_PATH_SPLIT_GROUPS;
    uint groups = floatBitsToUint(hg_path_get(word, slot));
    groups = bitfieldInsert(second ? groups : 0u, group, second ? 8 : 0, 8);
    hg_path_set(word, slot, uintBitsToFloat(groups));
}

// Which share of f, the light by this way, the first surface's diffuse lobe reflects.
void note_split(uint slot, uint word, hg_bsdf b, vec3 l, vec3 f)
{
    vec3 share = vec3(HG_PATH_CAN(HG_PATH_GATHERS) && hg_gather_scatters_through(b) ? 1.0 : -1.0);
    if (dot(b.base.n, l) > 0.0)
        share = clamp(hg_bsdf_evaluate_diffuse_part(b, l) / max(f, 1e-30), 0.0, 1.0);
    hg_path_set3(hg_path.split + word, slot, share);
}

// Light that would arrive, times f of the surface, weighted. candidates: of which it is one; pdf: with which the path
// goes on that way, 0: it does not.
vec3 weighted(hg_surface s, hg_emitter_sample e, vec3 f, float pdf, uint candidates)
{
    float weight = 1.0;
    if (!e.delta)
        weight = ((hg_path.estimators & HG_PATH_USE_SURFACES) != 0u && pdf > 0.0
                ? mis(float(candidates) * e.pdf, pdf) : 1.0) / max(e.pdf, 1e-20);
    bool any = (e.delta || e.pdf > 0.0) &&
        dot(s.geometric_normal, e.direction) * dot(s.normal, e.direction) > 0.0;
    return any ? hg_path_finite(f * e.radiance * weight) : vec3(0.0);
}

// Of a surface that scatters all that it sends back.
vec3 scattered(vec3 albedo, hg_surface s, hg_emitter_sample e)
{
    return albedo * (max(dot(s.normal, e.direction), 0.0) * HG_INV_PI);
}

// ends: no path goes on that might meet the light.
vec3 reflected(hg_bsdf b, hg_surface s, hg_emitter_sample e, uint candidates, bool ends, out vec3 f)
{
    float pdf_surface;
    bool alone = ends && e.group != HG_EMITTER_GROUP_ENVIRONMENT;
    f = hg_bsdf_evaluate(b, e.direction, pdf_surface);
    if (alone && s.roughness < HG_GATHER_ASKS)
        f = scattered(hg_gather_albedo(b), s, e);
    return weighted(s, e, f, alone ? 0.0 : pdf_surface, candidates);
}

struct light_choice {
    hg_emitter_sample e;
    vec3 f, light; // of the surface; what arrives and is reflected if nothing is in the way
};

light_choice candidate(hg_bsdf b, hg_vertex v, hg_surface s, vec3 normal, vec3 u, bool ends)
{
    light_choice c;
    c.e = hg_emitter_pick(v.position_ws, normal, u);
    c.light = reflected(b, s, c.e, CANDIDATES, ends, c.f);
    return c;
}

// One of two lights, with a chance by what it would bring. Both are drawn with the same density, so what the chosen one brings, times the mean of both
// over its own, has the right mean. Weights of the power heuristic are part of what it brings: any
// that add up to one are right, these are those of two samples.
// Source: Talbot, Cline and Egbert 2005, "Importance Resampling for Global Illumination".
light_choice one_of(light_choice one, light_choice other, float u)
{
    float first = hg_emitter_luminance(one.light), second = hg_emitter_luminance(other.light);
    float sum = first + second, mine = first;
    if (u * sum >= first) {
        one = other;
        mine = second;
    }
    one.light *= mine > 0.0 ? 0.5 * sum / mine : 0.0;
    return one;
}

// Half of all candidates lie behind the surface.
light_choice choose_light(hg_bsdf b, hg_vertex v, hg_surface s, vec3 normal, vec4 u, bool ends)
{
    light_choice one = candidate(b, v, s, normal, u.xyz, ends);
    if (!HG_EMITTER_MAY(SEVERAL))
        return one;
    return one_of(one, candidate(b, v, s, normal, fract(u.xyz + 0.5), ends), u.w);
}

// What the medium that the surface is in, or bounds, lets through of a light. Light from outside of
// the scene is not held back, as when a path runs into it: volumes end before that.
vec3 dimmed(path p, hg_bsdf b, hg_vertex v, hg_surface s, hg_emitter_sample e)
{
    if (!HG_MEDIA || e.distance >= HG_EMITTER_FAR)
        return vec3(1.0);
    uvec2 media = p.media;
    if (!b.thin && dot(s.geometric_normal, e.direction) < 0.0)
        hg_media_cross(media, v.material, s.front);
    return hg_bsdf_attenuation(hg_media_attenuation(media), e.distance);
}

// Emits a shadow ray, the second one to a directional light; true when there is one. light: that it brings.
bool ask(path p, hg_vertex v, hg_surface s, hg_emitter_sample e, vec3 light, bool second)
{
    light = clamped(p.throughput * light, p.bounce + 1u);
    float side = dot(s.geometric_normal, e.direction);
    bool any = max(light.r, max(light.g, light.b)) > 0.0 &&
        (hg_path.estimators & HG_PATH_USE_EMITTERS) != 0u;
    hg_gpu_ray ray;
    ray.origin_ws = hg_hit_offset(v.position_ws, side < 0.0 ? -s.geometric_normal : s.geometric_normal);
    ray.direction_ws = e.direction;
    ray.t_min = 0.0;
    ray.t_max = any ? e.distance : -1.0;
    ray.time = p.ray.time;
    ray.mask = first_mask(e);
    hg_path.shadow_rays.v[p.slot + (second ? hg_path.capacity : 0u)] = ray;
    hg_path_set3(second ? HG_PATH_PENDING_SUN : HG_PATH_PENDING, p.slot, light);
    if (HG_PATH_CAN(HG_PATH_GROUPS))
        note_group(p.slot, group_of(e), second);
    return any;
}

bool ask_light(path p, hg_bsdf b, hg_vertex v, hg_surface s, light_choice c, bool second)
{
    if (HG_PATH_CAN(HG_PATH_SPLIT) && p.bounce == 0u)
        note_split(p.slot, second ? HG_PATH_SPLIT_SUN : HG_PATH_SPLIT_ASKED, b, c.e.direction, c.f);
    return ask(p, v, s, c.e, c.light * dimmed(p, b, v, s, c.e), second);
}

// Where the path goes from here; false: nowhere.
bool go_on(inout path p, hg_bsdf b, hg_vertex v, hg_surface s, vec3 u, float survive, float width,
    float spread, out uint lobe)
{
    float turn = 0.0;
    if (HG_PATH_CAN(HG_PATH_GLASS))
        turn = hg_gather_take_turn(p, b, u);
    hg_bsdf_sample_result r = hg_bsdf_sample(b, u);
    if (turn > 0.0)
        r.weight *= r.pdf / turn;
    lobe = r.lobe;
    float side = dot(s.geometric_normal, r.direction);
    bool through = (r.lobe & HG_LOBE_TRANSMISSION) != 0u;
    bool on = r.pdf > 0.0 && (through ? side < 0.0 : side > 0.0);
    p.throughput = hg_path_finite(p.throughput * r.weight);
    float most = max(p.throughput.r, max(p.throughput.g, p.throughput.b));
    // What glass shows is not filtered, and few of its paths go far.
    uint after = HG_PATH_CAN(HG_PATH_GLASS) ? GLASS_ROULETTE_AFTER : ROULETTE_AFTER;
    float chance = p.bounce >= after ? clamp(most * hg_path_branches(), ROULETTE_LEAST, 1.0) : 1.0;
    on = on && most > 0.0 && survive < chance;
    p.throughput /= chance;
    p.pdf = (r.lobe & HG_LOBE_DELTA) != 0u ? 0.0 : r.pdf;
    if (HG_PATH_CAN(HG_PATH_SPLIT) && p.bounce == 0u) {
        float pdf;
        if ((r.lobe & HG_LOBE_DELTA) != 0u)
            hg_path_set3(hg_path.split + HG_PATH_SPLIT_PATH, p.slot, vec3(through ? -1.0 : 0.0));
        else
            note_split(p.slot, HG_PATH_SPLIT_PATH, b, r.direction, hg_bsdf_evaluate(b, r.direction, pdf));
    }
    if (through && !b.thin)
        hg_media_cross(p.media, v.material, s.front);
    bool diffuse = (r.lobe & HG_LOBE_DIFFUSE) != 0u;
    if (HG_PATH_CAN(HG_PATH_GATHERS)) {
        bool wide = diffuse || ((r.lobe & HG_LOBE_DELTA) == 0u && s.roughness >= HG_GATHER_ROUGH);
        p.flags = wide ? p.flags | HG_PATH_WIDE : p.flags & ~HG_PATH_WIDE;
    }
    float more = (diffuse ? 1.0 : s.roughness * s.roughness) * SPREAD_DIFFUSE * hg_path.footprint;
    hg_path_set(HG_PATH_CONE, p.slot, hg_path_pack_cone(width, spread + more));
    p.ray.origin_ws = hg_hit_offset(v.position_ws, side < 0.0 ? -s.geometric_normal : s.geometric_normal);
    p.ray.direction_ws = normalize(r.direction);
    p.ray.t_min = 0.0;
    p.ray.t_max = 1e30;
    return on;
}

void store(path p, float normal)
{
    hg_path.rays.v[p.slot] = p.ray;
    hg_path_set3(HG_PATH_THROUGHPUT, p.slot, p.throughput);
    hg_path_set(HG_PATH_PDF, p.slot, p.pdf);
    hg_path_set(HG_PATH_NORMAL, p.slot, normal);
    if (HG_MEDIA) {
        hg_path_set(HG_PATH_MEDIA, p.slot, uintBitsToFloat(p.media.x));
        hg_path_set(HG_PATH_MEDIA + 1u, p.slot, uintBitsToFloat(p.media.y));
    }
}

// The first surface that disperses leaves the path one channel, each with a chance of a third.
// Returns the path's channel, 3: all.
uint disperse(inout path p, inout hg_surface s, uvec2 pixel, uint number)
{
    if (!HG_HAS(HG_FEATURE_TRANSMISSION))
        return 3u;
    uint kept = bitfieldExtract(p.flags, HG_PATH_CHANNEL_SHIFT, 2);
    uint channel = kept == 0u ? 3u : kept - 1u;
    uvec3 h = hg_hash3(uvec3(pixel, number * 64u + 63u + hg_frame.seed * 65536u));
    p.throughput *= hg_surface_disperse(s, channel, float(h.x >> 8u) * (1.0 / 16777216.0));
    p.flags = bitfieldInsert(p.flags, channel == 3u ? 0u : channel + 1u, HG_PATH_CHANNEL_SHIFT, 2);
    return channel;
}

#include "lib/path_catcher.glsl"

// Whether the first surface of a gathering path sees a directional light, by a ray to a point of it; true when
// there is one.
bool ask_sun(path p, hg_vertex v, hg_surface s, vec3 side, vec3 u)
{
    hg_emitter_sample e = hg_emitter_pick_apart(v.position_ws, side, u);
    e.radiance = e.mask != 0u ? e.radiance : vec3(0.0); // it casts no shadows
    float light = catch_light(p, v, s, e, true);
    hg_path_add_sun(HG_PATH_GUIDE_OPEN_SUN, p.slot, light);
    if (HG_PATH_CAN(HG_PATH_LAMPS))
        hg_path_set(hg_path.split + HG_PATH_SPLIT_SUN, p.slot, 0.0);
    return light > 0.0;
}

// Whether it sees two lamps, in turn.
uint ask_lamps(inout path p, hg_vertex v, hg_surface s)
{
    uint turn = hg_gather_lamp_turn(p, 2u * (hg_path_number(p.slot) - hg_path.gather.lamps_from));
    uint status = HG_PATH_DONE;
    bool first = hg_gather_ask_lamp(p, v.position_ws, s.geometric_normal, s.normal, turn, false);
    bool second = hg_gather_ask_lamp(p, v.position_ws, s.geometric_normal, s.normal, turn + 1u, true);
    status |= first ? HG_PATH_SHADOW : 0u;
    return status | (second ? HG_PATH_SUN : 0u);
}

// For planes alone: the surface and its emission, no incident light.
uint see(inout path p, hg_vertex v, hg_surface s, hg_gpu_hit hit)
{
    note_seen(p, v, s, hit);
    p.flags |= HG_PATH_SEEN;
    vec3 emitted = s.unlit ? s.emissive + s.base_color : hg_surface_emission(s, -p.ray.direction_ws);
    hg_path_light(p.slot, 0u, 0u, hg_path_mark(hit.draw) & HG_PATH_GROUP_MASK,
        clamped(emitted, 0u));
    return HG_PATH_DONE;
}

// There is nothing: the path goes on behind it.
uint pass_by(inout path p, float t)
{
    p.steps++;
    if (HG_PATH_CAN(HG_PATH_FIRST))
        store(p, 0.0);
    hg_path.rays.v[p.slot].t_min = t * (1.0 + 1e-6);
    return p.steps < HG_PATH_MOST_STEPS ? HG_PATH_LIVE : HG_PATH_DONE;
}

// Of emission that the path ran into.
float weight_emitted(path p, hg_vertex v, hg_gpu_hit hit)
{
    float other = 0.0;
    if (HG_HAS(HG_FEATURE_EMITS))
        other = hg_emitter_pdf_triangle(p.ray.origin_ws, p.normal, hit.draw, hit.primitive,
            v.position_ws, v.geometric_ws);
    return weight_found(p, other, CANDIDATES);
}

uint surface(inout path p, hg_gpu_hit hit, uvec2 pixel)
{
    vec2 cone = hg_path_unpack_cone(hg_path_get(HG_PATH_CONE, p.slot));
    float width = cone.x + cone.y * hit.t;
    uint number = hg_path_number(p.slot);
    hg_vertex v = hg_fetch_hit(hit, p.ray.direction_ws, width);
    hg_surface s = hg_material_evaluate(v);
    hg_bend_normals(s, -p.ray.direction_ws);
    if (hg_texture_coarser != 0u)
        return HG_PATH_WAITS;
    hg_sampler points = hg_path_step_sampler(pixel, number);
    points.dimension = HG_PATH_CAMERA_PAIRS + p.steps * HG_PATH_STEP_PAIRS;
    vec4 ua = hg_sobol4(points), ub = hg_sobol4(points);

    // Surfaces with one side reflect on both, as those of other path tracers; only colour that is no
    // light (unlit) is not seen from behind, nor is emission. The real-time mode sees none of them.
    bool behind = !v.front && (v.flags & HG_DRAW_DOUBLE_SIDED) == 0u;
    if (behind)
        s.emissive = vec3(0.0);

    // Nothing there: holes, and what only has a front.
    bool one_sided = s.unlit || HG_PATH_CAN(HG_PATH_SURFACES | HG_PATH_GATHERS);
    bool layer = HG_PATH_CAN(HG_PATH_GATHERS) && hg_gather_is_layer(v, s.alpha);
    layer = layer && !(HG_PATH_CAN(HG_PATH_GLASS) && hg_gather_is_glass(v, s));
    if (ub.w >= s.alpha || ((layer || (one_sided && behind)) && p.bounce == 0u))
        return pass_by(p, hit.t);
    p.steps++;

    if (HG_PATH_CAN(HG_PATH_SURFACES))
        return see(p, v, s, hit);
    if (HG_PATH_CAN(HG_PATH_GLASS) && p.bounce == 0u && !hg_gather_is_glass(v, s))
        return HG_PATH_DONE;
    vec3 behind_it = HG_PATH_CAN(HG_PATH_GATHERS) && p.bounce == 1u ? hg_gather_behind(p) : vec3(0.0);
    vec3 arriving = p.throughput;
    uvec2 around = p.media;
    vec3 medium = hg_bsdf_attenuation(hg_media_attenuation(p.media), hit.t);
    p.throughput *= medium;
    // Lights count on the side of the normal, or on both; as stored, so that both ways agree.
    uint packed = hg_encode_normal(s.normal);
    bool both = s.transmission > 0.0 || s.diffuse_transmission > 0.0;
    hg_emitter_cone_width = width;
    hg_emitter_cone_spread = cone.y;
    vec3 side = both ? vec3(0.0) : hg_decode_normal(packed);
    vec3 throughput = p.throughput;
    uint channel = disperse(p, s, pixel, number);
    float outside = hg_media_outside(p.media, v.material, s.front, s.ior, channel);
    hg_bsdf b = hg_bsdf_make(s, -p.ray.direction_ws, outside);
    bool ends = HG_PATH_CAN(HG_PATH_GATHERS) && !HG_PATH_CAN(HG_PATH_FIRST) && hg_gather_ends(p, b, s, hit.t);
    ends = ends || (HG_PATH_CAN(HG_PATH_GLASS) && hg_gather_ends_behind_glass(p, b, s));
    light_choice light = choose_light(b, v, s, side, ua, ends);
    if (hg_texture_coarser != 0u)
        return HG_PATH_WAITS;
    if (HG_PATH_CAN(HG_PATH_GATHERS) && p.bounce == 1u)
        hg_path_add_sky(HG_PATH_GUIDE_OPEN_SKY, p.slot, 0u, behind_it);

    if (HG_PATH_CAN(HG_PATH_CATCHER) && p.bounce == 0u &&
        (hg_path_mark(hit.draw) & HG_PATH_MARK_CATCHER) != 0u) {
        p.throughput = throughput;
        return catch_shadow(p, v, s, hg_emitter_pick(v.position_ws, side, ua.xyz), ua.xyz);
    }
    if ((p.flags & HG_PATH_SEEN) == 0u)
        note_seen(p, v, s, hit);
    p.flags |= HG_PATH_SEEN;
    meet_lights(p, hit.t, arriving, around);
    // Rays to lights know of no coats: one counts where they are not the other way.
    vec3 emitted = p.pdf > 0.0 || s.unlit ? s.emissive : hg_surface_emission(s, -p.ray.direction_ws);
    emitted = emitted * weight_emitted(p, v, hit) + (s.unlit ? s.base_color : vec3(0.0));
    if (max(emitted.r, max(emitted.g, emitted.b)) > 0.0)
        hg_path_light(p.slot, p.bounce, 0u, hg_path_mark(hit.draw) & HG_PATH_GROUP_MASK,
            clamped(throughput * emitted, p.bounce));
    bool followed = HG_PATH_CAN(HG_PATH_FOLLOWS) && (p.flags & HG_PATH_FOLLOWED) != 0u;
    if (s.unlit || (p.bounce >= hg_path.max_bounces && !ends)) {
        if (followed)
            hg_features_follow(p, b, hit, medium, emitted, false);
        return HG_PATH_DONE;
    }

    if (p.bounce == 0u && push.branch == 0u && HG_PATH_HAS(HG_PATH_PLANE_GUIDE))
        note_guide(p, b, v, s);
    if (HG_PATH_CAN(HG_PATH_GATHERS) && hg_gather_leaves_out(light.e, p.bounce, ends))
        light.light = vec3(0.0);
    if (HG_PATH_CAN(HG_PATH_LAMPS) && p.bounce == 0u && hg_gather_turns(p, v.position_ws, s.geometric_normal, light.e))
        light.light = vec3(1.0);
    uint status = HG_PATH_DONE;
    bool asks = ask_light(p, b, v, s, light, false);
    status |= asks ? HG_PATH_SHADOW : 0u;
    if (HG_PATH_CAN(HG_PATH_GATHERS) && p.bounce == 0u && asks)
        hg_gather_asked(p, light.e);
    if (HG_PATH_CAN(HG_PATH_SUNS_APART) && HG_PATH_CAN(HG_PATH_GATHERS) && p.bounce == 0u) {
        status |= ask_sun(p, v, s, side, ua.xyz) ? HG_PATH_SUN : 0u;
    } else if (HG_PATH_CAN(HG_PATH_LAMPS) && p.bounce == 0u) {
        status |= hg_gather_ask_lamp(p, v.position_ws, s.geometric_normal, s.normal, hg_gather_lamp_turn(p, number), true)
            ? HG_PATH_SUN : 0u;
    } else if (HG_PATH_CAN(HG_PATH_SUNS_APART)) {
        light.e = hg_emitter_pick_apart(v.position_ws, side, ua.xyz);
        light.light = reflected(b, s, light.e, 1u, ends, light.f);
        if (HG_PATH_CAN(HG_PATH_GATHERS) && hg_gather_leaves_out(light.e, p.bounce, ends))
            light.light = vec3(0.0);
        if (ask_light(p, b, v, s, light, true))
            status |= HG_PATH_SUN;
    }
    if (ends) {
        hg_gather_end(p, hg_gather_albedo(b), v, s, ua.yzw);
        p.bounce++; // of the light that its shadow rays bring
        return status;
    }
    vec3 direction = p.ray.direction_ws;
    uint lobe;
    if (go_on(p, b, v, s, ub.xyz, ua.w, width, cone.y, lobe))
        status |= HG_PATH_LIVE;
    if (HG_PATH_CAN(HG_PATH_FOLLOWS) && p.bounce == 0u)
        hg_features_begin(p, b, v.depth, lobe, direction);
    else if (followed)
        hg_features_follow(p, b, hit, medium, emitted,
            (status & HG_PATH_LIVE) != 0u && hg_features_is_smooth(b, lobe));
    p.bounce++;
    p.flags = both ? p.flags | HG_PATH_BOTH_SIDES : p.flags & ~HG_PATH_BOTH_SIDES;
    if ((status & HG_PATH_LIVE) != 0u)
        store(p, uintBitsToFloat(packed));
    return status;
}

// A sample of what directional lights, or lamps, bring to what the camera sees, and of nothing else.
uint sunlit(inout path p, hg_gpu_hit hit, uvec2 pixel)
{
    if (hit.draw == HG_HIT_NONE)
        return HG_PATH_DONE;
    vec2 cone = hg_path_unpack_cone(hg_path_get(HG_PATH_CONE, p.slot));
    hg_vertex v = hg_fetch_hit(hit, p.ray.direction_ws, cone.x + cone.y * hit.t);
    hg_surface s = hg_material_evaluate(v);
    if (hg_texture_coarser != 0u)
        return HG_PATH_WAITS;
    bool behind = !v.front && (v.flags & HG_DRAW_DOUBLE_SIDED) == 0u;
    bool masked = (HG_MATERIAL_AT(v.material, flags) & HG_MATERIAL_MASK) != 0u && s.alpha <= 0.0;
    if (behind || masked || hg_gather_is_layer(v, s.alpha))
        return pass_by(p, hit.t);
    hg_sampler points = hg_path_step_sampler(pixel, hg_path_number(p.slot));
    points.dimension = HG_PATH_CAMERA_PAIRS + p.steps * HG_PATH_STEP_PAIRS;
    p.steps++;
    p.bounce++;
    if (s.unlit)
        return HG_PATH_DONE;
    if (HG_PATH_CAN(HG_PATH_LAMPS) && hg_path_number(p.slot) >= hg_path.gather.lamps_from)
        return ask_lamps(p, v, s);
    return ask_sun(p, v, s, s.normal, hg_sobol4(points).xyz) ? HG_PATH_SUN : HG_PATH_DONE;
}

#include "lib/path_end.glsl"

void load_state(inout path p)
{
    p.flags = 0u;
    p.throughput = vec3(1.0);
    p.pdf = 0.0;
    p.normal = vec3(0.0);
    p.media = uvec2(0u);
    if (!HG_PATH_CAN(HG_PATH_FIRST)) {
        p.flags = floatBitsToUint(hg_path_get(HG_PATH_FLAGS, p.slot));
        p.throughput = hg_path_get3(HG_PATH_THROUGHPUT, p.slot);
        p.pdf = hg_path_get(HG_PATH_PDF, p.slot);
        p.normal = hg_decode_normal(floatBitsToUint(hg_path_get(HG_PATH_NORMAL, p.slot)));
        if (HG_MEDIA)
            p.media = floatBitsToUint(vec2(hg_path_get(HG_PATH_MEDIA, p.slot),
                hg_path_get(HG_PATH_MEDIA + 1u, p.slot)));
    }
    if ((p.flags & HG_PATH_BOTH_SIDES) != 0u)
        p.normal = vec3(0.0);
    p.steps = p.flags & HG_PATH_STEPS_MASK;
    p.bounce = bitfieldExtract(p.flags, HG_PATH_BOUNCE_SHIFT, 9);
}

void main()
{
    uint i = gl_GlobalInvocationID.x;
    if (i >= push.count)
        return;
    path p;
    p.slot = push.list.v[i];
    uvec2 pixel = hg_path_pixel(p.slot);
    load_state(p);
    p.ray = hg_path.rays.v[p.slot];
    hg_path_time = p.ray.time;
    hg_gpu_hit hit = hg_path.hits.v[p.slot];
    bool none = kind == 1u || (kind == 0u && hit.draw == HG_HIT_NONE);
    if (HG_PATH_CAN(HG_PATH_FIRST)) {
        bool whole = HG_PATH_CAN(HG_PATH_SURFACES) || (none && push.branch == 0u);
        p.throughput = vec3(whole ? 1.0 : 1.0 / hg_path_branches());
    }

    uint status;
    uvec3 bits = hg_hash3(uvec3(pixel, hg_path_number(p.slot) * 1024u + p.steps +
        hg_frame.seed * 0x9e3779b1u));
    hg_texture_xi = vec2(bits.xy >> 8u) * (1.0 / 16777216.0);
    if (kind == 1u || (kind == 0u && none)) {
        // Only what is met is shaded several times; where the host knows, other slots do not come.
        bool over = HG_PATH_CAN(HG_PATH_FIRST) && kind == 0u && push.branch != 0u;
        status = over ? HG_PATH_DONE : meets_ground(p) ? ground(p, pixel) : miss(p);
    } else if (kind == 3u) {
        status = end_of_path(p, hit, pixel);
    } else if (kind == 4u) {
        status = sunlit(p, hit, pixel);
    } else {
        status = surface(p, hit, pixel);
    }
    hg_texture_report(pixel);
    hg_path.status.v[p.slot] = status;
    if (status == HG_PATH_WAITS || status == HG_PATH_FINE || (kind == 1u && (p.flags & HG_PATH_CATCHES) == 0u))
        return;
    hg_path_set(HG_PATH_FLAGS, p.slot,
        uintBitsToFloat((p.flags & ~(HG_PATH_STEPS_MASK | (HG_PATH_BOUNCE_MASK << HG_PATH_BOUNCE_SHIFT))) |
            p.steps | (p.bounce << HG_PATH_BOUNCE_SHIFT)));
}
