// select.h - runs of triangles that one view may see, on the host. Private to the room.
#ifndef HG_RENDERER_CULL_SELECT_H
#define HG_RENDERER_CULL_SELECT_H

#include "renderer/geometry/geometry_state.h"
#include "renderer/cull/culling.h"

#define HG_RUN_NO_BIT 0xffffffffu

// Consecutive primitives of one draw.
struct hg_run {
    uint32_t draw;
    uint32_t chunk;             // of a baked part; HG_LOD_NONE: the part itself
    uint32_t first, count;      // primitives of it
    uint32_t bit;               // of histories; HG_RUN_NO_BIT: always drawn
    float center[3], extent[3]; // box, object space; extent < 0: not known
};

struct hg_selection { // zeroed = empty; keeps its memory
    struct hg_run *items;
    size_t capacity;
    uint32_t count;
    struct hg_chunk_want *wants; // chunks that are not there
    size_t want_capacity;
    uint32_t want_count;
    uint32_t mark; // of chunks that are wanted already
};

// A view in the space of an object.
struct hg_object_view {
    float planes[6][4], reach[6][3]; // reach: |plane|
    uint32_t plane_count;
    float eye[3], forward[3];
    float px_scale; // at least so many pixels per radian, or per unit when orthographic
    bool has_facing, orthographic;
};

// HG_DRAW_* of a draw, as the view shows it.
static inline uint32_t hg_select_flags(
    const struct hg_geometry *geometry, const struct hg_culling_view *view, uint32_t draw)
{
    return view->shown != NULL ? view->shown[draw].flags : geometry->draws[draw].gpu.flags;
}

bool hg_select_is_outside(const struct hg_object_view *object, const struct hg_meshlet *box);
bool hg_select_faces_away(const struct hg_object_view *object, const struct hg_meshlet *cone);

// One draw of a baked part.
struct hg_lod_draw {
    uint32_t draw;
    uint32_t first_bit; // of hg_select_lod_bits() bits
    struct hg_cluster_mesh *mesh;
    const struct hg_mat4x3 *world;
    const struct hg_object_view *object; // the view in its space
};

// select_lod.c: runs of a draw, by chunk and place. HG_E_NOMEM.
enum hg_status hg_select_lod(const struct hg_culling_view *view, const struct hg_lod_draw *draw,
    struct hg_selection *out) HG_MUST_CHECK;
uint32_t hg_select_lod_bits(void);
// Marks the chunks of the runs as used, and brings the list of what is wanted in order: each chunk
// once, with its parents unless the view wants the whole of it. HG_E_NOMEM.
enum hg_status hg_select_wants(const struct hg_geometry *geometry,
    const struct hg_culling_view *view, struct hg_selection *selection) HG_MUST_CHECK;

// Appends runs in draw order, and what is missing. HG_E_NOMEM.
enum hg_status hg_select(const struct hg_geometry *geometry, const struct hg_culling_view *view,
    struct hg_jobs *jobs, struct hg_selection *out) HG_MUST_CHECK;

#endif
