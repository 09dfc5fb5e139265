// irradiance_directions.c - rays of texels: what they count for, against integrals.
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>

#include <cmocka.h>

#include "renderer/gi/lobe.h"
#include "renderer/irradiance/directions.h"

#define RAYS 200000

// Seen from a direction in the plane x, z at this angle from the normal, +z.
static struct hg_irradiance_surface surface_at(float roughness, float degrees)
{
    const float angle = degrees * (float)HG_PI / 180;
    struct hg_irradiance_surface s = {.normal = {0, 0, 1},
        .facet = {0, 0, 1},
        .mirror = {0, 0, 1},
        .view = {sinf(angle), 0, cosf(angle)},
        .roughness = roughness,
        .f0 = 0.04f,
        .rough = roughness >= HG_LOBE_ROUGH};
    return s;
}

// Light along +x is brighter than along -x.
static double radiance(const float way[3])
{
    return way[2] > 0 ? 1 + 0.8 * (double)way[0] : 0;
}

// Integrals of the lobe and of the cosine times that light, by the midpoint rule.
static void integrate(
    const struct hg_irradiance_surface *s, double *diffuse, double *mirrored, double *albedo)
{
    enum { ACROSS = 512, AROUND = 1024 };
    *diffuse = *mirrored = *albedo = 0;
    for (int i = 0; i < ACROSS; i++)
        for (int k = 0; k < AROUND; k++) {
            const double z = (i + 0.5) / ACROSS, phi = 2 * HG_PI * (k + 0.5) / AROUND;
            const double flat = sqrt(1 - z * z), piece = 2 * HG_PI / ACROSS / AROUND;
            const float way[3] = {(float)(flat * cos(phi)), (float)(flat * sin(phi)), (float)z};
            float density;
            const double value =
                (double)hg_lobe_value(s->roughness, s->f0, s->mirror, s->view, way, &density);
            *diffuse += radiance(way) * z / HG_PI * piece;
            *mirrored += radiance(way) * value * piece;
            *albedo += value * piece;
        }
}

static void check(const struct hg_irradiance_surface *s)
{
    struct hg_irradiance_cell cell = {.key = 7};
    double diffuse = 0, mirrored = 0, weights[2] = {0}, want[3];
    float most = 0;
    for (int i = 0; i < RAYS; i++) {
        struct hg_irradiance_direction d;
        hg_irradiance_choose(&cell, s, &d);
        assert_float_equal(hg_dot3(d.way, d.way), 1, 1e-4);
        assert_true(d.diffuse >= 0 && d.mirrored >= 0);
        most = fmaxf(most, fmaxf(d.diffuse, d.mirrored));
        diffuse += (double)d.diffuse * radiance(d.way) / RAYS;
        mirrored += (double)d.mirrored * radiance(d.way) / RAYS;
        weights[0] += (double)d.diffuse / RAYS;
        weights[1] += (double)d.mirrored / RAYS;
    }
    integrate(s, &want[0], &want[1], &want[2]);
    print_message("roughness %.2f: diffuse %.4f of %.4f, mirrored %.5f of %.5f, most %.2f\n",
        (double)s->roughness, diffuse, want[0], mirrored, want[1], (double)most);
    assert_true(fabs(weights[0] - 1) < 0.01);
    assert_true(fabs(diffuse - want[0]) < 0.01);
    assert_int_equal(cell.rays, RAYS);
    if (s->rough) {
        assert_true(most < 3.01f); // a third of the rays goes one of the two ways
        assert_true(fabs(weights[1] - want[2]) < 0.02 * want[2]);
        assert_true(fabs(mirrored - want[1]) < 0.02 * want[1]);
    } else {
        assert_true(weights[1] == 0);
    }
}

static void test_integrals(void **state)
{
    (void)state;
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < 3; k++) {
            const struct hg_irradiance_surface s =
                surface_at(0.4f + 0.3f * (float)i, 10 + 35 * (float)k);
            check(&s);
        }
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_integrals)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
