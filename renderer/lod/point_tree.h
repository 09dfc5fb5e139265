// point_tree.h - a balanced k-d tree over the points of a part, and what a point cloud says about
// the surface that it was taken from: spacing and normals. Floor 2 (geometry). Pure: any thread.
//
// A node at level j is number t of 2^j and holds items [count * t / 2^j, count * (t + 1) / 2^j).
// Trees and results are the same on any number of threads.
//
// Source: Bentley 1975, "Multidimensional binary search trees"; Hoppe et al. 1992, "Surface
// reconstruction from unorganized points" (normals from the covariance of neighbours).
#ifndef HG_RENDERER_LOD_POINT_TREE_H
#define HG_RENDERER_LOD_POINT_TREE_H

#include "base/jobs.h"
#include "renderer/scene/scene.h"

#define HG_POINT_TREE_LEAF 32u // points of a leaf, at most

struct hg_point_item {
    float at[3];
    // Of the point: part->indices[number * stride] is its vertex. In a gathered tree its place
    // among `normals` and `colors`; in the same order within a leaf.
    uint32_t number;
};

struct hg_point_tree {
    struct hg_point_item *items; // [count] in the order of the tree
    float *splits;               // [2^depth] coordinate that parts node 2^level + t
    uint8_t *axes;               // [2^depth]
    uint32_t count, depth, stride;
    // Gathered: the part's attributes, those of points that are near each other in one place.
    bool gathered;
    float *normals, *colors; // [count * 3], [count * 4]; NULL: the part has none
};

// Of the points that part->indices names, every `stride`-th. `gather`: where there are many,
// attributes are read in the order of the part once, and from then on near each other; otherwise
// each point reads a page of its own of a spilled array. HG_E_NOMEM. Cost O(n log n).
enum hg_status hg_point_tree_build(const struct hg_mesh_part *part, uint32_t stride, bool gather,
    struct hg_jobs *jobs, struct hg_point_tree *out) HG_MUST_CHECK;
void hg_point_tree_finish(struct hg_point_tree *tree);

static inline uint32_t hg_point_tree_first(
    const struct hg_point_tree *tree, uint32_t level, uint32_t node)
{
    return (uint32_t)(((uint64_t)tree->count * node) >> level);
}

// Moves the `nth` smallest along an axis to the front; of equal ones by number.
void hg_point_select(struct hg_point_item *items, uint32_t count, uint32_t nth, int axis);
// The axis along which the items reach farthest.
int hg_point_longest_axis(const struct hg_point_item *items, uint32_t count);

// A point with the piece of surface around it.
struct hg_surfel {
    float at[3], normal[3]; // unit; as in the part, or estimated and of any sign
    float radius;           // metres
    float color[4];         // linear; white without colours
};

// Surfels of items [first, first + count), in their order. The disc of a surfel covers the Voronoi
// cell of its point among the neighbours, in the plane of its normal, so that discs of a plane
// close. Points far from all others are as large as those around them. part->point_scale and
// part->point_diameter apply. HG_E_NOMEM.
enum hg_status hg_surfels_measure(const struct hg_point_tree *tree, const struct hg_mesh_part *part,
    uint32_t first, uint32_t count, struct hg_surfel *out) HG_MUST_CHECK;

#endif
