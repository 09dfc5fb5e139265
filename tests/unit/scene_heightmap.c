// scene_heightmap.c - height maps as scenes: SRTM tiles, 16-bit pictures, gzip, refusals.
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <zlib.h>

#include "base/alloc.h"
#include "renderer/scene/load.h"
#include "tests/support/folder.h"
#include "tests/support/test_data.h"

#define SIDE 1201u

static char folder[TEST_FOLDER_MAX];

static void path_of(const char *name, char path[128])
{
    snprintf(path, 128, "%s/%s", folder, name);
}

// A slope to the east of 2 m per sample with one void.
static void write_tile(const char *name, size_t bytes, bool gzip)
{
    char path[128];
    uint8_t *data = hg_calloc(SIDE * SIDE, 2);
    assert_non_null(data);
    for (uint32_t i = 0; i < SIDE * SIDE; i++) {
        const uint16_t v = i == 5 ? 0x8000u : (uint16_t)((i % SIDE) * 2 + 100);
        data[i * 2] = (uint8_t)(v >> 8);
        data[i * 2 + 1] = (uint8_t)v;
    }
    path_of(name, path);
    if (gzip) {
        gzFile file = gzopen(path, "wb1");
        assert_non_null(file);
        assert_int_equal(gzwrite(file, data, (unsigned)bytes), bytes);
        assert_int_equal(gzclose(file), Z_OK);
    } else {
        test_file_write(path, data, bytes);
    }
    hg_free(data);
}

static int make_folder(void **state)
{
    (void)state;
    return !test_folder_make(folder, "heights");
}

static int remove_folder(void **state)
{
    (void)state;
    return !test_folder_remove(folder);
}

static enum hg_status load(
    const char *path, uint64_t limit, struct hg_asset **asset, struct hg_error *err)
{
    return hg_load_asset(
        &(struct hg_load_params){
            .path = path, .asset_number = 1, .scene_index = -1, .memory_limit_bytes = limit},
        asset, err);
}

static void check_slope(const char *name)
{
    char path[128];
    struct hg_asset *asset;
    struct hg_error err = {0};
    path_of(name, path);
    assert_int_equal(load(path, 0, &asset, &err), HG_OK);
    assert_int_equal(asset->mesh_count, 1);
    assert_int_equal(asset->warning_count, 1); // the void
    assert_int_equal(asset->root_count, 1);
    const struct hg_mesh_part *p = &asset->meshes[0]->parts[0];
    assert_int_equal(p->vertex_count, SIDE * SIDE);
    assert_int_equal(p->index_count, (SIDE - 1) * (SIDE - 1) * 6);
    // 60 degrees north: half as wide as high; half a degree farther, as the middle is taken.
    const float wide = p->bounds_max[0] - p->bounds_min[0],
                high = p->bounds_max[2] - p->bounds_min[2];
    assert_true(fabsf(high - 111319.5f) < 1.0f);
    assert_true(fabsf(wide / high - cosf(60.5f * 0.017453293f)) < 1e-4f);
    assert_true(p->bounds_min[1] == 100.0f && p->bounds_max[1] == 2500.0f);
    assert_true(p->positions[5 * 3 + 1] == 100.0f); // the void takes the lowest
    // In the middle: rises to the east, faces up.
    const float *n = p->normals + ((size_t)600 * SIDE + 600) * 3;
    const float slope = 2.0f / (wide / (float)(SIDE - 1));
    assert_true(fabsf(n[0] / n[1] + slope) < 1e-4f && n[1] > 0.99f && fabsf(n[2]) < 1e-6f);
    const uint32_t *t = p->indices;
    const float *a = p->positions + t[0] * 3, *b = p->positions + t[1] * 3,
                *c = p->positions + t[2] * 3;
    assert_true((b[2] - a[2]) * (c[0] - a[0]) - (b[0] - a[0]) * (c[2] - a[2]) > 0.0f);
    hg_asset_destroy(asset);
}

static void test_srtm_tile(void **state)
{
    (void)state;
    write_tile("N60E008.hgt", SIDE * SIDE * 2, false);
    check_slope("N60E008.hgt");
}

static void test_gzipped_tile(void **state)
{
    (void)state;
    write_tile("N60W012.hgt.gz", SIDE * SIDE * 2, true);
    check_slope("N60W012.hgt.gz");
}

static void test_refused(void **state)
{
    (void)state;
    char path[128];
    struct hg_asset *asset;
    struct hg_error err = {0};
    write_tile("S01E001.hgt", SIDE * SIDE * 2 - 2, false);
    path_of("S01E001.hgt", path);
    assert_int_equal(load(path, 0, &asset, &err), HG_E_FORMAT);
    assert_null(asset);
    write_tile("S02E001.hgt", SIDE * SIDE * 2, false);
    path_of("S02E001.hgt", path);
    assert_int_equal(load(path, 20u << 20, &asset, &err), HG_E_LIMIT);
    assert_null(asset);
}

static void test_real_picture(void **state)
{
    (void)state;
    const char *path = test_data("big-geometry/srtm/N46E008_height16.png");
    struct hg_asset *asset;
    struct hg_error err = {0};
    if (load(path, 0, &asset, &err) != HG_OK)
        fail_msg("%s: %s", err.what, err.reason);
    const struct hg_mesh_part *p = &asset->meshes[0]->parts[0];
    assert_int_equal(p->index_count / 3, 2880000);
    assert_true(p->bounds_max[1] > 4000.0f && p->bounds_max[1] < 4810.0f); // the Alps
    hg_asset_destroy(asset);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_srtm_tile),
        cmocka_unit_test(test_gzipped_tile),
        cmocka_unit_test(test_refused),
        cmocka_unit_test(test_real_picture),
    };
    return test_run_group(tests, make_folder, remove_folder);
}
