// path_end.glsl - where gathering paths end (HG_PATH_GATHERS): surfaces far away that a rough lobe found.
//
// Much less is to be known there than of surfaces that a path goes on from: all light is scattered, by the albedo of
// all lobes together, and normal maps are left out. Devices that run both sides of branches have half the work by that,
// in a kernel of its own. Surfaces with more than that (holes, layers, media, mirrors) are left to the other one.
//
// Part of passes/path_shade.comp.
#ifndef HG_LIB_PATH_END_GLSL
#define HG_LIB_PATH_END_GLSL

light_choice end_candidate(vec3 albedo, hg_vertex v, hg_surface s, vec3 u)
{
    light_choice c;
    c.e = hg_emitter_pick(v.position_ws, s.normal, u);
    c.f = scattered(albedo, s, c.e);
    c.light = weighted(s, c.e, c.f, 0.0, CANDIDATES);
    if (hg_gather_leaves_out(c.e, 1u, true))
        c.light = vec3(0.0);
    return c;
}

// Shadow rays; returns the bits of the status.
uint end_lights(path p, vec3 albedo, hg_vertex v, hg_surface s, vec4 u)
{
    uint status = HG_PATH_DONE;
    if (HG_EMITTER_MAY(HG_EMITTER_KIND_TREE)) { // all others are in the field, or chosen apart
        light_choice c = end_candidate(albedo, v, s, u.xyz);
        c = one_of(c, end_candidate(albedo, v, s, fract(u.xyz + 0.5)), u.w);
        status |= ask(p, v, s, c.e, c.light, false) ? HG_PATH_SHADOW : 0u;
    }
    if (HG_PATH_CAN(HG_PATH_SUNS_APART)) {
        hg_emitter_sample e = hg_emitter_pick_apart(v.position_ws, s.normal, u.xyz);
        vec3 light = weighted(s, e, scattered(albedo, s, e), 0.0, 1u);
        status |= ask(p, v, s, e, light, true) ? HG_PATH_SUN : 0u;
    }
    return status;
}

// The surface has nothing but a base that is no mirror.
bool end_suits(hg_vertex v)
{
    uint flags = HG_MATERIAL_AT(v.material, flags);
    bool lobes = HG_HAS(HG_FEATURE_LOBES) && HG_MATERIAL_AT(v.material, lobes) != 0u;
    return (flags & (HG_MATERIAL_BLEND | HG_MATERIAL_MASK)) == 0u && !lobes;
}

uint end_of_path(inout path p, hg_gpu_hit hit, uvec2 pixel)
{
    bool media = HG_MEDIA && p.media != uvec2(0u);
    if (hit.draw == HG_HIT_NONE || media || !hg_gather_ends_at(p, hit.t))
        return HG_PATH_FINE;
    vec2 cone = hg_path_unpack_cone(hg_path_get(HG_PATH_CONE, p.slot));
    float width = cone.x + cone.y * hit.t;
    hg_vertex v = hg_fetch_hit(hit, p.ray.direction_ws, width);
    if (!end_suits(v))
        return HG_PATH_FINE;
    vec3 view = -p.ray.direction_ws;
    hg_surface s = hg_material_evaluate(v);
    hg_bend_normals(s, view);
    if (hg_texture_coarser != 0u)
        return HG_PATH_WAITS;
    hg_brdf b = hg_surface_brdf(s, view);
    vec3 mirrored = hg_specular_albedo(b.f0, b.f_ms, b.dfg_v);
    if (s.unlit || hg_gather_mirrors(mirrored, s.roughness))
        return HG_PATH_FINE;
    if (!v.front && (v.flags & HG_DRAW_DOUBLE_SIDED) == 0u)
        s.emissive = vec3(0.0);

    vec3 behind = p.bounce == 1u ? hg_gather_behind(p) : vec3(0.0);
    hg_emitter_cone_width = width;
    hg_emitter_cone_spread = cone.y;
    hg_sampler points = hg_path_step_sampler(pixel, hg_path_number(p.slot));
    points.dimension = HG_PATH_CAMERA_PAIRS + p.steps * HG_PATH_STEP_PAIRS;
    vec4 u = hg_sobol4(points);
    vec3 albedo = min(hg_gather_base_scattering(b) + mirrored, vec3(1.0));
    uint status = end_lights(p, albedo, v, s, u);
    vec3 emitted = HG_HAS(HG_FEATURE_EMITS) ? s.emissive * weight_emitted(p, v, hit) : vec3(0.0);
    if (hg_texture_coarser != 0u) // of what emits, or of the environment
        return HG_PATH_WAITS;

    if (p.bounce == 1u)
        hg_path_add_sky(HG_PATH_GUIDE_OPEN_SKY, p.slot, 0u, behind);
    meet_lights(p, hit.t, p.throughput, p.media);
    if (hg_max3(emitted) > 0.0)
        hg_path_light(p.slot, p.bounce, 0u, hg_path_mark(hit.draw) & HG_PATH_GROUP_MASK,
            clamped(p.throughput * emitted, p.bounce));
    hg_gather_end(p, albedo, v, s, u.yzw);
    p.steps++;
    p.bounce++; // of the light that its shadow rays bring
    return status;
}

#endif
