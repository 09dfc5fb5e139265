// lod_discs.c - points as discs: sizes against closed forms, closed planes, normals, odd clouds.
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
#include "tests/unit/lod_points.h"

static struct hg_mesh_part *build(const struct hg_mesh_part *part)
{
    struct hg_mesh_part *discs;
    assert_int_equal(hg_discs_build(part, UINT32_MAX, &discs), HG_OK);
    assert_int_equal(discs->topology, HG_TOPOLOGY_TRIANGLES);
    for (uint32_t i = 0; i < discs->index_count; i++)
        assert_true(discs->indices[i] < discs->vertex_count);
    return discs;
}

static double triangle_area(const struct hg_mesh_part *p, uint32_t triangle)
{
    const uint32_t *v = p->indices + (size_t)triangle * 3;
    double e[2][3], n[3];
    for (int k = 0; k < 3; k++) {
        e[0][k] = (double)p->positions[v[1] * 3 + k] - (double)p->positions[v[0] * 3 + k];
        e[1][k] = (double)p->positions[v[2] * 3 + k] - (double)p->positions[v[0] * 3 + k];
    }
    for (int k = 0; k < 3; k++)
        n[k] = e[0][(k + 1) % 3] * e[1][(k + 2) % 3] - e[0][(k + 2) % 3] * e[1][(k + 1) % 3];
    return 0.5 * sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
}

// Area of the disc of a point.
static double disc_area(const struct hg_mesh_part *discs, uint32_t points, uint32_t point)
{
    const uint32_t each = discs->index_count / 3 / points;
    double sum = 0.0;
    for (uint32_t t = 0; t < each; t++) {
        assert_int_equal(hg_discs_point(discs, point * each + t), point);
        sum += triangle_area(discs, point * each + t);
    }
    return sum;
}

// A disc is as large as its circle, whatever the number of sides, and lies across its normal.
static void test_area_is_that_of_the_circle(void **state)
{
    (void)state;
    static const uint32_t counts[] = {9, 4000, 5000};
    for (int i = 0; i < 3; i++) {
        struct hg_mesh_part part = points_sphere(counts[i], true);
        part.point_diameter = 0.125f;
        struct hg_mesh_part *discs = build(&part);
        for (uint32_t p = 0; p < counts[i]; p += 1 + counts[i] / 100)
            assert_true(fabs(disc_area(discs, counts[i], p) / (M_PI * 0.0625 * 0.0625) - 1) < 1e-4);
        for (uint32_t v = 0; v < discs->vertex_count; v++) {
            const float *n = discs->normals + (size_t)v * 3, *at = discs->positions + (size_t)v * 3;
            // Points of the unit sphere: tangent planes are one away from the origin.
            assert_true(fabsf(n[0] * at[0] + n[1] * at[1] + n[2] * at[2] - 1.0f) < 1e-5f);
        }
        hg_discs_free(discs);
        points_finish(&part);
    }
    for (uint32_t sides = 4; sides <= 16; sides++) {
        static const float at[3] = {0}, up[3] = {0, 0, 1};
        float corners[HG_DISC_SIDES_MAX * 3];
        double sum = 0.0;
        if (!hg_disc_sides_ok(sides))
            continue;
        hg_disc_corners(at, up, 2.0f, sides, corners);
        for (uint32_t c = 0; c < sides; c++) {
            const float *a = corners + c * 3, *b = corners + (c + 1) % sides * 3;
            sum += 0.5 * ((double)a[0] * b[1] - (double)a[1] * b[0]); // counter-clockwise
        }
        assert_true(fabs(sum - 4.0 * M_PI) < 1e-5);
    }
}

// On a square grid the Voronoi cells are squares: discs reach their corners and little farther.
static void test_spacing_of_a_grid(void **state)
{
    (void)state;
    struct hg_mesh_part part = points_grid(40, 0.25f);
    struct hg_mesh_part *discs = build(&part);
    const double reach = 0.25 * sqrt(0.5) * 1.06;
    for (uint32_t p = 0; p < part.index_count; p++)
        assert_true(fabs(sqrt(disc_area(discs, part.index_count, p) / M_PI) / reach - 1) < 1e-3);
    hg_discs_free(discs);
    part.point_scale = 2.0f;
    discs = build(&part);
    assert_true(fabs(sqrt(disc_area(discs, part.index_count, 820) / M_PI) / reach - 2) < 2e-3);
    hg_discs_free(discs);
    points_finish(&part);
}

static bool covered(const struct hg_mesh_part *d, uint32_t points, float x, float z)
{
    const uint32_t sides = d->vertex_count / points;
    for (uint32_t p = 0; p < points; p++) {
        const float *c = d->positions + (size_t)p * sides * 3;
        bool inside = true;
        for (uint32_t i = 0; inside && i < sides; i++) {
            const float *a = c + i * 3, *b = c + (i + 1) % sides * 3;
            // Counter-clockwise about +y: x to the right, z towards the eye.
            inside = (b[2] - a[2]) * (x - a[0]) - (b[0] - a[0]) * (z - a[2]) >= 0.0f;
        }
        if (inside)
            return true;
    }
    return false;
}

// Discs of a plane leave no hole, however unevenly its points lie.
static void test_planes_are_closed(void **state)
{
    (void)state;
    uint32_t seed = 5;
    for (int uneven = 0; uneven < 2; uneven++) {
        struct hg_mesh_part part = points_plane(6000, uneven != 0);
        struct hg_mesh_part *discs = build(&part);
        uint32_t open = 0;
        for (int i = 0; i < 4000; i++) {
            const float x = points_random(&seed) * 1.6f - 0.8f,
                        z = points_random(&seed) * 1.6f - 0.8f;
            open += !covered(discs, part.index_count, x, z);
        }
        assert_in_range(open, 0, 2); // beside 4000
        hg_discs_free(discs);
        points_finish(&part);
    }
}

// Normals that the cloud does not have come out as those of the surface, but for their sign.
static void test_normals_are_estimated(void **state)
{
    (void)state;
    struct hg_mesh_part part = points_sphere(5000, false);
    struct hg_mesh_part *discs = build(&part);
    const uint32_t sides = discs->vertex_count / part.index_count;
    for (uint32_t p = 0; p < part.index_count; p++) {
        const float *n = discs->normals + (size_t)p * sides * 3,
                    *at = part.positions + (size_t)p * 3;
        assert_true(fabsf(n[0] * at[0] + n[1] * at[1] + n[2] * at[2]) > 0.99f);
    }
    hg_discs_free(discs);
    points_finish(&part);
}

// One point, points in one place, a line, and one point far from all others.
static void test_odd_clouds(void **state)
{
    (void)state;
    struct hg_mesh_part part = points_grid(1, 1.0f);
    struct hg_mesh_part *discs = build(&part);
    assert_true(fabs(disc_area(discs, 1, 0) / (M_PI * 1e-4) - 1) < 1e-3); // 1 cm
    hg_discs_free(discs);
    points_finish(&part);

    part = points_make(30000);
    discs = build(&part); // all at the origin
    hg_discs_free(discs);
    for (uint32_t i = 0; i < part.vertex_count; i++)
        part.positions[i * 3] = 0.01f * (float)i;
    discs = build(&part);
    for (uint32_t i = 0; i < part.index_count; i += 999) {
        const double radius = sqrt(disc_area(discs, part.index_count, i) / M_PI);
        assert_true(radius > 0.004 && radius < 0.02);
    }
    hg_discs_free(discs);
    points_finish(&part);

    part = points_grid(40, 0.25f);
    part.positions[1] = 1000.0f;
    discs = build(&part);
    assert_true(disc_area(discs, part.index_count, 0) < 2.0 * M_PI);
    hg_discs_free(discs);
    points_finish(&part);
}

static void test_some_of_a_cloud(void **state)
{
    (void)state;
    struct hg_mesh_part part = points_plane(6000, false), *discs;
    assert_int_equal(hg_discs_build(&part, 500, &discs), HG_OK);
    assert_in_range(discs->index_count / 6, 400, 500); // squares
    hg_discs_free(discs);
    points_finish(&part);
}

static void test_what_is_lit(void **state)
{
    (void)state;
    float values[4] = {0};
    struct hg_mesh_part part = {.topology = HG_TOPOLOGY_POINTS};
    assert_true(hg_discs_are_lit(&part));
    part.colors = values;
    assert_false(hg_discs_are_lit(&part));
    part.normals = values;
    assert_true(hg_discs_are_lit(&part));
    assert_true(hg_discs_can_build(&part, 0));
    part.topology = HG_TOPOLOGY_LINES;
    assert_false(hg_discs_can_build(&part, 0));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_area_is_that_of_the_circle),
        cmocka_unit_test(test_spacing_of_a_grid),
        cmocka_unit_test(test_planes_are_closed),
        cmocka_unit_test(test_normals_are_estimated),
        cmocka_unit_test(test_odd_clouds),
        cmocka_unit_test(test_some_of_a_cloud),
        cmocka_unit_test(test_what_is_lit),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
