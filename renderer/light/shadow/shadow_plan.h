// shadow_plan.h - which shadow maps a view needs, where they lie in the atlas, how they project.
// Floor 2 (light). Pure: a plan follows from its inputs alone, never from the views before, so that
// a picture does not depend on the way the camera came; but for the places of maps in
// motion, and among many lamps, where shaders leave them out of their sums. Cascades move in steps
// of a coarse grid and grow in steps, so that small camera moves give the same plan and nothing is
// drawn again.
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
    bool paged;    // the sun has a pool of pages (shadow_pages.h), which is no map,
    uint32_t pool; // the first of its two; the second holds the whole scene
};

// From the projection of map->gpu: what draws it.
void hg_shadow_map_project(struct hg_shadow_map *map);
// Gives lights their maps (sets shadow and shadow_count). Lights that matter most come first:
// directional ones, then by illuminance at the eye; where some go without, the shadows of the last
// ones that have a map are faint (shadow_fade). When the wished sizes do not fit the atlas all are
// halved, down to the least size; after that the last lights go without. HG_E_NOMEM.
enum hg_status hg_shadow_plan_make(struct hg_shadow_plan *plan, struct hg_light_set *lights,
    const struct hg_lighting_view *view, uint32_t max_atlas_px) HG_MUST_CHECK;
// Maps that another plan has drawn, and that are not stale there, get their places in its atlas,
// the others what is free; if that is too little, places stay as they are. HG_E_NOMEM.
enum hg_status hg_shadow_plan_keep(struct hg_shadow_plan *plan, const struct hg_shadow_plan *before,
    uint32_t atlas_px) HG_MUST_CHECK;
// Adds the texels of a map that a box of casters may cover, before or after it moved, to those that
// are drawn again.
void hg_shadow_map_touch(struct hg_shadow_map *map, const struct hg_box *casters);
void hg_shadow_plan_finish(struct hg_shadow_plan *plan); // accepts a zeroed one

#endif
