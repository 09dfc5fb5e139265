#include "renderer/lod/proxy_mesh.h"

#include <math.h>
#include <string.h>

#include "base/alloc.h"
#include "base/spill.h"
#include "renderer/scene/asset.h"

#define FREE       UINT32_MAX
#define KEEPS      0.8f     // of the cells along an axis, while there are too many triangles
#define CELLS_MAX  2097151u // along an axis: 21 bits
#define SCARCE     8u // fewer than this part of what was asked for: cells are too large for it
#define GROWS_MOST 16.0f

struct cell {
    uint64_t key;
    double position[3];
    float normal[3];
    uint32_t count, first; // vertices, and the first of them
};

struct grid {
    float min[3], scale; // cells per metre
    struct cell *cells;
    uint32_t *table; // [1 << bits] numbers of cells, FREE
    size_t capacity;
    uint32_t count, bits;
};

// ---- cells --------------------------------------------------------------------------------------

static uint32_t slot_of(uint64_t key, uint32_t bits)
{
    return (uint32_t)(key * 0x9e3779b97f4a7c15ull >> (64 - bits));
}

static enum hg_status rehash(struct grid *g, uint32_t bits)
{
    uint32_t *table = hg_spill_scratch((size_t)1 << bits, sizeof *table);
    if (table == NULL)
        return HG_E_NOMEM;
    memset(table, 0xff, sizeof *table << bits);
    for (uint32_t i = 0; i < g->count; i++) {
        uint32_t slot = slot_of(g->cells[i].key, bits);
        while (table[slot] != FREE)
            slot = (slot + 1) & ((1u << bits) - 1);
        table[slot] = i;
    }
    hg_free(g->table);
    g->table = table;
    g->bits = bits;
    return HG_OK;
}

static enum hg_status add_cell(struct grid *g, uint64_t key, uint32_t vertex, uint32_t *cell)
{
    if (hg_grow(&g->cells, &g->capacity, g->count + 1ull, sizeof *g->cells) != HG_OK ||
        ((uint64_t)g->count * 2 >= 1ull << g->bits && rehash(g, g->bits + 1) != HG_OK))
        return HG_E_NOMEM;
    uint32_t slot = slot_of(key, g->bits);
    while (g->table[slot] != FREE)
        slot = (slot + 1) & ((1u << g->bits) - 1);
    *cell = g->table[slot] = g->count++;
    g->cells[*cell] = (struct cell){.key = key, .first = vertex};
    return HG_OK;
}

static enum hg_status cell_of(struct grid *g, const float p[3], uint32_t vertex, uint32_t *cell)
{
    uint64_t key = 0;
    for (int k = 0; k < 3; k++) {
        const float at = fminf(fmaxf((p[k] - g->min[k]) * g->scale, 0.0f), (float)CELLS_MAX);
        key = key << 21 | (uint64_t)at;
    }
    uint32_t slot = slot_of(key, g->bits);
    while (g->table[slot] != FREE && g->cells[g->table[slot]].key != key)
        slot = (slot + 1) & ((1u << g->bits) - 1);
    *cell = g->table[slot];
    return *cell != FREE ? HG_OK : add_cell(g, key, vertex, cell);
}

static enum hg_status start_grid(struct grid *g, const struct hg_mesh_part *part, float cells)
{
    float max[3], side = 0.0f;
    memcpy(g->min, part->positions, sizeof g->min);
    memcpy(max, part->positions, sizeof max);
    for (size_t v = 0; v < part->vertex_count; v++) {
        for (int k = 0; k < 3; k++) {
            g->min[k] = fminf(g->min[k], part->positions[v * 3 + (size_t)k]);
            max[k] = fmaxf(max[k], part->positions[v * 3 + (size_t)k]);
        }
    }
    for (int k = 0; k < 3; k++)
        side = fmaxf(side, max[k] - g->min[k]);
    g->scale = side > 0.0f && isfinite(cells / side) ? cells / side : 0.0f;
    return rehash(g, 12);
}

// cell_at [vertex_count] out: the cell of each vertex.
static enum hg_status fill_grid(struct grid *g, const struct hg_mesh_part *part, uint32_t *cell_at)
{
    static const float no_normal[3];
    for (uint32_t v = 0; v < part->vertex_count; v++) {
        const float *p = part->positions + (size_t)v * 3;
        const float *n = part->normals != NULL ? part->normals + (size_t)v * 3 : no_normal;
        const enum hg_status status = cell_of(g, p, v, &cell_at[v]);
        if (status != HG_OK)
            return status;
        struct cell *c = &g->cells[cell_at[v]];
        for (int k = 0; k < 3; k++) {
            c->position[k] += (double)p[k];
            c->normal[k] += n[k];
        }
        c->count++;
    }
    return HG_OK;
}

// ---- triangles ----------------------------------------------------------------------------------

struct triangles {
    uint32_t (*items)[3];
    uint32_t *table; // [1 << bits], FREE
    size_t capacity;
    uint32_t count, bits;
};

static uint32_t slot_of_triangle(const struct triangles *t, const uint32_t at[3], uint32_t bits)
{
    const uint64_t key = ((uint64_t)at[0] << 32 | at[1]) * 0xd6e8feb86659fd93ull + at[2];
    uint32_t slot = slot_of(key ^ key >> 32, bits);
    while (t->table[slot] != FREE && memcmp(t->items[t->table[slot]], at, 12) != 0)
        slot = (slot + 1) & ((1u << bits) - 1);
    return slot;
}

static enum hg_status grow_table(struct triangles *t)
{
    uint32_t *old = t->table;
    t->bits++;
    t->table = hg_spill_scratch((size_t)1 << t->bits, sizeof *t->table);
    if (t->table == NULL) {
        t->table = old;
        return HG_E_NOMEM;
    }
    hg_free(old);
    memset(t->table, 0xff, sizeof *t->table << t->bits);
    for (uint32_t i = 0; i < t->count; i++)
        t->table[slot_of_triangle(t, t->items[i], t->bits)] = i;
    return HG_OK;
}

// Adds a triangle that is not there yet.
static enum hg_status add_triangle(struct triangles *t, const uint32_t v[3])
{
    const int k = v[0] < v[1] ? (v[0] < v[2] ? 0 : 2) : (v[1] < v[2] ? 1 : 2); // the least first
    const uint32_t at[3] = {v[k], v[(k + 1) % 3], v[(k + 2) % 3]};
    if ((uint64_t)t->count * 2 >= 1ull << t->bits && grow_table(t) != HG_OK)
        return HG_E_NOMEM;
    const uint32_t slot = slot_of_triangle(t, at, t->bits);
    if (t->table[slot] != FREE)
        return HG_OK;
    if (hg_grow(&t->items, &t->capacity, t->count + 1ull, sizeof *t->items) != HG_OK)
        return HG_E_NOMEM;
    memcpy(t->items[t->count], at, sizeof at);
    t->table[slot] = t->count++;
    return HG_OK;
}

static enum hg_status fill_triangles(
    struct triangles *t, const struct hg_mesh_part *part, const uint32_t *cell_at)
{
    enum hg_status status = HG_OK;
    t->bits = 11;
    status = grow_table(t);
    for (size_t i = 0; i < part->index_count && status == HG_OK; i += 3) {
        const uint32_t *v = part->indices + i;
        const uint32_t at[3] = {cell_at[v[0]], cell_at[v[1]], cell_at[v[2]]};
        if (at[0] != at[1] && at[1] != at[2] && at[2] != at[0])
            status = add_triangle(t, at);
    }
    return status;
}

// ---- parts --------------------------------------------------------------------------------------

static enum hg_status start_part(const struct hg_mesh_part *like, uint32_t vertices,
    uint32_t triangles, struct hg_mesh_part **out)
{
    struct hg_mesh_part *p = *out = hg_calloc(1, sizeof *p);
    if (p == NULL)
        return HG_E_NOMEM;
    p->vertex_count = vertices;
    p->index_count = triangles * 3;
    p->indices = hg_calloc(p->index_count, sizeof *p->indices);
    p->positions = hg_calloc(vertices, 12);
    p->normals = like->normals != NULL ? hg_calloc(vertices, 12) : NULL;
    p->tangents = like->tangents != NULL ? hg_calloc(vertices, 16) : NULL;
    p->colors = like->colors != NULL ? hg_calloc(vertices, 16) : NULL;
    bool whole = p->indices != NULL && p->positions != NULL &&
                 (p->normals != NULL) == (like->normals != NULL) &&
                 (p->tangents != NULL) == (like->tangents != NULL) &&
                 (p->colors != NULL) == (like->colors != NULL);
    for (int i = 0; i < 2; i++) {
        p->uv[i] = like->uv[i] != NULL ? hg_calloc(vertices, 8) : NULL;
        whole = whole && (p->uv[i] != NULL) == (like->uv[i] != NULL);
    }
    return whole ? HG_OK : HG_E_NOMEM;
}

static void copy_vertex(
    struct hg_mesh_part *to, size_t v, const struct hg_mesh_part *from, size_t source)
{
    memcpy(to->positions + v * 3, from->positions + source * 3, 12);
    if (from->normals != NULL)
        memcpy(to->normals + v * 3, from->normals + source * 3, 12);
    if (from->tangents != NULL)
        memcpy(to->tangents + v * 4, from->tangents + source * 4, 16);
    if (from->colors != NULL)
        memcpy(to->colors + v * 4, from->colors + source * 4, 16);
    for (int i = 0; i < 2; i++)
        if (from->uv[i] != NULL)
            memcpy(to->uv[i] + v * 2, from->uv[i] + source * 2, 8);
}

static enum hg_status part_of_cells(const struct hg_mesh_part *part, const struct grid *g,
    const struct triangles *t, struct hg_mesh_part **out)
{
    const enum hg_status status = start_part(part, g->count, t->count, out);
    if (status != HG_OK)
        return status;
    struct hg_mesh_part *p = *out;
    for (size_t i = 0; i < g->count; i++) {
        const struct cell *c = &g->cells[i];
        const float *n = c->normal, length = sqrtf(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
        copy_vertex(p, i, part, c->first);
        for (size_t k = 0; k < 3; k++) {
            p->positions[i * 3 + k] = (float)(c->position[k] / c->count);
            if (p->normals != NULL && length > 1e-3f * (float)c->count) // else they turn every way
                p->normals[i * 3 + k] = n[k] / length;
        }
    }
    if (t->count > 0)
        memcpy(p->indices, t->items, t->count * sizeof *t->items);
    return HG_OK;
}

static enum hg_status cluster(
    const struct hg_mesh_part *part, float cells, struct hg_mesh_part **out)
{
    struct grid g = {0};
    struct triangles t = {0};
    uint32_t *cell_at = hg_spill_scratch(part->vertex_count, sizeof *cell_at);
    enum hg_status status = cell_at != NULL ? start_grid(&g, part, cells) : HG_E_NOMEM;
    *out = NULL;
    if (status == HG_OK)
        status = fill_grid(&g, part, cell_at);
    if (status == HG_OK)
        status = fill_triangles(&t, part, cell_at);
    if (status == HG_OK)
        status = part_of_cells(part, &g, &t, out);
    hg_free(cell_at);
    hg_free(g.cells);
    hg_free(g.table);
    hg_free(t.items);
    hg_free(t.table);
    return status;
}

// Every n-th triangle, larger by as much as the others covered.
static enum hg_status sample(
    const struct hg_mesh_part *part, uint32_t triangles, struct hg_mesh_part **out)
{
    const uint32_t all = part->index_count / 3, count = all < triangles ? all : triangles;
    const enum hg_status status = start_part(part, count * 3, count, out);
    if (status != HG_OK)
        return status;
    const float grow = fminf(sqrtf((float)all / (float)count), GROWS_MOST);
    for (size_t i = 0; i < count; i++) {
        const uint32_t *v = part->indices + (size_t)((uint64_t)i * all / count) * 3;
        float *p = (*out)->positions + i * 9;
        for (size_t k = 0; k < 3; k++) {
            copy_vertex(*out, i * 3 + k, part, v[k]);
            (*out)->indices[i * 3 + k] = (uint32_t)(i * 3 + k);
        }
        for (size_t k = 0; k < 3; k++) {
            const float centre = p[k] / 3.0f + p[3 + k] / 3.0f + p[6 + k] / 3.0f;
            for (size_t c = 0; c < 3; c++)
                p[c * 3 + k] = centre + (p[c * 3 + k] - centre) * grow;
        }
    }
    return HG_OK;
}

void hg_proxy_free(struct hg_mesh_part *p)
{
    if (p == NULL)
        return;
    hg_mesh_part_finish(p, 0);
    hg_free(p);
}

enum hg_status hg_proxy_build(
    const struct hg_mesh_part *part, uint32_t triangles, struct hg_mesh_part **out)
{
    *out = NULL;
    if (part->vertex_count == 0 || part->index_count == 0)
        return start_part(part, 0, 0, out);
    float cells = sqrtf((float)triangles);
    enum hg_status status = cluster(part, cells, out);
    while (status == HG_OK && (*out)->index_count / 3 > triangles) {
        struct hg_mesh_part *finer = *out;
        cells *= KEEPS;
        status = cluster(finer, cells, out);
        hg_proxy_free(finer);
    }
    const uint32_t enough = part->index_count / 3 < triangles ? part->index_count / 3 : triangles;
    if (status == HG_OK && (*out)->index_count / 3 < enough / SCARCE) {
        hg_proxy_free(*out);
        *out = NULL;
        status = sample(part, triangles, out);
    }
    if (status != HG_OK) {
        hg_proxy_free(*out);
        *out = NULL;
    }
    return status;
}
