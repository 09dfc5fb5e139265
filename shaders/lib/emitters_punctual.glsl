// emitters_punctual.glsl - lights of the scene, the directional ones among them. Part of
// lib/emitters.glsl.
#ifndef HG_LIB_EMITTERS_PUNCTUAL_GLSL
#define HG_LIB_EMITTERS_PUNCTUAL_GLSL

// u: where on lights with a size.
hg_emitter_sample hg_emitter_light(uint index, float chance, vec3 position_ws, vec2 u)
{
    hg_emitter_sample s = hg_emitter_nothing();
    hg_gpu_light light = HG_EMITTER_LIGHT(index);
    if (HG_EMITTER_MAY(HG_EMITTER_KIND_SIZED) && light.radiance > 0.0)
        return hg_emitter_shape(light, chance, position_ws, u);
    vec3 l;
    vec3 e = hg_light_illuminance(light, position_ws, l);
    s.direction = l;
    s.group = HG_EMITTER_GROUP_PUNCTUAL;
    s.draw = light.id;
    s.distance = HG_EMITTER_FAR;
    if (light.kind != HG_LIGHT_KIND_DIRECTIONAL)
        s.distance =
            hg_emitter_reach(position_ws, distance(light.position_ws, position_ws), 1.0, 0.0);
    s.mask = light.shadow == HG_SHADOW_UNASKED ? 0u : HG_RAY_ALL | HG_RAY_STRAIGHT;
    s.delta = chance > 0.0 && max(e.r, max(e.g, e.b)) > 0.0;
    if (s.delta)
        s.radiance = e / chance;
    return s;
}

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

hg_emitter_sample hg_emitter_pick_sun(
    float share, vec3 position_ws, vec3 normal_ws, hg_emitter_dice dice, vec2 u)
{
    if (!HG_EMITTER_MAY(HG_EMITTER_KIND_SUNS))
        return hg_emitter_light(0u, share, position_ws, u);
    uint count = HG_EMITTERS.directional_count;
    if (count <= HG_EMITTER_SUNS) {
        float sum = hg_emitter_suns(normal_ws), at = dice.u * sum, mine = 0.0;
        uint chosen = HG_EMITTER_NONE;
        for (uint i = 0u; i < count; i++) { // the last one with non-zero power, in case of rounding
            float w = hg_emitter_sun(i, normal_ws);
            if (w > 0.0 && (chosen == HG_EMITTER_NONE || at >= 0.0)) {
                chosen = i;
                mine = w;
            }
            at -= w;
        }
        if (chosen == HG_EMITTER_NONE)
            return hg_emitter_nothing();
        return hg_emitter_light(chosen, share * mine / sum, position_ws, u);
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
    return hg_emitter_light(
        low, share * (HG_EMITTERS.directional.v[low] - below), position_ws, u);
}

// Chance with which hg_emitter_pick_sun chooses a directional light.
float hg_emitter_sun_chance(uint index, vec3 normal_ws)
{
    uint count = HG_EMITTERS.directional_count;
    if (!HG_EMITTER_MAY(HG_EMITTER_KIND_SUNS))
        return hg_emitter_sun(0u, normal_ws) > 0.0 ? 1.0 : 0.0;
    if (count <= HG_EMITTER_SUNS)
        return hg_emitter_sun(index, normal_ws) / max(hg_emitter_suns(normal_ws), 1e-30);
    float below = index == 0u ? 0.0 : HG_EMITTERS.directional.v[index - 1u];
    return HG_EMITTERS.directional.v[index] - below;
}

#endif
