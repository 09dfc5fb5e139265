// The quality governor against frames whose time follows from what it chose.
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include <math.h>
#include <string.h>

#include "renderer/frame/quality/quality.h"

#define TARGET 50.0f

// What frames cost at full quality; triangles fall with `power` of the error, and the time of all
// parts is off by up to `noise`.
struct world {
    float rest, pixels, shading, rays, triangles, power, noise;
    bool scales, checkerboards, flat; // flat: geometry without levels of detail
    uint32_t random;
    uint32_t changes; // of the choice, in the newest run
};

static float noise_of(struct world *w)
{
    w->random = w->random * 1664525u + 1013904223u;
    return 1.0f + w->noise * ((float)(w->random >> 8) / (float)(1u << 23) - 1.0f);
}

// The last frame's time.
static float run(struct hg_quality *q, struct world *w, int frames)
{
    float ms = 0;
    w->changes = 0;
    for (int i = 0; i < frames; i++) {
        const struct hg_quality_choice c = hg_quality_choose(q, TARGET);
        const float factor = noise_of(w);
        const float part[HG_QUALITY_PARTS] = {[HG_QUALITY_REST] = w->rest * factor,
            [HG_QUALITY_PIXELS] = w->pixels * c.scale * c.scale * factor,
            [HG_QUALITY_SHADING] =
                w->shading * c.scale * c.scale * (c.checkerboard ? 0.55f : 1.0f) * factor,
            [HG_QUALITY_RAYS] = w->rays * c.rays * factor,
            [HG_QUALITY_TRIANGLES] =
                w->triangles * (w->flat ? 1.0f : powf(c.factor, -w->power)) * factor};
        ms = 0;
        for (int p = 0; p < HG_QUALITY_PARTS; p++)
            ms += part[p];
        assert_true(c.scale >= 0.5f && c.scale <= 1.0f && c.rays >= 0.25f && c.rays <= 1.0f);
        assert_true(c.factor >= 1.0f && c.factor <= HG_QUALITY_MOST);
        assert_true(w->scales || c.scale == 1.0f);
        assert_true(!c.checkerboard || (w->checkerboards && c.scale == 1.0f));
        assert_true(!w->flat || c.factor == 1.0f);
        const struct hg_quality_levers levers = {w->scales, w->checkerboards, !w->flat};
        hg_quality_note(q, part, TARGET, &levers);
        const struct hg_quality_choice next = hg_quality_choose(q, TARGET);
        w->changes += memcmp(&next, &c, sizeof c) != 0;
    }
    return ms;
}

static void assert_full(const struct hg_quality *q)
{
    const struct hg_quality_choice c = hg_quality_choose(q, TARGET);
    assert_true(c.scale == 1.0f && c.rays == 1.0f && c.factor == 1.0f);
}

static void test_off(void **state)
{
    (void)state;
    struct hg_quality q = {0};
    const float slow[HG_QUALITY_PARTS] = {10, 1000, 0, 10, 1000};
    const struct hg_quality_levers levers = {true, true, true};
    assert_full(&q);
    for (int i = 0; i < 50; i++)
        hg_quality_note(&q, slow, 0, &levers);
    const struct hg_quality_choice c = hg_quality_choose(&q, 0);
    assert_true(c.scale == 1.0f && c.rays == 1.0f && c.factor == 1.0f);
    assert_full(&q);
}

// Whatever the time goes into, the target is held where it can be, and not by more than needed.
static void test_holds_the_time(void **state)
{
    (void)state;
    for (float geometry = 10; geometry < 2000; geometry *= 2)
        for (float pixels = 10; pixels < 100; pixels *= 2)
            for (float power = 1; power <= 2; power += 0.5f) {
                struct hg_quality q = {0};
                struct world w = {.rest = 10,
                    .pixels = pixels,
                    .rays = 4,
                    .triangles = geometry,
                    .power = power,
                    .scales = true};
                const float ms = run(&q, &w, 600);
                const float least = 11 + pixels / 4 + geometry * powf(HG_QUALITY_MOST, -power);
                if (least > TARGET) {
                    assert_true(ms <= least + 1);
                    continue;
                }
                assert_true(ms <= TARGET);
                if (geometry + pixels + 14 <= TARGET)
                    assert_full(&q);
                else
                    assert_true(ms >= 0.6f * TARGET);
            }
}

// Each part of the time is answered where it is.
static void test_looks_where_the_time_goes(void **state)
{
    (void)state;
    struct hg_quality q = {0};
    struct world w = {.rest = 10, .pixels = 80, .triangles = 5, .power = 1.5f, .scales = true};
    run(&q, &w, 60);
    assert_true(q.now.scale < 0.8f && q.now.factor < 3.0f);
    q = (struct hg_quality){0};
    w = (struct world){.rest = 10, .pixels = 5, .triangles = 200, .power = 1.5f, .scales = true};
    run(&q, &w, 60);
    assert_true(q.now.scale == 1.0f && q.now.factor > 2.0f);
    q = (struct hg_quality){0};
    w = (struct world){.rest = 10, .pixels = 25, .rays = 20, .power = 1.5f, .scales = true};
    run(&q, &w, 60);
    assert_true(q.now.scale == 1.0f && q.now.rays < 1.0f && q.now.factor == 1.0f);
    // Without history there is but the error.
    q = (struct hg_quality){0};
    w = (struct world){.rest = 10, .pixels = 20, .triangles = 200, .power = 1.5f};
    run(&q, &w, 60);
    assert_true(q.now.factor > 2.0f);
}

// Every second pixel shaded is the better picture for the time where that is nearly all of it, and
// not elsewhere.
static void test_checkerboard(void **state)
{
    (void)state;
    struct hg_quality q = {0};
    struct world w = {.rest = 5, .pixels = 4, .shading = 60, .scales = true, .checkerboards = true};
    run(&q, &w, 60);
    assert_true(q.now.checkerboard && q.now.scale == 1.0f);
    w.shading = 100; // too much for half of it
    run(&q, &w, 60);
    assert_true(!q.now.checkerboard && q.now.scale < 0.77f);
    q = (struct hg_quality){0};
    w = (struct world){
        .rest = 5, .pixels = 40, .shading = 30, .scales = true, .checkerboards = true};
    run(&q, &w, 60);
    assert_true(!q.now.checkerboard && q.now.scale < 1.0f);
    const float part[HG_QUALITY_PARTS] = {5, 40, 30, 0, 0};
    const struct hg_quality_levers none = {.error = true};
    hg_quality_note(&q, part, TARGET, &none); // a scale was set, say
    assert_true(!q.now.checkerboard && q.now.scale == 1.0f);
}

// Without levels of detail an error changes nothing, however much triangles cost.
static void test_flat_geometry(void **state)
{
    (void)state;
    struct hg_quality q = {0};
    struct world w = {.rest = 5, .pixels = 40, .triangles = 200, .flat = true, .scales = true};
    run(&q, &w, 200);
    assert_true(q.now.scale == 0.5f && q.now.factor == 1.0f);
    w.triangles = 20;
    run(&q, &w, 600);
    assert_true(q.now.scale > 0.5f && q.now.factor == 1.0f);
}

static void test_comes_back(void **state)
{
    (void)state;
    struct hg_quality q = {0};
    struct world w = {
        .rest = 10, .pixels = 60, .rays = 4, .triangles = 400, .power = 1.5f, .scales = true};
    run(&q, &w, 60);
    assert_true(q.now.factor > 2.0f);
    w.pixels = w.triangles = 10; // the scene became light
    run(&q, &w, 60);
    assert_full(&q);
    w.rest = 100; // more than the target: as fast as it can be
    w.pixels = w.triangles = 50;
    run(&q, &w, 200);
    assert_true(q.now.scale == 0.5f && q.now.factor > 8.0f);
}

// Times that are off by 10 % and follow another power than the model has do not make it swing.
static void test_is_stable(void **state)
{
    (void)state;
    for (float pixels = 20; pixels < 150; pixels *= 1.3f)
        for (float power = 1; power <= 2; power += 0.5f) {
            struct hg_quality q = {0};
            struct world w = {.rest = 8,
                .pixels = pixels,
                .rays = 4,
                .triangles = 60,
                .power = power,
                .noise = 0.1f,
                .scales = true,
                .random = 7};
            run(&q, &w, 300);
            run(&q, &w, 600);
            assert_true(w.changes <= 12);
        }
}

static void test_one_slow_frame(void **state)
{
    (void)state;
    struct hg_quality q = {0};
    struct world w = {.rest = 10, .pixels = 15, .triangles = 10, .power = 1.5f, .scales = true};
    const float slow[HG_QUALITY_PARTS] = {5000, 15, 0, 0, 10};
    const struct hg_quality_levers levers = {true, true, true};
    run(&q, &w, 10);
    hg_quality_note(&q, slow, TARGET, &levers);
    assert_full(&q);
    run(&q, &w, 10);
    assert_full(&q);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_off),
        cmocka_unit_test(test_holds_the_time),
        cmocka_unit_test(test_looks_where_the_time_goes),
        cmocka_unit_test(test_checkerboard),
        cmocka_unit_test(test_flat_geometry),
        cmocka_unit_test(test_comes_back),
        cmocka_unit_test(test_is_stable),
        cmocka_unit_test(test_one_slow_frame),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
