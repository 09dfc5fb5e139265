// emitters_tree.glsl - sets of lights and the way down to one of them. Part of lib/emitters.glsl.
//
// Source: Conty Estevez and Kulla 2018, "Importance Sampling of Many Lights with Adaptive Tree
// Splitting" (bounds and importance of sets of lights).
#ifndef HG_LIB_EMITTERS_TREE_GLSL
#define HG_LIB_EMITTERS_TREE_GLSL

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
        return value / clamp(r2, 1e-8, 1e20); // not 0, however far apart lights are
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

#endif
