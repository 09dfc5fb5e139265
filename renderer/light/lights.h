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
    // Profiles and images of the lights, each once, one behind the other: of `word_count` words.
    // The same lights of a scene have the same places in every set.
    struct hg_light_table **tables; // [table_count] references
    uint32_t *places;               // [table_count] first word
    size_t table_capacity, place_capacity;
    uint32_t table_count, word_count;
    uint32_t left_out; // tables that there was no room for
};

// Visible lights with positions relative to origin; black lights are left out, those whose numbers
// are not finite are black. shadow is
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
// The words of the tables: words [word_count] out.
void hg_light_set_tables(const struct hg_light_set *set, uint32_t *words);
// What tells whether the words are the same: 0 where there are none.
uint64_t hg_light_set_table_hash(const struct hg_light_set *set);
void hg_light_set_finish(struct hg_light_set *set); // accepts a zeroed one

// Reach of a light in metres; 0 = infinite.
float hg_gpu_light_range(const struct hg_gpu_light *light);

#endif
