// warp.h - the last frame as another camera would see it, by the depth that came with it: what is
// shown between frames. The formulas are those of client/web/warp.js; docs/internals/web.md
// ("Between frames") has the idea. Floor 6 (client). Thread: any, one at a time per object. What
// comes from the server is not trusted: sizes are checked before memory is taken.
//
// With (x, y) of the old picture, -1..1 and y up, and d what cells hold (1 / depth with
// perspective, depth without), a surface lies at a linear function of (x, y, 1, d) in the new clip
// space, so a mesh of one vertex per cell is exact for planes.
#ifndef HG_CLIENT_VIEW_WARP_H
#define HG_CLIENT_VIEW_WARP_H

#include "base/status.h"
#include "client/view/projection.h"

// Depth of a state of the view: of one camera in one revision of the scene.
struct hg_warp_depth {
    bool is_known;
    uint64_t input_seq, revision;
    struct hgp_view_camera camera; // that the state shows
    uint32_t columns, rows;        // of cells, equal parts of the picture
    float *values;                 // [rows][columns] d; where nothing is, that of the farthest
    size_t capacity;               // of values
};

// A frame came: with the depth of its state, or one more of the state that is known, or without.
// HG_E_FORMAT: the depth is damaged; HG_E_NOMEM. On failure none is known.
enum hg_status hg_warp_take(
    struct hg_warp_depth *depth, const struct hgp_frame *frame, struct hg_error *err) HG_MUST_CHECK;
enum hg_status hg_warp_copy(
    const struct hg_warp_depth *from, struct hg_warp_depth *to, struct hg_error *err) HG_MUST_CHECK;
void hg_warp_depth_finish(struct hg_warp_depth *depth);

struct hg_warp_vertex {
    float x, y; // px of the window
    float u, v; // of the old picture, 0..1
};

// Two triangles between four neighbouring cells, what is farther first; around the picture lies a
// ring of more, which holds the border's depth and colours.
struct hg_warp_mesh {
    struct hg_warp_vertex *vertices; // 4 a quad
    int *indices;                    // 6 a quad
    struct hg_warp_quad *quads;      // while they are sorted
    size_t vertex_capacity, index_capacity, quad_capacity;
    uint32_t quad_count;
};

// The mesh of a known depth as `camera` sees it in `rect`. False: the two are of different kinds,
// or one looks nowhere. HG_E_NOMEM leaves a mesh without quads, and is false, too.
bool hg_warp_build(struct hg_warp_mesh *mesh, const struct hg_warp_depth *depth,
    const struct hgp_view_camera *camera, const struct hg_projection_rect *rect) HG_MUST_CHECK;
void hg_warp_mesh_finish(struct hg_warp_mesh *mesh);

#endif
