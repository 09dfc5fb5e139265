// lights.h - the punctual lights of a scene in the shader's form.
// Floor 2 (light). Thread: the render thread.
#ifndef HG_RENDERER_LIGHT_LIGHTS_H
#define HG_RENDERER_LIGHT_LIGHTS_H

#include "renderer/scene/scene.h"
#include "shaders/shared/light.h"

// Zero-initialise. Order: directional lights, lights of infinite range, lights with a range; each
// group in the order of the scene's nodes.
struct hg_light_set {
    struct hg_gpu_light *items;
    bool *casts; // asks for shadows
    const struct hg_node **nodes; // NULL: of the sky's sun
    size_t capacity, casts_capacity, node_capacity;
    uint32_t count, global_count, directional_count;
};

// Visible lights with positions relative to origin; black lights are left out. shadow is
// HG_SHADOW_NONE. Source: KHR_lights_punctual (units, cone, range). HG_E_NOMEM.
enum hg_status hg_light_set_collect(
    struct hg_light_set *set, const struct hg_scene *scene, const double origin[3]) HG_MUST_CHECK;
// Whether the set of a scene has directional lights. hg_scene_update was called.
bool hg_scene_has_directional_light(const struct hg_scene *scene);
// A directional light that casts shadows; illuminance: lux on a surface that faces it.
struct hg_gpu_light hg_light_of_sun(const float illuminance[3], const float towards_ws[3]);
// Adds a directional light that no node has, in front of all others: it casts shadows, and its node
// is NULL. illuminance: lux on a surface that faces it. HG_E_NOMEM.
enum hg_status hg_light_set_add_sun(
    struct hg_light_set *set, const float illuminance[3], const float towards_ws[3]) HG_MUST_CHECK;
void hg_light_set_finish(struct hg_light_set *set); // accepts a zeroed one

// Reach of a light in metres; 0 = infinite.
float hg_gpu_light_range(const struct hg_gpu_light *light);

#endif
