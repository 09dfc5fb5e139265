// image_ktx2_files.c - see image_ktx2_files.h.
#include "tests/unit/image_ktx2_files.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "base/alloc.h"
#include "base/file.h"
#include "tests/support/check.h"

const char *const ktx2_names[FILES] = {"uastc", "uastc_zstd", "etc1s", "etc1s_alpha"};

struct bytes ktx2_files[FILES];
struct hg_image ktx2_wanted[FILES];

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

int ktx2_read_all(void **state)
{
    (void)state;
    for (unsigned i = 0; i < FILES; i++) {
        struct hg_error err = {0};
        ktx2_files[i] = read_bytes(ktx2_names[i], "ktx2");
        struct bytes png = read_bytes(ktx2_names[i], "png");
        test_ok(hg_image_read_memory(&(struct hg_image_bytes){png.data, png.size, "png"},
                    HG_PIXEL_RGBA8, NULL, &ktx2_wanted[i], &err),
            &err);
        hg_free(png.data);
    }
    return 0;
}

int ktx2_free_all(void **state)
{
    (void)state;
    for (unsigned i = 0; i < FILES; i++) {
        hg_free(ktx2_files[i].data);
        hg_image_finish(&ktx2_wanted[i]);
    }
    return 0;
}

uint32_t get32(const struct bytes *b, size_t at)
{
    uint32_t v;
    memcpy(&v, b->data + at, sizeof v);
    return v;
}

void put32(struct bytes *b, size_t at, uint32_t value)
{
    memcpy(b->data + at, &value, sizeof value);
}

void put64(struct bytes *b, size_t at, uint64_t value)
{
    memcpy(b->data + at, &value, sizeof value);
}

// A file with room for more behind it.
struct bytes ktx2_copy(unsigned file, size_t more)
{
    struct bytes b = {hg_calloc(ktx2_files[file].size + more, 1), ktx2_files[file].size + more};
    assert_non_null(b.data);
    memcpy(b.data, ktx2_files[file].data, ktx2_files[file].size);
    return b;
}

struct hg_image ktx2_decode(const struct bytes *b, enum hg_pixel_format format)
{
    struct hg_image image;
    struct hg_error err = {0};
    test_ok(hg_image_read_memory(
                &(struct hg_image_bytes){b->data, b->size, "x.ktx2"}, format, NULL, &image, &err),
        &err);
    return image;
}

// Read as a picture: the status; an error has to say what of which file.
enum hg_status ktx2_try_decode(const uint8_t *data, size_t size, struct hg_error *err)
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

void ktx2_expect(const struct bytes *b, enum hg_status want, const char *where)
{
    struct hg_error err;
    const enum hg_status got = ktx2_try_decode(b->data, b->size, &err);
    if (got != want)
        fail_msg(
            "%s: %s (%s), not %s", where, hg_status_name(got), err.reason, hg_status_name(want));
}
