// image_metrics.c - each metric against closed forms, and against what its paper promises.
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <math.h>
#include <string.h>
#include <cmocka.h>

#include "renderer/image/metrics.h"

enum { side = 48 };

static struct hg_image make(uint32_t width, uint32_t height, enum hg_pixel_format format)
{
    struct hg_image image;
    assert_int_equal(hg_image_create(width, height, format, NULL, &image), HG_OK);
    return image;
}

static struct hg_image constant(uint8_t r, uint8_t g, uint8_t b)
{
    struct hg_image image = make(side, side, HG_PIXEL_RGBA8);
    for (size_t i = 0; i < image.size_bytes; i += 4) {
        uint8_t px[4] = {r, g, b, 255};
        memcpy((uint8_t *)image.pixels + i, px, 4);
    }
    return image;
}

// Reproducible noise in 0..255, opaque.
static struct hg_image noise(uint32_t seed)
{
    struct hg_image image = make(side, side, HG_PIXEL_RGBA8);
    for (size_t i = 0; i < image.size_bytes; i++) {
        seed = seed * 1664525u + 1013904223u;
        ((uint8_t *)image.pixels)[i] = i % 4 == 3 ? 255 : (uint8_t)(seed >> 24);
    }
    return image;
}

static double compare(const struct hg_image *a, const struct hg_image *b, enum hg_metric metric)
{
    double value;
    struct hg_error err = {0};
    if (hg_image_compare(&(struct hg_image_pair){a, b, NULL}, metric, &value, NULL, &err))
        fail_msg("%s", err.reason);
    return value;
}

static void near_to(double got, double want, double slack)
{
    if (!(fabs(got - want) <= slack))
        fail_msg("%.9g is not %.9g (within %g)", got, want, slack);
}

static void identical_pictures(void **state)
{
    (void)state;
    struct hg_image a = noise(1);
    near_to(compare(&a, &a, HG_METRIC_PSNR), 999, 0);
    near_to(compare(&a, &a, HG_METRIC_SSIM), 1, 1e-6);
    near_to(compare(&a, &a, HG_METRIC_FLIP), 0, 0);
    near_to(compare(&a, &a, HG_METRIC_RMSE), 0, 0);
    near_to(compare(&a, &a, HG_METRIC_MAX), 0, 0);
    hg_image_finish(&a);
}

static void constant_offsets(void **state)
{
    (void)state;
    struct hg_image a = constant(100, 100, 100), b = constant(117, 100, 90);
    double dr = 17 / 255.0, db = 10 / 255.0, mse = (dr * dr + db * db) / 3;
    near_to(compare(&a, &b, HG_METRIC_PSNR), -10 * log10(mse), 1e-4);
    near_to(compare(&a, &b, HG_METRIC_RMSE), sqrt(mse), 1e-9);
    near_to(compare(&a, &b, HG_METRIC_MAX), dr, 1e-9);
    hg_image_finish(&a);
    hg_image_finish(&b);
}

static void ssim_of_constants(void **state)
{
    (void)state;
    // Variances are 0: only the luminance term is left.
    struct hg_image a = constant(51, 51, 51), b = constant(204, 204, 204);
    double ma = 0.2, mb = 0.8, c1 = 1e-4;
    near_to(compare(&a, &b, HG_METRIC_SSIM), (2 * ma * mb + c1) / (ma * ma + mb * mb + c1), 1e-3);
    hg_image_finish(&a);
    hg_image_finish(&b);
}

static void ssim_of_a_negative(void **state)
{
    (void)state;
    // Means near 1/2 agree; the structure is the exact opposite, so the mean is near -1.
    struct hg_image a = noise(3), b = noise(3);
    uint8_t *px = b.pixels;
    for (size_t i = 0; i < b.size_bytes; i++)
        px[i] = i % 4 == 3 ? 255 : (uint8_t)(255 - px[i]);
    double s = compare(&a, &b, HG_METRIC_SSIM);
    assert_true(s < -0.9 && s > -1.0);
    struct hg_image c = noise(4);
    assert_true(fabs(compare(&a, &c, HG_METRIC_SSIM)) < 0.1); // independent noise
    hg_image_finish(&a);
    hg_image_finish(&b);
    hg_image_finish(&c);
}

// FLIP of two flat fields has no edges and survives the filters: it is the redistributed colour
// distance. Computed here in double from the CIE definitions.
static double lab_f(double t)
{
    double d = 6.0 / 29;
    return t > d * d * d ? cbrt(t) : t / (3 * d * d) + 4.0 / 29;
}

static void hunt_lab(const double srgb[3], double lab[3])
{
    static const double m[3][3] = {
        {10135552.0 / 24577794, 8788810.0 / 24577794, 4435075.0 / 24577794},
        {2613072.0 / 12288897, 8788810.0 / 12288897, 887015.0 / 12288897},
        {1425312.0 / 73733382, 8788810.0 / 73733382, 70074185.0 / 73733382}};
    double f[3];
    for (int r = 0; r < 3; r++) {
        double sum = 0, white = 0;
        for (int c = 0; c < 3; c++) {
            double v = srgb[c];
            v = v <= 0.04045 ? v / 12.92 : pow((v + 0.055) / 1.055, 2.4);
            sum += m[r][c] * v;
            white += m[r][c];
        }
        f[r] = lab_f(sum / white);
    }
    lab[0] = 116 * f[1] - 16;
    lab[1] = 0.01 * lab[0] * 500 * (f[0] - f[1]);
    lab[2] = 0.01 * lab[0] * 200 * (f[1] - f[2]);
}

static double color_distance(const double a[3], const double b[3])
{
    double la[3], lb[3];
    hunt_lab(a, la);
    hunt_lab(b, lb);
    return pow(fabs(la[0] - lb[0]) + hypot(la[1] - lb[1], la[2] - lb[2]), 0.7);
}

static double flat_flip(const double a[3], const double b[3])
{
    const double green[3] = {0, 1, 0}, blue[3] = {0, 0, 1};
    double largest = color_distance(green, blue), d = color_distance(a, b), knee = 0.4 * largest;
    return d < knee ? 0.95 / knee * d : 0.95 + (d - knee) / (largest - knee) * 0.05;
}

static void flip_of_flat_fields(void **state)
{
    (void)state;
    static const uint8_t colors[][3] = {
        {0, 0, 0}, {255, 255, 255}, {0, 255, 0}, {0, 0, 255}, {128, 120, 100}, {130, 118, 101}};
    for (size_t i = 0; i < 6; i++)
        for (size_t j = 0; j < 6; j++) {
            const uint8_t *ci = colors[i], *cj = colors[j];
            double a[3] = {ci[0] / 255.0, ci[1] / 255.0, ci[2] / 255.0};
            double b[3] = {cj[0] / 255.0, cj[1] / 255.0, cj[2] / 255.0};
            struct hg_image ia = constant(ci[0], ci[1], ci[2]), ib = constant(cj[0], cj[1], cj[2]);
            double want = i == j ? 0 : flat_flip(a, b);
            near_to(compare(&ia, &ib, HG_METRIC_FLIP), want, 0.004);
            hg_image_finish(&ia);
            hg_image_finish(&ib);
        }
    const double green[3] = {0, 1, 0}, blue[3] = {0, 0, 1};
    near_to(flat_flip(green, blue), 1, 1e-12); // the largest difference by definition
}

static struct hg_image transposed(const struct hg_image *a)
{
    struct hg_image t = make(a->height, a->width, HG_PIXEL_RGBA8);
    for (uint32_t y = 0; y < a->height; y++)
        for (uint32_t x = 0; x < a->width; x++)
            memcpy((uint8_t *)t.pixels + ((size_t)x * t.width + y) * 4,
                (uint8_t *)a->pixels + ((size_t)y * a->width + x) * 4, 4);
    return t;
}

static void flip_has_no_direction(void **state)
{
    (void)state;
    struct hg_image a = noise(5), b = noise(6), at = transposed(&a), bt = transposed(&b);
    double ab = compare(&a, &b, HG_METRIC_FLIP);
    assert_true(ab > 0.05 && ab < 1);
    near_to(compare(&b, &a, HG_METRIC_FLIP), ab, 1e-6);
    near_to(compare(&at, &bt, HG_METRIC_FLIP), ab, 1e-5);
    hg_image_finish(&a);
    hg_image_finish(&b);
    hg_image_finish(&at);
    hg_image_finish(&bt);
}

// A checkerboard of single pixels is beyond the eye at 67 px per degree: against its mean grey in
// linear light it must look far closer than black against white does.
static void flip_does_not_see_fine_patterns(void **state)
{
    (void)state;
    struct hg_image fine = constant(0, 0, 0), coarse = constant(0, 0, 0);
    struct hg_image grey = constant(188, 188, 188);
    for (uint32_t y = 0; y < side; y++)
        for (uint32_t x = 0; x < side; x++) {
            size_t i = ((size_t)y * side + x) * 4;
            memset((uint8_t *)fine.pixels + i, (x + y) % 2 ? 255 : 0, 3);
            memset((uint8_t *)coarse.pixels + i, (x / 12 + y / 12) % 2 ? 255 : 0, 3);
        }
    double f = compare(&grey, &fine, HG_METRIC_FLIP), c = compare(&grey, &coarse, HG_METRIC_FLIP);
    assert_true(f < 0.35 * c);
    hg_image_finish(&fine);
    hg_image_finish(&coarse);
    hg_image_finish(&grey);
}

static void alpha_is_over_black(void **state)
{
    (void)state;
    struct hg_image a = constant(200, 100, 50), b = constant(0, 0, 0);
    for (size_t i = 3; i < a.size_bytes; i += 4)
        ((uint8_t *)a.pixels)[i] = 0;
    near_to(compare(&a, &b, HG_METRIC_PSNR), 999, 0);
    near_to(compare(&a, &b, HG_METRIC_FLIP), 0, 0);
    near_to(compare(&a, &b, HG_METRIC_MAX), 1, 0); // alpha itself differs
    near_to(compare(&a, &b, HG_METRIC_RMSE), 0.5, 1e-9);
    hg_image_finish(&a);
    hg_image_finish(&b);
}

static void floats_and_bytes_agree(void **state)
{
    (void)state;
    struct hg_image a = noise(7), b = noise(8);
    struct hg_image fa = make(side, side, HG_PIXEL_RGBA32F);
    struct hg_image fb = make(side, side, HG_PIXEL_RGBA32F);
    for (size_t i = 0; i < a.size_bytes; i++) {
        ((float *)fa.pixels)[i] = (float)((uint8_t *)a.pixels)[i] / 255.0f;
        ((float *)fb.pixels)[i] = (float)((uint8_t *)b.pixels)[i] / 255.0f;
    }
    for (int m = HG_METRIC_PSNR; m <= HG_METRIC_MAX; m++)
        near_to(compare(&fa, &fb, (enum hg_metric)m), compare(&a, &b, (enum hg_metric)m), 1e-5);
    ((float *)fb.pixels)[0] = NAN;
    assert_true(isinf(compare(&fa, &fb, HG_METRIC_MAX)));
    hg_image_finish(&a);
    hg_image_finish(&b);
    hg_image_finish(&fa);
    hg_image_finish(&fb);
}

static void heat_map_shows_where(void **state)
{
    (void)state;
    struct hg_image a = constant(90, 90, 90), b = constant(90, 90, 90), diff;
    ((uint8_t *)b.pixels)[(20 * side + 30) * 4] = 255;
    double value;
    struct hg_error err = {0};
    assert_int_equal(
        hg_image_compare(&(struct hg_image_pair){&a, &b, NULL}, HG_METRIC_MAX, &value, &diff, &err),
        HG_OK);
    const uint8_t *px = diff.pixels;
    for (size_t i = 0; i < (size_t)side * side; i++)
        assert_int_equal(px[i * 4] > 0, i == 20 * side + 30);
    hg_image_finish(&diff);
    hg_image_finish(&a);
    hg_image_finish(&b);
}

static void unlike_pictures_are_refused(void **state)
{
    (void)state;
    struct hg_image a = make(4, 4, HG_PIXEL_RGBA8), b = make(4, 5, HG_PIXEL_RGBA8);
    struct hg_image c = make(4, 4, HG_PIXEL_RGBA32F);
    double value;
    struct hg_error err = {0};
    assert_int_equal(
        hg_image_compare(&(struct hg_image_pair){&a, &b, NULL}, HG_METRIC_MAX, &value, NULL, &err),
        HG_E_INVAL);
    assert_string_equal(err.where, "size");
    assert_int_equal(
        hg_image_compare(&(struct hg_image_pair){&a, &c, NULL}, HG_METRIC_MAX, &value, NULL, &err),
        HG_E_INVAL);
    assert_string_equal(err.where, "format");
    hg_image_finish(&a);
    hg_image_finish(&b);
    hg_image_finish(&c);
}

static void tiny_pictures_are_measured(void **state)
{
    (void)state;
    for (uint32_t w = 1; w <= 13; w += 3)
        for (uint32_t h = 1; h <= 13; h += 3) {
            struct hg_image a = make(w, h, HG_PIXEL_RGBA8), b = make(w, h, HG_PIXEL_RGBA8);
            memset(a.pixels, 255, a.size_bytes);
            memset(b.pixels, 255, b.size_bytes);
            near_to(compare(&a, &b, HG_METRIC_SSIM), 1, 1e-5);
            near_to(compare(&a, &b, HG_METRIC_FLIP), 0, 0);
            for (size_t i = 0; i < b.size_bytes; i++)
                ((uint8_t *)b.pixels)[i] = i % 4 == 3 ? 255 : 0;
            assert_true(compare(&a, &b, HG_METRIC_SSIM) < 0.01);
            assert_true(compare(&a, &b, HG_METRIC_FLIP) > 0.9);
            hg_image_finish(&a);
            hg_image_finish(&b);
        }
}

// Pixels that a mask leaves out change no metric, and means are those of the others.
static void masks(void **state)
{
    (void)state;
    static const enum hg_metric all[] = {
        HG_METRIC_PSNR, HG_METRIC_SSIM, HG_METRIC_FLIP, HG_METRIC_RMSE, HG_METRIC_MAX};
    struct hg_image a = constant(100, 100, 100), b = constant(100, 100, 100);
    struct hg_image mask = constant(255, 255, 255), small = make(side, side - 1, HG_PIXEL_RGBA8);
    struct hg_error err = {0};
    double value, rmse;
    // The left half differs by 51 levels, the upper quarter of the left half by 102.
    for (uint32_t y = 0; y < side; y++)
        for (uint32_t x = 0; x < side / 2; x++) {
            const size_t at = ((size_t)y * side + x) * 4;
            for (int c = 0; c < 3; c++) {
                ((uint8_t *)b.pixels)[at + c] = y < side / 4 ? 202 : 151;
                ((uint8_t *)mask.pixels)[at + c] = y < side / 4 ? 127 : 128; // about half
            }
        }
    const struct hg_image_pair pair = {&a, &b, &mask};
    assert_int_equal(hg_image_compare(&pair, HG_METRIC_MAX, &value, NULL, &err), HG_OK);
    near_to(value, 0.2, 1e-9);
    assert_int_equal(hg_image_compare(&pair, HG_METRIC_RMSE, &rmse, NULL, &err), HG_OK);
    near_to(rmse, sqrt(0.04 * 3 / 7), 1e-9); // 3 of the 7 eighths that count
    assert_int_equal(hg_image_compare(&pair, HG_METRIC_PSNR, &value, NULL, &err), HG_OK);
    near_to(value, -20 * log10(rmse), 1e-4);
    // All of the difference left out: the pictures are the same.
    for (size_t i = 0; i < mask.size_bytes; i += 4)
        ((uint8_t *)mask.pixels)[i + 1] = (i / 4) % side < side / 2 ? 0 : 255;
    for (size_t i = 0; i < sizeof all / sizeof *all; i++) {
        assert_int_equal(hg_image_compare(&pair, all[i], &value, NULL, &err), HG_OK);
        near_to(value, compare(&a, &a, all[i]), 1e-6);
    }
    memset(mask.pixels, 0, mask.size_bytes);
    assert_int_equal(hg_image_compare(&pair, HG_METRIC_PSNR, &value, NULL, &err), HG_E_INVAL);
    assert_string_equal(err.reason, "leaves no pixel");
    const struct hg_image_pair other = {&a, &b, &small};
    assert_int_equal(hg_image_compare(&other, HG_METRIC_PSNR, &value, NULL, &err), HG_E_INVAL);
    assert_string_equal(err.where, "mask");
    hg_image_finish(&a);
    hg_image_finish(&b);
    hg_image_finish(&mask);
    hg_image_finish(&small);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(identical_pictures),
        cmocka_unit_test(masks),
        cmocka_unit_test(constant_offsets),
        cmocka_unit_test(ssim_of_constants),
        cmocka_unit_test(ssim_of_a_negative),
        cmocka_unit_test(flip_of_flat_fields),
        cmocka_unit_test(flip_has_no_direction),
        cmocka_unit_test(flip_does_not_see_fine_patterns),
        cmocka_unit_test(alpha_is_over_black),
        cmocka_unit_test(floats_and_bytes_agree),
        cmocka_unit_test(heat_map_shows_where),
        cmocka_unit_test(unlike_pictures_are_refused),
        cmocka_unit_test(tiny_pictures_are_measured),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
