// layout.h - which bodies of ray geometry are instanced, and which are flattened into the
// world. Floor 2 (trace). Thread: any; no shared state. Private to the room.
//
// The pieces of a draw are a *body*; draws whose pieces have the same keys share it, each at a
// *place* of its own. A body that is placed once, or is small, is *flat*: its triangles go with all
// others of that kind into one structure in world space, so that rays need not enter an instance
// for each draw (the boxes of draws overlap). What animations move is not, so that they do not
// build the flat structure for each frame. Rounding differs between both: the choice depends on
// nothing that was there before.
#ifndef HG_RENDERER_TRACE_LAYOUT_H
#define HG_RENDERER_TRACE_LAYOUT_H

#include "renderer/trace/layout_apart.h"
#include "renderer/trace/ray_geometry.h"

struct hg_trace_body {
    uint64_t key;
    uint64_t triangles, vertices;      // vertices: of the pieces, shared ones once
    uint32_t first_place, place_count; // consecutive in `places`
    bool flat, deforms;
    bool in_world; // not flat, but in world space: its one place has no matrix (layout_apart.h)
    bool still;    // matrices are the same at both ends of the shutter
    bool moves;    // positions are others at the opening of the shutter
};

struct hg_trace_place {
    uint32_t draw, mask;
    uint32_t first_piece, piece_count;
    uint64_t key; // of the body
};

struct hg_trace_layout { // zeroed = empty; keeps its memory
    const struct hg_ray_geometry_piece *pieces;
    struct hg_trace_place *places; // by body, then draw
    size_t place_capacity;
    uint32_t place_count;
    struct hg_trace_body *bodies; // by key
    size_t body_capacity;
    uint32_t body_count;
    uint64_t flat_key;       // of all flat bodies and where they are; 0 = there are none
    uint64_t flat_triangles; // placed
    bool flat_deforms;       // under the same key
    uint64_t triangles;      // of all bodies, those of flat ones as often as they are placed
    uint32_t instances;      // places of bodies that are not flat
    bool motion;             // something moves while the shutter is open
    bool apart;              // hg_trace_params.apart
    struct hg_trace_apart moved;
};

// HG_E_NOMEM.
enum hg_status hg_trace_layout_make(struct hg_trace_layout *layout,
    const struct hg_ray_geometry_piece *pieces, uint32_t count) HG_MUST_CHECK;
void hg_trace_layout_finish(struct hg_trace_layout *layout);
// What brings a place to world space: none where it is there already.
static inline const float *hg_trace_matrix(
    const struct hg_trace_body *body, const struct hg_ray_geometry_piece *piece)
{
    static const float identity[12] = {1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0};
    return body->in_world ? identity : piece->world;
}
// The piece of a place, with where it is.
static inline const struct hg_ray_geometry_piece *hg_trace_piece(
    const struct hg_trace_layout *layout, const struct hg_trace_place *place, uint32_t index)
{
    return &layout->pieces[place->first_piece + index];
}
// A corner in world space, the same bits for all backends.
static inline void hg_trace_to_world(const float m[12], const float p[3], float out[3])
{
    for (int c = 0; c < 3; c++)
        out[c] = m[c] * p[0] + m[3 + c] * p[1] + m[6 + c] * p[2] + m[9 + c];
}

#endif
