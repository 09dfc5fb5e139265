// image_rows.c - PNG and JPEG files of every kind, read by rows.h and by OpenImageIO: the same
// pixels.
#include <png.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <dirent.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>

#include <cmocka.h>
#include <turbojpeg.h>

#include "base/alloc.h"
#include "base/file.h"
#include "renderer/image/check.h"
#include "renderer/image/rows.h"
#include "tests/support/test_data.h"

enum { WIDTH = 37, HEIGHT = 29 };

static const enum hg_oiio_type types[] = {HG_OIIO_NATIVE, HG_OIIO_U8, HG_OIIO_U16, HG_OIIO_F32};

static size_t bytes_of(const struct hg_oiio_header *h, enum hg_oiio_type type)
{
    static const size_t bytes[] = {[HG_OIIO_U8] = 1, [HG_OIIO_U16] = 2, [HG_OIIO_F32] = 4};
    return type == HG_OIIO_NATIVE ? (h->is_16bit ? 2 : 1) : bytes[type];
}

// ---- both readers
// --------------------------------------------------------------------------------

typedef enum hg_status open_fn(FILE *file, const struct hg_image_bytes *bytes, bool large,
    struct hg_rows_input **out, struct hg_error *err);

struct format {
    const char *name; // OpenImageIO's
    open_fn *open;
};
static const struct format png_format = {"png", hg_png_open}, jpeg_format = {"jpeg", hg_jpeg_open};

struct both {
    const struct format *format;
    struct hg_image_bytes file;
    struct hg_rows_input *ours;
    struct hg_oiio_input *theirs;
    const struct hg_oiio_header *h; // the same
};

static void compare_headers(const struct both *b)
{
    const struct hg_oiio_header *theirs = hg_oiio_get_header(b->theirs);
    if (b->h->width != theirs->width || b->h->height != theirs->height ||
        b->h->channels != theirs->channels || b->h->alpha_channel != theirs->alpha_channel ||
        b->h->is_16bit != theirs->is_16bit || b->h->is_float != theirs->is_float ||
        b->h->straight_alpha != theirs->straight_alpha || b->h->row_bytes != theirs->row_bytes ||
        b->h->image_bytes != theirs->image_bytes)
        fail_msg("%s: another header than OpenImageIO's", b->file.name);
}

static void compare_pixels(const struct both *b, enum hg_oiio_type type, int channels)
{
    const size_t stride = bytes_of(b->h, type) * (size_t)channels * (size_t)b->h->width;
    const size_t size = stride * (size_t)b->h->height;
    uint8_t *ours = calloc(size, 1), *theirs = calloc(size, 1);
    struct hg_error err = {0};
    // OpenImageIO 2.4 cannot go back in a PNG in memory: opened anew each time.
    const struct hg_oiio_target whole = {type, channels, theirs};
    struct hg_oiio_input *again;
    if (hg_oiio_open(NULL, &b->file, b->format->name, false, &again, &err) != HG_OK ||
        hg_oiio_read_image(again, 0, &whole, &err) != HG_OK)
        fail_msg("%s: OpenImageIO: %s", b->file.name, err.reason);
    hg_oiio_close(again);
    const uint32_t height = (uint32_t)b->h->height, half = height / 2;
    // The lower half first: going back begins anew.
    const uint32_t parts[2][2] = {{half, height - half}, {0, half}};
    for (int i = 0; i < 2; i++) {
        const struct hg_oiio_target to = {type, channels, ours + stride * parts[i][0]};
        if (hg_rows_read(b->ours, parts[i][0], parts[i][1], &to, &err) != HG_OK)
            fail_msg("%s: %s", err.what, err.reason);
    }
    if (memcmp(ours, theirs, size) != 0)
        fail_msg("%s: other pixels than OpenImageIO's (type %d, %d channels)", b->file.name,
            (int)type, channels);
    free(ours);
    free(theirs);
}

static void compare(const struct format *format, const void *data, size_t size, const char *name)
{
    struct hg_error err = {0};
    struct both b = {.format = format, .file = {data, size, name}};
    if (format->open(NULL, &b.file, false, &b.ours, &err) != HG_OK)
        fail_msg("%s: %s", err.what, err.reason);
    if (hg_oiio_open(NULL, &b.file, format->name, false, &b.theirs, &err) != HG_OK)
        fail_msg("%s: %s", err.what, err.reason);
    b.h = &b.ours->header;
    compare_headers(&b);
    for (size_t i = 0; i < sizeof types / sizeof *types; i++)
        for (int channels = 1; channels <= b.h->channels; channels++)
            compare_pixels(&b, types[i], channels);
    hg_rows_close(b.ours);
    hg_oiio_close(b.theirs);
}

// ---- files made here
// -----------------------------------------------------------------------------

struct png_kind {
    int color, depth;
    bool interlaced, transparent;
};

static void put(png_structp png, png_bytep data, size_t size)
{
    hg_write_bytes(png_get_io_ptr(png), data, size);
}

static void describe(png_structp png, png_infop info, const struct png_kind *k)
{
    png_color palette[256];
    png_byte alphas[4] = {0, 100, 200, 255};
    const png_color_16 key = {.index = 0, .red = 3, .green = 3, .blue = 3, .gray = 1};
    for (int i = 0; i < 256; i++)
        palette[i] = (png_color){(png_byte)i, (png_byte)(255 - i), (png_byte)(i * 7)};
    png_set_IHDR(png, info, WIDTH, HEIGHT, k->depth, k->color,
        k->interlaced ? PNG_INTERLACE_ADAM7 : PNG_INTERLACE_NONE, 0, 0);
    if (k->color == PNG_COLOR_TYPE_PALETTE)
        png_set_PLTE(png, info, palette, 1 << k->depth);
    if (k->transparent && k->color == PNG_COLOR_TYPE_PALETTE)
        png_set_tRNS(png, info, alphas, k->depth > 1 ? 4 : 2, NULL);
    else if (k->transparent)
        png_set_tRNS(png, info, NULL, 0, &key);
}

static struct hg_writer make_png(const struct png_kind *k)
{
    struct hg_writer out = {0};
    png_structp png = png_create_write_struct(PNG_LIBPNG_VER_STRING, NULL, NULL, NULL);
    png_infop info = png_create_info_struct(png);
    png_set_write_fn(png, &out, put, NULL);
    describe(png, info, k);
    png_write_info(png, info);
    static uint8_t pixels[HEIGHT][WIDTH * 8];
    png_bytep rows[HEIGHT];
    uint32_t state = 1;
    for (int y = 0; y < HEIGHT; y++) {
        rows[y] = pixels[y];
        for (size_t i = 0; i < sizeof pixels[y]; i++)
            // Many equal pixels, among them those of the transparent colour.
            pixels[y][i] =
                (state = state * 1664525u + 1013904223u) >> 30 ? (uint8_t)(state >> 24) : 3;
    }
    png_write_image(png, rows);
    png_write_end(png, info);
    png_destroy_write_struct(&png, &info);
    return out;
}

static void every_kind_of_png_is_read_as_openimageio_reads_it(void **state)
{
    (void)state;
    static const int depths[][2] = {{PNG_COLOR_TYPE_GRAY, 1}, {PNG_COLOR_TYPE_GRAY, 2},
        {PNG_COLOR_TYPE_GRAY, 4}, {PNG_COLOR_TYPE_GRAY, 8}, {PNG_COLOR_TYPE_GRAY, 16},
        {PNG_COLOR_TYPE_PALETTE, 1}, {PNG_COLOR_TYPE_PALETTE, 2}, {PNG_COLOR_TYPE_PALETTE, 4},
        {PNG_COLOR_TYPE_PALETTE, 8}, {PNG_COLOR_TYPE_RGB, 8}, {PNG_COLOR_TYPE_RGB, 16},
        {PNG_COLOR_TYPE_GRAY_ALPHA, 8}, {PNG_COLOR_TYPE_GRAY_ALPHA, 16},
        {PNG_COLOR_TYPE_RGB_ALPHA, 8}, {PNG_COLOR_TYPE_RGB_ALPHA, 16}};
    for (size_t i = 0; i < sizeof depths / sizeof *depths; i++)
        for (int variant = 0; variant < 4; variant++) {
            const struct png_kind k = {depths[i][0], depths[i][1], variant & 1, variant & 2};
            char name[64];
            if (k.transparent && k.color & PNG_COLOR_MASK_ALPHA)
                continue;
            snprintf(name, sizeof name, "color %d, %d bits%s%s", k.color, k.depth,
                k.interlaced ? ", interlaced" : "", k.transparent ? ", transparent" : "");
            struct hg_writer file = make_png(&k);
            compare(&png_format, file.data, file.size, name);
            hg_writer_finish(&file);
        }
}

// Every end of a file that is cut short is an error, before or while rows are read, and stays one.
static long most_kib(void)
{
    struct rusage usage;
    assert_int_equal(getrusage(RUSAGE_SELF, &usage), 0);
    return usage.ru_maxrss;
}

// libpng has two rows for itself, of 2 GiB each here: not before pixels are read.
static void what_a_png_claims_takes_no_memory(void **state)
{
    (void)state;
    static const uint32_t width = (UINT32_C(1) << 28) + 1;
    struct hg_writer file = {0};
    struct hg_rows_input *input;
    struct hg_error err = {0};
    png_structp png = png_create_write_struct(PNG_LIBPNG_VER_STRING, NULL, NULL, NULL);
    png_infop info = png_create_info_struct(png);
    png_set_write_fn(png, &file, put, NULL);
    png_set_user_limits(png, width, 1);
    png_set_IHDR(png, info, width, 1, 16, PNG_COLOR_TYPE_RGB_ALPHA, PNG_INTERLACE_NONE,
        PNG_COMPRESSION_TYPE_DEFAULT, PNG_FILTER_TYPE_DEFAULT);
    png_write_info(png, info);
    png_write_chunk(png, (png_const_bytep) "IDAT", (png_const_bytep) "data", 4);
    png_destroy_write_struct(&png, &info);
    const struct hg_image_bytes bytes = {file.data, file.size, "wide.png"};
    const long before_kib = most_kib();
    assert_int_equal(hg_png_open(NULL, &bytes, false, &input, &err), HG_E_LIMIT);
    assert_int_equal(hg_png_open(NULL, &bytes, true, &input, &err), HG_OK);
    assert_int_equal(input->header.width, (int)width);
    hg_rows_close(input);
    assert_in_range(most_kib() - before_kib, 0, 64 << 10);
    hg_writer_finish(&file);
}

static void cut_pngs_are_refused(void **state)
{
    (void)state;
    static uint8_t pixels[HEIGHT * WIDTH * 8];
    for (int interlaced = 0; interlaced < 2; interlaced++) {
        struct hg_writer file =
            make_png(&(struct png_kind){PNG_COLOR_TYPE_RGB, 8, interlaced, false});
        for (size_t size = 0; size + 16 < file.size; size += 1 + size / 32) {
            struct hg_rows_input *input;
            struct hg_error err = {0};
            uint8_t *exact = malloc(size ? size : 1); // so that reading beyond it is found
            memcpy(exact, file.data, size);
            enum hg_status status = hg_png_open(
                NULL, &(struct hg_image_bytes){exact, size, "cut.png"}, false, &input, &err);
            for (int tries = 0; tries < 2 && input; tries++)
                status = hg_rows_read(
                    input, 0, HEIGHT, &(struct hg_oiio_target){HG_OIIO_U8, 3, pixels}, &err);
            assert_int_equal(status, HG_E_FORMAT);
            assert_string_equal(err.what, "cut.png");
            hg_rows_close(input);
            free(exact);
        }
        hg_writer_finish(&file);
    }
}

// ---- files of others
// -----------------------------------------------------------------------------

static void compare_file(const char *path)
{
    uint8_t *data;
    size_t size;
    struct hg_error err = {0};
    struct hg_rows_input *ours = NULL;
    struct hg_oiio_input *theirs = NULL;
    assert_int_equal(hg_file_read(path, 64 << 20, &data, &size, &err), HG_OK);
    const struct hg_image_bytes file = {data, size, path};
    if (hg_check_png(data, size, path, &err) == HG_OK) { // what no reader gets to see
        const bool is_ours = hg_png_open(NULL, &file, false, &ours, &err) == HG_OK;
        if (is_ours != (hg_oiio_open(NULL, &file, "png", false, &theirs, &err) == HG_OK))
            fail_msg("%s: only one of two readers opens it", path);
    }
    hg_rows_close(ours);
    hg_oiio_close(theirs);
    // Names that begin with x are damaged: their rows may end in an error at different places.
    const char *slash = strrchr(path, '/');
    if (ours && slash[1] != 'x')
        compare(&png_format, data, size, path);
    hg_free(data);
}

static void the_png_suite_is_read_as_openimageio_reads_it(void **state)
{
    (void)state;
    const char *folder = test_data("image-corpora/pngsuite");
    struct dirent **entries;
    const int count = scandir(folder, &entries, NULL, alphasort);
    int files = 0;
    for (int i = 0; i < count; i++) {
        char path[1024];
        const char *dot = strrchr(entries[i]->d_name, '.');
        snprintf(path, sizeof path, "%s/%s", folder, entries[i]->d_name);
        if (dot && strcmp(dot, ".png") == 0) {
            compare_file(path);
            files++;
        }
        free(entries[i]);
    }
    free(entries);
    assert_true(files > 100);
}

// ---- JPEG
// ----------------------------------------------------------------------------------------

static void every_kind_of_jpeg_is_read_as_openimageio_reads_it(void **state)
{
    (void)state;
    static const int samplings[] = {TJSAMP_444, TJSAMP_422, TJSAMP_420, TJSAMP_440, TJSAMP_GRAY};
    static uint8_t pixels[HEIGHT][WIDTH][3];
    tjhandle handle = tjInitCompress();
    for (int y = 0; y < HEIGHT; y++)
        for (int x = 0; x < WIDTH; x++)
            for (int c = 0; c < 3; c++)
                pixels[y][x][c] = (uint8_t)(x * (7 - c) + y * (c + 3) + (x * y * c) / 16);
    for (size_t i = 0; i < sizeof samplings / sizeof *samplings; i++)
        for (int progressive = 0; progressive < 2; progressive++) {
            unsigned char *file = NULL;
            unsigned long size = 0;
            char name[64];
            assert_int_equal(tjCompress2(handle, pixels[0][0], WIDTH, 0, HEIGHT, TJPF_RGB, &file,
                                 &size, samplings[i], 85, progressive ? TJFLAG_PROGRESSIVE : 0),
                0);
            snprintf(name, sizeof name, "sampling %d%s", samplings[i],
                progressive ? ", progressive" : "");
            compare(&jpeg_format, file, size, name);
            tjFree(file);
        }
    tjDestroy(handle);
}

// A hundred bytes for each scan ask for a pass over a whole picture each.
static void jpegs_of_many_scans_are_refused(void **state)
{
    (void)state;
    static uint8_t pixels[64][64][3], rows[64 * 64 * 3];
    tjhandle handle = tjInitCompress();
    unsigned char *file = NULL;
    unsigned long size = 0;
    assert_int_equal(tjCompress2(handle, pixels[0][0], 64, 0, 64, TJPF_RGB, &file, &size,
                         TJSAMP_444, 85, TJFLAG_PROGRESSIVE),
        0);
    tjDestroy(handle);
    size_t at = 0; // of the last scan: SOS (ffda) up to the end (ffd9)
    for (size_t i = 0; i + 1 < size; i++)
        at = file[i] == 0xff && file[i + 1] == 0xda ? i : at;
    struct hg_writer many = {0};
    hg_write_bytes(&many, file, at);
    for (int i = 0; i < 600; i++)
        hg_write_bytes(&many, file + at, size - 2 - at);
    hg_write_bytes(&many, file + size - 2, 2);
    struct hg_rows_input *input;
    struct hg_error err = {0};
    const struct hg_image_bytes bytes = {many.data, many.size, "scans.jpg"};
    assert_int_equal(hg_jpeg_open(NULL, &bytes, false, &input, &err), HG_OK);
    for (int tries = 0; tries < 2; tries++)
        assert_int_equal(
            hg_rows_read(input, 0, 64, &(struct hg_oiio_target){HG_OIIO_U8, 3, rows}, &err),
            HG_E_LIMIT);
    hg_rows_close(input);
    hg_writer_finish(&many);
    tjFree(file);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_kind_of_png_is_read_as_openimageio_reads_it),
        cmocka_unit_test(cut_pngs_are_refused),
        cmocka_unit_test(what_a_png_claims_takes_no_memory),
        cmocka_unit_test(every_kind_of_jpeg_is_read_as_openimageio_reads_it),
        cmocka_unit_test(jpegs_of_many_scans_are_refused),
        cmocka_unit_test(the_png_suite_is_read_as_openimageio_reads_it),
    };
    return test_run_group(tests, NULL, NULL);
}
