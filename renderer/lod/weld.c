// weld.c - a part on the lattice: positions and attributes quantised, equal ones made one.
#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/alloc.h"
#include "base/checked.h"
#include "base/spill.h"
#include "renderer/lod/internal.h"
#include "renderer/lod/vertex_pack.h"

#define EDGE_SAMPLES  16384u // edges looked at to find the lattice steps
#define STEP_MAX      (FLT_MAX / (2.0f * HG_LOD_LATTICE_MAX)) // a file may have
#define EDGE_FRACTION 64.0f // a short edge is this many steps long

enum hg_status hg_lod_take(struct hg_lod_budget *budget, uint64_t count, size_t size, void *out)
{
    void **to = out;
    *to = NULL;
    uint64_t bytes, total;
    if (!hg_mul_u64(count, size, &bytes) || !hg_add_u64(budget->used, bytes, &total) ||
        (budget->limit > 0 && total > budget->limit))
        return HG_E_LIMIT;
    *to = hg_spill_scratch((size_t)count, size);
    if (*to == NULL)
        return HG_E_NOMEM;
    budget->used = total;
    budget->peak = total > budget->peak ? total : budget->peak;
    return HG_OK;
}

void hg_lod_give(struct hg_lod_budget *budget, void *ptr_to_ptr, uint64_t count, size_t size)
{
    void **at = ptr_to_ptr;
    if (*at == NULL)
        return;
    hg_free(*at);
    *at = NULL;
    budget->used -= count * size;
}

void hg_lod_format_set(struct hg_lod_format *f, uint32_t flags, bool has_uv)
{
    int32_t at = 0;
    f->flags = flags;
    const bool normals = (flags & (HG_DRAW_NORMALS | HG_DRAW_DISCS)) != 0;
    f->normal = normals ? at : -1;
    at += normals;
    f->tangent = flags & HG_DRAW_TANGENTS ? at : -1;
    at += flags & HG_DRAW_TANGENTS ? 1 : 0;
    f->uv = has_uv ? at : -1;
    at += has_uv ? 2 : 0;
    f->uv1 = flags & HG_DRAW_UV1 ? at : -1;
    at += flags & HG_DRAW_UV1 ? 2 : 0;
    f->color = flags & (HG_DRAW_COLOR8 | HG_DRAW_COLOR16) ? at : -1;
    at += flags & HG_DRAW_COLOR16 ? 2 : flags & HG_DRAW_COLOR8 ? 1 : 0;
    f->radius = flags & HG_DRAW_DISCS ? at++ : -1;
    f->words = (uint32_t)at;
    f->extra_words = (flags & HG_DRAW_UV1 ? 2u : 0u) + (flags & HG_DRAW_COLOR8 ? 1u : 0u) +
                     (flags & HG_DRAW_COLOR16 ? 2u : 0u);
}

// ---- checks -------------------------------------------------------------------------------------

static bool finite_all(const float *values, uint64_t count)
{
    uint32_t bad = 0; // no way out of the loop: several at a time
    for (uint64_t i = 0; values != NULL && i < count; i++)
        bad |= !(fabsf(values[i]) <= FLT_MAX);
    return bad == 0;
}

// Of numbers.
static float largest(const float *values, uint64_t count)
{
    float max = 0.0f;
    for (uint64_t i = 0; values != NULL && i < count; i++) {
        const float size = fabsf(values[i]);
        max = size > max ? size : max;
    }
    return max;
}

static enum hg_status check(const struct hg_mesh_part *part, struct hg_error *err)
{
    const uint64_t n = part->vertex_count;
    if (part->topology != HG_TOPOLOGY_TRIANGLES || part->joints != NULL || part->targets != NULL)
        return hg_error_set(err, HG_E_INVAL, "part", NULL,
            "only triangles without skin and morph targets have cluster hierarchies");
    if (part->index_count % 3 != 0 || (part->index_count > 0 && part->positions == NULL))
        return hg_error_set(err, HG_E_INVAL, "part", "indices", "not a list of triangles");
    if (!finite_all(part->positions, n * 3))
        return hg_error_set(err, HG_E_INVAL, "part", "positions", "a value is not finite");
    if (largest(part->positions, n * 3) > HG_LOD_FARTHEST)
        return hg_error_set(err, HG_E_LIMIT, "part", "positions", "a coordinate is beyond 1e36 m");
    if (!finite_all(part->normals, n * 3) || !finite_all(part->tangents, n * 4) ||
        !finite_all(part->uv[0], n * 2) || !finite_all(part->uv[1], n * 2) ||
        !finite_all(part->colors, n * 4))
        return hg_error_set(err, HG_E_INVAL, "part", "attributes", "a value is not finite");
    for (uint32_t i = 0; i < part->index_count; i++)
        if (part->indices[i] >= part->vertex_count)
            return hg_error_set(err, HG_E_INVAL, "part", "indices", "index %u of vertex %u of %u",
                i, part->indices[i], part->vertex_count);
    return HG_OK;
}

// ---- lattice steps ------------------------------------------------------------------------------

static int compare_floats(const void *a, const void *b)
{
    const float x = *(const float *)a, y = *(const float *)b;
    return x < y ? -1 : x > y;
}

// Length of a short edge (the tenth percentile of those with a length) of `width`-vectors; negative
// without memory.
static float short_edge(const struct hg_mesh_part *part, const float *values, int width)
{
    const uint32_t triangles = part->index_count / 3;
    float *lengths = hg_calloc(EDGE_SAMPLES + 3, sizeof *lengths);
    if (lengths == NULL)
        return -1.0f;
    const uint32_t step = triangles * 3ull > EDGE_SAMPLES ? triangles / (EDGE_SAMPLES / 3) : 1;
    uint32_t count = 0;
    for (uint64_t t = 0; t < triangles && count < EDGE_SAMPLES; t += step) {
        for (int k = 0; k < 3; k++) {
            const float *a = values + (size_t)part->indices[t * 3 + (uint64_t)k] * (size_t)width;
            const float *b =
                values + (size_t)part->indices[t * 3 + (uint64_t)(k + 1) % 3] * (size_t)width;
            double sum = 0.0;
            for (int c = 0; c < width; c++)
                sum += ((double)a[c] - b[c]) * ((double)a[c] - b[c]);
            if (sum > 0.0)
                lengths[count++] = (float)sqrt(sum);
        }
    }
    qsort(lengths, count, sizeof *lengths, compare_floats);
    const float length = count > 0 ? lengths[count / 10] : 0.0f;
    hg_free(lengths);
    return length;
}

float hg_lod_power_below(float v)
{
    int exponent;
    if (!(v >= FLT_MIN))
        return FLT_MIN;
    (void)frexpf(v, &exponent);
    return ldexpf(0.5f, exponent);
}

// Smallest power of two by which `max` stays inside the lattice.
static float power_for(float max, int32_t lattice_max)
{
    const float q = hg_lod_power_below(max / (float)lattice_max * 4.0f);
    return q;
}

static enum hg_status choose_steps(const struct hg_mesh_part *part,
    const struct hg_lod_params *params, struct hg_lod_format *format)
{
    const float least =
        power_for(largest(part->positions, part->vertex_count * 3ull), HG_LOD_LATTICE_MAX);
    const float edge = short_edge(part, part->positions, 3);
    const float wanted = params->quantum > 0.0f ? params->quantum : edge / EDGE_FRACTION;
    float uv_max = 0.0f, uv_step = 0x1p-12f;
    if (edge < 0.0f)
        return HG_E_NOMEM;
    format->quantum = fmaxf(hg_lod_power_below(fminf(wanted, STEP_MAX)), least);
    format->uv_quantum = 1.0f;
    for (int set = 0; set < 2; set++) {
        if (part->uv[set] == NULL)
            continue;
        const float uv_edge = short_edge(part, part->uv[set], 2);
        if (uv_edge < 0.0f)
            return HG_E_NOMEM;
        uv_step = uv_edge > 0.0f ? fminf(uv_step, uv_edge / EDGE_FRACTION) : uv_step;
        uv_max = fmaxf(uv_max, largest(part->uv[set], part->vertex_count * 2ull));
    }
    if (part->uv[0] != NULL || part->uv[1] != NULL)
        format->uv_quantum = fmaxf(
            hg_lod_power_below(fmaxf(uv_step, 0x1p-20f)), power_for(uv_max, HG_LOD_LATTICE_MAX));
    return HG_OK;
}

// ---- attributes ---------------------------------------------------------------------------------

static void octahedral(const float v[3], int32_t steps, int32_t out[2])
{
    const float sum = fabsf(v[0]) + fabsf(v[1]) + fabsf(v[2]);
    const float scale = sum > 0.0f ? 1.0f / sum : 0.0f;
    const float x = v[0] * scale, y = v[1] * scale;
    const float fx = v[2] >= 0.0f ? x : (1.0f - fabsf(y)) * (x < 0.0f ? -1.0f : 1.0f);
    const float fy = v[2] >= 0.0f ? y : (1.0f - fabsf(x)) * (y < 0.0f ? -1.0f : 1.0f);
    out[0] = (int32_t)lrintf(fx * (float)steps);
    out[1] = (int32_t)lrintf(fy * (float)steps);
}

uint32_t hg_lod_normal_word(const float normal[3])
{
    int32_t o[2];
    octahedral(normal, HG_LOD_NORMAL_STEPS, o);
    return ((uint32_t)o[0] & 0xffffu) | (uint32_t)o[1] << 16;
}

static uint32_t unorm(float v, float scale)
{
    return !(v > 0.0f) ? 0 : v >= 1.0f ? (uint32_t)scale : (uint32_t)(v * scale + 0.5f);
}

static void make_words(const struct hg_mesh_part *part, const struct hg_lod_format *f, size_t i,
    uint32_t words[HG_LOD_WORDS])
{
    int32_t o[2];
    if (f->normal >= 0)
        words[f->normal] = hg_lod_normal_word(part->normals + i * 3);
    if (f->tangent >= 0) {
        octahedral(part->tangents + i * 4, HG_LOD_TANGENT_STEPS, o);
        words[f->tangent] = ((uint32_t)o[0] & 0xffffu) | ((uint32_t)o[1] & 0x7fffu) << 16 |
                            (part->tangents[i * 4 + 3] < 0.0f ? 0x80000000u : 0u);
    }
    const int32_t at[2] = {f->uv, f->uv1};
    for (int set = 0; set < 2; set++)
        for (int k = 0; at[set] >= 0 && k < 2; k++)
            words[at[set] + k] =
                (uint32_t)(int32_t)lrintf(part->uv[set][i * 2 + (size_t)k] / f->uv_quantum);
    const float *c = f->color >= 0 ? part->colors + i * 4 : NULL;
    if (c != NULL && f->flags & HG_DRAW_COLOR8) {
        words[f->color] = unorm(c[0], 255.0f) | unorm(c[1], 255.0f) << 8 |
                          unorm(c[2], 255.0f) << 16 | unorm(c[3], 255.0f) << 24;
    } else if (c != NULL) {
        words[f->color] = unorm(c[0], 65535.0f) | unorm(c[1], 65535.0f) << 16;
        words[f->color + 1] = unorm(c[2], 65535.0f) | unorm(c[3], 65535.0f) << 16;
    }
}

static inline void octahedral_decode(int32_t x, int32_t y, float steps, float v[3])
{
    v[0] = (float)x * (1.0f / steps);
    v[1] = (float)y * (1.0f / steps);
    v[2] = 1.0f - fabsf(v[0]) - fabsf(v[1]);
    const float fold = v[2] < 0.0f ? -v[2] : 0.0f;
    v[0] += v[0] >= 0.0f ? -fold : fold;
    v[1] += v[1] >= 0.0f ? -fold : fold;
    const float inverse = 1.0f / sqrtf(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
    for (int i = 0; i < 3; i++)
        v[i] *= inverse;
}

uint32_t hg_lod_attributes(
    const struct hg_lod_format *f, const uint32_t *words, float out[HG_LOD_ATTRIBUTES])
{
    uint32_t n = 0;
    if (f->normal >= 0) {
        const uint32_t w = words[f->normal];
        octahedral_decode((int16_t)w, (int16_t)(w >> 16), HG_LOD_NORMAL_STEPS, out);
        n += 3;
    }
    const int32_t at[2] = {f->uv, f->uv1};
    for (int set = 0; set < 2; set++)
        for (int k = 0; at[set] >= 0 && k < 2; k++)
            out[n++] = (float)(int32_t)words[at[set] + k] * f->uv_quantum;
    if (f->color >= 0 && f->flags & HG_DRAW_COLOR8)
        for (int k = 0; k < 4; k++)
            out[n++] = (float)(words[f->color] >> (8 * k) & 0xffu) / 255.0f;
    else if (f->color >= 0)
        for (int k = 0; k < 4; k++)
            out[n++] = (float)(words[f->color + k / 2] >> (16 * (k & 1)) & 0xffffu) / 65535.0f;
    return n;
}

// ---- welding ------------------------------------------------------------------------------------

static uint32_t hash3(uint32_t a, uint32_t b, uint32_t c)
{
    uint64_t h = ((uint64_t)a << 32 | b) * 0x9e3779b97f4a7c15ull;
    h = (h ^ h >> 29 ^ c) * 0xbf58476d1ce4e5b9ull;
    return (uint32_t)(h >> 32);
}

#define LOOKS_MAX  64u // vertices at one position that a new one is compared with: the latest
#define AHEAD      12u // triangles from one that is asked for to when it is looked at
#define INDEX_MASK 0x3fffffffu // of a vertex or position, + 1
#define PROBES_MAX 8u          // slots in a row that a triangle is looked for in

struct welder {
    const struct hg_mesh_part *part;
    struct hg_lod_mesh *mesh;
    uint32_t *positions; // hash table of index + 1 and two bits of the hash above it
    uint32_t mask;
    uint32_t *first, *next; // the latest vertex at each position + 1; the one before each vertex
};

static void lattice_of(const struct welder *w, uint32_t index, int32_t p[3])
{
    const float steps = 1.0f / w->mesh->format.quantum; // exact: a power of two
    for (int k = 0; k < 3; k++)
        p[k] = (int32_t)lrintf(w->part->positions[(size_t)index * 3 + (size_t)k] * steps);
}

static uint32_t position_hash(const int32_t p[3])
{
    return hash3((uint32_t)p[0], (uint32_t)p[1], (uint32_t)p[2]);
}

// Others in the way lie anywhere in the lattice; two bits tell three out of four of them.
static uint32_t weld_position(struct welder *w, const int32_t p[3])
{
    struct hg_lod_mesh *m = w->mesh;
    const uint32_t hash = position_hash(p), tag = hash & ~INDEX_MASK;
    uint32_t slot = hash & w->mask;
    for (; w->positions[slot] != 0; slot = (slot + 1) & w->mask) {
        const uint32_t other = (w->positions[slot] & INDEX_MASK) - 1;
        if ((w->positions[slot] & ~INDEX_MASK) == tag &&
            memcmp(m->lattice[other], p, sizeof m->lattice[0]) == 0)
            return other;
    }
    memcpy(m->lattice[m->position_count], p, sizeof m->lattice[0]);
    w->positions[slot] = ++m->position_count | tag;
    return m->position_count - 1;
}

static uint32_t weld_vertex(struct welder *w, uint32_t position, const uint32_t *words)
{
    struct hg_lod_mesh *m = w->mesh;
    const uint32_t n = m->format.words;
    uint32_t link = w->first[position];
    for (uint32_t i = 0; i < LOOKS_MAX && link != 0; i++, link = w->next[link - 1])
        if (memcmp(m->words + (size_t)(link - 1) * n, words, n * 4) == 0)
            return link - 1;
    const uint32_t v = m->vertex_count++;
    m->position_of[v] = position;
    memcpy(m->words + (size_t)v * n, words, n * 4);
    w->next[v] = w->first[position];
    w->first[position] = v + 1;
    return v;
}

static uint32_t weld_one(struct welder *w, uint32_t index)
{
    const struct hg_lod_format *f = &w->mesh->format;
    uint32_t words[HG_LOD_WORDS + 1] = {0};
    int32_t p[3];
    lattice_of(w, index, p);
    make_words(w->part, f, index, words);
    return weld_vertex(w, weld_position(w, p), words);
}

// Slots of the table lie anywhere: those of a triangle that comes soon are fetched already.
HG_LOD_INLINE void expect(const struct welder *w, const uint32_t *remap, const uint32_t *triangle)
{
    for (int k = 0; k < 3; k++) {
        int32_t p[3];
        if (remap[triangle[k]] != 0)
            continue;
        lattice_of(w, triangle[k], p);
        hg_lod_expect(&w->positions[position_hash(p) & w->mask]);
    }
}

// Welds the vertices that triangles use and copies the triangles that have an area of their own.
static void weld_triangles(struct welder *w, uint32_t *remap)
{
    struct hg_lod_mesh *m = w->mesh;
    const size_t count = w->part->index_count / 3;
    for (size_t t = 0; t < count; t++) {
        uint32_t v[3];
        if (t + AHEAD < count)
            expect(w, remap, w->part->indices + (t + AHEAD) * 3);
        for (size_t k = 0; k < 3; k++) {
            const uint32_t i = w->part->indices[t * 3 + k];
            if (remap[i] == 0)
                remap[i] = weld_one(w, i) + 1;
            v[k] = remap[i] - 1;
        }
        const uint32_t a = m->position_of[v[0]], b = m->position_of[v[1]], c = m->position_of[v[2]];
        if (a != b && b != c && a != c)
            memcpy(m->triangles + (size_t)m->triangle_count++ * 3, v, sizeof v);
    }
}

static uint32_t table_size(uint32_t count)
{
    uint32_t size = 16;
    while (size < count + count / 2 && size < 0x80000000u)
        size *= 2;
    return size;
}

// The least vertex first.
static void turn(const uint32_t from[3], uint32_t out[3])
{
    const uint32_t k =
        from[0] < from[1] ? (from[0] < from[2] ? 0 : 2) : (from[1] < from[2] ? 1 : 2);
    out[0] = from[k];
    out[1] = from[k == 2 ? 0 : k + 1];
    out[2] = from[k == 0 ? 2 : k - 1];
}

static bool is_at(const struct hg_lod_mesh *m, uint32_t triangle, const uint32_t turned[3])
{
    uint32_t other[3];
    turn(m->triangles + (size_t)triangle * 3, other);
    return memcmp(other, turned, sizeof other) == 0;
}

// Where a triangle is in the table, or the free slot for it: near the place of its least vertex,
// where those before it have just been looked for; when that is crowded, anywhere, some slots at a
// time, as long runs may be full. per_vertex: slots, times 2^32.
static uint32_t repeat_slot(const struct hg_lod_mesh *m, const uint32_t *table, uint32_t size,
    uint64_t per_vertex, const uint32_t v[3])
{
    uint32_t slot = (uint32_t)(v[0] * per_vertex >> 32);
    for (uint32_t i = 1; table[slot] != 0 && !is_at(m, table[slot] - 1, v); i++) {
        if (i % PROBES_MAX == 0)
            slot = hash3(v[0], v[1], v[2] + i);
        slot = (slot + 1) & (size - 1);
    }
    return slot;
}

// Of triangles with the same vertices the first stays: a heap of them in one place looks like one,
// but no tree would keep a ray from meeting all. Turned over they are others.
static enum hg_status drop_repeats(struct hg_lod_mesh *m, struct hg_lod_budget *budget)
{
    const uint32_t size = table_size(m->triangle_count);
    const uint64_t per_vertex = ((uint64_t)size << 32) / (m->vertex_count + 1ull);
    uint32_t *table = NULL, kept = 0; // index + 1
    const enum hg_status status = hg_lod_take(budget, size, 4, &table);
    for (uint32_t t = 0; status == HG_OK && t < m->triangle_count; t++) {
        uint32_t v[3];
        turn(m->triangles + (size_t)t * 3, v);
        const uint32_t slot = repeat_slot(m, table, size, per_vertex, v);
        if (table[slot] != 0)
            continue;
        memmove(m->triangles + (size_t)kept * 3, m->triangles + (size_t)t * 3, sizeof v);
        table[slot] = ++kept;
    }
    if (status == HG_OK)
        m->triangle_count = kept;
    hg_lod_give(budget, &table, size, 4);
    return status;
}

enum hg_status hg_lod_weld(const struct hg_mesh_part *part, const struct hg_lod_params *params,
    struct hg_lod_budget *budget, struct hg_lod_mesh *out, struct hg_error *err)
{
    memset(out, 0, sizeof *out);
    struct hg_pack_layout layout;
    enum hg_status status = check(part, err);
    if (status == HG_OK && (part->index_count / 3 >= 1u << 30 || part->vertex_count >= 1u << 30))
        status = hg_error_set(err, HG_E_LIMIT, "part", NULL, "more than 2^30 triangles");
    if (status == HG_OK)
        status = hg_pack_layout_of(part, 0, &layout);
    if (status != HG_OK)
        return status;
    const uint32_t n = part->vertex_count, size = table_size(n);
    struct welder w = {.part = part, .mesh = out, .mask = size - 1};
    uint32_t *remap = NULL;
    hg_lod_format_set(
        &out->format, layout.flags & ~(HG_DRAW_LINES | HG_DRAW_POINTS), part->uv[0] != NULL);
    const uint64_t word_count = (uint64_t)n * out->format.words;
    if ((status = choose_steps(part, params, &out->format)) != HG_OK ||
        (status = hg_lod_take(budget, size, 4, &w.positions)) != HG_OK ||
        (status = hg_lod_take(budget, n, 4, &w.first)) != HG_OK ||
        (status = hg_lod_take(budget, n, 4, &w.next)) != HG_OK ||
        (status = hg_lod_take(budget, n, 4, &remap)) != HG_OK ||
        (status = hg_lod_take(budget, n, sizeof *out->lattice, &out->lattice)) != HG_OK ||
        (status = hg_lod_take(budget, n, 4, &out->position_of)) != HG_OK ||
        (status = hg_lod_take(budget, word_count, 4, &out->words)) != HG_OK ||
        (status = hg_lod_take(budget, part->index_count, 4, &out->triangles)) != HG_OK)
        (void)hg_error_set(err, status, "part", NULL, "no memory to weld %u vertices", n);
    out->room[0] = out->room[1] = out->room[2] = n;
    out->room[3] = part->index_count;
    if (status == HG_OK)
        weld_triangles(&w, remap);
    if (status == HG_OK && (status = drop_repeats(out, budget)) != HG_OK)
        (void)hg_error_set(err, status, "part", NULL, "no memory to find repeated triangles");
    hg_lod_give(budget, &w.positions, size, 4);
    hg_lod_give(budget, &w.first, n, 4);
    hg_lod_give(budget, &w.next, n, 4);
    hg_lod_give(budget, &remap, n, 4);
    if (status != HG_OK)
        hg_lod_mesh_finish(out, budget);
    return status;
}

// ---- order --------------------------------------------------------------------------------------

// Numbers by first use: of vertices to vertex[], of positions to position[], both 0 at first.
static void number_by_use(
    const struct hg_lod_mesh *m, uint32_t *vertex, uint32_t *position, uint32_t counts[2])
{
    counts[0] = counts[1] = 0;
    for (size_t i = 0; i < (size_t)m->triangle_count * 3; i++) {
        const uint32_t v = m->triangles[i], p = m->position_of[v];
        if (vertex[v] == 0)
            vertex[v] = ++counts[1];
        if (position[p] == 0)
            position[p] = ++counts[0];
    }
}

// Moves `count` elements of `size` bytes to their new numbers, 1..kept; `room`: the old memory's.
static enum hg_status move(struct hg_lod_budget *budget, void *array_ptr, uint64_t *room,
    const uint32_t *number, const uint32_t counts[2], size_t size)
{
    uint8_t *from, *to = NULL;
    memcpy(&from, array_ptr, sizeof from);
    const enum hg_status status = hg_lod_take(budget, counts[1], size, &to);
    if (status != HG_OK)
        return status;
    for (size_t i = 0; i < counts[0]; i++)
        if (number[i] > 0)
            memcpy(to + (number[i] - 1) * size, from + i * size, size);
    hg_lod_give(budget, &from, *room, size);
    memcpy(array_ptr, &to, sizeof to);
    *room = counts[1];
    return HG_OK;
}

enum hg_status hg_lod_mesh_reorder(struct hg_lod_mesh *m, struct hg_lod_budget *budget)
{
    const uint64_t positions = m->position_count, vertices = m->vertex_count;
    uint32_t *number = NULL, counts[2];
    enum hg_status status = hg_lod_take(budget, positions + vertices, 4, &number);
    if (status != HG_OK)
        return status;
    uint32_t *vertex = number, *position = number + vertices;
    number_by_use(m, vertex, position, counts);
    for (size_t i = 0; i < (size_t)m->triangle_count * 3; i++)
        m->triangles[i] = vertex[m->triangles[i]] - 1;
    for (size_t v = 0; v < vertices; v++)
        m->position_of[v] = vertex[v] > 0 ? position[m->position_of[v]] - 1 : 0;
    const uint32_t p[2] = {m->position_count, counts[0]}, v[2] = {m->vertex_count, counts[1]};
    status = move(budget, &m->lattice, &m->room[0], position, p, sizeof *m->lattice);
    if (status == HG_OK)
        status = move(budget, &m->position_of, &m->room[1], vertex, v, 4);
    if (status == HG_OK)
        status = move(budget, &m->words, &m->room[2], vertex, v, 4 * (size_t)m->format.words);
    m->position_count = counts[0];
    m->vertex_count = counts[1];
    hg_lod_give(budget, &number, positions + vertices, 4);
    return status;
}

void hg_lod_mesh_finish(struct hg_lod_mesh *m, struct hg_lod_budget *budget)
{
    hg_lod_give(budget, &m->lattice, m->room[0], sizeof *m->lattice);
    hg_lod_give(budget, &m->position_of, m->room[1], 4);
    hg_lod_give(budget, &m->words, m->room[2] * m->format.words, 4);
    hg_lod_give(budget, &m->triangles, m->room[3], 4);
    hg_lod_give(budget, &m->piece_of, m->position_count, 4);
    hg_lod_give(budget, &m->pieces, m->piece_count, sizeof *m->pieces);
    memset(m, 0, sizeof *m);
}
