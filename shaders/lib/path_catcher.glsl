// path_catcher.glsl - rays to lights that say how much of their light arrives, whatever the surface is: for shadow
// catchers, the ground below the scene and directional lights of gathering paths.
//
// Part of passes/path_shade.comp.
#ifndef HG_LIB_PATH_CATCHER_GLSL
#define HG_LIB_PATH_CATCHER_GLSL

// What a light gives a white surface, luminance, and the ray that says whether it does.
float catch_light(path p, hg_vertex v, hg_surface s, hg_emitter_sample e, bool second)
{
    float cosine = max(dot(s.normal, e.direction), 0.0) * HG_INV_PI;
    vec3 radiance = hg_path_finite(e.radiance * (e.delta ? 1.0 : 1.0 / max(e.pdf, 1e-20)));
    float light = e.delta || e.pdf > 0.0 ? hg_emitter_luminance(radiance) * cosine : 0.0;
    light = dot(s.geometric_normal, e.direction) > 0.0 ? light : 0.0;
    hg_gpu_ray ray;
    ray.origin_ws = hg_hit_offset(v.position_ws, s.geometric_normal);
    ray.direction_ws = e.direction;
    ray.t_min = 0.0;
    ray.t_max = light > 0.0 ? e.distance : -1.0;
    ray.time = p.ray.time;
    ray.mask = first_mask(e);
    hg_path.shadow_rays.v[p.slot + (second ? hg_path.capacity : 0u)] = ray;
    hg_path_set3(second ? HG_PATH_PENDING_SUN : HG_PATH_PENDING, p.slot, vec3(light));
    return light;
}

// A shadow catcher in front of the background, which shows as far as light arrives: rays to lights
// tell, as they do for a white surface.
uint catch_shadow(inout path p, hg_vertex v, hg_surface s, hg_emitter_sample e, vec3 u)
{
    vec3 behind = background(p, p.ray.direction_ws) * p.throughput;
    if (hg_texture_coarser != 0u)
        return HG_PATH_WAITS;
    uint status = HG_PATH_DONE;
    float light = catch_light(p, v, s, e, false), sun = 0.0;
    status |= light > 0.0 ? HG_PATH_SHADOW : 0u;
    if (HG_PATH_CAN(HG_PATH_SUNS_APART)) {
        sun = catch_light(p, v, s, hg_emitter_pick_apart(v.position_ws, s.normal, u), true);
        status |= sun > 0.0 ? HG_PATH_SUN : 0u;
    }
    uint at = hg_path_out(hg_path.planes[HG_PATH_PLANE_CATCHER]);
    hg_path_set(at + HG_PATH_CATCHER_UNLIT, p.slot, light + sun);
    hg_path_set(at + HG_PATH_CATCHER_SAMPLES, p.slot, 1.0);
    hg_path_set3(at + HG_PATH_CATCHER_BEHIND, p.slot, behind);
    p.flags |= HG_PATH_CATCHES;
    return status;
}

// The ground below the scene, where a camera ray that met nothing else meets it.
bool meets_ground(path p)
{
    return HG_PATH_CAN(HG_PATH_CATCHER) && p.bounce == 0u && hg_frame.ground_up != vec3(0.0) &&
        hg_ground_distance(p.ray.origin_ws, p.ray.direction_ws) > 0.0;
}

uint ground(inout path p, uvec2 pixel)
{
    vec2 cone = hg_path_unpack_cone(hg_path_get(HG_PATH_CONE, p.slot));
    float t = hg_ground_distance(p.ray.origin_ws, p.ray.direction_ws);
    hg_vertex v;
    hg_surface s;
    v.position_ws = p.ray.origin_ws + t * p.ray.direction_ws;
    s.normal = s.geometric_normal = hg_frame.ground_up;
    hg_emitter_cone_width = cone.x + cone.y * t;
    hg_emitter_cone_spread = cone.y;
    hg_sampler points = hg_path_step_sampler(pixel, hg_path_number(p.slot));
    points.dimension = HG_PATH_CAMERA_PAIRS + p.steps * HG_PATH_STEP_PAIRS;
    vec4 u = hg_sobol4(points);
    return catch_shadow(p, v, s, hg_emitter_pick(v.position_ws, s.normal, u.xyz), u.xyz);
}

#endif
