// gi_gather.c - the filter of gathered light on made pictures.
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "base/alloc.h"
#include "renderer/gather/gather.h"
#include "shaders/shared/gi.h"
#include "shaders/shared/path.h"
#include "shaders/shared/sample_blocks.h"
#include "tests/support/check.h"

enum { WIDTH = 256, HEIGHT = 192, PIXELS = WIDTH * HEIGHT, SAMPLES = 8 };
#define FILM ((size_t)(HG_PATH_GUIDE_CHANNELS + HG_PATH_GUIDE_LIGHT) * PIXELS)

struct film {
    float *sums, *halves, *lamps; // lamps: NULL, or HG_GATHERED_LAMPS channels
    uint32_t *words;
    struct hg_jobs *jobs;
    uint32_t samples;
};

static void film_init(struct film *f, uint32_t threads)
{
    f->sums = hg_calloc(FILM, sizeof(float));
    f->lamps = NULL;
    f->words = hg_calloc(4 * (size_t)WIDTH * hg_gather_rows(HEIGHT, true), sizeof(uint32_t));
    assert_non_null(f->sums);
    assert_non_null(f->words);
    f->halves = f->sums + (size_t)HG_PATH_GUIDE_CHANNELS * PIXELS;
    f->jobs = hg_jobs_create(threads);
    f->samples = SAMPLES;
    assert_non_null(f->jobs);
}

static void film_finish(struct film *f)
{
    hg_jobs_destroy(f->jobs);
    hg_free(f->sums);
    hg_free(f->lamps);
    hg_free(f->words);
}

static void put3(struct film *f, size_t channel, size_t at, float value)
{
    for (size_t c = 0; c < 3; c++) {
        f->sums[(channel + c) * PIXELS + at] = value * (float)f->samples;
        if (channel < HG_PATH_GUIDE_LIGHT)
            f->halves[(channel + c) * PIXELS + at] = value * (float)((f->samples + 1) / 2);
    }
}

// A grey surface that faces the camera; albedo and reflection 0.5.
static void put_surface(struct film *f, size_t at, float depth, int axis)
{
    put3(f, HG_PATH_GUIDE_ALBEDO, at, 0.5f);
    put3(f, HG_PATH_GUIDE_REFLECTION, at, 0.5f);
    f->sums[(HG_PATH_GUIDE_NORMAL + (size_t)axis) * PIXELS + at] = (float)f->samples;
    f->sums[HG_PATH_GUIDE_DEPTH * PIXELS + at] = logf(depth) * (float)f->samples;
    f->sums[HG_PATH_GUIDE_ROUGHNESS * PIXELS + at] = 0.5f * (float)f->samples;
    f->sums[HG_PATH_GUIDE_HITS * PIXELS + at] = (float)f->samples;
}

static void put_light(struct film *f, size_t at, float scattered, float mirrored)
{
    put3(f, HG_PATH_GUIDE_DIRECT, at, 0.5f * scattered);
    put3(f, HG_PATH_GUIDE_SPECULAR, at, 0.5f * mirrored);
}

static void run(struct film *f)
{
    struct hg_error err = {0};
    const struct hg_gather_input input = {.width = WIDTH,
        .height = HEIGHT,
        .samples = f->samples,
        .first_half = (f->samples + 1) / 2,
        .sums = f->sums,
        .halves = f->halves,
        .lamps = f->lamps,
        .lamp_count = HG_GATHERED_LAMPS};
    struct hg_gather *gather;
    assert_int_equal(hg_gather_load(f->jobs, &input, &gather, &err), HG_OK);
    assert_int_equal(hg_gather_filter(gather, f->jobs, f->words, &err), HG_OK);
    hg_gather_free(gather);
}

static float channel(uint32_t rgb9e5, uint32_t c)
{
    return (float)(rgb9e5 >> (9 * c) & 511u) * exp2f((float)(rgb9e5 >> 27) - 24);
}

static float green(uint32_t rgb9e5)
{
    return channel(rgb9e5, 1);
}

static float noise(uint32_t i) // in [0, 1)
{
    i = i * 747796405u + 2891336453u;
    i = ((i >> ((i >> 28) + 4)) ^ i) * 277803737u;
    return (float)((i >> 22 ^ i) >> 8) / 16777216.0f;
}

// Light that is the same everywhere stays as it is, over any albedo; nothing is where no surface
// is.
static void test_constant(void **state)
{
    struct film f;
    (void)state;
    film_init(&f, 2);
    for (size_t at = 0; at < PIXELS; at++)
        if (at % WIDTH < WIDTH / 2) {
            put_surface(&f, at, 2, 2);
            put_light(&f, at, 3, 0.75f);
        }
    run(&f);
    for (size_t at = 0; at < PIXELS; at++) {
        const bool there = at % WIDTH < WIDTH / 2;
        float depth;
        memcpy(&depth, &f.words[4 * at + 3], sizeof depth);
        assert_true(fabsf(green(f.words[4 * at]) - (there ? 3.0f : 0.0f)) <= 0.01f);
        assert_true(fabsf(green(f.words[4 * at + 1]) - (there ? 0.75f : 0.0f)) <= 0.003f);
        assert_true(fabsf(depth - (there ? 2.0f : 0.0f)) <= 1e-4f);
    }
    film_finish(&f);
}

// Dark channels of a colour have the light that bright ones have.
static void test_dark_channels(void **state)
{
    static const float albedo[3] = {0.2f, 0.004f, 0.001f};
    struct film f;
    (void)state;
    film_init(&f, 2);
    for (size_t at = 0; at < PIXELS; at++) {
        put_surface(&f, at, 2, 2);
        for (size_t c = 0; c < 3; c++) {
            f.sums[(HG_PATH_GUIDE_ALBEDO + c) * PIXELS + at] = albedo[c] * SAMPLES;
            f.sums[(HG_PATH_GUIDE_REFLECTION + c) * PIXELS + at] = albedo[c] * SAMPLES;
            f.sums[(HG_PATH_GUIDE_DIRECT + c) * PIXELS + at] = 3 * albedo[c] * SAMPLES;
            f.sums[(HG_PATH_GUIDE_SPECULAR + c) * PIXELS + at] = 0.75f * albedo[c] * SAMPLES;
        }
    }
    run(&f);
    for (size_t at = 0; at < PIXELS; at++)
        for (uint32_t c = 0; c < 3; c++) {
            assert_true(fabsf(channel(f.words[4 * at], c) - 3) <= 0.01f);
            assert_true(fabsf(channel(f.words[4 * at + 1], c) - 0.75f) <= 0.003f);
        }
    film_finish(&f);
}

// Leaves: normals of the samples of a pixel point anywhere, so their means are short and differ
// from pixel to pixel. Little of their light is lost where few pixels have it, and most of its
// noise is.
static void test_leaves(void **state)
{
    struct film f;
    double before = 0, sum = 0, squares = 0, before_squares = 0;
    (void)state;
    film_init(&f, 2);
    for (size_t at = 0; at < PIXELS; at++) {
        const uint32_t i = (uint32_t)at;
        const float light = noise(i) < 0.1f ? 5 : 0.05f;
        put_surface(&f, at, 2, 2);
        put_light(&f, at, light, 0);
        for (uint32_t axis = 0; axis < 3; axis++)
            f.sums[(HG_PATH_GUIDE_NORMAL + axis) * PIXELS + at] =
                (noise(i + (axis + 1) * PIXELS) - 0.5f) * SAMPLES;
        before += (double)light;
        before_squares += (double)(light * light);
    }
    run(&f);
    for (size_t at = 0; at < PIXELS; at++) {
        const double light = (double)green(f.words[4 * at]);
        sum += light;
        squares += light * light;
    }
    const double mean = sum / PIXELS, expected = before / PIXELS;
    const double deviation = sqrt(squares / PIXELS - mean * mean);
    const double was = sqrt(before_squares / PIXELS - expected * expected);
    print_message(
        "leaves: mean %.3f of %.3f, deviation %.3f of %.3f\n", mean, expected, deviation, was);
    assert_true(fabs(mean - expected) <= 0.1 * expected);
    assert_true(deviation <= 0.5 * was);
    film_finish(&f);
}

// Two surfaces apart in depth, and two that meet at a right angle: no light crosses the edge.
static void test_edges(void **state)
{
    (void)state;
    for (int bends = 0; bends < 2; bends++) {
        struct film f;
        film_init(&f, 2);
        for (size_t at = 0; at < PIXELS; at++) {
            const bool left = at % WIDTH < WIDTH / 2;
            put_surface(&f, at, left || bends ? 2.0f : 3.0f, left || !bends ? 2 : 0);
            put_light(&f, at, left ? 1 : 0, left ? 1 : 0);
        }
        run(&f);
        for (size_t at = 0; at < PIXELS; at++) {
            const float light = at % WIDTH < WIDTH / 2 ? 1 : 0;
            assert_true(fabsf(green(f.words[4 * at]) - light) <= 0.01f);
            assert_true(fabsf(green(f.words[4 * at + 1]) - light) <= 0.01f);
        }
        film_finish(&f);
    }
}

// A twentieth of all pixels holds all of the light: its mean stays, its noise goes. Of one sample
// as well, where the pixels around tell how noisy they are.
static void check_sparse_light(uint32_t samples, double left)
{
    struct film one, two;
    double sum = 0, squares = 0, before = 0, before_squares = 0;
    film_init(&one, 1);
    film_init(&two, 2);
    one.samples = two.samples = samples;
    for (size_t at = 0; at < PIXELS; at++) {
        const float light = noise((uint32_t)at) < 0.05f ? 20 : 0;
        put_surface(&one, at, 2, 2);
        put_light(&one, at, light, light);
        before += (double)light;
        before_squares += (double)(light * light);
    }
    memcpy(two.sums, one.sums, FILM * sizeof(float));
    run(&one);
    run(&two);
    assert_memory_equal(one.words, two.words, 4 * (size_t)PIXELS * sizeof(uint32_t));
    for (size_t at = 0; at < PIXELS; at++) {
        const double light = (double)green(one.words[4 * at]);
        sum += light;
        squares += light * light;
    }
    const double mean = sum / PIXELS, expected = before / PIXELS;
    const double deviation = sqrt(squares / PIXELS - mean * mean);
    const double was = sqrt(before_squares / PIXELS - expected * expected);
    print_message("mean %.3f of %.3f, deviation %.3f of %.3f\n", mean, expected, deviation, was);
    assert_true(fabs(mean - expected) <= 0.05 * expected);
    assert_true(deviation <= left * was);
    film_finish(&one);
    film_finish(&two);
}

static void test_sparse_light(void **state)
{
    (void)state;
    check_sparse_light(SAMPLES, 0.2);
    check_sparse_light(1, 0.1);
}

// A wall that is lit evenly, by samples whose halves tell of their noise: it is filtered wider than
// a wall whose halves agree, where what differs may be light.
static double deviation_of_wall(bool noisy)
{
    struct film f;
    double sum = 0, squares = 0;
    film_init(&f, 2);
    for (size_t at = 0; at < PIXELS; at++) {
        const float first = 2 * noise((uint32_t)at), second = 2 * noise((uint32_t)(at + PIXELS));
        const float mean = 0.5f * (first + second);
        put_surface(&f, at, 2, 2);
        put_light(&f, at, mean, mean);
        for (size_t c = 0; c < 3; c++)
            f.halves[(HG_PATH_GUIDE_DIRECT + c) * PIXELS + at] =
                0.5f * (noisy ? first : mean) * (float)(SAMPLES / 2);
    }
    run(&f);
    for (size_t at = 0; at < PIXELS; at++) {
        const double light = (double)green(f.words[4 * at]);
        sum += light;
        squares += light * light;
    }
    film_finish(&f);
    return sqrt(squares / PIXELS - sum / PIXELS * (sum / PIXELS));
}

static void test_noisy_wall(void **state)
{
    const double noisy = deviation_of_wall(true), sure = deviation_of_wall(false);
    (void)state;
    print_message("deviation %.4f where halves differ, %.4f where they agree\n", noisy, sure);
    assert_true(noisy <= 0.033);
    assert_true(sure > noisy);
}

// An edge of light on one surface stays where it is, with one sample.
static void test_edge_of_light(void **state)
{
    struct film f;
    (void)state;
    film_init(&f, 2);
    f.samples = 1;
    for (size_t at = 0; at < PIXELS; at++) {
        put_surface(&f, at, 2, 2);
        put_light(&f, at, at % WIDTH < WIDTH / 2 ? 1 : 0, 0);
    }
    run(&f);
    for (size_t at = 0; at < PIXELS; at++) {
        const size_t x = at % WIDTH, apart = x < WIDTH / 2 ? WIDTH / 2 - x : x - WIDTH / 2;
        if (apart > 8)
            assert_true(fabsf(green(f.words[4 * at]) - (x < WIDTH / 2 ? 1 : 0)) <= 0.02f);
    }
    film_finish(&f);
}

// Noisy light of an environment that a part of is hidden from the right half, above steady light
// from elsewhere: the share has no noise where nothing is hidden, and little elsewhere; the rest is
// what is left.
static void test_sky(void **state)
{
    struct film f;
    double sum[2] = {0}, squares[2] = {0};
    (void)state;
    film_init(&f, 2);
    for (size_t at = 0; at < PIXELS; at++) {
        const uint32_t i = (uint32_t)at;
        const float open = 0.2f + 2 * noise(i);
        const bool hides = at % WIDTH >= WIDTH / 2 && noise(i + PIXELS) < 0.75f;
        put_surface(&f, at, 2, 2);
        put3(&f, HG_PATH_GUIDE_OPEN_SKY, at, 0.5f * open);
        put3(&f, HG_PATH_GUIDE_SEEN_SKY, at, hides ? 0 : 0.5f * open);
        put3(&f, HG_PATH_GUIDE_DIRECT, at, 0.05f + (hides ? 0 : 0.5f * open));
    }
    run(&f);
    for (size_t at = 0; at < PIXELS; at++) {
        const uint32_t bits = f.words[4 * at + 3] & HG_GATHERED_SHARE_MASK;
        const float root = (float)bits / (float)HG_GATHERED_SHARE_MASK, share = root * root;
        const int side = at % WIDTH >= WIDTH / 2;
        sum[side] += (double)share;
        squares[side] += (double)(share * share);
        assert_true(fabsf(green(f.words[4 * at]) - 0.1f) <= (side == 0 ? 0.001f : 0.05f));
        if (at % WIDTH < WIDTH / 4) // farther from the edge than the filter reaches
            assert_true(bits == HG_GATHERED_SHARE_MASK);
    }
    const double n = PIXELS / 2.0, mean = sum[1] / n;
    print_message("seen: %.4f and %.3f, deviation %.4f\n", sum[0] / n, mean,
        sqrt(fmax(squares[1] / n - mean * mean, 0)));
    assert_true(sum[0] / n >= 0.97);
    assert_true(fabs(mean - 0.25) <= 0.02);
    assert_true(squares[1] / n - mean * mean <= 0.1 * 0.1); // of one pixel 0.43
    film_finish(&f);
}

// Cloth keeps the environment's light where it is, and does not share it with what is no cloth.
static void test_cloth(void **state)
{
    struct film f;
    (void)state;
    film_init(&f, 1);
    for (size_t at = 0; at < PIXELS; at++) {
        const bool cloth = at % WIDTH < WIDTH / 2;
        put_surface(&f, at, 2, 2);
        put3(&f, HG_PATH_GUIDE_OPEN_SKY, at, 0.5f);
        put3(&f, HG_PATH_GUIDE_SEEN_SKY, at, 0.5f);
        put3(&f, HG_PATH_GUIDE_DIRECT, at, 0.5f);
        if (cloth)
            f.sums[HG_PATH_GUIDE_ROUGHNESS * PIXELS + at] += HG_PATH_GUIDE_CLOTH * SAMPLES;
    }
    run(&f);
    for (size_t at = 0; at < PIXELS; at++) {
        const bool cloth = at % WIDTH < WIDTH / 2;
        const uint32_t bits = f.words[4 * at + 3] & HG_GATHERED_SHARE_MASK;
        assert_int_equal(bits, cloth ? 0 : HG_GATHERED_SHARE_MASK);
        assert_true(fabsf(green(f.words[4 * at]) - (cloth ? 1.0f : 0.0f)) <= 0.005f);
    }
    film_finish(&f);
}

static float sunlit(const struct film *f, size_t at)
{
    const float root = (float)(f->words[4 * at + 2] >> 16 & 0xff) / 255;
    return root * root;
}

// Rays to the sun: an edge of its light stays where it is and sharp, and where half of them are
// held back, by chance, that is the share and its noise is little; what does not face the sun takes
// no part.
static void test_sun(void **state)
{
    struct film f;
    double sum = 0, squares = 0, count = 0;
    (void)state;
    film_init(&f, 2);
    for (size_t at = 0; at < PIXELS; at++) {
        const size_t x = at % WIDTH;
        put_surface(&f, at, 2, 2);
        if (x < 8)
            continue;
        for (uint32_t i = 0; i < SAMPLES; i++) {
            const bool seen = x < 64 || (x >= 128 && noise((uint32_t)at * SAMPLES + i) < 0.5f);
            for (int half = 0; half < 2 - (int)(i % 2); half++) {
                float *film = half == 0 ? f.sums : f.halves;
                film[HG_PATH_GUIDE_OPEN_SUN * PIXELS + at] += 3;
                film[HG_PATH_GUIDE_SEEN_SUN * PIXELS + at] += seen ? 3 : 0;
            }
        }
    }
    run(&f);
    for (size_t at = 0; at < PIXELS; at++) {
        const size_t x = at % WIDTH;
        const double share = (double)sunlit(&f, at);
        if (x >= 8 && x < 120)
            assert_true(fabs(share - (x < 64 ? 1 : 0)) <= 0.005);
        if (x >= 136 && x < WIDTH - 8) {
            sum += share;
            squares += share * share;
            count++;
        }
    }
    const double mean = sum / count, deviation = sqrt(squares / count - mean * mean);
    print_message("sun: mean %.3f, deviation %.3f\n", mean, deviation);
    assert_true(fabs(mean - 0.5) <= 0.01);
    assert_true(deviation <= 0.7 * sqrt(0.25 / SAMPLES));
    film_finish(&f);
}

static float lamplit(const struct film *f, size_t at, uint32_t lamp)
{
    const uint32_t word = f->words[4 * (PIXELS + at) + lamp / 4];
    const float root = (float)(word >> (8 * (lamp % 4)) & 0xff) / 255;
    return root * root;
}

// Rays to two lamps, six to one and two to the other: the edge of each stays where it is and sharp;
// where half of the rays are held back, by chance, that is the share and its noise is little.
// Pixels that did not ask for a lamp have what those around them found.
static void test_lamps(void **state)
{
    struct film f;
    double sum = 0, squares = 0, count = 0;
    (void)state;
    film_init(&f, 2);
    f.lamps = hg_calloc((size_t)HG_GATHERED_LAMPS * PIXELS, sizeof(float));
    assert_non_null(f.lamps);
    for (size_t at = 0; at < PIXELS; at++) {
        const size_t x = at % WIDTH;
        put_surface(&f, at, 2, 2);
        for (uint32_t i = 0; i < SAMPLES; i++) {
            const uint32_t lamp = i < 6 ? 1 : 14;
            bool seen = lamp == 1 ? x < 64 : x < 96;
            if (x >= 128)
                seen = noise((uint32_t)at * SAMPLES + i) < 0.5f;
            if (lamp == 1 || at % 3 > 0)
                f.lamps[lamp * PIXELS + at] += seen ? 1 + 16 * HG_PATH_LAMP_SEEN : 1;
        }
    }
    run(&f);
    for (size_t at = 0; at < PIXELS; at++) {
        const size_t x = at % WIDTH;
        const double share = (double)lamplit(&f, at, 1);
        if (x < 120) {
            assert_true(fabs(share - (x < 64 ? 1 : 0)) <= 0.005);
            const bool near =
                x > 92 && x < 100; // within the filter's reach of an edge of which pixels miss
            assert_true(near || fabs((double)lamplit(&f, at, 14) - (x < 96 ? 1 : 0)) <= 0.02);
        }
        if (x >= 136 && x < WIDTH - 8) {
            sum += share;
            squares += share * share;
            count++;
        }
    }
    const double mean = sum / count, deviation = sqrt(squares / count - mean * mean);
    print_message("lamps: mean %.3f, deviation %.3f\n", mean, deviation);
    assert_true(fabs(mean - 0.5) <= 0.01);
    assert_true(deviation <= 0.6 * sqrt(0.25 / 6));
    film_finish(&f);
}

// Each pixel asks for one of ten lamps, in turn; one half is lit by all of them: each has its share
// everywhere.
static void test_lamps_in_turn(void **state)
{
    enum { LAMPS = 10 };
    struct film f;
    (void)state;
    film_init(&f, 2);
    f.samples = 1;
    f.lamps = hg_calloc((size_t)HG_GATHERED_LAMPS * PIXELS, sizeof(float));
    assert_non_null(f.lamps);
    for (size_t at = 0; at < PIXELS; at++) {
        const size_t x = at % WIDTH, lamp = (x + 3 * (at / WIDTH)) % LAMPS;
        put_surface(&f, at, 2, 2);
        f.lamps[lamp * PIXELS + at] = x < WIDTH / 2 ? 1 + 16 * HG_PATH_LAMP_SEEN : 1;
    }
    run(&f);
    for (size_t at = 0; at < PIXELS; at++)
        for (uint32_t lamp = 0; lamp < LAMPS; lamp++) {
            const bool lit = at % WIDTH < WIDTH / 2,
                       near = at % WIDTH + 8 >= WIDTH / 2 && at % WIDTH < WIDTH / 2 + 8;
            assert_true(near || fabsf(lamplit(&f, at, lamp) - (lit ? 1 : 0)) <= 0.02f);
        }
    film_finish(&f);
}

// Noisy light by way of glass before a steady one of its own: from left to right clear glass,
// frosted glass, and frosted glass that turns away and has other light.
enum { FROSTED = 64, TURNS = 192 };

static void put_glass(struct film *f, float *colors)
{
    for (size_t at = 0; at < PIXELS; at++) {
        const size_t x = at % WIDTH;
        const float light[2] = {noise((uint32_t)at) < 0.25f ? 4 : 0.2f,
            noise((uint32_t)(at + PIXELS)) < 0.25f ? 4 : 0.2f};
        const float mean = x < TURNS ? 0.5f * (light[0] + light[1]) : 3;
        put_surface(f, at, 2, x < TURNS ? 2 : 0);
        put3(f, HG_PATH_GUIDE_ALBEDO, at, 0);
        put_light(f, at, 0, mean);
        if (x < FROSTED)
            f->sums[HG_PATH_GUIDE_ROUGHNESS * PIXELS + at] = 0;
        for (size_t c = 0; c < 3; c++) {
            if (x < TURNS)
                f->halves[(HG_PATH_GUIDE_SPECULAR + c) * PIXELS + at] =
                    0.5f * light[0] * (float)(SAMPLES / 2);
            colors[4 * at + c] = 0.5f * mean + 0.25f;
        }
        colors[4 * at + 3] = 1;
    }
}

static void filter_glass(const struct film *f, float *colors)
{
    struct hg_error err = {0};
    const struct hg_gather_input input = {.width = WIDTH,
        .height = HEIGHT,
        .samples = SAMPLES,
        .first_half = SAMPLES / 2,
        .sums = f->sums,
        .halves = f->halves};
    assert_int_equal(hg_gather_glass(f->jobs, &input, HEIGHT, colors, &err), HG_OK);
}

// Clear glass keeps its bytes, frosted glass its light, without the noise and within its edges.
static void test_glass(void **state)
{
    enum { FLOATS = 4 * PIXELS };
    struct film one, two;
    double sum[2] = {0}, squares[2] = {0}, count = 0;
    (void)state;
    film_init(&one, 1);
    film_init(&two, 2);
    float *colors[3]; // as they were, filtered by one thread and by two
    for (int i = 0; i < 3; i++) {
        colors[i] = hg_calloc(FLOATS, sizeof(float));
        assert_non_null(colors[i]);
        put_glass(i < 2 ? &one : &two, colors[i]);
    }
    filter_glass(&one, colors[1]);
    filter_glass(&two, colors[2]);
    assert_memory_equal(colors[1], colors[2], FLOATS * sizeof(float));
    for (size_t at = 0; at < PIXELS; at++) {
        const size_t x = at % WIDTH;
        assert_true(colors[1][4 * at + 3] == 1);
        if (x < FROSTED)
            assert_memory_equal(&colors[0][4 * at], &colors[1][4 * at], 4 * sizeof(float));
        if (x >= TURNS)
            assert_true(fabsf(colors[1][4 * at + 1] - 1.75f) <= 0.01f);
        for (int i = 0; i < 2 && x >= FROSTED && x < TURNS; i++) {
            const double light = (double)colors[i][4 * at + 1];
            sum[i] += light;
            squares[i] += light * light;
            count += 0.5;
        }
    }
    const double mean = sum[1] / count, expected = sum[0] / count;
    const double deviation = sqrt(squares[1] / count - mean * mean);
    const double was = sqrt(squares[0] / count - expected * expected);
    print_message(
        "glass: mean %.4f of %.4f, deviation %.4f of %.4f\n", mean, expected, deviation, was);
    assert_true(fabs(mean - expected) <= 0.01 * expected);
    assert_true(deviation <= 0.25 * was);
    for (int i = 0; i < 3; i++)
        hg_free(colors[i]);
    film_finish(&one);
    film_finish(&two);
}

static uint32_t block_at(const uint32_t *counts, size_t x, size_t y)
{
    return counts[y / HG_SAMPLE_BLOCK_HEIGHT * HG_SAMPLE_BLOCK_COLUMNS(WIDTH) +
                  x / HG_SAMPLE_BLOCK_WIDTH];
}

static void count_samples(const struct film *f, uint32_t samples, uint32_t *counts)
{
    const struct hg_gather_input input = {
        .width = WIDTH, .height = HEIGHT, .samples = f->samples, .sums = f->sums};
    hg_gather_samples(f->jobs, &input, samples, counts);
}

// From left to right a plain wall, which lies aslant; a corner; paint of another colour; a step to
// a wall behind; nothing.
enum { CORNER = 32, PAINT = 64, DEEPER = 96, GONE = 128 };

static void put_scenery(struct film *f)
{
    for (size_t at = 0; at < PIXELS; at++) {
        const size_t x = at % WIDTH;
        if (x >= GONE)
            continue;
        put_surface(f, at, x < DEEPER ? 1 / (0.5f + 0.002f * (float)x) : 4, x < CORNER ? 0 : 2);
        put3(f, HG_PATH_GUIDE_ALBEDO, at, x < PAINT ? 0.5f : 0.9f);
        put3(f, HG_PATH_GUIDE_REFLECTION, at, 0);
    }
}

// Few samples but at edges, more the more contrast there is, and all across others.
static void test_samples(void **state)
{
    struct film f;
    (void)state;
    film_init(&f, 2);
    f.samples = 2;
    put_scenery(&f);
    const size_t edges[] = {CORNER, PAINT, DEEPER, GONE};
    const uint32_t at_edges[] = {24, 12, 32, 32};
    uint32_t *counts = hg_calloc(PIXELS, sizeof *counts);
    assert_non_null(counts);
    count_samples(&f, 32, counts);
    for (size_t y = 0; y < HEIGHT; y++) {
        for (size_t e = 0; e < 4; e++) {
            assert_int_equal(block_at(counts, edges[e] - 1, y), at_edges[e]);
            assert_int_equal(block_at(counts, edges[e], y), at_edges[e]);
            assert_int_equal(block_at(counts, edges[e] - 16, y), 8);
        }
        assert_int_equal(block_at(counts, WIDTH - 1, y), 32); // what is there is not known
    }
    count_samples(&f, 8, counts);
    for (size_t x = 0; x < WIDTH; x++)
        assert_int_equal(block_at(counts, x, 0), 8);
    count_samples(&f, 256, counts);
    assert_int_equal(block_at(counts, 8, 8), 64);
    hg_free(counts);
    film_finish(&f);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_constant),
        cmocka_unit_test(test_dark_channels),
        cmocka_unit_test(test_leaves),
        cmocka_unit_test(test_edges),
        cmocka_unit_test(test_sparse_light),
        cmocka_unit_test(test_noisy_wall),
        cmocka_unit_test(test_edge_of_light),
        cmocka_unit_test(test_sky),
        cmocka_unit_test(test_cloth),
        cmocka_unit_test(test_sun),
        cmocka_unit_test(test_lamps),
        cmocka_unit_test(test_lamps_in_turn),
        cmocka_unit_test(test_glass),
        cmocka_unit_test(test_samples),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
