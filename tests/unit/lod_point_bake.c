// lod_point_bake.c - hierarchies of point clouds: every cut closes a plane, keeps to its error and
// holds the cloud's points and colours; two million points; threads; files that were damaged.
#include <float.h>
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "base/alloc.h"
#include "renderer/lod/discs.h"
#include "renderer/lod/internal.h"
#include "tests/unit/lod_points.h"

struct baked {
    uint8_t *data;
    size_t size;
    struct hg_lod_report report;
    struct hg_lod *lod;
};

static struct baked bake(const struct hg_mesh_part *part, struct hg_jobs *jobs)
{
    struct hg_error err = {0};
    struct baked b = {0};
    const struct hg_lod_params params = {.jobs = jobs};
    assert_true(hg_lod_can_bake(part, 0));
    assert_int_equal(hg_lod_bake(part, &params, &b.data, &b.size, &b.report, &err), HG_OK);
    assert_int_equal(hg_lod_open(b.data, b.size, &b.lod, &err), HG_OK);
    return b;
}

static void baked_finish(struct baked *b)
{
    hg_lod_close(b->lod);
    hg_free(b->data);
}

// The clusters of the cut at which groups with an error above the limit are refined.
static bool is_drawn(const struct hg_lod *lod, uint32_t cluster, float limit)
{
    const struct hg_lod_cluster *c = &lod->clusters[cluster];
    const bool group = lod->groups[c->group].error > limit;
    return group && !(c->made_from != HG_LOD_NONE && lod->groups[c->made_from].error > limit);
}

// Marks the cells of a grid over [-1, 1]^2 that the discs of a cut cover in the plane y = 0.
#define CELLS 64
static uint32_t cover(const struct baked *b, float limit, uint8_t *cells)
{
    const struct hg_lod *lod = b->lod;
    uint8_t *chunk = hg_calloc(HG_LOD_CHUNK_BYTES, 1);
    uint32_t discs = 0, loaded = HG_LOD_NONE;
    struct hg_lod_layout layout = {0};
    struct hg_error err;
    memset(cells, 0, CELLS * CELLS);
    for (uint32_t i = 0; i < lod->cluster_count; i++) {
        const struct hg_lod_cluster *c = &lod->clusters[i];
        const uint32_t number = lod->groups[c->group].chunk;
        uint32_t points, sides;
        if (!is_drawn(lod, i, limit))
            continue;
        if (number != loaded) {
            const struct hg_lod_chunk *k = &lod->chunks[number];
            assert_int_equal(
                hg_lod_decode(lod, number, lod->data + k->offset, k->bytes, chunk, &err), HG_OK);
            hg_lod_chunk_layout(lod, number, &layout);
            loaded = number;
        }
        assert_true(hg_lod_disc_counts(&lod->chunks[number], &points, &sides));
        discs += c->triangle_count / hg_disc_triangles(sides);
        const uint32_t *indices = (const uint32_t *)(const void *)(chunk + layout.indices);
        const float *positions = (const float *)(const void *)(chunk + layout.positions);
        for (uint32_t t = 0; t < c->triangle_count; t++) {
            const uint32_t *v = indices + c->first_index + t * 3;
            const float *p[3] = {positions + v[0] * 3, positions + v[1] * 3, positions + v[2] * 3};
            float low[3], high[3];
            for (int k = 0; k < 3; k++) {
                low[k] = fminf(p[0][k], fminf(p[1][k], p[2][k]));
                high[k] = fmaxf(p[0][k], fmaxf(p[1][k], p[2][k]));
                assert_true(low[k] >= c->center[k] - c->extent[k] - 1e-6f);
                assert_true(high[k] <= c->center[k] + c->extent[k] + 1e-6f);
            }
            for (int z = 0; z < CELLS; z++) {
                const float cz = ((float)z + 0.5f) * 2.0f / CELLS - 1.0f;
                for (int x = 0; cz >= low[2] && cz <= high[2] && x < CELLS; x++) {
                    const float cx = ((float)x + 0.5f) * 2.0f / CELLS - 1.0f;
                    bool in = cx >= low[0] && cx <= high[0];
                    for (int k = 0; in && k < 3; k++) {
                        const float *a = p[k], *q = p[(k + 1) % 3];
                        in = (q[2] - a[2]) * (cx - a[0]) - (q[0] - a[0]) * (cz - a[2]) >= -1e-9f;
                    }
                    cells[z * CELLS + x] |= in;
                }
            }
        }
    }
    hg_free(chunk);
    return discs;
}

// Cells within the plane, a little off its edge, that are not covered.
static uint32_t open_cells(const uint8_t *cells)
{
    uint32_t open = 0;
    for (int z = 4; z < CELLS - 4; z++)
        for (int x = 4; x < CELLS - 4; x++)
            open += !cells[z * CELLS + x];
    return open;
}

static void test_every_level_closes_a_plane(void **state)
{
    (void)state;
    struct hg_mesh_part part = points_plane(60000, false);
    struct baked b = bake(&part, NULL);
    static uint8_t cells[CELLS * CELLS];
    uint32_t before = UINT32_MAX;
    assert_true(b.lod->level_count >= 5);
    assert_int_equal(cover(&b, 0.0f, cells), part.index_count);
    for (float limit = 0.0f; limit < b.report.root_error * 1.1f; limit = limit * 2.0f + 0.002f) {
        const uint32_t discs = cover(&b, limit, cells);
        assert_true(discs <= before && discs > 0);
        assert_int_equal(open_cells(cells), 0);
        before = discs;
    }
    assert_in_range(cover(&b, b.report.root_error * 1.01f, cells), 1, 256);
    assert_int_equal(open_cells(cells), 0);
    baked_finish(&b);
    points_finish(&part);
}

// Errors say how far points are from the discs that stand for them: spacing times two per level.
static void test_errors(void **state)
{
    (void)state;
    struct hg_mesh_part part = points_grid(256, 1.0f / 128.0f);
    struct baked b = bake(&part, NULL);
    float largest[8] = {0};
    for (uint32_t g = 0; g < b.lod->group_count; g++) {
        const struct hg_lod_group *group = &b.lod->groups[g];
        if (group->error < FLT_MAX && group->level < 8)
            largest[group->level] = fmaxf(largest[group->level], group->error);
    }
    // Four points of a square grid are sqrt(1/2) of its step from their middle; the next four twice
    // that, so errors are less than twice those of the sum, and no less than half.
    for (uint32_t level = 0; level < 4; level++) {
        const float step = 1.0f / 128.0f, exact = 0.70711f * step * (float)((2u << level) - 1);
        assert_true(largest[level] > 0.9f * exact && largest[level] < 2.0f * exact);
    }
    baked_finish(&b);
    points_finish(&part);
}

// The same bytes on any number of threads; two million points.
static void test_two_million_points(void **state)
{
    (void)state;
    struct hg_mesh_part part = points_plane(2000000, true);
    struct hg_jobs *jobs = hg_jobs_create(2);
    struct baked b = bake(&part, jobs);
    print_message("2 million points: %.1f s, %.1f bytes a point, %u chunks, %u levels\n",
        (double)b.report.total_ns * 1e-9, (double)b.size / 2e6, b.report.chunks, b.report.levels);
    uint64_t points = 0;
    for (uint32_t i = 0; i < b.lod->cluster_count; i++)
        if (b.lod->clusters[i].made_from == HG_LOD_NONE)
            points += b.lod->clusters[i].triangle_count / hg_disc_triangles(8);
    assert_int_equal(points, 2000000);
    assert_true(b.size < 2000000ull * 20);
    baked_finish(&b);
    part.index_count = 30000;
    struct baked one = bake(&part, NULL), two = bake(&part, jobs);
    assert_int_equal(one.size, two.size);
    assert_memory_equal(one.data, two.data, one.size);
    baked_finish(&one);
    baked_finish(&two);
    hg_jobs_destroy(jobs);
    points_finish(&part);
}

// What is gathered is the same points with the same attributes in the same order: of a cloud whose
// indices are in no order, with equal coordinates on both sides of splits.
static void test_gathered_trees(void **state)
{
    (void)state;
    enum { COUNT = 1u << 20, LOOKED_AT = 64 };
    struct hg_mesh_part part = points_sphere(COUNT, true);
    struct hg_jobs *jobs = hg_jobs_create(2);
    struct hg_point_tree near = {0}, far = {0};
    struct hg_surfel a[LOOKED_AT], b[LOOKED_AT];
    uint32_t wrong = 0;
    part.colors = hg_calloc(COUNT, 16);
    assert_non_null(part.colors);
    for (uint32_t i = 0; i < COUNT; i++) {
        part.indices[i] = i * 48271u % COUNT;
        part.positions[i * 3] = roundf(part.positions[i * 3] * 16.0f) / 16.0f;
        for (uint32_t k = 0; k < 4; k++)
            part.colors[i * 4 + k] = (float)(i >> k * 5 & 31) / 31.0f;
    }
    assert_int_equal(hg_point_tree_build(&part, 1, true, jobs, &near), HG_OK);
    assert_int_equal(hg_point_tree_build(&part, 1, false, NULL, &far), HG_OK);
    assert_true(near.gathered && !far.gathered);
    for (uint32_t i = 0; i < COUNT; i++) {
        const size_t vertex = part.indices[far.items[i].number], at = near.items[i].number;
        wrong += memcmp(near.items[i].at, far.items[i].at, 12) != 0 ||
                 memcmp(near.normals + at * 3, part.normals + vertex * 3, 12) != 0 ||
                 memcmp(near.colors + at * 4, part.colors + vertex * 4, 16) != 0;
    }
    assert_int_equal(wrong, 0);
    for (uint32_t i = 0; i < COUNT; i += COUNT / 8) {
        assert_int_equal(hg_surfels_measure(&near, &part, i, LOOKED_AT, a), HG_OK);
        assert_int_equal(hg_surfels_measure(&far, &part, i, LOOKED_AT, b), HG_OK);
        assert_memory_equal(a, b, sizeof a);
    }
    hg_point_tree_finish(&near);
    hg_point_tree_finish(&far);
    hg_jobs_destroy(jobs);
    points_finish(&part);
}

static void test_sizes_are_part_of_the_key(void **state)
{
    (void)state;
    struct hg_mesh_part part = points_grid(4, 1.0f);
    uint8_t keys[3][32];
    for (int i = 0; i < 3; i++) {
        part.point_scale = i == 1 ? 2.0f : 0.0f;
        part.point_diameter = i == 2 ? 2.0f : 0.0f;
        assert_int_equal(hg_lod_key(&part, &(struct hg_lod_params){0}, keys[i]), HG_OK);
    }
    assert_memory_not_equal(keys[0], keys[1], 32);
    assert_memory_not_equal(keys[0], keys[2], 32);
    points_finish(&part);
}

// Small, empty and bad clouds.
static void test_odd_clouds(void **state)
{
    (void)state;
    struct hg_error err;
    uint8_t *data;
    size_t size;
    for (uint32_t side = 0; side < 14; side += 3) {
        struct hg_mesh_part part = points_grid(side, 0.1f);
        struct baked b = bake(&part, NULL);
        uint32_t discs = 0;
        for (uint32_t i = 0; i < b.lod->cluster_count; i++)
            discs += b.lod->clusters[i].made_from == HG_LOD_NONE
                         ? b.lod->clusters[i].triangle_count / 14
                         : 0;
        assert_int_equal(discs, side * side);
        baked_finish(&b);
        points_finish(&part);
    }
    struct hg_mesh_part part = points_grid(10, 0.1f);
    part.positions[7] = NAN;
    assert_int_equal(
        hg_lod_bake(&part, &(struct hg_lod_params){0}, &data, &size, NULL, &err), HG_E_INVAL);
    part.positions[7] = 0.0f;
    assert_int_equal(hg_lod_bake(&part, &(struct hg_lod_params){.memory_limit_bytes = 100}, &data,
                         &size, NULL, &err),
        HG_E_LIMIT);
    points_finish(&part);
}

// Whatever is changed in a chunk: an error, or a chunk of its size, and nothing beyond it.
static void test_damaged_chunks(void **state)
{
    (void)state;
    struct hg_mesh_part part = points_plane(3000, false);
    struct baked b = bake(&part, NULL);
    const struct hg_lod_file *file = (const struct hg_lod_file *)(const void *)b.lod;
    const struct hg_lod_chunk *chunk = &b.lod->chunks[b.lod->chunk_count - 1];
    struct hg_lod_layout layout;
    struct hg_error err;
    hg_lod_chunk_layout(b.lod, b.lod->chunk_count - 1, &layout);
    uint8_t *bytes = hg_calloc(chunk->bytes, 1), *out = hg_calloc(layout.total_bytes, 1);
    uint32_t refused = 0;
    for (uint32_t i = 0; i < chunk->bytes; i += 3) {
        memcpy(bytes, b.lod->data + chunk->offset, chunk->bytes);
        bytes[i] ^= (uint8_t)(1u << i % 8);
        refused +=
            hg_lod_decode_payload(&file->format, chunk, bytes, chunk->bytes, out, &err) != HG_OK;
        assert_int_not_equal(
            hg_lod_decode_payload(&file->format, chunk, bytes, i, out, &err), HG_OK);
    }
    assert_true(refused > 0);
    hg_free(bytes);
    hg_free(out);
    baked_finish(&b);
    points_finish(&part);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_every_level_closes_a_plane),
        cmocka_unit_test(test_errors),
        cmocka_unit_test(test_two_million_points),
        cmocka_unit_test(test_gathered_trees),
        cmocka_unit_test(test_sizes_are_part_of_the_key),
        cmocka_unit_test(test_odd_clouds),
        cmocka_unit_test(test_damaged_chunks),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
