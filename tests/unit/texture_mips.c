// texture_mips.c - mip chains and page layouts, without a device.
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "base/alloc.h"
#include "renderer/texture/source/half.h"
#include "renderer/texture/source/mips.h"
#include "renderer/texture/source/pages.h"
#include "tests/support/page_cut.h"

static uint32_t random_state = 1;

static uint32_t next_random(void)
{
    random_state = random_state * 1664525u + 1013904223u;
    return random_state >> 8;
}

static struct hg_image make(uint32_t width, uint32_t height)
{
    struct hg_image image;
    assert_int_equal(hg_image_create(width, height, HG_PIXEL_RGBA8, NULL, &image), HG_OK);
    return image;
}

static struct hg_image noise(uint32_t width, uint32_t height)
{
    struct hg_image image = make(width, height);
    for (size_t i = 0; i < image.size_bytes; i++)
        ((uint8_t *)image.pixels)[i] = (uint8_t)next_random();
    return image;
}

static double to_linear(double c)
{
    return c <= 0.04045 ? c / 12.92 : pow((c + 0.055) / 1.055, 2.4);
}

static double to_srgb(double l)
{
    return l <= 0.0031308 ? l * 12.92 : 1.055 * pow(l, 1.0 / 2.4) - 0.055;
}

// A constant image keeps its value in every mip, whatever its size and transfer.
static void test_constant(void **state)
{
    (void)state;
    static const uint32_t sizes[][2] = {{1, 1}, {7, 5}, {128, 128}, {333, 100}, {1, 77}, {129, 2}};
    for (size_t s = 0; s < sizeof sizes / sizeof *sizes; s++) {
        for (int value = 0; value < 256; value += 17) {
            struct hg_image image = make(sizes[s][0], sizes[s][1]);
            memset(image.pixels, value, image.size_bytes);
            struct hg_mips mips;
            assert_int_equal(hg_mips_build(&image,
                                 &(struct hg_mips_params){
                                     .srgb = s % 2 == 0, .use = HG_TEXTURE_COLOR, .cutoff = 0.0f},
                                 &mips),
                HG_OK);
            for (size_t i = 0; i < mips.bytes; i++)
                assert_int_equal(mips.levels[0][i], value);
            hg_mips_finish(&mips);
            hg_image_finish(&image);
        }
    }
}

// Mip 1 against the definition: mean of the linear values under each texel, by exact overlap.
static void check_mip1(uint32_t width, uint32_t height, bool srgb)
{
    struct hg_image image = noise(width, height);
    struct hg_mips mips;
    assert_int_equal(
        hg_mips_build(&image,
            &(struct hg_mips_params){.srgb = srgb, .use = HG_TEXTURE_COLOR, .cutoff = 0.0f}, &mips),
        HG_OK);
    const uint32_t w = hg_mips_side(width, 1), h = hg_mips_side(height, 1);
    const uint8_t *src = image.pixels;
    for (uint32_t y = 0; y < h; y++)
        for (uint32_t x = 0; x < w; x++)
            for (int c = 0; c < 4; c++) {
                const double x0 = (double)x * width / w, x1 = (x + 1.0) * width / w;
                const double y0 = (double)y * height / h, y1 = (y + 1.0) * height / h;
                double sum = 0.0;
                for (uint32_t j = 0; j < height; j++)
                    for (uint32_t i = 0; i < width; i++) {
                        const double ox = fmax(0.0, fmin(x1, i + 1.0) - fmax(x0, i));
                        const double oy = fmax(0.0, fmin(y1, j + 1.0) - fmax(y0, j));
                        const double v = src[(j * width + i) * 4 + c] / 255.0;
                        sum += ox * oy * (srgb && c < 3 ? to_linear(v) : v);
                    }
                sum /= (x1 - x0) * (y1 - y0);
                const double want = 255.0 * (srgb && c < 3 ? to_srgb(sum) : sum);
                assert_true(fabs(mips.levels[1][(y * w + x) * 4 + c] - want) <= 0.51);
            }
    hg_mips_finish(&mips);
    hg_image_finish(&image);
}

static void test_filter(void **state)
{
    (void)state;
    check_mip1(16, 16, true);
    check_mip1(17, 16, true);
    check_mip1(13, 11, false);
    check_mip1(1, 9, true);
    check_mip1(5, 1, false);
    check_mip1(3, 2, true);
}

// The last mip is the mean of the image: nothing is lost or counted twice on the way down.
static void test_mean(void **state)
{
    (void)state;
    struct hg_image image = noise(101, 67);
    double sum = 0.0;
    for (size_t i = 0; i < (size_t)101 * 67; i++)
        sum += to_linear(((uint8_t *)image.pixels)[i * 4] / 255.0);
    struct hg_mips mips;
    assert_int_equal(
        hg_mips_build(&image,
            &(struct hg_mips_params){.srgb = true, .use = HG_TEXTURE_COLOR, .cutoff = 0.0f}, &mips),
        HG_OK);
    assert_int_equal(mips.count, 7);
    assert_true(fabs(mips.levels[6][0] - 255.0 * to_srgb(sum / (101 * 67))) <= 0.6);
    hg_mips_finish(&mips);
    hg_image_finish(&image);
}

static void test_normals(void **state)
{
    (void)state;
    struct hg_image image = noise(50, 30);
    struct hg_mips mips;
    assert_int_equal(
        hg_mips_build(&image,
            &(struct hg_mips_params){.srgb = false, .use = HG_TEXTURE_NORMAL, .cutoff = 0.0f},
            &mips),
        HG_OK);
    for (uint32_t m = 1; m < mips.count; m++) {
        const size_t count = (size_t)hg_mips_side(mips.width, m) * hg_mips_side(mips.height, m);
        for (size_t i = 0; i < count; i++) {
            double length2 = 0.0;
            for (int c = 0; c < 3; c++) {
                const double v = mips.levels[m][i * 4 + c] / 255.0 * 2.0 - 1.0;
                length2 += v * v;
            }
            assert_true(fabs(sqrt(length2) - 1.0) < 0.01);
        }
    }
    hg_mips_finish(&mips);
    hg_image_finish(&image);
}

static double gaussian(void)
{
    double sum = -6.0;
    for (int i = 0; i < 12; i++)
        sum += next_random() / 16777216.0;
    return sum;
}

static double squared_gain(const struct hg_mips *mips, uint32_t mip)
{
    const size_t count = (size_t)hg_mips_side(mips->width, mip) * hg_mips_side(mips->height, mip);
    double sum = 0.0;
    for (size_t i = 0; i < count; i++) {
        const double s = 1.0 - mips->levels[mip][i * 4 + 3] / 255.0;
        sum += s * s;
    }
    return sum / (double)count;
}

// Bumps whose slopes vary by sigma along each axis widen the squared lobe by 2 sigma^2 (Beckmann's
// width of a Gaussian surface) once a mip has averaged them away; a flat map widens nothing.
static void test_lost_variance(void **state)
{
    (void)state;
    for (int k = 0; k < 4; k++) {
        const double sigma = 0.08 * k;
        struct hg_image image = make(256, 256);
        uint8_t *t = image.pixels;
        for (size_t i = 0; i < (size_t)256 * 256; i++, t += 4) {
            const double x = sigma * gaussian(), y = sigma * gaussian();
            const double scale = 0.5 / sqrt(1.0 + x * x + y * y);
            t[0] = (uint8_t)lrint((x * scale + 0.5) * 255.0);
            t[1] = (uint8_t)lrint((y * scale + 0.5) * 255.0);
            t[2] = (uint8_t)lrint((scale + 0.5) * 255.0);
            t[3] = (uint8_t)(i * 7); // a file's own alpha means nothing
        }
        struct hg_mips mips;
        assert_int_equal(
            hg_mips_build(&image, &(struct hg_mips_params){.use = HG_TEXTURE_NORMAL}, &mips),
            HG_OK);
        assert_true(squared_gain(&mips, 0) == 0.0);
        const double last = squared_gain(&mips, mips.count - 1), want = 2.0 * sigma * sigma;
        // kappa counts angles, which are smaller than slopes: 2 sigma^2 less about 3 sigma^4 each.
        assert_true(fabs(last - want * (1.0 - 2.9 * sigma * sigma)) <= 0.04 * want + 1e-5);
        for (uint32_t m = 1; m < mips.count; m++) // what is lost only grows
            assert_true(squared_gain(&mips, m) >= squared_gain(&mips, m - 1) - 0.02 * want - 1e-5);
        hg_mips_finish(&mips);
        hg_image_finish(&image);
    }
}

// A smooth bend (a sphere) keeps its gloss: linear filtering brings its normals back.
static void test_kept_gloss(void **state)
{
    (void)state;
    struct hg_image image = make(256, 256);
    uint8_t *t = image.pixels;
    for (int y = 0; y < 256; y++)
        for (int x = 0; x < 256; x++, t += 4) {
            const double nx = (x - 127.5) / 256.0, ny = (y - 127.5) / 256.0;
            t[0] = (uint8_t)lrint((nx * 0.5 + 0.5) * 255.0);
            t[1] = (uint8_t)lrint((ny * 0.5 + 0.5) * 255.0);
            t[2] = (uint8_t)lrint((sqrt(1.0 - nx * nx - ny * ny) * 0.5 + 0.5) * 255.0);
            t[3] = 255;
        }
    struct hg_mips mips;
    assert_int_equal(
        hg_mips_build(&image, &(struct hg_mips_params){.use = HG_TEXTURE_NORMAL}, &mips), HG_OK);
    for (uint32_t m = 1; m + 3 < mips.count; m++) {
        const double bend = (1 << m) / 256.0; // between texels of the mip
        assert_true(squared_gain(&mips, m) <= 0.1 * 2.0 * bend * bend / 12.0 + 2e-4);
    }
    hg_mips_finish(&mips);
    hg_image_finish(&image);
}

// Leaves: a tenth of the texels pass the cutoff. Plain filtering loses nearly all of them.
static void test_coverage(void **state)
{
    (void)state;
    struct hg_image image = noise(256, 256);
    uint8_t *texels = image.pixels;
    for (size_t i = 0; i < (size_t)256 * 256; i++)
        texels[i * 4 + 3] = next_random() % 10 == 0 ? 255 : 0;
    struct hg_mips masked, plain;
    assert_int_equal(
        hg_mips_build(&image,
            &(struct hg_mips_params){.srgb = true, .use = HG_TEXTURE_MASK, .cutoff = 0.5f},
            &masked),
        HG_OK);
    assert_int_equal(
        hg_mips_build(&image,
            &(struct hg_mips_params){.srgb = true, .use = HG_TEXTURE_COLOR, .cutoff = 0.5f},
            &plain),
        HG_OK);
    for (uint32_t m = 1; m < 5; m++) {
        const size_t count = (size_t)(256 >> m) * (256 >> m);
        size_t with = 0, without = 0;
        for (size_t i = 0; i < count; i++) {
            with += masked.levels[m][i * 4 + 3] >= 128;
            without += plain.levels[m][i * 4 + 3] >= 128;
        }
        // Alpha has few distinct values in the first mips, so the share comes in steps.
        assert_true(fabs((double)with / (double)count - 0.1) < (m == 1 ? 0.25 : 0.1));
        assert_true(m < 2 || without < with / 2);
    }
    hg_mips_finish(&masked);
    hg_mips_finish(&plain);
    hg_image_finish(&image);
}

// Colours of invisible texels do not bleed into the mips of blended textures.
static void test_weighted(void **state)
{
    (void)state;
    struct hg_image image = make(64, 64);
    uint8_t *texels = image.pixels;
    for (size_t i = 0; i < (size_t)64 * 64; i++) {
        const bool red = (i + i / 64) % 2 == 0;
        texels[i * 4] = red ? 255 : 0;
        texels[i * 4 + 1] = red ? 0 : 255;
        texels[i * 4 + 3] = red ? 255 : 0;
    }
    struct hg_mips mips;
    assert_int_equal(
        hg_mips_build(&image,
            &(struct hg_mips_params){.srgb = true, .use = HG_TEXTURE_BLEND, .cutoff = 0.0f}, &mips),
        HG_OK);
    assert_true(mips.levels[1][0] >= 254);
    assert_true(mips.levels[1][1] <= 10);
    assert_in_range(mips.levels[1][3], 127, 128);
    hg_mips_finish(&mips);
    hg_image_finish(&image);
}

static void test_half(void **state)
{
    (void)state;
    for (uint32_t h = 0; h < 0x7c00; h++) { // every finite value comes back
        assert_int_equal(hg_half_from_float(hg_half_to_float((uint16_t)h)), h);
        assert_int_equal(hg_half_from_float(-hg_half_to_float((uint16_t)h)), h | 0x8000u);
    }
    assert_int_equal(hg_half_from_float(1.0f + 0x1p-11f), 0x3c00);            // tie to even
    assert_int_equal(hg_half_from_float(1.0f + 0x1p-11f + 0x1p-20f), 0x3c01); // above the tie
    assert_int_equal(hg_half_from_float(INFINITY), 0x7c00);
    assert_int_equal(hg_half_from_float(1e9f), 0x7c00);
    assert_int_equal(hg_half_from_float(0x1p-24f), 1);
    assert_int_equal(hg_half_from_float(0x1p-26f), 0);
}

static void test_float_image(void **state)
{
    (void)state;
    struct hg_image image;
    assert_int_equal(hg_image_create(2, 2, HG_PIXEL_RGBA32F, NULL, &image), HG_OK);
    float *t = image.pixels;
    for (int i = 0; i < 16; i++)
        t[i] = (float)i;
    t[0] = NAN;
    t[4] = INFINITY;
    struct hg_mips mips;
    assert_int_equal(
        hg_mips_build(&image,
            &(struct hg_mips_params){.srgb = false, .use = HG_TEXTURE_COLOR, .cutoff = 0.0f},
            &mips),
        HG_OK);
    assert_int_equal(mips.texel_bytes, 8);
    const uint16_t *mip0 = (const uint16_t *)(const void *)mips.levels[0];
    assert_true(hg_half_to_float(mip0[0]) == 0.0f);
    assert_true(hg_half_to_float(mip0[4]) == 65504.0f);
    assert_true(hg_half_to_float(mip0[15]) == 15.0f);
    const uint16_t *mip1 = (const uint16_t *)(const void *)mips.levels[1];
    assert_true(hg_half_to_float(mip1[1]) == 7.0f);
    hg_mips_finish(&mips);
    hg_image_finish(&image);
}

// Bytes kept as floats are decoded: a mid grey of a colour slot stays that grey.
static void test_bytes_as_float(void **state)
{
    (void)state;
    struct hg_image image = make(2, 2);
    memset(image.pixels, 188, image.size_bytes);
    const struct hg_mips_params params = {.srgb = true, .half = true, .use = HG_TEXTURE_COLOR};
    struct hg_mips mips;
    assert_int_equal(hg_mips_build(&image, &params, &mips), HG_OK);
    assert_int_equal(mips.texel_bytes, 8);
    const uint16_t *mip1 = (const uint16_t *)(const void *)(mips.levels[1]);
    assert_true(fabs(hg_half_to_float(mip1[0]) - to_linear(188 / 255.0)) < 1e-3);
    assert_true(fabs(hg_half_to_float(mip1[3]) - 188 / 255.0) < 1e-3);
    hg_mips_finish(&mips);
    hg_image_finish(&image);
}

// --- pages ---------------------------------------------------------------------------------------

static const uint32_t page_sizes[][2] = {{1, 1}, {64, 64}, {65, 1}, {128, 128}, {129, 3},
    {200, 100}, {256, 256}, {1000, 37}, {1, 4096}, {2048, 1024}, {8192, 8192}, {65536, 1}};

static void test_layout(void **state)
{
    (void)state;
    for (size_t s = 0; s < sizeof page_sizes / sizeof *page_sizes; s++) {
        const struct hg_page_layout l = hg_page_layout_of(page_sizes[s][0], page_sizes[s][1]);
        uint8_t *taken = calloc(l.entries, 1);
        assert_non_null(taken);
        for (uint32_t page = 0; page < l.pages; page++) {
            uint32_t x, y;
            const uint32_t mip = hg_page_find(&l, page, &x, &y);
            const uint32_t entry = hg_page_entry(&l, mip, x, y);
            assert_true(entry < l.entries);
            assert_int_equal(taken[entry]++, 0); // no two pages share an entry
        }
        assert_int_equal(hg_page_entry(&l, l.tail, 0, 0), l.entries - 1);
        free(taken);
    }
    assert_int_equal(hg_page_layout_of(64, 64).pages, 1);
    assert_int_equal(hg_page_layout_of(128, 128).pages, 2);
    assert_int_equal(hg_page_layout_of(1024, 1024).pages, 64 + 16 + 4 + 1 + 1);
}

// The mips of a tail do not overlap and stay inside the page.
static void test_tail(void **state)
{
    (void)state;
    static uint8_t used[HG_PAGE_PITCH][HG_PAGE_PITCH];
    memset(used, 0, sizeof used);
    for (int j = 0; j < 7; j++) {
        const int side = (HG_TAIL_TEXELS >> j) + 2 * HG_PAGE_BORDER;
        for (int y = 0; y < side; y++)
            for (int x = 0; x < side; x++) {
                assert_in_range(HG_TAIL_X(j) + x, 0, HG_PAGE_PITCH - 1);
                assert_in_range(HG_TAIL_Y(j) + y, 0, HG_PAGE_PITCH - 1);
                assert_int_equal(used[HG_TAIL_Y(j) + y][HG_TAIL_X(j) + x]++, 0);
            }
    }
}

static int64_t wrapped(int64_t i, int64_t n, enum hg_wrap wrap)
{
    if (wrap == HG_WRAP_CLAMP)
        return i < 0 ? 0 : i >= n ? n - 1 : i;
    if (wrap == HG_WRAP_REPEAT)
        return ((i % n) + n) % n;
    const int64_t m = ((i % (2 * n)) + 2 * n) % (2 * n);
    return m < n ? m : 2 * n - 1 - m;
}

// Every texel of payload and border of every page is the texel that the wrap modes name.
static void test_cut(void **state)
{
    (void)state;
    static uint32_t page_texels[HG_PAGE_PITCH * HG_PAGE_PITCH];
    for (size_t s = 0; s < 9; s++) {
        struct hg_image image = noise(page_sizes[s][0], page_sizes[s][1]);
        struct hg_mips mips;
        assert_int_equal(
            hg_mips_build(&image,
                &(struct hg_mips_params){.srgb = false, .use = HG_TEXTURE_DATA, .cutoff = 0.0f},
                &mips),
            HG_OK);
        const struct hg_page_layout l = hg_page_layout_of(image.width, image.height);
        const enum hg_wrap ws = (enum hg_wrap)(s % 3), wt = (enum hg_wrap)((s / 3 + 1) % 3);
        uint32_t page = 0;
        for (uint32_t m = 0; m < l.mips; m++) {
            const int64_t w = hg_mips_side(image.width, m), h = hg_mips_side(image.height, m);
            const uint32_t *level = (const uint32_t *)(const void *)mips.levels[m];
            const bool tail = m >= l.tail;
            const int64_t across = tail ? 1 : (w + 127) / 128, down = tail ? 1 : (h + 127) / 128;
            for (int64_t p = 0; p < across * down; p++) {
                page_cut(&l, &mips, page, (const enum hg_wrap[2]){ws, wt}, page_texels);
                const int64_t ox = tail ? HG_TAIL_X((int)(m - l.tail)) : 0;
                const int64_t oy = tail ? HG_TAIL_Y((int)(m - l.tail)) : 0;
                const int64_t x0 = p % across * 128, y0 = p / across * 128;
                for (int64_t y = -2; y < (h - y0 < 128 ? h - y0 : 128) + 2; y++)
                    for (int64_t x = -2; x < (w - x0 < 128 ? w - x0 : 128) + 2; x++)
                        assert_int_equal(page_texels[(oy + y + 2) * HG_PAGE_PITCH + ox + x + 2],
                            level[wrapped(y0 + y, h, wt) * w + wrapped(x0 + x, w, ws)]);
                page += !tail;
            }
        }
        assert_int_equal(page, l.pages - 1);
        hg_mips_finish(&mips);
        hg_image_finish(&image);
    }
}

// Each allocation failing in turn gives a status and no leak.
static void test_out_of_memory(void **state)
{
    (void)state;
    struct hg_image image = noise(40, 40);
    enum hg_status status = HG_E_NOMEM;
    uint64_t n = 1;
    for (; status != HG_OK && n < 20; n++) {
        struct hg_mips mips;
        hg_alloc_fail_at(n);
        status = hg_mips_build(&image,
            &(struct hg_mips_params){.srgb = true, .use = HG_TEXTURE_COLOR, .cutoff = 0.0f}, &mips);
        hg_alloc_fail_at(0);
        assert_true(status == HG_OK || mips.levels[0] == NULL);
        hg_mips_finish(&mips);
    }
    assert_int_equal(status, HG_OK);
    assert_true(n > 3);
    hg_image_finish(&image);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_constant),
        cmocka_unit_test(test_filter), cmocka_unit_test(test_mean), cmocka_unit_test(test_normals),
        cmocka_unit_test(test_lost_variance), cmocka_unit_test(test_kept_gloss),
        cmocka_unit_test(test_coverage), cmocka_unit_test(test_weighted),
        cmocka_unit_test(test_half), cmocka_unit_test(test_float_image),
        cmocka_unit_test(test_bytes_as_float), cmocka_unit_test(test_layout),
        cmocka_unit_test(test_tail), cmocka_unit_test(test_cut),
        cmocka_unit_test(test_out_of_memory)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
