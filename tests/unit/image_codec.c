// image_codec.c - files written by hg_image_encode come back as they were, with the right tags.
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <math.h>
#include <cmocka.h>

#include "base/alloc.h"
#include "renderer/image/metrics.h"
#include "renderer/image/zstd.h"

enum { test_width = 37, test_height = 23 };

// A picture that has every alpha, steep and flat places, and no symmetry.
static double sample_at(uint32_t x, uint32_t y, unsigned channel)
{
    double v = channel == 3 ? (double)x / (test_width - 1)
                            : 0.5 + 0.5 * sin(0.9 * x * (channel + 1) + 0.37 * y);
    return v;
}

static void fill(struct hg_image *image)
{
    size_t i = 0;
    for (uint32_t y = 0; y < image->height; y++)
        for (uint32_t x = 0; x < image->width; x++)
            for (unsigned c = 0; c < 4; c++, i++) {
                double v = sample_at(x, y, c);
                if (image->format == HG_PIXEL_RGBA8)
                    ((uint8_t *)image->pixels)[i] = (uint8_t)(v * 255.0 + 0.5);
                else if (image->format == HG_PIXEL_RGBA16)
                    ((uint16_t *)image->pixels)[i] = (uint16_t)(v * 65535.0 + 0.5);
                else
                    ((float *)image->pixels)[i] = (float)(c == 3 ? v : v * 40.0);
            }
    image->has_alpha = true;
}

static struct hg_image make_image(enum hg_pixel_format format)
{
    struct hg_image image;
    assert_int_equal(hg_image_create(test_width, test_height, format, NULL, &image), HG_OK);
    fill(&image);
    return image;
}

static struct hg_writer encode(const struct hg_image *image, const struct hg_image_encode *params)
{
    struct hg_writer w = {0};
    struct hg_error err = {0};
    if (hg_image_encode(image, params, &w, &err))
        fail_msg("%s: %s", err.what, err.reason);
    return w;
}

static struct hg_image decode(const struct hg_writer *w, enum hg_pixel_format format)
{
    struct hg_image image;
    struct hg_error err = {0};
    if (hg_image_read_memory(
            &(struct hg_image_bytes){w->data, w->size, "test"}, format, NULL, &image, &err))
        fail_msg("%s: %s", err.what, err.reason);
    return image;
}

static bool contains(const struct hg_writer *w, const char *text, size_t size)
{
    return memmem(w->data, w->size, text, size) != NULL;
}

static void png8_comes_back_exactly(void **state)
{
    (void)state;
    struct hg_image a = make_image(HG_PIXEL_RGBA8);
    struct hg_image_encode params = {.file = HG_IMAGE_PNG8};
    struct hg_writer w = encode(&a, &params), again = encode(&a, &params);
    assert_int_equal(w.size, again.size);
    assert_memory_equal(w.data, again.data, w.size);
    assert_true(contains(&w, "sRGB", 4));
    struct hg_image b = decode(&w, HG_PIXEL_RGBA8);
    assert_true(b.has_alpha);
    assert_int_equal(b.size_bytes, a.size_bytes);
    assert_memory_equal(b.pixels, a.pixels, a.size_bytes);
    hg_image_finish(&b);
    params.opaque = true;
    struct hg_writer rgb = encode(&a, &params);
    b = decode(&rgb, HG_PIXEL_RGBA8);
    assert_false(b.has_alpha);
    for (size_t i = 0; i < a.size_bytes; i++)
        assert_int_equal(((uint8_t *)b.pixels)[i], i % 4 == 3 ? 255 : ((uint8_t *)a.pixels)[i]);
    hg_image_finish(&a);
    hg_image_finish(&b);
    hg_writer_finish(&w);
    hg_writer_finish(&again);
    hg_writer_finish(&rgb);
}

static void png16_comes_back_exactly(void **state)
{
    (void)state;
    struct hg_image a = make_image(HG_PIXEL_RGBA16);
    struct hg_writer w = encode(&a, &(struct hg_image_encode){.file = HG_IMAGE_PNG16});
    struct hg_image b = decode(&w, HG_PIXEL_RGBA16), low = decode(&w, HG_PIXEL_RGBA8);
    assert_memory_equal(b.pixels, a.pixels, a.size_bytes);
    for (size_t i = 0; i < low.size_bytes; i++) {
        double exact = ((uint16_t *)a.pixels)[i] / 257.0;
        assert_int_equal(((uint8_t *)low.pixels)[i], (int)floor(exact + 0.5));
    }
    hg_image_finish(&a);
    hg_image_finish(&b);
    hg_image_finish(&low);
    hg_writer_finish(&w);
}

static void png16_takes_display_floats(void **state)
{
    (void)state;
    struct hg_image a = make_image(HG_PIXEL_RGBA32F);
    float *px = a.pixels;
    px[0] = -1.0f, px[1] = 2.0f, px[2] = 0.25f, px[3] = 1.0f;
    struct hg_writer w = encode(&a, &(struct hg_image_encode){.file = HG_IMAGE_PNG16});
    struct hg_image b = decode(&w, HG_PIXEL_RGBA16);
    const uint16_t *got = b.pixels;
    assert_int_equal(got[0], 0);
    assert_int_equal(got[1], 65535);
    assert_int_equal(got[2], 16384); // 0.25 * 65535 = 16383.75
    hg_image_finish(&a);
    hg_image_finish(&b);
    hg_writer_finish(&w);
}

static void eight_bits_widen_by_257(void **state)
{
    (void)state;
    struct hg_image a = make_image(HG_PIXEL_RGBA8);
    struct hg_writer w = encode(&a, &(struct hg_image_encode){.file = HG_IMAGE_PNG8});
    struct hg_image b = decode(&w, HG_PIXEL_RGBA16), f = decode(&w, HG_PIXEL_RGBA32F);
    for (size_t i = 0; i < a.size_bytes; i++) {
        unsigned v = ((uint8_t *)a.pixels)[i];
        assert_int_equal(((uint16_t *)b.pixels)[i], v * 257);
        assert_true(fabs(((float *)f.pixels)[i] - v / 255.0) < 1e-6);
    }
    hg_image_finish(&a);
    hg_image_finish(&b);
    hg_image_finish(&f);
    hg_writer_finish(&w);
}

static void check_exr(enum hg_image_file file, double tolerance)
{
    float matrix[16] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 5, 6, 7, 1};
    struct hg_image_attribute attributes[] = {
        {.name = "heliograph:samples", .type = HG_ATTR_INT, .integer = 32},
        {.name = "heliograph:scene", .type = HG_ATTR_STRING, .string = "a scene"},
        {.name = "worldToCamera", .type = HG_ATTR_MAT4, .floats = matrix},
        {.name = "framesPerSecond", .type = HG_ATTR_RATIO, .integer = 24000, .count = 1001},
    };
    struct hg_image a = make_image(HG_PIXEL_RGBA32F);
    struct hg_image_encode params = {.file = file, .attributes = attributes, .attribute_count = 4};
    struct hg_writer w = encode(&a, &params), again = encode(&a, &params);
    assert_int_equal(w.size, again.size);
    assert_memory_equal(w.data, again.data, w.size);
    assert_false(
        contains(&w, "capDate", 7)); // when is not known, nor the same for the same picture
    assert_true(contains(&w, "chromaticities", 14));
    assert_true(contains(&w, "heliograph:samples", 18));
    assert_true(contains(&w, "a scene", 7));
    assert_true(contains(&w, "worldToCamera", 13));
    static const char rate[] = "framesPerSecond\0rational\0\10\0\0\0\xc0\x5d\0\0\xe9\3\0";
    assert_true(contains(&w, rate, sizeof rate));
    struct hg_image b = decode(&w, HG_PIXEL_RGBA32F);
    const float *want = a.pixels, *got = b.pixels;
    for (size_t i = 0; i < a.size_bytes / 4; i++) {
        double alpha = want[i / 4 * 4 + 3];
        double expected = i % 4 < 3 && alpha == 0 ? 0 : want[i];
        double slack = tolerance * fmax(1, fabs(expected)) * 2;
        if (fabs(got[i] - expected) > slack)
            fail_msg("value %zu is %g, not %g", i, (double)got[i], expected);
    }
    hg_image_finish(&a);
    hg_image_finish(&b);
    hg_writer_finish(&w);
    hg_writer_finish(&again);
}

static void exr_keeps_values_and_attributes(void **state)
{
    (void)state;
    check_exr(HG_IMAGE_EXR_FLOAT, 1e-6);
    check_exr(HG_IMAGE_EXR_HALF, 1.0 / 2048);
}

static void jpeg_is_close_and_stable(void **state)
{
    (void)state;
    struct hg_image a;
    assert_int_equal(hg_image_create(64, 48, HG_PIXEL_RGBA8, NULL, &a), HG_OK);
    for (size_t i = 0; i < a.size_bytes; i++)
        ((uint8_t *)a.pixels)[i] = (uint8_t)(i % 4 == 3 ? 7 : 60 + (i / 4) % 64 + (i / 256));
    struct hg_image_encode params = {.file = HG_IMAGE_JPEG, .quality = 95};
    struct hg_writer w = encode(&a, &params), again = encode(&a, &params);
    assert_int_equal(w.size, again.size);
    assert_memory_equal(w.data, again.data, w.size);
    struct hg_image b = decode(&w, HG_PIXEL_RGBA8);
    assert_false(b.has_alpha);
    for (size_t i = 0; i < a.size_bytes; i++) {
        int d = ((uint8_t *)a.pixels)[i] - ((uint8_t *)b.pixels)[i];
        assert_true(i % 4 == 3 ? ((uint8_t *)b.pixels)[i] == 255 : abs(d) <= 4);
    }
    hg_image_finish(&a);
    hg_image_finish(&b);
    hg_writer_finish(&w);
    hg_writer_finish(&again);
}

// RGBA8 comes from libjpeg-turbo's own interface, the other formats through OpenImageIO.
static void both_jpeg_decoders_agree(void **state)
{
    (void)state;
    struct hg_image a = make_image(HG_PIXEL_RGBA8);
    for (int quality = 50; quality <= 100; quality += 25) {
        struct hg_image_encode params = {.file = HG_IMAGE_JPEG, .quality = quality};
        struct hg_writer w = encode(&a, &params);
        struct hg_image b = decode(&w, HG_PIXEL_RGBA8), c = decode(&w, HG_PIXEL_RGBA16);
        assert_false(b.has_alpha);
        for (size_t i = 0; i < b.size_bytes; i++)
            assert_int_equal(((uint8_t *)b.pixels)[i] * 257, ((uint16_t *)c.pixels)[i]);
        hg_image_finish(&b);
        hg_image_finish(&c);
        hg_writer_finish(&w);
    }
    hg_image_finish(&a);
}

static void wrong_parameters_are_refused(void **state)
{
    (void)state;
    struct hg_image a = make_image(HG_PIXEL_RGBA8);
    struct hg_writer w = {0};
    struct hg_error err = {0};
    struct hg_image_encode params = {.file = HG_IMAGE_EXR_HALF};
    assert_int_equal(hg_image_encode(&a, &params, &w, &err), HG_E_INVAL);
    params = (struct hg_image_encode){.file = HG_IMAGE_JPEG, .quality = 101};
    assert_int_equal(hg_image_encode(&a, &params, &w, &err), HG_E_INVAL);
    w.limit_bytes = 100;
    params = (struct hg_image_encode){.file = HG_IMAGE_PNG8};
    assert_int_equal(hg_image_encode(&a, &params, &w, &err), HG_E_NOMEM);
    hg_writer_finish(&w);
    hg_image_finish(&a);
}

static void limits_are_kept(void **state)
{
    (void)state;
    struct hg_image a = make_image(HG_PIXEL_RGBA8), b;
    struct hg_writer w = encode(&a, &(struct hg_image_encode){.file = HG_IMAGE_PNG8});
    struct hg_image_limits limits[] = {
        {.max_side_px = test_width - 1},
        {.max_pixels = test_width * test_height - 1},
        {.max_bytes = test_width * test_height * 4 - 1},
    };
    for (size_t i = 0; i < 3; i++) {
        struct hg_error err = {0};
        assert_int_equal(hg_image_read_memory(&(struct hg_image_bytes){w.data, w.size, "big.png"},
                             HG_PIXEL_RGBA8, &limits[i], &b, &err),
            HG_E_LIMIT);
        assert_string_equal(err.what, "big.png");
        assert_null(b.pixels);
    }
    struct hg_image_limits enough = {
        test_width, test_width * test_height, test_width * test_height * 4};
    struct hg_error err = {0};
    assert_int_equal(hg_image_read_memory(&(struct hg_image_bytes){w.data, w.size, "big.png"},
                         HG_PIXEL_RGBA8, &enough, &b, &err),
        HG_OK);
    hg_image_finish(&a);
    hg_image_finish(&b);
    hg_writer_finish(&w);
    assert_int_equal(hg_image_create(40000, 1, HG_PIXEL_RGBA8, NULL, &b), HG_E_LIMIT);
    assert_int_equal(hg_image_create(0, 1, HG_PIXEL_RGBA8, NULL, &b), HG_E_LIMIT);
}

static void every_prefix_is_an_error(void **state)
{
    (void)state;
    struct hg_image a = make_image(HG_PIXEL_RGBA8), b;
    struct hg_writer w = encode(&a, &(struct hg_image_encode){.file = HG_IMAGE_PNG8});
    for (size_t n = 0; n < w.size; n++) {
        uint8_t *exact = malloc(n ? n : 1);
        assert_non_null(exact);
        memcpy(exact, w.data, n);
        struct hg_error err = {0};
        enum hg_status st = hg_image_read_memory(
            &(struct hg_image_bytes){exact, n, "cut.png"}, HG_PIXEL_RGBA8, NULL, &b, &err);
        if (st != HG_E_FORMAT)
            fail_msg("%zu of %zu bytes: %s", n, w.size, hg_status_name(st));
        assert_string_equal(err.what, "cut.png");
        assert_true(err.reason[0] != 0);
        free(exact);
    }
    hg_image_finish(&a);
    hg_writer_finish(&w);
}

// An EXR header that claims 2 GiB for an attribute is refused before a library takes them.
static void exr_attributes_lie_inside_the_file(void **state)
{
    (void)state;
    struct hg_image a = make_image(HG_PIXEL_RGBA32F), b;
    struct hg_writer w = encode(&a, &(struct hg_image_encode){.file = HG_IMAGE_EXR_HALF});
    uint8_t *type = memmem(w.data, w.size, "chlist", 7);
    assert_non_null(type);
    memcpy(type + 7, "\xff\xff\xff\x7f", 4);
    struct hg_error err = {0};
    assert_int_equal(hg_image_read_memory(&(struct hg_image_bytes){w.data, w.size, "big.exr"},
                         HG_PIXEL_RGBA32F, NULL, &b, &err),
        HG_E_FORMAT);
    assert_memory_equal(err.where, "byte ", 5);
    for (size_t n = 4; n < 200; n++)
        assert_int_equal(hg_image_read_memory(&(struct hg_image_bytes){w.data, n, "cut.exr"},
                             HG_PIXEL_RGBA32F, NULL, &b, &err),
            HG_E_FORMAT);
    hg_image_finish(&a);
    hg_writer_finish(&w);
}

static void probe_says_what_a_file_is(void **state)
{
    (void)state;
    struct hg_image a = make_image(HG_PIXEL_RGBA32F);
    struct hg_writer w = encode(&a, &(struct hg_image_encode){.file = HG_IMAGE_EXR_HALF});
    struct hg_image_info info;
    struct hg_error err = {0};
    assert_int_equal(
        hg_image_probe_memory(&(struct hg_image_bytes){w.data, w.size, "x"}, &info, &err), HG_OK);
    assert_string_equal(info.file_format, "openexr");
    assert_int_equal(info.width, test_width);
    assert_int_equal(info.height, test_height);
    assert_int_equal(info.channels, 4);
    assert_true(info.is_float && info.is_16bit);
    assert_int_equal(
        hg_image_probe_memory(&(struct hg_image_bytes){"not one", 7, "x"}, &info, &err),
        HG_E_FORMAT);
    assert_int_equal(hg_image_probe_file("/nowhere/x.png", &info, &err), HG_E_NOTFOUND);
    hg_image_finish(&a);
    hg_writer_finish(&w);
}

static void zstd_comes_back_or_is_refused(void **state)
{
    (void)state;
    uint8_t data[5000], back[5000];
    for (size_t i = 0; i < sizeof data; i++)
        data[i] = (uint8_t)(i * i >> 3);
    struct hg_writer w = {0};
    struct hg_error err = {0};
    assert_int_equal(hg_zstd_encode(data, sizeof data, 1, &w, &err), HG_OK);
    assert_int_equal(hg_zstd_decode(w.data, w.size, back, sizeof back, &err), HG_OK);
    assert_memory_equal(data, back, sizeof data);
    assert_int_equal(hg_zstd_decode(w.data, w.size, back, sizeof back - 1, &err), HG_E_FORMAT);
    for (size_t n = 0; n < w.size; n++)
        assert_int_equal(hg_zstd_decode(w.data, n, back, sizeof back, &err), HG_E_FORMAT);
    assert_int_equal(hg_zstd_encode(data, sizeof data, 0, &w, &err), HG_E_INVAL);
    hg_writer_finish(&w);
}

// Every allocation of ours fails once: a status, empty outputs, nothing leaked (asan), then
// success.
static void every_allocation_may_fail(void **state)
{
    (void)state;
    struct hg_image a = make_image(HG_PIXEL_RGBA8), back = {0}, diff;
    static const enum hg_metric metrics[] = {HG_METRIC_SSIM, HG_METRIC_FLIP, HG_METRIC_MAX};
    static const enum hg_image_file files[] = {HG_IMAGE_PNG8, HG_IMAGE_JPEG};
    bool failed = true;
    for (uint64_t n = 1; failed; n++) {
        struct hg_writer w = {0};
        struct hg_error err = {0};
        double value;
        enum hg_status st = HG_OK;
        assert_true(n < 100);
        hg_alloc_fail_at(n);
        for (size_t i = 0; i < 2 && !st; i++) {
            w.size = 0;
            st = hg_image_encode(&a, &(struct hg_image_encode){.file = files[i]}, &w, &err);
        }
        if (!st)
            st = hg_image_read_memory(&(struct hg_image_bytes){w.data, w.size, "x.jpg"},
                HG_PIXEL_RGBA8, NULL, &back, &err);
        for (size_t i = 0; i < 3 && !st; i++) {
            st = hg_image_compare(
                &(struct hg_image_pair){&a, &back, NULL}, metrics[i], &value, &diff, &err);
            if (!st)
                hg_image_finish(&diff);
        }
        hg_image_finish(&back);
        hg_writer_finish(&w);
        failed = hg_alloc_count() >= n;
        hg_alloc_fail_at(0);
        assert_int_equal(st, failed ? HG_E_NOMEM : HG_OK);
        assert_true(!failed || err.status == HG_E_NOMEM);
    }
    hg_image_finish(&a);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(png8_comes_back_exactly),
        cmocka_unit_test(png16_comes_back_exactly),
        cmocka_unit_test(png16_takes_display_floats),
        cmocka_unit_test(eight_bits_widen_by_257),
        cmocka_unit_test(exr_keeps_values_and_attributes),
        cmocka_unit_test(jpeg_is_close_and_stable),
        cmocka_unit_test(both_jpeg_decoders_agree),
        cmocka_unit_test(wrong_parameters_are_refused),
        cmocka_unit_test(limits_are_kept),
        cmocka_unit_test(every_prefix_is_an_error),
        cmocka_unit_test(exr_attributes_lie_inside_the_file),
        cmocka_unit_test(probe_says_what_a_file_is),
        cmocka_unit_test(every_allocation_may_fail),
        cmocka_unit_test(zstd_comes_back_or_is_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
