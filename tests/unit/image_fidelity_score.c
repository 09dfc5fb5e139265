// image_fidelity_score.c - the distance of the fidelity test against values known by hand.
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <math.h>
#include <string.h>
#include <cmocka.h>

#include "tests/fidelity/score.h"

static struct hg_image filled(uint32_t width, uint32_t height, uint8_t level, uint8_t alpha)
{
    struct hg_image image;
    assert_int_equal(hg_image_create(width, height, HG_PIXEL_RGBA8, NULL, &image), HG_OK);
    for (size_t i = 0; i < image.size_bytes; i++)
        ((uint8_t *)image.pixels)[i] = i % 4 == 3 ? alpha : level;
    return image;
}

static void near_to(double got, double want, double slack)
{
    if (!(fabs(got - want) <= slack))
        fail_msg("%.9g is not %.9g (within %g)", got, want, slack);
}

static void greys_have_closed_forms(void **state)
{
    (void)state;
    struct hg_image black = filled(8, 8, 0, 255), white = filled(8, 8, 255, 255);
    struct hg_image grey = filled(8, 8, 100, 255), near_grey = filled(8, 8, 110, 255);
    near_to(score_db(&black, &black), -100, 0);
    // Grey levels differ in Y alone: 0.5053 * 255^2 of 35215.
    near_to(score_db(&black, &white), 10 * log10(0.5053 * 255 * 255 / 35215), 1e-6);
    near_to(score_db(&grey, &near_grey), 10 * log10(0.5053 * 100 / 35215), 1e-6);
    hg_image_finish(&black);
    hg_image_finish(&white);
    hg_image_finish(&grey);
    hg_image_finish(&near_grey);
}

static void transparent_pixels_are_left_out(void **state)
{
    (void)state;
    struct hg_image a = filled(8, 8, 0, 255), b = filled(8, 8, 0, 255);
    memset(a.pixels, 0, a.size_bytes / 2); // the upper half of `a` is missing
    near_to(score_db(&a, &b), -100, 0);    // the published metric does not see it
    double half = 10 * log10(sqrt(0.5) * 0.5053 * 255 * 255 / 35215);
    near_to(score_db(&b, &a), half, 1e-6);
    near_to(score_distance(&a, &b), half, 1e-6);
    near_to(score_distance(&b, &a), half, 1e-6);
    struct hg_image none = filled(8, 8, 0, 0);
    assert_true(isnan(score_db(&none, &b)));
    near_to(score_distance(&none, &b), 0, 0);
    near_to(score_distance(&none, &none), -100, 0);
    hg_image_finish(&a);
    hg_image_finish(&b);
    hg_image_finish(&none);
}

static void resizing_keeps_what_it_must(void **state)
{
    (void)state;
    struct hg_image flat = filled(40, 60, 90, 255), small;
    score_resize(&flat, 13, 17, &small);
    for (size_t i = 0; i < small.size_bytes; i++)
        assert_int_equal(((uint8_t *)small.pixels)[i], i % 4 == 3 ? 255 : 90);
    hg_image_finish(&small);
    // Invisible colour does not bleed into what is visible.
    for (size_t i = 0; i < flat.size_bytes; i += 4)
        if (i / 4 % 40 < 20)
            memcpy((uint8_t *)flat.pixels + i, "\xff\x00\xff\x00", 4);
    score_resize(&flat, 20, 30, &small);
    for (size_t i = 0; i < small.size_bytes; i += 4) {
        const uint8_t *px = (uint8_t *)small.pixels + i;
        if (px[3] > 20)
            assert_true(px[0] >= 88 && px[0] <= 92 && px[1] >= 88 && px[2] <= 92);
        if (i / 4 % 20 < 7)
            assert_int_equal(px[3], 0);
    }
    hg_image_finish(&small);
    hg_image_finish(&flat);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(greys_have_closed_forms),
        cmocka_unit_test(transparent_pixels_are_left_out),
        cmocka_unit_test(resizing_keeps_what_it_must),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
