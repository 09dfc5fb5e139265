// Multi-part EXR files, read back by OpenImageIO and piece by piece; Cryptomatte against the known
// values of its specification; files that say what they were made from.
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "base/alloc.h"
#include "renderer/image/cryptomatte.h"
#include "renderer/image/exr.h"
#include "tests/unit/image_exr.h"

static float id_of(const char *name)
{
    const uint32_t bits = hg_cryptomatte_id(name);
    float id;
    memcpy(&id, &bits, sizeof id);
    return id;
}

enum { WIDTH = 37, HEIGHT = 21, PIXELS = WIDTH * HEIGHT };

#define LIMIT (UINT64_C(1) << 30)

static float color[PIXELS * 4], depth[PIXELS], crypto[PIXELS * 4];
static uint32_t ids[PIXELS];
static float matrix[16];

static void fill(void)
{
    for (int i = 0; i < 16; i++)
        matrix[i] = (float)i * 0.5f - 3;
    for (int i = 0; i < PIXELS; i++) {
        for (int c = 0; c < 4; c++)
            color[4 * i + c] = (float)((i * 7 + c * 3) % 64) / 16; // exact as half
        depth[i] = 1.0f / (float)(i + 1);                          // not exact as half
        ids[i] = 0xfff00000u + (uint32_t)i;                        // not exact as float
        crypto[4 * i] = id_of(i % 2 ? "hello" : "cube");
        crypto[4 * i + 1] = 0.75f;
    }
}

static struct hg_image_attribute attributes[] = {
    {.name = "worldtocamera", .type = HG_ATTR_MAT4, .floats = matrix},
    {.name = "heliograph:job", .type = HG_ATTR_STRING, .string = "0123abcd"},
    {.name = "heliograph:samples", .type = HG_ATTR_INT, .integer = 12},
    {.name = "heliograph:seed", .type = HG_ATTR_COUNT, .count = UINT32_MAX},
};

static void make_parts(struct hg_exr_part parts[4])
{
    fill();
    parts[0] = (struct hg_exr_part){.name = "rgba",
        .channels = {"R", "G", "B", "A"},
        .channel_count = 4,
        .stride = 4,
        .type = HG_EXR_HALF,
        .pixels = color,
        .size_bytes = sizeof color,
        .attributes = attributes,
        .attribute_count = sizeof attributes / sizeof *attributes};
    parts[1] = (struct hg_exr_part){.name = "depth",
        .channels = {"depth.Z"},
        .channel_count = 1,
        .stride = 1,
        .type = HG_EXR_FLOAT,
        .pixels = depth,
        .size_bytes = sizeof depth};
    parts[2] = (struct hg_exr_part){.name = "object",
        .channels = {"object.I"},
        .channel_count = 1,
        .stride = 1,
        .type = HG_EXR_UINT,
        .pixels = ids,
        .size_bytes = sizeof ids};
    parts[3] = (struct hg_exr_part){.name = "CryptoObject00",
        .channels = {"CryptoObject00.R", "CryptoObject00.G", "CryptoObject00.B",
            "CryptoObject00.A"},
        .channel_count = 4,
        .stride = 4,
        .type = HG_EXR_FLOAT,
        .pixels = crypto,
        .size_bytes = sizeof crypto};
}

static struct hg_writer encode(void)
{
    static const struct hg_exr_window size = {.width = WIDTH, .height = HEIGHT};
    struct hg_exr_part parts[4];
    struct hg_writer file = {0};
    struct hg_error err = {0};
    make_parts(parts);
    if (hg_exr_encode(&size, parts, 4, LIMIT, &file, &err))
        fail_msg("%s: %s", err.what, err.reason);
    return file;
}

static void test_read_back(void **state)
{
    (void)state;
    struct hg_writer file = encode(), again = encode();
    struct exr_seen seen[4];
    assert_int_equal(file.size, again.size);
    assert_memory_equal(file.data, again.data, file.size);
    assert_int_equal(exr_read(file.data, file.size, seen, 4), 4);
    static const char *const names[] = {"rgba", "depth", "object", "CryptoObject00"};
    static const char *const types[] = {"half", "float", "uint", "float"};
    for (int i = 0; i < 4; i++) {
        assert_string_equal(seen[i].name, names[i]);
        assert_string_equal(seen[i].type, types[i]);
        assert_int_equal(seen[i].width, WIDTH);
        assert_int_equal(seen[i].height, HEIGHT);
    }
    assert_string_equal(seen[1].channel, "depth.Z");
    assert_memory_equal(seen[0].pixels, color, sizeof color);
    assert_memory_equal(seen[1].pixels, depth, sizeof depth);
    assert_memory_equal(seen[2].pixels, ids, sizeof ids);
    assert_memory_equal(seen[3].pixels, crypto, sizeof crypto);
    assert_memory_equal(seen[0].world_to_camera, matrix, sizeof matrix);
    assert_true(seen[0].seed == 4294967295.0 && seen[1].seed < 0);
    for (int i = 0; i < 4; i++)
        free(seen[i].pixels);
    hg_writer_finish(&file);
    hg_writer_finish(&again);
}

// Halves have no infinity in files: bright lamps would spread in every blur.
static void test_bright_halves(void **state)
{
    (void)state;
    static const struct hg_exr_window size = {.width = WIDTH, .height = HEIGHT};
    struct hg_exr_part parts[4];
    struct exr_seen seen[4];
    struct hg_writer file = {0};
    struct hg_error err = {0};
    make_parts(parts);
    color[0] = 65504;
    color[1] = 65530; // rounds to infinity
    color[4] = 1e9f;
    color[5] = -1e9f;
    color[PIXELS * 4 - 1] = INFINITY;
    depth[0] = 1e9f; // of whole floats
    assert_int_equal(hg_exr_encode(&size, parts, 4, LIMIT, &file, &err), HG_OK);
    assert_int_equal(exr_read(file.data, file.size, seen, 4), 4);
    const float *rgba = seen[0].pixels, *z = seen[1].pixels;
    assert_true(rgba[0] == 65504 && rgba[1] == 65504 && rgba[2] == color[2]);
    assert_true(rgba[4] == 65504 && rgba[5] == -65504 && rgba[PIXELS * 4 - 1] == 65504);
    assert_true(z[0] == 1e9f);
    for (int i = 0; i < 4; i++)
        free(seen[i].pixels);
    hg_writer_finish(&file);
}

static void test_refusals(void **state)
{
    (void)state;
    static const struct hg_exr_window size = {.width = WIDTH, .height = HEIGHT},
                                      huge = {.width = 70000, .height = 1};
    struct hg_exr_part parts[4];
    struct hg_writer file = {0};
    struct hg_error err = {0};
    make_parts(parts);
    assert_int_equal(hg_exr_encode(&size, parts, 4, 1000, &file, &err), HG_E_LIMIT);
    assert_non_null(strstr(err.reason, "fewer planes"));
    assert_int_equal(hg_exr_encode(&size, parts, 0, LIMIT, &file, &err), HG_E_LIMIT);
    assert_int_equal(hg_exr_encode(&huge, parts, 4, LIMIT, &file, &err), HG_E_INVAL);
    parts[2].name = "depth";
    assert_int_equal(hg_exr_encode(&size, parts, 4, LIMIT, &file, &err), HG_E_INVAL);
    make_parts(parts);
    parts[1].size_bytes--;
    assert_int_equal(hg_exr_encode(&size, parts, 4, LIMIT, &file, &err), HG_E_INVAL);
    make_parts(parts);
    parts[1].name = "a name that is longer than 31 bytes";
    assert_int_equal(hg_exr_encode(&size, parts, 4, LIMIT, &file, &err), HG_E_INVAL);
    assert_int_equal(file.size, 0);
}

// A file that is whole tells its job; cut anywhere, or with a bit turned in its pixels, it does
// not.
static void test_examine(void **state)
{
    (void)state;
    struct hg_writer file = encode();
    struct hg_image_summary summary;
    struct hg_error err = {0};
    assert_int_equal(hg_image_examine(&(struct hg_image_bytes){file.data, file.size, "a.exr"},
                         "heliograph:job", NULL, &summary, &err),
        HG_OK);
    assert_string_equal(summary.value, "0123abcd");
    assert_int_equal(summary.parts, 4);
    assert_int_equal(summary.width, WIDTH);
    size_t step = file.size / 50;
    for (size_t size = 0; size < file.size; size += step) {
        uint8_t *cut = malloc(size ? size : 1);
        memcpy(cut, file.data, size);
        assert_int_not_equal(hg_image_examine(&(struct hg_image_bytes){cut, size, "a.exr"},
                                 "heliograph:job", NULL, &summary, &err),
            HG_OK);
        assert_string_equal(summary.value, "");
        free(cut);
    }
    file.data[file.size - file.size / 8] ^= 0x10;
    assert_int_not_equal(hg_image_examine(&(struct hg_image_bytes){file.data, file.size, "a.exr"},
                             "heliograph:job", NULL, &summary, &err),
        HG_OK);
    hg_writer_finish(&file);
}

// The same for the other kinds of files.
static void test_examine_kinds(void **state)
{
    (void)state;
    static const enum hg_image_file kinds[] = {
        HG_IMAGE_PNG8, HG_IMAGE_PNG16, HG_IMAGE_JPEG, HG_IMAGE_EXR_HALF};
    static const enum hg_pixel_format formats[] = {
        HG_PIXEL_RGBA8, HG_PIXEL_RGBA16, HG_PIXEL_RGBA8, HG_PIXEL_RGBA32F};
    for (int k = 0; k < 4; k++) {
        struct hg_image image;
        struct hg_writer file = {0};
        struct hg_error err = {0};
        struct hg_image_summary summary;
        assert_int_equal(hg_image_create(64, 48, formats[k], NULL, &image), HG_OK);
        if (formats[k] != HG_PIXEL_RGBA32F)
            for (size_t i = 0; i < image.size_bytes; i++)
                ((uint8_t *)image.pixels)[i] = (uint8_t)(i * i >> 5);
        struct hg_image_encode params = {.file = kinds[k],
            .opaque = true,
            .attributes = attributes,
            .attribute_count = sizeof attributes / sizeof *attributes};
        assert_int_equal(hg_image_encode(&image, &params, &file, &err), HG_OK);
        assert_int_equal(hg_image_examine(&(struct hg_image_bytes){file.data, file.size, "a"},
                             "heliograph:job", NULL, &summary, &err),
            HG_OK);
        assert_string_equal(summary.value, "0123abcd");
        assert_int_equal(summary.width, 64);
        for (size_t cut = 1; cut < file.size; cut += file.size / 20 + 1) {
            assert_int_not_equal(
                hg_image_examine(&(struct hg_image_bytes){file.data, file.size - cut, "a"},
                    "heliograph:job", NULL, &summary, &err),
                HG_OK);
        }
        hg_writer_finish(&file);
        hg_image_finish(&image);
    }
}

// ---- Cryptomatte -------------------------------------------------------------------------------

static void test_hashes(void **state)
{
    (void)state;
    static const struct {
        const char *name;
        uint32_t hash;
    } murmur[] = {{"", 0}, {"test", 0xba6bd213}, {"Hello, world!", 0xc0363e43},
        {"The quick brown fox jumps over the lazy dog", 0x2e4ff723}};
    for (size_t i = 0; i < sizeof murmur / sizeof *murmur; i++)
        assert_int_equal(
            hg_cryptomatte_hash(murmur[i].name, strlen(murmur[i].name)), murmur[i].hash);
    // Ids as the specification gives them.
    static const struct {
        const char *name;
        double id;
    } known[] = {{"hello", 6.0705627102400005616e-17}, {"cube", -4.08461912519e+15},
        {"sphere", 2.79018604383e+15}, {"plane", 3.66557617593e-11}};
    for (size_t i = 0; i < sizeof known / sizeof *known; i++) {
        double seen = (double)id_of(known[i].name);
        assert_true(seen / known[i].id > 1 - 1e-6 && seen / known[i].id < 1 + 1e-6);
    }
}

static void test_bits(void **state)
{
    (void)state;
    assert_int_equal(hg_cryptomatte_bits(0x00000001), 0x00800001);
    assert_int_equal(hg_cryptomatte_bits(0x7f812345), 0x7f012345);
    assert_int_equal(hg_cryptomatte_bits(0xff812345), 0xff012345);
    assert_int_equal(hg_cryptomatte_bits(0x3f812345), 0x3f812345);
    char prefix[24];
    hg_cryptomatte_prefix("CryptoObject", prefix);
    assert_int_equal(strlen(prefix), 20);
    char again[24];
    uint32_t hash = hg_cryptomatte_hash("CryptoObject", 12);
    snprintf(again, sizeof again, "cryptomatte/%07x/", hash >> 4);
    assert_string_equal(prefix, again);
}

static uint32_t bits(float f)
{
    uint32_t u;
    memcpy(&u, &f, sizeof u);
    return u;
}

static void test_ranks(void **state)
{
    (void)state;
    struct hg_cryptomatte_sample samples[] = {{7, 1}, {0, 2}, {9, 2}, {7, 1.5f}, {3, 2}, {5, 0}};
    float out[8];
    hg_cryptomatte_rank(samples, 6, 10, 4, out);
    assert_int_equal(bits(out[0]), 7);
    assert_true(out[1] == 0.25f);
    assert_int_equal(bits(out[2]), 3); // equal weights: by id
    assert_true(out[3] == 0.2f && out[5] == 0.2f);
    assert_int_equal(bits(out[4]), 9);
    assert_true(out[6] == 0 && out[7] == 0);
    struct hg_cryptomatte_sample few[] = {{7, 1}, {8, 3}};
    hg_cryptomatte_rank(few, 2, 4, 1, out);
    assert_int_equal(bits(out[0]), 8);
    assert_true(out[1] == 0.75f);
    hg_cryptomatte_rank(few, 0, 0, 2, out);
    assert_true(out[0] == 0 && out[3] == 0);
}

static void test_manifest(void **state)
{
    (void)state;
    static const char *const names[] = {"b\"q\\", "hello", "a\n", "hello"};
    char *text;
    assert_int_equal(hg_cryptomatte_manifest(names, 4, &text), HG_OK);
    char wanted[200];
    snprintf(wanted, sizeof wanted,
        "{\"a\\u000a\":\"%08x\",\"b\\\"q\\\\\":\"%08x\",\"hello\":\"%08x\"}",
        hg_cryptomatte_id("a\n"), hg_cryptomatte_id("b\"q\\"), hg_cryptomatte_id("hello"));
    assert_string_equal(text, wanted);
    hg_free(text);
    assert_int_equal(hg_cryptomatte_manifest(NULL, 0, &text), HG_OK);
    assert_string_equal(text, "{}");
    hg_free(text);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_read_back),
        cmocka_unit_test(test_bright_halves),
        cmocka_unit_test(test_refusals),
        cmocka_unit_test(test_examine),
        cmocka_unit_test(test_examine_kinds),
        cmocka_unit_test(test_hashes),
        cmocka_unit_test(test_bits),
        cmocka_unit_test(test_ranks),
        cmocka_unit_test(test_manifest),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
