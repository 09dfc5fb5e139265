#include "renderer/gi/direct.h"

#include <float.h>

#include "renderer/math/vec.h"

#define MOST_CANDIDATES 64 // lamps that one hit weighs; of more every n-th, which count n times

// --- lights --------------------------------------------------------------------------------------

// Illuminance per unit of a light's colour on a surface, and the way to it; distance: metres.
// KHR_lights_punctual, as hg_light_illuminance in shaders/lib/light.glsl.
static float illuminance(
    const struct hg_gpu_light *light, const struct hg_gi_receiver *r, float to[3], float *distance)
{
    const float way[3] = {light->direction_ws.x, light->direction_ws.y, light->direction_ws.z};
    const float from[3] = {light->position_ws.x, light->position_ws.y, light->position_ws.z};
    *distance = FLT_MAX;
    if (light->kind == HG_LIGHT_KIND_DIRECTIONAL) {
        for (int a = 0; a < 3; a++)
            to[a] = -way[a];
        return fmaxf(hg_dot3(to, r->normal), 0);
    }
    hg_sub3(from, r->position, to);
    const float d2 = fmaxf(hg_dot3(to, to), 1e-8f), q = d2 * light->inv_range_sq;
    *distance = sqrtf(d2);
    for (int a = 0; a < 3; a++)
        to[a] /= *distance;
    float e = hg_clampf(1 - q * q, 0, 1) / d2 * fmaxf(hg_dot3(to, r->normal), 0);
    if (light->kind == HG_LIGHT_KIND_SPOT) {
        const float cone =
            hg_clampf(-hg_dot3(to, way) * light->spot_scale + light->spot_offset, 0, 1);
        e *= cone * cone;
    }
    return e;
}

static void ask(const struct hg_lighting_sources *sources, uint32_t light,
    const struct hg_gi_receiver *r, struct hg_gi_direct *out, uint32_t slot)
{
    const struct hg_gpu_light *l = &sources->lights[light];
    float to[3], distance, lifted[3];
    const float e = illuminance(l, r, to, &distance);
    const float color[3] = {l->color.x, l->color.y, l->color.z};
    for (int c = 0; c < 3; c++)
        out->light[slot][c] = color[c] * e * (float)(1 / HG_PI);
    if (!(e > 0) || !sources->casts[light])
        return;
    hg_mad3(r->position, r->normal, r->lift, lifted);
    out->rays[slot] = (struct hg_gpu_ray){.origin_ws = {lifted[0], lifted[1], lifted[2]},
        .direction_ws = {to[0], to[1], to[2]},
        .t_max = distance < FLT_MAX ? distance - r->lift : FLT_MAX,
        .mask = HG_RAY_OPAQUE | HG_RAY_MASK};
}

static float weight_of(const struct hg_gpu_light *light, const struct hg_gi_receiver *r)
{
    float to[3], distance;
    const float most = fmaxf(light->color.x, fmaxf(light->color.y, light->color.z));
    return illuminance(light, r, to, &distance) * most;
}

// One of the lights from `first` on, with a probability in proportion to its light here.
static void ask_one(const struct hg_lighting_sources *sources, uint32_t first,
    const struct hg_gi_receiver *r, struct hg_gi_direct *out, uint32_t slot)
{
    const uint32_t count = sources->count - first;
    const uint32_t stride = (count + MOST_CANDIDATES - 1) / MOST_CANDIDATES;
    const uint32_t shift = stride > 1 ? (uint32_t)(r->xi * 65536) % stride : 0;
    float sum = 0, chosen_weight = 0, pick = r->xi;
    uint32_t chosen = UINT32_MAX;
    for (uint32_t i = first + shift; i < sources->count; i += stride) {
        const float w = weight_of(&sources->lights[i], r);
        if (!(w > 0))
            continue;
        sum += w;
        const float share = w / sum;
        const bool take = pick < share;
        if (take) {
            chosen = i;
            chosen_weight = w;
        }
        pick = take ? pick / share : (pick - share) / fmaxf(1 - share, 1e-6f);
    }
    if (chosen == UINT32_MAX)
        return;
    ask(sources, chosen, r, out, slot);
    for (int c = 0; c < 3; c++)
        out->light[slot][c] *= sum / chosen_weight * (float)stride;
}

void hg_gi_direct_at(const struct hg_lighting_sources *sources, const struct hg_gi_receiver *r,
    struct hg_gi_direct *out)
{
    const uint32_t suns = sources->directional_count < 2 ? sources->directional_count : 2;
    *out = (struct hg_gi_direct){0};
    for (uint32_t i = 0; i < HG_GI_SHADOW_RAYS; i++)
        out->rays[i].t_max = -1;
    for (uint32_t i = 0; i < suns; i++)
        ask(sources, i, r, out, i);
    if (sources->count > suns)
        ask_one(sources, suns, r, out, 2);
}
