// shadow_sight.h - which lights, and which of their shadow maps, reach anything that a camera may
// see. Floor 2 (light). Pure host code. Thread: any.
//
// Conservative: what is said to be out of sight changes no pixel. A light's reach is a sphere, for
// spots, rectangles and discs the part of it inside of the cone of their directions.
#ifndef HG_RENDERER_LIGHT_SHADOW_SHADOW_SIGHT_H
#define HG_RENDERER_LIGHT_SHADOW_SHADOW_SIGHT_H

#include "renderer/light/lighting.h"

struct hg_shadow_sight {
    float planes[6][4]; // of the camera's frustum: inside dot(xyz, p) + w >= 0
    uint32_t count;
    float eye[3];
    float slack_per_m, slack_m; // jitter and filters of the picture, per metre from the eye; always
};

struct hg_shadow_sight hg_shadow_sight_make(const struct hg_gpu_camera *camera);
bool hg_shadow_sight_has_light(
    const struct hg_shadow_sight *sight, const struct hg_gpu_light *light);
// A map of that light, which is not directional.
bool hg_shadow_sight_has_map(const struct hg_shadow_sight *sight, const struct hg_gpu_light *light,
    const struct hg_shadow_map *map);

#endif
