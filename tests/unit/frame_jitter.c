// frame_jitter.c - where the samples of a pixel lie: centred, spread like the filter, reproducible.
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <math.h>
#include <cmocka.h>

#include "renderer/camera/camera.h"

static void few_samples_do_not_shift_the_picture(void **state)
{
    (void)state;
    for (uint32_t seed = 0; seed < 5; seed++) {
        double sum[2] = {0, 0};
        for (uint32_t i = 0; i < 65; i++) {
            float px[2];
            hg_camera_jitter(i, seed, px);
            for (int c = 0; c < 2; c++) {
                assert_true(fabsf(px[c]) <= 1.5f);
                sum[c] += (double)px[c];
                double largest = i % 2 ? 1.5 / (i + 1) : 1e-6; // odd index: even count
                assert_true(fabs(sum[c] / (i + 1)) <= largest);
            }
        }
    }
}

// Variance of the Blackman-Harris window of radius 1.5, integrated here.
static double window_variance(void)
{
    double mass = 0, second = 0;
    for (int i = 0; i < 20000; i++) {
        double x = (i + 0.5) / 10000 - 1, a = 3.14159265358979 * (x + 1);
        double w = 0.35875 - 0.48829 * cos(a) + 0.14128 * cos(2 * a) - 0.01168 * cos(3 * a);
        mass += w;
        second += w * x * x * 1.5 * 1.5;
    }
    return second / mass;
}

static void samples_are_spread_like_the_filter(void **state)
{
    (void)state;
    double second[2] = {0, 0};
    enum { count = 4096 };
    for (uint32_t i = 0; i < count; i++) {
        float px[2];
        hg_camera_jitter(i, 3, px);
        for (int c = 0; c < 2; c++)
            second[c] += (double)px[c] * (double)px[c] / count;
    }
    for (int c = 0; c < 2; c++)
        assert_true(fabs(second[c] / window_variance() - 1) < 0.01);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(few_samples_do_not_shift_the_picture),
        cmocka_unit_test(samples_are_spread_like_the_filter),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
