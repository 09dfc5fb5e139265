// skinned_lod.h - discrete levels of detail of parts that are skinned or morphed.
// Floor 2, private to renderer/geometry/. Pure: no device; any thread. Lengths in metres.
//
// A level is a shorter list of triangles over the vertices of the part, so that poses are worked
// out once for all levels, and it lies behind the part's own list: primitive numbers of a level are
// places in the list as a whole, and shading, facets and picks need not know of levels.
//
// Each vertex of the part has a place on the level: the nearest in the rest pose. How far the two
// are apart is the error: in the rest pose (and what normals and uvs are off by, as in lod.h), per
// unit of each morph target, and under a skin for the vertices where that is most to be expected.
// So the error of a pose is worked out for that pose and no list of extreme ones is needed.
#ifndef HG_RENDERER_LOD_SKINNED_LOD_H
#define HG_RENDERER_LOD_SKINNED_LOD_H

#include "renderer/scene/scene.h"
#include "shaders/shared/geometry.h"

#define HG_SKINNED_LOD_FROM    2048u // triangles
#define HG_SKINNED_LOD_LEVELS  6u
#define HG_SKINNED_LOD_SAMPLES 256u // of a level

struct hg_skinned_lod_sample { // a vertex and its place on the level
    uint32_t vertex, corners[3];
    float weights[3];
};

struct hg_skinned_lod_level {
    uint32_t first, count; // triangles, from the first of the part's own on
    float error;           // rest pose
    float *morph_errors;   // [target_count] per unit of weight; NULL: there are none
    struct hg_skinned_lod_sample *samples;
    uint32_t sample_count; // 0 without joints
};

struct hg_skinned_lod_levels { // zeroed = none
    struct hg_skinned_lod_level items[HG_SKINNED_LOD_LEVELS];
    uint32_t count;    // from fine to coarse
    uint32_t *indices; // [index_count] of all levels: they come behind those of the part
    uint32_t *sources; // [index_count / 3] the part's triangle that a level's one lies on
    uint32_t index_count;
};

// None for parts of few triangles and those without joints and targets. HG_E_NOMEM. O(n log n).
enum hg_status hg_skinned_lod_build(const struct hg_mesh_part *part, uint32_t target_count,
    struct hg_skinned_lod_levels *out) HG_MUST_CHECK;
void hg_skinned_lod_finish(struct hg_skinned_lod_levels *levels); // accepts a zeroed one

// Errors of all levels in a pose; they grow from level to level. matrices: of the joints, NULL: no
// skin; weights: of the targets, NULL: none. stretch: the most that a joint makes a length grow.
struct hg_skinned_lod_pose {
    const struct hg_mat4x3 *matrices;
    uint32_t joint_count;
    const float *weights;
    uint32_t target_count;
    float stretch;
};
void hg_skinned_lod_errors(const struct hg_skinned_lod_levels *levels,
    const struct hg_mesh_part *part, const struct hg_skinned_lod_pose *pose,
    float errors[HG_SKINNED_LOD_LEVELS]);

#endif
