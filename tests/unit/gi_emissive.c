// Rays to emissive triangles: means of many against the form factor of a square, sides that shine,
// and triangles of which most are far away.
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <cmocka.h>

#include <math.h>

#include "renderer/host_shading/emissive.h"
#include "renderer/math/vec.h"

enum { POINTS = 20000 };

static const float square[12] = {-1, 0, -1, 1, 0, -1, 1, 0, 1, -1, 0, 1}; // normal (0, -1, 0)
static const uint32_t indices[6] = {0, 1, 2, 0, 2, 3};

struct rig {
    struct hg_ray_geometry_piece pieces[64];
    uint32_t piece_materials[64];
    struct hg_host_material materials[2];
    struct hg_host_surfaces surfaces;
    struct hg_host_emissive emissive;
};

// Squares of half a side `half` at (x, 3, 0), of material 0.
static void add_square(struct rig *r, float half, float x)
{
    struct hg_ray_geometry_piece *p = &r->pieces[r->surfaces.piece_count++];
    *p = (struct hg_ray_geometry_piece){.triangle_count = 2,
        .vertex_count = 4,
        .positions = square,
        .indices = indices,
        .world = {half, 0, 0, 0, half, 0, 0, 0, half, x, 3, 0}};
}

static void begin(struct rig *r)
{
    *r = (struct rig){0};
    r->materials[0].emitted[0] = 4;
    r->materials[0].emitted[1] = 2;
    r->materials[0].emitted[2] = 1;
    r->surfaces = (struct hg_host_surfaces){.pieces = r->pieces,
        .piece_materials = r->piece_materials,
        .materials = r->materials,
        .material_count = 2,
        .built = 1};
}

static void sync(struct rig *r)
{
    assert_int_equal(hg_host_emissive_sync(&r->emissive, &r->surfaces), HG_OK);
}

#define EVERYWHERE (1 / (4 * (float)HG_PI)) // density of directions of a probe

// What is left to rays that meet the square above the origin by chance: over the cosine about up,
// or from a probe.
static void meet(struct rig *r, float half, const float *normal, double sum[3])
{
    for (int i = 0; i < POINTS; i++) {
        const double u = fmod(i * 0.7548776662466927, 1), v = fmod(i * 0.5698402909980532, 1);
        const float up = (float)(normal ? sqrt(1 - u) : 2 * u - 1);
        const float along = sqrtf(1 - up * up) / up, phi = 2 * (float)(HG_PI * v);
        const float x = 3 * along * cosf(phi), z = 3 * along * sinf(phi);
        if (!(up > 0) || fabsf(x) > half || fabsf(z) > half)
            continue;
        const float *emitted = r->materials[0].emitted;
        const float other = normal ? up / (float)HG_PI : EVERYWHERE;
        const float share = hg_host_emissive_share(&r->emissive, emitted, 3 / up, up, other);
        for (int c = 0; c < 3; c++)
            sum[c] += (double)(emitted[c] * (1 - share) / (normal ? 1 : EVERYWHERE));
    }
}

// Mean of what rays from the origin bring, with what is left to others, and the deviation of one of
// them over it.
static void measure(
    struct rig *r, float half, const float *normal, float mean[3], double *deviation)
{
    double sum[3] = {0}, squares = 0;
    for (uint64_t i = 0; i < POINTS; i++) {
        const struct hg_host_emissive_receiver receiver = {
            .normal = normal, .density = EVERYWHERE, .seed = i * 2654435761u};
        struct hg_host_emissive_ray ray;
        if (!hg_host_emissive_choose(&r->emissive, &receiver, &ray))
            continue;
        assert_float_equal(hg_length3(ray.direction), 1, 1e-5f);
        assert_true(ray.distance > 2.9f && ray.distance < 1000);
        for (int c = 0; c < 3; c++)
            sum[c] += (double)ray.light[c];
        squares += (double)ray.light[0] * (double)ray.light[0];
    }
    const double first = sum[0] / POINTS;
    if (first > 0)
        meet(r, half, normal, sum);
    for (int c = 0; c < 3; c++)
        mean[c] = (float)(sum[c] / POINTS);
    *deviation = first > 0 ? sqrt(fmax(squares / POINTS - first * first, 0)) / first : 0;
}

// Of a square that faces a point below its middle at `away` half sides: four times that of a
// corner. Source: Howell, "A Catalog of Radiation Heat Transfer Configuration Factors", B-4.
static double form_factor(double away)
{
    const double a = 1 / away, root = sqrt(1 + a * a);
    return 4 / (2 * HG_PI) * 2 * a / root * atan(a / root);
}

static void test_square(void **state)
{
    (void)state;
    static const float up[3] = {0, 1, 0}, down[3] = {0, -1, 0};
    struct rig r;
    float mean[3];
    double deviation;
    begin(&r);
    add_square(&r, 2, 0);
    sync(&r);
    assert_int_equal(r.emissive.count, 2);
    measure(&r, 2, up, mean, &deviation);
    const double expected = form_factor(1.5);
    print_message(
        "square: %.4f of %.4f, one ray is off by %.2f\n", (double)mean[0] / 4, expected, deviation);
    for (int c = 0; c < 3; c++)
        assert_true(
            fabs((double)mean[c] / (double)r.materials[0].emitted[c] / expected - 1) < 0.01);
    assert_true(deviation < 0.5);
    measure(&r, 2, down, mean, &deviation);
    assert_true(mean[0] == 0);
    hg_host_emissive_finish(&r.emissive);
}

// What has one side shines to that side alone, also where the instance is mirrored.
static void test_sides(void **state)
{
    (void)state;
    static const float up[3] = {0, 1, 0};
    for (int i = 0; i < 4; i++) {
        struct rig r;
        float mean[3];
        double deviation;
        begin(&r);
        add_square(&r, 1, 0);
        float *world = r.pieces[0].world;
        world[4] = world[8] = i == 0 || i == 2 ? -1.0f : 1.0f; // about x, so that it faces up
        if (i == 3)                                            // the same square, mirrored
            world[0] = -1;
        r.pieces[0].flags = i == 3 ? HG_DRAW_MIRRORED : 0;
        r.materials[0].double_sided = i == 2;
        sync(&r);
        measure(&r, 1, up, mean, &deviation);
        assert_int_equal(mean[0] > 0, i != 0);
        hg_host_emissive_finish(&r.emissive);
    }
}

// A near one among many that are as strong and far away: few of the candidates are of it.
static void test_many(void **state)
{
    (void)state;
    static const float up[3] = {0, 1, 0};
    struct rig r;
    float mean[3];
    double deviation;
    begin(&r);
    add_square(&r, 2, 0);
    for (int i = 1; i < 32; i++)
        add_square(&r, 2, 100 + 20 * (float)i);
    sync(&r);
    measure(&r, 2, up, mean, &deviation);
    print_message("one of 32: %.4f of %.4f, one ray is off by %.2f\n", (double)mean[0] / 4,
        form_factor(1.5), deviation);
    assert_true(fabs((double)mean[0] / 4 / form_factor(1.5) - 1) < 0.05);
    hg_host_emissive_finish(&r.emissive);
}

// A probe asks for illuminance across the direction: of a small square the intensity over the
// square of the distance.
static void test_probe(void **state)
{
    (void)state;
    struct rig r;
    float mean[3];
    double deviation;
    begin(&r);
    add_square(&r, 0.05f, 0);
    sync(&r);
    measure(&r, 0.05f, NULL, mean, &deviation);
    assert_true(fabs((double)mean[0] / (4 * 0.01 / 9) - 1) < 0.01);
    hg_host_emissive_finish(&r.emissive);
}

// Dark ones, those without area and too many of them: none is known. Another revision is noticed.
static void test_none(void **state)
{
    (void)state;
    struct rig r;
    begin(&r);
    add_square(&r, 0, 0);
    add_square(&r, 1, 0);
    r.piece_materials[1] = 1;
    sync(&r);
    assert_int_equal(r.emissive.count, 0);
    r.piece_materials[1] = 0;
    sync(&r);
    assert_int_equal(r.emissive.count, 0);
    r.surfaces.built = 2;
    sync(&r);
    assert_int_equal(r.emissive.count, 2);
    r.surfaces.built = 3;
    r.pieces[1].triangle_count = HG_HOST_MOST_EMISSIVE;
    sync(&r);
    assert_int_equal(r.emissive.count, 0);
    hg_host_emissive_finish(&r.emissive);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_square), cmocka_unit_test(test_sides),
        cmocka_unit_test(test_many), cmocka_unit_test(test_probe), cmocka_unit_test(test_none)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
