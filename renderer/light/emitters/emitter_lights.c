// Punctual lights of the emitters. See emitter_lights.h.
#include "renderer/light/emitters/emitter_lights.h"

#include <math.h>

#include "base/alloc.h"
#include "base/hash.h"
#include "renderer/math/vec.h"

float hg_emitter_luminance(float r, float g, float b)
{
    const float sum = 0.2126f * fmaxf(r, 0) + 0.7152f * fmaxf(g, 0) + 0.0722f * fmaxf(b, 0);
    return isfinite(r) && isfinite(g) && isfinite(b) && isfinite(sum) ? sum : 0;
}

static float light_luminance(const struct hg_gpu_light *light)
{
    return hg_emitter_luminance(light->color.x, light->color.y, light->color.z);
}

static bool is_finite3(struct hg_vec3 v)
{
    return isfinite(v.x) && isfinite(v.y) && isfinite(v.z);
}

static bool is_usable(const struct hg_gpu_light *light)
{
    return light_luminance(light) > 0 && is_finite3(light->direction_ws) &&
           isfinite(light->inv_range_sq) && isfinite(light->spot_scale) &&
           isfinite(light->spot_offset) && isfinite(light->radiance) &&
           (light->kind == HG_LIGHT_KIND_DIRECTIONAL || is_finite3(light->position_ws));
}

// The sun of a sky, of its size; it does not move while a shutter is open. Its number follows those
// of the scene's lights.
static struct hg_gpu_light light_of_sky(const struct hg_emitter_lights *l)
{
    struct hg_gpu_light light = hg_light_of_sun(l->sun.lux, l->sun.towards_ws);
    light.radius = sinf(HG_SUN_RADIUS);
    light.bound = cosf(HG_SUN_RADIUS);
    light.radiance = 1 / ((float)HG_PI * light.radius * light.radius);
    light.id = l->set.count;
    return light;
}

static void add(struct hg_emitter_lights *l, const struct hg_gpu_light *light, uint64_t *signature)
{
    if (light->kind == HG_LIGHT_KIND_DIRECTIONAL) {
        l->directional_count++;
        l->directional_lux += light_luminance(light);
        l->sized_suns += light->radiance > 0;
    } else {
        l->sized_lamps += light->radiance > 0;
    }
    *signature = hg_hash_mix_bytes(*signature, light, sizeof *light);
    l->items[l->count++] = *light;
}

enum hg_status hg_emitter_lights_collect(struct hg_emitter_lights *l, const struct hg_scene *scene,
    const double origin[3], uint64_t *signature)
{
    if (hg_light_set_collect(&l->set, scene, origin) ||
        hg_grow(&l->items, &l->capacity, 2 * ((size_t)l->set.count + 1), sizeof *l->items))
        return HG_E_NOMEM;
    // If a light exists at one of the two times only, all lights are static.
    l->move = l->opening && l->closing && l->opening->count == l->set.count &&
              l->closing->count == l->set.count;
    const struct hg_gpu_light *now = l->move ? l->closing->items : l->set.items;
    const struct hg_gpu_light *then = l->move ? l->opening->items : l->set.items;
    l->count = l->directional_count = l->sized_suns = l->sized_lamps = 0;
    l->directional_lux = 0;
    hg_sky_disc_update(&l->sun, &scene->environment, l->set.directional_count > 0);
    const struct hg_gpu_light sun = light_of_sky(l);
    const bool shines = hg_sky_disc_is_there(&l->sun) && is_usable(&sun);
    if (shines)
        add(l, &sun, signature);
    for (uint32_t i = 0; i < l->set.count; i++) {
        if (!is_usable(&now[i]) || !is_usable(&then[i]))
            continue;
        struct hg_gpu_light light = now[i];
        light.shadow = l->set.casts[i] ? HG_SHADOW_NONE : HG_SHADOW_UNASKED;
        add(l, &light, signature);
    }
    uint32_t k = l->count;
    if (l->move && shines)
        l->items[k++] = sun;
    for (uint32_t i = 0; i < l->set.count && l->move; i++) {
        if (!is_usable(&now[i]) || !is_usable(&then[i]))
            continue;
        *signature = hg_hash_mix_bytes(*signature, &then[i], sizeof then[i]);
        l->items[k++] = then[i];
    }
    return HG_OK;
}

void hg_emitter_lights_finish(struct hg_emitter_lights *l)
{
    hg_free(l->items);
    hg_light_set_finish(&l->set);
}

void hg_emitter_lights_shares(const struct hg_emitter_lights *l, float *shares)
{
    double sum = 0;
    for (uint32_t i = 0; i < l->directional_count; i++) {
        sum += (double)light_luminance(&l->items[i]) / (double)l->directional_lux;
        shares[i] = i + 1 < l->directional_count ? (float)fmin(1, sum) : 1;
    }
}

// Half of the box around a light, metres.
static void extent_of(const struct hg_gpu_light *light, float out[3])
{
    const float x[3] = {light->axis_ws.x, light->axis_ws.y, light->axis_ws.z};
    const float z[3] = {light->direction_ws.x, light->direction_ws.y, light->direction_ws.z};
    float y[3];
    hg_cross3(z, x, y);
    for (int a = 0; a < 3; a++) {
        if (light->kind == HG_LIGHT_KIND_RECTANGLE)
            out[a] = fabsf(x[a]) * light->half_width + fabsf(y[a]) * light->half_height;
        else if (light->kind == HG_LIGHT_KIND_TUBE)
            out[a] = fabsf(x[a]) * light->half_width + light->radius;
        else
            out[a] = light->radius;
        out[a] *= 1.0001f; // rays that meet it by rounding alone
    }
}

struct hg_light_item hg_emitter_lamp_leaf(const struct hg_gpu_light *light)
{
    struct hg_light_item item = {.cos_o = -1,
        .cos_e = 1,
        .power = light_luminance(light),
        .range = hg_gpu_light_range(light)};
    memcpy(item.min, &light->position_ws, sizeof item.min);
    memcpy(item.max, &light->position_ws, sizeof item.max);
    memcpy(item.axis, &light->direction_ws, sizeof item.axis);
    if (light->radiance > 0) {
        float half[3];
        extent_of(light, half);
        hg_sub3(item.min, half, item.min);
        hg_mad3(item.max, half, 1, item.max);
    }
    if (light->kind == HG_LIGHT_KIND_RECTANGLE || light->kind == HG_LIGHT_KIND_DISC) {
        item.cos_o = 1;
        item.cos_e = 0;
    }
    // The cone ends where cos * scale + offset is 0.
    if (light->kind == HG_LIGHT_KIND_SPOT && light->spot_scale > 0 &&
        hg_dot3(item.axis, item.axis) > 0.5f)
        item.cos_o = hg_clampf(-light->spot_offset / light->spot_scale - 1e-4f, -1, 1);
    return item;
}

// Total power of the light.
static void widen(struct hg_light_item *item, const struct hg_light_item *then)
{
    for (int i = 0; i < 3; i++) {
        item->min[i] = fminf(item->min[i], then->min[i]);
        item->max[i] = fmaxf(item->max[i], then->max[i]);
    }
    if (memcmp(item->axis, then->axis, sizeof item->axis) != 0)
        item->cos_o = -1;
    item->cos_e = fminf(item->cos_e, then->cos_e);
    item->cos_o = fminf(item->cos_o, then->cos_o);
    item->power = fmaxf(item->power, then->power);
    item->range = item->range > 0 && then->range > 0 ? fmaxf(item->range, then->range) : 0;
}

struct hg_light_item hg_emitter_lights_leaf(const struct hg_emitter_lights *l, uint32_t index)
{
    struct hg_light_item leaf = hg_emitter_lamp_leaf(&l->items[index]);
    if (l->move) {
        const struct hg_light_item then = hg_emitter_lamp_leaf(&l->items[l->count + index]);
        widen(&leaf, &then);
    }
    return leaf;
}

enum hg_status hg_emitter_lights_tree(
    const struct hg_emitter_lights *l, struct hg_jobs *jobs, struct hg_light_tree *out)
{
    const uint32_t count = l->count - l->directional_count;
    *out = (struct hg_light_tree){0};
    if (l->sized_lamps == 0)
        return HG_OK;
    struct hg_light_item *items = hg_calloc(count, sizeof *items);
    if (!items)
        return HG_E_NOMEM;
    for (uint32_t i = 0; i < count; i++) { // those without a size stay dark, which leaves them out
        if (l->items[l->directional_count + i].radiance > 0)
            items[i] = hg_emitter_lights_leaf(l, l->directional_count + i);
    }
    const enum hg_status status = hg_light_tree_build(items, count, jobs, out);
    hg_free(items);
    return status;
}
