// light_tree.h - the light tree: a bounding hierarchy over emitters, for importance sampling.
// Floor 2 (light). Pure; work is spread over jobs, the result is the same for any number of
// threads.
//
// Top down by the surface area orientation heuristic of Conty Estevez and Kulla 2018, "Importance
// Sampling of Many Lights with Adaptive Tree Splitting", section 4.4, over bins of centres; how far
// the normals of a bin spread is taken from the length of their mean. Bounds of nodes are then made
// from the leaves up. No leaf is more than HG_EMITTER_MAX_DEPTH steps away.
#ifndef HG_RENDERER_LIGHT_EMITTERS_LIGHT_TREE_H
#define HG_RENDERER_LIGHT_EMITTERS_LIGHT_TREE_H

#include "base/jobs.h"
#include "base/status.h"
#include "shaders/shared/emitters.h"

// Bounds of the light of one leaf (shaders/shared/emitters.h).
struct hg_light_item {
    float min[3], max[3];
    float axis[3];      // unit; any when cos_o is -1
    float cos_o, cos_e; // of theta_o and theta_e
    float power;        // greatest radiant intensity; leaves without any are left out
    float range;        // metres, 0 = infinite
    bool two_sided;     // emits along -axis as well
};

// Zeroed = empty.
struct hg_light_tree {
    struct hg_gpu_light_node *nodes; // [node_count]
    uint32_t node_count;             // 2 * leaf_count - 1
    uint32_t leaf_count;             // items that the tree holds
    uint32_t depth;                  // most steps to a leaf
    uint32_t *trails;                // [count] of each item; HG_EMITTER_NONE: left out
};

// Items whose numbers are not finite are left out, like dark ones. count < 2^30. HG_E_NOMEM.
// Cost O(n log n), about 1.2 us per item and core; 180 bytes per item while it runs.
enum hg_status hg_light_tree_build(const struct hg_light_item *items, uint32_t count,
    struct hg_jobs *jobs, struct hg_light_tree *out) HG_MUST_CHECK;
void hg_light_tree_finish(struct hg_light_tree *tree); // accepts a zeroed one

#endif
