// bvh.h - binary trees of shaders/shared/bvh.h, built by Embree's builder.
// Floor 2 (trace). Thread: the render thread; the builder takes all cores. Private to the room.
//
// Source: Wald et al. 2014, "Embree" (surface area heuristic by bins); Mahovsky and Wyvill 2006,
// "Memory-Conserving Bounding Volume Hierarchies" (boxes on a grid).
#ifndef HG_RENDERER_TRACE_BVH_H
#define HG_RENDERER_TRACE_BVH_H

#include "base/status.h"
#include "shaders/shared/bvh.h"

struct hg_bvh_box {
    float min[3], max[3]; // finite
};

struct hg_bvh {                    // zeroed = empty; hg_bvh_finish
    struct hg_gpu_bvh_node *nodes; // parents before children
    size_t node_capacity;
    uint32_t node_count;
    uint32_t *order; // [item_count] the box that is at each place of the leaves
    uint32_t item_count;
    uint32_t root; // HG_BVH_NONE: of nothing
    float origin[3], step[3];
    struct hg_bvh_box bounds;
};

struct hg_bvh_builder;
// HG_E_NOMEM, HG_E_DEVICE.
enum hg_status hg_bvh_builder_create(
    struct hg_bvh_builder **out, struct hg_error *err) HG_MUST_CHECK;
void hg_bvh_builder_destroy(struct hg_bvh_builder *builder); // accepts NULL

// leaf_most: boxes of a leaf, 1..HG_BVH_LEAF_MOST. Trees are never deeper than HG_BVH_DEPTH: where
// the heuristic would be, halves of equal count are taken instead. HG_E_NOMEM, HG_E_LIMIT (2^28).
enum hg_status hg_bvh_build(struct hg_bvh_builder *builder, const struct hg_bvh_box *boxes,
    uint32_t count, uint32_t leaf_most, struct hg_bvh *out) HG_MUST_CHECK;
// The same tree over boxes that have moved: items in the order of the tree. HG_E_NOMEM.
enum hg_status hg_bvh_refit(struct hg_bvh *bvh, const struct hg_bvh_box *items) HG_MUST_CHECK;
void hg_bvh_finish(struct hg_bvh *bvh);
// Host memory that building so many takes at most, besides the boxes.
uint64_t hg_bvh_build_bytes(uint64_t count);

#endif
