// emitter_lights.h - punctual lights as light sampling has them. Private to light.
// Floor 2 (light). Thread: the render thread.
#ifndef HG_RENDERER_LIGHT_EMITTERS_EMITTER_LIGHTS_H
#define HG_RENDERER_LIGHT_EMITTERS_EMITTER_LIGHTS_H

#include "renderer/light/emitters/light_tree.h"
#include "renderer/light/env/sky.h"
#include "renderer/light/lights.h"

// Zero-initialise. Directional lights come first.
struct hg_emitter_lights {
    struct hg_light_set set;                      // of the scene
    struct hg_sky_disc sun;                       // of its sky, which is the first light
    const struct hg_light_set *opening, *closing; // of a shutter; NULL: nothing moves
    struct hg_gpu_light *items;                   // [count], then those of the opening if they move
    size_t capacity;
    bool move;
    uint32_t count, directional_count;
    uint32_t sized_suns, sized_lamps; // directional ones and others that have a size
    float directional_lux;            // of all directional ones
};

// Relative luminance of linear Rec. 709, 0 or more; 0 where it is not finite.
float hg_emitter_luminance(float red, float green, float blue);

// Collects lights with finite, non-zero intensity, and hashes them into *signature. HG_E_NOMEM.
enum hg_status hg_emitter_lights_collect(struct hg_emitter_lights *lights,
    const struct hg_scene *scene, const double origin[3], uint64_t *signature) HG_MUST_CHECK;
void hg_emitter_lights_finish(struct hg_emitter_lights *lights); // accepts a zeroed one
// CDF of the directional lights by illuminance; the last is 1.
//   shares [directional_count] out
void hg_emitter_lights_shares(const struct hg_emitter_lights *lights, float *shares);
// The leaf of a light that has a place.
struct hg_light_item hg_emitter_lamp_leaf(const struct hg_gpu_light *light);
// The leaf of a positional light, with bounds over the shutter's time.
struct hg_light_item hg_emitter_lights_leaf(const struct hg_emitter_lights *lights, uint32_t index);
// A tree over the positional lights that have a size, for rays that may meet them; its leaves are
// their numbers among the positional ones. HG_E_NOMEM.
enum hg_status hg_emitter_lights_tree(const struct hg_emitter_lights *lights, struct hg_jobs *jobs,
    struct hg_light_tree *out) HG_MUST_CHECK;

#endif
