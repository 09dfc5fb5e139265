// light.glsl - light that comes straight from punctual lights, through clusters and shadow maps.
//
// Include lib/frame.glsl first. Photometric input, radiometric use: 1 lux on white Lambert gives a
// radiance of 1 / pi. Source of the light model: KHR_lights_punctual.
#ifndef HG_LIB_LIGHT_GLSL
#define HG_LIB_LIGHT_GLSL

#include "lib/brdf.glsl"
// Includes of lib/bsdf.glsl come first, where materials may have lobes (HG_FEATURE_LOBES).

layout(set = 0, binding = HG_BIND_SHADOW) uniform sampler2D hg_shadow_atlas;

// --- shadow maps ---------------------------------------------------------------------------------

// Where a receiver lies in one map, and how its plane runs there.
struct hg_shadow_receiver {
    vec2 ndc;      // -1..1
    float depth;   // reversed
    float bias;    // of depth
    vec2 gradient; // of depth along the receiver's plane, per texel
};

// Slopes steeper than this (about 87 degrees) are not followed: the light hardly reaches them.
#define HG_SHADOW_MIN_COS 0.05
#define HG_SHADOW_RINGS 4 // of the search for what is in the way of lights with a size
#define HG_SHADOW_TAPS_AT_ONCE 16 // of lights with a size, where a picture has one sample

// Plane through pos with this normal in the map's depth.
//   orthographic: n . q = c            => d depth / d x = scale_z n.x / (n.z scale)
//   perspective:  1 / z = (n.xy/s, n.z) . (ndc, 1) / c, depth = near / z => linear in ndc as well
hg_shadow_receiver hg_shadow_project(hg_gpu_shadow s, vec3 pos_ws, vec3 n)
{
    hg_shadow_receiver r;
    vec3 d = pos_ws - s.origin_ws;
    vec3 q = vec3(dot(d, s.right_ws), dot(d, s.up_ws), dot(d, s.forward_ws));
    vec3 m = vec3(dot(n, s.right_ws), dot(n, s.up_ws), dot(n, s.forward_ws));
    float texel_ndc = 2.0 / s.size_px;
    if (s.perspective == 0u) {
        r.ndc = q.xy * s.scale;
        r.depth = 1.0 - q.z * s.depth_scale;
        r.bias = 0.5 * s.texel_size * s.depth_scale;
        float mz = min(m.z, -HG_SHADOW_MIN_COS);
        r.gradient = m.xy * (s.depth_scale / (s.scale * mz) * texel_ndc);
        return r;
    }
    float z = max(q.z, 1e-6);
    r.ndc = q.xy * (s.scale / z);
    r.depth = s.depth_scale / z;
    r.bias = 0.5 * s.texel_size * s.depth_scale / z; // of near / z for a step of texel_size * z
    float c = min(dot(m, q), -HG_SHADOW_MIN_COS * length(q));
    r.gradient = m.xy * (s.depth_scale / (s.scale * c) * texel_ndc);
    return r;
}

// Among many lamps places in the atlas depend on the pictures before (hg_shadow_plan_keep): there
// texels are counted from the map's corner, so that the place is not in their rounding.
vec2 hg_shadow_corner(hg_gpu_shadow s)
{
    return HG_HAS(HG_FEATURE_CLUSTERS) ? vec2(0.0) : s.rect_px;
}

// The four texels whose first one is i.
vec4 hg_shadow_gather(hg_gpu_shadow s, vec2 i)
{
    vec2 at = i + 1.0;
    if (HG_HAS(HG_FEATURE_CLUSTERS))
        at += s.rect_px;
    return textureGather(hg_shadow_atlas, at * hg_frame.lighting.shadow_inv_size);
}

// Share of light let through around a point of the atlas: 2x2 comparisons, bilinear weights. Each
// texel is compared with the receiver's plane at that texel, where this lies nearer to the light
// than the receiver, so that planes at any angle neither shadow themselves nor need a bias that
// grows with the slope; where it lies deeper the receiver's own depth is used, so that the floor
// before a wall does not shadow the wall's foot.
// Source: Isidoro 2006, "Shadow Mapping: GPU-based Tips and Techniques" (receiver plane bias).
float hg_shadow_tap(hg_gpu_shadow s, hg_shadow_receiver r, vec2 receiver_px, vec2 offset_px)
{
    vec2 t = receiver_px + offset_px - 0.5;
    vec2 i = floor(t);
    vec2 f = t - i;
    vec4 stored = hg_shadow_gather(s, i);
    // Gather order: (0,1) (1,1) (1,0) (0,0). Rows of the map run down, the gradient is y up.
    vec2 c = i + 0.5 - receiver_px;
    vec4 x = c.x + vec4(0.0, 1.0, 1.0, 0.0);
    vec4 y = c.y + vec4(1.0, 1.0, 0.0, 0.0);
    vec4 plane = x * r.gradient.x - y * r.gradient.y;
    vec4 lit = step(stored, vec4(r.depth + r.bias) + max(plane, vec4(0.0)));
    vec2 low = mix(lit.wx, lit.zy, f.x);
    return mix(low.x, low.y, f.y);
}

// Place of a receiver in the atlas.
vec2 hg_shadow_px(hg_gpu_shadow s, hg_shadow_receiver r)
{
    return hg_shadow_corner(s) + (vec2(r.ndc.x, -r.ndc.y) * 0.5 + 0.5) * s.size_px;
}

// Tap of a filter that is `scale` times as wide, within the map.
vec2 hg_shadow_offset(hg_gpu_shadow s, vec2 px, int i, float scale)
{
    vec2 at = px + hg_frame.lighting.shadow_taps_px[i] * scale;
    return clamp(at, hg_shadow_corner(s) + 1.0, hg_shadow_corner(s) + s.size_px - 1.0) - px;
}

// How much wider than that of a point the filter of a light with a size is: by the mean distance of what is
// in the way, among texels that the light is seen through at their distance. size: tangent of the angle
// that a sun's radius is seen at, or metres of a lamp's radius. Under a lamp of radius R the penumbra is
// R (z - b) / b wide at distance z, b being that of what is in the way: R (1 / b - 1 / z) / texel_size
// texels, which is linear in reversed depth as that of a sun is.
// Source: Fernando 2005, "Percentage-Closer Soft Shadows".
float hg_shadow_penumbra(hg_gpu_shadow s, hg_shadow_receiver r, vec2 px, float size)
{
    const float widest = HG_PENUMBRA_MOST_PX / HG_SHADOW_RADIUS_PX;
    float per_m = size / (s.texel_size * HG_SHADOW_RADIUS_PX); // widths of the filter
    float most_m = (1.0 - r.depth) / s.depth_scale; // to the map's near end
    float search = clamp(per_m * most_m, 1.0, widest);
    vec2 sum = vec2(0.0);
    // Near to a lamp its disc fills the search, farther away it may be a few texels: rings, each of
    // half the radius.
    int rings = HG_HAS2(HG_FEATURE2_SIZED) ? HG_SHADOW_RINGS : 1;
    for (int i = 0; i < HG_SHADOW_TAPS * rings; i++) {
        float ring = search;
        if (HG_HAS2(HG_FEATURE2_SIZED))
            ring = max(search * exp2(-float(i / HG_SHADOW_TAPS)), 1.0);
        vec2 off = hg_shadow_offset(s, px, i % HG_SHADOW_TAPS, ring);
        vec4 stored;
        if (HG_HAS(HG_FEATURE_CLUSTERS))
            stored = hg_shadow_gather(s, floor(px + off - 0.5));
        else
            stored = textureGather(hg_shadow_atlas, (px + off) * hg_frame.lighting.shadow_inv_size);
        float plane = max(off.x * r.gradient.x - off.y * r.gradient.y, 0.0);
        vec4 above = (stored - (r.depth + r.bias + plane)) / s.depth_scale; // m; of lamps 1 / m
        float apart = length(off) / HG_SHADOW_RADIUS_PX - 1.0;
        vec4 counts = step(vec4(1e-6), above) * step(vec4(apart), above * per_m);
        sum += vec2(dot(counts, above), dot(counts, vec4(1.0)));
    }
    return clamp(per_m * sum.x / max(sum.y, 1.0), 1.0, widest);
}

// Filter of a picture that is shown after one sample, which has as many taps as several together.
// Vogel 1979, as in renderer/light/lighting.c.
float hg_shadow_filter_at_once(hg_gpu_shadow s, hg_shadow_receiver r, vec2 px, float scale)
{
    float sum = 0.0;
    for (int i = 0; i < HG_SHADOW_TAPS_AT_ONCE; i++) {
        float radius = sqrt((float(i) + 0.5) / float(HG_SHADOW_TAPS_AT_ONCE)) * HG_SHADOW_RADIUS_PX;
        float phi = float(i) * 2.39996323;
        vec2 at = px + vec2(cos(phi), sin(phi)) * (radius * scale);
        sum += hg_shadow_tap(
            s, r, px, clamp(at, hg_shadow_corner(s) + 1.0, hg_shadow_corner(s) + s.size_px - 1.0) - px);
    }
    return sum / float(HG_SHADOW_TAPS_AT_ONCE);
}

// size: as of hg_shadow_penumbra; 0: a point.
float hg_shadow_filter(hg_gpu_shadow s, hg_shadow_receiver r, float size)
{
    bool sizes = HG_HAS2(HG_FEATURE2_GATHERED) || HG_HAS2(HG_FEATURE2_SIZED);
    vec2 px = hg_shadow_px(s, r);
    float sum = 0.0, scale = 1.0;
    if (sizes && size > 0.0)
        scale = hg_shadow_penumbra(s, r, px, size);
    if (HG_HAS2(HG_FEATURE2_SIZED) && scale > 1.0 && hg_frame.sample_index == 0u)
        return hg_shadow_filter_at_once(s, r, px, scale);
    for (int i = 0; i < HG_SHADOW_TAPS; i++) {
        vec2 off = hg_frame.lighting.shadow_taps_px[i];
        if (sizes)
            off = hg_shadow_offset(s, px, i, scale);
        sum += hg_shadow_tap(s, r, px, off);
    }
    return sum / float(HG_SHADOW_TAPS);
}

// Of the sky's sun where the frame says so.
float hg_shadow_sun_size()
{
    bool disc = HG_HAS2(HG_FEATURE2_GATHERED) && (hg_frame.flags & HG_FRAME_SUN_DISC) != 0u;
    return disc ? HG_SUN_RADIUS : 0.0;
}

// Of a light with a size: a disc of the area that is seen along its direction.
float hg_shadow_light_size(hg_gpu_light light)
{
    if (light.kind == HG_LIGHT_KIND_DIRECTIONAL)
        return light.radius / max(light.bound, 0.01);
    return light.radiance > 0.0 ? sqrt(HG_INV_PI / light.radiance) : 0.0;
}

// Where a point lies in a map of a light, off its surface by part of a texel along the normal (for
// curvature and rounding) and by `slack`. cos_l: of the normal and the direction to the light.
hg_shadow_receiver hg_shadow_receive(
    hg_gpu_shadow s, vec3 pos_ws, vec3 n_geometric, float cos_l, float slack)
{
    float distance = s.perspective == 0u ? 1.0 : abs(dot(pos_ws - s.origin_ws, s.forward_ws));
    float sine = sqrt(max(0.0, 1.0 - cos_l * cos_l));
    vec3 p = pos_ws + n_geometric * (s.texel_size * distance * (0.25 + 0.75 * sine) + slack);
    return hg_shadow_project(s, p, n_geometric);
}

// Possible distance in metres of the shaded point from its surface, by rounding.
float hg_shadow_slack(vec3 pos_ws)
{
    return hg_frame.lighting.shadow_slack_m + hg_frame.lighting.shadow_slack_per_m *
        dot(pos_ws - hg_frame.camera.eye_ws, hg_frame.camera.forward_ws);
}

// The page of a point in the sun's shadow, as a map, and the receiver in it; false: there is none.
// s: the map of the whole scene, whose projection pages share. Each level is tried where the point
// lies once it is off its surface by part of that level's texel.
bool hg_shadow_page(inout hg_gpu_shadow s, inout hg_shadow_receiver r, vec3 pos_ws, vec3 n_geometric,
    float cos_l, float slack)
{
    hg_gpu_shadow_pages pages = hg_frame.lighting.pages;
    float view_depth = dot(pos_ws - hg_frame.camera.eye_ws, hg_frame.camera.forward_ws);
    float texels = view_depth * pages.per_depth + pages.constant;
    int level = int(clamp(ceil(log2(max(texels, 1.0))), 0.0, float(HG_SHADOW_PAGE_LEVELS)));
    float off = 0.25 + 0.75 * sqrt(max(0.0, 1.0 - cos_l * cos_l)); // as in hg_shadow_receive
    vec3 d = pos_ws - s.origin_ws;
    vec2 at = vec2(dot(d, s.right_ws), dot(d, s.up_ws));
    vec2 n = vec2(dot(n_geometric, s.right_ws), dot(n_geometric, s.up_ws));
    uint word = 0u;
    ivec2 page = ivec2(0);
    float texel = 0.0;
    for (int i = 0; i < HG_SHADOW_PAGE_TRIES; i++, level++) {
        float t = pages.texel * exp2(float(level));
        ivec2 p = ivec2(floor((at + n * (t * off + slack)) / (t * float(HG_SHADOW_PAGE_INNER_PX))));
        uvec2 place = uvec2(p) % HG_SHADOW_PAGE_WINDOW;
        uvec2 tag = (uvec2(p) / HG_SHADOW_PAGE_WINDOW) & HG_SHADOW_PAGE_TAG_MASK;
        uint row = uint(min(level, HG_SHADOW_PAGE_LEVELS - 1)) * HG_SHADOW_PAGE_WINDOW + place.y;
        uint w = hg_shadow_page_at(row * HG_SHADOW_PAGE_WINDOW + place.x);
        uint same = tag.x << HG_SHADOW_PAGE_TAG_X | tag.y << HG_SHADOW_PAGE_TAG_Y;
        if (word == 0u && level < HG_SHADOW_PAGE_LEVELS && w != 0u &&
            (w & ~HG_SHADOW_PAGE_SLOT_MASK) == same) {
            word = w;
            page = p;
            texel = t;
        }
    }
    if (word == 0u)
        return false;
    uint slot = (word & HG_SHADOW_PAGE_SLOT_MASK) - 1u;
    s.texel_size = texel;
    s.size_px = float(HG_SHADOW_PAGE_PX);
    s.scale = 2.0 / (s.size_px * texel);
    s.rect_px = pages.rect_px + vec2(slot % pages.side, slot / pages.side) * s.size_px;
    r = hg_shadow_receive(s, pos_ws, n_geometric, cos_l, slack);
    r.ndc -= (vec2(page) + 0.5) * (2.0 * float(HG_SHADOW_PAGE_INNER_PX) / float(HG_SHADOW_PAGE_PX));
    return true;
}

bool hg_shadow_holds(hg_gpu_shadow s, hg_shadow_receiver r, bool last)
{
    float hand_over = 1.0 - 0.1 * hg_frame.lighting.shadow_dither;
    return max(abs(r.ndc.x), abs(r.ndc.y)) <= s.extent * (last ? 1.0 : hand_over) && r.depth > 0.0;
}

// Lit share of a point; n_geometric faces the eye, cos_l > 0. First map of the light that holds it:
// cascades come finest first and hand over at a distance from their edge that changes with every
// sample, so that the settled image blends them.
// sky_sun: it may be the sky's sun.
float hg_shadow(hg_gpu_light light, vec3 pos_ws, vec3 n_geometric, vec3 l, bool sky_sun)
{
    uint first = light.shadow, last = light.shadow + light.shadow_count - 1u;
    if (light.shadow_count == 6u) { // faces of a cube: +x -x +y -y +z -z
        vec3 a = abs(l);
        uint face = a.x >= a.y && a.x >= a.z ? (l.x > 0.0 ? 1u : 0u)
            : a.y >= a.z                     ? (l.y > 0.0 ? 3u : 2u)
                                             : (l.z > 0.0 ? 5u : 4u);
        first += face; // l points to the light, the face looks the other way
        last = first;
    }
    bool coarse = (hg_frame.flags & HG_FRAME_COARSE_SHADOWS) != 0u;
    if (coarse && light.kind == HG_LIGHT_KIND_DIRECTIONAL)
        first = last;
    float cos_l = dot(n_geometric, l);
    float slack = hg_shadow_slack(pos_ws);
    hg_gpu_shadow s;
    hg_shadow_receiver r;
    // Metres of the penumbra by the map of the whole scene: it has to fit the filter of a finer one.
    float wide = 0.0, size = sky_sun ? hg_shadow_sun_size() : 0.0;
    if (HG_HAS2(HG_FEATURE2_SIZED)) {
        size = max(size, hg_shadow_light_size(light));
        if (light.radiance > 0.0 && first < last) {
            s = hg_shadow_at(last);
            r = hg_shadow_receive(s, pos_ws, n_geometric, cos_l, slack);
            float scale = hg_shadow_penumbra(s, r, hg_shadow_px(s, r), size);
            wide = scale > 1.0 ? scale * HG_SHADOW_RADIUS_PX * s.texel_size : 0.0;
        }
    }
    // The map is chosen first and filtered once: filtering inside the loop would be done for each.
    uint i = first;
    bool inside;
    // Tested at the end: a software rasteriser runs the rest of a body that was broken out of, so a
    // test at the top costs one more pass.
    do {
        s = hg_shadow_at(i);
        r = hg_shadow_receive(s, pos_ws, n_geometric, cos_l, slack);
        // A face of a cube always holds what lies in its direction; the offset along the normal may
        // take it past the edge by a texel, which the map's margin has.
        inside = light.shadow_count == 6u || hg_shadow_holds(s, r, i == last);
        if (HG_HAS2(HG_FEATURE2_SIZED))
            inside = inside && (i == last || wide <= HG_PENUMBRA_MOST_PX * s.texel_size);
    } while (!inside && ++i <= last);
    if (HG_HAS2(HG_FEATURE2_SHADOW_PAGES)) {
        if (light.shadow == hg_frame.lighting.pages.shadow && size == 0.0)
            hg_shadow_page(s, r, pos_ws, n_geometric, cos_l, slack);
    }
    float lit = hg_shadow_filter(s, r, size);
    lit = inside ? lit : 1.0;
    return HG_HAS(HG_FEATURE_CLUSTERS) ? mix(lit, 1.0, light.shadow_fade) : lit;
}

#ifdef HG_FRAME_FLAT
// The same for the sun, whose last map is at hand: the others are looked at when they are in use.
float hg_shadow_of_sun(vec3 pos_ws, vec3 n_geometric, vec3 l)
{
    float cos_l = dot(n_geometric, l), slack = hg_shadow_slack(pos_ws);
    hg_gpu_shadow s = hg_sun_map;
    hg_shadow_receiver r = hg_shadow_receive(s, pos_ws, n_geometric, cos_l, slack);
    bool inside = hg_shadow_holds(s, r, true);
    bool coarse = (hg_frame.flags & HG_FRAME_COARSE_SHADOWS) != 0u;
    if (HG_HAS(HG_FEATURE_REST)) {
        uint i = hg_sun.shadow, last = i + hg_sun.shadow_count - 1u;
        bool found = coarse;
        do { // finest first; tested at the end, as above
            hg_gpu_shadow finer = hg_shadow_at(i);
            finer.perspective = 0u;
            hg_shadow_receiver at = hg_shadow_receive(finer, pos_ws, n_geometric, cos_l, slack);
            if (!found && hg_shadow_holds(finer, at, i == last)) {
                s = finer;
                r = at;
                found = inside = true;
            }
        } while (!found && ++i < last);
    }
    if (HG_HAS2(HG_FEATURE2_SHADOW_PAGES))
        hg_shadow_page(s, r, pos_ws, n_geometric, cos_l, slack);
    float lit = hg_shadow_filter(s, r, hg_shadow_sun_size());
    return inside ? lit : 1.0;
}
#endif

// --- lights --------------------------------------------------------------------------------------

#include "lib/light_table.glsl"

// Illuminance at a point on a plane facing the light (lux per unit of its colour), and where it is.
// Distance and cone after KHR_lights_punctual, "Range Property" and "Inner and Outer Cone Angles".
vec3 hg_light_illuminance(hg_gpu_light light, vec3 pos_ws, out vec3 l)
{
    if (!HG_HAS(HG_FEATURE_LOCAL) || light.kind == HG_LIGHT_KIND_DIRECTIONAL) {
        l = -light.direction_ws;
        return light.color * hg_light_tint(light, pos_ws);
    }
    vec3 d = light.position_ws - pos_ws;
    float d2 = max(dot(d, d), 1e-8);
    l = d * inversesqrt(d2);
    float q = d2 * light.inv_range_sq;
    float e = clamp(1.0 - q * q, 0.0, 1.0);
    if (HG_HAS(HG_FEATURE_CLUSTERS)) // lamps together, renderer/light/light_cut.h
        e /= light.radiance > 0.0 ? d2 : max(d2, light.half_width * light.half_width);
    else
        e /= d2;
    if (light.kind == HG_LIGHT_KIND_SPOT) {
        float c = dot(-l, light.direction_ws);
        float cone = clamp(c * light.spot_scale + light.spot_offset, 0.0, 1.0);
        e *= cone * cone;
    }
    return light.color * e * hg_light_tint(light, pos_ws);
}

// Radiance of the surface of a light that has a size, as a point receives it. Cone and range go by the
// light's middle, so that all of the surface has the same.
vec3 hg_light_radiance(hg_gpu_light light, vec3 pos_ws)
{
    if (light.kind == HG_LIGHT_KIND_DIRECTIONAL)
        return light.color * hg_light_tint(light, pos_ws) * light.radiance;
    vec3 d = light.position_ws - pos_ws, l;
    float d2 = max(dot(d, d), 1e-8);
    return hg_light_illuminance(light, pos_ws, l) * (d2 * light.radiance);
}

#include "lib/area_light.glsl"

// Share of its greatest intensity that a light with a size has in a direction from it, -l, far away.
float hg_light_lobe(hg_gpu_light light, vec3 l)
{
    if (light.kind == HG_LIGHT_KIND_RECTANGLE || light.kind == HG_LIGHT_KIND_DISC)
        return max(-dot(l, light.direction_ws), 0.0);
    float along = dot(l, light.axis_ws);
    return light.kind == HG_LIGHT_KIND_TUBE ? sqrt(max(1.0 - along * along, 0.0)) : 1.0;
}

// The light of lamps with a size was gathered for the surface that is shaded, and rays told which share of
// that of directional lights arrives, and of lamps without a size.
bool hg_light_gathered = false;
bool hg_light_by_maps = false; // all the same shadow maps say which share arrives, as they know both sides
float hg_light_sun_seen = 1.0;
uvec4 hg_light_lamps_seen = uvec4(0xffffffffu); // HG_FEATURE2_LAMPS_GATHERED: of each HG_GATHERED_LAMP

// Share of a lamp's light that arrives. A sky's sun, which is in front of the scene's lights, takes an id.
float hg_light_lamp_seen(uint id)
{
    if (id == HG_LIGHT_TOGETHER) {
        vec4 all = vec4(0.0);
        for (int i = 0; i < 4; i++)
            all += unpackUnorm4x8(hg_light_lamps_seen[i]) * unpackUnorm4x8(hg_light_lamps_seen[i]);
        return dot(all, vec4(1.0 / 16.0));
    }
    uint lamp = HG_GATHERED_LAMP(id - ((hg_frame.flags & HG_FRAME_SUN_DISC) != 0u ? 1u : 0u));
    float root = float(bitfieldExtract(hg_light_lamps_seen[lamp / 4u], 8 * int(lamp % 4u), 8)) * (1.0 / 255.0);
    return root * root;
}

#ifdef HG_LIB_BSDF_GLSL
hg_bsdf hg_light_bsdf; // what light falls on, where materials have lobes; set by the pass
#endif

// f(v, l) |n.l| of what light falls on.
vec3 hg_light_reflected(hg_brdf b, vec3 l)
{
#ifdef HG_LIB_BSDF_GLSL
    float pdf;
    if (HG_HAS(HG_FEATURE_LOBES))
        return hg_bsdf_evaluate(hg_light_bsdf, l, pdf);
#endif
    return hg_brdf_evaluate(b, l);
}

// Whether light from l may show: from behind, it goes through what is thin.
bool hg_light_reaches(hg_brdf b, vec3 l)
{
#ifdef HG_LIB_BSDF_GLSL
    if (HG_HAS(HG_FEATURE_DIFFUSE_TRANSMISSION) || HG_HAS(HG_FEATURE_TRANSMISSION)) {
        if (hg_light_bsdf.transmission > 0.0 || hg_max3(hg_light_bsdf.behind) > 0.0)
            return true;
    }
#endif
    return dot(b.n, l) > 0.0;
}

// The side of the surface that is lit, as its normal: shadows are those of that side.
vec3 hg_light_side(hg_brdf b, vec3 n_geometric, vec3 l)
{
#ifdef HG_LIB_BSDF_GLSL
    if (HG_HAS(HG_FEATURE_DIFFUSE_TRANSMISSION) || HG_HAS(HG_FEATURE_TRANSMISSION))
        return dot(b.n, l) < 0.0 ? -n_geometric : n_geometric;
#endif
    return n_geometric;
}

// Lit share of a point by a light that has a shadow map, where gathering paths have not told.
float hg_light_lit(hg_gpu_light light, vec3 pos_ws, vec3 n_geometric, vec3 l, bool sky_sun)
{
    bool directional = !HG_HAS(HG_FEATURE_LOCAL) || light.kind == HG_LIGHT_KIND_DIRECTIONAL;
    if (HG_HAS2(HG_FEATURE2_GATHERED) && hg_light_gathered && !hg_light_by_maps && directional)
        return hg_light_sun_seen;
    return hg_shadow(light, pos_ws, n_geometric, l, sky_sun);
}

// The same from a light with a size, whose middle is at l. A shadow map shows what its middle sees.
vec3 hg_light_sized(hg_brdf b, hg_gpu_light light, vec3 pos_ws, vec3 n_geometric, vec3 l)
{
    hg_area_outline outline = hg_area_outline_of(light, pos_ws);
    vec3 radiance = hg_light_radiance(light, pos_ws), mean, sum;
    if (outline.center == vec3(0.0) || max(radiance.r, max(radiance.g, radiance.b)) <= 0.0)
        return vec3(0.0);
#ifdef HG_LIB_BSDF_GLSL
    if (HG_HAS(HG_FEATURE_LOBES))
        sum = hg_area_reflected_by_lobes(hg_light_bsdf, outline, mean);
    else
#endif
        sum = hg_area_reflected(b, outline, mean);
    mean = dot(mean, mean) > 0.0 ? mean : l; // all of it is behind
    n_geometric = hg_light_side(b, n_geometric, mean);
    if (dot(n_geometric, mean) <= 0.0)
        return vec3(0.0);
    if (HG_HAS(HG_FEATURE_SHADOWS) && light.shadow != HG_SHADOW_NONE)
        sum *= hg_light_lit(light, pos_ws, n_geometric, l, false);
    return sum * radiance;
}

// Light that arrives at a surface from one light. A surface that faces away lies in its own shadow,
// whatever its normal map says.
vec3 hg_light_one(hg_brdf b, uint index, vec3 pos_ws, vec3 n_geometric)
{
    hg_gpu_light light = hg_light_at(index);
    vec3 l;
    vec3 e = hg_light_illuminance(light, pos_ws, l);
    bool lamp = light.kind != HG_LIGHT_KIND_DIRECTIONAL;
    if (HG_HAS2(HG_FEATURE2_SIZED) && light.radiance > 0.0)
        return hg_light_gathered && lamp ? vec3(0.0) : hg_light_sized(b, light, pos_ws, n_geometric, l);
    if (!hg_light_reaches(b, l) || max(e.r, max(e.g, e.b)) <= 0.0)
        return vec3(0.0);
    vec3 sum = e * hg_light_reflected(b, l);
    n_geometric = hg_light_side(b, n_geometric, l);
    // Those that no shadow map, or that cast no shadows, among them.
    if (HG_HAS2(HG_FEATURE2_LAMPS_GATHERED) && hg_light_gathered && !hg_light_by_maps && lamp)
        return dot(n_geometric, l) > 0.0 ? sum * hg_light_lamp_seen(light.id) : vec3(0.0);
    bool first = index == 0u; // the sky's sun, if there is one
    if (HG_HAS(HG_FEATURE_SHADOWS) && light.shadow != HG_SHADOW_NONE)
        sum *= dot(n_geometric, l) > 0.0 ? hg_light_lit(light, pos_ws, n_geometric, l, first) : 0.0;
    return sum;
}

#ifdef HG_FRAME_FLAT
vec3 hg_light_sun(hg_brdf b, vec3 pos_ws, vec3 n_geometric)
{
    vec3 l = -hg_sun.direction_ws;
    vec3 sum = hg_sun.color * hg_light_reflected(b, l);
    n_geometric = hg_light_side(b, n_geometric, l);
    if (HG_HAS(HG_FEATURE_SHADOWS) && hg_sun.shadow != HG_SHADOW_NONE)
        sum *= dot(n_geometric, l) <= 0.0                         ? 0.0
            : HG_HAS2(HG_FEATURE2_GATHERED) && hg_light_gathered && !hg_light_by_maps ? hg_light_sun_seen
                                                                 : hg_shadow_of_sun(pos_ws, n_geometric, l);
    return sum;
}
#endif

// Cluster of a pixel (centre at +0.5) at a distance along the view direction.
// Source: Olsson, Billeter and Assarsson 2012, "Clustered Deferred and Forward Shading"; slices
// exponential in depth.
uint hg_light_cluster(vec2 pixel, float view_depth)
{
    uvec3 n = uvec3(hg_frame.lighting.cluster_x, hg_frame.lighting.cluster_y,
        hg_frame.lighting.cluster_z);
    vec2 xy = pixel *
        vec2(hg_frame.lighting.cluster_scale_x, hg_frame.lighting.cluster_scale_y);
    float z = log2(max(view_depth, 1e-9)) * hg_frame.lighting.cluster_z_scale +
        hg_frame.lighting.cluster_z_bias;
    uvec3 c = min(uvec3(max(vec3(xy, z), vec3(0.0))), n - 1u);
    return (c.z * n.y + c.y) * n.x + c.x;
}

// Light reflected to the eye from all punctual lights. pixel: centre of the shaded pixel in px;
// view_depth: metres along the camera's forward.
vec3 hg_light_brdf(hg_brdf b, vec3 pos_ws, vec3 n_geometric, vec2 pixel, float view_depth)
{
    vec3 sum = vec3(0.0);
    if (!HG_HAS(HG_FEATURE_LIGHTS))
        return sum;
#ifdef HG_FRAME_FLAT
    if (!HG_HAS(HG_FEATURE_NO_SUN))
        return hg_light_sun(b, pos_ws, n_geometric);
#endif
    uint everywhere = hg_frame.lighting.global_count;
    if (!HG_HAS(HG_FEATURE_CLUSTERS) || hg_frame.lighting.clustered == 0u)
        everywhere = hg_frame.lighting.light_count;
    if (everywhere > 0u) {
        uint i = 0u;
        do
            sum += hg_light_one(b, i, pos_ws, n_geometric);
        while (++i < everywhere);
    }
    if (HG_HAS(HG_FEATURE_CLUSTERS) && hg_frame.lighting.clustered != 0u) {
        uint cluster = hg_light_cluster(pixel, view_depth);
        uint k = hg_frame.lighting.clusters.v[cluster];
        uint end = hg_frame.lighting.clusters.v[cluster + 1u];
        if (k < end) {
            do
                sum += hg_light_one(b, hg_frame.lighting.cluster_lights.v[k], pos_ws, n_geometric);
            while (++k < end);
        }
    }
    return sum;
}

#ifdef HG_LIB_MATERIAL_GLSL
// The same for an evaluated material (include lib/material.glsl first).
vec3 hg_light_direct(hg_surface s, vec3 pos_ws, vec3 view_ws, vec2 pixel, float view_depth)
{
    return hg_light_brdf(
        hg_surface_brdf(s, view_ws), pos_ws, s.geometric_normal, pixel, view_depth);
}
#endif

#endif
