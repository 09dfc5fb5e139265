// lod_file.c - the cluster file: what goes in comes out, damage is refused, odd meshes are
// survived.
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include <float.h>

#include "renderer/lod/lod.h"
#include "renderer/lod/vertex_pack.h"
#include "tests/unit/lod_meshes.h"

static enum hg_status try_bake(const struct hg_mesh_part *part, const struct hg_lod_params *params,
    uint8_t **data, size_t *size)
{
    struct hg_lod_report report;
    struct hg_error err = {0};
    const enum hg_status status = hg_lod_bake(part, params, data, size, &report, &err);
    if (status != HG_OK) {
        assert_null(*data);
        assert_int_equal(*size, 0);
        assert_int_equal(err.status, status);
        assert_true(strlen(err.reason) > 0);
    }
    return status;
}

static struct hg_lod *bake_and_open(const struct hg_mesh_part *part, uint8_t **data, size_t *size)
{
    const struct hg_lod_params params = {0};
    struct hg_lod *lod = NULL;
    struct hg_error err = {0};
    assert_int_equal(try_bake(part, &params, data, size), HG_OK);
    assert_int_equal(hg_lod_open(*data, *size, &lod, &err), HG_OK);
    return lod;
}

// Opens and decodes everything; the worst status of all.
static enum hg_status read_all(const uint8_t *data, size_t size)
{
    struct hg_lod *lod = NULL;
    struct hg_error err = {0};
    enum hg_status status = hg_lod_open(data, size, &lod, &err);
    if (status != HG_OK) {
        assert_null(lod);
        assert_int_equal(err.status, status);
        return status;
    }
    for (uint32_t i = 0; status == HG_OK && i < lod->chunk_count; i++) {
        struct hg_lod_layout layout;
        hg_lod_chunk_layout(lod, i, &layout);
        uint8_t *dst = hg_calloc_aligned(16, layout.total_bytes);
        assert_non_null(dst);
        status =
            hg_lod_decode(lod, i, data + lod->chunks[i].offset, lod->chunks[i].bytes, dst, &err);
        hg_free(dst);
    }
    hg_lod_close(lod);
    return status;
}

// ---- content
// -------------------------------------------------------------------------------------

static void check_vertex(const struct hg_mesh_part *part, uint32_t source, const float *position,
    const struct hg_gpu_vertex *vertex, float quantum)
{
    float n[3], t[4];
    for (int k = 0; k < 3; k++)
        assert_true(fabsf(position[k] - part->positions[source * 3 + (uint32_t)k]) <= quantum);
    hg_unpack_normal(vertex->normal, n);
    const float *m = part->normals + (size_t)source * 3;
    const float length = sqrtf(m[0] * m[0] + m[1] * m[1] + m[2] * m[2]);
    assert_true((n[0] * m[0] + n[1] * m[1] + n[2] * m[2]) / length > 0.99999f); // 0.25 degrees
    assert_true(fabsf(vertex->uv.x - part->uv[0][source * 2]) <= 0.00025f);
    assert_true(fabsf(vertex->uv.y - part->uv[0][source * 2 + 1]) <= 0.00025f);
    if (part->tangents == NULL)
        return;
    const float *u = part->tangents + (size_t)source * 4;
    hg_unpack_tangent(vertex->tangent, t);
    assert_true(t[0] * u[0] + t[1] * u[1] + t[2] * u[2] > 0.9999f); // 0.8 degrees
    assert_true(t[3] == u[3]);
}

// Level 0 holds the vertices of the source: every decoded one has its origin.
static void test_level_0_is_the_source(void **state)
{
    (void)state;
    struct hg_mesh_part part = lod_torus(60, 30, 1.5f);
    for (uint32_t i = 0; i < part.vertex_count; i += 3)
        part.tangents[i * 4 + 3] = -1.0f;
    uint8_t *data, *slot = hg_calloc_aligned(16, HG_LOD_CHUNK_BYTES);
    size_t size;
    struct hg_lod *lod = bake_and_open(&part, &data, &size);
    struct hg_error err = {0};
    uint32_t found = 0;
    assert_int_equal(lod->flags, HG_DRAW_NORMALS | HG_DRAW_TANGENTS);
    assert_non_null(slot);
    for (uint32_t i = 0; i < lod->chunk_count; i++) {
        const struct hg_lod_chunk *c = &lod->chunks[i];
        struct hg_lod_layout l;
        hg_lod_chunk_layout(lod, i, &l);
        assert_int_equal(hg_lod_decode(lod, i, data + c->offset, c->bytes, slot, &err), HG_OK);
        const float *positions = (const float *)(const void *)(slot + l.positions);
        const struct hg_gpu_vertex *vertices =
            (const struct hg_gpu_vertex *)(const void *)(slot + l.vertices);
        for (uint32_t v = 0; v < c->vertex_count; v++) {
            uint32_t best = 0;
            float least = INFINITY;
            for (uint32_t s = 0; s < part.vertex_count; s++) {
                float d = 0.0f;
                for (uint32_t k = 0; k < 3; k++)
                    d += fabsf(positions[v * 3 + k] - part.positions[s * 3 + k]);
                for (uint32_t k = 0; k < 2; k++)
                    d += fabsf((&vertices[v].uv.x)[k] - part.uv[0][s * 2 + k]);
                best = d < least ? s : best;
                least = d < least ? d : least;
            }
            check_vertex(&part, best, positions + (size_t)v * 3, &vertices[v], lod->quantum);
            found++;
        }
    }
    assert_true(found > part.vertex_count);
    hg_free(slot);
    hg_lod_close(lod);
    hg_free(data);
    lod_part_finish(&part);
}

static void test_extra_stream(void **state)
{
    (void)state;
    struct hg_mesh_part part = lod_soup(40);
    uint8_t *data, *slot = hg_calloc_aligned(16, HG_LOD_CHUNK_BYTES);
    size_t size;
    struct hg_error err = {0};
    struct hg_lod *lod = bake_and_open(&part, &data, &size);
    assert_non_null(slot);
    assert_int_equal(lod->flags, HG_DRAW_NORMALS | HG_DRAW_UV1 | HG_DRAW_COLOR16);
    assert_int_equal(lod->extra_words, 4);
    const uint32_t last = lod->chunk_count - 1; // level 0
    struct hg_lod_layout l;
    hg_lod_chunk_layout(lod, last, &l);
    assert_int_equal(hg_lod_decode(lod, last, data + lod->chunks[last].offset,
                         lod->chunks[last].bytes, slot, &err),
        HG_OK);
    const float *positions = (const float *)(const void *)(slot + l.positions);
    for (uint32_t v = 0; v < lod->chunks[last].vertex_count; v++) {
        const uint8_t *extra = slot + l.extra + (size_t)v * 16;
        float uv[2];
        uint16_t color[4];
        memcpy(uv, extra, 8);
        memcpy(color, extra + 8, 8);
        uint32_t matches = 0;
        for (uint32_t s = 0; s < part.vertex_count; s++) {
            bool same = true;
            for (uint32_t k = 0; k < 3; k++)
                same = same && fabsf(positions[v * 3 + k] - part.positions[s * 3 + k]) < 0.02f;
            for (uint32_t k = 0; k < 2; k++)
                same = same && fabsf(uv[k] - part.uv[1][s * 2 + k]) < 0.001f;
            for (uint32_t k = 0; k < 4; k++)
                same = same && fabsf((float)color[k] / 65535.0f - part.colors[s * 4 + k]) < 1e-4f;
            matches += same;
        }
        assert_int_equal(matches, 1);
    }
    hg_free(slot);
    hg_lod_close(lod);
    hg_free(data);
    lod_part_finish(&part);
}

// ---- damage
// --------------------------------------------------------------------------------------

static void test_every_truncation(void **state)
{
    (void)state;
    struct hg_mesh_part part = lod_torus(24, 12, 1.0f);
    uint8_t *data;
    size_t size;
    hg_lod_close(bake_and_open(&part, &data, &size));
    for (size_t n = 0; n < size; n++) {
        uint8_t *exact = malloc(n + (n == 0)); // so that reading past it is seen
        assert_non_null(exact);
        memcpy(exact, data, n);
        assert_int_not_equal(read_all(exact, n), HG_OK);
        free(exact);
    }
    uint8_t *longer = malloc(size + 1);
    assert_non_null(longer);
    memcpy(longer, data, size);
    longer[size] = 0;
    assert_int_equal(read_all(longer, size + 1), HG_E_FORMAT);
    free(longer);
    assert_int_equal(read_all(data, size), HG_OK);
    hg_free(data);
    lod_part_finish(&part);
}

static void test_every_flipped_bit(void **state)
{
    (void)state;
    struct hg_mesh_part part = lod_torus(16, 8, 1.0f);
    uint8_t *data;
    size_t size;
    hg_lod_close(bake_and_open(&part, &data, &size));
    for (size_t bit = 0; bit < size * 8; bit++) {
        data[bit / 8] ^= (uint8_t)(1u << bit % 8);
        assert_int_not_equal(read_all(data, size), HG_OK);
        data[bit / 8] ^= (uint8_t)(1u << bit % 8);
    }
    hg_free(data);
    lod_part_finish(&part);
}

static void test_wrong_chunk_bytes(void **state)
{
    (void)state;
    struct hg_mesh_part part = lod_torus(60, 40, 1.0f);
    uint8_t *data, *slot = hg_calloc_aligned(16, HG_LOD_CHUNK_BYTES);
    size_t size;
    struct hg_error err = {0};
    struct hg_lod *lod = bake_and_open(&part, &data, &size);
    assert_non_null(slot);
    assert_true(lod->chunk_count > 1);
    const struct hg_lod_chunk *a = &lod->chunks[0], *b = &lod->chunks[1];
    assert_int_equal(
        hg_lod_decode(lod, 0, data + a->offset, a->bytes - 1, slot, &err), HG_E_TRUNCATED);
    assert_int_not_equal(hg_lod_decode(lod, 0, data + b->offset, b->bytes, slot, &err), HG_OK);
    hg_free(slot);
    hg_lod_close(lod);
    hg_free(data);
    lod_part_finish(&part);
}

// ---- odd meshes
// ----------------------------------------------------------------------------------

// Triangles as given; normals all +Z.
static struct hg_mesh_part plain(
    const float *positions, uint32_t vertices, const uint32_t *indices, uint32_t index_count)
{
    struct hg_mesh_part p = lod_part(vertices, index_count);
    memcpy(p.positions, positions, vertices * 12ull);
    memcpy(p.indices, indices, index_count * 4ull);
    for (uint32_t i = 0; i < vertices; i++)
        p.normals[i * 3 + 2] = 1.0f;
    return p;
}

static uint64_t triangles_of(struct hg_mesh_part *part)
{
    uint8_t *data;
    size_t size;
    struct hg_lod *lod = bake_and_open(part, &data, &size);
    assert_int_equal(read_all(data, size), HG_OK);
    const uint64_t n = lod->source_triangles;
    assert_int_equal(lod->root_chunk_count > 0, n > 0);
    assert_int_equal(lod->node_count > 0, n > 0);
    hg_lod_close(lod);
    hg_free(data);
    lod_part_finish(part);
    return n;
}

static void test_few_triangles(void **state)
{
    (void)state;
    const float quad[12] = {0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0};
    const uint32_t one[3] = {0, 1, 2}, two[6] = {0, 1, 2, 0, 2, 3};
    const uint32_t none[6] = {0, 0, 1, 2, 3, 3}; // no area
    struct hg_mesh_part part = plain(quad, 4, one, 0);
    assert_int_equal(triangles_of(&part), 0);
    part = plain(quad, 4, one, 3);
    assert_int_equal(triangles_of(&part), 1);
    part = plain(quad, 4, two, 6);
    assert_int_equal(triangles_of(&part), 2);
    part = plain(quad, 4, none, 6);
    assert_int_equal(triangles_of(&part), 0);
}

static void test_fans_and_copies(void **state)
{
    (void)state;
    // A book of 300 pages on one spine, every page three times: once is enough.
    float positions[302 * 3] = {0};
    uint32_t indices[300 * 9];
    positions[5] = 1.0f;
    for (uint32_t i = 0; i < 300; i++) {
        positions[(i + 2) * 3] = cosf((float)i * 0.02f);
        positions[(i + 2) * 3 + 1] = sinf((float)i * 0.02f);
        for (uint32_t c = 0; c < 3; c++)
            memcpy(indices + i * 9 + c * 3, (uint32_t[3]){0, 1, i + 2}, 12);
    }
    struct hg_mesh_part part = plain(positions, 302, indices, 300 * 9);
    assert_int_equal(triangles_of(&part), 300);
    // The same triangle two thousand times.
    struct hg_mesh_part copies = lod_part(3, 6000);
    copies.positions[3] = copies.positions[7] = 1.0f;
    copies.normals[2] = copies.normals[5] = copies.normals[8] = 1.0f;
    for (uint32_t i = 0; i < 6000; i++)
        copies.indices[i] = i % 3;
    assert_int_equal(triangles_of(&copies), 1);
    // All vertices in one point, and on one line.
    struct hg_mesh_part point = lod_terrain(20);
    memset(point.positions, 0, point.vertex_count * 12ull);
    assert_int_equal(triangles_of(&point), 0);
    struct hg_mesh_part line = lod_terrain(20);
    for (uint32_t i = 0; i < line.vertex_count; i++)
        line.positions[i * 3 + 1] = line.positions[i * 3 + 2] = 0.0f;
    assert_true(triangles_of(&line) < 800);
}

static void test_huge_and_tiny(void **state)
{
    (void)state;
    const float scales[] = {1e-30f, 1e-12f, 1e12f, 4e35f};
    for (size_t s = 0; s < sizeof scales / sizeof *scales; s++) {
        struct hg_mesh_part part = lod_torus(40, 20, scales[s]);
        assert_true(triangles_of(&part) == 1600);
    }
    // A metre of detail a thousand kilometres out: what floats can tell apart stays apart.
    struct hg_mesh_part far = lod_terrain(40);
    for (uint32_t i = 0; i < far.vertex_count; i++)
        far.positions[i * 3] += 1e6f;
    assert_int_equal(triangles_of(&far), 3200);
}

static void test_refused(void **state)
{
    (void)state;
    const struct hg_lod_params params = {0};
    uint8_t *data;
    size_t size;
    float *arrays[4];
    for (int i = 0; i < 6; i++) {
        struct hg_mesh_part part = lod_torus(10, 5, 1.0f);
        arrays[0] = part.positions;
        arrays[1] = part.normals;
        arrays[2] = part.tangents;
        arrays[3] = part.uv[0];
        if (i < 4)
            arrays[i][17] = i & 1 ? NAN : INFINITY;
        else if (i == 4)
            part.indices[9] = part.vertex_count;
        else
            part.topology = HG_TOPOLOGY_LINES;
        assert_int_equal(try_bake(&part, &params, &data, &size), HG_E_INVAL);
        lod_part_finish(&part);
    }
}

static bool stop_at_half(void *user, uint64_t done, uint64_t total)
{
    uint64_t *last = user;
    assert_true(done >= *last && done <= total);
    *last = done;
    return done * 2 < total;
}

static void test_limit_and_cancel(void **state)
{
    (void)state;
    struct hg_mesh_part part = lod_terrain(100);
    uint64_t last = 0;
    uint8_t *data;
    size_t size;
    struct hg_lod_params params = {.progress = stop_at_half, .progress_user = &last};
    assert_int_equal(try_bake(&part, &params, &data, &size), HG_E_CANCELLED);
    assert_true(last > 0);
    params = (struct hg_lod_params){.memory_limit_bytes = 200000};
    assert_int_equal(try_bake(&part, &params, &data, &size), HG_E_LIMIT);
    lod_part_finish(&part);
}

static void test_no_memory(void **state)
{
    (void)state;
    struct hg_mesh_part part = lod_torus(30, 12, 1.0f);
    const struct hg_lod_params params = {0};
    uint8_t *data;
    size_t size;
    enum hg_status status = HG_E_NOMEM;
    uint64_t n = 1;
    for (; status != HG_OK && n < 100000; n++) {
        hg_alloc_fail_at(n);
        status = try_bake(&part, &params, &data, &size);
        hg_alloc_fail_at(0);
        if (status != HG_OK)
            assert_int_equal(status, HG_E_NOMEM);
    }
    assert_true(n > 50);
    status = HG_E_NOMEM;
    for (n = 1; status != HG_OK; n++) {
        struct hg_lod *lod = NULL;
        struct hg_error err = {0};
        hg_alloc_fail_at(n);
        status = hg_lod_open(data, size, &lod, &err);
        hg_alloc_fail_at(0);
        if (status != HG_OK)
            assert_int_equal(status, HG_E_NOMEM);
        hg_lod_close(lod);
    }
    hg_free(data);
    lod_part_finish(&part);
}

static void test_key(void **state)
{
    (void)state;
    struct hg_mesh_part part = lod_torus(10, 5, 1.0f);
    struct hg_lod_params params = {0};
    uint8_t a[32], b[32];
    assert_int_equal(hg_lod_key(&part, &params, a), HG_OK);
    assert_int_equal(hg_lod_key(&part, &params, b), HG_OK);
    assert_memory_equal(a, b, 32);
    params.quantum = 0.5f;
    assert_int_equal(hg_lod_key(&part, &params, b), HG_OK);
    assert_memory_not_equal(a, b, 32);
    params.quantum = 0.0f;
    part.uv[0][3] += 0.25f;
    assert_int_equal(hg_lod_key(&part, &params, b), HG_OK);
    assert_memory_not_equal(a, b, 32);
    lod_part_finish(&part);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_level_0_is_the_source),
        cmocka_unit_test(test_extra_stream),
        cmocka_unit_test(test_every_truncation),
        cmocka_unit_test(test_every_flipped_bit),
        cmocka_unit_test(test_wrong_chunk_bytes),
        cmocka_unit_test(test_few_triangles),
        cmocka_unit_test(test_fans_and_copies),
        cmocka_unit_test(test_huge_and_tiny),
        cmocka_unit_test(test_refused),
        cmocka_unit_test(test_limit_and_cancel),
        cmocka_unit_test(test_no_memory),
        cmocka_unit_test(test_key),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
