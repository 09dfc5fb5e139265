// motion_table.h - what has moved by itself since the picture before of a view, for motion vectors.
// Floor 2 (geometry). Thread: the render thread. Host work on the tables of the scene.
#ifndef HG_RENDERER_GEOMETRY_MOTION_TABLE_H
#define HG_RENDERER_GEOMETRY_MOTION_TABLE_H

#include "renderer/geometry/geometry.h"

#define HG_MOTION_STANDS   0u     // of `draws`: no transform of its own
#define HG_MOTION_DEFORMED 65535u // posed vertices, or a surface that was not there before

// Places of a scene at one picture, and how they differ at the next one. Zeroed = none.
struct hg_motion_table {
    uint64_t *nodes;          // [count] of the instances
    struct hg_mat4x3 *worlds; // [count] relative to `origin`
    uint32_t count;
    double origin[3];
    uint64_t layout; // which draws, instances and parts have which numbers
    // Of the newest compare:
    uint16_t *draws; // [draw_count] HG_MOTION_*, or index into `moved`, from 1
    uint32_t draw_count;
    double (*moved)[16]; // [moved_count] world of now to world of then, both relative to the origin
    uint32_t moved_count; // of now, column-major; the first is that of what stands: identity
    bool deformed;        // some draw is HG_MOTION_DEFORMED
    bool same_layout;     // numbers mean the same as then
};

void hg_motion_table_finish(struct hg_motion_table *table);
// What differs; everything stands where there is no picture before. HG_E_NOMEM: nothing is known.
enum hg_status hg_motion_table_compare(
    struct hg_motion_table *table, const struct hg_geometry *geometry) HG_MUST_CHECK;
// The places of now are those of the picture before from now on. HG_E_NOMEM: there are none.
enum hg_status hg_motion_table_note(
    struct hg_motion_table *table, const struct hg_geometry *geometry) HG_MUST_CHECK;
// Any surface has posed vertices.
bool hg_motion_table_deforms(const struct hg_geometry *geometry);
// Bounds of all surfaces with posed vertices, relative to the origin. False: there are none.
bool hg_motion_table_bounds(const struct hg_geometry *geometry, float min[3], float max[3]);

#endif
