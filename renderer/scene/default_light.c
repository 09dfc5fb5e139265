// default_light.c - see default_light.h.
#include "renderer/scene/default_light.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "renderer/scene/xform.h"

#define SUBJECTS_MOST 256

static const float pi = 3.14159265358979f;

// Radiance of a white diffuser that faces up under the scattered light of the sky of intensity 1,
// of turbidity 2 and a sun at 50 degrees (tests/unit/scene_default_light.c compares it with the
// sky).
static const float sky_radiance = 0.17f;

// --- lights --------------------------------------------------------------------------------------

// The bounding sphere of a mesh.
struct subject {
    float center[3], radius;
};

static bool find_subject(const struct hg_node *node, struct subject *out)
{
    float min[3], max[3];
    hg_bounds_clear(min, max);
    for (uint32_t i = 0; i < node->mesh->part_count; i++) {
        const struct hg_mesh_part *part = &node->mesh->parts[i];
        if (part->index_count > 0)
            hg_bounds_add_box(min, max, node->world, part->bounds_min, part->bounds_max);
    }
    float square = 0;
    for (int i = 0; i < 3; i++) {
        out->center[i] = 0.5f * (min[i] + max[i]);
        square += 0.25f * (max[i] - min[i]) * (max[i] - min[i]);
    }
    out->radius = sqrtf(square);
    return min[0] <= max[0] && isfinite(out->radius);
}

static float luminance(const struct hg_light *light)
{
    const float *c = light->color;
    return hg_light_peak(light) * (0.2126f * c[0] + 0.7152f * c[1] + 0.0722f * c[2]);
}

// A spotlight reaches a sphere that its cone touches. It shines along its -z.
static bool is_in_cone(const struct hg_node *lamp, const float to[3], float distance, float radius)
{
    float axis[3] = {-lamp->world[8], -lamp->world[9], -lamp->world[10]};
    if (distance <= radius || !hg_normalize3(axis))
        return true;
    const float cosine = hg_dot3(axis, to) / distance;
    const float angle = acosf(fminf(fmaxf(cosine, -1.0f), 1.0f)) - asinf(radius / distance);
    return angle < lamp->light->outer_cone_rad;
}

// Seen from the surface of the sphere on average: its square distance is that of the centre and a
// third of the radius', which is exact for points spread over a box.
static float illuminance(const struct hg_node *lamp, const struct subject *s)
{
    const struct hg_light *light = lamp->light;
    const float lum = luminance(light);
    if (light->kind == HG_LIGHT_DIRECTIONAL)
        return lum;
    float to[3];
    for (int i = 0; i < 3; i++)
        to[i] = s->center[i] - lamp->world[12 + i];
    const float square = hg_dot3(to, to), distance = sqrtf(square);
    if (light->range > 0 && distance - s->radius > light->range)
        return 0;
    if (light->kind == HG_LIGHT_SPOT && !is_in_cone(lamp, to, distance, s->radius))
        return 0;
    return lum / fmaxf(square + s->radius * s->radius / 3, 1e-12f);
}

static bool is_subject(const struct hg_node *node)
{
    return node->mesh && node->world_visible;
}

static int compare_floats(const void *a, const void *b)
{
    const float x = *(const float *)a, y = *(const float *)b;
    return (x > y) - (x < y);
}

// At most SUBJECTS_MOST meshes, evenly spread over the scene's list.
static uint32_t find_subjects(const struct hg_object_list *nodes, struct subject *out)
{
    uint32_t meshes = 0, seen = 0, count = 0;
    for (uint32_t i = 0; i < nodes->count; i++)
        meshes += is_subject((const struct hg_node *)nodes->items[i]);
    for (uint32_t i = 0; i < nodes->count && count < SUBJECTS_MOST; i++) {
        const struct hg_node *node = (const struct hg_node *)nodes->items[i];
        if (!is_subject(node))
            continue;
        const uint64_t due = (uint64_t)seen++ * SUBJECTS_MOST / meshes;
        if (meshes <= SUBJECTS_MOST || due >= count)
            count += find_subject(node, &out[count]);
    }
    return count;
}

float hg_key_illuminance(const struct hg_scene *scene)
{
    const struct hg_object_list *nodes = &scene->objects[HG_OBJECT_NODE];
    struct subject subjects[SUBJECTS_MOST];
    float lux[SUBJECTS_MOST] = {0};
    const uint32_t count = find_subjects(nodes, subjects);
    uint32_t lit = 0;
    for (uint32_t i = 0; i < nodes->count; i++) {
        const struct hg_node *node = (const struct hg_node *)nodes->items[i];
        for (uint32_t k = 0; k < count && node->light && node->world_visible; k++)
            lux[k] += illuminance(node, &subjects[k]);
    }
    for (uint32_t k = 0; k < count; k++)
        if (lux[k] > 0 && isfinite(lux[k]))
            lux[lit++] = lux[k];
    qsort(lux, lit, sizeof *lux, compare_floats);
    return lit > 0 ? lux[(uint64_t)(lit - 1) * 3 / 4] : 0;
}

// --- environment ---------------------------------------------------------------------------------

void hg_default_light_update(struct hg_scene *scene)
{
    struct hg_environment *env = &scene->environment;
    if (!env->automatic)
        return;
    hg_scene_update(scene);
    const float key = hg_key_illuminance(scene);
    const bool fills = key > 0;
    const enum hg_sky_sun sun = fills ? HG_SKY_SUN_OFF : env->wanted_sun;
    const float scale = fills ? key / pi * HG_FILL_RATIO / sky_radiance : 1.0f;
    const float intensity = env->wanted_intensity * scale;
    if (env->kind == HG_ENV_SKY && env->fills == fills && env->sun == sun &&
        env->intensity == intensity)
        return;
    env->kind = HG_ENV_SKY;
    env->fills = fills;
    env->sun = sun;
    env->intensity = intensity;
    env->revision = scene->revision;
}
