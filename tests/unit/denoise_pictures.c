// denoise_pictures.c - see denoise_pictures.h.
#include "tests/unit/denoise_pictures.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdlib.h>

#include <cmocka.h>

#include "tests/support/check.h"

static uint32_t seed_state;

static float random_float(void)
{
    seed_state = seed_state * 1664525u + 1013904223u;
    uint32_t x = seed_state;
    x ^= x >> 15;
    x *= 0x2c1b3c6du;
    x ^= x >> 13;
    return (float)(x >> 8) * (1.0f / 16777216.0f);
}

// Mean 1; noise 1: exponentially distributed.
static float scatter(float noise)
{
    return 1.0f + noise * (-logf(1.0f - random_float()) - 1.0f);
}

static void add_sample(struct picture *p, size_t at, uint32_t number, const struct point *s)
{
    const size_t pixels = (size_t)p->width * p->height;
    const float light = s->irradiance * scatter(s->noise), gloss = s->mirrored * scatter(s->noise);
    const float around = 0.5f * s->irradiance * scatter(s->noise);
    const float *a = s->albedo, m = s->reflection;
    const bool knows = s->knows == 0.0f || random_float() < s->knows;
    const float seen = s->shines > 0.0f && random_float() < s->shines ? 1.0f : s->seen;
    const float mirrored = !knows ? 0.0f : m * seen * gloss / (s->knows > 0.0f ? s->knows : 1.0f);
    const float k = knows ? 1.0f : 0.0f;
    const float values[CHANNELS] = {a[0] * light, a[1] * light, a[2] * light, a[0] * around,
        a[1] * around, a[2] * around, mirrored, mirrored, mirrored, a[0], a[1], a[2], m, m, m,
        s->normal[0], s->normal[1], s->normal[2], logf(s->depth), s->mirrors ? 0.0f : 0.5f, 1.0f,
        k * seen, k * seen, k * seen, k * logf(s->depth + s->behind), s->mirrors ? 0.0f : k, k};
    for (size_t c = 0; c < CHANNELS; c++) {
        p->sums[c * pixels + at] += values[c];
        if (HG_PATH_IS_FIRST_HALF(number))
            p->halves[c * pixels + at] += values[c];
    }
}

struct picture picture_make_seeded(
    uint32_t width, uint32_t height, uint32_t samples, point_at *at, uint32_t seed)
{
    struct picture p = {.width = width, .height = height, .samples = samples};
    const size_t pixels = (size_t)width * height;
    const size_t tiles = (size_t)((width + 15) / 16) * ((height + 15) / 16);
    p.sums = calloc(CHANNELS * pixels, sizeof(float));
    p.halves = calloc(CHANNELS * pixels, sizeof(float));
    p.out = calloc(HG_DENOISE_LIGHT * pixels, sizeof(float));
    p.counts = calloc(tiles, sizeof(uint32_t));
    assert_true(p.sums && p.halves && p.out && p.counts);
    for (size_t i = 0; i < tiles; i++)
        p.counts[i] = samples;
    seed_state = seed;
    for (uint32_t y = 0; y < height; y++) {
        for (uint32_t x = 0; x < width; x++) {
            const struct point point = at(x, y);
            for (uint32_t i = 0; i < samples && point.depth > 0; i++)
                add_sample(&p, (size_t)y * width + x, i, &point);
        }
    }
    p.input = (struct hg_denoise_input){
        .width = width, .height = height, .sums = p.sums, .halves = p.halves, .samples = p.counts};
    return p;
}

struct picture picture_make(uint32_t width, uint32_t height, uint32_t samples, point_at *at)
{
    return picture_make_seeded(width, height, samples, at, 1);
}

void picture_finish(struct picture *p)
{
    free(p->sums);
    free(p->halves);
    free(p->out);
    free(p->counts);
}

void picture_denoise(struct picture *p, unsigned threads)
{
    struct hg_error err = {0};
    struct hg_jobs *jobs = hg_jobs_create(threads);
    assert_non_null(jobs);
    test_ok(hg_denoise_run(jobs, &p->input, p->out, &err), &err);
    hg_jobs_destroy(jobs);
    for (size_t i = 0; i < (size_t)p->width * p->height * HG_DENOISE_LIGHT; i++)
        assert_true(isfinite(p->out[i]) && p->out[i] >= 0.0f);
}

float picture_out(const struct picture *p, uint32_t x, uint32_t y, int channel)
{
    return p->out[((size_t)channel * p->height + y) * p->width + x];
}

float picture_raw(const struct picture *p, uint32_t x, uint32_t y, int channel)
{
    return p->sums[((size_t)channel * p->height + y) * p->width + x] / (float)p->samples;
}

// Root of the mean squared difference from the truth in a channel, relative to the truth.
double picture_error(const struct picture *p, point_at *truth, bool raw)
{
    double sum = 0.0;
    for (uint32_t y = 0; y < p->height; y++) {
        for (uint32_t x = 0; x < p->width; x++) {
            const struct point t = truth(x, y);
            const double want = (double)(t.irradiance * t.albedo[0]);
            const double got = (double)(raw ? picture_raw(p, x, y, 0) : picture_out(p, x, y, 0));
            sum += (got / want - 1.0) * (got / want - 1.0);
        }
    }
    return sqrt(sum / ((double)p->width * p->height));
}

struct point point_wall(float noise)
{
    return (struct point){.irradiance = 2.0f,
        .mirrored = 0.5f,
        .albedo = {0.5f, 0.4f, 0.3f},
        .reflection = 0.04f,
        .normal = {0, 0, 1},
        .depth = 3.0f,
        .noise = noise,
        .seen = 1.0f};
}

struct point point_noisy_wall(uint32_t x, uint32_t y)
{
    (void)x;
    (void)y;
    return point_wall(1.0f);
}

// A texture in a mirror, in a polished surface that mirrors a quarter of the paths, and behind
// glass that mirrors something white as well.
struct point point_mirror(uint32_t x, uint32_t y)
{
    struct point p = point_wall(1.0f);
    p.mirrors = true;
    p.reflection = 0.9f;
    p.seen = (x / 2 + y / 3) % 2 ? 0.1f : 0.6f;
    return p;
}

struct point point_polished(uint32_t x, uint32_t y)
{
    struct point p = point_mirror(x / 3, y / 3);
    p.knows = 0.25f;
    return p;
}

// As error_of, of mirrored light.
double picture_mirror_error(const struct picture *p, point_at *truth, bool raw)
{
    double sum = 0.0;
    for (uint32_t y = 0; y < p->height; y++) {
        for (uint32_t x = 0; x < p->width; x++) {
            const struct point t = truth(x, y);
            const float seen = t.shines + (1.0f - t.shines) * t.seen;
            const double want = (double)(t.mirrored * t.reflection * seen);
            const double got = (double)(raw ? picture_raw(p, x, y, 6) : picture_out(p, x, y, 6));
            sum += (got / want - 1.0) * (got / want - 1.0);
        }
    }
    return sqrt(sum / ((double)p->width * p->height));
}
