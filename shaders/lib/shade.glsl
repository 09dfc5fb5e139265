// shade.glsl - all of shade*.frag, which differ in where words of the frame come from (lib/flat.glsl)
// and in whether materials may have lobes besides metallic-roughness.
#ifndef HG_LIB_SHADE_GLSL
#define HG_LIB_SHADE_GLSL

// 0 opaque, 1 opaque behind layers, 2 nearest layer, 3 opaque, to be seen through layers, 4 all layers
layout(constant_id = 0) const uint hg_variant = 0u;
// 0: radiance, to be accumulated; else a picture at once, with the curve of this number less one.
layout(constant_id = 4) const uint hg_picture = 0u;
layout(constant_id = 3) const bool hg_background = false; // where nothing is; the depth test chooses

#define HG_TEXTURE_STOCHASTIC     true
#define HG_TEXTURE_NOTE           true
#define HG_ENVIRONMENT_STOCHASTIC true
#define HG_ENVIRONMENT_PROBES

// Mips of normal maps say how rough they are; finer ones would be grain that takes more samples.
#define HG_MATERIAL_COARSE_NORMALS HG_HAS2(HG_FEATURE2_GATHERED)

#include "lib/frame.glsl"
#include "lib/blend.glsl"
#include "lib/tables.glsl"
#ifdef HG_FRAME_FLAT
#include "lib/flat.glsl"
#endif
#include "lib/vertex.glsl"
#include "lib/triangle_cache.glsl"
#include "lib/texture.glsl"
#include "lib/material.glsl"
#include "lib/brdf.glsl"
#ifndef HG_NO_LOBES
#include "lib/bsdf.glsl"
#endif
#include "lib/shading_normal.glsl"
#include "lib/light.glsl"
#include "lib/environment.glsl"
#include "lib/ground.glsl"
#include "lib/resolve.glsl"
#include "shared/checkerboard.h"
#include "shared/pass_io.h"

// hg_front of layers is the opaque scene. Its alpha is how deep it lies, metres, or NOTHING; with a minus where
// the sample is not as it will be.
HG_SHADE_IO(HG_IO_DECLARE)
#define NOTHING 1e30

#include "lib/gathered.glsl"
#include "lib/probe_light.glsl"
#include "lib/mirrors.glsl"
#ifndef HG_NO_LOBES
#include "lib/glass.glsl"
#endif

layout(early_fragment_tests) in; // also where samples are counted
layout(location = 0) out vec4 out_color;

vec2 hg_at; // centre of the pixel that is shaded
vec2 shaded_pixel()
{
    uvec2 at = uvec2(gl_FragCoord.xy);
    if (HG_HAS2(HG_FEATURE2_CHECKERBOARD) && (hg_frame.flags & HG_FRAME_CHECKERBOARD) != 0u)
        return vec2(HG_CHECKERBOARD_COLUMN(at, hg_frame.sample_index, hg_frame.width), at.y) + 0.5;
    return gl_FragCoord.xy;
}

vec4 behind_all()
{
    if (HG_BACKGROUND_IS_CLEAR(hg_frame.background_mode) && hg_variant < 3u)
        return vec4(0.0);
    if (hg_frame.background_mode == HG_BACKGROUND_MODE_COLOR)
        return vec4(hg_frame.background_color, 1.0);
    vec3 ray = hg_frame.camera.forward_ws;
    if (hg_frame.camera.orthographic == 0u)
        ray = hg_frame.camera.ray_origin_ws + hg_at.x * hg_frame.camera.ray_x_ws +
            hg_at.y * hg_frame.camera.ray_y_ws;
    if (hg_frame.background_mode == HG_BACKGROUND_MODE_BLUR)
        return vec4(hg_environment_blurred(ray), 1.0);
    // Off the middle a pixel is a smaller angle; `ray` is 1 deep.
    float lod = 0.0;
    if (HG_HAS(HG_FEATURE_SKY_MIPS)) {
        hg_texture_xi = hg_random3(uvec2(hg_at), 1u).xy;
        lod = hg_frame.textures.background_lod - 0.5 * log2(dot(ray, ray));
    }
    return vec4(hg_environment_seen(ray, lod), 1.0);
}

// The background with the shadow on the ground.
vec4 background()
{
    vec4 color = behind_all();
    if (!HG_HAS2(HG_FEATURE2_GROUND) || hg_frame.ground_up == vec3(0.0))
        return color;
    bool flat_view = hg_frame.camera.orthographic != 0u;
    vec3 across = hg_frame.camera.ray_origin_ws + hg_at.x * hg_frame.camera.ray_x_ws +
        hg_at.y * hg_frame.camera.ray_y_ws;
    vec3 from = flat_view ? across : hg_frame.camera.eye_ws;
    vec3 ray = flat_view ? hg_frame.camera.forward_ws : across;
    float depth = hg_ground_distance(from, ray); // both rays are 1 deep
    if (!(depth > 0.0))
        return color;
    float lit = hg_ground_lit(from + depth * ray, hg_at, depth);
    color.rgb *= lit;
    color.a = 1.0 - (1.0 - color.a) * lit;
    return color;
}

// What is near occludes the reflected environment, and what a material says of the same is not taken twice.
void occlude(inout hg_surface s, float n_dot_v, float alpha)
{
    hg_probes_sky *= hg_specular_occlusion(n_dot_v, hg_probe_light_open, alpha);
    s.occlusion = min(s.occlusion / max(hg_probe_light_open, 0.01), 1.0);
}

#ifndef HG_NO_LOBES
// Metres of the world per unit of an instance's own space.
float hg_world_scale(uint instance)
{
    mat4x3 m = hg_world_at(instance);
    return pow(abs(determinant(mat3(m))), 1.0 / 3.0);
}

// Perceptual roughness of the mirror lobe that is as wide as the one behind the surface: refraction
// widens by eta - 1 over eta times what facets tilt, reflection by twice that.
float hg_refracted_roughness(hg_bsdf b)
{
    float width = b.thin ? 1.0 : clamp(2.0 * abs(b.eta - 1.0) / max(b.eta, 1.0), 0.0, 1.0);
    return sqrt(b.base.roughness * b.base.roughness * width);
}

// Where something is at the centre of a pixel.
vec3 position_at(ivec2 pixel, float depth)
{
    vec2 at = vec2(pixel) + 0.5;
    vec3 ray = hg_frame.camera.ray_origin_ws + at.x * hg_frame.camera.ray_x_ws +
        at.y * hg_frame.camera.ray_y_ws;
    return hg_frame.camera.orthographic != 0u ? ray + hg_frame.camera.forward_ws * depth
                                              : hg_frame.camera.eye_ws + ray * depth;
}

#define FAR 1e4 // metres
// The pixel that has a point; false: it is not in the picture.
bool pixel_of(vec3 position_ws, out ivec2 pixel)
{
    vec4 clip = hg_frame.camera.view_proj * vec4(position_ws - hg_frame.camera.eye_ws, 0.0) + hg_frame.camera.proj[3];
    vec2 at = (clip.xy / max(clip.w, 1e-6) * 0.5 + 0.5) * vec2(hg_frame.width, hg_frame.height);
    pixel = ivec2(at);
    return clip.w > 0.0 && all(greaterThanEqual(at, vec2(0.0))) &&
        all(lessThan(at, vec2(hg_frame.width, hg_frame.height)));
}

// Radiance of what lies behind a layer's point, in a direction that was bent there, and after
// `inside` metres of it leads on along `out_ws`: the opaque scene as this view has it, as far away as it is at
// this pixel; with `spread`, for directions that differ much from pixel to pixel, as far as it is where they lead to.
// Where the view does not have it, the environment, or what probes say that were looked at there.
vec3 behind(vec3 position_ws, vec3 in_ws, float inside, vec3 out_ws, float roughness, bool spread)
{
    ivec2 here = ivec2(hg_at), from = here, at;
    vec3 leaves = position_ws + in_ws * inside;
    bool found = !spread || pixel_of(leaves + out_ws * FAR, from);
    float deep = texelFetch(hg_front, found ? from : here, 0).a;
    float reach = abs(deep) < NOTHING ? max(dot(position_at(from, abs(deep)) - leaves, out_ws), 0.0) : FAR;
    bool seen = pixel_of(leaves + out_ws * reach, at) && found;
    vec4 color = texelFetch(hg_front, seen ? at : here, 0);
    if (HG_HAS(HG_FEATURE_STREAM) && min(deep, color.a) < 0.0)
        hg_texture_coarser = max(hg_texture_coarser, 1u);
    // Rejects background samples that lie in front of the layer.
    float own = dot(position_ws - hg_frame.camera.eye_ws, hg_frame.camera.forward_ws);
    if (abs(color.a) < own)
        color = texelFetch(hg_front, here, 0);
    return seen ? color.rgb : hg_environment_reflected(out_ws, roughness);
}

// Radiance of a transmissive surface that paths brought (HG_FEATURE2_GLASS), of the pixel or one beside it. a 0: none.
vec4 by_way_of_glass(ivec2 pixel)
{
    ivec2 last = ivec2(hg_frame.width, hg_frame.height) - 1;
    vec4 sum = vec4(0.0);
    for (int i = 0; i < 5; i++) {
        ivec2 off = i == 0 ? ivec2(0) : (i & 1) == 0 ? ivec2(i - 3, 0) : ivec2(0, i - 2);
        sum += (i == 0 ? 1.0 : 1e-3) * texelFetch(hg_mirrored, clamp(pixel + off, ivec2(0), last), 0);
    }
    return vec4(sum.rgb / max(sum.a, 1e-6), sum.a);
}

// Facets of rough glass that bend what is seen in this sample.
uint transmitted_taps(hg_bsdf b)
{
    if (b.base.roughness < HG_DELTA_ROUGHNESS)
        return 1u;
    return hg_frame.sample_index == 0u ? 8u : (hg_frame.flags & HG_FRAME_MOTION) != 0u ? 4u : 1u;
}

// Light that comes through the surface from what lies behind it. Facets of a sample are of the R2 sequence (Roberts
// 2018), from a random place on.
vec3 transmitted(hg_bsdf b, hg_surface s, hg_vertex v)
{
    if (b.transmission <= 0.0)
        return vec3(0.0);
    float thickness = b.thin ? 0.0 : s.thickness * hg_world_scale(v.instance);
    float roughness = hg_refracted_roughness(b), eta = max(b.eta, 1.0001);
    vec3 straight = -b.base.v, sum = vec3(0.0);
    if (!b.thin)
        hg_refract(b.base.v, b.base.n, eta, straight);
    if (HG_HAS2(HG_FEATURE2_PROBES)) // rooms do not show the environment outside of them
        hg_probes_look(v.position_ws + straight * thickness, -b.base.v, -b.base.v, -b.base.v, -b.base.v,
            hg_random3(uvec2(gl_FragCoord.xy), 14u));
    uint taps = transmitted_taps(b), tap = 0u;
    bool spread = taps > 1u && (hg_frame.flags & HG_FRAME_MOTION) != 0u;
    vec2 first_xi = hg_random3(uvec2(hg_at), 3u).xy;
    do {
        vec2 xi = fract(first_xi + float(tap) * vec2(0.754877666, 0.569840296));
        vec3 h = hg_sample_aniso_vndf(b.v_ts, b.alpha, xi);
        h = b.base.roughness < HG_DELTA_ROUGHNESS ? vec3(0.0, 0.0, 1.0) : h;
        vec3 l = vec3(2.0 * dot(b.v_ts, h) * h.xy - b.v_ts.xy, 0.0);
        l.z = -abs(2.0 * dot(b.v_ts, h) * h.z - b.v_ts.z);
        if (!b.thin)
            hg_refract(b.v_ts, h, eta, l);
        vec3 l_ws = normalize(b.t * l.x + b.s * l.y + b.base.n * l.z);
        // It leaves the other side as it came, but for what the facet turned it.
        vec3 out_ws = normalize((l_ws - straight) * (b.thin ? 1.0 : eta) - b.base.v);
        sum += behind(v.position_ws, l_ws, thickness, out_ws, roughness, spread);
    } while (++tap < taps);
    vec3 mean = hg_bsdf_mean_reflectance(
        b, hg_bsdf_cosine(b, b.v_ts), b.base.dfg_v, b.eta, b.inside).dielectric;
    vec3 e = hg_bsdf_dielectric_albedo(b, mean, b.base.dfg_v, 1.0);
    vec3 tinted = b.tint * hg_bsdf_attenuation(b.attenuation, thickness) * sum;
    if (HG_HAS2(HG_FEATURE2_GLASS_RAYS))
        tinted = mix(tinted, b.tint * hg_glass_behind * float(taps), hg_glass_share);
    return tinted * max(1.0 - e - b.glass_v * b.glass_front, 0.0) *
        (b.transmission * b.through_v / float(taps));
}

// hg_bsdf of all lobes, and the light of the whole scene on it.
vec3 lobes(hg_surface s, hg_vertex v, vec3 view)
{
    hg_bsdf b = hg_bsdf_make(s, view, 1.0);
    if (HG_HAS2(HG_FEATURE2_GATHERED)) {
        hg_gathered_look(hg_at, v.depth, b.base.n);
        s.occlusion = 1.0;
        // What was gathered is over the albedo of both sides together.
        hg_probes_behind = hg_probes_irradiance;
        hg_light_by_maps = HG_HAS(HG_FEATURE_DIFFUSE_TRANSMISSION) && hg_max3(b.behind) > 0.0;
    } else if (HG_HAS2(HG_FEATURE2_PROBE_LIGHT)) {
        hg_probe_light_look(hg_at, v.depth, b.base.n);
        occlude(s, b.base.n_dot_v, b.base.alpha);
        if (HG_HAS2(HG_FEATURE2_MIRRORS))
            hg_mirrors_look(hg_at, v.position_ws, v.depth, b.base.n, b.base.roughness);
    } else if (HG_HAS2(HG_FEATURE2_PROBES)) {
        vec3 xi = hg_random3(uvec2(hg_at), 15u);
        vec3 r = reflect(-view, b.base.n);
        if (HG_HAS(HG_FEATURE_DIFFUSE_TRANSMISSION)) {
            hg_probes_look(v.position_ws, -s.geometric_normal, -b.base.n, -view, r, xi);
            hg_probes_behind = hg_probes_irradiance;
        }
        hg_probes_look(v.position_ws, s.geometric_normal, b.base.n, view, r, xi);
    }
    b.delta = b.coat_delta = false; // highlights of point lights are to be seen
    if (HG_HAS2(HG_FEATURE2_GLASS) && HG_HAS(HG_FEATURE_TRANSMISSION) && b.transmission > 0.0) {
        vec4 glass = by_way_of_glass(ivec2(gl_FragCoord.xy));
        hg_light_gathered = true;
        hg_light_bsdf = b;
        if (glass.a > 0.0)
            return glass.rgb +
                hg_light_brdf(b.base, v.position_ws, s.geometric_normal, gl_FragCoord.xy, v.depth);
        hg_light_gathered = false;
    }
    if (HG_HAS2(HG_FEATURE2_GLASS_RAYS) && b.transmission > 0.0) {
        hg_glass_look(hg_at, b.base.roughness);
        hg_probes_sky = mix(hg_probes_sky, hg_glass_sky, hg_glass_share);
        hg_probes_surfaces = mix(hg_probes_surfaces, hg_glass_mirrored, hg_glass_share);
    }
    vec3 radiance = hg_bsdf_emission(b, s.emissive);
    radiance += hg_environment_bsdf(b, s.occlusion, hg_random3(uvec2(hg_at), 2u).xy);
    if (HG_HAS(HG_FEATURE_TRANSMISSION))
        radiance += transmitted(b, s, v);
    hg_light_bsdf = b;
    return radiance +
        hg_light_brdf(b.base, v.position_ws, s.geometric_normal, hg_at, v.depth);
}

#endif

vec4 surface(uvec2 id, out float depth)
{
    // One bilinear lookup per texture and sample. The first sample, which is what moving pictures
    // show, chooses between mips only; later ones spread along the footprint as well, so that the
    // accumulated image is filtered anisotropically.
    vec3 xi = hg_random3(uvec2(hg_at), 1u);
    hg_texture_xi = xi.xy;
    hg_environment_xi = xi.z;
    if (hg_frame.sample_index == 0u)
        hg_texture_most_taps = 1.0;
#ifndef HG_NO_LOBES
    if (HG_HAS(HG_FEATURE_LOBE_TEXTURES) && HG_HAS(HG_FEATURE_STREAM))
        hg_texture_drawn = hg_texture_draws(uvec2(hg_at));
#endif
    // Lanes beside what is seen load too on some devices, and where nothing was drawn id is 0.
    id.x = max(id.x, 1u);
    hg_vertex v = hg_fetch_surface(id.x - 1u, id.y, hg_at);
    depth = v.depth;
    if (HG_HAS2(HG_FEATURE2_GATHERED))
        hg_texture_share = hg_frame_footprint();
    hg_surface s = hg_material_evaluate(v);
    float alpha = hg_variant == 2u || hg_variant == 4u ? s.alpha : 1.0;
    if (s.unlit)
        return vec4(s.base_color + s.emissive, 1.0) * alpha;
    vec3 view = -hg_frame.camera.forward_ws;
    if (hg_frame.camera.orthographic == 0u)
        view = normalize(hg_frame.camera.eye_ws - v.position_ws);
    if (HG_HAS2(HG_FEATURE2_GATHERED))
        hg_bend_normals(s, view);
#ifndef HG_NO_LOBES
    if (HG_HAS(HG_FEATURE_LOBES))
        return vec4(lobes(s, v, view), 1.0) * alpha;
#endif
    hg_brdf b = hg_brdf_make(s.base_color, s.metallic, s.roughness, s.f0, s.normal, view);
    if (HG_HAS2(HG_FEATURE2_GATHERED)) {
        hg_gathered_look(hg_at, v.depth, b.n);
        s.occlusion = 1.0;
    } else if (HG_HAS2(HG_FEATURE2_PROBE_LIGHT)) {
        hg_probe_light_look(hg_at, v.depth, b.n);
        occlude(s, b.n_dot_v, b.alpha);
        if (HG_HAS2(HG_FEATURE2_MIRRORS))
            hg_mirrors_look(hg_at, v.position_ws, v.depth, b.n, b.roughness);
    } else if (HG_HAS2(HG_FEATURE2_PROBES)) {
        hg_probes_look(v.position_ws, s.geometric_normal, b.n, view, reflect(-view, b.n),
            hg_random3(uvec2(hg_at), 15u));
    }
    vec3 radiance = s.emissive + hg_environment_brdf(b, s.occlusion);
    radiance += hg_light_brdf(b, v.position_ws, s.geometric_normal, hg_at, v.depth);
    return vec4(radiance, 1.0) * alpha;
}

// One broken or boundless sample must not spoil the mean.
vec4 bounded(vec4 color)
{
    color = clamp(color, 0.0, 65504.0);
    return any(isnan(color)) ? vec4(0.0, 0.0, 0.0, 1.0) : color;
}

// The layers of a pixel, front to back, premultiplied. What lies behind a surface that hides it all is
// not looked at.
vec4 layers(ivec2 pixel)
{
    uint at = hg_blend_head(uvec2(pixel));
    vec4 front = vec4(0.0);
    // Helper invocations may have an old list, which is beyond the area.
    for (uint left = uint(HG_BLEND_MAX_LAYERS); at != 0u && front.a < 1.0 && left > 0u; left--) {
        uvec2 id = uvec2(hg_frame.blend.nodes.v[at].draw, hg_frame.blend.nodes.v[at].primitive);
        float depth;
        hg_texture_forget();
        vec4 color = bounded(surface(id, depth));
        if (HG_HAS(HG_FEATURE_STREAM)) {
            hg_texture_report(pixel);
            hg_progress_spoil(pixel);
        }
        front += (1.0 - front.a) * color;
        at = hg_frame.blend.nodes.v[at].next;
    }
    return front;
}

void main()
{
#ifdef HG_FRAME_FLAT
    hg_flat_receive();
#endif
    hg_at = shaded_pixel();
    ivec2 pixel = ivec2(hg_at);
    hg_texture_counts = hg_variant == 3u || hg_progress_waits(pixel);
    if (hg_variant == 4u) {
        out_color = layers(pixel);
        return;
    }
    vec4 color;
    float depth = NOTHING;
    if (hg_background)
        color = background();
    else
        color = surface(texelFetch(hg_visibility, pixel, 0).xy, depth);
    color = bounded(color);
    if (hg_variant == 3u)
        color.a = depth;
    if (hg_variant == 1u) {
        vec4 front = texelFetch(hg_front, pixel, 0);
        color = front + (1.0 - front.a) * color;
    }
    if (HG_HAS(HG_FEATURE_STREAM)) {
        if (!hg_background || HG_HAS(HG_FEATURE_SKY_PAGES))
            hg_texture_report(pixel);
        if (hg_variant == 2u)
            hg_progress_spoil(pixel);
        else if (hg_variant == 3u)
            color.a = hg_progress_would_take(pixel) ? depth : -depth;
        else if (!hg_progress_take(pixel))
            color = vec4(0.0);
    }
    if (hg_picture > 0u) {
        bool over = hg_frame.background_mode == HG_BACKGROUND_MODE_DISPLAY;
        color = hg_resolve(color, hg_frame.exposure, hg_picture - 1u,
            vec4(hg_frame.background_color, over ? 1.0 : 0.0));
    }
    out_color = color;
}

#endif
