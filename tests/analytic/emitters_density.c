// emitters_density.c - the densities of lib/emitters.glsl: those that come with samples, those that
// are asked for, and how often each light and direction is really chosen.
#include "tests/analytic/emitters_rig.h"

#include <math.h>
#include <string.h>

#include "base/alloc.h"
#include "renderer/light/emitters/light_tree.h"
#include "tests/support/check.h"

#define ONES 65536

static void take_ones(struct rig *r, const float p[3], const float n[3], struct hg_vec4 *out)
{
    struct hg_vec4 *in = hg_calloc(ONES, 2 * sizeof *in);
    assert_non_null(in);
    for (uint32_t i = 0; i < ONES; i++) {
        in[2 * i] = (struct hg_vec4){p[0], p[1], p[2], 0};
        in[2 * i + 1] = (struct hg_vec4){n[0], n[1], n[2], 0};
    }
    rig_run(r, OP_ONE, ONES, in, out);
    hg_free(in);
}

// The density that comes with a sample is that of the pdf functions.
static void test_pdf_is_that_of_pick(void **state)
{
    (void)state;
    static struct rig r;
    const float center[3] = {0, 1, 0}, ball[3] = {2, 1, 1}, p[3] = {0.3f, 0, 0.1f};
    struct hg_vec4 *out = hg_calloc(ONES, 2 * sizeof *out);
    assert_non_null(out);
    for (int budget = 0; budget < 2; budget++) {
        rig_open(&r);
        r.budget_bytes = budget ? 60000 : 0;
        rig_add_ceiling(&r, center, 0.2f, 0.2f, 4, 5);
        rig_add_sphere(&r, ball, 0.3f, 24, 2);
        rig_add_lights(&r, 50, 6, 3);
        rig_set_image(&r, 512, 3000, 0.2f);
        const struct hg_emitters_stats stats = rig_sync(&r);
        assert_true(budget == 0 ? stats.run == 1 : stats.run > 1);
        take_ones(&r, p, up, out);
        uint32_t differ = 0, kinds[8] = {0};
        double worst = 0;
        for (uint32_t i = 0; i < ONES; i++) {
            const double pdf = (double)out[2 * i].w, again = (double)out[2 * i + 1].w;
            kinds[(uint32_t)out[2 * i + 1].z & 7]++;
            if (!(pdf > 0))
                continue;
            const double off = fabs(again / pdf - 1);
            differ += off > 1e-3; // directions within rounding of the border of a cell
            worst = off < 1e-3 ? fmax(worst, off) : worst;
        }
        print_message("densities agree within %.1e, %u of %d on borders; environment %u, delta %u, "
                      "triangles %u\n",
            worst, differ, ONES, kinds[2], kinds[1], kinds[4]);
        assert_true(differ * 1000 < ONES);
        assert_true(kinds[2] > 1000 && kinds[1] > 1000 && kinds[4] > 1000);
        rig_close(&r);
    }
    hg_free(out);
}

// Chi-square of counts against expected ones; bins of few are put together. Wilson and Hilferty
// 1931 for the limit: one chance in 10^5.
static void expect_chi_square(
    const char *what, const double *counts, const double *expected, uint32_t n)
{
    double sum = 0, rest_count = 0, rest = 0;
    uint32_t bins = 0;
    for (uint32_t i = 0; i < n; i++) {
        rest_count += counts[i];
        rest += expected[i];
        if (rest < 10)
            continue;
        sum += (rest_count - rest) * (rest_count - rest) / rest;
        rest_count = rest = 0;
        bins++;
    }
    const double k = bins - 1, z = 4.265, t = 1 - 2 / (9 * k) + z * sqrt(2 / (9 * k));
    print_message("%s: chi-square %.1f of %u bins, limit %.1f\n", what, sum, bins, k * t * t * t);
    assert_true(bins > 10 && sum < k * t * t * t);
}

static void test_leaves_by_their_chance(void **state)
{
    (void)state;
    static struct rig r;
    const float ball[3] = {2, 1, 1}, p[3] = {0.3f, 0, 0.1f};
    rig_open(&r);
    rig_add_sphere(&r, ball, 0.6f, 12, 2);
    const struct hg_emitters_stats stats = rig_sync(&r);
    const uint32_t leaves = r.block.leaf_count;
    assert_int_equal(stats.run, 1);
    struct hg_vec4 *in = hg_calloc(leaves, 2 * sizeof *in),
                   *chances = hg_calloc(leaves, sizeof *in);
    struct hg_vec4 *out = hg_calloc(ONES, 2 * sizeof *out);
    double *counts = hg_calloc(leaves, sizeof *counts),
           *expected = hg_calloc(leaves, sizeof *counts);
    assert_true(in && chances && out && counts && expected);
    for (uint32_t i = 0; i < leaves; i++) {
        in[2 * i] = (struct hg_vec4){p[0], p[1], p[2], (float)i};
        in[2 * i + 1] = (struct hg_vec4){up[0], up[1], up[2], 0};
    }
    rig_run(&r, OP_CHANCE, leaves, in, chances);
    take_ones(&r, p, up, out);
    double total = 0, missed = 0, rare = 0;
    for (uint32_t i = 0; i < leaves; i++) {
        expected[i] = (double)chances[i].x * ONES;
        total += (double)chances[i].x;
    }
    for (uint32_t i = 0; i < ONES; i++) {
        const uint32_t triangle = (uint32_t)out[2 * i + 1].y;
        if ((double)out[2 * i + 1].x > 1e6) // nothing was chosen
            missed++;
        else
            counts[triangle]++;
    }
    for (uint32_t i = 0; i < leaves; i++)
        rare += expected[i] == 0.0 ? counts[i] : 0;
    assert_true(rare == 0.0);
    assert_true(total <= 1 + 1e-4);
    probe_near(missed / ONES, 1 - total, 0.01);
    expect_chi_square("leaves", counts, expected, leaves);
    hg_free(in);
    hg_free(chances);
    hg_free(out);
    hg_free(counts);
    hg_free(expected);
    rig_close(&r);
}

// Directions over the sphere as often as the density says; the density integrates to 1.
static void test_environment_histogram(void **state)
{
    (void)state;
    enum {
        COLUMNS = 48,
        ROWS = 24,
        FINE = 16,
        CELLS = COLUMNS * ROWS,
        PLACES = CELLS * FINE * FINE
    };
    static struct rig r;
    static double counts[CELLS], expected[CELLS];
    const float p[3] = {0, 0, 0};
    rig_open(&r);
    rig_set_image(&r, 256, 50, 0.3f);
    r.probe.scene->environment.rotation_rad = 0;
    rig_sync(&r);
    struct hg_vec4 *in = hg_calloc(PLACES, 2 * sizeof *in),
                   *densities = hg_calloc(PLACES, sizeof *in);
    struct hg_vec4 *out = hg_calloc(ONES, 2 * sizeof *out);
    assert_true(in && densities && out);
    for (uint32_t i = 0; i < PLACES; i++) {
        const double u = (i % (COLUMNS * FINE) + 0.5) / (COLUMNS * FINE);
        const double v = (i / (COLUMNS * FINE) + 0.5) / (ROWS * FINE);
        const double theta = PI * v, phi = 2 * PI * (u - 0.5);
        in[2 * i] = (struct hg_vec4){
            (float)(sin(theta) * cos(phi)), (float)cos(theta), (float)(sin(theta) * sin(phi)), 0};
    }
    rig_run(&r, OP_ENVIRONMENT, PLACES, in, densities);
    double total = 0;
    memset(counts, 0, sizeof counts);
    memset(expected, 0, sizeof expected);
    for (uint32_t i = 0; i < PLACES; i++) {
        const uint32_t x = i % (COLUMNS * FINE) / FINE, row = i / (COLUMNS * FINE);
        const double angle = 2 * PI / (COLUMNS * FINE) *
                             (cos(PI * row / (ROWS * FINE)) - cos(PI * (row + 1) / (ROWS * FINE)));
        expected[row / FINE * COLUMNS + x] += (double)densities[i].y * angle * ONES;
        total += (double)densities[i].y * angle;
    }
    probe_near(total, 1, 0.002);
    take_ones(&r, p, everywhere, out);
    for (uint32_t i = 0; i < ONES; i++) {
        const struct hg_vec4 d = out[2 * i];
        const double u = atan2((double)d.z, (double)d.x) / (2 * PI) + 0.5;
        const double v = acos(fmax(-1, fmin(1, (double)d.y))) / PI;
        counts[(uint32_t)fmin(ROWS - 1, v * ROWS) * COLUMNS +
               (uint32_t)fmin(COLUMNS - 1, u * COLUMNS)]++;
    }
    expect_chi_square("directions", counts, expected, CELLS);
    hg_free(in);
    hg_free(densities);
    hg_free(out);
    rig_close(&r);
}

int main(int argc, char **argv)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_pdf_is_that_of_pick),
        cmocka_unit_test(test_leaves_by_their_chance),
        cmocka_unit_test(test_environment_histogram),
    };
    if (argc > 1)
        cmocka_set_test_filter(argv[1]);
    return cmocka_run_group_tests(tests, rig_setup, rig_teardown);
}
