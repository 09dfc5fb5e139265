// Normals by crease angle, of parts without normals (mesh_tools.h).
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/alloc.h"
#include "base/spill.h"
#include "renderer/scene/asset.h"
#include "renderer/scene/mesh_tools.h"
#include "renderer/scene/xform.h"

enum { PAIRS_OF = 8, INSERTION = 16 }; // triangles at an edge of which all pairs are compared

// The cosine of HG_CREASE_DEG, less what rounding of positions takes from a prism of nine sides.
static const float crease_cosine = 0.766044f - 2e-4f;

struct edge { // of one triangle, filed under its lower vertex
    uint32_t other, corner;
};

struct creases {
    struct hg_mesh_part *part;
    const uint32_t *smoothing;
    uint32_t corners;
    uint32_t *weld;     // [vertex_count] the first vertex at the same position
    float *normals;     // [corners] of triangles, unit; zero: no area
    uint32_t *first;    // [vertex_count + 1] of `edges`
    struct edge *edges; // [corners]
    uint32_t *parent;   // [corners] union-find of corners that share a normal
    float *sums;        // [corners * 3] of normals, at roots
    uint32_t *table;    // [table_size] 1 + corner, by vertex and root
    uint32_t table_size;
    uint32_t *number; // [corners] of the vertex that a first corner became
    uint32_t *source; // [corners] new vertex to old
};

static uint32_t table_size(uint32_t count)
{
    uint32_t size = 64;
    while (size < UINT32_C(1) << 31 && size / 2 < count)
        size *= 2;
    return size;
}

static uint32_t mix(uint32_t a, uint32_t b, uint32_t c)
{
    uint64_t h = (((uint64_t)a << 32) | b) * UINT64_C(0x9e3779b97f4a7c15);
    h = (h ^ h >> 32 ^ c) * UINT64_C(0xff51afd7ed558ccd);
    return (uint32_t)(h >> 32);
}

static bool weld(struct creases *k)
{
    const struct hg_mesh_part *part = k->part;
    const uint32_t size = table_size(part->vertex_count);
    uint32_t *table = hg_spill_scratch(size, sizeof *table); // 1 + vertex
    for (uint32_t v = 0; table && v < part->vertex_count; v++) {
        uint32_t bits[3];
        float p[3];
        for (int c = 0; c < 3; c++)
            p[c] = part->positions[(size_t)v * 3 + c] + 0.0f; // -0 is 0
        memcpy(bits, p, sizeof bits);
        uint32_t at = mix(bits[0], bits[1], bits[2]) & (size - 1);
        for (; table[at]; at = (at + 1) & (size - 1)) {
            const float *q = part->positions + (size_t)(table[at] - 1) * 3;
            if (p[0] == q[0] && p[1] == q[1] && p[2] == q[2])
                break;
        }
        if (!table[at])
            table[at] = v + 1;
        k->weld[v] = table[at] - 1;
    }
    hg_free(table);
    return table != NULL;
}

static const float *position(const struct creases *k, uint32_t corner)
{
    return k->part->positions + (size_t)k->part->indices[corner] * 3;
}

static uint32_t welded(const struct creases *k, uint32_t corner)
{
    return k->weld[k->part->indices[corner]];
}

static uint32_t next_corner(uint32_t corner)
{
    return corner % 3 == 2 ? corner - 2 : corner + 1;
}

static void make_face_normals(struct creases *k)
{
    for (uint32_t f = 0; f < k->corners / 3; f++) {
        const float *p[3] = {position(k, 3 * f), position(k, 3 * f + 1), position(k, 3 * f + 2)};
        double a[3], b[3];
        for (int c = 0; c < 3; c++) {
            a[c] = (double)p[1][c] - (double)p[0][c];
            b[c] = (double)p[2][c] - (double)p[0][c];
        }
        const double n[3] = {
            a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
        const double length = sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
        for (int c = 0; c < 3; c++)
            k->normals[(size_t)f * 3 + c] = length > 0 ? (float)(n[c] / length) : 0;
    }
}

// ---- edges -------------------------------------------------------------------------------------

static int compare_edges(const void *a, const void *b)
{
    const struct edge *x = a, *y = b;
    if (x->other != y->other)
        return x->other < y->other ? -1 : 1;
    return x->corner < y->corner ? -1 : x->corner > y->corner;
}

static void sort_edges(struct edge *edges, uint32_t count)
{
    if (count > INSERTION) {
        qsort(edges, count, sizeof *edges, compare_edges);
        return;
    }
    for (uint32_t i = 1; i < count; i++) {
        const struct edge moving = edges[i];
        uint32_t at = i;
        for (; at > 0 && compare_edges(&edges[at - 1], &moving) > 0; at--)
            edges[at] = edges[at - 1];
        edges[at] = moving;
    }
}

// A counting sort by the lower vertex.
static void file_edges(struct creases *k)
{
    for (uint32_t i = 0; i < k->corners; i++) {
        const uint32_t a = welded(k, i), b = welded(k, next_corner(i));
        k->first[(a < b ? a : b) + 1]++;
    }
    for (uint32_t v = 0; v < k->part->vertex_count; v++)
        k->first[v + 1] += k->first[v];
    for (uint32_t i = k->corners; i-- > 0;) {
        const uint32_t a = welded(k, i), b = welded(k, next_corner(i));
        const uint32_t low = a < b ? a : b;
        k->edges[--k->first[low + 1]] = (struct edge){a < b ? b : a, i};
    }
    // first[v + 1] is now where the edges of v begin
    for (uint32_t v = 0; v < k->part->vertex_count; v++) {
        const uint32_t start = k->first[v + 1];
        const uint32_t end = v + 1 < k->part->vertex_count ? k->first[v + 2] : k->corners;
        sort_edges(k->edges + start, end - start);
    }
}

static uint32_t find_root(struct creases *k, uint32_t corner)
{
    while (k->parent[corner] != corner) {
        k->parent[corner] = k->parent[k->parent[corner]];
        corner = k->parent[corner];
    }
    return corner;
}

static void join(struct creases *k, uint32_t a, uint32_t b)
{
    a = find_root(k, a);
    b = find_root(k, b);
    if (a < b)
        k->parent[b] = a;
    else
        k->parent[a] = b;
}

static bool is_smooth(const struct creases *k, uint32_t f, uint32_t g)
{
    if (k->smoothing)
        return k->smoothing[f] != 0 && k->smoothing[f] == k->smoothing[g];
    return hg_dot3(k->normals + (size_t)f * 3, k->normals + (size_t)g * 3) >= crease_cosine;
}

// Joins the corners at both ends of an edge that two triangles share.
static void join_across(struct creases *k, uint32_t i, uint32_t j)
{
    if (i / 3 == j / 3 || !is_smooth(k, i / 3, j / 3))
        return;
    const bool same_way = welded(k, i) == welded(k, j);
    join(k, i, same_way ? j : next_corner(j));
    join(k, next_corner(i), same_way ? next_corner(j) : j);
}

static void join_run(struct creases *k, const struct edge *run, uint32_t count)
{
    for (uint32_t i = 0; i < count; i++)
        for (uint32_t j = i + 1; j < count && (count <= PAIRS_OF || j == i + 1); j++)
            join_across(k, run[i].corner, run[j].corner);
}

static void find_surfaces(struct creases *k)
{
    file_edges(k);
    for (uint32_t i = 0; i < k->corners; i++)
        k->parent[i] = i;
    for (uint32_t at = 0, end; at < k->corners; at = end) {
        const uint32_t low = welded(k, k->edges[at].corner),
                       high = welded(k, next_corner(k->edges[at].corner));
        for (end = at + 1; end < k->corners; end++) {
            const uint32_t a = welded(k, k->edges[end].corner),
                           b = welded(k, next_corner(k->edges[end].corner));
            if (!((a == low && b == high) || (a == high && b == low)))
                break;
        }
        if (low != high)
            join_run(k, k->edges + at, end - at);
    }
}

// ---- vertices ----------------------------------------------------------------------------------

static float angle_at(const struct creases *k, uint32_t corner)
{
    const float *p = position(k, corner), *q = position(k, next_corner(corner)),
                *r = position(k, next_corner(next_corner(corner)));
    float a[3], b[3], n[3];
    for (int c = 0; c < 3; c++) {
        a[c] = q[c] - p[c];
        b[c] = r[c] - p[c];
    }
    hg_normalize3(a);
    hg_normalize3(b);
    hg_cross3(a, b, n);
    return atan2f(sqrtf(hg_dot3(n, n)), hg_dot3(a, b));
}

static void sum_normals(struct creases *k)
{
    for (uint32_t i = 0; i < k->corners; i++) {
        float *sum = k->sums + (size_t)find_root(k, i) * 3;
        const float *n = k->normals + (size_t)(i / 3) * 3, weight = angle_at(k, i);
        for (int c = 0; c < 3; c++)
            sum[c] += weight * n[c];
    }
}

// The first corner with this vertex and this surface.
static uint32_t first_like(struct creases *k, uint32_t corner)
{
    const uint32_t vertex = k->part->indices[corner], root = find_root(k, corner);
    uint32_t at = mix(vertex, root, 0) & (k->table_size - 1);
    for (; k->table[at]; at = (at + 1) & (k->table_size - 1)) {
        const uint32_t other = k->table[at] - 1;
        if (k->part->indices[other] == vertex && find_root(k, other) == root)
            return other;
    }
    k->table[at] = corner + 1;
    return corner;
}

static enum hg_status split_vertices(struct creases *k)
{
    uint32_t count = 0;
    for (uint32_t i = 0; i < k->corners; i++) {
        const uint32_t like = first_like(k, i);
        if (like == i) {
            k->number[i] = count;
            k->source[count++] = k->part->indices[i];
        } else {
            k->number[i] = k->number[like];
        }
    }
    float *normals = hg_spill_calloc(count, 3 * sizeof *normals);
    if (!normals)
        return HG_E_NOMEM;
    for (uint32_t i = 0; i < k->corners; i++) {
        float *n = normals + (size_t)k->number[i] * 3;
        memcpy(n, k->sums + (size_t)find_root(k, i) * 3, 3 * sizeof *n);
        if (!hg_normalize3(n)) { // no area: covers no pixel, any unit vector does
            n[0] = n[1] = 0;
            n[2] = 1;
        }
    }
    const enum hg_status status = hg_mesh_part_remap(k->part, 0, k->source, count);
    if (!status)
        memcpy(k->part->indices, k->number, k->corners * sizeof *k->number);
    k->part->normals = normals;
    return status;
}

static bool take_memory(struct creases *k)
{
    const size_t n = k->corners, v = k->part->vertex_count;
    k->table_size = table_size(k->corners);
    k->weld = hg_spill_scratch(v, sizeof *k->weld);
    k->normals = hg_spill_scratch(n, sizeof *k->normals);
    k->first = hg_spill_scratch(v + 1, sizeof *k->first);
    k->edges = hg_spill_scratch(n, sizeof *k->edges);
    k->parent = hg_spill_scratch(n, sizeof *k->parent);
    k->sums = hg_spill_scratch(n, 3 * sizeof *k->sums);
    k->table = hg_spill_scratch(k->table_size, sizeof *k->table);
    k->number = hg_spill_scratch(n, sizeof *k->number);
    k->source = hg_spill_scratch(n, sizeof *k->source);
    return k->weld && k->normals && k->first && k->edges && k->parent && k->sums && k->table &&
           k->number && k->source;
}

enum hg_status hg_part_make_crease_normals(struct hg_mesh_part *part, const uint32_t *smoothing)
{
    struct creases k = {.part = part, .smoothing = smoothing, .corners = part->index_count};
    enum hg_status status = take_memory(&k) && weld(&k) ? HG_OK : HG_E_NOMEM;
    if (!status) {
        make_face_normals(&k);
        find_surfaces(&k);
        sum_normals(&k);
        status = split_vertices(&k);
    }
    void *const arrays[] = {
        k.weld, k.normals, k.first, k.edges, k.parent, k.sums, k.table, k.number, k.source};
    for (size_t i = 0; i < sizeof arrays / sizeof *arrays; i++)
        hg_free(arrays[i]);
    return status;
}
