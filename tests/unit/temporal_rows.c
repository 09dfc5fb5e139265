// Loops over eight pixels at a time: runs of samples that move differently, and both ways to weigh
// and filter history and to bring samples to pixels.
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include <string.h>

#include "renderer/temporal/look_up.h"
#include "renderer/temporal/sharpen.h"

#define WIDTH    203
#define HEIGHT   5
#define MATRICES 4

static uint32_t next(uint32_t *random)
{
    *random = *random * 1664525u + 1013904223u;
    return *random >> 8;
}

// Motion vectors of runs of 1 to 20 samples are those of pictures in which all moves like the run.
static void test_runs(void **state)
{
    (void)state;
    static float depth[HEIGHT * WIDTH], motion[HEIGHT * WIDTH][3],
        alone[MATRICES][HEIGHT * WIDTH][3];
    static uint32_t ids[HEIGHT * WIDTH][2];
    const uint16_t matrix_of_draw[MATRICES + 1] = {0, 1, 2, 3, HG_TEMPORAL_DEFORMED};
    double matrices[MATRICES][16] = {0};
    uint32_t random = 3;
    for (int m = 0; m < MATRICES; m++)
        for (int i = 0; i < 16; i++)
            matrices[m][i] = (i % 5 == 0 ? 1.0 : 0.0) + (double)(next(&random) % 1000) * 1e-5;
    for (size_t i = 0; i < HEIGHT * WIDTH;) {
        const uint32_t run = 1 + next(&random) % 20, id = next(&random) % 6;
        for (uint32_t k = 0; k < run && i < HEIGHT * WIDTH; k++, i++) {
            ids[i][0] = id;
            depth[i] = 0.001f * (float)(next(&random) % 1000);
        }
    }
    struct hg_temporal_picture picture = {.width = WIDTH,
        .height = HEIGHT,
        .depth = depth,
        .matrix_of_draw = matrix_of_draw,
        .draw_count = MATRICES + 1,
        .matrix_count = 1};
    for (int m = 0; m < MATRICES; m++) {
        picture.to_previous = (const double(*)[16]) & matrices[m];
        assert_int_equal(hg_temporal_motion(&picture, NULL, alone[m][0]), HG_OK);
    }
    picture.to_previous = (const double(*)[16])matrices;
    picture.matrix_count = MATRICES;
    picture.ids = ids[0];
    assert_int_equal(hg_temporal_motion(&picture, NULL, motion[0]), HG_OK);
    for (size_t i = 0; i < HEIGHT * WIDTH; i++) {
        const uint32_t draw = ids[i][0] - 1u, m = ids[i][0] > 0 ? matrix_of_draw[draw] : 0;
        if (m == HG_TEMPORAL_DEFORMED)
            assert_true(motion[i][2] == 0);
        else
            assert_memory_equal(motion[i], alone[m][i], sizeof motion[i]);
    }
}

static void test_filters(void **state)
{
    (void)state;
    static uint16_t color[HEIGHT * WIDTH * 4 + 16];
    static float weight[WIDTH], part_x[WIDTH], part_y[WIDTH], found[2][WIDTH * 4];
    static int32_t texel[WIDTH];
    uint32_t random = 5;
    if (!hg_temporal_has_avx2())
        skip();
    for (size_t i = 0; i < sizeof color / sizeof color[0]; i++)
        color[i] = (uint16_t)next(&random);
    for (uint32_t i = 0; i < WIDTH; i++) {
        weight[i] = (float)(i % 3); // the first of three has no history
        part_x[i] = (float)(next(&random) % 1000) * 1e-3f;
        part_y[i] = (float)(next(&random) % 1000) * 1e-3f;
        texel[i] = (int32_t)(next(&random) % (WIDTH * (HEIGHT - 4)));
    }
    const struct hg_temporal_past past = {.color = color};
    struct hg_temporal_found out = {
        .weight = weight, .part_x = part_x, .part_y = part_y, .texel = texel};
    out.color = found[0];
    hg_temporal_filter_plain(&past, WIDTH, WIDTH, &out);
    out.color = found[1];
    hg_temporal_filter_avx2(&past, WIDTH, WIDTH, &out);
    assert_memory_equal(found[0], found[1], sizeof found[0]);
    for (uint32_t i = 1; i < WIDTH; i += 3) // and neither is idle: weights have the sum 1
        assert_true(found[0][4 * i] > -0.6f && found[0][4 * i] < 1.6f && found[0][4 * i] != 0);
}

// Depths of which some hide, pixels outside, and what came nearer since.
static void test_weights(void **state)
{
    (void)state;
    static float depth[HEIGHT * WIDTH], found[2][WIDTH + 8], rows[3][WIDTH + 8];
    static uint8_t samples[HEIGHT * WIDTH + 3];
    static int32_t nearest[WIDTH + 8];
    uint32_t random = 11, kept = 0;
    if (!hg_temporal_has_avx2())
        skip();
    for (size_t i = 0; i < HEIGHT * WIDTH; i++) {
        depth[i] = 1e-3f * (float)(next(&random) % 1000);
        samples[i] = (uint8_t)next(&random);
    }
    for (uint32_t i = 0; i < WIDTH; i++) {
        nearest[i] = (int32_t)(next(&random) % (HEIGHT * WIDTH + 50)) - 50;
        for (int k = 0; k < 3; k++)
            rows[k][i] = 1e-3f * (float)(next(&random) % (k == 2 ? 100 : 1000));
    }
    nearest[WIDTH - 1] = HEIGHT * WIDTH - 1;
    const struct hg_temporal_past past = {.depth = depth, .weight = samples};
    const struct hg_temporal_about about = {
        .motion = {.expect = rows[0], .depth = rows[1]}, .slope = rows[2]};
    struct hg_temporal_found out = {.nearest = nearest, .weight = found[0]};
    hg_temporal_weigh_plain(&past, &about, WIDTH, &out);
    out.weight = found[1];
    hg_temporal_weigh_avx2(&past, &about, WIDTH, &out);
    assert_memory_equal(found[0], found[1], WIDTH * sizeof(float));
    for (uint32_t i = 0; i < WIDTH; i++)
        kept += found[0][i] > 0;
    assert_in_range(kept, WIDTH / 4, WIDTH - WIDTH / 4);
}

// Both ways to bring rows of samples to pixels, for half of the pixels to all but one.
static void test_expand(void **state)
{
    (void)state;
    static float memory[WIDTH + 16], weights[3 * WIDTH + 8], trust[WIDTH + 8], to[4][WIDTH + 8];
    static uint32_t first[WIDTH + 8];
    float *from = memory + 8;
    uint32_t random = 13;
    if (!hg_temporal_has_avx2())
        skip();
    for (size_t i = 0; i < WIDTH + 16; i++)
        memory[i] = 1e-3f * (float)(next(&random) % 1000);
    const struct hg_temporal_taps taps = {first, weights, trust};
    struct hg_temporal_taps fill = taps;
    for (uint32_t samples = (WIDTH + 1) / 2; samples < WIDTH; samples += 7) {
        const float jitter = 0.49f * ((float)(next(&random) % 2001) * 1e-3f - 1.0f);
        hg_temporal_taps_fill(&fill, WIDTH, samples, jitter);
        hg_temporal_expand_plain(from, &taps, WIDTH, to[0]);
        hg_temporal_expand_avx2(from, &taps, WIDTH, to[1]);
        assert_memory_equal(to[0], to[1], WIDTH * sizeof(float));
        hg_temporal_expand_weighed_plain(from, &taps, WIDTH, to[2]);
        hg_temporal_expand_weighed_avx2(from, &taps, WIDTH, to[3]);
        assert_memory_equal(to[2], to[3], WIDTH * sizeof(float));
        assert_true(to[0][WIDTH - 1] == from[samples - 1]);
    }
}

static uint8_t channel(const uint8_t *rgba, uint32_t x, uint32_t y, uint32_t c)
{
    return rgba[4 * (y * WIDTH + x) + c];
}

// Ramps become steeper and nothing goes beyond its neighbours, so what is flat stays, and alpha
// does.
static void test_sharpen(void **state)
{
    (void)state;
    static uint8_t from[WIDTH * HEIGHT * 4], to[2][WIDTH * HEIGHT * 4];
    const uint32_t size[2] = {WIDTH, HEIGHT};
    struct hg_jobs *jobs = hg_jobs_create(2);
    uint32_t random = 7, moved = 0;
    assert_non_null(jobs);
    for (uint32_t i = 0; i < WIDTH * HEIGHT; i++) {
        const uint32_t x = i % WIDTH;
        from[4 * i] = (uint8_t)(x < 6 ? 60 : x < 9 ? 60 + 10 * (x - 5) * (x - 5) : 150); // a bend
        from[4 * i + 1] = 90;
        from[4 * i + 2] = from[4 * i + 3] = (uint8_t)next(&random);
    }
    hg_temporal_sharpen(jobs, from, size, 0, to[0]);
    assert_memory_equal(from, to[0], sizeof from);
    hg_temporal_sharpen(jobs, from, size, 0.5f, to[0]);
    hg_temporal_sharpen(jobs, from, size, 1, to[1]);
    for (uint32_t y = 1; y + 1 < HEIGHT; y++)
        for (uint32_t x = 1; x + 1 < WIDTH; x++) {
            assert_int_equal(channel(to[1], x, y, 1), 90);
            assert_int_equal(channel(to[1], x, y, 3), channel(from, x, y, 3));
            const uint8_t five[5] = {channel(from, x, y, 2), channel(from, x - 1, y, 2),
                channel(from, x + 1, y, 2), channel(from, x, y - 1, 2), channel(from, x, y + 1, 2)};
            uint8_t low = 255, high = 0;
            for (int k = 0; k < 5; k++) {
                low = five[k] < low ? five[k] : low;
                high = five[k] > high ? five[k] : high;
            }
            assert_true(channel(to[1], x, y, 2) >= low && channel(to[1], x, y, 2) <= high);
            moved += channel(to[1], x, y, 2) != five[0];
        }
    assert_true(moved > WIDTH * HEIGHT / 8);
    // The bend upwards at x = 6 and 7 gets deeper, by more with more strength.
    for (uint32_t x = 6; x < 8; x++)
        assert_true(channel(to[1], x, 2, 0) < channel(to[0], x, 2, 0) &&
                    channel(to[0], x, 2, 0) < channel(from, x, 2, 0));
    hg_jobs_destroy(jobs);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_runs), cmocka_unit_test(test_filters),
        cmocka_unit_test(test_weights), cmocka_unit_test(test_expand),
        cmocka_unit_test(test_sharpen)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
