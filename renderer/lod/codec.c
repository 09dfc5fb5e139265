// codec.c - what encoder and decoder of a chunk do alike: the order of vertices, predictions.
#include <string.h>
#include <zlib.h>

#include "renderer/lod/discs.h"
#include "renderer/lod/internal.h"

uint32_t hg_lod_crc(const void *data, size_t size)
{
    return (uint32_t)crc32_z(0, data, size);
}

// ---- order --------------------------------------------------------------------------------------

#define EDGES 2048u

struct edge {
    uint32_t a, b, opposite; // a > b: a zeroed entry is no edge
};

static struct edge *edge_slot(struct edge *edges, uint32_t a, uint32_t b)
{
    const uint32_t hash = (a ^ b * 0x9e3779b1u) * 0x85ebca6bu;
    return &edges[(hash >> 16) % EDGES];
}

static void remember(struct edge *edges, uint32_t a, uint32_t b, uint32_t opposite)
{
    const uint32_t high = a > b ? a : b, low = a > b ? b : a;
    *edge_slot(edges, high, low) = (struct edge){high, low, opposite};
}

static uint32_t recall(struct edge *edges, uint32_t a, uint32_t b)
{
    const uint32_t high = a > b ? a : b, low = a > b ? b : a;
    const struct edge *e = edge_slot(edges, high, low);
    return high != low && e->a == high && e->b == low ? e->opposite : HG_LOD_NONE;
}

uint32_t hg_lod_visits(const uint32_t *indices, uint32_t index_count, uint32_t vertex_count,
    struct hg_lod_visit *visits, uint8_t *seen)
{
    struct edge edges[EDGES];
    uint32_t n = 0;
    memset(edges, 0, sizeof edges);
    memset(seen, 0, vertex_count);
    for (uint32_t i = 0; i + 2 < index_count; i += 3) {
        const uint32_t *t = indices + i;
        for (uint32_t k = 0; k < 3; k++) {
            const uint32_t v = t[k], x = t[(k + 1) % 3], y = t[(k + 2) % 3];
            if (seen[v])
                continue;
            struct hg_lod_visit *at = &visits[n];
            *at = (struct hg_lod_visit){v, HG_LOD_NONE, HG_LOD_NONE, HG_LOD_NONE};
            if (seen[x] && seen[y]) {
                *at = (struct hg_lod_visit){v, x, y, recall(edges, x, y)};
            } else if (seen[x] || seen[y]) {
                at->a = seen[x] ? x : y;
            } else if (n > 0) {
                at->a = visits[n - 1].vertex;
            }
            seen[v] = 1;
            n++;
        }
        for (uint32_t k = 0; k < 3; k++)
            remember(edges, t[k], t[(k + 1) % 3], t[(k + 2) % 3]);
    }
    return n;
}

// Points follow each other.
void hg_lod_point_visits(uint32_t count, struct hg_lod_visit *visits)
{
    for (uint32_t i = 0; i < count; i++)
        visits[i] = (struct hg_lod_visit){i, i > 0 ? i - 1 : HG_LOD_NONE, HG_LOD_NONE, HG_LOD_NONE};
}

bool hg_lod_disc_counts(const struct hg_lod_chunk *chunk, uint32_t *points, uint32_t *sides)
{
    const uint64_t triple = chunk->vertex_count * 3ull;
    *points = triple > chunk->index_count ? (uint32_t)((triple - chunk->index_count) / 6) : 0;
    *sides = *points > 0 ? chunk->vertex_count / *points : 0;
    return hg_disc_sides_ok(*sides) && (uint64_t)*points * *sides == chunk->vertex_count &&
           (uint64_t)*points * hg_disc_triangles(*sides) * 3 == chunk->index_count;
}

// ---- components ---------------------------------------------------------------------------------

static uint32_t add(
    struct hg_lod_component *out, uint32_t n, int kind, int32_t word, uint32_t count)
{
    for (uint32_t i = 0; word >= 0 && i < count; i++) {
        out[n].kind = kind;
        out[n].word = word;
        out[n++].index = i;
    }
    return n;
}

uint32_t hg_lod_components(
    const struct hg_lod_format *f, struct hg_lod_component out[HG_LOD_PLANES])
{
    uint32_t n = add(out, 0, HG_LOD_NORMAL, f->normal, 2);
    n = add(out, n, HG_LOD_TANGENT, f->tangent, 2);
    n = add(out, n, HG_LOD_LATTICE, f->uv, 2);
    n = add(out, n, HG_LOD_LATTICE, f->uv1, 2);
    n = add(out, n, HG_LOD_LATTICE, f->radius, 1);
    return add(out, n, f->flags & HG_DRAW_COLOR8 ? HG_LOD_BYTES : HG_LOD_SHORTS, f->color, 4);
}

// The second component of a tangent carries the sign of w in its lowest bit.
int32_t hg_lod_component_get(const struct hg_lod_component *c, const uint32_t *words)
{
    const uint32_t w = words[c->word];
    switch (c->kind) {
    case HG_LOD_NORMAL:
        return (int16_t)(w >> (16 * c->index));
    case HG_LOD_TANGENT:
        if (c->index == 0)
            return (int16_t)w;
        const int32_t y = (int32_t)(w >> 16 & 0x7fffu);
        return (y >= 0x4000 ? y - 0x8000 : y) * 2 + (int32_t)(w >> 31);
    case HG_LOD_BYTES:
        return (int32_t)(w >> (8 * c->index) & 0xffu);
    case HG_LOD_SHORTS:
        return (int32_t)(words[c->word + (int32_t)c->index / 2] >> (16 * (c->index & 1)) & 0xffffu);
    case HG_LOD_LATTICE:
        break;
    }
    return (int32_t)words[c->word + (int32_t)c->index];
}

void hg_lod_component_set(const struct hg_lod_component *c, uint32_t *words, int32_t value)
{
    uint32_t *w = &words[c->word];
    const uint32_t v = (uint32_t)value;
    switch (c->kind) {
    case HG_LOD_NORMAL:
        *w = c->index == 0 ? (*w & 0xffff0000u) | (v & 0xffffu) : (*w & 0xffffu) | v << 16;
        break;
    case HG_LOD_TANGENT:
        if (c->index == 0)
            *w = (*w & 0xffff0000u) | (v & 0xffffu);
        else
            *w = (*w & 0xffffu) | (v >> 1 & 0x7fffu) << 16 | v << 31;
        break;
    case HG_LOD_BYTES:
        *w |= (v & 0xffu) << (8 * c->index); // words begin as 0
        break;
    case HG_LOD_SHORTS:
        w[c->index / 2] |= (v & 0xffffu) << (16 * (c->index & 1));
        break;
    case HG_LOD_LATTICE:
        w[c->index] = v;
        break;
    }
}

// ---- predictions --------------------------------------------------------------------------------

// Steps of the octahedral coordinates of v; (0, 0) for none.
static int32_t octahedral(const int64_t v[3], uint32_t index)
{
    uint64_t size[3], largest = 0;
    for (int k = 0; k < 3; k++) {
        size[k] = v[k] < 0 ? 0 - (uint64_t)v[k] : (uint64_t)v[k];
        largest |= size[k];
    }
    const int bits = largest > 0 ? 64 - __builtin_clzll(largest) : 0;
    const int shift = bits > 40 ? bits - 40 : 0;
    uint64_t sum = 0;
    for (int k = 0; k < 3; k++)
        sum += size[k] >>= shift;
    if (sum == 0)
        return 0;
    const uint64_t along = v[2] >= 0 ? size[index] : sum - size[1 - index];
    const int32_t steps = (int32_t)((along * HG_LOD_NORMAL_STEPS + sum / 2) / sum);
    return v[index] < 0 ? -steps : steps;
}

int32_t hg_lod_predict(const struct hg_lod_component *c, const struct hg_lod_visit *v,
    const int32_t *values, const int64_t (*normals)[3])
{
    if (c->kind == HG_LOD_NORMAL && normals != NULL)
        return octahedral(normals[v->vertex], c->index);
    if (c->kind == HG_LOD_LATTICE)
        return hg_lod_predict_lattice(v, values);
    return v->a != HG_LOD_NONE ? values[v->a] : 0;
}

void hg_lod_sum_normals(const uint32_t *indices, uint32_t index_count, const int32_t (*lattice)[3],
    uint32_t vertex_count, int64_t (*normals)[3])
{
    memset(normals, 0, vertex_count * sizeof *normals);
    for (uint32_t i = 0; i + 2 < index_count; i += 3) {
        const int32_t *p[3];
        int64_t e[2][3], n[3];
        for (int k = 0; k < 3; k++)
            p[k] = lattice[indices[i + (uint32_t)k]];
        for (int k = 0; k < 3; k++) {
            e[0][k] = (int64_t)p[1][k] - p[0][k];
            e[1][k] = (int64_t)p[2][k] - p[0][k];
        }
        n[0] = e[0][1] * e[1][2] - e[0][2] * e[1][1];
        n[1] = e[0][2] * e[1][0] - e[0][0] * e[1][2];
        n[2] = e[0][0] * e[1][1] - e[0][1] * e[1][0];
        for (int k = 0; k < 3; k++)
            for (int j = 0; j < 3; j++) {
                int64_t *to = &normals[indices[i + (uint32_t)k]][j];
                *to = (int64_t)((uint64_t)*to + (uint64_t)n[j]);
            }
    }
}
