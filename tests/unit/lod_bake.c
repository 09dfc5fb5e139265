// lod_bake.c - cluster hierarchies: structure, cuts without cracks, errors, attributes,
// determinism.
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include <float.h>
#include <stdlib.h>

#include "base/checked.h"
#include "renderer/lod/lod.h"
#include "renderer/lod/vertex_pack.h"
#include "tests/unit/lod_meshes.h"

struct baked {
    uint8_t *data;
    size_t size;
    struct hg_lod *lod;
    struct hg_lod_report report;
    uint8_t **chunks; // decoded
};

static void bake(const struct hg_mesh_part *part, struct hg_jobs *jobs, struct baked *b)
{
    const struct hg_lod_params params = {.jobs = jobs};
    struct hg_error err = {0};
    assert_true(hg_lod_can_bake(part, 0));
    assert_int_equal(hg_lod_bake(part, &params, &b->data, &b->size, &b->report, &err), HG_OK);
    assert_int_equal(hg_lod_open(b->data, b->size, &b->lod, &err), HG_OK);
    b->chunks = hg_calloc(b->lod->chunk_count, sizeof *b->chunks);
    assert_non_null(b->chunks);
    for (uint32_t i = 0; i < b->lod->chunk_count; i++) {
        struct hg_lod_layout layout;
        hg_lod_chunk_layout(b->lod, i, &layout);
        assert_true(layout.total_bytes <= HG_LOD_CHUNK_BYTES);
        b->chunks[i] = hg_calloc_aligned(16, layout.total_bytes);
        assert_non_null(b->chunks[i]);
        assert_int_equal(hg_lod_decode(b->lod, i, b->data + b->lod->chunks[i].offset,
                             b->lod->chunks[i].bytes, b->chunks[i], &err),
            HG_OK);
    }
}

static void finish(struct baked *b)
{
    for (uint32_t i = 0; b->lod != NULL && i < b->lod->chunk_count; i++)
        hg_free(b->chunks[i]);
    hg_free(b->chunks);
    hg_lod_close(b->lod);
    hg_free(b->data);
    memset(b, 0, sizeof *b);
}

static const float *corner(const struct baked *b, uint32_t cluster, uint32_t index)
{
    const struct hg_lod_cluster *c = &b->lod->clusters[cluster];
    const uint32_t chunk = b->lod->groups[c->group].chunk;
    struct hg_lod_layout l;
    hg_lod_chunk_layout(b->lod, chunk, &l);
    const uint32_t *indices = (const uint32_t *)(const void *)(b->chunks[chunk] + l.indices);
    const float *positions = (const float *)(const void *)(b->chunks[chunk] + l.positions);
    return positions + (size_t)indices[c->first_index + index] * 3;
}

// ---- structure ----------------------------------------------------------------------------------

static float distance(const float a[3], const float b[3])
{
    double d = 0.0;
    for (int k = 0; k < 3; k++)
        d += ((double)a[k] - b[k]) * ((double)a[k] - b[k]);
    return (float)sqrt(d);
}

static void check_cluster(const struct baked *b, uint32_t i)
{
    const struct hg_lod_cluster *c = &b->lod->clusters[i];
    const struct hg_lod_group *g = &b->lod->groups[c->group];
    assert_in_range(c->triangle_count, 1, HG_LOD_CLUSTER_TRIANGLES);
    assert_in_range(i, g->first_cluster, g->first_cluster + g->cluster_count - 1);
    for (uint32_t k = 0; k < c->triangle_count * 3; k++) {
        const float *p = corner(b, i, k);
        assert_true(distance(p, c->center) <= c->radius);
        assert_true(distance(p, g->center) <= g->radius);
        for (int a = 0; a < 3; a++)
            assert_true(fabsf(p[a] - c->center[a]) <= c->extent[a] * 1.000001f + 1e-6f);
    }
    if (c->made_from == HG_LOD_NONE)
        return;
    const struct hg_lod_group *from = &b->lod->groups[c->made_from];
    assert_true(from->error < g->error);
    assert_true(from->level < g->level);
    assert_true(distance(from->center, g->center) + from->radius <= g->radius * 1.000001f);
    bool found = false;
    for (uint32_t k = 0; k < from->parent_count; k++)
        found = found || b->lod->parents[from->first_parent + k] == c->group;
    assert_true(found);
}

// Every group is in exactly one leaf, below nodes that hold it.
static void check_node(const struct baked *b, uint32_t node, uint8_t *seen)
{
    const struct hg_lod_node *n = &b->lod->nodes[node];
    assert_in_range(n->count, 1, HG_LOD_NODE_WIDTH);
    for (uint32_t i = n->first; i < n->first + n->count; i++) {
        const float *center = n->is_leaf ? b->lod->groups[i].center : b->lod->nodes[i].center;
        const float radius = n->is_leaf ? b->lod->groups[i].radius : b->lod->nodes[i].radius;
        const float error = n->is_leaf ? b->lod->groups[i].error : b->lod->nodes[i].error;
        assert_true(distance(center, n->center) + radius <= n->radius * 1.000001f);
        assert_true(error <= n->error);
        if (n->is_leaf)
            assert_int_equal(seen[i]++, 0);
        else
            check_node(b, i, seen);
    }
}

static void check_structure(const struct baked *b)
{
    const struct hg_lod *l = b->lod;
    uint8_t *seen = hg_calloc(l->group_count, 1);
    assert_non_null(seen);
    for (uint32_t i = 0; i < l->cluster_count; i++)
        check_cluster(b, i);
    check_node(b, 0, seen);
    for (uint32_t i = 0; i < l->group_count; i++) {
        assert_int_equal(seen[i], 1);
        assert_true(l->groups[i].error < FLT_MAX || l->groups[i].chunk < l->root_chunk_count);
        assert_true((l->groups[i].error == FLT_MAX) == (l->groups[i].parent_count == 0));
        for (uint32_t k = 0; k < l->groups[i].parent_count; k++)
            assert_true(
                l->groups[l->parents[l->groups[i].first_parent + k]].chunk <= l->groups[i].chunk);
    }
    hg_free(seen);
}

// ---- cuts ---------------------------------------------------------------------------------------

struct edge {
    float a[3], b[3];
    int32_t sum; // +1 from a to b, -1 the other way
};

struct edges {
    struct edge *items;
    size_t capacity, count;
};

static int compare_edges(const void *left, const void *right)
{
    return memcmp(left, right, sizeof(float) * 6);
}

static void add_edge(struct edges *e, const float *a, const float *b)
{
    const int order = memcmp(a, b, 12);
    assert_int_equal(hg_grow(&e->items, &e->capacity, e->count + 1, sizeof *e->items), HG_OK);
    struct edge *to = &e->items[e->count++];
    memcpy(to->a, order < 0 ? a : b, 12);
    memcpy(to->b, order < 0 ? b : a, 12);
    to->sum = order < 0 ? 1 : -1;
}

// Sums edges that are the same; what is left is the oriented border of the surface.
static void border_of(struct edges *e)
{
    size_t n = 0;
    qsort(e->items, e->count, sizeof *e->items, compare_edges);
    for (size_t i = 0; i < e->count;) {
        struct edge edge = e->items[i++];
        for (; i < e->count && compare_edges(&edge, &e->items[i]) == 0; i++)
            edge.sum += e->items[i].sum;
        if (edge.sum != 0)
            e->items[n++] = edge;
    }
    e->count = n;
}

static bool use(const struct hg_lod_group *g, const float eye[3], float threshold)
{
    const float d = distance(eye, g->center) - g->radius;
    return g->error == FLT_MAX || g->error / fmaxf(d, 0.01f) > threshold;
}

static uint64_t cut(const struct baked *b, const float eye[3], float threshold, struct edges *e)
{
    uint64_t triangles = 0;
    for (uint32_t i = 0; i < b->lod->cluster_count; i++) {
        const struct hg_lod_cluster *c = &b->lod->clusters[i];
        if (!use(&b->lod->groups[c->group], eye, threshold))
            continue;
        if (c->made_from != HG_LOD_NONE && use(&b->lod->groups[c->made_from], eye, threshold))
            continue;
        triangles += c->triangle_count;
        for (uint32_t t = 0; t < c->triangle_count * 3; t += 3)
            for (uint32_t k = 0; k < 3; k++)
                add_edge(e, corner(b, i, t + k), corner(b, i, t + (k + 1) % 3));
    }
    border_of(e);
    return triangles;
}

// A border edge must lie on the border of the source: both ends are positions of it. Closed
// surfaces have no border in any cut.
static void check_cuts(const struct baked *b, int cuts, bool closed)
{
    uint32_t state = 99;
    struct edges source = {0};
    const float anywhere[3] = {0};
    const uint64_t all = cut(b, anywhere, 0.0f, &source);
    assert_int_equal(all, b->lod->source_triangles);
    if (closed)
        assert_int_equal(source.count, 0);
    uint64_t least = all;
    for (int i = 0; i < cuts; i++) {
        struct edges e = {0};
        float eye[3];
        for (int k = 0; k < 3; k++)
            eye[k] = b->lod->min[k] +
                     (2.0f * lod_random_unit(&state) - 0.5f) * (b->lod->max[k] - b->lod->min[k]);
        const float random = powf(10.0f, -4.0f + 5.0f * lod_random_unit(&state));
        const float threshold = i == 0 ? 1e30f : random; // the coarsest first
        const uint64_t n = cut(b, eye, threshold, &e);
        least = n < least ? n : least;
        if (closed)
            assert_int_equal(e.count, 0);
        for (size_t k = 0; k < e.count; k++) {
            bool a = false, c = false;
            for (size_t s = 0; s < source.count && !(a && c); s++) {
                a = a || memcmp(e.items[k].a, source.items[s].a, 12) == 0 ||
                    memcmp(e.items[k].a, source.items[s].b, 12) == 0;
                c = c || memcmp(e.items[k].b, source.items[s].a, 12) == 0 ||
                    memcmp(e.items[k].b, source.items[s].b, 12) == 0;
            }
            assert_true(a && c);
        }
        hg_free(e.items);
    }
    assert_true(least * 8 < all || all < 2048); // cuts were coarse too
    hg_free(source.items);
}

static void test_closed_with_seams(void **state)
{
    (void)state;
    struct hg_mesh_part part = lod_torus(200, 100, 2.0f);
    struct baked b = {0};
    bake(&part, NULL, &b);
    check_structure(&b);
    check_cuts(&b, 24, true);
    assert_int_equal(b.lod->source_triangles, 40000);
    finish(&b);
    lod_part_finish(&part);
}

static void test_open_terrain(void **state)
{
    (void)state;
    struct hg_mesh_part part = lod_terrain(120);
    struct baked b = {0};
    bake(&part, NULL, &b);
    check_structure(&b);
    check_cuts(&b, 24, false);
    finish(&b);
    lod_part_finish(&part);
}

static void test_flat_shaded(void **state)
{
    (void)state;
    struct hg_mesh_part part = lod_flat(100, 60);
    struct baked b = {0};
    bake(&part, NULL, &b);
    check_structure(&b);
    check_cuts(&b, 12, true);
    assert_true(b.lod->level_count > 4); // seams of normals everywhere do not stop it
    finish(&b);
    lod_part_finish(&part);
}

// Spikes many times as high as they are wide: clusters must lie side by side all the same, or each
// level would lock nearly all of the one below.
static void test_spikes(void **state)
{
    (void)state;
    struct hg_mesh_part part = lod_terrain(150);
    uint32_t random = 7;
    for (uint32_t i = 0; i < part.vertex_count; i++)
        part.positions[i * 3 + 1] = 2000.0f * lod_random_unit(&random);
    struct baked b = {0};
    bake(&part, NULL, &b);
    check_structure(&b);
    assert_true(b.lod->level_count <= 10); // from 352 clusters, half as many each time
    assert_int_equal(b.report.terminal_clusters, 1);
    finish(&b);
    lod_part_finish(&part);
}

static void test_soup(void **state)
{
    (void)state;
    struct hg_mesh_part part = lod_soup(5000);
    struct baked b = {0};
    bake(&part, NULL, &b);
    check_structure(&b);
    check_cuts(&b, 8, false);
    finish(&b);
    lod_part_finish(&part);
}

// Triangles that are there many times, whatever their first corner is, are there once; turned over
// they are others.
static void test_repeats(void **state)
{
    (void)state;
    struct hg_mesh_part part = lod_terrain(40), heap = part;
    const uint32_t count = part.index_count, copies = 7;
    heap.index_count = copies * count;
    heap.indices = hg_calloc(heap.index_count, sizeof *heap.indices);
    assert_non_null(heap.indices);
    for (uint32_t i = 0; i < copies * count; i++) {
        const uint32_t copy = i / count, at = i % count, turned = (at + copy) % 3;
        const uint32_t corner = copy % 2 == 0 ? turned : (3 - turned) % 3;
        heap.indices[i] = part.indices[at - at % 3 + corner];
    }
    struct baked b = {0};
    bake(&heap, NULL, &b);
    uint64_t finest = 0;
    for (uint32_t i = 0; i < b.lod->cluster_count; i++)
        if (b.lod->clusters[i].made_from == HG_LOD_NONE)
            finest += b.lod->clusters[i].triangle_count;
    assert_int_equal(finest, 2 * count / 3);
    check_structure(&b);
    finish(&b);
    hg_free(heap.indices);
    lod_part_finish(&part);
}

static void test_same_bytes_on_any_threads(void **state)
{
    (void)state;
    struct hg_mesh_part part = lod_torus(240, 120, 1.0f);
    struct baked one = {0};
    bake(&part, NULL, &one);
    for (unsigned threads = 1; threads <= 7; threads += 3) {
        struct hg_jobs *jobs = hg_jobs_create(threads);
        struct baked many = {0};
        assert_non_null(jobs);
        bake(&part, jobs, &many);
        assert_int_equal(many.size, one.size);
        assert_memory_equal(many.data, one.data, one.size);
        finish(&many);
        hg_jobs_destroy(jobs);
    }
    finish(&one);
    lod_part_finish(&part);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_closed_with_seams),
        cmocka_unit_test(test_open_terrain),
        cmocka_unit_test(test_flat_shaded),
        cmocka_unit_test(test_spikes),
        cmocka_unit_test(test_soup),
        cmocka_unit_test(test_repeats),
        cmocka_unit_test(test_same_bytes_on_any_threads),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
