// Automatic exposure from arrays: the histogram against closed forms, and what counts in a picture.
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "renderer/camera/exposure.h"

#define NEAR(a, b) assert_true(fabs((double)(a) - (double)(b)) < 1e-9)

static double mean_of(const struct hg_exposure_histogram *h, double floor, double low, double high)
{
    double stops;
    assert_true(hg_exposure_histogram_mean(h, floor, low, high, &stops));
    return stops;
}

// Luminances 2^0, 2^1, ... 2^9 with one weight each: percentiles cut between and through them.
static void test_histogram(void **state)
{
    (void)state;
    static struct hg_exposure_histogram h;
    memset(&h, 0, sizeof h);
    for (int i = 0; i < 10; i++)
        hg_exposure_histogram_add(&h, exp2(i), 3);
    NEAR(h.total, 30);
    NEAR(mean_of(&h, HG_EXPOSURE_LOW_STOPS, 0, 1), 4.5);
    NEAR(mean_of(&h, HG_EXPOSURE_LOW_STOPS, 0.5, 1), 7);
    NEAR(mean_of(&h, HG_EXPOSURE_LOW_STOPS, 0.2, 0.3), 2);
    // 0.55 to 0.95: half of 5, all of 6, 7 and 8, half of 9
    NEAR(mean_of(&h, HG_EXPOSURE_LOW_STOPS, 0.55, 0.95), (0.5 * 5 + 6 + 7 + 8 + 0.5 * 9) / 4);
    // above the floor 6, 7, 8 and 9 are left
    NEAR(mean_of(&h, 5.5, 0, 0.5), 6.5);
}

// A mean is exact within a bin, and black and broken values count as black.
static void test_histogram_edges(void **state)
{
    (void)state;
    static struct hg_exposure_histogram h;
    double stops;
    memset(&h, 0, sizeof h);
    assert_false(hg_exposure_histogram_mean(&h, HG_EXPOSURE_LOW_STOPS, 0, 1, &stops));
    const double black[] = {0, -1, NAN, INFINITY, 1e-30};
    for (size_t i = 0; i < sizeof black / sizeof *black; i++)
        hg_exposure_histogram_add(&h, black[i], 1);
    NEAR(h.total, 5);
    assert_false(hg_exposure_histogram_mean(&h, HG_EXPOSURE_LOW_STOPS, 0, 1, &stops));
    hg_exposure_histogram_add(&h, 0.18, 1);
    NEAR(mean_of(&h, HG_EXPOSURE_LOW_STOPS, 0, 1), log2(0.18));
    hg_exposure_histogram_add(&h, 1e30, 1);
    NEAR(mean_of(&h, 0, 0, 1), HG_EXPOSURE_HIGH_STOPS);
}

// The definition, "sunny 16", and what a stop is of each setting; white is 1.
static void test_camera(void **state)
{
    (void)state;
    NEAR(hg_exposure_ev100(1, 1, 100), 0);
    NEAR(hg_exposure_ev100(16, 1.0 / 128, 100), 15);
    NEAR(hg_exposure_ev100(16, 1.0 / 128, 400), 13);
    assert_true(fabs((double)hg_exposure_of_camera(16, 1.0 / 128, 100) + 15 + log2(1.2)) < 1e-6);
    const float ev = hg_exposure_of_camera(4, 0.02, 200);
    assert_true(fabsf(hg_exposure_of_camera(8, 0.08, 200) - ev) < 1e-5f);
    assert_true(fabsf(hg_exposure_of_camera(4, 0.04, 200) - ev - 1) < 1e-5f);
    assert_true(fabsf(hg_exposure_of_camera(4, 0.02, 400) - ev - 1) < 1e-5f);
}

// After one time constant the rest is 1/e of the way, by the rate of its direction; two steps are
// as one; it arrives, and goes no further.
static void test_adapt(void **state)
{
    (void)state;
    const float dark = hg_exposure_adapt(-4, 4, HG_EXPOSURE_TO_DARK_S);
    const float bright = hg_exposure_adapt(4, -4, HG_EXPOSURE_TO_BRIGHT_S);
    assert_true(fabs((double)dark - (4 - 8 * exp(-1))) < 1e-6);
    assert_true(fabs((double)bright + (4 - 8 * exp(-1))) < 1e-6);
    const float once = hg_exposure_adapt(-4, 4, 0.5);
    const float twice = hg_exposure_adapt(hg_exposure_adapt(-4, 4, 0.2), 4, 0.3);
    assert_true(fabsf(once - twice) < 1e-5f && once < 4);
    assert_true(hg_exposure_adapt(1, 2, 0) == 1 && hg_exposure_adapt(1, 2, -1) == 1);
    assert_true(hg_exposure_adapt(1, 2, 3) == 2 && hg_exposure_adapt(2, 2, 0) == 2);
}

static void test_of_light(void **state)
{
    (void)state;
    static const double rows[][2] = {{0, 0}, {1, 0}, {-1, 0}, {2, -2}, {-2, 2}, {1.5, -0.75},
        {8.25, -8.25}, {-6.5, 6.5}, {8.26, -8.25}, {40, HG_EXPOSURE_LEAST_EV},
        {-40, HG_EXPOSURE_MOST_EV}};
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++)
        NEAR(hg_exposure_of_light(rows[i][0]), rows[i][1]);
    for (double stops = -30; stops < 30; stops += 0.01) // continuous, and never the wrong way
        assert_true(hg_exposure_of_light(stops) >= hg_exposure_of_light(stops + 0.01));
}

enum { PIXELS = 1000, WIDTH = 50 };

static float color[PIXELS][4], albedo[PIXELS][3], emission[PIXELS][3];

static void fill(int from, int to, float light, float reflectance, float emitted)
{
    for (int i = from; i < to; i++) {
        for (int c = 0; c < 3; c++) {
            albedo[i][c] = reflectance;
            emission[i][c] = emitted;
            color[i][c] = light * reflectance + emitted;
        }
        color[i][3] = 1;
    }
}

static float metered_as(double sun_stops, double spread_px)
{
    return hg_exposure_of_picture(&(struct hg_exposure_picture){
        WIDTH, PIXELS / WIDTH, &color[0][0], &albedo[0][0], &emission[0][0], sun_stops, spread_px});
}

static float metered_under(double sun_stops)
{
    return metered_as(sun_stops, 0);
}

static float metered(void)
{
    return metered_under(-INFINITY);
}

static void clear(void)
{
    memset(color, 0, sizeof color);
    memset(albedo, 0, sizeof albedo);
    memset(emission, 0, sizeof emission);
}

// White, grey and black cards under the same light get the same exposure.
static void test_cards(void **state)
{
    (void)state;
    for (int i = 0; i < 3; i++) {
        const float cards[] = {0.9f, 0.18f, 0.06f};
        clear();
        fill(0, PIXELS, 64, cards[i], 0);
        NEAR(metered(), -6);
        fill(0, PIXELS, 0.0625f, cards[i], 0);
        NEAR(metered(), 4);
        fill(0, PIXELS, 1.2f, cards[i], 0); // as glTF has its light
        NEAR(metered(), 0);
    }
}

// A small object: what is around it has no coverage, however bright it is.
static void test_background(void **state)
{
    (void)state;
    clear();
    fill(0, 30, 16, 0.5f, 0);
    for (int i = 30; i < PIXELS; i++)
        color[i][0] = color[i][1] = color[i][2] = 1000;
    NEAR(metered(), -4);
    for (int i = 0; i < 30; i++) // antialiased: all are means over the pixel
        for (int c = 0; c < 4; c++) {
            color[i][c] *= 0.25f;
            albedo[i][c % 3] *= c < 3 ? 0.25f : 1;
        }
    NEAR(metered(), -4);
}

// Lamps in a dark room: the lit part counts, neither the lamps nor the shadows do.
static void test_night(void **state)
{
    (void)state;
    clear();
    fill(0, 600, 1e-4f, 0.5f, 0);
    fill(600, 980, 32, 0.5f, 0);
    fill(980, PIXELS, 32, 0.5f, 1e6f);
    NEAR(metered(), -5);
}

static void test_emitters(void **state)
{
    (void)state;
    clear();
    for (int i = 0; i < PIXELS; i++) // unlit materials emit their base colour
        fill(i, i + 1, 0, 0.1f + 0.8f * (float)i / PIXELS, 0.1f + 0.8f * (float)i / PIXELS);
    NEAR(metered(), 0);
    fill(0, PIXELS, 0, 0, 64); // a screen that is black when it is off
    NEAR(metered(), -6);
}

// Light in open shade is exposed for as the sun's is; far below it the sun does not matter.
static void test_shade(void **state)
{
    (void)state;
    clear();
    fill(0, PIXELS, 0.25f, 0.5f, 0);
    NEAR(metered(), 2);
    NEAR(metered_under(0), 0);
    NEAR(metered_under(-2.5), 2); // what is brighter than the sun's light
    NEAR(metered_under(-1), 0);
    fill(0, PIXELS, 0x1p-6f, 0.5f, 0);
    NEAR(metered_under(0), 6);
    NEAR(metered_under(-3.5), 3.5);             // a low sun
    for (double sun = -8; sun < 4; sun += 0.01) // continuous
        assert_true(fabs(metered_under(sun) - metered_under(sun + 0.01)) < 0.1);
}

// One sample in 16 brings all the light: the mean is what counts, not the samples that bring it.
// Neither a caustic's one path nor black pixels around what is lit change that.
static void test_noise(void **state)
{
    (void)state;
    uint32_t random = 1;
    clear();
    for (int i = 0; i < PIXELS; i++) {
        random = random * 1664525u + 1013904223u;
        fill(i, i + 1, random >> 28 == 0 ? 0x1p-2f : 0, i % 3 ? 0.5f : 0.1f, 0);
    }
    print_message("light 2^-6 by one pixel in 16: %.3f EV, %.3f as it is\n",
        (double)metered_as(-INFINITY, 1.5), (double)metered());
    assert_true(metered() < 3);
    assert_true(fabsf(metered_as(-INFINITY, 1.5) - 5.5f) < 0.5f); // the bright part of what is left
    fill(0, PIXELS, 64, 0.5f, 0);
    NEAR(metered_as(-INFINITY, 1.5), -6); // to the corners
    fill(525, 526, 1e8f, 0.5f, 0);
    assert_true(fabsf(metered_as(-INFINITY, 1.5) + 6) < 0.2f);
    clear();
    fill(100, 130, 16, 0.5f, 0);
    NEAR(metered_as(-INFINITY, 4), -4);
    color[115][0] = NAN;
    assert_true(fabsf(metered_as(-INFINITY, 4) + 4) < 0.2f);
}

static void test_nothing(void **state)
{
    (void)state;
    clear();
    NEAR(metered(), 0); // no geometry
    fill(0, PIXELS, 0, 0.5f, 0);
    NEAR(metered(), 0); // no light
    color[7][0] = NAN;
    NEAR(metered(), 0);
    assert_true(isfinite(metered()));
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_histogram),
        cmocka_unit_test(test_histogram_edges), cmocka_unit_test(test_camera),
        cmocka_unit_test(test_adapt), cmocka_unit_test(test_of_light), cmocka_unit_test(test_cards),
        cmocka_unit_test(test_background), cmocka_unit_test(test_night),
        cmocka_unit_test(test_emitters), cmocka_unit_test(test_shade), cmocka_unit_test(test_noise),
        cmocka_unit_test(test_nothing)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
