#include "renderer/host_shading/direct.h"

#include <float.h>

#include "base/hash.h"
#include "renderer/light/light_tint.h"
#include "renderer/math/vec.h"

#define MOST_CANDIDATES 64 // lamps that one hit weighs; of more every n-th, which count n times

// --- lights --------------------------------------------------------------------------------------

// Share of a light that its range and cone leave at a point, d from it to the light's middle.
static float share_of(const struct hg_gpu_light *light, const float d[3], float d2)
{
    const float way[3] = {light->direction_ws.x, light->direction_ws.y, light->direction_ws.z};
    const float q = d2 * light->inv_range_sq, window = hg_clampf(1 - q * q, 0, 1);
    if (light->kind != HG_LIGHT_KIND_SPOT)
        return window;
    const float cosine = -hg_dot3(d, way) / sqrtf(d2);
    const float cone = hg_clampf(cosine * light->spot_scale + light->spot_offset, 0, 1);
    return window * cone * cone;
}

// A direction within a cap about an axis, whose 1 - cosine is `cap`, evenly.
static void pick_in_cap(const float axis[3], float cap, const float u[2], float out[3])
{
    const float less = u[0] * cap, sine = sqrtf(fmaxf(0, less * (2 - less)));
    const float phi = 2 * (float)HG_PI * u[1],
                up[3] = {0, fabsf(axis[1]) < 0.9f, fabsf(axis[1]) >= 0.9f};
    float s[3], t[3];
    hg_cross3(up, axis, s);
    hg_normalize3(s);
    hg_cross3(axis, s, t);
    for (int a = 0; a < 3; a++)
        out[a] = axis[a] * (1 - less) + s[a] * sine * cosf(phi) + t[a] * sine * sinf(phi);
}

// A point of the surface of a rectangle, disc or tube, from the light's middle, and its normal; d:
// to the middle. Returns the area that it was chosen from.
static float pick_on_surface(const struct hg_gpu_light *light, const float d[3], const float u[2],
    float at[3], float normal[3])
{
    const float x[3] = {light->axis_ws.x, light->axis_ws.y, light->axis_ws.z};
    const float z[3] = {light->direction_ws.x, light->direction_ws.y, light->direction_ws.z};
    float y[3], along = (2 * u[0] - 1) * light->half_width, across = 0;
    hg_cross3(z, x, y);
    memcpy(normal, z, sizeof y);
    if (light->kind == HG_LIGHT_KIND_TUBE) { // of the part that faces the point
        float back[3];
        hg_mad3(d, x, -hg_dot3(d, x), back);
        const float distance = sqrtf(hg_dot3(back, back));
        const float most = acosf(hg_clampf(light->radius / fmaxf(distance, 1e-20f), 0, 1));
        const float phi = (2 * u[1] - 1) * most;
        for (int a = 0; a < 3; a++)
            back[a] /= -fmaxf(distance, 1e-20f);
        hg_cross3(x, back, y);
        for (int a = 0; a < 3; a++) {
            normal[a] = back[a] * cosf(phi) + y[a] * sinf(phi);
            at[a] = x[a] * along + normal[a] * light->radius;
        }
        return 4 * most * light->radius * light->half_width;
    }
    across = (2 * u[1] - 1) * light->half_height;
    if (light->kind == HG_LIGHT_KIND_DISC) {
        along = light->radius * sqrtf(u[0]) * cosf(2 * (float)HG_PI * u[1]);
        across = light->radius * sqrtf(u[0]) * sinf(2 * (float)HG_PI * u[1]);
    }
    for (int a = 0; a < 3; a++)
        at[a] = x[a] * along + y[a] * across;
    return light->kind == HG_LIGHT_KIND_DISC ? (float)HG_PI * light->radius * light->radius
                                             : 4 * light->half_width * light->half_height;
}

// The same as illuminance, of a point of a light with a size that two numbers in [0, 1) choose: its
// mean is that of the whole surface.
static float sized_illuminance(const struct hg_gpu_light *light, const struct hg_host_receiver *r,
    const float u[2], float to[3], float *distance)
{
    const float middle[3] = {light->position_ws.x, light->position_ws.y, light->position_ws.z};
    const float towards[3] = {
        -light->direction_ws.x, -light->direction_ws.y, -light->direction_ws.z};
    float d[3], at[3], normal[3];
    if (light->kind == HG_LIGHT_KIND_DIRECTIONAL) {
        const float cap = light->radius * light->radius / (1 + light->bound);
        pick_in_cap(towards, cap, u, to);
        return 2 * (float)HG_PI * cap * light->radiance * fmaxf(hg_dot3(to, r->normal), 0);
    }
    hg_sub3(middle, r->position, d);
    const float d2 = hg_dot3(d, d), radiance = light->radiance * share_of(light, d, d2);
    if (light->kind <= HG_LIGHT_KIND_SPOT) {
        if (d2 <= light->radius * light->radius)
            return 0;
        const float sine2 = light->radius * light->radius / d2;
        const float cap = sine2 / (1 + sqrtf(1 - sine2)), length = sqrtf(d2);
        const float axis[3] = {d[0] / length, d[1] / length, d[2] / length};
        pick_in_cap(axis, cap, u, to);
        *distance = length - light->radius;
        return 2 * (float)HG_PI * cap * radiance * fmaxf(hg_dot3(to, r->normal), 0);
    }
    const float area = pick_on_surface(light, d, u, at, normal);
    hg_mad3(d, at, 1, to);
    const float square = fmaxf(hg_dot3(to, to), 1e-8f);
    *distance = sqrtf(square);
    for (int a = 0; a < 3; a++)
        to[a] /= *distance;
    const float facing = fmaxf(-hg_dot3(to, normal), 0) * fmaxf(hg_dot3(to, r->normal), 0);
    return radiance * area * facing / square;
}

// Illuminance per unit of a light's colour on a surface, and the way to it; distance: metres.
// KHR_lights_punctual, as hg_light_illuminance in shaders/lib/light.glsl.
static float illuminance(const struct hg_gpu_light *light, const struct hg_host_receiver *r,
    float to[3], float *distance)
{
    const float way[3] = {light->direction_ws.x, light->direction_ws.y, light->direction_ws.z};
    const float from[3] = {light->position_ws.x, light->position_ws.y, light->position_ws.z};
    *distance = FLT_MAX;
    if (light->radiance > 0) {
        const uint64_t bits = hg_hash_mix_bytes(hg_hash_mix(1, light->id), r, sizeof *r);
        const float u[2] = {
            (float)(bits >> 40) * 0x1p-24f, (float)(bits >> 16 & 0xffffff) * 0x1p-24f};
        return sized_illuminance(light, r, u, to, distance);
    }
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

// What profile and image of a light leave of a colour; to: where it is lit from, unit, and how far
// away.
static void tint(const struct hg_lighting_sources *sources, const struct hg_gpu_light *light,
    const struct hg_host_receiver *r, const float to[3], float distance, float color[3])
{
    const float middle[3] = {light->position_ws.x, light->position_ws.y, light->position_ws.z};
    float at[3], offset[3], whole[3], spot[3];
    hg_light_tint(light, sources->tables, r->position, whole);
    hg_mad3(r->position, to, distance < FLT_MAX ? distance : 0, at);
    hg_sub3(at, middle, offset);
    hg_light_surface_tint(light, sources->tables, offset, spot);
    for (int c = 0; c < 3; c++)
        color[c] *= whole[c] * spot[c];
}

static void ask(const struct hg_lighting_sources *sources, uint32_t light,
    const struct hg_host_receiver *r, struct hg_host_direct *out, uint32_t slot)
{
    const struct hg_gpu_light *l = &sources->lights[light];
    float to[3], distance, lifted[3];
    const float e = illuminance(l, r, to, &distance);
    float color[3] = {l->color.x, l->color.y, l->color.z};
    if (e > 0 && hg_light_is_tinted(l))
        tint(sources, l, r, to, distance, color);
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

// What is dark by its profile or image has no weight.
static float weight_of(const struct hg_lighting_sources *sources, const struct hg_gpu_light *light,
    const struct hg_host_receiver *r)
{
    float to[3], distance, whole[3];
    hg_light_tint(light, sources->tables, r->position, whole);
    const float most = fmaxf(
        light->color.x * whole[0], fmaxf(light->color.y * whole[1], light->color.z * whole[2]));
    if (light->radiance > 0 && light->kind != HG_LIGHT_KIND_DIRECTIONAL) {
        // Whatever point is chosen may have light, so that no angle leaves it out.
        const float middle[3] = {light->position_ws.x, light->position_ws.y, light->position_ws.z};
        hg_sub3(middle, r->position, to);
        const float d2 = fmaxf(hg_dot3(to, to), light->bound * light->bound);
        return most * share_of(light, to, hg_dot3(to, to)) / d2;
    }
    return illuminance(light, r, to, &distance) * most;
}

// One of the lights from `first` on, with a probability in proportion to its light here.
static void ask_one(const struct hg_lighting_sources *sources, uint32_t first,
    const struct hg_host_receiver *r, struct hg_host_direct *out, uint32_t slot)
{
    const uint32_t count = sources->count - first;
    const uint32_t stride = (count + MOST_CANDIDATES - 1) / MOST_CANDIDATES;
    const uint32_t shift = stride > 1 ? (uint32_t)(r->xi * 65536) % stride : 0;
    float sum = 0, chosen_weight = 0, pick = r->xi;
    uint32_t chosen = UINT32_MAX;
    for (uint32_t i = first + shift; i < sources->count; i += stride) {
        const float w = weight_of(sources, &sources->lights[i], r);
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

void hg_host_direct_at(const struct hg_lighting_sources *sources, const struct hg_host_receiver *r,
    struct hg_host_direct *out)
{
    const uint32_t suns = sources->directional_count < 2 ? sources->directional_count : 2;
    hg_host_direct_clear(out);
    for (uint32_t i = 0; i < suns; i++)
        ask(sources, i, r, out, i);
    if (sources->count > suns)
        ask_one(sources, suns, r, out, 2);
}
