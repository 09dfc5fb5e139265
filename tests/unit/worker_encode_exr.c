// What a worker puts into an EXR file: exposure and directions of planes as they are documented.
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "base/refbuf.h"
#include "server/worker/encode/encode_exr.h"
#include "tests/unit/image_exr.h"

enum { WIDTH = 3, HEIGHT = 2, PIXELS = WIDTH * HEIGHT, EXPOSURE = 4, EXPOSURE_EV = 2 };

static struct hg_refbuf *numbers(uint32_t channels)
{
    struct hg_refbuf *b = hg_refbuf_create(PIXELS * channels * sizeof(float));
    assert_non_null(b);
    float *to = (float *)(void *)b->data;
    for (uint32_t i = 0; i < PIXELS * channels; i++)
        to[i] = 0.5f + (float)i;
    return b;
}

// Plane by plane: a number of the file over that of the renderer.
static void test_scales(void **state)
{
    (void)state;
    static const struct {
        enum hg_plane plane;
        float x, y; // of the first and second number of a pixel
    } rows[] = {{HG_PLANE_EMISSION, EXPOSURE, EXPOSURE},
        {HG_PLANE_INDIRECT_DIFFUSE, EXPOSURE, EXPOSURE}, {HG_PLANE_NOISY, EXPOSURE, EXPOSURE},
        {HG_PLANE_VARIANCE, EXPOSURE * EXPOSURE, EXPOSURE * EXPOSURE}, {HG_PLANE_ALBEDO, 1, 1},
        {HG_PLANE_DEPTH, 1, 1}, {HG_PLANE_POSITION, 1, 1}, {HG_PLANE_SAMPLES, 1, 1},
        {HG_PLANE_MOTION, 1, -1}};
    enum { ROWS = sizeof rows / sizeof *rows };
    struct encode_request request = {.opaque = true,
        .frame = {.width = WIDTH, .height = HEIGHT, .encoding = HGP_encoding_EXR_FLOAT},
        .metadata = {.params = {.exposure_ev = EXPOSURE_EV}},
        .pixels = numbers(4)};
    struct exr_seen seen[1 + ROWS];
    struct hg_writer file = {0};
    struct hg_error err = {0};
    for (uint32_t i = 0; i < ROWS; i++)
        request.planes[request.plane_count++] = (struct encode_plane){
            .plane = rows[i].plane, .values = numbers(hg_plane_channels(rows[i].plane))};
    if (hg_encode_exr(&request, &file, &err))
        fail_msg("%s: %s", err.what, err.reason);
    assert_int_equal(exr_read(file.data, file.size, seen, 1 + ROWS), 1 + ROWS);
    for (uint32_t i = 0; i < ROWS; i++) {
        const float *to = seen[1 + i].pixels;
        assert_string_equal(seen[1 + i].name, hg_plane_name(rows[i].plane));
        for (uint32_t k = 0; k < 2 && k < hg_plane_channels(rows[i].plane); k++)
            assert_true(to[k] == (0.5f + (float)k) * (k ? rows[i].y : rows[i].x));
    }
    for (uint32_t i = 0; i < 1 + ROWS; i++)
        free(seen[i].pixels);
    for (uint32_t i = 0; i < ROWS; i++)
        hg_refbuf_unref(request.planes[i].values);
    hg_refbuf_unref(request.pixels);
    hg_writer_finish(&file);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_scales)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
