// The quality that a bit rate leaves: of a model encoder, whose frames double every 20 steps.
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "server/worker/encode/rate_control.h"

enum { MS = 1000000 };

static double frame_bytes(double complexity, uint8_t quality)
{
    return complexity * exp2(quality / 20.0);
}

// Bytes per second of the last half of `seconds` at 30 frames per second.
static double run(struct rate_control *rc, uint64_t *now_ns, double complexity, uint32_t bitrate,
    int seconds, uint8_t *quality)
{
    double bytes = 0;
    for (int i = 0; i < 30 * seconds; i++) {
        *now_ns += 33 * MS;
        *quality = hg_rate_control_next(rc, 80, bitrate, *now_ns);
        const double size = frame_bytes(complexity, *quality);
        hg_rate_control_spent(rc, (uint64_t)size, true);
        bytes += i >= 15 * seconds ? size : 0;
    }
    return bytes / (seconds * 0.495);
}

static void test_without_rate_quality_is_kept(void **state)
{
    (void)state;
    struct rate_control rc = {0};
    uint64_t now_ns = 1;
    uint8_t quality;
    run(&rc, &now_ns, 1e5, 0, 2, &quality);
    assert_int_equal(quality, 80);
}

static void test_keeps_to_the_rate(void **state)
{
    (void)state;
    static const double complexities[] = {1500, 4000, 12000};
    for (int i = 0; i < 3; i++) {
        struct rate_control rc = {0};
        uint64_t now_ns = 1;
        uint8_t quality;
        const double rate = 8 * run(&rc, &now_ns, complexities[i], 4000000, 6, &quality);
        assert_true(quality < 80);
        assert_true(rate < 4000000 * 1.1);
        if (quality > 1)
            assert_true(rate > 4000000 * 0.75);
    }
}

// 20 -> 1 -> 20 Mbit/s: down at once, and up again within two seconds.
static void test_follows_the_rate(void **state)
{
    (void)state;
    struct rate_control rc = {0};
    uint64_t now_ns = 1;
    uint8_t high, low, again;
    run(&rc, &now_ns, 1000, 20000000, 3, &high);
    const double slow = 8 * run(&rc, &now_ns, 1000, 1000000, 4, &low);
    assert_true(low < high && slow < 1100000);
    run(&rc, &now_ns, 1000, 20000000, 2, &again);
    assert_true(again + 3 >= high);
}

// A key frame costs, but frames after it are not taken for its like.
static void test_key_frames_do_not_count_as_usual(void **state)
{
    (void)state;
    struct rate_control rc = {0};
    uint64_t now_ns = 1;
    uint8_t before;
    run(&rc, &now_ns, 1000, 3000000, 3, &before);
    now_ns += 33 * MS;
    hg_rate_control_next(&rc, 80, 3000000, now_ns);
    hg_rate_control_spent(&rc, 100000, false);
    now_ns += 33 * MS;
    const uint8_t after = hg_rate_control_next(&rc, 80, 3000000, now_ns);
    assert_true(after < before && after + 25 > before);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_without_rate_quality_is_kept),
        cmocka_unit_test(test_keeps_to_the_rate),
        cmocka_unit_test(test_follows_the_rate),
        cmocka_unit_test(test_key_frames_do_not_count_as_usual),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
