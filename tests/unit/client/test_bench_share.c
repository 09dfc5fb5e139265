// Shares of viewers: the ratio of least to most, its error, and what chance alone makes of equal
// shares. The scatter is of a fixed generator.
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include <math.h>

#include "client/cli/bench/bench_share.h"

enum { VIEWERS = 8, MOST = 4000 };
#define WINDOW_NS 1000000000000u
#define BEGIN_NS  77u

static uint64_t times[VIEWERS][MOST];
static struct hg_bench_times viewers[VIEWERS];

static double uniform(uint32_t *seed)
{
    *seed = *seed * 1664525u + 1013904223u;
    return (*seed >> 8) / 16777216.0;
}

// Frames of a viewer that take 1 / rate of the window on average, times 1 - scatter to 1 + scatter.
// load: all frames of the second half take as much longer.
static void make(uint32_t i, double rate, double scatter, double load, uint32_t *seed)
{
    double at = uniform(seed) / rate;
    uint32_t count = 0;
    while (at < 1 && count < MOST) {
        times[i][count++] = BEGIN_NS + (uint64_t)(at * WINDOW_NS);
        at += (1 + scatter * (2 * uniform(seed) - 1)) * (at > 0.5 ? load : 1) / rate;
    }
    viewers[i] = (struct hg_bench_times){times[i], count};
}

static struct hg_bench_shares shares_of(uint32_t count)
{
    struct hg_bench_shares shares;
    hg_bench_shares(viewers, count, BEGIN_NS, BEGIN_NS + WINDOW_NS, &shares);
    return shares;
}

static void test_regular_frames(void **state)
{
    (void)state;
    uint32_t seed = 1;
    make(0, 100, 0, 1, &seed);
    struct hg_bench_shares s = shares_of(1);
    assert_true(s.fairness >= 1 && s.error <= 0 && s.equal >= 1);
    make(1, 50, 0, 1, &seed);
    s = shares_of(2);
    assert_true(fabs(s.fairness - 0.5) < 0.02);
    assert_true(s.error < 0.01); // but for the edges of the window
}

static void test_none(void **state)
{
    (void)state;
    viewers[0] = viewers[1] = (struct hg_bench_times){0};
    struct hg_bench_shares s = shares_of(2);
    assert_true(s.fairness <= 0 && s.error >= 1);
    uint32_t seed = 1;
    make(0, 100, 0, 1, &seed);
    s = shares_of(2);
    assert_true(s.fairness <= 0 && s.error > 0);
}

// Over many windows the error that is said is about the one that is seen, and so is what equal
// shares show.
static void check_errors(double rate, double scatter, double load)
{
    enum { WINDOWS = 400 };
    double sum = 0, squares = 0, said = 0, least = 0, equal = 0;
    uint32_t seed = 7;
    for (int w = 0; w < WINDOWS; w++) {
        for (uint32_t i = 0; i < VIEWERS; i++)
            make(i, i == 1 ? rate / 2 : rate, scatter, load, &seed);
        const struct hg_bench_shares two = shares_of(2); // one of half the rate
        sum += two.fairness / WINDOWS;
        squares += two.fairness * two.fairness / WINDOWS;
        said += two.error / WINDOWS;
        make(1, rate, scatter, load, &seed);
        const struct hg_bench_shares all = shares_of(VIEWERS);
        least += all.fairness / WINDOWS;
        equal += all.equal / WINDOWS;
    }
    const double seen = sqrt(squares - sum * sum);
    assert_true(fabs(sum - 0.5) < 0.02);
    assert_true(said > 0.7 * seen && said < 1.6 * seen);
    assert_true(1 - equal > 0.7 * (1 - least) && 1 - equal < 1.6 * (1 - least));
}

static void test_errors(void **state)
{
    (void)state;
    check_errors(40, 0.9, 1);
    check_errors(400, 0.9, 1);
}

// The load of the machine changes what all of them get: that says nothing of their shares.
static void test_common_load(void **state)
{
    (void)state;
    uint32_t seed = 3;
    for (uint32_t i = 0; i < VIEWERS; i++)
        make(i, 300, 0.3, 4, &seed);
    const struct hg_bench_shares s = shares_of(VIEWERS);
    assert_true(s.fairness > 0.9);
    assert_true(s.error < 0.05); // 0.2 were it of counts alone
    assert_true(s.equal > 0.9);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_regular_frames),
        cmocka_unit_test(test_none),
        cmocka_unit_test(test_errors),
        cmocka_unit_test(test_common_load),
    };
    return cmocka_run_group_tests_name("bench_share", tests, NULL, NULL);
}
