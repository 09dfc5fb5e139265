#include "renderer/light/shadow/shadow_sight.h"

#include "renderer/light/lights.h"
#include "renderer/math/frustum.h"
#include "renderer/math/vec.h"

#define SLACK_PX 4.0f

struct hg_shadow_sight hg_shadow_sight_make(const struct hg_gpu_camera *camera)
{
    struct hg_shadow_sight s = {.slack_per_m = SLACK_PX * camera->pixel_angle,
        .slack_m = camera->orthographic != 0 ? SLACK_PX * camera->pixel_size : 0};
    s.count = hg_frustum_planes(camera->view_proj.m, s.planes);
    hg_copy3((const float *)&camera->eye_ws, s.eye);
    return s;
}

// Largest cosine between `way` and the directions within an angle of `axis`.
static float nearest_cosine(const float way[3], const float axis[3], float cos_half)
{
    const float c = hg_clampf(hg_dot3(way, axis), -1, 1);
    if (c >= cos_half)
        return 1;
    return c * cos_half + sqrtf((1 - c * c) * fmaxf(1 - cos_half * cos_half, 0));
}

// Cosine of half the angle of the cone that all light leaves in; -1: in every direction.
static float cone_of(const struct hg_gpu_light *light)
{
    switch (light->kind) {
    case HG_LIGHT_KIND_SPOT:
        return hg_clampf(-light->spot_offset / light->spot_scale, -1, 1);
    case HG_LIGHT_KIND_RECTANGLE:
    case HG_LIGHT_KIND_DISC:
        return 0;
    default:
        return -1;
    }
}

// Farthest that light gets along `way`: metres, or infinite.
static float reach_along(const struct hg_gpu_light *light, const float way[3], float cos_half)
{
    const float range = light->inv_range_sq > 0 ? hg_gpu_light_range(light) : INFINITY;
    const float c =
        cos_half > -1 ? nearest_cosine(way, (const float *)&light->direction_ws, cos_half) : 1;
    return c > 0 ? range * c : 0;
}

static float plane_distance(
    const struct hg_shadow_sight *s, const float plane[4], const float p[3], float *slack)
{
    float d[3];
    hg_sub3(p, s->eye, d);
    *slack = s->slack_m + s->slack_per_m * hg_length3(d);
    return hg_dot3(plane, p) + plane[3];
}

bool hg_shadow_sight_has_light(const struct hg_shadow_sight *s, const struct hg_gpu_light *light)
{
    if (light->kind == HG_LIGHT_KIND_DIRECTIONAL)
        return true;
    const float cos_half = cone_of(light);
    for (uint32_t i = 0; i < s->count; i++) {
        float slack;
        const float at =
            plane_distance(s, s->planes[i], (const float *)&light->position_ws, &slack);
        const float reach = reach_along(light, s->planes[i], cos_half);
        // Points of the reach may be farther from the eye than the light, by all of the reach.
        if (at + light->bound + reach * (1 + s->slack_per_m) < -slack)
            return false;
    }
    return true;
}

bool hg_shadow_sight_has_map(const struct hg_shadow_sight *s, const struct hg_gpu_light *light,
    const struct hg_shadow_map *map)
{
    const struct hg_gpu_shadow *m = &map->gpu;
    const float range = light->inv_range_sq > 0 ? hg_gpu_light_range(light) : INFINITY;
    const float half = m->extent / m->scale; // tangent of half the map's angle
    for (uint32_t i = 0; i < s->count; i++) {
        float slack, along = -INFINITY;
        const float at =
            plane_distance(s, s->planes[i], (const float *)&light->position_ws, &slack);
        for (int c = 0; c < 4; c++) { // its four edges, to the far plane at the range
            float way[3];
            hg_mad3((const float *)&m->forward_ws, (const float *)&m->right_ws,
                c & 1 ? half : -half, way);
            hg_mad3(way, (const float *)&m->up_ws, c & 2 ? half : -half, way);
            along = fmaxf(along, hg_dot3(s->planes[i], way));
        }
        const float reach = along > 0 ? range * along : 0;
        if (at + light->bound + reach * (1 + s->slack_per_m) < -slack)
            return false;
    }
    return true;
}
