// lod_vertex_pack.c - vertex formats: what is packed comes back, within the stated errors.
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "renderer/mesh/provoking_vertex.h"
#include "renderer/lod/vertex_pack.h"

static uint32_t random_state = 3;

static float next_random(void) // -1..1
{
    random_state = random_state * 1664525u + 1013904223u;
    return (float)(random_state >> 8) * 0x1p-23f - 1.0f;
}

static void random_unit(float v[3])
{
    float length;
    do {
        for (int i = 0; i < 3; i++)
            v[i] = next_random();
        length = sqrtf(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
    } while (length < 0.1f || length > 1.0f);
    for (int i = 0; i < 3; i++)
        v[i] /= length;
}

// Angle between two vectors in degrees, good for small ones.
static double angle(const float a[3], const float b[3])
{
    const double c[3] = {(double)a[1] * b[2] - (double)a[2] * b[1],
        (double)a[2] * b[0] - (double)a[0] * b[2], (double)a[0] * b[1] - (double)a[1] * b[0]};
    const double s = sqrt(c[0] * c[0] + c[1] * c[1] + c[2] * c[2]);
    const double d = (double)a[0] * b[0] + (double)a[1] * b[1] + (double)a[2] * b[2];
    return atan2(s, d) * 180.0 / 3.14159265358979;
}

static void test_octahedral(void **state)
{
    (void)state;
    double worst_normal = 0.0, worst_tangent = 0.0;
    for (int i = 0; i < 200000; i++) {
        float v[4], back[4];
        random_unit(v);
        v[3] = i & 1 ? 1.0f : -1.0f;
        hg_unpack_normal(hg_pack_normal(v), back);
        worst_normal = fmax(worst_normal, angle(v, back));
        hg_unpack_tangent(hg_pack_tangent(v), back);
        worst_tangent = fmax(worst_tangent, angle(v, back));
        assert_true(back[3] == v[3]);
    }
    print_message("worst angle: normal %.5f, tangent %.5f degrees\n", worst_normal, worst_tangent);
    assert_true(worst_normal < 0.0025);
    assert_true(worst_tangent < 0.006);
    assert_true(worst_normal > 0.0); // the measure itself works
}

// Axes are exact: flat walls stay flat.
static void test_axes(void **state)
{
    (void)state;
    for (int axis = 0; axis < 3; axis++)
        for (int sign = -1; sign <= 1; sign += 2) {
            float v[4] = {0.0f, 0.0f, 0.0f, 1.0f}, back[4];
            v[axis] = (float)sign;
            hg_unpack_normal(hg_pack_normal(v), back);
            assert_memory_equal(v, back, 3 * sizeof(float));
            hg_unpack_tangent(hg_pack_tangent(v), back);
            assert_memory_equal(v, back, 4 * sizeof(float));
        }
}

static float positions[5 * 3], normals[5 * 3], tangents[5 * 4], uv1[5 * 2], colors[5 * 4];
static uint16_t joints[5 * 4];
static float weights[5 * 4];
static uint32_t indices[6] = {0, 1, 2, 2, 3, 4};

static struct hg_mesh_part make_part(void)
{
    for (int i = 0; i < 5; i++) {
        positions[i * 3] = (float)i;
        random_unit(normals + i * 3);
        random_unit(tangents + i * 4);
        tangents[i * 4 + 3] = 1.0f;
        uv1[i * 2] = (float)i * 0.3f;
        for (int c = 0; c < 4; c++)
            colors[i * 4 + c] = (float)(i * 10 + c) / 255.0f;
    }
    return (struct hg_mesh_part){.topology = HG_TOPOLOGY_TRIANGLES,
        .vertex_count = 5,
        .index_count = 6,
        .indices = indices,
        .positions = positions,
        .normals = normals,
        .tangents = tangents,
        .uv = {NULL, uv1},
        .colors = colors,
        .joints = joints,
        .weights = weights,
        .joint_sets = 1};
}

static void test_layout(void **state)
{
    (void)state;
    struct hg_mesh_part part = make_part();
    struct hg_pack_layout l;
    assert_int_equal(hg_pack_layout_of(&part, 0, &l), HG_OK);
    assert_int_equal(l.flags, HG_DRAW_NORMALS | HG_DRAW_TANGENTS | HG_DRAW_UV1 | HG_DRAW_COLOR8);
    assert_int_equal(l.extra_words, 3);
    uint8_t *bytes = malloc(l.total_bytes);
    assert_non_null(bytes);
    hg_pack_part(&part, 0, NULL, &l, bytes);
    assert_memory_equal(bytes + l.indices, indices, sizeof indices);
    assert_memory_equal(bytes + l.positions, positions, sizeof positions);
    const uint32_t *extra = (const uint32_t *)(const void *)(bytes + l.extra);
    for (uint32_t i = 0; i < 5; i++) {
        assert_memory_equal(extra + i * 3, uv1 + i * 2, 8);
        for (uint32_t c = 0; c < 4; c++)
            assert_int_equal(extra[i * 3 + 2] >> (8 * c) & 255u, i * 10 + c);
    }
    free(bytes);
    colors[3] = 0.12345f; // no byte value
    assert_int_equal(hg_pack_layout_of(&part, 0, &l), HG_OK);
    assert_true(l.flags & HG_DRAW_COLOR16);
    assert_int_equal(l.extra_words, 4);
}

static void test_morph_offsets(void **state)
{
    (void)state;
    struct hg_mesh_part part = make_part();
    static float a[15], b[15], c[15];
    a[0] = 1.0f;
    b[0] = 2.0f;
    c[0] = 3.0f;
    struct hg_morph_target targets[2] = {{.positions = a}, {.normals = b, .tangents = c}};
    part.targets = targets;
    struct hg_pack_layout l;
    assert_int_equal(hg_pack_layout_of(&part, 2, &l), HG_OK);
    uint8_t *bytes = malloc(l.total_bytes);
    assert_non_null(bytes);
    hg_pack_part(&part, 2, NULL, &l, bytes);
    const float *stream = (const float *)(const void *)(bytes + l.targets);
    const struct hg_gpu_morph m0 = hg_pack_morph(&part, 0), m1 = hg_pack_morph(&part, 1);
    assert_int_equal(m0.normals, HG_DEFORM_ABSENT);
    assert_int_equal(m1.positions, HG_DEFORM_ABSENT);
    assert_true(stream[m0.positions] == 1.0f && stream[m1.normals] == 2.0f);
    assert_true(stream[m1.tangents] == 3.0f);
    free(bytes);
}

// Sizes that cannot be addressed are refused before anything is touched.
static void test_too_large(void **state)
{
    (void)state;
    struct hg_mesh_part part = make_part();
    struct hg_morph_target target = {.positions = positions};
    part.colors = NULL; // nothing of the part is read
    part.targets = &target;
    part.vertex_count = UINT32_MAX;
    struct hg_pack_layout l;
    assert_int_equal(hg_pack_layout_of(&part, 1, &l), HG_E_LIMIT);
    assert_int_equal(l.total_bytes, 0);
}

// Every triangle keeps its corners and its winding, and its first corner is its number.
static void check_numbered(const struct hg_mesh_part *part, const uint32_t *order)
{
    struct hg_provoking n;
    assert_int_equal(hg_provoking_build(part, order, &n), HG_OK);
    for (uint32_t i = 0; i < part->index_count / 3; i++) {
        const uint32_t *c = part->indices + (size_t)(order != NULL ? order[i] : i) * 3;
        const uint32_t *to = n.indices + (size_t)i * 3;
        uint32_t got[3], k = 0;
        assert_int_equal(to[0], i);
        for (int j = 0; j < 3; j++) {
            assert_true(to[j] < n.vertex_count);
            got[j] = n.sources[to[j]];
        }
        while (k < 3 && (got[0] != c[k] || got[1] != c[(k + 1) % 3] || got[2] != c[(k + 2) % 3]))
            k++;
        assert_true(k < 3);
    }
    assert_true(n.vertex_count <= part->index_count / 3 + part->vertex_count);
    hg_provoking_finish(&n);
}

static void test_numbered(void **state)
{
    (void)state;
    enum { SIDE = 40, TRIANGLES = SIDE * SIDE * 2, WILD = 500 };
    static uint32_t grid[TRIANGLES * 3], wild[WILD * 3], order[TRIANGLES];
    for (uint32_t i = 0; i < SIDE * SIDE; i++) {
        const uint32_t at = i / SIDE * (SIDE + 1) + i % SIDE;
        const uint32_t quad[6] = {at, at + 1, at + SIDE + 1, at + 1, at + SIDE + 2, at + SIDE + 1};
        memcpy(grid + (size_t)i * 6, quad, sizeof quad);
    }
    for (uint32_t i = 0; i < TRIANGLES; i++)
        order[i] = (i * 7919u + 13u) % TRIANGLES;
    for (uint32_t i = 0; i < WILD * 3; i++) // few vertices, corners that fall together
        wild[i] = (uint32_t)((next_random() * 0.5f + 0.5f) * 59.0f);
    struct hg_mesh_part part = {.topology = HG_TOPOLOGY_TRIANGLES,
        .vertex_count = (SIDE + 1) * (SIDE + 1),
        .index_count = TRIANGLES * 3,
        .indices = grid};
    check_numbered(&part, NULL);
    check_numbered(&part, order);
    part.indices = wild;
    part.index_count = WILD * 3;
    part.vertex_count = 60;
    check_numbered(&part, NULL);
    part.vertex_count = UINT32_MAX - 1;
    struct hg_provoking none;
    assert_int_equal(hg_provoking_build(&part, NULL, &none), HG_E_LIMIT);
    assert_null(none.indices);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_octahedral),
        cmocka_unit_test(test_axes), cmocka_unit_test(test_layout),
        cmocka_unit_test(test_morph_offsets), cmocka_unit_test(test_too_large),
        cmocka_unit_test(test_numbered)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
