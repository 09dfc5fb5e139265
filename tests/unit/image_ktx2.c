// image_ktx2.c - KTX2 files of Basis Universal textures against texels that another decoder gave,
// and what damaged and hostile ones end in.
//
// Files in ktx2/ were made with the Basis Universal encoder, the PNG files beside them from texels
// of its transcoder. That one rounds sRGB as linear: colours of uastc_zstd are those of an ASTC
// decoder, which was given what the file transcodes to without loss.
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
#include "renderer/image/reader.h"
#include "tests/support/check.h"
#include "tests/support/folder.h"

enum {
    UASTC,       // 45 x 18, raw, alpha, linear; blocks of all 19 modes
    UASTC_ZSTD,  // 37 x 23, alpha, sRGB, 6 mips
    ETC1S,       // 121 x 125, sRGB, 7 mips; long runs
    ETC1S_ALPHA, // 37 x 23, sRGB
    FILES
};
static const char *const names[FILES] = {"uastc", "uastc_zstd", "etc1s", "etc1s_alpha"};

// Places in the header.
enum {
    FORMAT = 12,
    TYPE_SIZE = 16,
    WIDTH = 20,
    HEIGHT = 24,
    DEPTH = 28,
    LAYERS = 32,
    FACES = 36,
    LEVELS = 40,
    SCHEME = 44,
    DESCRIPTOR = 48, // offset, length
    KEYS = 56,
    GLOBALS = 64, // of 64 bits each, like those of the level
    LEVEL = 80,
    LEVEL_SIZE = 96,
};

struct bytes {
    uint8_t *data;
    size_t size;
};

static struct bytes files[FILES];
static struct hg_image wanted[FILES];

static struct bytes read_bytes(const char *name, const char *extension)
{
    char path[512];
    struct bytes b;
    struct hg_error err = {0};
    snprintf(
        path, sizeof path, "%s/tests/unit/ktx2/%s.%s", getenv("HELIO_SOURCE_DIR"), name, extension);
    test_ok(hg_file_read(path, 1 << 20, &b.data, &b.size, &err), &err);
    return b;
}

static int read_all(void **state)
{
    (void)state;
    for (unsigned i = 0; i < FILES; i++) {
        struct hg_error err = {0};
        files[i] = read_bytes(names[i], "ktx2");
        struct bytes png = read_bytes(names[i], "png");
        test_ok(hg_image_read_memory(&(struct hg_image_bytes){png.data, png.size, "png"},
                    HG_PIXEL_RGBA8, NULL, &wanted[i], &err),
            &err);
        hg_free(png.data);
    }
    return 0;
}

static int free_all(void **state)
{
    (void)state;
    for (unsigned i = 0; i < FILES; i++) {
        hg_free(files[i].data);
        hg_image_finish(&wanted[i]);
    }
    return 0;
}

static uint32_t get32(const struct bytes *b, size_t at)
{
    uint32_t v;
    memcpy(&v, b->data + at, sizeof v);
    return v;
}

static void put32(struct bytes *b, size_t at, uint32_t value)
{
    memcpy(b->data + at, &value, sizeof value);
}

static void put64(struct bytes *b, size_t at, uint64_t value)
{
    memcpy(b->data + at, &value, sizeof value);
}

// A file with room for more behind it.
static struct bytes copy_of(unsigned file, size_t more)
{
    struct bytes b = {hg_calloc(files[file].size + more, 1), files[file].size + more};
    assert_non_null(b.data);
    memcpy(b.data, files[file].data, files[file].size);
    return b;
}

static struct hg_image decode(const struct bytes *b, enum hg_pixel_format format)
{
    struct hg_image image;
    struct hg_error err = {0};
    test_ok(hg_image_read_memory(
                &(struct hg_image_bytes){b->data, b->size, "x.ktx2"}, format, NULL, &image, &err),
        &err);
    return image;
}

// Read as a picture: the status; an error has to say what of which file.
static enum hg_status try_decode(const uint8_t *data, size_t size, struct hg_error *err)
{
    struct hg_image image;
    *err = (struct hg_error){0};
    const enum hg_status status = hg_image_read_memory(
        &(struct hg_image_bytes){data, size, "x.ktx2"}, HG_PIXEL_RGBA8, NULL, &image, err);
    if (status != HG_OK) {
        assert_null(image.pixels);
        assert_int_equal(err->status, status);
        assert_non_null(strstr(err->what, "x.ktx2"));
        assert_true(err->reason[0] != '\0');
    }
    hg_image_finish(&image);
    return status;
}

static void expect(const struct bytes *b, enum hg_status want, const char *where)
{
    struct hg_error err;
    const enum hg_status got = try_decode(b->data, b->size, &err);
    if (got != want)
        fail_msg(
            "%s: %s (%s), not %s", where, hg_status_name(got), err.reason, hg_status_name(want));
}

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
                    &(struct hg_image_bytes){files[i].data, files[i].size, names[i]}, &info, &err),
            &err);
        assert_int_equal(info.width, want[i].width);
        assert_int_equal(info.height, want[i].height);
        assert_int_equal(info.channels, want[i].channels);
        assert_false(info.is_float || info.is_16bit);
        assert_string_equal(info.file_format, "ktx2");
        struct hg_image image = decode(&files[i], HG_PIXEL_RGBA8);
        assert_int_equal(image.has_alpha, want[i].channels == 4);
        assert_int_equal(image.width, wanted[i].width);
        assert_int_equal(image.height, wanted[i].height);
        assert_memory_equal(image.pixels, wanted[i].pixels, image.size_bytes);
        hg_image_finish(&image);
    }
}

static void test_wider_formats(void **state)
{
    (void)state;
    for (unsigned i = 0; i < FILES; i++) {
        struct hg_image deep = decode(&files[i], HG_PIXEL_RGBA16);
        struct hg_image real = decode(&files[i], HG_PIXEL_RGBA32F);
        const uint8_t *want = wanted[i].pixels;
        for (size_t k = 0; k < wanted[i].size_bytes; k++) {
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
    struct bytes b = copy_of(file, 0);
    const size_t descriptor = get32(&b, DESCRIPTOR);
    b.data[descriptor + 28 + 3] = (uint8_t)first;
    if (second >= 0)
        b.data[descriptor + 28 + 16 + 3] = (uint8_t)second;
    struct hg_image_info info;
    struct hg_error err = {0};
    test_ok(hg_image_probe_memory(&(struct hg_image_bytes){b.data, b.size, "x.ktx2"}, &info, &err),
        &err);
    assert_int_equal(info.channels, channels);
    struct hg_image image = decode(&b, HG_PIXEL_RGBA8);
    assert_int_equal(image.has_alpha, channels == 4);
    hg_free(b.data);
    return image;
}

// Each channel of `image` is one of the wanted ones, or one of these values.
enum { ZERO = 4, FULL };
static void expect_channels(struct hg_image image, unsigned file, const unsigned from[4])
{
    const uint8_t *got = image.pixels, *want = wanted[file].pixels;
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
    struct bytes b = copy_of(UASTC, 0);
    b.data[get32(&b, DESCRIPTOR) + 14] = 2;
    struct hg_image image = decode(&b, HG_PIXEL_RGBA8);
    const uint8_t *got = image.pixels, *linear = wanted[UASTC].pixels;
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
    struct bytes b = copy_of(UASTC, 0);
    memcpy(b.data + get32(&b, LEVEL), blocks, sizeof blocks);
    struct hg_image image = decode(&b, HG_PIXEL_RGBA8);
    for (unsigned y = 0; y < 4; y++)
        for (unsigned x = 0; x < 12; x++)
            assert_memory_equal(
                (uint8_t *)image.pixels + 4 * ((size_t)y * image.width + x), error_colour, 4);
    assert_memory_equal((uint8_t *)image.pixels + 48, (uint8_t *)wanted[UASTC].pixels + 48, 4 * 33);
    hg_image_finish(&image);
    hg_free(b.data);
}

// ---- Zstandard ---------------------------------------------------------------------------------

// The raw file with its level replaced.
static struct bytes with_level(const void *data, size_t size)
{
    struct bytes b = copy_of(UASTC, size);
    const size_t at = files[UASTC].size;
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
    const uint8_t *raw = files[UASTC].data + get32(&files[UASTC], LEVEL);
    const size_t size = get32(&files[UASTC], LEVEL_SIZE), split = two ? 500 : 0;
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
        struct hg_image image = decode(&b, HG_PIXEL_RGBA8);
        assert_memory_equal(image.pixels, wanted[UASTC].pixels, image.size_bytes);
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
        expect(&b, cases[i].status, "window");
        hg_free(b.data);
    }
    struct bytes b = with_level("no frame at all", 15);
    expect(&b, HG_E_FORMAT, "no frame");
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
    const size_t row = (size_t)wanted[file].width * 4;
    struct hg_error err = {0};
    uint8_t *rows = hg_calloc(count, row);
    assert_non_null(rows);
    test_ok(hg_image_reader_rows(reader, HG_PIXEL_RGBA8, count, rows, &err), &err);
    assert_memory_equal(rows, (uint8_t *)wanted[file].pixels + from * row, count * row);
    hg_free(rows);
}

static void test_pieces_and_skips(void **state)
{
    (void)state;
    for (unsigned i = 0; i < FILES; i++)
        for (uint32_t piece = 1; piece < 12; piece++)
            for (uint32_t skip = 0; skip < 12; skip += 1 + skip / 2) {
                struct hg_image_reader *reader = open_reader(&files[i]);
                for (uint32_t y = 0; y < wanted[i].height; y += skip) {
                    const uint32_t left = wanted[i].height - y;
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
    struct hg_image_reader *reader = open_reader(&files[UASTC]);
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
        snprintf(
            path, sizeof path, "%s/tests/unit/ktx2/%s.ktx2", getenv("HELIO_SOURCE_DIR"), names[i]);
        struct hg_image image;
        test_ok(hg_image_read_file(path, HG_PIXEL_RGBA8, NULL, &image, &err), &err);
        assert_memory_equal(image.pixels, wanted[i].pixels, image.size_bytes);
        hg_image_finish(&image);
        struct hg_image_reader *reader;
        test_ok(hg_image_reader_open(path, 4096, &reader, &err), &err);
        assert_int_equal(hg_image_reader_info(reader)->file_bytes, files[i].size);
        expect_rows(reader, i, 0, 7);
        assert_true(hg_image_reader_can_sleep(reader));
        hg_image_reader_sleep(reader);
        test_ok(hg_image_reader_wake(reader, &err), &err);
        hg_image_reader_skip(reader, 2);
        expect_rows(reader, i, 2, wanted[i].height - 2);
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
        test_file_write(path, files[i].data, files[i].size);
        test_ok(hg_image_reader_open(path, 4096, &reader, &err), &err);
        test_file_write(path, files[i].data, get32(&files[i], LEVEL));
        for (unsigned k = 0; k < 2; k++)
            assert_int_equal(hg_image_reader_rows(reader, HG_PIXEL_RGBA8, 1, rows, &err), HG_E_IO);
        test_file_write(path, files[i].data, files[i].size);
        expect_rows(reader, i, 0, wanted[i].height);
        hg_image_reader_close(reader);
    }
    assert_true(test_folder_remove(folder));
}

// ---- what is refused ---------------------------------------------------------------------------

static void test_limits(void **state)
{
    (void)state;
    struct hg_image image;
    struct hg_image_reader *reader;
    struct hg_error err = {0};
    const struct hg_image_limits limits[] = {
        {.max_side_px = 44}, {.max_pixels = 45 * 18 - 1}, {.max_bytes = 45 * 18 * 4 - 1}};
    for (unsigned i = 0; i < 3; i++) {
        assert_int_equal(hg_image_read_memory(
                             &(struct hg_image_bytes){files[UASTC].data, files[UASTC].size, "x"},
                             HG_PIXEL_RGBA8, &limits[i], &image, &err),
            HG_E_LIMIT);
        assert_null(image.pixels);
    }
    assert_int_equal(
        hg_image_reader_open_memory(
            &(struct hg_image_bytes){files[UASTC].data, files[UASTC].size, "x"}, 44, &reader, &err),
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
        struct bytes b = copy_of(UASTC, 0);
        put32(&b, cases[i].at, cases[i].value);
        expect(&b, cases[i].status, cases[i].what);
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
        struct bytes b = copy_of(cases[i].file, 0);
        b.data[get32(&b, DESCRIPTOR) + cases[i].at] = cases[i].value;
        char text[16];
        snprintf(text, sizeof text, "case %u", i);
        expect(&b, cases[i].status, text);
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
        const size_t at = files[UASTC].size;
        struct bytes b = copy_of(UASTC, 32);
        put32(&b, at, cases[i].length);
        memcpy(b.data + at + 4, cases[i].pair, 28);
        put32(&b, KEYS, (uint32_t)at);
        put32(&b, KEYS + 4, cases[i].length < 28 ? cases[i].length + 4 : 32);
        expect(&b, cases[i].status, cases[i].pair);
        hg_free(b.data);
    }
}

static void test_long_parts(void **state)
{
    (void)state;
    for (unsigned i = 0; i < 2; i++) {
        struct bytes b = copy_of(UASTC, 2 << 20);
        put32(&b, i ? KEYS : DESCRIPTOR, (uint32_t)files[UASTC].size);
        put32(&b, (i ? KEYS : DESCRIPTOR) + 4, i ? 2 << 20 : 5000);
        expect(&b, HG_E_LIMIT, i ? "keys" : "descriptor");
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
        struct bytes b = copy_of(ETC1S_ALPHA, 0);
        put32(&b, get32(&b, GLOBALS) + cases[i].at, cases[i].value);
        expect(&b, cases[i].status, cases[i].what);
        hg_free(b.data);
    }
    for (unsigned i = 0; i < 3; i++) {
        struct bytes b = copy_of(ETC1S_ALPHA, 0);
        put32(&b, i < 2 ? GLOBALS + 8 * i : LEVELS, i < 2 ? 0xfffffff0 : 32);
        expect(&b, HG_E_FORMAT, "place of global data");
        hg_free(b.data);
    }
}

// ---- damage ------------------------------------------------------------------------------------

static void test_every_prefix(void **state)
{
    (void)state;
    for (unsigned i = 0; i < FILES; i++)
        for (size_t n = 0; n < files[i].size; n++) {
            struct hg_error err;
            uint8_t *block = malloc(n ? n : 1); // of that very size, for the sanitiser
            assert_non_null(block);
            memcpy(block, files[i].data, n);
            assert_int_equal(try_decode(block, n, &err), HG_E_FORMAT);
            free(block);
        }
}

static void test_every_byte(void **state)
{
    (void)state;
    static const uint8_t changes[] = {0x01, 0x80, 0xff};
    unsigned decoded = 0, refused = 0;
    for (unsigned i = 0; i < FILES; i++) {
        uint8_t *block = malloc(files[i].size);
        assert_non_null(block);
        memcpy(block, files[i].data, files[i].size);
        for (size_t k = 0; k < files[i].size * sizeof changes; k++) {
            struct hg_error err;
            block[k / sizeof changes] ^= changes[k % sizeof changes];
            const enum hg_status status = try_decode(block, files[i].size, &err);
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
            status = try_decode(files[i].data, files[i].size, &err);
            hg_alloc_fail_at(0);
            if (status != HG_OK)
                assert_int_equal(status, HG_E_NOMEM);
            assert_true(n < 1000);
        }
        assert_true(n > 5);
    }
}

// The same reader goes on after it could not.
static void test_no_memory_for_rows(void **state)
{
    (void)state;
    uint8_t rows[121 * 4];
    for (unsigned i = 0; i < FILES; i++)
        for (uint64_t n = 1; n < 100; n++) {
            struct hg_error err = {0};
            struct hg_image_reader *reader = open_reader(&files[i]);
            hg_alloc_fail_at(n);
            const enum hg_status status =
                hg_image_reader_rows(reader, HG_PIXEL_RGBA8, 1, rows, &err);
            hg_alloc_fail_at(0);
            assert_true(status == HG_E_NOMEM || status == HG_OK);
            expect_rows(reader, i, status == HG_OK, wanted[i].height - (status == HG_OK));
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
        cmocka_unit_test(test_limits),
        cmocka_unit_test(test_headers),
        cmocka_unit_test(test_descriptors),
        cmocka_unit_test(test_keys),
        cmocka_unit_test(test_long_parts),
        cmocka_unit_test(test_global_data),
        cmocka_unit_test(test_every_prefix),
        cmocka_unit_test(test_every_byte),
        cmocka_unit_test(test_no_memory),
        cmocka_unit_test(test_no_memory_for_rows),
    };
    return cmocka_run_group_tests(tests, read_all, free_all);
}
