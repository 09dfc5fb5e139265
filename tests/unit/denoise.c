// denoise.c - laws of the denoiser on made pictures: what is constant stays so, noise goes and
// energy stays, edges and textures are not blurred, nothing changes where there is no noise, single
// samples make no spots, threads make no difference.
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "base/alloc.h"
#include "renderer/denoise/denoise.h"
#include "tests/support/check.h"

enum { CHANNELS = HG_PATH_GUIDE_CHANNELS };

// What a pixel shows, and how its samples scatter.
struct point {
    float irradiance, mirrored; // means; light is these times the albedos
    float albedo[3], reflection, normal[3], depth, noise;
    float seen;   // albedo of what is seen in a mirror
    float behind; // and how far behind it, metres
    float knows,
        shines; // shares of samples that follow it, that see something white in it; 0: 1, 0
    bool mirrors;
};

struct picture {
    uint32_t width, height, samples;
    struct hg_denoise_input input;
    float *sums, *halves, *out;
    uint32_t *counts;
};

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

typedef struct point point_at(uint32_t x, uint32_t y); // of a made scene

static struct picture make_seeded(
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

static struct picture make(uint32_t width, uint32_t height, uint32_t samples, point_at *at)
{
    return make_seeded(width, height, samples, at, 1);
}

static void finish(struct picture *p)
{
    free(p->sums);
    free(p->halves);
    free(p->out);
    free(p->counts);
}

static void run(struct picture *p, unsigned threads)
{
    struct hg_error err = {0};
    struct hg_jobs *jobs = hg_jobs_create(threads);
    assert_non_null(jobs);
    test_ok(hg_denoise_run(jobs, &p->input, p->out, &err), &err);
    hg_jobs_destroy(jobs);
    for (size_t i = 0; i < (size_t)p->width * p->height * HG_DENOISE_LIGHT; i++)
        assert_true(isfinite(p->out[i]) && p->out[i] >= 0.0f);
}

static float out_at(const struct picture *p, uint32_t x, uint32_t y, int channel)
{
    return p->out[((size_t)channel * p->height + y) * p->width + x];
}

static float raw_at(const struct picture *p, uint32_t x, uint32_t y, int channel)
{
    return p->sums[((size_t)channel * p->height + y) * p->width + x] / (float)p->samples;
}

// Root of the mean squared difference from the truth in a channel, relative to the truth.
static double error_of(const struct picture *p, point_at *truth, bool raw)
{
    double sum = 0.0;
    for (uint32_t y = 0; y < p->height; y++) {
        for (uint32_t x = 0; x < p->width; x++) {
            const struct point t = truth(x, y);
            const double want = (double)(t.irradiance * t.albedo[0]);
            const double got = (double)(raw ? raw_at(p, x, y, 0) : out_at(p, x, y, 0));
            sum += (got / want - 1.0) * (got / want - 1.0);
        }
    }
    return sqrt(sum / ((double)p->width * p->height));
}

// --- scenes --------------------------------------------------------------------------------------

static struct point wall(float noise)
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

static struct point still_wall(uint32_t x, uint32_t y)
{
    (void)x;
    (void)y;
    return wall(0.0f);
}

static struct point noisy_wall(uint32_t x, uint32_t y)
{
    (void)x;
    (void)y;
    return wall(1.0f);
}

static struct point nearly_still_shadow(uint32_t x, uint32_t y)
{
    struct point p = wall(1e-4f);
    p.irradiance = x + y / 3 < 40 ? 0.2f : 2.0f;
    p.mirrored = (x / 3 + y / 3) % 2 ? 0.2f : 0.7f; // what is seen in a mirror
    return p;
}

// A corner: light and normal change, the albedo does not.
static struct point corner(uint32_t x, uint32_t y)
{
    struct point p = wall(1.0f);
    (void)y;
    p.irradiance = x < 37 ? 0.2f : 2.0f;
    p.normal[0] = x < 37 ? 1.0f : 0.0f;
    p.normal[2] = x < 37 ? 0.0f : 1.0f;
    return p;
}

// In front of a wall stands another one, of the same normal and albedo.
static struct point step(uint32_t x, uint32_t y)
{
    struct point p = wall(1.0f);
    (void)y;
    p.irradiance = x < 37 ? 0.2f : 2.0f;
    p.depth = x < 37 ? 3.0f : 4.0f;
    return p;
}

static struct point checkers(uint32_t x, uint32_t y)
{
    struct point p = wall(1.0f);
    for (int c = 0; c < 3; c++)
        p.albedo[c] = (x / 2 + y / 3) % 2 ? 0.1f : 0.6f;
    return p;
}

// A texture in a mirror, in a polished surface that mirrors a quarter of the paths, and behind
// glass that mirrors something white as well.
static struct point mirror(uint32_t x, uint32_t y)
{
    struct point p = wall(1.0f);
    p.mirrors = true;
    p.reflection = 0.9f;
    p.seen = (x / 2 + y / 3) % 2 ? 0.1f : 0.6f;
    return p;
}

static struct point polished(uint32_t x, uint32_t y)
{
    struct point p = mirror(x / 3, y / 3);
    p.knows = 0.25f;
    return p;
}

static struct point glazed(uint32_t x, uint32_t y)
{
    struct point p = mirror(x / 3, y / 3);
    p.noise = 0.1f;
    p.shines = 0.15f;
    return p;
}

// Light that follows the normal of a rounded surface.
static struct point column(uint32_t x, uint32_t y)
{
    struct point p = wall(0.5f);
    (void)y;
    const float s = ((float)x - 40.0f) / 45.0f;
    p.normal[0] = s;
    p.normal[2] = sqrtf(1.0f - s * s);
    p.irradiance =
        0.5f + 1.5f * (0.6f * s + 0.8f * p.normal[2] > 0 ? 0.6f * s + 0.8f * p.normal[2] : 0);
    return p;
}

// --- laws ----------------------------------------------------------------------------------------

static void test_constant(void **state)
{
    (void)state;
    for (uint32_t samples = 1; samples <= 16; samples += 5) {
        struct picture p = make(80, 48, samples, still_wall);
        run(&p, 2);
        const double error = error_of(&p, still_wall, false);
        print_message("constant, %u samples: %.1e\n", samples, error);
        assert_true(error < 2e-6);
        finish(&p);
    }
}

static void test_noise_goes(void **state)
{
    (void)state;
    static const struct {
        uint32_t samples;
        double least_db;
    } cases[] = {{1, 10.0}, {2, 10.0}, {4, 12.0}, {16, 14.0}, {64, 14.0}};
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        struct picture p = make(96, 96, cases[i].samples, noisy_wall);
        run(&p, 2);
        const double gain =
            20.0 * log10(error_of(&p, noisy_wall, true) / error_of(&p, noisy_wall, false));
        print_message("wall, %u samples: %.1f dB\n", cases[i].samples, gain);
        assert_true(gain > cases[i].least_db);
        finish(&p);
    }
}

// Of each region as much as of its samples; of the picture, which energy.c looks after, exactly.
static void test_energy_stays(void **state)
{
    (void)state;
    struct picture p = make(128, 128, 16, noisy_wall);
    run(&p, 2);
    double worst = 0.0, all_raw = 0.0, all_out = 0.0;
    for (uint32_t r = 0; r < 16; r++) {
        double raw = 0.0, out = 0.0;
        for (uint32_t i = 0; i < 32 * 32; i++) {
            const uint32_t x = r % 4 * 32 + i % 32, y = r / 4 * 32 + i / 32;
            raw += (double)raw_at(&p, x, y, 0);
            out += (double)out_at(&p, x, y, 0);
        }
        worst = fmax(worst, fabs(out / raw - 1.0));
        all_raw += raw;
        all_out += out;
    }
    const double all = fabs(all_out / all_raw - 1.0);
    print_message("energy: %.2f %%, of all %.5f %%\n", 100.0 * worst, 100.0 * all);
    assert_true(worst < 0.01);
    assert_true(all < 1e-4);
    finish(&p);
}

static void test_no_noise_no_change(void **state)
{
    (void)state;
    struct picture p = make(96, 64, 64, nearly_still_shadow);
    run(&p, 2);
    double worst = 0.0;
    for (uint32_t y = 0; y < p.height; y++) {
        for (uint32_t x = 0; x < p.width; x++) {
            for (int c = 0; c < HG_DENOISE_LIGHT; c++)
                worst =
                    fmax(worst, fabs((double)(out_at(&p, x, y, c) / raw_at(&p, x, y, c)) - 1.0));
        }
    }
    print_message("no noise: %.1e\n", worst);
    assert_true(worst < 1e-3);
    finish(&p);
}

static void check_edge(const char *name, point_at *scene)
{
    struct picture p = make(80, 80, 8, scene);
    run(&p, 2);
    for (uint32_t x = 35; x < 39; x++) {
        double mean = 0.0;
        for (uint32_t y = 0; y < p.height; y++)
            mean += (double)out_at(&p, x, y, 0) / p.height;
        const struct point t = scene(x, 0);
        const double off = mean / (double)(t.irradiance * t.albedo[0]) - 1.0;
        print_message("%s, column %u: %+.1f %%\n", name, x, 100.0 * off);
        assert_true(fabs(off) < 0.12); // noise of what is left; across, 900 or -90 %
    }
    finish(&p);
}

static void test_edges(void **state)
{
    (void)state;
    check_edge("corner", corner);
    check_edge("step", step);
}

static void test_textures(void **state)
{
    (void)state;
    struct picture p = make(96, 96, 4, checkers);
    run(&p, 2);
    const double error = error_of(&p, checkers, false), raw = error_of(&p, checkers, true);
    print_message("checkers: %.3f of %.3f\n", error, raw);
    assert_true(error < 0.25 * raw && error < 0.12);
    finish(&p);
}

// As error_of, of mirrored light.
static double mirror_error(const struct picture *p, point_at *truth, bool raw)
{
    double sum = 0.0;
    for (uint32_t y = 0; y < p->height; y++) {
        for (uint32_t x = 0; x < p->width; x++) {
            const struct point t = truth(x, y);
            const float seen = t.shines + (1.0f - t.shines) * t.seen;
            const double want = (double)(t.mirrored * t.reflection * seen);
            const double got = (double)(raw ? raw_at(p, x, y, 6) : out_at(p, x, y, 6));
            sum += (got / want - 1.0) * (got / want - 1.0);
        }
    }
    return sqrt(sum / ((double)p->width * p->height));
}

static void test_mirrors(void **state)
{
    (void)state;
    static const struct {
        const char *name;
        point_at *scene;
        double most; // of the error of samples
    } cases[] = {{"mirror", mirror, 0.25}, {"polished", polished, 0.4}, {"glazed", glazed, 0.6}};
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        struct picture p = make(96, 96, 4, cases[i].scene);
        run(&p, 2);
        const double error = mirror_error(&p, cases[i].scene, false);
        const double raw = mirror_error(&p, cases[i].scene, true);
        print_message("%s: %.3f of %.3f\n", cases[i].name, error, raw);
        assert_true(error < cases[i].most * raw);
        finish(&p);
    }
}

static void test_curves(void **state)
{
    (void)state;
    struct picture p = make(80, 80, 16, column);
    run(&p, 2);
    const double error = error_of(&p, column, false), raw = error_of(&p, column, true);
    print_message("column: %.3f of %.3f\n", error, raw);
    assert_true(error < 0.35 * raw);
    finish(&p);
}

static void test_fireflies(void **state)
{
    (void)state;
    for (uint32_t samples = 1; samples <= 16; samples *= 4) {
        struct picture p = make(64, 64, samples, noisy_wall);
        const size_t at = 32 * 64 + 32;
        for (size_t c = 0; c < 3; c++) { // its first sample
            p.sums[c * 64 * 64 + at] += 1e5f;
            p.halves[c * 64 * 64 + at] += 1e5f;
        }
        run(&p, 2);
        double most = 0.0;
        for (uint32_t y = 26; y < 39; y++)
            for (uint32_t x = 26; x < 39; x++)
                most = fmax(most, (double)out_at(&p, x, y, 0));
        print_message("firefly, %u samples: %.2f of 1\n", samples, most);
        assert_true(most < 2.0);
        finish(&p);
    }
}

static void test_threads(void **state)
{
    (void)state;
    struct picture a = make(100, 70, 8, corner), b = make(100, 70, 8, corner);
    run(&a, 1);
    for (unsigned threads = 2; threads < 6; threads += 3) {
        run(&b, threads);
        assert_memory_equal(a.out, b.out, 100 * 70 * HG_DENOISE_LIGHT * sizeof(float));
    }
    finish(&a);
    finish(&b);
}

// In parts as in one piece, to the bit.
static void test_parts(void **state)
{
    (void)state;
    static const uint32_t sides[] = {33, 64, 100};
    struct picture a = make(150, 90, 6, corner), b = make(150, 90, 6, corner);
    a.sums[40 * 150 + 100] += 300.0f;
    b.sums[40 * 150 + 100] += 300.0f;
    run(&a, 2);
    for (size_t i = 0; i < sizeof sides / sizeof *sides; i++) {
        b.input.part_px = sides[i];
        run(&b, 2);
        assert_memory_equal(a.out, b.out, 150 * 90 * HG_DENOISE_LIGHT * sizeof(float));
    }
    finish(&a);
    finish(&b);
}

static struct point sparse(uint32_t x, uint32_t y)
{
    struct point p = wall(1.0f);
    p.depth = (x + y) % 3 ? 2.0f : 0.0f; // 0: nothing is hit
    return p;
}

static void test_sizes(void **state)
{
    (void)state;
    static const uint32_t sizes[][2] = {{1, 1}, {3, 2}, {17, 33}, {33, 17}, {70, 1}};
    for (size_t i = 0; i < sizeof sizes / sizeof *sizes; i++) {
        struct picture p = make(sizes[i][0], sizes[i][1], 3, sparse);
        p.counts[0] = i % 2 ? 3 : 0; // a tile without samples
        run(&p, 2);
        for (uint32_t y = 0; y < p.height; y++)
            for (uint32_t x = 0; x < p.width; x++)
                if ((x + y) % 3 == 0)
                    assert_true(out_at(&p, x, y, 0) == 0.0f);
        finish(&p);
    }
}

// --- what pixels show ----------------------------------------------------------------------------

// How much of a pixel something covers that stands before nothing: an edge two pixels wide.
static float covered(uint32_t x, uint32_t y)
{
    const float off = 0.5f + (50.2f - (float)x - (float)y / 3.0f) / 2.0f;
    return off < 0.0f ? 0.0f : off > 1.0f ? 1.0f : off;
}

// The samples of a pixel itself see all of it or nothing.
static struct point cut(uint32_t x, uint32_t y)
{
    struct point p = wall(0.0f);
    p.depth = covered(x, y) > 0.5f ? 3.0f : 0.0f;
    return p;
}

static float *shown_of(const struct picture *p)
{
    const size_t pixels = (size_t)p->width * p->height;
    const struct point s = wall(0.0f);
    const float values[HG_PATH_SHOWN_CHANNELS] = {0, 0, 0, s.albedo[0], s.albedo[1], s.albedo[2],
        s.reflection, s.reflection, s.reflection, 1.0f};
    float *out = calloc(HG_PATH_SHOWN_CHANNELS * pixels, sizeof *out);
    assert_non_null(out);
    for (size_t i = 0; i < HG_PATH_SHOWN_CHANNELS * pixels; i++) {
        const uint32_t at = (uint32_t)(i % pixels);
        out[i] = (float)p->samples * covered(at % p->width, at / p->width) * values[i / pixels];
    }
    return out;
}

// Light is as much as what a pixel shows has of it, also where its own samples see nothing.
static void test_shown(void **state)
{
    (void)state;
    static const struct hg_denoise_taps taps[] = {{{0, 1, 0}, {0, 1, 0}}, // of no tile here
        {{0.1f, 0.8f, 0.1f}, {0.1f, 0.8f, 0.1f}}};
    const struct point w = wall(0.0f);
    const float want[3] = {w.irradiance, 0.5f * w.irradiance, w.mirrored};
    struct picture p = make(96, 64, 4, cut), parts = make(96, 64, 4, cut);
    float *shown = shown_of(&p), worst = 0.0f;
    uint32_t between = 0;
    p.input.shown = parts.input.shown = shown;
    p.input.taps = parts.input.taps = taps;
    p.input.taps_count = parts.input.taps_count = 2;
    parts.input.part_px = 33;
    run(&p, 1);
    run(&parts, 3);
    for (uint32_t i = 0; i < 96 * 64 * 3; i++) {
        const uint32_t x = i % 96, y = i / 96 % 64, kind = i / (96 * 64);
        const float albedo = kind == 2 ? w.reflection : w.albedo[0], part = covered(x, y);
        const float off = out_at(&p, x, y, (int)kind * 3) / (want[kind] * albedo) - part;
        worst = fabsf(off) > worst ? fabsf(off) : worst;
        between += kind == 0 && part > 0.0f && part < 0.5f;
    }
    print_message("shown: off by %.4f at most\n", (double)worst);
    assert_true(between > 50);
    assert_true(worst < 0.01f);
    assert_memory_equal(p.out, parts.out, 96 * 64 * HG_DENOISE_LIGHT * sizeof(float));
    free(shown);
    finish(&p);
    finish(&parts);
}

// Two lights on one surface: as much of each as the taps say.
static void test_taps(void **state)
{
    (void)state;
    static const struct hg_denoise_taps taps = {{0.05f, 0.85f, 0.1f}, {0, 1, 0}};
    struct picture p = make(96, 64, 4, nearly_still_shadow),
                   raw = make(96, 64, 4, nearly_still_shadow);
    const size_t pixels = 96 * 64;
    float *shown = calloc(HG_PATH_SHOWN_CHANNELS * pixels, sizeof *shown);
    assert_non_null(shown);
    memcpy(shown + HG_PATH_SHOWN_ALBEDO * pixels, p.sums + HG_PATH_GUIDE_ALBEDO * pixels,
        6 * pixels * sizeof *shown);
    memcpy(shown + HG_PATH_SHOWN_HITS * pixels, p.sums + HG_PATH_GUIDE_HITS * pixels,
        pixels * sizeof *shown);
    p.input.shown = shown;
    p.input.taps = &taps;
    p.input.taps_count = 1;
    run(&p, 2);
    run(&raw, 2);
    for (uint32_t i = 0; i < 94 * 64; i++) {
        const uint32_t x = 1 + i % 94, y = i / 94;
        for (int c = 0; c < HG_DENOISE_LIGHT; c++) {
            const float mean = 0.05f * out_at(&raw, x - 1, y, c) + 0.85f * out_at(&raw, x, y, c) +
                               0.1f * out_at(&raw, x + 1, y, c);
            assert_true(fabsf(out_at(&p, x, y, c) / mean - 1.0f) < 0.02f);
        }
    }
    free(shown);
    finish(&p);
    finish(&raw);
}

// --- animation -----------------------------------------------------------------------------------

// A camera at eye_x looks at what stands 3 m away, 0.03 m a pixel there.
static struct hg_denoise_camera camera_at(const struct picture *p, double eye_x)
{
    return (struct hg_denoise_camera){.eye = {eye_x},
        .forward = {0, 0, -1},
        .across = {-0.005 * p->width, 0.005 * p->height, -1},
        .x = {0.01},
        .y = {0, -0.01}};
}

static uint32_t moved_px; // what is seen goes left by so much

static struct point lit_from_right(uint32_t x, uint32_t y)
{
    struct point p = wall(1.0f);
    (void)y;
    p.irradiance = x + moved_px < 60 ? 0.5f : 2.0f; // a shadow's edge
    return p;
}

struct film {
    struct picture last, before; // frames
};

static void film_finish(struct film *film)
{
    finish(&film->last);
    finish(&film->before);
}

// Mean difference of the last two frames where both show the same, relative.
static double flicker_of(const struct film *film, uint32_t step_px)
{
    const struct picture *a = &film->before, *b = &film->last;
    double sum = 0.0;
    for (uint32_t y = 0; y < b->height; y++)
        for (uint32_t x = 0; x + step_px < b->width; x++)
            sum += fabs((double)(out_at(b, x, y, 0) / out_at(a, x + step_px, y, 0)) - 1.0);
    return sum / ((double)b->height * (b->width - step_px));
}

// Frames of 4 samples.
static struct film play(int frames, uint32_t step_px, bool with_history, point_at *scene)
{
    struct film film = {0};
    struct hg_denoise *history = hg_denoise_create();
    assert_non_null(history);
    moved_px = 0;
    for (int i = 0; i < frames; i++, moved_px += step_px) {
        finish(&film.before);
        film.before = film.last;
        film.last = make_seeded(112, 64, 4, scene, 77u + 1000u * (uint32_t)i);
        film.last.input.camera = camera_at(&film.last, 0.03 * moved_px);
        film.last.input.history = with_history ? history : NULL;
        hg_denoise_next(history);
        run(&film.last, 2);
    }
    hg_denoise_destroy(history);
    return film;
}

static void test_flicker(void **state)
{
    (void)state;
    for (uint32_t step_px = 0; step_px < 8; step_px += 7) {
        struct film still = play(8, step_px, false, lit_from_right);
        struct film animation = play(8, step_px, true, lit_from_right);
        const double a = flicker_of(&still, step_px), b = flicker_of(&animation, step_px);
        moved_px -= step_px; // of the last frame
        const double ea = error_of(&still.last, lit_from_right, false);
        const double eb = error_of(&animation.last, lit_from_right, false);
        print_message("%u px a frame: flicker %.4f, %.4f with history; error %.4f, %.4f\n", step_px,
            a, b, ea, eb);
        assert_true(b < 0.5 * a);
        assert_true(eb < 1.05 * ea); // shadows do not lag
        film_finish(&still);
        film_finish(&animation);
    }
}

// Stripes of light in a mirror that stands still, 3 m behind it.
static struct point striped(uint32_t x, uint32_t y)
{
    struct point p = mirror(x, y);
    p.seen = 0.5f;
    p.behind = 3.0f;
    p.mirrored = (x + moved_px) / 10 % 2 ? 0.5f : 2.0f;
    return p;
}

// Error of the last of 8 frames whose stripes go left by so much; told_px: what the frames say.
static double striped_error(uint32_t step_px, int told_px, bool with_history)
{
    enum { WIDTH = 112, HEIGHT = 64, SAMPLES = 4 };
    struct hg_denoise *history = hg_denoise_create();
    float *moved = calloc((size_t)HG_PATH_MOVED_WORDS * WIDTH * HEIGHT, sizeof *moved);
    double error = 0.0;
    assert_true(history && moved);
    for (size_t i = 0; i < WIDTH * HEIGHT; i++) // 0.06 m a pixel
        moved[HG_PATH_MOVED_SEEN * WIDTH * HEIGHT + i] = SAMPLES * 0.06f * (float)told_px;
    for (uint32_t i = 0; i < 8; i++) {
        moved_px = i * step_px;
        struct picture p = make_seeded(WIDTH, HEIGHT, SAMPLES, striped, 77u + 1000u * i);
        p.input.camera = camera_at(&p, 0.0);
        p.input.moved = moved;
        p.input.history = with_history ? history : NULL;
        hg_denoise_next(history);
        run(&p, 2);
        error = mirror_error(&p, striped, false);
        finish(&p);
    }
    hg_denoise_destroy(history);
    free(moved);
    return error;
}

// What is seen in a mirror that stands still is found where it was, not where the mirror is.
static void test_images_move(void **state)
{
    (void)state;
    const double frame = striped_error(3, 3, false), told = striped_error(3, 3, true);
    const double still = striped_error(3, 0, true), wrong = striped_error(3, -3, true);
    print_message(
        "stripes in a mirror: error %.4f, with history %.4f; not told %.4f, wrongly %.4f\n", frame,
        told, still, wrong);
    assert_true(told < 0.87 * frame && told < 0.7 * still && told < 0.7 * wrong);
}

static float lamp;

static struct point lamplit(uint32_t x, uint32_t y)
{
    struct point p = wall(1.0f);
    (void)x;
    (void)y;
    p.irradiance = lamp;
    return p;
}

// A lamp that goes on is on at once.
static void test_change(void **state)
{
    (void)state;
    struct hg_denoise *history = hg_denoise_create();
    assert_non_null(history);
    for (uint32_t i = 0; i < 10; i++) {
        lamp = i < 8 ? 1.0f : 1.6f;
        struct picture p = make_seeded(96, 64, 8, lamplit, 5u + i);
        p.input.camera = camera_at(&p, 0.0);
        p.input.history = history;
        hg_denoise_next(history);
        run(&p, 2);
        double mean = 0.0;
        for (uint32_t k = 0; k < 96 * 64; k++)
            mean += (double)p.out[k] / (96.0 * 64.0);
        print_message("frame %u: %.3f of %.3f\n", i, mean / 0.5, (double)lamp);
        assert_true(fabs(mean / (0.5 * (double)lamp) - 1.0) < 0.05);
        finish(&p);
    }
    hg_denoise_destroy(history);
}

// A history that went through a file is what it was, to the bit.
static void test_saved(void **state)
{
    (void)state;
    struct hg_error err = {0};
    struct hg_denoise *history = hg_denoise_create(), *loaded;
    struct hg_refbuf *file;
    assert_non_null(history);
    struct picture a = make_seeded(64, 48, 4, polished, 3), b = make_seeded(64, 48, 4, polished, 4);
    struct picture c = make_seeded(64, 48, 4, polished, 4);
    struct picture *const all[] = {&a, &b, &c};
    for (size_t i = 0; i < 3; i++)
        all[i]->input.camera = camera_at(all[i], 0.02 * (double)(i > 0));
    a.input.history = b.input.history = history;
    run(&a, 2);
    test_ok(hg_denoise_save(history, &file, &err), &err);
    test_ok(hg_denoise_load(file->data, file->size, &loaded, &err), &err);
    assert_int_equal(
        hg_denoise_load(file->data, file->size - 1, &c.input.history, &err), HG_E_INVAL);
    c.input.history = loaded;
    hg_denoise_next(history);
    hg_denoise_next(loaded);
    run(&b, 2);
    run(&c, 2);
    assert_memory_equal(b.out, c.out, 64 * 48 * HG_DENOISE_LIGHT * sizeof(float));
    hg_refbuf_unref(file);
    for (size_t i = 0; i < 3; i++)
        finish(all[i]);
    hg_denoise_destroy(history);
    hg_denoise_destroy(loaded);
}

// A picture that is run again with a history takes its own place, and another size none.
static void test_again(void **state)
{
    (void)state;
    struct hg_denoise *history = hg_denoise_create();
    assert_non_null(history);
    struct picture a = make(64, 48, 4, noisy_wall), b = make(64, 48, 4, noisy_wall);
    struct picture small = make(20, 30, 4, noisy_wall);
    struct picture *const all[] = {&a, &b, &small};
    for (size_t i = 0; i < 3; i++) {
        all[i]->input.camera = camera_at(all[i], 0.0);
        all[i]->input.history = history;
    }
    run(&small, 2);
    hg_denoise_next(history);
    run(&a, 2);
    run(&b, 3);
    assert_memory_equal(a.out, b.out, 64 * 48 * HG_DENOISE_LIGHT * sizeof(float));
    finish(&a);
    finish(&b);
    finish(&small);
    hg_denoise_destroy(history);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_constant),
        cmocka_unit_test(test_noise_goes),
        cmocka_unit_test(test_energy_stays),
        cmocka_unit_test(test_no_noise_no_change),
        cmocka_unit_test(test_edges),
        cmocka_unit_test(test_textures),
        cmocka_unit_test(test_mirrors),
        cmocka_unit_test(test_curves),
        cmocka_unit_test(test_fireflies),
        cmocka_unit_test(test_threads),
        cmocka_unit_test(test_parts),
        cmocka_unit_test(test_sizes),
        cmocka_unit_test(test_shown),
        cmocka_unit_test(test_taps),
        cmocka_unit_test(test_flicker),
        cmocka_unit_test(test_images_move),
        cmocka_unit_test(test_change),
        cmocka_unit_test(test_saved),
        cmocka_unit_test(test_again),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
