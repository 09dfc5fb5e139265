// shadow_plan.h - which shadow maps a view needs, where they lie in the atlas, how they project.
// Floor 2 (light). Pure: a plan follows from its inputs alone, never from the views before, so that
// a picture does not depend on the way the camera came. Cascades move in steps of a coarse grid and
// grow in steps, so that small camera moves give the same plan and nothing is drawn again.
#ifndef HG_RENDERER_LIGHT_SHADOW_SHADOW_PLAN_H
#define HG_RENDERER_LIGHT_SHADOW_SHADOW_PLAN_H

#include "renderer/light/lighting.h"
#include "renderer/light/lights.h"

#define HG_SHADOW_REACH_PX      4.0f // texels past a map's edge that filter and normal offset may touch
#define HG_SHADOW_MIN_SIDE_PX   128
#define HG_SHADOW_SUN_SIDE_PX   2048 // wished for, per cascade
#define HG_SHADOW_SPOT_SIDE_PX  1024
#define HG_SHADOW_POINT_SIDE_PX 512 // per face

// Zero-initialise.
struct hg_shadow_plan {
    struct hg_shadow_map *maps;
    size_t capacity;
    uint32_t count;
    uint32_t atlas_px; // side that the maps need, a power of two; 0 = no maps
    uint32_t shadowed_lights, unshadowed_lights;
};

// Gives lights their maps (sets shadow and shadow_count). Lights that matter most come first:
// directional ones, then by illuminance at the eye. When the wished sizes do not fit the atlas all
// are halved, down to the least size; after that the last lights go without. HG_E_NOMEM.
enum hg_status hg_shadow_plan_make(struct hg_shadow_plan *plan, struct hg_light_set *lights,
    const struct hg_lighting_view *view, uint32_t max_atlas_px) HG_MUST_CHECK;
void hg_shadow_plan_finish(struct hg_shadow_plan *plan); // accepts a zeroed one

#endif
