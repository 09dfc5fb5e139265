// scene_creases.c - normals by crease angle: solids with edges, round ones, and the weights.
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include <stdlib.h>

#include "base/alloc.h"
#include "renderer/scene/asset.h"
#include "renderer/scene/mesh_tools.h"
#include "tests/unit/scene_files.h"

static struct hg_mesh_part make_part(
    const float *positions, uint32_t vertices, const uint32_t *indices, uint32_t count)
{
    struct hg_mesh_part part = {.vertex_count = vertices, .index_count = count};
    part.positions = hg_calloc(vertices, 3 * sizeof(float));
    part.indices = hg_calloc(count, sizeof(uint32_t));
    assert_true(part.positions && part.indices);
    memcpy(part.positions, positions, vertices * 3 * sizeof(float));
    memcpy(part.indices, indices, count * sizeof(uint32_t));
    return part;
}

static void face_normal(const struct hg_mesh_part *part, uint32_t face, float n[3])
{
    float a[3], b[3];
    const float *p = part->positions + (size_t)part->indices[face * 3] * 3;
    for (int c = 0; c < 3; c++) {
        a[c] = part->positions[(size_t)part->indices[face * 3 + 1] * 3 + c] - p[c];
        b[c] = part->positions[(size_t)part->indices[face * 3 + 2] * 3 + c] - p[c];
    }
    n[0] = a[1] * b[2] - a[2] * b[1];
    n[1] = a[2] * b[0] - a[0] * b[2];
    n[2] = a[0] * b[1] - a[1] * b[0];
    const float length = sqrtf(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
    for (int c = 0; c < 3; c++)
        n[c] /= length;
}

// A prism of `sides`: its wall is round up to 40 degrees between sides, its lids are flat.
static void check_prism(uint32_t sides, bool round)
{
    float positions[64 * 2 * 3];
    uint32_t indices[64 * 12], n = 0;
    for (uint32_t i = 0; i < sides; i++)
        for (uint32_t k = 0; k < 2; k++) {
            const double a = 6.283185307179586 * i / sides;
            float *p = positions + ((size_t)i * 2 + k) * 3;
            p[0] = (float)cos(a);
            p[1] = k ? 1 : -1;
            p[2] = (float)-sin(a);
        }
    for (uint32_t i = 0; i < sides; i++) {
        const uint32_t a = i * 2, b = (i + 1) % sides * 2;
        const uint32_t wall[6] = {a, b, b + 1, a, b + 1, a + 1};
        memcpy(indices + n, wall, sizeof wall);
        n += 6;
    }
    const uint32_t walls = n / 3;
    for (uint32_t i = 1; i + 1 < sides; i++) {
        const uint32_t lids[6] = {1, i * 2 + 1, i * 2 + 3, 0, i * 2 + 2, i * 2};
        memcpy(indices + n, lids, sizeof lids);
        n += 6;
    }
    struct hg_mesh_part part = make_part(positions, sides * 2, indices, n);
    assert_int_equal(hg_part_make_crease_normals(&part, NULL), HG_OK);
    assert_int_equal(part.vertex_count, round ? sides * 4 : sides * 6);
    for (uint32_t f = 0; f < n / 3; f++)
        for (uint32_t c = 0; c < 3; c++) {
            const uint32_t v = part.indices[f * 3 + c];
            float want[3];
            face_normal(&part, f, want);
            if (f < walls && round) { // of the cylinder: both sides have the same angles
                const float *p = part.positions + (size_t)v * 3;
                memcpy(want, (const float[]){p[0], 0, p[2]}, sizeof want);
            }
            expect_vector(part.normals + (size_t)v * 3, want, 3, 1e-5f);
        }
    hg_mesh_part_finish(&part, 0);
}

static void test_prisms(void **state)
{
    (void)state;
    check_prism(4, false); // a cube is not a pillow
    check_prism(6, false);
    check_prism(8, false);
    check_prism(9, true); // 40 degrees
    check_prism(12, true);
    check_prism(64, true);
}

// Where a corner has one triangle of a plane or five of them does not turn the normal.
static void test_weights_are_angles(void **state)
{
    (void)state;
    // a roof of 30 degrees between planes; one side is cut into slivers at vertex 0
    const float s = sinf(0.2617994f), c = cosf(0.2617994f);
    float positions[9 * 3] = {0, 0, 0, 0, 0, 1, -c, -s, 0, -c, -s, 1};
    uint32_t indices[7 * 3] = {0, 2, 3, 0, 3, 1}, n = 6;
    for (uint32_t i = 0; i < 5; i++) { // from along the ridge to across it, on the other side
        const float a = 1.5707963f * (float)i / 4;
        const float p[3] = {sinf(a) * c, -sinf(a) * s, cosf(a)};
        memcpy(positions + (4 + i) * 3, i ? p : (const float[]){0, 0, 1}, sizeof p);
    }
    for (uint32_t i = 4; i < 8; i++) {
        memcpy(indices + n, (const uint32_t[]){0, i, i + 1}, 3 * sizeof *indices);
        n += 3;
    }
    struct hg_mesh_part part = make_part(positions, 9, indices, n);
    assert_int_equal(hg_part_make_crease_normals(&part, NULL), HG_OK);
    expect_vector(part.normals + (size_t)part.indices[0] * 3, (const float[]){0, 1, 0}, 3, 1e-6f);
    hg_mesh_part_finish(&part, 0);
}

// Seams of texture coordinates split vertices, not the surface; -0 and 0 are one place.
static void test_seams_do_not_show(void **state)
{
    (void)state;
    const float positions[6 * 3] = {
        -1, 0, 0, 0, 0.1f, 0, 0, 0.1f, 1, -0.0f, 0.1f, 1, 0, 0.1f, -0.0f, 1, 0, 0};
    const uint32_t indices[6] = {0, 2, 1, 4, 3, 5};
    struct hg_mesh_part part = make_part(positions, 6, indices, 6);
    assert_int_equal(hg_part_make_crease_normals(&part, NULL), HG_OK);
    assert_int_equal(part.vertex_count, 6);
    expect_vector(part.normals + (size_t)part.indices[1] * 3,
        part.normals + (size_t)part.indices[4] * 3, 3, 0);
    hg_mesh_part_finish(&part, 0);
}

// Triangles back to back, three at an edge, none of area, and the same one twice.
static void test_odd_meshes(void **state)
{
    (void)state;
    const float positions[5 * 3] = {0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 0.5f, 0.5f, 0.5f};
    const uint32_t indices[21] = {0, 1, 2, 2, 1, 0, 0, 1, 3, 0, 1, 4, 0, 0, 1, 0, 1, 2, 3, 3, 3};
    struct hg_mesh_part part = make_part(positions, 5, indices, 21);
    assert_int_equal(hg_part_make_crease_normals(&part, NULL), HG_OK);
    assert_int_equal(part.index_count, 21);
    for (uint32_t i = 0; i < 21; i++)
        assert_true(part.indices[i] < part.vertex_count);
    for (uint32_t v = 0; v < part.vertex_count; v++) {
        const float *n = part.normals + (size_t)v * 3;
        assert_float_equal(n[0] * n[0] + n[1] * n[1] + n[2] * n[2], 1, 1e-5);
    }
    expect_vector(part.normals + (size_t)part.indices[0] * 3, (const float[]){0, 0, 1}, 3, 1e-6f);
    expect_vector(part.normals + (size_t)part.indices[3] * 3, (const float[]){0, 0, -1}, 3, 1e-6f);
    hg_mesh_part_finish(&part, 0);
}

static void test_failed_allocations(void **state)
{
    (void)state;
    const float positions[9] = {0, 0, 0, 1, 0, 0, 0, 1, 0};
    const uint32_t indices[3] = {0, 1, 2};
    for (uint64_t n = 1;; n++) {
        struct hg_mesh_part part = make_part(positions, 3, indices, 3);
        hg_alloc_fail_at(n);
        const enum hg_status status = hg_part_make_crease_normals(&part, NULL);
        const bool all_made = hg_alloc_count() < n;
        hg_alloc_fail_at(0);
        assert_int_equal(status, all_made ? HG_OK : HG_E_NOMEM);
        hg_mesh_part_finish(&part, 0);
        if (all_made)
            break;
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_prisms),
        cmocka_unit_test(test_weights_are_angles), cmocka_unit_test(test_seams_do_not_show),
        cmocka_unit_test(test_odd_meshes), cmocka_unit_test(test_failed_allocations)};
    return cmocka_run_group_tests_name("scene_creases", tests, NULL, NULL);
}
