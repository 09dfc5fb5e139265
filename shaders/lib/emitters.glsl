// emitters.glsl - choosing light for a point of a surface, and with which density it is chosen.
//
// Define HG_EMITTERS as an expression of type hg_gpu_emitters first, and include lib/frame.glsl.
// Positions are those of the frame (relative to the geometry's origin), directions are unit length.
// normal_ws: of the side that light has to come from; vec3(0): light from every side counts. Surfaces
// that let light through have to ask with vec3(0), else emitters behind them are never chosen. A
// direction is drawn by hg_emitter_pick with the density that the two pdf functions return for the
// same position and normal; where they return 0 it never is, and light found there by other means
// counts in full.
//
// Emissive triangles shine from their front side, from both when they are double-sided; unlit ones
// are never chosen (their colour is no light). What is chosen does not depend on what is resident.
#ifndef HG_LIB_EMITTERS_GLSL
#define HG_LIB_EMITTERS_GLSL

#include "lib/texture.glsl"
#include "lib/material.glsl"
#include "lib/environment.glsl"
#include "lib/light.glsl"
#include "shared/emitters.h"
#include "shared/ray.h"

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
    uint mask;      // HG_RAY_* of the ray there
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

// Numbers by whose rounding a triangle may lie elsewhere than where rays meet it: an expression.
#ifndef HG_EMITTER_TERMS
#define HG_EMITTER_TERMS(draw, world) 0.0
#endif

// Punctual lights of such a time: an expression.
#ifndef HG_EMITTER_LIGHT
#define HG_EMITTER_LIGHT(index) HG_EMITTERS.lights.v[index]
#endif

// Defined before: nodes that were looked at are counted.
#ifdef HG_EMITTER_COUNT_WORK
uint hg_emitter_work = 0u;
#endif

#define HG_EMITTER_FAR 1e30

float hg_emitter_luminance(vec3 c)
{
    return dot(max(c, vec3(0.0)), vec3(0.2126, 0.7152, 0.0722));
}

// How far a ray from a point goes to a place so that it does not meet the surface that the place is
// on: by more than the rounding of either, off the surface; at grazing angles no less than it has to.
// cosine: of the ray at that surface; terms: HG_EMITTER_TERMS.
float hg_emitter_reach(vec3 position_ws, float distance, float cosine, float terms)
{
    vec3 a = abs(position_ws);
    float rounding = max((max(a.x, max(a.y, a.z)) + distance) * 8e-6, terms * 2e-6);
    return distance - min(rounding / max(cosine, 1e-6), max(rounding, distance * 1e-4));
}

hg_emitter_sample hg_emitter_nothing()
{
    return hg_emitter_sample(vec3(0.0, 1.0, 0.0), 0.0, HG_RAY_ALL, vec3(0.0), 0.0, false, 0u,
        HG_EMITTER_NONE, 0u, vec2(0.0));
}

#include "lib/emitters_dice.glsl"
#include "lib/emitters_tree.glsl"
#include "lib/emitters_triangles.glsl"
#include "lib/emitters_shapes.glsl"
#include "lib/emitters_punctual.glsl"
#include "lib/emitters_environment.glsl"

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

// Light for a point. u: three random numbers in [0, 1).
hg_emitter_sample hg_emitter_pick(vec3 position_ws, vec3 normal_ws, vec3 u)
{
    vec3 shares = hg_emitter_shares(position_ws, normal_ws);
    hg_emitter_dice dice = hg_emitter_dice_of(u.x, u);
    if (shares.x + shares.y + shares.z <= 0.0)
        return hg_emitter_nothing();
    float others = shares.x + shares.y;
    if (HG_EMITTER_MAY(HG_EMITTER_KIND_IMAGE | HG_EMITTER_KIND_PLAIN) && shares.z > 0.0 &&
        (others <= 0.0 || hg_emitter_throw(dice, shares.z)))
        return hg_emitter_pick_environment(shares.z, normal_ws, u.yz);
    if (HG_EMITTER_MAY(HG_EMITTER_KIND_SUN) && !HG_EMITTER_APART && shares.y > 0.0 &&
        (shares.x <= 0.0 || hg_emitter_throw(dice, shares.y / others)))
        return hg_emitter_pick_sun(shares.y, position_ws, normal_ws, dice, u.yz);
    if (!HG_EMITTER_MAY(HG_EMITTER_KIND_TREE))
        return hg_emitter_nothing();
    float chance;
    uint found = hg_emitter_descend(position_ws, normal_ws, dice, chance);
    if (found >= HG_EMITTERS.leaf_count)
        return hg_emitter_nothing();
    hg_gpu_emitter_leaf leaf = HG_EMITTERS.leaves.v[found];
    if ((leaf.count & HG_EMITTER_IS_LIGHT) != 0u)
        return hg_emitter_light(leaf.draw, chance * shares.x, position_ws, u.yz);
    return hg_emitter_pick_triangle(leaf, chance * shares.x, position_ws, dice.u, u.yz);
}

// A directional light, besides what hg_emitter_pick chooses.
hg_emitter_sample hg_emitter_pick_apart(vec3 position_ws, vec3 normal_ws, vec3 u)
{
    if (!HG_EMITTER_APART || hg_emitter_suns(normal_ws) <= 0.0)
        return hg_emitter_nothing();
    return hg_emitter_pick_sun(
        1.0, position_ws, normal_ws, hg_emitter_dice_of(u.x, position_ws), u.yz);
}

// Density with which a directional light with a size would have been chosen, by hg_emitter_pick_apart
// where they are chosen apart.
float hg_emitter_pdf_sun(vec3 position_ws, vec3 normal_ws, uint index, hg_gpu_light light)
{
    float share = HG_EMITTER_APART ? 1.0 : hg_emitter_shares(position_ws, normal_ws).y;
    return share * hg_emitter_sun_chance(index, normal_ws) *
        hg_shape_pdf(light, position_ws, hg_shape_hit(HG_EMITTER_FAR, 1.0));
}

// The same of a light with a size and a place; index: among the lights of the tree.
float hg_emitter_pdf_lamp(
    vec3 position_ws, vec3 normal_ws, uint index, hg_gpu_light light, hg_shape_hit hit)
{
    uint trail = HG_EMITTERS.trails.v[HG_EMITTERS.first_lamp_leaf + index];
    if (trail == HG_EMITTER_NONE)
        return 0.0;
    float pdf = hg_shape_pdf(light, position_ws, hit);
    return pdf <= 0.0 ? 0.0 : pdf * hg_emitter_shares(position_ws, normal_ws).x *
            hg_emitter_leaf_chance(trail, position_ws, normal_ws);
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
