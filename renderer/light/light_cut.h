// light_cut.h - lists of lamps for clusters where there are too many: a cut through a tree of
// lamps. Floor 2 (light). Thread: the render thread; cells are spread over jobs, the result is the
// same for any number of threads.
//
// Each cell of the clusters gets a cut through light trees over all lamps (point, spot and area
// lights, each of one shape of intensity): lamps, and nodes in place of many. A node shines with
// the power of its lamps from their mean place, as a light of its own; the power in a list is that
// of all lamps, but for those whose range or cone ends before the cell. Nodes are opened where
// their error is greatest, until it is small beside the light of the cell or the list is full.
// Source: Walter et al. 2005, "Lightcuts: A Scalable Approach to Illumination"; lists for clusters
// instead of pixels as in Olsson, Billeter and Assarsson 2012.
#ifndef HG_RENDERER_LIGHT_LIGHT_CUT_H
#define HG_RENDERER_LIGHT_LIGHT_CUT_H

#include "renderer/light/cluster.h"
#include "renderer/light/emitters/light_tree.h"
#include "renderer/light/lighting.h"

#define HG_LIGHT_CUT_MOST   128   // entries of a list
#define HG_LIGHT_CUT_MOVING 48    // while the view moves
#define HG_LIGHT_CUT_ERROR  0.01f // of a node, over the light of its cell

#define HG_LIGHT_CUT_TREES 4 // points, spots, rectangles and discs, tubes

// Zero-initialise.
struct hg_light_cuts {
    uint64_t signature; // of the lamps that the trees hold
    uint32_t node_count, root_count;
    uint32_t roots[HG_LIGHT_CUT_TREES];
    struct hg_gpu_light_node *nodes; // [node_count] of all trees
    struct hg_light_sum *sums;       // [node_count]
    uint32_t *places;                // [node_count] in `lights`, plus one
    bool *shadowed;                  // [node_count] holds a lamp with shadow maps
    uint32_t *trails;     // [lamps] way from the root, one bit per step; HG_EMITTER_NONE: left out
    uint32_t *lamp_roots; // [lamps]
    uint32_t *cut;        // [HG_CLUSTER_COUNT][HG_LIGHT_CUT_MOST + 1] count and nodes
    struct hg_gpu_light *lights; // [count] directional ones as in the set, then what lists hold
    size_t light_capacity;
    uint32_t count;
};

// Writes lists of all lamps of the set, whose shadows are planned, and the lights that they number.
// Lamps whose numbers are not finite are left out. Memory: 280 bytes per lamp, 300 more while the
// tree is built, which happens when lamps changed. HG_E_NOMEM.
enum hg_status hg_light_cuts_build(struct hg_light_cuts *cuts, struct hg_clusters *clusters,
    const struct hg_light_set *set, const struct hg_lighting_view *view,
    struct hg_jobs *jobs) HG_MUST_CHECK;
void hg_light_cuts_finish(struct hg_light_cuts *cuts); // accepts a zeroed one

#endif
