// simplifier.h - the state of one simplification: what simplify.c prepares and collapse.c works on.
// Floor 2, private to geometry/. One thread.
#ifndef HG_RENDERER_LOD_SIMPLIFIER_H
#define HG_RENDERER_LOD_SIMPLIFIER_H

#include "renderer/lod/internal.h"
#include "renderer/lod/quadric.h"

#define HG_LOD_RING_MAX   48     // positions with more neighbours stay
#define HG_LOD_LEAST_AREA 1e-12f // squared edge lengths

struct hg_lod_ring {
    uint32_t at[HG_LOD_RING_MAX];  // neighbour positions
    uint8_t uses[HG_LOD_RING_MAX]; // triangles at the edge to it
    uint32_t count, odd;           // odd: edges without exactly two triangles
    uint32_t twisted;              // edges that two triangles have in the same direction
    bool full;
};

struct hg_lod_simplifier {
    struct hg_lod_patch patch;
    struct hg_lod_quadric *shape; // [position_count]
    struct hg_lod_quadric *looks; // [vertex_count]
    hg_lod_vec *gradients;        // [vertex_count * attribute_count]
    hg_lod_vec *mean;             // [vertex_count] normals by area; all 0: no normals
    float *area, *looks_area;     // [position_count], [vertex_count] of the triangles in them
    float *root;                  // [position_count] of `area`
    float *cost;                  // [position_count] of the best collapse
    uint32_t *target;             // [position_count]
    uint64_t *heap;               // [position_count] bits of the cost, then the position
    uint32_t *place;              // in the heap, HG_LOD_NONE: not in it
    uint32_t heap_count;
    uint32_t *stamp, now; // [position_count] marks of a search
    uint8_t *slot;        // [position_count] in the ring
    uint8_t *plain;       // [position_count] all its edges have two triangles, turned the same way
    uint8_t *rim;         // [position_count] has open edges
    uint8_t *sure;        // [position_count] depth is in the cost
    uint8_t *stale;       // [position_count] the cost is a lower bound: evaluate first
    bool permissive;      // give up topology and open edges
    void *memory;
};

// Next corner of a live triangle from `corner` on; drops dead ones from the list.
static inline uint32_t hg_lod_live_corner(const struct hg_lod_patch *p, uint32_t corner)
{
    while (corner != HG_LOD_NONE && p->triangles[corner / 4][0] == HG_LOD_NONE)
        corner = p->next[corner];
    return corner;
}

#define HG_LOD_FOR_CORNERS(patch, position, c)                                                     \
    for (uint32_t c = hg_lod_live_corner(patch, (patch)->head[position]); c != HG_LOD_NONE;        \
         c = hg_lod_live_corner(patch, (patch)->next[c]))

// Positions of the corner and of the next two.
static inline void hg_lod_corner_places(
    const struct hg_lod_patch *p, uint32_t corner, uint32_t at[3])
{
    static const uint8_t turn[3][3] = {{0, 1, 2}, {1, 2, 0}, {2, 0, 1}};
    const uint32_t *t = p->places[corner / 4];
    const uint8_t *k = turn[corner % 4];
    at[0] = t[k[0]];
    at[1] = t[k[1]];
    at[2] = t[k[2]];
}

static inline void hg_lod_corner_vertices(
    const struct hg_lod_patch *p, uint32_t corner, uint32_t v[3])
{
    const uint32_t *t = p->triangles[corner / 4];
    const uint32_t k = corner % 4;
    v[0] = t[k];
    v[1] = t[k == 2 ? 0 : k + 1];
    v[2] = t[k == 0 ? 2 : k - 1];
}

static inline hg_lod_vec hg_lod_vec_cross(hg_lod_vec a, hg_lod_vec b)
{
    return (hg_lod_vec){
        a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0], 0.0f};
}

static inline hg_lod_vec hg_lod_vec_at(const struct hg_lod_patch *p, uint32_t position)
{
    return hg_lod_vec_load(p->point[position]);
}

static inline float hg_lod_vec_dot(hg_lod_vec a, hg_lod_vec b)
{
    return hg_lod_vec_sum(a * b);
}

// Neighbours of a position and how often edges are used; drops dead corners.
void hg_lod_gather(struct hg_lod_simplifier *s, uint32_t position, struct hg_lod_ring *ring);
// Marks a position as plain and finds its first collapse, if its edges are seen to be so quickly.
bool hg_lod_choose_if_plain(struct hg_lod_simplifier *s, uint32_t position);
// Finds the best collapse of a position; with `check` only among valid ones, and by depth too.
void hg_lod_evaluate(struct hg_lod_simplifier *s, uint32_t position, bool check);
// Collapses, cheapest first, until `target` triangles are left or nothing more can be done.
void hg_lod_collapse(struct hg_lod_simplifier *s, uint32_t target);

#endif
