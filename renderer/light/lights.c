#include "renderer/light/lights.h"

#include "base/alloc.h"
#include "base/hash.h"
#include "renderer/math/vec.h"
#include "renderer/scene/light_table.h"

#define MOST_TABLES 1024u
#define MOST_WORDS  (16u << 20)

static enum {
    GROUP_DIRECTIONAL,
    GROUP_INFINITE,
    GROUP_RANGED,
    GROUP_COUNT
} light_group(const struct hg_light *light)
{
    if (light->kind == HG_LIGHT_DIRECTIONAL)
        return GROUP_DIRECTIONAL;
    return light->range > 0 ? GROUP_RANGED : GROUP_INFINITE;
}

static bool is_dark(const struct hg_light *light)
{
    float peak = fmaxf(light->color[0], fmaxf(light->color[1], light->color[2]));
    return !(peak * hg_light_peak(light) > 0);
}

// Cone terms of KHR_lights_punctual, "Inner and Outer Cone Angles".
static void set_cone(struct hg_gpu_light *out, const struct hg_light *light)
{
    float outer = cosf(light->outer_cone_rad), inner = cosf(light->inner_cone_rad);
    out->spot_scale = 1 / fmaxf(0.001f, inner - outer);
    out->spot_offset = -outer * out->spot_scale;
}

// Size and radiance, so that what is far away gets as much light as from a point of the same
// intensity. Sizes that are no numbers above 0 are left out.
static void set_size(struct hg_gpu_light *out, const struct hg_light *light)
{
    const float pi = (float)HG_PI, r = light->radius, w = light->width, h = light->height;
    const float half_angle = 0.5f * fminf(light->angular_diameter_rad, HG_LIGHT_MOST_ANGLE_RAD);
    float area = 0; // across the direction of the greatest intensity; DIRECTIONAL: projected angle
    out->radius = r;
    out->half_width = 0.5f * w;
    out->half_height = 0.5f * h;
    switch (light->kind) {
    case HG_LIGHT_DIRECTIONAL:
        out->radius = sinf(half_angle);
        out->bound = cosf(half_angle);
        area = half_angle > 0 ? pi * out->radius * out->radius : 0;
        break;
    case HG_LIGHT_POINT:
    case HG_LIGHT_SPOT:
    case HG_LIGHT_DISC:
        out->bound = r;
        out->half_width = out->half_height = 0;
        area = r > 0 ? pi * r * r : 0;
        break;
    case HG_LIGHT_RECTANGLE:
        out->bound = 0.5f * hypotf(w, h);
        area = w > 0 && h > 0 ? w * h : 0;
        break;
    case HG_LIGHT_TUBE:
        out->bound = hypotf(0.5f * w, r);
        area = w > 0 && r > 0 ? 2 * r * w : 0;
        break;
    }
    const float radiance = 1 / area;
    out->radiance = isfinite(area) && isfinite(radiance) && isfinite(out->bound) ? radiance : 0;
    if (!(out->radiance > 0))
        out->radius = out->half_width = out->half_height = out->radiance = out->bound = 0;
}

static bool is_finite(const struct hg_gpu_light *light)
{
    const float *p = (const float *)&light->position_ws, *d = (const float *)&light->direction_ws,
                *c = (const float *)&light->color, *x = (const float *)&light->axis_ws;
    return isfinite(
        hg_dot3(p, p) + hg_dot3(d, d) + hg_dot3(x, x) + c[0] + c[1] + c[2] + light->inv_range_sq);
}

// Of a light that is nowhere: cells, trees and plans of shadow maps need numbers.
static struct hg_gpu_light dark_light(uint32_t kind)
{
    return (struct hg_gpu_light){.kind = kind,
        .inv_range_sq = 1,
        .direction_ws = {0, 0, -1},
        .axis_ws = {1, 0, 0},
        .spot_scale = 1,
        .shadow = HG_SHADOW_NONE};
}

static struct hg_gpu_light make_light(const struct hg_node *node, const double origin[3])
{
    const struct hg_light *light = node->light;
    const float *m = node->world, intensity = hg_light_peak(light);
    float travel[3] = {-m[8], -m[9], -m[10]};
    hg_normalize3(travel);
    struct hg_gpu_light out = {
        .position_ws = {(float)((double)m[12] - origin[0]), (float)((double)m[13] - origin[1]),
            (float)((double)m[14] - origin[2])},
        .direction_ws = {travel[0], travel[1], travel[2]},
        .color = {light->color[0] * intensity, light->color[1] * intensity,
            light->color[2] * intensity},
        .inv_range_sq = light->range > 0 ? 1 / (light->range * light->range) : 0,
        .shadow = HG_SHADOW_NONE,
        .profile = HG_LIGHT_NO_TABLE,
        .image = HG_LIGHT_NO_TABLE,
    };
    static const uint32_t kinds[] = {[HG_LIGHT_DIRECTIONAL] = HG_LIGHT_KIND_DIRECTIONAL,
        [HG_LIGHT_POINT] = HG_LIGHT_KIND_POINT,
        [HG_LIGHT_SPOT] = HG_LIGHT_KIND_SPOT,
        [HG_LIGHT_RECTANGLE] = HG_LIGHT_KIND_RECTANGLE,
        [HG_LIGHT_DISC] = HG_LIGHT_KIND_DISC,
        [HG_LIGHT_TUBE] = HG_LIGHT_KIND_TUBE};
    out.kind = kinds[light->kind];
    if (out.kind == HG_LIGHT_KIND_SPOT)
        set_cone(&out, light);
    set_size(&out, light);
    // Square to the direction: rotations and even scales keep it so, others need not.
    float x[3] = {m[0], m[1], m[2]};
    hg_mad3(x, travel, -hg_dot3(x, travel), x);
    hg_normalize3(x);
    out.axis_ws = (struct hg_vec3){x[0], x[1], x[2]};
    const bool turned = fabsf(hg_dot3(x, x) - 1) < 1e-3f; // else its matrix has no inverse
    if (light->kind > HG_LIGHT_SPOT && !(out.radiance > 0 && turned))
        out.color = (struct hg_vec3){0, 0, 0}; // no surface, no light
    return is_finite(&out) ? out : dark_light(out.kind);
}

static enum hg_status reserve_one(struct hg_light_set *set)
{
    size_t need = (size_t)set->count + 1;
    return hg_grow(&set->items, &set->capacity, need, sizeof *set->items) ||
                   hg_grow(&set->casts, &set->casts_capacity, need, sizeof *set->casts) ||
                   hg_grow(&set->nodes, &set->node_capacity, need, sizeof *set->nodes)
               ? HG_E_NOMEM
               : HG_OK;
}

// --- tables --------------------------------------------------------------------------------------

// Place of a table among the words.
static enum hg_status place_table(
    struct hg_light_set *set, struct hg_light_table *table, uint32_t *place)
{
    *place = HG_LIGHT_NO_TABLE;
    if (!table)
        return HG_OK;
    for (uint32_t i = set->table_count; i-- > 0;) // lights often share that of the one before
        if (set->tables[i] == table) {
            *place = set->places[i];
            return HG_OK;
        }
    if (set->table_count == MOST_TABLES || table->word_count > MOST_WORDS - set->word_count) {
        set->left_out++;
        return HG_OK;
    }
    const size_t need = (size_t)set->table_count + 1;
    if (hg_grow(&set->tables, &set->table_capacity, need, sizeof *set->tables) ||
        hg_grow(&set->places, &set->place_capacity, need, sizeof *set->places))
        return HG_E_NOMEM;
    set->tables[set->table_count] = hg_light_table_ref(table);
    set->places[set->table_count++] = *place = set->word_count;
    set->word_count += table->word_count;
    return HG_OK;
}

static void drop_tables(struct hg_light_set *set)
{
    for (uint32_t i = 0; i < set->table_count; i++)
        hg_light_table_unref(set->tables[i]);
    set->table_count = set->word_count = set->left_out = 0;
}

void hg_light_set_tables(const struct hg_light_set *set, uint32_t *words)
{
    for (uint32_t i = 0; i < set->table_count; i++)
        memcpy(words + set->places[i], set->tables[i]->words,
            (size_t)set->tables[i]->word_count * sizeof *words);
}

uint64_t hg_light_set_table_hash(const struct hg_light_set *set)
{
    uint64_t hash = 0;
    for (uint32_t i = 0; i < set->table_count; i++)
        hash = hg_hash_mix(hash, set->tables[i]->hash);
    return hash;
}

// Which of them a light has is a matter of its kind.
static enum hg_status place_tables(
    struct hg_light_set *set, const struct hg_light *light, struct hg_gpu_light *out)
{
    const bool local = light->kind == HG_LIGHT_POINT || light->kind == HG_LIGHT_SPOT;
    enum hg_status status = place_table(set, local ? light->profile : NULL, &out->profile);
    if (!status)
        status = place_table(set, light->kind != HG_LIGHT_TUBE ? light->image : NULL, &out->image);
    if (light->kind == HG_LIGHT_DIRECTIONAL && light->image) {
        out->half_width = 0.5f * fmaxf(light->width, 1e-6f);
        out->half_height = 0.5f * fmaxf(light->height, 1e-6f);
    }
    return status;
}

// --- sets ----------------------------------------------------------------------------------------

static enum hg_status append(
    struct hg_light_set *set, const struct hg_node *node, const double origin[3])
{
    if (reserve_one(set))
        return HG_E_NOMEM;
    set->items[set->count] = make_light(node, origin);
    if (place_tables(set, node->light, &set->items[set->count]))
        return HG_E_NOMEM;
    set->items[set->count].id = set->count;
    set->nodes[set->count] = node;
    set->casts[set->count++] = node->light->casts_shadow;
    return HG_OK;
}

enum hg_status hg_light_set_collect(
    struct hg_light_set *set, const struct hg_scene *scene, const double origin[3])
{
    const struct hg_object_list *nodes = &scene->objects[HG_OBJECT_NODE];
    set->count = 0;
    drop_tables(set);
    for (int group = 0; group < GROUP_COUNT; group++) {
        for (uint32_t i = 0; i < nodes->count; i++) {
            const struct hg_node *node = (const struct hg_node *)nodes->items[i];
            if (!node->light || !node->world_visible || is_dark(node->light) ||
                (int)light_group(node->light) != group)
                continue;
            enum hg_status status = append(set, node, origin);
            if (status)
                return status;
        }
        if (group == GROUP_DIRECTIONAL)
            set->directional_count = set->count;
        if (group == GROUP_INFINITE)
            set->global_count = set->count;
    }
    return HG_OK;
}

bool hg_scene_has_directional_light(const struct hg_scene *scene)
{
    const struct hg_object_list *nodes = &scene->objects[HG_OBJECT_NODE];
    for (uint32_t i = 0; i < nodes->count; i++) {
        const struct hg_node *node = (const struct hg_node *)nodes->items[i];
        if (node->light && node->world_visible && !is_dark(node->light) &&
            light_group(node->light) == GROUP_DIRECTIONAL)
            return true;
    }
    return false;
}

struct hg_gpu_light hg_light_of_sun(const float illuminance[3], const float towards_ws[3])
{
    return (struct hg_gpu_light){
        .direction_ws = {-towards_ws[0], -towards_ws[1], -towards_ws[2]},
        .kind = HG_LIGHT_KIND_DIRECTIONAL,
        .color = {illuminance[0], illuminance[1], illuminance[2]},
        .shadow = HG_SHADOW_NONE,
        .profile = HG_LIGHT_NO_TABLE,
        .image = HG_LIGHT_NO_TABLE,
    };
}

enum hg_status hg_light_set_add_sun(
    struct hg_light_set *set, const float illuminance[3], const float towards_ws[3])
{
    if (reserve_one(set))
        return HG_E_NOMEM;
    memmove(set->items + 1, set->items, set->count * sizeof *set->items);
    memmove(set->casts + 1, set->casts, set->count * sizeof *set->casts);
    memmove(set->nodes + 1, set->nodes, set->count * sizeof *set->nodes);
    set->items[0] = hg_light_of_sun(illuminance, towards_ws);
    set->casts[0] = true;
    set->nodes[0] = NULL;
    set->count++;
    set->directional_count++;
    set->global_count++;
    for (uint32_t i = 0; i < set->count; i++)
        set->items[i].id = i;
    return HG_OK;
}

void hg_light_set_finish(struct hg_light_set *set)
{
    hg_free(set->items);
    hg_free(set->casts);
    hg_free(set->nodes);
    drop_tables(set);
    hg_free(set->tables);
    hg_free(set->places);
    *set = (struct hg_light_set){0};
}

float hg_gpu_light_range(const struct hg_gpu_light *light)
{
    return light->inv_range_sq > 0 ? 1 / sqrtf(light->inv_range_sq) : 0;
}
