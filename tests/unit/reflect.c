// reflect.c - the lobe of reflections against quadrature and counts, the tests of the radiance
// cache, filters and the place of mirror images.
#include <float.h>
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>

#include <cmocka.h>

#include "base/jobs.h"
#include "renderer/reflect/cache.h"
#include "renderer/reflect/filter.h"

static uint64_t seed = 1;

static float chance(void)
{
    seed = seed * UINT64_C(6364136223846793005) + UINT64_C(1442695040888963407);
    return (float)(seed >> 40) * 0x1p-24f;
}

static const float up[3] = {0, 0, 1};

static void view_at(float degrees, float out[3])
{
    const float a = degrees * (float)HG_PI / 180;
    const float v[3] = {sinf(a), 0, cosf(a)};
    hg_copy3(v, out);
}

// --- lobe ----------------------------------------------------------------------------------------

// Directional albedo of single-scattering GGX with a reflectance of 1, by quadrature over half
// vectors.
static double albedo_of(float roughness, const float v[3])
{
    enum { RINGS = 2000, TURNS = 128 };
    const double alpha = roughness * roughness;
    double sum = 0;
    for (int i = 0; i < RINGS; i++)
        for (int k = 0; k < TURNS; k++) { // even in the cumulative distribution of D cos
            const double u = (i + 0.5) / RINGS, phi = 2 * HG_PI * (k + 0.5) / TURNS;
            const double z = sqrt((1 - u) / (1 + (alpha * alpha - 1) * u)), s = sqrt(1 - z * z);
            const float h[3] = {(float)(s * cos(phi)), (float)(s * sin(phi)), (float)z};
            const float vh = hg_dot3(v, h), l = 2 * vh * h[2] - v[2];
            if (vh <= 0 || l <= 0)
                continue;
            const double lv = hg_lobe_lambda((float)alpha, v[2]),
                         ll = hg_lobe_lambda((float)alpha, l);
            sum += vh / ((1 + lv + ll) * v[2] * z); // f cos / pdf
        }
    return sum / (RINGS * TURNS);
}

static void test_weights(void **state)
{
    (void)state;
    for (int r = 1; r <= 6; r++)
        for (int a = 0; a <= 80; a += 40) {
            const float roughness = 0.1f * (float)r;
            float v[3], sum = 0;
            view_at((float)a, v);
            enum { COUNT = 40000 };
            for (int i = 0; i < COUNT; i++) {
                const float xi[2] = {chance(), chance()};
                const struct hg_lobe_sample s = hg_lobe_take(roughness, 1, up, v, xi);
                assert_true(fabsf(hg_length3(s.direction) - 1) < 1e-3f);
                assert_true(s.weight >= 0 && s.weight <= 1.001f);
                assert_true(s.weight == 0 || s.direction[2] > 0);
                sum += s.weight / COUNT;
            }
            const double want = albedo_of(roughness, v);
            print_message("roughness %.1f, %d degrees: %.4f, quadrature %.4f\n", (double)roughness,
                a, (double)sum, want);
            assert_true(fabs((double)sum - want) < 0.006);
        }
}

// The density of same texels against a count of half vectors drawn from D cos.
static void test_same_texel(void **state)
{
    (void)state;
    enum { COUNT = 400000 };
    for (int r = 2; r <= 6; r += 2)
        for (int wide = 1; wide <= 2; wide++) {
            const float roughness = 0.1f * (float)r, alpha = roughness * roughness;
            const float side = 100.0f / (float)wide; // the sphere of a texel over the ray's length
                                                     // is sqrt(2) / side
            float v[3];
            view_at(30, v);
            const float middle[3] = {-v[0], v[1], v[2]}; // mirror direction: h = up
            const struct hg_lobe_sample s = {.half_cosine = 1, .half_view = v[2]};
            const double p = (double)hg_lobe_same_texel(roughness, &s, 1, side, 1);
            const double edge = sqrt(1 - 2.0 / (side * side));
            uint32_t inside = 0;
            for (int i = 0; i < COUNT; i++) {
                const float u = chance(), phi = 2 * (float)HG_PI * chance();
                const float z = sqrtf((1 - u) / (1 + (alpha * alpha - 1) * u)),
                            q = sqrtf(1 - z * z);
                const float h[3] = {q * cosf(phi), q * sinf(phi), z};
                float l[3];
                for (int c = 0; c < 3; c++)
                    l[c] = 2 * hg_dot3(v, h) * h[c] - v[c];
                inside += (double)hg_dot3(l, middle) > edge;
            }
            const double count = inside / (double)COUNT;
            print_message("roughness %.1f, side %.0f: p %.4f, counted %.4f\n", (double)roughness,
                (double)side, p, count);
            if (p < 0.1)
                assert_true(fabs(p / count - 1) < 0.2);
            else
                assert_true(p >= 0.95 * count); // errs towards rejecting
        }
    const struct hg_lobe_sample mirror = {.half_cosine = 1, .half_view = 1};
    assert_true(hg_lobe_same_texel(0, &mirror, 1, 64, 1) > 0.1f);
}

// --- cache ---------------------------------------------------------------------------------------

struct fixture {
    struct hg_gi_field field;
    struct hg_radiance_cache *cache;
    struct hg_cache_key key;
};

static void set_up(struct fixture *f)
{
    const float min[3] = {-2, -2, -2}, max[3] = {2, 2, 2};
    *f = (struct fixture){.key = {.light = 1, .side = 32, .lit_enough = 1}};
    struct hg_gi_field grid = {0};
    hg_gi_field_grid(&grid, min, max);
    assert_int_equal(hg_gi_field_place_grid(&f->field, &grid), HG_OK);
    for (uint32_t i = 0; i < f->field.count; i++) // all see equally far
        for (int k = 0; k < HG_PROBE_MOMENT_TEXELS; k++)
            f->field.means[i].reach[k][0] = 1;
    assert_int_equal(hg_radiance_cache_create(&f->cache), HG_OK);
    assert_int_equal(hg_radiance_cache_sync(f->cache, &f->key, &f->field), HG_OK);
}

static void tear_down(struct fixture *f)
{
    hg_radiance_cache_destroy(f->cache);
    hg_gi_field_finish(&f->field, NULL);
}

// A hit on the wall x = at, as a rough surface in the middle of the room finds it.
static struct hg_cache_query on_wall(float at, float y, float z, float roughness)
{
    return (struct hg_cache_query){.position = {at, y, z},
        .normal = {-1, 0, 0},
        .roughness = roughness,
        .length = 2,
        .sample = {.half_cosine = 0.98f, .half_view = 0.9f}};
}

// A place from now on shows the wall that was hit.
static void fill(struct fixture *f, struct hg_cache_place place, const struct hg_cache_query *hit)
{
    struct hg_gi_patch wall = {.albedo = {0.5f, 0.25f, 0.125f}, .emission = {0, 0, 2}}, got;
    hg_copy3(hit->position, wall.position);
    hg_copy3(hit->normal, wall.normal);
    hg_radiance_cache_fill(f->cache, place, &wall);
    hg_radiance_cache_surface(f->cache, place, &got);
    assert_memory_equal(got.position, hit->position, sizeof got.position);
    assert_true(fabsf(got.albedo[0] - 0.5f) < 1e-4f && fabsf(got.albedo[2] - 0.125f) < 1e-4f);
    assert_true(got.emission[2] == 2);
}

static void test_cache(void **state)
{
    (void)state;
    struct fixture f;
    struct hg_radiance_cache_stats stats;
    set_up(&f);
    hg_radiance_cache_stats(f.cache, &stats);
    assert_int_equal(stats.probes, HG_CACHE_MOST_PROBES);
    uint32_t accepted = 0, behind = 0;
    for (int i = 0; i < 20000; i++) {
        struct hg_cache_query q =
            on_wall(2, 3 * chance() - 1.5f, 3 * chance() - 1.5f, 0.4f + 0.2f * chance());
        struct hg_cache_place place;
        float got[3];
        enum hg_cache_answer answer = hg_radiance_cache_find(f.cache, &q, &place, got);
        if (answer == HG_CACHE_EMPTY) {
            fill(&f, place, &q);
            answer = hg_radiance_cache_find(f.cache, &q, &place, got);
            assert_int_equal(answer, HG_CACHE_UNLIT); // what filled it is found again
        }
        if (answer == HG_CACHE_UNLIT) {
            assert_true(hg_radiance_cache_ask(f.cache, place));
            assert_false(hg_radiance_cache_ask(f.cache, place)); // once
            hg_radiance_cache_light(f.cache, place, (const float[3]){1, 2, 3});
            answer = hg_radiance_cache_find(f.cache, &q, &place, got);
        }
        accepted += answer == HG_CACHE_FOUND;
        if (answer == HG_CACHE_FOUND)
            assert_true(got[0] == 1 && got[1] == 2 && got[2] == 3);
        // Something in front of the wall, as of now.
        q.position[0] = 0.4f;
        q.filled = true;
        behind += hg_radiance_cache_find(f.cache, &q, &place, got) >= HG_CACHE_UNLIT;
        // What faces another way is another surface.
        q = on_wall(2, q.position[1], q.position[2], q.roughness);
        q.normal[0] = 1;
        q.filled = true;
        assert_true(hg_radiance_cache_find(f.cache, &q, &place, got) < HG_CACHE_UNLIT);
        // Mirrors ask for more than there is, but near a probe.
        q = on_wall(2, q.position[1], q.position[2], 0);
        q.length = 0.25f;
        q.sample = (struct hg_lobe_sample){.half_cosine = 1, .half_view = 1};
        assert_int_equal(hg_radiance_cache_find(f.cache, &q, &place, got), HG_CACHE_NOTHING);
    }
    print_message("%u of 20000 accepted, %u before the wall\n", accepted, behind);
    assert_true(accepted > 15000);
    assert_int_equal(behind, 0);
    tear_down(&f);
}

// Under another light a texel keeps what it had until it is lit again; under one that is chosen by
// chance it has the mean.
static void test_cache_light(void **state)
{
    (void)state;
    struct fixture f;
    set_up(&f);
    struct hg_cache_query q;
    struct hg_cache_place place;
    float got[3];
    q = on_wall(2, 0.3f, 0.4f, 0.5f);
    assert_int_equal(hg_radiance_cache_find(f.cache, &q, &place, got), HG_CACHE_EMPTY);
    fill(&f, place, &q);
    assert_int_equal(hg_radiance_cache_find(f.cache, &q, &place, got), HG_CACHE_UNLIT);
    hg_radiance_cache_light(f.cache, place, (const float[3]){1, 1, 1});
    f.key.light = 2;
    f.key.lit_enough = 2;
    assert_int_equal(hg_radiance_cache_sync(f.cache, &f.key, &f.field), HG_OK);
    assert_int_equal(hg_radiance_cache_find(f.cache, &q, &place, got), HG_CACHE_STALE);
    assert_true(got[0] == 1);
    hg_radiance_cache_light(f.cache, place, (const float[3]){2, 2, 2});
    assert_int_equal(hg_radiance_cache_find(f.cache, &q, &place, got), HG_CACHE_STALE);
    assert_true(got[0] == 2);
    hg_radiance_cache_light(f.cache, place, (const float[3]){4, 4, 4});
    assert_int_equal(hg_radiance_cache_find(f.cache, &q, &place, got), HG_CACHE_FOUND);
    assert_true(got[0] == 3);
    f.key.side = 16;
    assert_int_equal(hg_radiance_cache_sync(f.cache, &f.key, &f.field), HG_OK);
    assert_int_equal(hg_radiance_cache_find(f.cache, &q, &place, got), HG_CACHE_EMPTY);
    f.key.origin[0] = 1;
    f.key.budget_bytes = 1000;
    assert_int_equal(hg_radiance_cache_sync(f.cache, &f.key, &f.field), HG_E_LIMIT);
    assert_int_equal(hg_radiance_cache_find(f.cache, &q, &place, got), HG_CACHE_NOTHING);
    tear_down(&f);
}

// --- filters -------------------------------------------------------------------------------------

enum { SIDE = 32 };

// The plane z = 0 from 3 m above; its right half is turned by 60 degrees.
static void make_texels(struct hg_reflect_texel *texels, bool edge)
{
    for (int i = 0; i < SIDE * SIDE; i++) {
        const float x = 0.01f * (float)(i % SIDE - SIDE / 2), y = 0.01f * (float)(i / SIDE);
        texels[i] = (struct hg_reflect_texel){.position = {x, y, 0},
            .normal = {0, 0, 1},
            .view = {0, 0, 1},
            .roughness = 0.5f,
            .f0 = 1,
            .depth = 3,
            .length = 2,
            .mirrors = true};
        if (edge && x >= 0) {
            texels[i].normal[0] = 0.866f;
            texels[i].normal[2] = 0.5f;
        }
    }
}

static void test_spatial(void **state)
{
    (void)state;
    static struct hg_reflect_texel texels[SIDE * SIDE];
    static hg_reflect_sums planes[2][SIDE * SIDE];
    hg_reflect_sums *sums = planes[0], *spare = planes[1];
    struct hg_jobs *jobs = hg_jobs_create(1);
    static uint32_t counts[SIDE];
    const struct hg_reflect_image image = {SIDE, SIDE, texels, counts, jobs};
    for (int y = 0; y < SIDE; y++)
        counts[y] = SIDE;
    for (int edge = 0; edge < 2; edge++) {
        double before = 0, after = 0;
        make_texels(texels, edge == 1);
        for (int i = 0; i < SIDE * SIDE; i++) {
            const float noise = chance(), right = i % SIDE >= SIDE / 2 ? 10.0f : 0.0f;
            sums[i] = (hg_reflect_sums){edge ? right : noise, 1, 0, 0, 1};
            before += ((double)noise - 0.5) * ((double)noise - 0.5);
        }
        hg_reflect_filter_spatial(&image, &sums, &spare);
        for (int i = 0; i < SIDE * SIDE; i++) {
            assert_true(fabsf(sums[i][1] - 1) < 1e-5f); // what is the same everywhere stays
            after += pow((double)sums[i][0] - 0.5, 2);
            if (edge)
                assert_true(fabsf(sums[i][0] - (i % SIDE >= SIDE / 2 ? 10.0f : 0.0f)) < 0.01f);
        }
        if (!edge) {
            print_message(
                "variance %.4f, filtered %.4f\n", before / (SIDE * SIDE), after / (SIDE * SIDE));
            assert_true(after < 0.1 * before);
        }
    }
    hg_jobs_destroy(jobs);
}

// Of many rays one that is far brighter, and one that alone sees the environment.
static void test_single_rays(void **state)
{
    (void)state;
    static struct hg_reflect_texel texels[SIDE * SIDE];
    static hg_reflect_sums planes[2][SIDE * SIDE];
    struct hg_jobs *jobs = hg_jobs_create(1);
    static uint32_t counts[SIDE];
    const struct hg_reflect_image image = {SIDE, SIDE, texels, counts, jobs};
    for (int y = 0; y < SIDE; y++)
        counts[y] = SIDE;
    const int middle = SIDE / 2 * SIDE + SIDE / 2;
    for (int half = 0; half < 2; half++) { // of the rays see it
        hg_reflect_sums *sums = planes[0], *spare = planes[1];
        double light = 0, open = 0;
        make_texels(texels, false);
        for (int i = 0; i < SIDE * SIDE; i++)
            sums[i] = (hg_reflect_sums){1, 1, 1, half && (i & 1), 1};
        sums[middle] = (hg_reflect_sums){1000, 1000, 1000, 1, 1};
        hg_reflect_filter_spatial(&image, &sums, &spare);
        for (int i = 0; i < SIDE * SIDE; i++) {
            light = fmax(light, (double)sums[i][HG_REFLECT_RED]);
            open += (double)sums[i][HG_REFLECT_OPEN] / (SIDE * SIDE);
        }
        print_message("brightest %.3f, open in the mean %.4f\n", light, open);
        assert_true(light < 1.5);
        assert_true(half ? fabs(open - 0.5) < 0.02 : open < 0.2 / (SIDE * SIDE));
    }
    hg_jobs_destroy(jobs);
}

// Behind a plane mirror the image is as far as the thing in front; of a ball it is the thin lens'.
static void test_image(void **state)
{
    (void)state;
    struct hg_reflect_texel t = {
        .position = {1, 2, 0}, .normal = {0, 0, 1}, .depth = 5, .length = 4};
    float got[3];
    view_at(35, t.view);
    hg_reflect_image_position(&t, 0, got);
    const float want[3] = {1 - 4 * t.view[0], 2, -4 * t.view[2]};
    for (int c = 0; c < 3; c++)
        assert_true(fabsf(got[c] - want[c]) < 1e-5f);
    view_at(0, t.view);
    hg_reflect_image_position(&t, 2, got); // a ball of half a metre
    assert_true(fabsf(got[2] + 1 / (1.0f / 4 + 2 * 2)) < 1e-5f);
    hg_reflect_image_position(&t, -0.125f, got); // its focus: the image is nowhere, but bounded
    assert_true(isfinite(got[2]));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_weights),
        cmocka_unit_test(test_same_texel),
        cmocka_unit_test(test_cache),
        cmocka_unit_test(test_cache_light),
        cmocka_unit_test(test_spatial),
        cmocka_unit_test(test_single_rays),
        cmocka_unit_test(test_image),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
