// image_ktx2_refused.c - what limits, malformed headers, damage and a lack of memory end in.
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "base/alloc.h"
#include "tests/unit/image_ktx2_files.h"

static void test_limits(void **state)
{
    (void)state;
    struct hg_image image;
    struct hg_image_reader *reader;
    struct hg_error err = {0};
    const struct hg_image_limits limits[] = {
        {.max_side_px = 44}, {.max_pixels = 45 * 18 - 1}, {.max_bytes = 45 * 18 * 4 - 1}};
    for (unsigned i = 0; i < 3; i++) {
        assert_int_equal(hg_image_read_memory(&(struct hg_image_bytes){ktx2_files[UASTC].data,
                                                  ktx2_files[UASTC].size, "x"},
                             HG_PIXEL_RGBA8, &limits[i], &image, &err),
            HG_E_LIMIT);
        assert_null(image.pixels);
    }
    assert_int_equal(hg_image_reader_open_memory(&(struct hg_image_bytes){ktx2_files[UASTC].data,
                                                     ktx2_files[UASTC].size, "x"},
                         44, &reader, &err),
        HG_E_LIMIT);
    assert_null(reader);
}

static void test_headers(void **state)
{
    (void)state;
    static const struct {
        const char *what;
        uint32_t at, value;
        enum hg_status status;
    } cases[] = {
        {"a format of Vulkan", FORMAT, 37, HG_E_UNSUPPORTED},
        {"type size", TYPE_SIZE, 4, HG_E_UNSUPPORTED},
        {"width 0", WIDTH, 0, HG_E_UNSUPPORTED},
        {"height 0", HEIGHT, 0, HG_E_UNSUPPORTED},
        {"width huge", WIDTH, UINT32_MAX, HG_E_LIMIT},
        {"height huge", HEIGHT, 0x80000000, HG_E_LIMIT},
        {"width not of the bytes", WIDTH, 49, HG_E_FORMAT},
        {"height not of the bytes", HEIGHT, 32768, HG_E_FORMAT},
        {"depth", DEPTH, 2, HG_E_UNSUPPORTED},
        {"layers", LAYERS, 2, HG_E_UNSUPPORTED},
        {"cube", FACES, 6, HG_E_UNSUPPORTED},
        {"no face", FACES, 0, HG_E_UNSUPPORTED},
        {"levels", LEVELS, 33, HG_E_FORMAT},
        {"BasisLZ over UASTC", SCHEME, 1, HG_E_FORMAT},
        {"not Zstandard", SCHEME, 2, HG_E_FORMAT},
        {"ZLIB", SCHEME, 3, HG_E_UNSUPPORTED},
        {"descriptor past the end", DESCRIPTOR, 0xfffffff0, HG_E_FORMAT},
        {"descriptor empty", DESCRIPTOR + 4, 0, HG_E_FORMAT},
        {"descriptor without samples", DESCRIPTOR + 4, 28, HG_E_FORMAT},
        {"descriptor long", DESCRIPTOR + 4, UINT32_MAX, HG_E_FORMAT},
        {"keys past the end", KEYS, 0xfffffff0, HG_E_FORMAT},
        {"keys long", KEYS + 4, UINT32_MAX, HG_E_FORMAT},
        {"level past the end", LEVEL, 0xfffffff0, HG_E_FORMAT},
        {"level far past the end", LEVEL + 4, UINT32_MAX, HG_E_FORMAT},
        {"level short", LEVEL + 8, 959, HG_E_FORMAT},
        {"level long", LEVEL + 8, 961, HG_E_FORMAT},
        {"level huge", LEVEL + 12, UINT32_MAX, HG_E_FORMAT},
        {"level's size", LEVEL_SIZE, 944, HG_E_FORMAT},
    };
    for (unsigned i = 0; i < sizeof cases / sizeof *cases; i++) {
        struct bytes b = ktx2_copy(UASTC, 0);
        put32(&b, cases[i].at, cases[i].value);
        ktx2_expect(&b, cases[i].status, cases[i].what);
        hg_free(b.data);
    }
}

static void test_descriptors(void **state)
{
    (void)state;
    static const struct {
        unsigned file, at;
        uint8_t value;
        enum hg_status status;
    } cases[] = {
        {UASTC, 10, 0, HG_E_FORMAT},       // its length
        {UASTC, 11, 255, HG_E_FORMAT},     //
        {UASTC, 12, 1, HG_E_UNSUPPORTED},  // model
        {UASTC, 12, 163, HG_E_FORMAT},     // ETC1S needs BasisLZ
        {ETC1S, 12, 166, HG_E_FORMAT},     // UASTC has none
        {UASTC, 15, 1, HG_E_UNSUPPORTED},  // premultiplied
        {UASTC, 31, 1, HG_E_UNSUPPORTED},  // channels
        {UASTC, 31, 15, HG_E_UNSUPPORTED}, //
        {ETC1S, 31, 15, HG_E_UNSUPPORTED}, //
        {ETC1S_ALPHA, 47, 0, HG_E_UNSUPPORTED},
    };
    for (unsigned i = 0; i < sizeof cases / sizeof *cases; i++) {
        struct bytes b = ktx2_copy(cases[i].file, 0);
        b.data[get32(&b, DESCRIPTOR) + cases[i].at] = cases[i].value;
        char text[16];
        snprintf(text, sizeof text, "case %u", i);
        ktx2_expect(&b, cases[i].status, text);
        hg_free(b.data);
    }
}

static void test_keys(void **state)
{
    (void)state;
    static const struct {
        uint32_t length; // as the file says it
        char pair[32];
        enum hg_status status;
    } cases[] = {
        {18, "KTXorientation\0rd", HG_OK},
        {18, "KTXorientation\0ru", HG_E_UNSUPPORTED},
        {18, "KTXorientation\0ld", HG_E_UNSUPPORTED},
        {16, "KTXswizzle\0rgba", HG_OK},
        {16, "KTXswizzle\0rrr1", HG_E_UNSUPPORTED},
        {8, "any\0ru", HG_OK},
        {28, "no end of the key, only text", HG_E_FORMAT},
        {29, "longer than they are", HG_E_FORMAT},
        {UINT32_MAX, "much longer", HG_E_FORMAT},
        {0, "", HG_E_FORMAT},
    };
    for (unsigned i = 0; i < sizeof cases / sizeof *cases; i++) {
        const size_t at = ktx2_files[UASTC].size;
        struct bytes b = ktx2_copy(UASTC, 32);
        put32(&b, at, cases[i].length);
        memcpy(b.data + at + 4, cases[i].pair, 28);
        put32(&b, KEYS, (uint32_t)at);
        put32(&b, KEYS + 4, cases[i].length < 28 ? cases[i].length + 4 : 32);
        ktx2_expect(&b, cases[i].status, cases[i].pair);
        hg_free(b.data);
    }
}

static void test_long_parts(void **state)
{
    (void)state;
    for (unsigned i = 0; i < 2; i++) {
        struct bytes b = ktx2_copy(UASTC, 2 << 20);
        put32(&b, i ? KEYS : DESCRIPTOR, (uint32_t)ktx2_files[UASTC].size);
        put32(&b, (i ? KEYS : DESCRIPTOR) + 4, i ? 2 << 20 : 5000);
        ktx2_expect(&b, HG_E_LIMIT, i ? "keys" : "descriptor");
        hg_free(b.data);
    }
}

// Two bytes each: counts of endpoints and selectors; four: bytes of endpoints, selectors, tables
// and extensions, then flags, offset and length of both slices.
static void test_global_data(void **state)
{
    (void)state;
    static const struct {
        const char *what;
        uint32_t at, value;
        enum hg_status status;
    } cases[] = {
        {"no endpoints", 0, 0x00010000, HG_E_FORMAT},
        {"no selectors", 0, 0x00000001, HG_E_FORMAT},
        {"more than there are", 0, UINT32_MAX, HG_E_FORMAT},
        {"endpoints long", 4, UINT32_MAX, HG_E_FORMAT},
        {"endpoints empty", 4, 0, HG_E_FORMAT},
        {"selectors empty", 8, 0, HG_E_FORMAT},
        {"tables empty", 12, 0, HG_E_FORMAT},
        {"tables long", 12, 0x7fffffff, HG_E_FORMAT},
        {"a frame of a video", 20, 2, HG_E_UNSUPPORTED},
        {"slice past the end", 24, 93, HG_E_FORMAT},
        {"slice long", 28, UINT32_MAX, HG_E_FORMAT},
        {"slice empty", 28, 0, HG_E_FORMAT},
        {"alpha past the end", 32, UINT32_MAX, HG_E_FORMAT},
        {"alpha empty", 36, 0, HG_E_FORMAT},
    };
    for (unsigned i = 0; i < sizeof cases / sizeof *cases; i++) {
        struct bytes b = ktx2_copy(ETC1S_ALPHA, 0);
        put32(&b, get32(&b, GLOBALS) + cases[i].at, cases[i].value);
        ktx2_expect(&b, cases[i].status, cases[i].what);
        hg_free(b.data);
    }
    for (unsigned i = 0; i < 3; i++) {
        struct bytes b = ktx2_copy(ETC1S_ALPHA, 0);
        put32(&b, i < 2 ? GLOBALS + 8 * i : LEVELS, i < 2 ? 0xfffffff0 : 32);
        ktx2_expect(&b, HG_E_FORMAT, "place of global data");
        hg_free(b.data);
    }
}

// ---- damage ------------------------------------------------------------------------------------

static void test_every_prefix(void **state)
{
    (void)state;
    for (unsigned i = 0; i < FILES; i++)
        for (size_t n = 0; n < ktx2_files[i].size; n++) {
            struct hg_error err;
            uint8_t *block = malloc(n ? n : 1); // of that very size, for the sanitiser
            assert_non_null(block);
            memcpy(block, ktx2_files[i].data, n);
            assert_int_equal(ktx2_try_decode(block, n, &err), HG_E_FORMAT);
            free(block);
        }
}

static void test_every_byte(void **state)
{
    (void)state;
    static const uint8_t changes[] = {0x01, 0x80, 0xff};
    unsigned decoded = 0, refused = 0;
    for (unsigned i = 0; i < FILES; i++) {
        uint8_t *block = malloc(ktx2_files[i].size);
        assert_non_null(block);
        memcpy(block, ktx2_files[i].data, ktx2_files[i].size);
        for (size_t k = 0; k < ktx2_files[i].size * sizeof changes; k++) {
            struct hg_error err;
            block[k / sizeof changes] ^= changes[k % sizeof changes];
            const enum hg_status status = ktx2_try_decode(block, ktx2_files[i].size, &err);
            assert_true(status == HG_OK || status == HG_E_FORMAT || status == HG_E_UNSUPPORTED ||
                        status == HG_E_LIMIT);
            *(status == HG_OK ? &decoded : &refused) += 1;
            block[k / sizeof changes] ^= changes[k % sizeof changes];
        }
        free(block);
    }
    assert_true(decoded > 1000 && refused > 1000);
}

static void test_no_memory(void **state)
{
    (void)state;
    for (unsigned i = 0; i < FILES; i++) {
        enum hg_status status = HG_E_NOMEM;
        uint64_t n = 0;
        while (status != HG_OK) {
            struct hg_error err;
            hg_alloc_fail_at(++n);
            status = ktx2_try_decode(ktx2_files[i].data, ktx2_files[i].size, &err);
            hg_alloc_fail_at(0);
            if (status != HG_OK)
                assert_int_equal(status, HG_E_NOMEM);
            assert_true(n < 1000);
        }
        assert_true(n > 5);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_limits),
        cmocka_unit_test(test_headers),
        cmocka_unit_test(test_descriptors),
        cmocka_unit_test(test_keys),
        cmocka_unit_test(test_long_parts),
        cmocka_unit_test(test_global_data),
        cmocka_unit_test(test_every_prefix),
        cmocka_unit_test(test_every_byte),
        cmocka_unit_test(test_no_memory),
    };
    return cmocka_run_group_tests(tests, ktx2_read_all, ktx2_free_all);
}
