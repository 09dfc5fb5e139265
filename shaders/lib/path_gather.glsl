// path_gather.glsl - paths that gather light for a real-time picture (HG_PATH_GATHERS).
//
// Define struct path, CANDIDATES, clamped, weight_found and first_mask first; include lib/path.glsl, lib/probes.glsl,
// lib/emitters.glsl and lib/path_features.glsl.
#ifndef HG_LIB_PATH_GATHER_GLSL
#define HG_LIB_PATH_GATHER_GLSL

#define HG_GATHER_ROUGH   0.3 // lobes from this roughness on are rough
#define HG_GATHER_ASKS    0.2 // where paths end, rays to lights find what lobes from this roughness on mirror
#define HG_GATHER_LAMP_TRIES 8u // lamps that are looked at for one that reaches a first surface
#define HG_GATHER_SHARP   500.0 // 1 / sr: density of directions from which on a lobe mirrors, at about a roughness of 0.1
#define HG_GATHER_FEW_BITS 4u // log2 of samples that leave noise in mirrors
#define HG_GATHER_MIRRORS 0.2 // of light from everywhere: smooth surfaces that mirror more are no ends

// Of a gathering path: light that real-time pictures draw themselves at the first surface, or that is looked
// up in the field of probes where the path ends: that of the environment.
// Lamps with a size are not among what is drawn. Directional lights are chosen apart (HG_PATH_SUNS_APART).
bool hg_gather_leaves_out(hg_emitter_sample e, uint bounce, bool ends)
{
    bool lamp = e.group == HG_EMITTER_GROUP_PUNCTUAL;
    if (ends && HG_PATH_CAN(HG_PATH_GLASS)) // not filtered: the field has the light of all but lamps
        return !lamp;
    bool drawn = bounce == 0u && lamp && e.delta && !HG_PATH_CAN(HG_PATH_LAMPS);
    return ends ? e.group == HG_EMITTER_GROUP_ENVIRONMENT : drawn;
}

// What irradiance is multiplied by where the base scatters it: as in hg_environment_brdf.
vec3 hg_gather_base_scattering(hg_brdf b)
{
    float miss = 1.0 - b.dfg_v.x - b.dfg_v.y;
    return b.diffuse * clamp(1.0 - b.f0_dielectric * b.dfg_v.x - b.dfg_v.y - b.f_ms_dielectric * miss, 0.0, 1.0);
}

// Light that scatters through the surface counts for what scatters.
bool hg_gather_scatters_through(hg_bsdf b)
{
    return HG_HAS(HG_FEATURE_DIFFUSE_TRANSMISSION) && hg_max3(b.behind) > 0.0;
}

// The same of all lobes, sheen with them: as in hg_environment_bsdf.
vec3 hg_gather_scattering(hg_bsdf b)
{
    if (HG_HAS(HG_FEATURE_LOBES)) {
        vec3 scattering = b.base.diffuse * b.enter_v;
        if (HG_HAS(HG_FEATURE_DIFFUSE_TRANSMISSION))
            scattering += b.behind * b.enter_v;
        if (HG_HAS(HG_FEATURE_SHEEN))
            scattering += b.sheen * (b.sheen_albedo_v.y * b.coat_v);
        return scattering;
    }
    return hg_gather_base_scattering(b.base);
}

// A path that met a surface after t metres ends there. Every second one goes on for a bounce more, which
// halves the error of the field; pairs of samples and pixels take turns. Mirrors and glass are no ends, as
// what they show is not what the field has about them, unless there may be no more bounces. Nor are surfaces that
// scatter light through: a lampshade has another field on each side, and is smaller than the spacing of probes.
bool hg_gather_mirrors(vec3 mirrored, float roughness)
{
    return roughness < HG_GATHER_ROUGH && hg_max3(mirrored) > HG_GATHER_MIRRORS;
}

// Frosted glass is no end either, whatever its roughness: what it lets through comes from its other side.
bool hg_gather_lets_through(hg_bsdf b, hg_surface s)
{
    return hg_gather_scatters_through(b) || (HG_HAS(HG_FEATURE_TRANSMISSION) && s.transmission > 0.0);
}

// For surfaces that are no mirrors.
bool hg_gather_ends_at(path p, float t)
{
    uint from = HG_PATH_ENDS_FROM(hg_path_sample(p.slot), p.slot, p.slot >> 1u);
    return p.bounce >= from && (p.flags & HG_PATH_WIDE) != 0u &&
        t >= hg_path.gather.reach * hg_probes_spacing(p.ray.origin_ws + t * p.ray.direction_ws);
}

// What a sharp lobe shows, by few samples: noise there is not filtered, as neighbours see other things.
bool hg_gather_is_mirrored(path p)
{
    bool sharp = (p.flags & HG_PATH_WIDE) == 0u && (p.pdf <= 0.0 || p.pdf > HG_GATHER_SHARP);
    return p.bounce > 0u && sharp && hg_path.sample_bits <= HG_GATHER_FEW_BITS;
}

bool hg_gather_ends(path p, hg_bsdf b, hg_surface s, float t)
{
    if (hg_gather_mirrors(hg_features_mirroring(b), s.roughness) || hg_gather_lets_through(b, s))
        return p.bounce >= hg_path.max_bounces;
    return p.bounce >= hg_path.max_bounces || hg_gather_is_mirrored(p) || hg_gather_ends_at(p, t);
}

// Drawn as a layer. Where nothing transmits, fragments of layers that hide all behind them are drawn as opaque ones.
bool hg_gather_is_layer(hg_vertex v, float alpha)
{
    return (v.flags & HG_DRAW_BLEND) != 0u && (HG_HAS(HG_FEATURE_TRANSMISSION) || alpha < 1.0);
}

// The surface of a camera ray that only looks for transmissive ones (HG_PATH_GLASS).
bool hg_gather_is_glass(hg_vertex v, hg_surface s)
{
    return (v.flags & HG_DRAW_BLEND) != 0u && s.transmission > 0.0;
}

// A path by way of glass ends at the first surface that neither mirrors nor lets light through.
bool hg_gather_ends_behind_glass(path p, hg_bsdf b, hg_surface s)
{
    bool through = s.transmission > 0.0 || s.diffuse_transmission > 0.0;
    return p.bounce > 0u && !through && !hg_gather_mirrors(hg_features_mirroring(b), s.roughness);
}

#define GLASS_FAINT 0.3 // throughput of paths that glass mirrored inside,
#define GLASS_AGAIN 0.2 // and the least chance that it does so again

// At the first surfaces of clear glass samples take turns between what it mirrors and what it lets through: every
// second one, then every fourth one is mirrored, whatever Fresnel's share. That is small, and what is mirrored may be
// bright: by chance it would be specks. So would be what it mirrors inside more than once, which faint paths find.
// Moves u.z to where that lobe is chosen; returns the chance of it, 0: u decides.
float hg_gather_take_turn(path p, hg_bsdf b, inout vec3 u)
{
    uint number = hg_path_sample(p.slot);
    float p_reflect = hg_bsdf_facet(b, b.v_ts.z).p_reflect;
    bool splits = b.delta && b.transmission > 0.0 && b.p_specular > 0.999 && p_reflect > 0.0 && p_reflect < 1.0;
    if (splits && p.bounce > 1u && hg_max3(p.throughput) < GLASS_FAINT) {
        float chance = clamp(p_reflect, GLASS_AGAIN, 1.0 - GLASS_AGAIN);
        bool again = u.z < chance;
        u.z = b.p_specular * 0.5 * (again ? p_reflect : 1.0 + p_reflect);
        return again ? chance : 1.0 - chance;
    }
    if (!splits || hg_path.sample_bits < 1u + 2u * p.bounce)
        return 0.0;
    bool mirrors = p.bounce == 0u ? (number & 1u) == 0u : ((number >> (2u * p.bounce - 1u)) & 3u) == 0u;
    float often = p.bounce == 0u ? 0.5 : 0.25;
    u.z = b.p_specular * 0.5 * (mirrors ? p_reflect : 1.0 + p_reflect);
    return mirrors ? often : 1.0 - often;
}

// What the environment would send along the ray to the surface that it left, had it met nothing.
vec3 hg_gather_behind(path p)
{
    vec3 d = p.ray.direction_ws;
    float other = hg_emitter_pdf_environment(p.ray.origin_ws, p.normal, d);
    return clamped(p.throughput * hg_emitter_environment(d) * weight_found(p, other, CANDIDATES), p.bounce);
}

// The first ray that left a first surface met nothing.
void hg_gather_saw_sky(path p, vec3 light)
{
    hg_path_add_sky(HG_PATH_GUIDE_OPEN_SKY, p.slot, 0u, light);
    hg_path_add_sky(HG_PATH_GUIDE_SEEN_SKY, p.slot, 0u, light);
}

// Every second sample that chose a lamp without a size asks for one of all of them in turn: where the brightest
// are hidden the light of others is all there is. That there is one counts, not how bright it is. True where it does.
bool hg_gather_turns(path p, vec3 position_ws, vec3 normal, inout hg_emitter_sample e)
{
    uint count = HG_EMITTERS.leaf_count - HG_EMITTERS.first_lamp_leaf, number = hg_path_sample(p.slot);
    uvec2 pixel = hg_path_pixel(p.slot); // may have one sample
    if (e.group != HG_EMITTER_GROUP_PUNCTUAL || !e.delta || (number + pixel.x + pixel.y) % 2u == 0u)
        return false;
    uint turn = (number / 2u + pixel.x / 2u + 3u * pixel.y) % count;
    hg_emitter_sample other =
        hg_emitter_light(HG_EMITTERS.directional_count + turn, 1.0, position_ws, vec2(0.5));
    bool faces = other.delta && dot(normal, other.direction) > 0.0;
    if (faces)
        e = other;
    return faces;
}

// Whether the first surface sees a lamp without a size, by a ray to it: one of all in turn, or the next one of those
// that reach it. True when there is one.
bool hg_gather_ask_lamp(inout path p, vec3 position_ws, vec3 geometric_normal, vec3 normal, uint turn, bool second)
{
    uint count = HG_EMITTERS.leaf_count - HG_EMITTERS.first_lamp_leaf, tries = min(count, HG_GATHER_LAMP_TRIES);
    hg_emitter_sample e = hg_emitter_nothing();
    bool found = false;
    for (uint i = 0u; i < tries && !found; i++) {
        e = hg_emitter_light(HG_EMITTERS.directional_count + (turn + i) % count, 1.0, position_ws, vec2(0.5));
        found = e.delta && min(dot(normal, e.direction), dot(geometric_normal, e.direction)) > 0.0;
    }
    hg_gpu_ray ray;
    ray.origin_ws = hg_hit_offset(position_ws, geometric_normal);
    ray.direction_ws = e.direction;
    ray.t_min = 0.0;
    ray.t_max = found ? e.distance : -1.0;
    ray.time = p.ray.time;
    ray.mask = first_mask(e);
    hg_path.shadow_rays.v[p.slot + (second ? hg_path.capacity : 0u)] = ray;
    hg_path_set3(second ? HG_PATH_PENDING_SUN : HG_PATH_PENDING, p.slot, vec3(1.0));
    if (!found)
        return false;
    uint lamp = HG_GATHERED_LAMP(e.draw);
    if (second)
        hg_path_set(hg_path.split + HG_PATH_SPLIT_SUN, p.slot, float(lamp + 1u));
    else
        p.flags = bitfieldInsert(p.flags, lamp, HG_PATH_LAMP_SHIFT, 4) | HG_PATH_ASKS_LAMP;
    hg_path_add(hg_path_out(hg_path.planes[HG_PATH_PLANE_LAMPS] + lamp), p.slot, 1.0);
    return true;
}

// Whose turn it is.
uint hg_gather_lamp_turn(path p, uint number)
{
    uvec2 pixel = hg_path_pixel(p.slot);
    return number + pixel.x + 2u * pixel.y;
}

// The first surface has a shadow ray to a light: what may stop it is not known yet. Of lamps without a size
// only that is of interest.
void hg_gather_asked(inout path p, hg_emitter_sample e)
{
    if (HG_PATH_CAN(HG_PATH_LAMPS) && e.group == HG_EMITTER_GROUP_PUNCTUAL && e.delta) {
        uint lamp = HG_GATHERED_LAMP(e.draw);
        p.flags = bitfieldInsert(p.flags, lamp, HG_PATH_LAMP_SHIFT, 4) | HG_PATH_ASKS_LAMP;
        hg_path_set3(HG_PATH_PENDING, p.slot, vec3(1.0));
        hg_path_add(hg_path_out(hg_path.planes[HG_PATH_PLANE_LAMPS] + lamp), p.slot, 1.0);
    }
    if (e.group != HG_EMITTER_GROUP_ENVIRONMENT)
        return;
    p.flags |= HG_PATH_ASKS_SKY;
    hg_path_add_sky(HG_PATH_GUIDE_OPEN_SKY, p.slot, 1u, hg_path_get3(HG_PATH_PENDING, p.slot));
}

// Of light from everywhere what a surface sends back, mirrored or scattered.
vec3 hg_gather_albedo(hg_bsdf b)
{
    return min(hg_gather_scattering(b) + hg_features_mirroring(b), vec3(1.0));
}

// The light of the field of probes on a surface with this albedo ends the path; rays to lights bring that of emitters,
// which changes within less than the spacing of probes.
void hg_gather_end(path p, vec3 albedo, hg_vertex v, hg_surface s, vec3 xi)
{
    vec3 view = -p.ray.direction_ws;
    hg_probes_look(v.position_ws, s.geometric_normal, s.normal, view, reflect(-view, s.normal), xi);
    hg_path_light(p.slot, p.bounce + 1u, 0u, HG_EMITTER_GROUP_ENVIRONMENT,
        clamped(p.throughput * albedo * hg_probes_irradiance, p.bounce + 1u));
}

#endif
