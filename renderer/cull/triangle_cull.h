// triangle_cull.h - conservative per-triangle culling, for all samples of a view.
// Floor 2 (geometry). Pure: any thread. Private to the room.
//
// A rasteriser in software pays for each triangle by itself: corners, setup, and a place in the
// list of every tile that it touches. Most of those that the box of a meshlet lets pass face away,
// lie outside of the image or between the samples. Tests are conservative: corners may lie anywhere
// within a radius about where they are computed here, which bounds what a driver rounds (its own
// arithmetic in single precision, and corners that it snaps to 1/256 of a pixel). So exactly the
// same samples are covered, whether the rest is drawn or not.
#ifndef HG_RENDERER_CULL_TRIANGLE_CULL_H
#define HG_RENDERER_CULL_TRIANGLE_CULL_H

#include "renderer/geometry/geometry_state.h"
#include "renderer/cull/culling.h"

// One draw as one view sees it. Pixels: samples lie at whole numbers.
struct hg_triangle_cull {
    float x[4], y[4], z[4], w[4];  // rows: of a position, times w but for w itself
    float width, height;           // px
    float shift_px;                // samples may lie so far from whole numbers
    float radius_px, radius_per_w; // of corners: radius_px + radius_per_w / w
    float side;                    // sign of the area (y down) of triangles that face away; 0: none
};

// world: of the draw. bounds: of the part, object space. flags: HG_DRAW_* of the draw.
void hg_triangle_cull_open(const struct hg_culling_view *view, const struct hg_mat4x3 *world,
    const struct hg_box *bounds, uint32_t flags, struct hg_triangle_cull *out);

// Where triangles are listed, with room for all of them.
struct hg_triangle_list {
    uint32_t *indices; // three each
    uint32_t *ids;     // one each; NULL: none are wanted
    uint32_t first_id; // id of the first triangle that is looked at
};

// Lists the triangles of `indices` that may show, as they are and in their order. indices: [count *
// 3]. positions: [vertices * 3]. Returns how many there are. Cost: 10 ns for each of `count`.
uint32_t hg_triangle_cull_list(const struct hg_triangle_cull *cull, const float *positions,
    const uint32_t *indices, uint32_t count, const struct hg_triangle_list *out);

#endif
