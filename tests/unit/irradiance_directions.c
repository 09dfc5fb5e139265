// irradiance_directions.c - rays of texels: what they count for, against integrals; guides: what
// they learn, what they forget, how much less noise they leave.
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>

#include <cmocka.h>

#include "renderer/host_shading/lobe.h"
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

static void check(
    const struct hg_irradiance_surface *s, const struct hg_irradiance_distribution *guided)
{
    double diffuse = 0, mirrored = 0, weights[2] = {0}, want[3];
    float most = 0;
    for (uint32_t i = 0; i < RAYS; i++) {
        const struct hg_irradiance_turn turn = {.key = 7, .number = i};
        struct hg_irradiance_direction d;
        hg_irradiance_choose(&turn, s, guided, &d);
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
    if (s->rough) {
        assert_true(most < (guided ? 3.0f / 0.99f : 3.01f)); // a third of the rays goes each way
        assert_true(fabs(weights[1] - want[2]) < 0.02 * want[2]);
        assert_true(fabs(mirrored - want[1]) < 0.02 * want[1]);
    } else {
        assert_true(weights[1] == 0);
    }
}

static struct hg_irradiance_guides guides;

static int set_up(void **state)
{
    (void)state;
    return hg_irradiance_guides_init(&guides) == HG_OK ? 0 : -1;
}

static int tear_down(void **state)
{
    (void)state;
    hg_irradiance_guides_finish(&guides);
    return 0;
}

static void test_integrals(void **state)
{
    (void)state;
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < 3; k++) {
            const struct hg_irradiance_surface s =
                surface_at(0.4f + 0.3f * (float)i, 10 + 35 * (float)k);
            check(&s, NULL);
        }
}

// A lamp of 0.02 of the hemisphere, 200 times as bright as all else.
static float lamp(const float way[3])
{
    static const float to[3] = {0.48f, 0.6f, 0.64f};
    return hg_dot3(way, to) > 0.98f ? 200.0f : 1.0f;
}

// Directions all over the sphere.
static void teach(struct hg_irradiance_guide *guide, int rays)
{
    for (int i = 0; i < rays; i++) {
        const float z = 1 - 2 * ((float)i + 0.5f) / (float)rays, angle = 2.3999632f * (float)i;
        const float flat = sqrtf(1 - z * z);
        const float way[3] = {flat * cosf(angle), flat * sinf(angle), z};
        hg_irradiance_guide_add(guide, way, lamp(way));
    }
}

static void test_guided_integrals(void **state)
{
    struct hg_irradiance_guide *guide = hg_irradiance_guide_ask(&guides, 5, 1, 1);
    (void)state;
    assert_non_null(guide);
    teach(guide, 500);
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < 3; k++) {
            const struct hg_irradiance_surface s =
                surface_at(0.4f + 0.3f * (float)i, 10 + 35 * (float)k);
            struct hg_irradiance_distribution d;
            assert_true(hg_irradiance_guide_distribution(&guides, guide, s.normal, &d));
            check(&s, &d);
        }
}

// Mean and variance of what rays bring of that lamp.
static void estimate(const struct hg_irradiance_surface *s,
    const struct hg_irradiance_distribution *guided, double *mean, double *variance)
{
    double sums[2] = {0, 0};
    for (uint32_t i = 0; i < RAYS; i++) {
        const struct hg_irradiance_turn turn = {.key = 9, .number = i};
        struct hg_irradiance_direction d;
        hg_irradiance_choose(&turn, s, guided, &d);
        const double v = (double)d.diffuse * (double)lamp(d.way);
        sums[0] += v / RAYS;
        sums[1] += v * v / RAYS;
    }
    *mean = sums[0];
    *variance = sums[1] - sums[0] * sums[0];
}

static void test_guides_take_noise_away(void **state)
{
    const struct hg_irradiance_surface s = surface_at(0.4f, 10);
    struct hg_irradiance_guide *guide = hg_irradiance_guide_ask(&guides, 6, 1, 1);
    struct hg_irradiance_distribution d;
    double mean[2], variance[2];
    (void)state;
    assert_non_null(guide);
    teach(guide, 500);
    assert_true(hg_irradiance_guide_distribution(&guides, guide, s.normal, &d));
    estimate(&s, NULL, &mean[0], &variance[0]);
    estimate(&s, &d, &mean[1], &variance[1]);
    print_message(
        "mean %.3f and %.3f, variance %.1f and %.1f\n", mean[0], mean[1], variance[0], variance[1]);
    assert_true(fabs(mean[1] / mean[0] - 1) < 0.02);
    assert_true(variance[1] < 0.3 * variance[0]);
}

static void test_densities(void **state)
{
    const float normal[3] = {0, 0.6f, 0.8f};
    struct hg_irradiance_guide *guide = hg_irradiance_guide_ask(&guides, 7, 1, 1);
    struct hg_irradiance_distribution d;
    double all = 0, mean = 0;
    (void)state;
    assert_non_null(guide);
    teach(guide, 500);
    assert_true(hg_irradiance_guide_distribution(&guides, guide, normal, &d));
    for (int i = 0; i < RAYS; i++) { // over the sphere, and where its own rays go
        const float z = 1 - 2 * ((float)i + 0.5f) / RAYS, angle = 2.3999632f * (float)i;
        const float flat = sqrtf(1 - z * z);
        const float way[3] = {flat * cosf(angle), flat * sinf(angle), z};
        const float xi[2] = {((float)i + 0.5f) / RAYS, angle - floorf(angle)};
        float taken[3];
        hg_irradiance_distribution_take(&d, xi, taken);
        const double density = (double)hg_irradiance_distribution_density(&d, taken);
        assert_true(density > 0);
        all += (double)hg_irradiance_distribution_density(&d, way) * 4 * HG_PI / RAYS;
        mean += 1 / density / RAYS; // the solid angle that is reached at all
    }
    print_message("densities %.4f, solid angle %.3f\n", all, mean);
    assert_true(fabs(all - 1) < 0.01);
    assert_true(mean > 2 * HG_PI && mean < 4 * HG_PI);
}

static void test_guides_know_and_forget(void **state)
{
    const float up[3] = {0, 0, 1};
    struct hg_irradiance_distribution d;
    struct hg_irradiance_guide *guide = hg_irradiance_guide_ask(&guides, 8, 1, 1);
    (void)state;
    assert_non_null(guide);
    teach(guide, HG_GUIDE_FEW - 1);
    assert_false(hg_irradiance_guide_distribution(&guides, guide, up, &d));
    teach(guide, 500);
    assert_true(hg_irradiance_guide_distribution(&guides, guide, up, &d));
    const float before = guide->all;
    assert_ptr_equal(hg_irradiance_guide_ask(&guides, 8, 2, 1), guide);
    assert_float_equal(guide->all, before, 0);
    assert_ptr_equal(hg_irradiance_guide_ask(&guides, 8, 2, 2), guide); // of another light
    assert_true(guide->all < before / 8);
    hg_irradiance_guide_add(guide, up, NAN); // what is no number changes nothing
    hg_irradiance_guide_add(guide, up, INFINITY);
    hg_irradiance_guide_add(guide, (const float[3]){NAN, 0, 0}, 1); // nor is anything hurt
    assert_true(isfinite(guide->all) && guide->all < before / 8);

    hg_irradiance_guides_clear(&guides);
    uint32_t made = 0;
    for (uint64_t key = 1; key <= 2 * HG_GUIDES; key++)
        made += hg_irradiance_guide_ask(&guides, key, 3, 1) != NULL;
    assert_true(made > HG_GUIDES / 2 && made <= HG_GUIDES); // those in use stay
    assert_non_null(hg_irradiance_guide_ask(&guides, 2 * HG_GUIDES + 1, 1000, 1)); // long after
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_integrals),
        cmocka_unit_test(test_guided_integrals), cmocka_unit_test(test_guides_take_noise_away),
        cmocka_unit_test(test_densities), cmocka_unit_test(test_guides_know_and_forget)};
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
