// The quality controller against frames whose time follows from their error.
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include <math.h>

#include "renderer/frame/quality.h"

// A fixed part, and triangles that fall with the square of the error.
static float frame_ms(float fixed_ms, float geometry_ms, float error_px)
{
    return fixed_ms + geometry_ms / (error_px * error_px);
}

static float run(struct hg_quality *q, int frames, float fixed, float geometry, float target)
{
    float ms = 0;
    for (int i = 0; i < frames; i++) {
        ms = frame_ms(fixed, geometry, hg_quality_error_px(q, 1, target));
        hg_quality_note(q, ms, target);
    }
    return ms;
}

static void test_off(void **state)
{
    (void)state;
    struct hg_quality q = {0};
    assert_true(hg_quality_error_px(&q, 0.5f, 0) == 0.5f);
    run(&q, 50, 10, 1000, 0);
    assert_true(hg_quality_error_px(&q, 0.5f, 0) == 0.5f);
    assert_true(q.factor == 1);
}

static void test_holds_the_time(void **state)
{
    (void)state;
    for (float geometry = 10; geometry < 4000; geometry *= 2) {
        struct hg_quality q = {0};
        const float ms = run(&q, 60, 20, geometry, 50);
        const float alone = frame_ms(20, geometry, 1);
        if (alone <= 50)
            assert_true(hg_quality_error_px(&q, 1, 50) == 1);
        else
            assert_true(ms <= 51 && ms >= 0.75f * 50);
    }
}

static void test_comes_back(void **state)
{
    (void)state;
    struct hg_quality q = {0};
    run(&q, 60, 20, 4000, 50);
    assert_true(q.factor > 5);
    run(&q, 60, 20, 10, 50); // the scene became light
    assert_true(hg_quality_error_px(&q, 1, 50) == 1);
    run(&q, 500, 100, 10, 50); // the fixed part alone is too much: as coarse as may be
    assert_true(hg_quality_error_px(&q, 1, 50) == HG_QUALITY_MOST);
}

static void test_one_slow_frame(void **state)
{
    (void)state;
    struct hg_quality q = {0};
    hg_quality_note(&q, 5000, 50);
    assert_true(q.factor == 2);
    run(&q, 10, 10, 10, 50);
    assert_true(hg_quality_error_px(&q, 1, 50) == 1);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_off),
        cmocka_unit_test(test_holds_the_time),
        cmocka_unit_test(test_comes_back),
        cmocka_unit_test(test_one_slow_frame),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
