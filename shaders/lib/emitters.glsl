// emitters.glsl - choosing light for a point of a surface, and with which density it is chosen.
//
// Define HG_EMITTERS as an expression of type hg_gpu_emitters first, and include lib/frame.glsl.
// Positions are those of the frame (relative to the geometry's origin), directions are unit length.
// normal_ws: of the side that light has to come from; vec3(0): light from every side counts. Surfaces
// that let light through have to ask with vec3(0), else what shines on their back is never chosen. A
// direction is drawn by hg_emitter_pick with the density that the two pdf functions return for the
// same position and normal; where they return 0 it never is, and light found there by other means
// counts in full.
//
// Emissive triangles shine from their front side, from both when they are double-sided; unlit ones
// are never chosen (their colour is no light). What is chosen does not depend on what is resident.
//
// Sources: Conty Estevez and Kulla 2018, "Importance Sampling of Many Lights with Adaptive Tree
// Splitting" (bounds and importance of sets of lights); Clarberg, Jarosz, Akenine-Moller and Jensen
// 2005, "Wavelet Importance Sampling" (hierarchical warping).
#ifndef HG_LIB_EMITTERS_GLSL
#define HG_LIB_EMITTERS_GLSL

#include "lib/texture.glsl"
#include "lib/material.glsl"
#include "lib/environment.glsl"
#include "lib/light.glsl"
#include "shared/emitters.h"

// Defined before: HG_EMITTER_KIND_* of the kinds of light that there are, a constant.
#ifndef HG_EMITTER_KINDS
#define HG_EMITTER_KINDS HG_EMITTER_KIND_ALL
#endif
#define HG_EMITTER_MAY(kind) ((HG_EMITTER_KINDS & (kind)) != 0u)

// Defined before: hg_emitter_pick leaves out directional lights, hg_emitter_pick_apart chooses them.
#ifndef HG_EMITTER_APART
#define HG_EMITTER_APART false
#endif

struct hg_emitter_sample {
    vec3 direction; // to the light
    float distance; // to its surface or place, a little less; 1e30 = infinity
    vec3 radiance;  // divide by pdf; delta: illuminance facing it, over the chance of this light
    float pdf;      // per steradian, the choice of the light included; 0: nothing, unless delta
    bool delta;     // found by no direction but this one
    uint group;     // HG_EMITTER_GROUP_*
    uint draw, primitive; // of emissive triangles; of lights draw is hg_gpu_light.id
    vec2 barycentrics;
};

// What the point was seen with, for lookups in emissive textures: width of the ray's cone at the
// point in metres, and how it grows with distance. 0: the finest texels.
float hg_emitter_cone_width = 0.0, hg_emitter_cone_spread = 0.0;
// Mip of environments that have pages. 0: the finest.
float hg_emitter_environment_lod = 0.0;
// Emissive triangles of a time other than that of the tables: define both, as expressions.
#ifndef HG_EMITTER_WORLD
#define HG_EMITTER_WORLD(draw) hg_world_at((draw).instance)
#define HG_EMITTER_POSITION(draw, part, vertex) (part).positions.v[vertex]
#endif

// Punctual lights of such a time: an expression.
#ifndef HG_EMITTER_LIGHT
#define HG_EMITTER_LIGHT(index) HG_EMITTERS.lights.v[index]
#endif

// Defined before: nodes that were looked at are counted.
#ifdef HG_EMITTER_COUNT_WORK
uint hg_emitter_work = 0u;
#endif

#define HG_EMITTER_FAR  1e30
#define HG_EMITTER_NEAR (1.0 - 1e-4) // share of the way that shadow rays go

float hg_emitter_luminance(vec3 c)
{
    return dot(max(c, vec3(0.0)), vec3(0.2126, 0.7152, 0.0722));
}

hg_emitter_sample hg_emitter_nothing()
{
    return hg_emitter_sample(vec3(0.0, 1.0, 0.0), 0.0, vec3(0.0), 0.0, false, 0u,
        HG_EMITTER_NONE, 0u, vec2(0.0));
}

// A random number in [0, 1) that choices are made with, one after the other, and how far apart its
// values are: after each choice they spread over [0, 1) again. Noise fills the gaps before they are
// wide enough to matter, so that even rare choices come about as often as they should.
struct hg_emitter_dice {
    float u, gap;
    uint seed;
};

hg_emitter_dice hg_emitter_dice_of(float u, vec3 salt)
{
    uvec3 h = hg_hash3(floatBitsToUint(salt));
    return hg_emitter_dice(min(u, 0.99999994), 1.0 / 16777216.0, h.x);
}

// True with chance p, 0 < p < 1.
bool hg_emitter_throw(inout hg_emitter_dice d, float p)
{
    if (d.gap > 1.0 / 65536.0) {
        d.seed = d.seed * 747796405u + 2891336453u;
        uint h = ((d.seed >> ((d.seed >> 28u) + 4u)) ^ d.seed) * 277803737u; // PCG, RXS-M-XS
        d.u = min(d.u + d.gap * (float((h ^ (h >> 22u)) >> 8u) * (1.0 / 16777216.0)), 0.99999994);
        d.gap = 1.0 / 16777216.0;
    }
    bool yes = d.u < p;
    float share = max(yes ? p : 1.0 - p, 1e-12);
    d.u = clamp((yes ? d.u : d.u - p) / share, 0.0, 0.99999994);
    d.gap /= share;
    return yes;
}

// --- the tree ------------------------------------------------------------------------------------

// cos(max(0, a - b)) of two angles in 0..pi.
float hg_emitter_cos_less(float cos_a, float cos_b)
{
    float sines = sqrt(max(0.0, (1.0 - cos_a * cos_a) * (1.0 - cos_b * cos_b)));
    return cos_a > cos_b ? 1.0 : cos_a * cos_b + sines;
}
float hg_emitter_sin_less(float cos_a, float cos_b)
{
    float sin_a = sqrt(max(0.0, 1.0 - cos_a * cos_a)), sin_b = sqrt(max(0.0, 1.0 - cos_b * cos_b));
    return cos_a > cos_b ? 0.0 : sin_a * cos_b - cos_a * sin_b;
}

// About the illuminance that a set of emitters gives at most, were nothing in the way; 0 only where
// it gives none. Conty Estevez and Kulla 2018, eq. 3 and 4.
float hg_emitter_importance(hg_gpu_light_node e, vec3 position_ws, vec3 normal_ws)
{
#ifdef HG_EMITTER_COUNT_WORK
    hg_emitter_work++;
#endif
    vec3 center = 0.5 * (e.min + e.max), reach = 0.5 * (e.max - e.min);
    vec3 d = position_ws - center;
    float r2 = dot(reach, reach), d2 = dot(d, d);
    vec3 outside = max(abs(d) - reach, vec3(0.0));
    float window = dot(outside, outside) * e.inv_range_sq;
    float value = e.power * max(0.0, 1.0 - window * window);
    // Inside the sphere about the box anything may face anything.
    if (d2 <= r2)
        return value / max(r2, 1e-8);
    vec3 w = d * inversesqrt(max(d2, 1e-30));
    float cos_u = sqrt(max(0.0, 1.0 - r2 / d2));
    float cos_o = float(e.angles & 0xffffu) * (2.0 / 65535.0) - 1.0;
    float cos_e = float((e.angles >> 16u) & 0x7fffu) * (2.0 / 32767.0) - 1.0;
    float cos_t = dot(hg_decode_normal(e.axis), w);
    if ((e.angles & 0x80000000u) != 0u)
        cos_t = abs(cos_t);
    // theta' = theta - theta_o - theta_u, not below 0
    float cos_x = hg_emitter_cos_less(cos_t, cos_o), sin_x = hg_emitter_sin_less(cos_t, cos_o);
    float sin_u = sqrt(max(0.0, 1.0 - cos_u * cos_u));
    float cos_p = cos_x > cos_u ? 1.0 : cos_x * cos_u + sin_x * sin_u;
    if (cos_p < cos_e - 1e-3)
        return 0.0;
    float facing = 1.0;
    if (normal_ws != vec3(0.0))
        facing = hg_emitter_cos_less(clamp(-dot(w, normal_ws), -1.0, 1.0), cos_u);
    return value * max(cos_p, 1e-3) * max(facing, 0.0) / max(d2, 1e-8);
}

// Chance of the first of two nodes; -1: neither of them gives light.
float hg_emitter_first(uint child, vec3 position_ws, vec3 normal_ws)
{
    float a = hg_emitter_importance(HG_EMITTERS.nodes.v[child], position_ws, normal_ws);
    float b = hg_emitter_importance(HG_EMITTERS.nodes.v[child + 1u], position_ws, normal_ws);
    float sum = a + b;
    return sum > 0.0 && !isinf(sum) ? a / sum : -1.0;
}

// A leaf, and the chance of it; HG_EMITTER_NONE: the way ended where nothing gives light.
uint hg_emitter_descend(
    vec3 position_ws, vec3 normal_ws, inout hg_emitter_dice dice, out float chance)
{
    uint child = HG_EMITTERS.nodes.v[0].child;
    chance = 1.0;
    for (uint i = 0u; i < HG_EMITTER_MAX_DEPTH && (child & HG_EMITTER_IS_LEAF) == 0u; i++) {
        float first = hg_emitter_first(child, position_ws, normal_ws);
        if (first < 0.0)
            return HG_EMITTER_NONE;
        bool take = first >= 1.0 ? true : first <= 0.0 ? false : hg_emitter_throw(dice, first);
        chance *= take ? first : 1.0 - first;
        child = HG_EMITTERS.nodes.v[child + (take ? 0u : 1u)].child;
    }
    return child & ~HG_EMITTER_IS_LEAF;
}

// Chance of a leaf by its trail.
float hg_emitter_leaf_chance(uint trail, vec3 position_ws, vec3 normal_ws)
{
    uint child = HG_EMITTERS.nodes.v[0].child;
    float chance = 1.0;
    for (uint i = 0u; i < HG_EMITTER_MAX_DEPTH && (child & HG_EMITTER_IS_LEAF) == 0u; i++) {
        float first = hg_emitter_first(child, position_ws, normal_ws);
        bool second = ((trail >> i) & 1u) != 0u;
        chance *= first < 0.0 ? 0.0 : second ? 1.0 - first : first;
        if (chance <= 0.0)
            return 0.0;
        child = HG_EMITTERS.nodes.v[child + (second ? 1u : 0u)].child;
    }
    return chance;
}

// --- which kind of light -------------------------------------------------------------------------

// Luminance of a directional light's illuminance at a surface.
float hg_emitter_sun(uint i, vec3 normal_ws)
{
    hg_gpu_light light = HG_EMITTER_LIGHT(i);
    float facing = normal_ws == vec3(0.0) ? 1.0 : max(0.0, -dot(light.direction_ws, normal_ws));
    return hg_emitter_luminance(light.color) * facing;
}

float hg_emitter_suns(vec3 normal_ws)
{
    if (!HG_EMITTER_MAY(HG_EMITTER_KIND_SUNS))
        return hg_emitter_sun(0u, normal_ws);
    if (HG_EMITTERS.directional_count > HG_EMITTER_SUNS)
        return HG_EMITTERS.directional_lux;
    float sum = 0.0;
    for (uint i = 0u; i < HG_EMITTERS.directional_count; i++)
        sum += hg_emitter_sun(i, normal_ws);
    return sum;
}

// Chances of the tree, of directional lights and of the environment; they add up to 1 or are 0. Half
// goes by what each would give unoccluded, half is the same for all: what is in the way is not known.
vec3 hg_emitter_shares(vec3 position_ws, vec3 normal_ws)
{
    vec3 light = vec3(0.0);
    if (HG_EMITTER_MAY(HG_EMITTER_KIND_TREE) && HG_EMITTERS.node_count != 0u)
        light.x = hg_emitter_importance(HG_EMITTERS.nodes.v[0], position_ws, normal_ws);
    if (HG_EMITTER_MAY(HG_EMITTER_KIND_SUN) && !HG_EMITTER_APART &&
        HG_EMITTERS.directional_count != 0u)
        light.y = hg_emitter_suns(normal_ws);
    if (HG_EMITTER_MAY(HG_EMITTER_KIND_IMAGE | HG_EMITTER_KIND_PLAIN) &&
        HG_EMITTERS.environment_kind != HG_ENV_KIND_NONE)
        light.z = HG_EMITTERS.environment_mean * HG_PI *
            hg_emitter_luminance(hg_frame.lighting.env_color);
    light = mix(vec3(0.0), min(light, vec3(1e30)), greaterThan(light, vec3(0.0)));
    vec3 there = vec3(greaterThan(light, vec3(0.0)));
    float count = there.x + there.y + there.z;
    return count > 0.0 ? 0.5 * light / (light.x + light.y + light.z) + 0.5 * there / count
                       : vec3(0.0);
}

// --- emissive triangles --------------------------------------------------------------------------

struct hg_emitter_triangle {
    hg_gpu_part part;
    uvec3 corners;
    vec3 p0, e1, e2; // a corner and the edges from it
    vec3 normal;     // unit, of the front side
    float area;      // 0: degenerate
    uint flags, material;
};

hg_emitter_triangle hg_emitter_fetch(uint draw, uint primitive)
{
    hg_emitter_triangle t;
    hg_gpu_draw d = hg_draw_at(draw);
    t.part = hg_part_at(d.part);
    t.flags = d.flags;
    t.material = d.material;
    if (HG_HAS(HG_FEATURE_LOD) && (d.flags & HG_DRAW_LOD) != 0u) {
        t.part = hg_part_list(t.part.indices).v[primitive >> HG_LOD_SHIFT];
        primitive &= (1u << HG_LOD_SHIFT) - 1u;
    }
    mat4x3 world = HG_EMITTER_WORLD(d);
    uint first = primitive * 3u;
    t.corners = uvec3(
        t.part.indices.v[first], t.part.indices.v[first + 1u], t.part.indices.v[first + 2u]);
    vec3 a = HG_EMITTER_POSITION(d, t.part, t.corners.x);
    t.p0 = world * vec4(a, 1.0);
    t.e1 = mat3(world) * (HG_EMITTER_POSITION(d, t.part, t.corners.y) - a);
    t.e2 = mat3(world) * (HG_EMITTER_POSITION(d, t.part, t.corners.z) - a);
    vec3 face = cross(t.e1, t.e2) * ((d.flags & HG_DRAW_MIRRORED) != 0u ? -1.0 : 1.0);
    float twice = length(face);
    bool good = twice > 0.0 && !isinf(twice);
    t.area = good ? 0.5 * twice : 0.0;
    t.normal = good ? face / twice : vec3(0.0);
    return t;
}

// Cosine on the shining side of a triangle for light that leaves along -direction; <= 0: none.
float hg_emitter_cosine(hg_emitter_triangle t, vec3 direction)
{
    float c = -dot(t.normal, direction);
    return (t.flags & HG_DRAW_DOUBLE_SIDED) != 0u ? abs(c) : c;
}

// Surface point of a triangle as far as emission needs it; width: of the footprint, metres.
hg_vertex hg_emitter_vertex(hg_emitter_triangle t, vec2 b, float width)
{
    hg_vertex v;
    vec3 w = vec3(1.0 - b.x - b.y, b.x, b.y);
    v.position_ws = t.p0 + t.e1 * b.x + t.e2 * b.y;
    v.depth = 0.0;
    v.normal_ws = v.geometric_ws = t.normal;
    v.tangent_ws = vec4(1.0, 0.0, 0.0, 1.0);
    v.material = t.material;
    v.flags = t.flags;
    v.instance = 0u;
    v.front = true;
    vec2 a0 = t.part.vertices.v[t.corners.x].uv, a1 = t.part.vertices.v[t.corners.y].uv,
         a2 = t.part.vertices.v[t.corners.z].uv;
    float scale = width * inversesqrt(max(2.0 * t.area, 1e-30));
    v.uv0 = a0 * w.x + a1 * w.y + a2 * w.z;
    v.uv0_dx = (a1 - a0) * scale;
    v.uv0_dy = (a2 - a0) * scale;
    v.uv1 = v.uv0;
    v.uv1_dx = v.uv0_dx;
    v.uv1_dy = v.uv0_dy;
    if (HG_HAS(HG_FEATURE_VERTICES) && (t.flags & HG_DRAW_UV1) != 0u) {
        a0 = hg_fetch_uv1(t.part.extra, t.flags, t.corners.x);
        a1 = hg_fetch_uv1(t.part.extra, t.flags, t.corners.y);
        a2 = hg_fetch_uv1(t.part.extra, t.flags, t.corners.z);
        v.uv1 = a0 * w.x + a1 * w.y + a2 * w.z;
        v.uv1_dx = (a1 - a0) * scale;
        v.uv1_dy = (a2 - a0) * scale;
    }
    v.color = vec4(1.0);
    if (HG_HAS(HG_FEATURE_VERTICES) && (t.flags & (HG_DRAW_COLOR8 | HG_DRAW_COLOR16)) != 0u)
        v.color = hg_fetch_color(t.part.extra, t.flags, t.corners.x) * w.x +
            hg_fetch_color(t.part.extra, t.flags, t.corners.y) * w.y +
            hg_fetch_color(t.part.extra, t.flags, t.corners.z) * w.z;
    return v;
}

// Radiance that leaves a point, times the share of the surface that is there.
vec3 hg_emitter_radiance(hg_vertex v)
{
    vec3 radiance = HG_MATERIAL_AT(v.material, emissive);
    if (HG_HAS(HG_FEATURE_EMISSIVE))
        radiance *= hg_material_sample(v.material, HG_MATERIAL_EMISSIVE, true, v).rgb;
    uint flags = HG_MATERIAL_AT(v.material, flags);
    if ((flags & (HG_MATERIAL_MASK | HG_MATERIAL_BLEND)) != 0u) {
        float alpha = hg_material_alpha(v.material, v);
        if ((flags & HG_MATERIAL_MASK) != 0u)
            alpha = alpha >= HG_MATERIAL_AT(v.material, alpha_cutoff) ? 1.0 : 0.0;
        radiance *= clamp(alpha, 0.0, 1.0);
    }
    return radiance;
}

uint hg_emitter_weight(uint i)
{
    return (HG_EMITTERS.weights.v[i >> 1u] >> ((i & 1u) * 16u)) & 0xffffu;
}

// Share of triangle i among those of a leaf.
float hg_emitter_part_chance(hg_gpu_emitter_leaf leaf, uint i)
{
    if (leaf.count < 2u)
        return 1.0;
    uint below = i == 0u ? 0u : hg_emitter_weight(leaf.first_weight + i - 1u);
    return float(hg_emitter_weight(leaf.first_weight + i) - below) / 65535.0;
}

// One of the triangles of a leaf.
uint hg_emitter_pick_part(hg_gpu_emitter_leaf leaf, float u)
{
    if (leaf.count < 2u)
        return 0u;
    uint at = min(uint(u * 65535.0), 65534u), low = 0u, high = leaf.count - 1u;
    for (uint i = 0u; i < 16u && low < high; i++) {
        uint middle = (low + high) >> 1u;
        if (hg_emitter_weight(leaf.first_weight + middle) > at)
            high = middle;
        else
            low = middle + 1u;
    }
    return low;
}

// Density per steradian of a point of a triangle that is chosen evenly.
float hg_emitter_solid_angle_pdf(float area, float distance2, float cosine)
{
    float pdf = distance2 / (area * cosine);
    return area > 0.0 && cosine > 1e-6 && !isinf(pdf) && pdf > 0.0 ? pdf : 0.0;
}

hg_emitter_sample hg_emitter_pick_triangle(hg_gpu_emitter_leaf leaf, float chance,
    vec3 position_ws, float u, vec2 v)
{
    hg_emitter_sample s = hg_emitter_nothing();
    uint part = hg_emitter_pick_part(leaf, u);
    hg_emitter_triangle t = hg_emitter_fetch(leaf.draw, leaf.primitive + part);
    // Evenly over the triangle. Heitz 2019, "A Low-Distortion Map Between Triangle and Square".
    vec2 b = v.y > v.x ? vec2(v.x * 0.5, v.y - v.x * 0.5) : vec2(v.x - v.y * 0.5, v.y * 0.5);
    vec3 d = t.p0 + t.e1 * b.x + t.e2 * b.y - position_ws;
    float d2 = dot(d, d);
    if (!(d2 > 0.0) || isinf(d2))
        return s;
    s.direction = d * inversesqrt(d2);
    float distance = sqrt(d2);
    s.distance = distance * HG_EMITTER_NEAR;
    s.pdf = chance * hg_emitter_part_chance(leaf, part) *
        hg_emitter_solid_angle_pdf(t.area, d2, hg_emitter_cosine(t, s.direction));
    s.group = HG_EMITTER_GROUP_EMISSIVE;
    s.draw = leaf.draw;
    s.primitive = leaf.primitive + part;
    s.barycentrics = b;
    if (s.pdf > 0.0)
        s.radiance = hg_emitter_radiance(hg_emitter_vertex(
            t, b, hg_emitter_cone_width + hg_emitter_cone_spread * distance));
    return s;
}

// Leaf of a triangle, its place in it; false: it is not among those that are chosen.
bool hg_emitter_find(uint draw, uint primitive, out uint leaf, out uint part)
{
    leaf = part = 0u;
    if (draw >= HG_EMITTERS.draw_count)
        return false;
    uint low = HG_EMITTERS.draw_pieces.v[draw], end = HG_EMITTERS.draw_pieces.v[draw + 1u];
    if (low >= end)
        return false;
    uint high = end - 1u;
    for (uint i = 0u; i < 32u && low < high; i++) { // the last that starts at or before it
        uint middle = (low + high + 1u) >> 1u;
        if (HG_EMITTERS.pieces.v[middle].first_primitive <= primitive)
            low = middle;
        else
            high = middle - 1u;
    }
    hg_gpu_emitter_piece piece = HG_EMITTERS.pieces.v[low];
    uint i = primitive - piece.first_primitive;
    leaf = piece.first_leaf + (i >> piece.shift);
    part = i & ((1u << piece.shift) - 1u);
    return primitive >= piece.first_primitive && i < piece.count;
}

// --- punctual lights -----------------------------------------------------------------------------

hg_emitter_sample hg_emitter_delta(uint index, float chance, vec3 position_ws)
{
    hg_emitter_sample s = hg_emitter_nothing();
    hg_gpu_light light = HG_EMITTER_LIGHT(index);
    vec3 l;
    vec3 e = hg_light_illuminance(light, position_ws, l);
    s.direction = l;
    s.group = HG_EMITTER_GROUP_PUNCTUAL;
    s.draw = light.id;
    s.distance = HG_EMITTER_FAR;
    if (light.kind != HG_LIGHT_KIND_DIRECTIONAL)
        s.distance = distance(light.position_ws, position_ws) * HG_EMITTER_NEAR;
    s.delta = chance > 0.0 && max(e.r, max(e.g, e.b)) > 0.0;
    if (s.delta)
        s.radiance = e / chance;
    return s;
}

hg_emitter_sample hg_emitter_pick_sun(
    float share, vec3 position_ws, vec3 normal_ws, hg_emitter_dice dice)
{
    if (!HG_EMITTER_MAY(HG_EMITTER_KIND_SUNS))
        return hg_emitter_delta(0u, share, position_ws);
    uint count = HG_EMITTERS.directional_count;
    if (count <= HG_EMITTER_SUNS) {
        float sum = hg_emitter_suns(normal_ws), at = dice.u * sum, mine = 0.0;
        uint chosen = HG_EMITTER_NONE;
        for (uint i = 0u; i < count; i++) { // the last one that shines, if rounding passes it by
            float w = hg_emitter_sun(i, normal_ws);
            if (w > 0.0 && (chosen == HG_EMITTER_NONE || at >= 0.0)) {
                chosen = i;
                mine = w;
            }
            at -= w;
        }
        if (chosen == HG_EMITTER_NONE)
            return hg_emitter_nothing();
        return hg_emitter_delta(chosen, share * mine / sum, position_ws);
    }
    uint low = 0u, high = count - 1u;
    for (uint i = 0u; i < 32u && low < high; i++) {
        uint middle = (low + high) >> 1u;
        if (HG_EMITTERS.directional.v[middle] > dice.u)
            high = middle;
        else
            low = middle + 1u;
    }
    float below = low == 0u ? 0.0 : HG_EMITTERS.directional.v[low - 1u];
    return hg_emitter_delta(low, share * (HG_EMITTERS.directional.v[low] - below), position_ws);
}

// --- the environment -----------------------------------------------------------------------------

// Radiance from far away.
vec3 hg_emitter_environment(vec3 direction_ws)
{
    if (hg_frame.lighting.env_kind != HG_ENV_KIND_IMAGE)
        return hg_frame.lighting.env_color;
    return hg_environment_seen(direction_ws, hg_emitter_environment_lod);
}

// First quad of a level of the grid, 1..levels.
uint hg_emitter_quads_at(uint level)
{
    return 1u + 2u * ((1u << (2u * (level - 1u))) - 1u) / 3u;
}

// Solid angle of a cell in row y of the finest grid.
float hg_emitter_cell_angle(uint y, uint levels)
{
    float rows = float(1u << levels);
    return 2.0 * HG_PI / float(2u << levels) * 2.0 * sin(HG_PI * (float(y) + 0.5) / rows) *
        sin(0.5 * HG_PI / rows);
}

// Direction in the image's own frame; *pdf per steradian.
vec3 hg_emitter_warp(vec2 u, out float pdf)
{
    uint levels = HG_EMITTERS.environment_levels;
    hg_emitter_dice dx = hg_emitter_dice_of(u.x, u.xyx), dy = hg_emitter_dice_of(u.y, u.yyx);
    vec4 q = HG_EMITTERS.environment.v[0];
    float total = q.x + q.y;
    uint x = 0u, y = 0u, index = 0u;
    float weight = q.x;
    if (!(q.x > 0.0) || (q.y > 0.0 && !hg_emitter_throw(dx, q.x / total))) {
        x = index = 1u;
        weight = q.y;
    }
    for (uint level = 1u; level <= levels; level++) {
        q = HG_EMITTERS.environment.v[hg_emitter_quads_at(level) + index];
        float top = q.x + q.y, bottom = q.z + q.w;
        bool lower = !(top > 0.0) ||
            (bottom > 0.0 && !hg_emitter_throw(dy, top / (top + bottom)));
        vec2 row = lower ? q.zw : q.xy;
        bool right = !(row.x > 0.0) ||
            (row.y > 0.0 && !hg_emitter_throw(dx, row.x / (row.x + row.y)));
        weight = right ? row.y : row.x;
        x = x * 2u + (right ? 1u : 0u);
        y = y * 2u + (lower ? 1u : 0u);
        index = index * 4u + (right ? 1u : 0u) + (lower ? 2u : 0u);
    }
    pdf = weight / (total * hg_emitter_cell_angle(y, levels));
    // Evenly in solid angle within the cell.
    float rows = float(1u << levels);
    float cosine = mix(cos(HG_PI * float(y) / rows), cos(HG_PI * float(y + 1u) / rows), dy.u);
    float sine = sqrt(max(0.0, (1.0 - cosine) * (1.0 + cosine)));
    float phi = HG_PI * ((float(x) + dx.u) / rows - 1.0);
    return vec3(cos(phi) * sine, cosine, sin(phi) * sine);
}

// Density of hg_emitter_warp for a direction of the world.
float hg_emitter_warp_pdf(vec3 direction_ws)
{
    uint levels = HG_EMITTERS.environment_levels;
    vec2 size = vec2(uvec2(2u, 1u) << levels);
    uvec2 cell = uvec2(clamp(hg_environment_uv(direction_ws) * size, vec2(0.0), size - 1.0));
    vec4 root = HG_EMITTERS.environment.v[0];
    uint quad = cell.x >> levels; // the half
    for (uint level = levels; level-- > 1u;)
        quad = quad * 4u + ((cell.x >> level) & 1u) + ((cell.y >> level) & 1u) * 2u;
    float weight = quad == 0u ? root.x : root.y;
    if (levels > 0u) {
        vec4 q = HG_EMITTERS.environment.v[hg_emitter_quads_at(levels) + quad];
        weight = q[(cell.x & 1u) + (cell.y & 1u) * 2u];
    }
    return weight / ((root.x + root.y) * hg_emitter_cell_angle(cell.y, levels));
}

// Light from behind a surface that lets none through is nothing that was chosen.
bool hg_emitter_faces(vec3 direction, vec3 normal_ws)
{
    return normal_ws == vec3(0.0) || dot(direction, normal_ws) > 0.0;
}

hg_emitter_sample hg_emitter_pick_environment(float share, vec3 normal_ws, vec2 u)
{
    hg_emitter_sample s = hg_emitter_nothing();
    s.distance = HG_EMITTER_FAR;
    s.group = HG_EMITTER_GROUP_ENVIRONMENT;
    bool image = HG_EMITTER_MAY(HG_EMITTER_KIND_IMAGE) &&
        (!HG_EMITTER_MAY(HG_EMITTER_KIND_PLAIN) ||
            HG_EMITTERS.environment_kind == HG_ENV_KIND_IMAGE);
    if (image) {
        vec3 d = hg_emitter_warp(u, s.pdf);
        float c = hg_frame.lighting.env_rotation_cos, r = hg_frame.lighting.env_rotation_sin;
        s.direction = vec3(c * d.x + r * d.z, d.y, c * d.z - r * d.x); // hg_environment_rotate back
    } else if (normal_ws == vec3(0.0)) {
        float z = 1.0 - 2.0 * u.x, phi = 2.0 * HG_PI * u.y;
        s.direction = vec3(vec2(cos(phi), sin(phi)) * sqrt(max(0.0, 1.0 - z * z)), z);
        s.pdf = 0.25 * HG_INV_PI;
    } else {
        vec3 t, b, d = hg_sample_cosine(u);
        hg_basis(normal_ws, t, b);
        s.direction = normalize(t * d.x + b * d.y + normal_ws * d.z);
        s.pdf = d.z * HG_INV_PI;
    }
    s.pdf *= hg_emitter_faces(s.direction, normal_ws) ? share : 0.0;
    if (s.pdf > 0.0)
        s.radiance = hg_emitter_environment(s.direction);
    return s;
}

// --- for the integrator --------------------------------------------------------------------------

// Light for a point. u: three random numbers in [0, 1).
hg_emitter_sample hg_emitter_pick(vec3 position_ws, vec3 normal_ws, vec3 u)
{
    vec3 shares = hg_emitter_shares(position_ws, normal_ws);
    hg_emitter_dice dice = hg_emitter_dice_of(u.x, u);
    if (shares.x + shares.y + shares.z <= 0.0)
        return hg_emitter_nothing();
    float others = shares.x + shares.y;
    if (HG_EMITTER_MAY(HG_EMITTER_KIND_IMAGE | HG_EMITTER_KIND_PLAIN) && shares.z > 0.0 && (others <= 0.0 || hg_emitter_throw(dice, shares.z)))
        return hg_emitter_pick_environment(shares.z, normal_ws, u.yz);
    if (HG_EMITTER_MAY(HG_EMITTER_KIND_SUN) && !HG_EMITTER_APART && shares.y > 0.0 && (shares.x <= 0.0 || hg_emitter_throw(dice, shares.y / others)))
        return hg_emitter_pick_sun(shares.y, position_ws, normal_ws, dice);
    if (!HG_EMITTER_MAY(HG_EMITTER_KIND_TREE))
        return hg_emitter_nothing();
    float chance;
    uint found = hg_emitter_descend(position_ws, normal_ws, dice, chance);
    if (found >= HG_EMITTERS.leaf_count)
        return hg_emitter_nothing();
    hg_gpu_emitter_leaf leaf = HG_EMITTERS.leaves.v[found];
    if ((leaf.count & HG_EMITTER_IS_LIGHT) != 0u)
        return hg_emitter_delta(leaf.draw, chance * shares.x, position_ws);
    return hg_emitter_pick_triangle(leaf, chance * shares.x, position_ws, dice.u, u.yz);
}

// A directional light, besides what hg_emitter_pick chooses.
hg_emitter_sample hg_emitter_pick_apart(vec3 position_ws, vec3 normal_ws, float u)
{
    if (!HG_EMITTER_APART || hg_emitter_suns(normal_ws) <= 0.0)
        return hg_emitter_nothing();
    return hg_emitter_pick_sun(1.0, position_ws, normal_ws, hg_emitter_dice_of(u, position_ws));
}

// Density with which hg_emitter_pick would have chosen a point of a triangle. What the point's
// geometric normal is follows from the triangle.
float hg_emitter_pdf_triangle(vec3 position_ws, vec3 normal_ws, uint draw, uint primitive,
    vec3 hit_position_ws, vec3 hit_geometric_normal)
{
    uint found, part;
    if (!HG_EMITTER_MAY(HG_EMITTER_KIND_TREE))
        return 0.0;
    if (!hg_emitter_find(draw, primitive, found, part))
        return 0.0;
    uint trail = HG_EMITTERS.trails.v[found];
    if (trail == HG_EMITTER_NONE)
        return 0.0;
    hg_gpu_emitter_leaf leaf = HG_EMITTERS.leaves.v[found];
    hg_emitter_triangle t = hg_emitter_fetch(draw, primitive);
    vec3 d = hit_position_ws - position_ws;
    float d2 = dot(d, d);
    vec3 w = d * inversesqrt(max(d2, 1e-30));
    float pdf = hg_emitter_solid_angle_pdf(t.area, d2, hg_emitter_cosine(t, w));
    if (pdf <= 0.0)
        return 0.0;
    return pdf * hg_emitter_part_chance(leaf, part) *
        hg_emitter_shares(position_ws, normal_ws).x *
        hg_emitter_leaf_chance(trail, position_ws, normal_ws);
}

// Density with which hg_emitter_pick would have chosen a direction that leads to the environment.
float hg_emitter_pdf_environment(vec3 position_ws, vec3 normal_ws, vec3 direction_ws)
{
    if (!HG_EMITTER_MAY(HG_EMITTER_KIND_IMAGE | HG_EMITTER_KIND_PLAIN) ||
        HG_EMITTERS.environment_kind == HG_ENV_KIND_NONE ||
        !hg_emitter_faces(direction_ws, normal_ws))
        return 0.0;
    float share = hg_emitter_shares(position_ws, normal_ws).z;
    if (HG_EMITTER_MAY(HG_EMITTER_KIND_IMAGE) && HG_EMITTERS.environment_kind == HG_ENV_KIND_IMAGE)
        return share * hg_emitter_warp_pdf(direction_ws);
    if (normal_ws == vec3(0.0))
        return share * 0.25 * HG_INV_PI;
    return share * max(0.0, dot(direction_ws, normal_ws)) * HG_INV_PI;
}

#endif
