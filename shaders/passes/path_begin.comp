// Camera rays of a wave.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#extension GL_EXT_buffer_reference2 : require

#include "lib/frame.glsl"
#include "lib/clip.glsl"
#include "lib/path.glsl"
#include "lib/sampling.glsl"

layout(local_size_x = HG_PATH_GROUP) in;

// Place in the filter: its weight is in how often places come.
// Source: Ernst, Stamminger and Greiner 2006, "Filter Importance Sampling".
float filter_offset(float u)
{
    float at = u * float(HG_PATH_FILTER_STEPS);
    uint i = min(uint(at), HG_PATH_FILTER_STEPS - 1u);
    return mix(hg_path.filter_px[i], hg_path.filter_px[i + 1u], at - float(i));
}

// Source: Shirley and Chiu 1997, "A Low Distortion Map Between Disk and Square".
vec2 disk(vec2 u)
{
    vec2 p = 2.0 * u - 1.0;
    bool wide = abs(p.x) > abs(p.y);
    float r = wide ? p.x : p.y, ratio = r != 0.0 ? (wide ? p.y : p.x) / r : 0.0;
    float angle = ratio * (0.25 * HG_PI);
    return r * (wide ? vec2(cos(angle), sin(angle)) : vec2(sin(angle), cos(angle)));
}

void main()
{
    uint i = gl_GlobalInvocationID.x;
    if (i >= push.count)
        return;
    uint slot = push.list.v[i];
    uvec2 pixel = hg_path_pixel(slot);
    bool inside = pixel.x < hg_frame.width && pixel.y < hg_frame.height;
    hg_sampler s = hg_path_sampler(pixel, hg_path_sample(slot));
    vec2 u = hg_sobol2(s), lens = disk(hg_sobol2(s));
    vec2 at = vec2(pixel) + 0.5;
    if (HG_PATH_CAN(HG_PATH_SPLATS))
        at += vec2(hg_path.splat_offset[0], hg_path.splat_offset[1]);
    else
        at += vec2(filter_offset(u.x), filter_offset(u.y));
    vec3 from = hg_frame.camera.ray_origin_ws;
    vec3 x = hg_frame.camera.ray_x_ws, y = hg_frame.camera.ray_y_ws;
    vec3 lens_x = hg_path.lens_x_ws, lens_y = hg_path.lens_y_ws;
    if (HG_PATH_CAN(HG_PATH_BLURS)) {
        s.dimension = HG_PATH_TIME_PAIR;
        hg_path_time = hg_sobol2(s).x;
        from = HG_PATH_BETWEEN(hg_path.moments[HG_PATH_OPENING].ray_origin_ws,
            hg_path.moments[HG_PATH_CLOSING].ray_origin_ws);
        x = HG_PATH_BETWEEN(hg_path.moments[HG_PATH_OPENING].ray_x_ws,
            hg_path.moments[HG_PATH_CLOSING].ray_x_ws);
        y = HG_PATH_BETWEEN(hg_path.moments[HG_PATH_OPENING].ray_y_ws,
            hg_path.moments[HG_PATH_CLOSING].ray_y_ws);
        lens_x = length(lens_x) * normalize(x);
        lens_y = -length(lens_y) * normalize(y);
    }
    vec3 across = from + at.x * x + at.y * y;
    vec3 forward = hg_path_forward();

    hg_gpu_ray ray;
    float width = hg_frame.camera.pixel_size, spread = 0.0;
    if (hg_frame.camera.orthographic != 0u) {
        ray.origin_ws = across;
        ray.direction_ws = forward;
    } else { // `across` is 1 deep
        vec3 off = lens.x * lens_x + lens.y * lens_y;
        ray.origin_ws = hg_path_eye() + off;
        ray.direction_ws = normalize(across - off / hg_path.focus_distance);
        width = 0.0;
        spread = hg_frame.camera.pixel_angle * dot(ray.direction_ws, forward);
    }
    float along = max(dot(ray.direction_ws, forward), 1e-6);
    ray.t_min = max(hg_frame.camera.near, 0.0) / along;
    ray.t_max = hg_frame.camera.far > 0.0 ? hg_frame.camera.far / along : 1e30;
    if (hg_frame.camera.orthographic != 0u) { // planes may lie behind the eye
        ray.origin_ws += forward * hg_frame.camera.near;
        ray.t_min = 0.0;
        ray.t_max = hg_frame.camera.far - hg_frame.camera.near;
    }
    hg_clip_ray(ray.origin_ws, ray.direction_ws, ray.t_min, ray.t_max);
    if (!inside)
        ray.t_max = -1.0;
    ray.time = HG_PATH_CAN(HG_PATH_BLURS) ? hg_path_time : 0.0;
    ray.mask = HG_RAY_ALL;
    hg_path.rays.v[slot] = ray;
    hg_path.status.v[slot] = inside ? HG_PATH_LIVE : HG_PATH_DONE;

    // The rest of the state is known to HG_PATH_FIRST; the host has cleared what the film adds up.
    hg_path_set(HG_PATH_CONE, slot, hg_path_pack_cone(width * hg_path.footprint, spread * hg_path.footprint));
}
