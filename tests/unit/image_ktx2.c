// image_ktx2.c - KTX2 files of Basis Universal textures against texels that another decoder gave.
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <zstd.h>

#include <cmocka.h>

#include "base/alloc.h"
#include "base/file.h"
#include "tests/support/check.h"
#include "tests/support/folder.h"
#include "tests/unit/image_ktx2_files.h"

// ---- texels ------------------------------------------------------------------------------------

static void test_texels(void **state)
{
    (void)state;
    static const struct {
        uint32_t width, height, channels;
    } want[FILES] = {{45, 18, 4}, {37, 23, 4}, {121, 125, 3}, {37, 23, 4}};
    for (unsigned i = 0; i < FILES; i++) {
        struct hg_image_info info;
        struct hg_error err = {0};
        test_ok(hg_image_probe_memory(
                    &(struct hg_image_bytes){ktx2_files[i].data, ktx2_files[i].size, ktx2_names[i]},
                    &info, &err),
            &err);
        assert_int_equal(info.width, want[i].width);
        assert_int_equal(info.height, want[i].height);
        assert_int_equal(info.channels, want[i].channels);
        assert_false(info.is_float || info.is_16bit);
        assert_string_equal(info.file_format, "ktx2");
        struct hg_image image = ktx2_decode(&ktx2_files[i], HG_PIXEL_RGBA8);
        assert_int_equal(image.has_alpha, want[i].channels == 4);
        assert_int_equal(image.width, ktx2_wanted[i].width);
        assert_int_equal(image.height, ktx2_wanted[i].height);
        assert_memory_equal(image.pixels, ktx2_wanted[i].pixels, image.size_bytes);
        hg_image_finish(&image);
    }
}

static void test_wider_formats(void **state)
{
    (void)state;
    for (unsigned i = 0; i < FILES; i++) {
        struct hg_image deep = ktx2_decode(&ktx2_files[i], HG_PIXEL_RGBA16);
        struct hg_image real = ktx2_decode(&ktx2_files[i], HG_PIXEL_RGBA32F);
        const uint8_t *want = ktx2_wanted[i].pixels;
        for (size_t k = 0; k < ktx2_wanted[i].size_bytes; k++) {
            assert_int_equal(((const uint16_t *)deep.pixels)[k], want[k] * 257);
            assert_float_equal(((const float *)real.pixels)[k], want[k] / 255.0f, 1e-7f);
        }
        hg_image_finish(&deep);
        hg_image_finish(&real);
    }
}

// Texels as `file` has them when its samples mean these channels (-1: there is no second).
static struct hg_image with_channels(unsigned file, int first, int second, uint32_t channels)
{
    struct bytes b = ktx2_copy(file, 0);
    const size_t descriptor = get32(&b, DESCRIPTOR);
    b.data[descriptor + 28 + 3] = (uint8_t)first;
    if (second >= 0)
        b.data[descriptor + 28 + 16 + 3] = (uint8_t)second;
    struct hg_image_info info;
    struct hg_error err = {0};
    test_ok(hg_image_probe_memory(&(struct hg_image_bytes){b.data, b.size, "x.ktx2"}, &info, &err),
        &err);
    assert_int_equal(info.channels, channels);
    struct hg_image image = ktx2_decode(&b, HG_PIXEL_RGBA8);
    assert_int_equal(image.has_alpha, channels == 4);
    hg_free(b.data);
    return image;
}

// Each channel of `image` is one of the wanted ones, or one of these values.
enum { ZERO = 4, FULL };
static void expect_channels(struct hg_image image, unsigned file, const unsigned from[4])
{
    const uint8_t *got = image.pixels, *want = ktx2_wanted[file].pixels;
    for (size_t k = 0; k < image.size_bytes; k++) {
        const unsigned c = from[k % 4];
        assert_int_equal(got[k], c == ZERO ? 0 : c == FULL ? 255 : want[k / 4 * 4 + c]);
    }
    hg_image_finish(&image);
}

static void test_channels(void **state)
{
    (void)state;
    const unsigned rgb[4] = {0, 1, 2, FULL}, grey[4] = {0, 0, 0, FULL};
    const unsigned red_green[4] = {0, 1, ZERO, FULL}, red_alpha[4] = {0, 3, ZERO, FULL};
    expect_channels(with_channels(UASTC, 0, -1, 3), UASTC, rgb);
    expect_channels(with_channels(UASTC, 4, -1, 1), UASTC, grey);
    expect_channels(with_channels(UASTC, 5, -1, 2), UASTC, red_alpha);
    expect_channels(with_channels(UASTC, 6, -1, 2), UASTC, red_green);
    expect_channels(with_channels(ETC1S, 3, -1, 1), ETC1S, grey);
    expect_channels(with_channels(ETC1S_ALPHA, 3, 4, 2), ETC1S_ALPHA, red_alpha);
}

// Colours are rounded as ASTC rounds those of sRGB files, alpha never is.
static void test_srgb_rounding(void **state)
{
    (void)state;
    struct bytes b = ktx2_copy(UASTC, 0);
    b.data[get32(&b, DESCRIPTOR) + 14] = 2;
    struct hg_image image = ktx2_decode(&b, HG_PIXEL_RGBA8);
    const uint8_t *got = image.pixels, *linear = ktx2_wanted[UASTC].pixels;
    unsigned changed = 0;
    for (size_t k = 0; k < image.size_bytes; k++) {
        const int step = abs(got[k] - linear[k]);
        assert_true(step <= (k % 4 == 3 ? 0 : 1));
        changed += step != 0;
    }
    assert_true(changed > 0);
    hg_image_finish(&image);
    hg_free(b.data);
}

static void test_undefined_blocks(void **state)
{
    (void)state;
    static const uint8_t blocks[3][16] = {
        {0x45},                   // no mode
        {0x1d, 0, 0xf0, 0x01},    // mode 2, pattern 31 of 30
        {0x03, 0, 0xb0, 0, 0xff}, // mode 3, pattern 11 of 11
    };
    static const uint8_t error_colour[4] = {255, 0, 255, 255};
    struct bytes b = ktx2_copy(UASTC, 0);
    memcpy(b.data + get32(&b, LEVEL), blocks, sizeof blocks);
    struct hg_image image = ktx2_decode(&b, HG_PIXEL_RGBA8);
    for (unsigned y = 0; y < 4; y++)
        for (unsigned x = 0; x < 12; x++)
            assert_memory_equal(
                (uint8_t *)image.pixels + 4 * ((size_t)y * image.width + x), error_colour, 4);
    assert_memory_equal(
        (uint8_t *)image.pixels + 48, (uint8_t *)ktx2_wanted[UASTC].pixels + 48, 4 * 33);
    hg_image_finish(&image);
    hg_free(b.data);
}

// ---- Zstandard ---------------------------------------------------------------------------------

// The raw file with its level replaced.
static struct bytes with_level(const void *data, size_t size)
{
    struct bytes b = ktx2_copy(UASTC, size);
    const size_t at = ktx2_files[UASTC].size;
    memcpy(b.data + at, data, size);
    put32(&b, SCHEME, 2);
    put64(&b, LEVEL, at);
    put64(&b, LEVEL + 8, size);
    return b;
}

// One frame or two; the second says how much it holds only when `told`.
static struct bytes with_frames(bool two, bool told)
{
    uint8_t packed[4096];
    const uint8_t *raw = ktx2_files[UASTC].data + get32(&ktx2_files[UASTC], LEVEL);
    const size_t size = get32(&ktx2_files[UASTC], LEVEL_SIZE), split = two ? 500 : 0;
    ZSTD_CCtx *z = ZSTD_createCCtx();
    assert_false(ZSTD_isError(ZSTD_CCtx_setParameter(z, ZSTD_c_contentSizeFlag, told)));
    size_t n = two ? ZSTD_compress2(z, packed, sizeof packed, raw, split) : 0;
    n += ZSTD_compress2(z, packed + n, sizeof packed - n, raw + split, size - split);
    assert_true(n < sizeof packed);
    ZSTD_freeCCtx(z);
    return with_level(packed, n);
}

static void test_zstandard_frames(void **state)
{
    (void)state;
    for (unsigned i = 0; i < 4; i++) {
        struct bytes b = with_frames(i & 1, i >> 1 & 1);
        struct hg_image image = ktx2_decode(&b, HG_PIXEL_RGBA8);
        assert_memory_equal(image.pixels, ktx2_wanted[UASTC].pixels, image.size_bytes);
        hg_image_finish(&image);
        hg_free(b.data);
    }
}

// Memory that a frame asks for is bounded by what the level holds, or by 8 MiB.
static void test_zstandard_windows(void **state)
{
    (void)state;
    static const struct {
        uint8_t window; // (log - 10) << 3
        enum hg_status status;
    } cases[] = {{13 << 3, HG_E_FORMAT}, {14 << 3, HG_E_LIMIT}, {20 << 3, HG_E_LIMIT},
        {31 << 3, HG_E_FORMAT}}; // which the library knows nothing of
    for (unsigned i = 0; i < sizeof cases / sizeof *cases; i++) {
        const uint8_t frame[] = {0x28, 0xb5, 0x2f, 0xfd, 0, cases[i].window, 0x07, 0, 0};
        struct bytes b = with_level(frame, sizeof frame);
        ktx2_expect(&b, cases[i].status, "window");
        hg_free(b.data);
    }
    struct bytes b = with_level("no frame at all", 15);
    ktx2_expect(&b, HG_E_FORMAT, "no frame");
    hg_free(b.data);
}

static uint64_t told_of(const struct bytes *b)
{
    struct hg_image_reader *reader;
    struct hg_error err = {0};
    test_ok(hg_image_reader_open_memory(
                &(struct hg_image_bytes){b->data, b->size, "x"}, 1 << 16, &reader, &err),
        &err);
    const uint64_t bytes = hg_image_reader_info(reader)->row_buffer_bytes;
    hg_image_reader_close(reader);
    return bytes;
}

static void test_memory_is_told(void **state)
{
    (void)state;
    uint64_t bytes[2];
    for (unsigned i = 0; i < 2; i++) {
        struct bytes b = with_frames(false, i == 0);
        bytes[i] = told_of(&b);
        hg_free(b.data);
    }
    assert_true(bytes[0] > 960 && bytes[0] < 1 << 20); // the frame says that it is small
    assert_true(bytes[1] > 8 << 20);                   // it may have the largest window
    struct bytes b = with_frames(false, false);
    put32(&b, WIDTH, 8192);
    put32(&b, HEIGHT, 4096);
    put64(&b, LEVEL_SIZE, 8192 * 4096);
    assert_true(told_of(&b) > 32 << 20 && told_of(&b) < 40 << 20);
    put32(&b, HEIGHT, 65532);
    put64(&b, LEVEL_SIZE, 8192 * 65532);
    assert_true(told_of(&b) > 128 << 20 && told_of(&b) < 136 << 20);
    hg_free(b.data);
}

// ---- readers -----------------------------------------------------------------------------------

static struct hg_image_reader *open_reader(const struct bytes *b)
{
    struct hg_image_reader *reader;
    struct hg_error err = {0};
    test_ok(hg_image_reader_open_memory(
                &(struct hg_image_bytes){b->data, b->size, "x.ktx2"}, 4096, &reader, &err),
        &err);
    return reader;
}

// Rows [from, from + count) as they come now.
static void expect_rows(
    struct hg_image_reader *reader, unsigned file, uint32_t from, uint32_t count)
{
    const size_t row = (size_t)ktx2_wanted[file].width * 4;
    struct hg_error err = {0};
    uint8_t *rows = hg_calloc(count, row);
    assert_non_null(rows);
    test_ok(hg_image_reader_rows(reader, HG_PIXEL_RGBA8, count, rows, &err), &err);
    assert_memory_equal(rows, (uint8_t *)ktx2_wanted[file].pixels + from * row, count * row);
    hg_free(rows);
}

static void test_pieces_and_skips(void **state)
{
    (void)state;
    for (unsigned i = 0; i < FILES; i++)
        for (uint32_t piece = 1; piece < 12; piece++)
            for (uint32_t skip = 0; skip < 12; skip += 1 + skip / 2) {
                struct hg_image_reader *reader = open_reader(&ktx2_files[i]);
                for (uint32_t y = 0; y < ktx2_wanted[i].height; y += skip) {
                    const uint32_t left = ktx2_wanted[i].height - y;
                    const uint32_t count = piece < left ? piece : left;
                    expect_rows(reader, i, y, count);
                    hg_image_reader_skip(reader, skip);
                    y += count;
                }
                hg_image_reader_close(reader);
            }
}

static void test_past_the_end(void **state)
{
    (void)state;
    uint8_t rows[45 * 4 * 4];
    struct hg_error err = {0};
    struct hg_image_reader *reader = open_reader(&ktx2_files[UASTC]);
    hg_image_reader_skip(reader, 15);
    assert_int_equal(hg_image_reader_rows(reader, HG_PIXEL_RGBA8, 4, rows, &err), HG_E_INVAL);
    expect_rows(reader, UASTC, 15, 3);
    hg_image_reader_skip(reader, UINT32_MAX);
    assert_int_equal(hg_image_reader_rows(reader, HG_PIXEL_RGBA8, 1, rows, &err), HG_E_INVAL);
    uint64_t bytes;
    const struct hg_image_rect rect = {0, {0, 0}, {1, 1}};
    assert_int_equal(
        hg_image_reader_rect(reader, &rect, HG_PIXEL_RGBA8, rows, &bytes, &err), HG_E_INVAL);
    hg_image_reader_close(reader);
}

static void test_files_and_sleep(void **state)
{
    (void)state;
    for (unsigned i = 0; i < FILES; i++) {
        char path[512];
        struct hg_error err = {0};
        snprintf(path, sizeof path, "%s/tests/unit/ktx2/%s.ktx2", getenv("HELIO_SOURCE_DIR"),
            ktx2_names[i]);
        struct hg_image image;
        test_ok(hg_image_read_file(path, HG_PIXEL_RGBA8, NULL, &image, &err), &err);
        assert_memory_equal(image.pixels, ktx2_wanted[i].pixels, image.size_bytes);
        hg_image_finish(&image);
        struct hg_image_reader *reader;
        test_ok(hg_image_reader_open(path, 4096, &reader, &err), &err);
        assert_int_equal(hg_image_reader_info(reader)->file_bytes, ktx2_files[i].size);
        expect_rows(reader, i, 0, 7);
        assert_true(hg_image_reader_can_sleep(reader));
        hg_image_reader_sleep(reader);
        test_ok(hg_image_reader_wake(reader, &err), &err);
        hg_image_reader_skip(reader, 2);
        expect_rows(reader, i, 2, ktx2_wanted[i].height - 2);
        hg_image_reader_close(reader);
    }
}

// A file that is cut while it is read; rows are tried again.
static void test_shrinking_file(void **state)
{
    (void)state;
    char folder[TEST_FOLDER_MAX], path[TEST_FOLDER_MAX + 16];
    assert_true(test_folder_make(folder, "ktx2"));
    snprintf(path, sizeof path, "%s/x.ktx2", folder);
    for (unsigned i = 0; i < FILES; i++) {
        struct hg_image_reader *reader;
        struct hg_error err = {0};
        uint8_t rows[121 * 4];
        test_file_write(path, ktx2_files[i].data, ktx2_files[i].size);
        test_ok(hg_image_reader_open(path, 4096, &reader, &err), &err);
        test_file_write(path, ktx2_files[i].data, get32(&ktx2_files[i], LEVEL));
        for (unsigned k = 0; k < 2; k++)
            assert_int_equal(hg_image_reader_rows(reader, HG_PIXEL_RGBA8, 1, rows, &err), HG_E_IO);
        test_file_write(path, ktx2_files[i].data, ktx2_files[i].size);
        expect_rows(reader, i, 0, ktx2_wanted[i].height);
        hg_image_reader_close(reader);
    }
    assert_true(test_folder_remove(folder));
}

// The same reader goes on after it could not.
static void test_no_memory_for_rows(void **state)
{
    (void)state;
    uint8_t rows[121 * 4];
    for (unsigned i = 0; i < FILES; i++)
        for (uint64_t n = 1; n < 100; n++) {
            struct hg_error err = {0};
            struct hg_image_reader *reader = open_reader(&ktx2_files[i]);
            hg_alloc_fail_at(n);
            const enum hg_status status =
                hg_image_reader_rows(reader, HG_PIXEL_RGBA8, 1, rows, &err);
            hg_alloc_fail_at(0);
            assert_true(status == HG_E_NOMEM || status == HG_OK);
            expect_rows(reader, i, status == HG_OK, ktx2_wanted[i].height - (status == HG_OK));
            hg_image_reader_close(reader);
            if (status == HG_OK)
                break;
            assert_true(n < 99);
        }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_texels),
        cmocka_unit_test(test_wider_formats),
        cmocka_unit_test(test_channels),
        cmocka_unit_test(test_srgb_rounding),
        cmocka_unit_test(test_undefined_blocks),
        cmocka_unit_test(test_zstandard_frames),
        cmocka_unit_test(test_zstandard_windows),
        cmocka_unit_test(test_memory_is_told),
        cmocka_unit_test(test_pieces_and_skips),
        cmocka_unit_test(test_past_the_end),
        cmocka_unit_test(test_files_and_sleep),
        cmocka_unit_test(test_shrinking_file),
        cmocka_unit_test(test_no_memory_for_rows),
    };
    return cmocka_run_group_tests(tests, ktx2_read_all, ktx2_free_all);
}
