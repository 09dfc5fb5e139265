// pieces.c - connected pieces of the source surface and how large they are.
//
// What a simplified surface may leave out altogether is a piece that is small enough: a piece that
// is nowhere wider than the error changes no more of a picture than a surface moved by the error.
// Scans hold tiny pieces inside of their bodies, far from everything; by their distance alone they
// would have to stay at any level.
#include <math.h>
#include <string.h>

#include "base/alloc.h"
#include "renderer/lod/internal.h"

static uint32_t top_of(uint32_t *up, uint32_t i)
{
    while (up[i] != i) {
        up[i] = up[up[i]];
        i = up[i];
    }
    return i;
}

// The smaller number leads, so that a piece's first position is its top.
static void join(uint32_t *up, uint32_t a, uint32_t b)
{
    a = top_of(up, a);
    b = top_of(up, b);
    if (a < b)
        up[b] = a;
    else
        up[a] = b;
}

static uint32_t find_pieces(const struct hg_lod_mesh *m, uint32_t *piece_of)
{
    for (uint32_t i = 0; i < m->position_count; i++)
        piece_of[i] = i;
    for (size_t i = 0; i < (size_t)m->triangle_count * 3; i += 3) {
        const uint32_t a = m->position_of[m->triangles[i]];
        join(piece_of, a, m->position_of[m->triangles[i + 1]]);
        join(piece_of, a, m->position_of[m->triangles[i + 2]]);
    }
    // A top comes before all it leads: tops become numbers on the way.
    uint32_t count = 0;
    for (uint32_t i = 0; i < m->position_count; i++)
        piece_of[i] = piece_of[i] == i ? count++ : piece_of[piece_of[i]];
    return count;
}

struct extent {
    int32_t min[3], max[3]; // lattice
};

static enum hg_status measure_pieces(struct hg_lod_mesh *m, struct hg_lod_budget *budget)
{
    struct extent *boxes = NULL;
    enum hg_status status = hg_lod_take(budget, m->piece_count, sizeof *m->pieces, &m->pieces);
    if (status == HG_OK)
        status = hg_lod_take(budget, m->piece_count, sizeof *boxes, &boxes);
    for (uint32_t i = 0; status == HG_OK && i < m->piece_count; i++)
        for (int k = 0; k < 3; k++)
            boxes[i] = (struct extent){
                {INT32_MAX, INT32_MAX, INT32_MAX}, {INT32_MIN, INT32_MIN, INT32_MIN}};
    for (uint32_t i = 0; status == HG_OK && i < m->position_count; i++) {
        struct extent *box = &boxes[m->piece_of[i]];
        for (int k = 0; k < 3; k++) {
            const int32_t at = m->lattice[i][k];
            box->min[k] = at < box->min[k] ? at : box->min[k];
            box->max[k] = at > box->max[k] ? at : box->max[k];
        }
    }
    for (uint32_t i = 0; status == HG_OK && i < m->piece_count; i++) {
        double sum = 0.0;
        for (int k = 0; k < 3; k++) {
            const double side = (double)boxes[i].max[k] - boxes[i].min[k];
            sum += side * side;
        }
        m->pieces[i] = (float)(sqrt(sum) * (double)m->format.quantum);
    }
    hg_lod_give(budget, &boxes, m->piece_count, sizeof *boxes);
    return status;
}

enum hg_status hg_lod_find_pieces(struct hg_lod_mesh *m, struct hg_lod_budget *budget)
{
    enum hg_status status = hg_lod_take(budget, m->position_count, 4, &m->piece_of);
    if (status != HG_OK || m->position_count == 0)
        return status;
    m->piece_count = find_pieces(m, m->piece_of);
    if (m->piece_count > 1)
        return measure_pieces(m, budget);
    hg_lod_give(budget, &m->piece_of, m->position_count, 4);
    return HG_OK;
}
