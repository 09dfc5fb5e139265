// meshlets.h - a mesh part cut into runs of neighbouring triangles that face alike.
// Floor 2 (geometry). Pure: any thread.
#ifndef HG_RENDERER_MESH_MESHLETS_H
#define HG_RENDERER_MESH_MESHLETS_H

#include "renderer/scene/scene.h"

#define HG_MESHLET_TRIANGLES 64 // at most
#define HG_MESHLET_GROUP     4  // neighbours whose occlusion is tested together

// Rasterisers move corners by a part of a pixel: what turns away by less is not culled as a whole.
#define HG_CONE_MARGIN 0.04f

struct hg_meshlet {
    float center[3], extent[3]; // box: half sizes about the centre, object space
    // All triangles face away from the eye if
    // dot(center - eye, cone_axis) >= cone_cutoff * length(center - eye) + length(extent), with a
    // margin of some degrees for rasterisers that round corners; cutoff 1: never.
    float cone_axis[3], cone_cutoff;
    uint32_t first, count; // triangles, in the order of the list
};

struct hg_meshlet_list { // zeroed = none
    struct hg_meshlet *items;
    uint32_t count;
    uint32_t *order; // [triangles] source triangle of each; NULL: as in the source
};

// Meshlets of at most HG_MESHLET_TRIANGLES triangles, all but few of them full. Triangles are split
// at the median of the longest side of their centres and normals until they are few enough; the
// result depends on the part alone. Parts of few triangles keep their order; lines and points give
// an empty list. HG_E_NOMEM. Cost O(n log n).
enum hg_status hg_meshlets_build(
    const struct hg_mesh_part *part, struct hg_meshlet_list *out) HG_MUST_CHECK;
void hg_meshlets_finish(struct hg_meshlet_list *list);

#endif
