// emitter_leaves.h - runs of emissive triangles as leaves of the light tree.
// Private to the emitters. Floor 2 (light). Pure; work is spread over jobs.
#ifndef HG_RENDERER_LIGHT_EMITTERS_EMITTER_LEAVES_H
#define HG_RENDERER_LIGHT_EMITTERS_EMITTER_LEAVES_H

#include "renderer/light/emitters/emitter_sources.h"
#include "renderer/light/emitters/light_tree.h"

// Outputs for the leaves of a plan, zeroed by the caller.
struct hg_emitter_leaves {
    struct hg_light_item *items;        // [leaf_count] power 0: dark
    struct hg_gpu_emitter_leaf *leaves; // [leaf_count]
    // [weight_count] of a leaf with several triangles: sums of their shares of its power, in units
    // of 1 / 65535
    uint16_t *weights;
};
void hg_emitter_leaves_fill(const struct hg_emitter_leaves *out,
    const struct hg_emitter_sources *sources, const struct hg_emitter_plan *plan,
    struct hg_jobs *jobs);

#endif
