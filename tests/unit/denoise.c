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
#include "tests/support/check.h"
#include "tests/unit/denoise_pictures.h"

// --- scenes --------------------------------------------------------------------------------------

static struct point still_wall(uint32_t x, uint32_t y)
{
    (void)x;
    (void)y;
    return point_wall(0.0f);
}

static struct point nearly_still_shadow(uint32_t x, uint32_t y)
{
    struct point p = point_wall(1e-4f);
    p.irradiance = x + y / 3 < 40 ? 0.2f : 2.0f;
    p.mirrored = (x / 3 + y / 3) % 2 ? 0.2f : 0.7f; // what is seen in a mirror
    return p;
}

// A corner: light and normal change, the albedo does not.
static struct point corner(uint32_t x, uint32_t y)
{
    struct point p = point_wall(1.0f);
    (void)y;
    p.irradiance = x < 37 ? 0.2f : 2.0f;
    p.normal[0] = x < 37 ? 1.0f : 0.0f;
    p.normal[2] = x < 37 ? 0.0f : 1.0f;
    return p;
}

// In front of a wall stands another one, of the same normal and albedo.
static struct point step(uint32_t x, uint32_t y)
{
    struct point p = point_wall(1.0f);
    (void)y;
    p.irradiance = x < 37 ? 0.2f : 2.0f;
    p.depth = x < 37 ? 3.0f : 4.0f;
    return p;
}

static struct point checkers(uint32_t x, uint32_t y)
{
    struct point p = point_wall(1.0f);
    for (int c = 0; c < 3; c++)
        p.albedo[c] = (x / 2 + y / 3) % 2 ? 0.1f : 0.6f;
    return p;
}

static struct point glazed(uint32_t x, uint32_t y)
{
    struct point p = point_mirror(x / 3, y / 3);
    p.noise = 0.1f;
    p.shines = 0.15f;
    return p;
}

// Light that follows the normal of a rounded surface.
static struct point column(uint32_t x, uint32_t y)
{
    struct point p = point_wall(0.5f);
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
        struct picture p = picture_make(80, 48, samples, still_wall);
        picture_denoise(&p, 2);
        const double error = picture_error(&p, still_wall, false);
        print_message("constant, %u samples: %.1e\n", samples, error);
        assert_true(error < 2e-6);
        picture_finish(&p);
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
        struct picture p = picture_make(96, 96, cases[i].samples, point_noisy_wall);
        picture_denoise(&p, 2);
        const double gain = 20.0 * log10(picture_error(&p, point_noisy_wall, true) /
                                         picture_error(&p, point_noisy_wall, false));
        print_message("wall, %u samples: %.1f dB\n", cases[i].samples, gain);
        assert_true(gain > cases[i].least_db);
        picture_finish(&p);
    }
}

// Of each region as much as of its samples; of the picture, which energy.c looks after, exactly.
static void test_energy_stays(void **state)
{
    (void)state;
    struct picture p = picture_make(128, 128, 16, point_noisy_wall);
    picture_denoise(&p, 2);
    double worst = 0.0, all_raw = 0.0, all_out = 0.0;
    for (uint32_t r = 0; r < 16; r++) {
        double raw = 0.0, out = 0.0;
        for (uint32_t i = 0; i < 32 * 32; i++) {
            const uint32_t x = r % 4 * 32 + i % 32, y = r / 4 * 32 + i / 32;
            raw += (double)picture_raw(&p, x, y, 0);
            out += (double)picture_out(&p, x, y, 0);
        }
        worst = fmax(worst, fabs(out / raw - 1.0));
        all_raw += raw;
        all_out += out;
    }
    const double all = fabs(all_out / all_raw - 1.0);
    print_message("energy: %.2f %%, of all %.5f %%\n", 100.0 * worst, 100.0 * all);
    assert_true(worst < 0.01);
    assert_true(all < 1e-4);
    picture_finish(&p);
}

static void test_no_noise_no_change(void **state)
{
    (void)state;
    struct picture p = picture_make(96, 64, 64, nearly_still_shadow);
    picture_denoise(&p, 2);
    double worst = 0.0;
    for (uint32_t y = 0; y < p.height; y++) {
        for (uint32_t x = 0; x < p.width; x++) {
            for (int c = 0; c < HG_DENOISE_LIGHT; c++)
                worst = fmax(worst,
                    fabs((double)(picture_out(&p, x, y, c) / picture_raw(&p, x, y, c)) - 1.0));
        }
    }
    print_message("no noise: %.1e\n", worst);
    assert_true(worst < 1e-3);
    picture_finish(&p);
}

static void check_edge(const char *name, point_at *scene)
{
    struct picture p = picture_make(80, 80, 8, scene);
    picture_denoise(&p, 2);
    for (uint32_t x = 35; x < 39; x++) {
        double mean = 0.0;
        for (uint32_t y = 0; y < p.height; y++)
            mean += (double)picture_out(&p, x, y, 0) / p.height;
        const struct point t = scene(x, 0);
        const double off = mean / (double)(t.irradiance * t.albedo[0]) - 1.0;
        print_message("%s, column %u: %+.1f %%\n", name, x, 100.0 * off);
        assert_true(fabs(off) < 0.12); // noise of what is left; across, 900 or -90 %
    }
    picture_finish(&p);
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
    struct picture p = picture_make(96, 96, 4, checkers);
    picture_denoise(&p, 2);
    const double error = picture_error(&p, checkers, false),
                 raw = picture_error(&p, checkers, true);
    print_message("checkers: %.3f of %.3f\n", error, raw);
    assert_true(error < 0.25 * raw && error < 0.12);
    picture_finish(&p);
}

static void test_mirrors(void **state)
{
    (void)state;
    static const struct {
        const char *name;
        point_at *scene;
        double most; // of the error of samples
    } cases[] = {
        {"mirror", point_mirror, 0.25}, {"polished", point_polished, 0.4}, {"glazed", glazed, 0.6}};
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        struct picture p = picture_make(96, 96, 4, cases[i].scene);
        picture_denoise(&p, 2);
        const double error = picture_mirror_error(&p, cases[i].scene, false);
        const double raw = picture_mirror_error(&p, cases[i].scene, true);
        print_message("%s: %.3f of %.3f\n", cases[i].name, error, raw);
        assert_true(error < cases[i].most * raw);
        picture_finish(&p);
    }
}

static void test_curves(void **state)
{
    (void)state;
    struct picture p = picture_make(80, 80, 16, column);
    picture_denoise(&p, 2);
    const double error = picture_error(&p, column, false), raw = picture_error(&p, column, true);
    print_message("column: %.3f of %.3f\n", error, raw);
    assert_true(error < 0.35 * raw);
    picture_finish(&p);
}

static void test_fireflies(void **state)
{
    (void)state;
    for (uint32_t samples = 1; samples <= 16; samples *= 4) {
        struct picture p = picture_make(64, 64, samples, point_noisy_wall);
        const size_t at = 32 * 64 + 32;
        for (size_t c = 0; c < 3; c++) { // its first sample
            p.sums[c * 64 * 64 + at] += 1e5f;
            p.halves[c * 64 * 64 + at] += 1e5f;
        }
        picture_denoise(&p, 2);
        double most = 0.0;
        for (uint32_t y = 26; y < 39; y++)
            for (uint32_t x = 26; x < 39; x++)
                most = fmax(most, (double)picture_out(&p, x, y, 0));
        print_message("firefly, %u samples: %.2f of 1\n", samples, most);
        assert_true(most < 2.0);
        picture_finish(&p);
    }
}

static struct point polished_metal(uint32_t x, uint32_t y)
{
    struct point p = point_wall(0.0f);
    (void)x;
    (void)y;
    p.irradiance = 0.0f;
    p.reflection = p.seen = 1.0f;
    p.mirrored = 0.2f;
    p.mirrors = true;
    return p;
}

// Lamps that single samples see in polished metal stay in their pixels, with all of their light.
static void test_highlights(void **state)
{
    (void)state;
    enum { SIDE = 64, SAMPLES = 16, LAMPS = 5 };
    static const uint32_t lamps[LAMPS][2] = {{30, 30}, {33, 35}, {36, 31}, {40, 33}, {31, 40}};
    struct picture p = picture_make(SIDE, SIDE, SAMPLES, polished_metal);
    for (int i = 0; i < LAMPS; i++)
        for (size_t c = HG_PATH_GUIDE_SPECULAR; c < HG_PATH_GUIDE_SPECULAR + 3; c++) {
            const size_t at = (c * SIDE + lamps[i][1]) * SIDE + lamps[i][0];
            p.sums[at] += 300.0f;
            p.halves[at] += i % 2 ? 0.0f : 300.0f;
        }
    picture_denoise(&p, 2);
    double worst = 0.0, lost = 0.0;
    for (uint32_t y = 0; y < SIDE; y++)
        for (uint32_t x = 0; x < SIDE; x++) {
            const double raw = (double)picture_raw(&p, x, y, HG_PATH_GUIDE_SPECULAR);
            const double off = (double)picture_out(&p, x, y, HG_PATH_GUIDE_SPECULAR) / raw - 1.0;
            if (raw > 1.0)
                lost = fmax(lost, fabs(off));
            else
                worst = fmax(worst, fabs(off));
        }
    print_message("highlights: lamps %.1f %% off, around them %.1f %%\n", 1e2 * lost, 1e2 * worst);
    assert_true(lost < 0.05 && worst < 0.1);
    const size_t bytes = (size_t)SIDE * SIDE * HG_DENOISE_LIGHT * sizeof(float);
    float *whole = malloc(bytes);
    assert_non_null(whole);
    memcpy(whole, p.out, bytes);
    p.input.part_px = 33;
    picture_denoise(&p, 2);
    assert_memory_equal(p.out, whole, bytes);
    free(whole);
    picture_finish(&p);
}

static void test_threads(void **state)
{
    (void)state;
    struct picture a = picture_make(100, 70, 8, corner), b = picture_make(100, 70, 8, corner);
    picture_denoise(&a, 1);
    for (unsigned threads = 2; threads < 6; threads += 3) {
        picture_denoise(&b, threads);
        assert_memory_equal(a.out, b.out, 100 * 70 * HG_DENOISE_LIGHT * sizeof(float));
    }
    picture_finish(&a);
    picture_finish(&b);
}

// In parts as in one piece, to the bit.
static void test_parts(void **state)
{
    (void)state;
    static const uint32_t sides[] = {33, 64, 100};
    struct picture a = picture_make(150, 90, 6, corner), b = picture_make(150, 90, 6, corner);
    a.sums[40 * 150 + 100] += 300.0f;
    b.sums[40 * 150 + 100] += 300.0f;
    picture_denoise(&a, 2);
    for (size_t i = 0; i < sizeof sides / sizeof *sides; i++) {
        b.input.part_px = sides[i];
        picture_denoise(&b, 2);
        assert_memory_equal(a.out, b.out, 150 * 90 * HG_DENOISE_LIGHT * sizeof(float));
    }
    picture_finish(&a);
    picture_finish(&b);
}

static struct point sparse(uint32_t x, uint32_t y)
{
    struct point p = point_wall(1.0f);
    p.depth = (x + y) % 3 ? 2.0f : 0.0f; // 0: nothing is hit
    return p;
}

static void test_sizes(void **state)
{
    (void)state;
    static const uint32_t sizes[][2] = {{1, 1}, {3, 2}, {17, 33}, {33, 17}, {70, 1}};
    for (size_t i = 0; i < sizeof sizes / sizeof *sizes; i++) {
        struct picture p = picture_make(sizes[i][0], sizes[i][1], 3, sparse);
        p.counts[0] = i % 2 ? 3 : 0; // a tile without samples
        picture_denoise(&p, 2);
        for (uint32_t y = 0; y < p.height; y++)
            for (uint32_t x = 0; x < p.width; x++)
                if ((x + y) % 3 == 0)
                    assert_true(picture_out(&p, x, y, 0) == 0.0f);
        picture_finish(&p);
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
    struct point p = point_wall(0.0f);
    p.depth = covered(x, y) > 0.5f ? 3.0f : 0.0f;
    return p;
}

static float *shown_of(const struct picture *p)
{
    const size_t pixels = (size_t)p->width * p->height;
    const struct point s = point_wall(0.0f);
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
    const struct point w = point_wall(0.0f);
    const float want[3] = {w.irradiance, 0.5f * w.irradiance, w.mirrored};
    struct picture p = picture_make(96, 64, 4, cut), parts = picture_make(96, 64, 4, cut);
    float *shown = shown_of(&p), worst = 0.0f;
    uint32_t between = 0;
    p.input.shown = parts.input.shown = shown;
    p.input.taps = parts.input.taps = taps;
    p.input.taps_count = parts.input.taps_count = 2;
    parts.input.part_px = 33;
    picture_denoise(&p, 1);
    picture_denoise(&parts, 3);
    for (uint32_t i = 0; i < 96 * 64 * 3; i++) {
        const uint32_t x = i % 96, y = i / 96 % 64, kind = i / (96 * 64);
        const float albedo = kind == 2 ? w.reflection : w.albedo[0], part = covered(x, y);
        const float off = picture_out(&p, x, y, (int)kind * 3) / (want[kind] * albedo) - part;
        worst = fabsf(off) > worst ? fabsf(off) : worst;
        between += kind == 0 && part > 0.0f && part < 0.5f;
    }
    print_message("shown: off by %.4f at most\n", (double)worst);
    assert_true(between > 50);
    assert_true(worst < 0.01f);
    assert_memory_equal(p.out, parts.out, 96 * 64 * HG_DENOISE_LIGHT * sizeof(float));
    free(shown);
    picture_finish(&p);
    picture_finish(&parts);
}

// Two lights on one surface: as much of each as the taps say.
static void test_taps(void **state)
{
    (void)state;
    static const struct hg_denoise_taps taps = {{0.05f, 0.85f, 0.1f}, {0, 1, 0}};
    struct picture p = picture_make(96, 64, 4, nearly_still_shadow),
                   raw = picture_make(96, 64, 4, nearly_still_shadow);
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
    picture_denoise(&p, 2);
    picture_denoise(&raw, 2);
    for (uint32_t i = 0; i < 94 * 64; i++) {
        const uint32_t x = 1 + i % 94, y = i / 94;
        for (int c = 0; c < HG_DENOISE_LIGHT; c++) {
            const float mean = 0.05f * picture_out(&raw, x - 1, y, c) +
                               0.85f * picture_out(&raw, x, y, c) +
                               0.1f * picture_out(&raw, x + 1, y, c);
            assert_true(fabsf(picture_out(&p, x, y, c) / mean - 1.0f) < 0.02f);
        }
    }
    free(shown);
    picture_finish(&p);
    picture_finish(&raw);
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
        cmocka_unit_test(test_highlights),
        cmocka_unit_test(test_threads),
        cmocka_unit_test(test_parts),
        cmocka_unit_test(test_sizes),
        cmocka_unit_test(test_shown),
        cmocka_unit_test(test_taps),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
