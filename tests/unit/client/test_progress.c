// What is left of a command, from how fast its samples and frames came.
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include "base/clock.h"
#include "client/cli/progress.h"

static const uint64_t second_ns = 1000000000;

// Time is what passes between calls; here it is taken off the beginnings.
static void pass(struct hg_cli_progress *p, uint64_t seconds)
{
    p->stage_ns -= seconds * second_ns;
    p->frame_begin_ns -= seconds * second_ns;
}

static void assert_left(const struct hg_cli_progress *p, double least, double most)
{
    const double left = hg_cli_progress_left(p, hg_clock_now_ns());
    if (left < least || left > most)
        fail_msg("%g s left, not %g to %g", left, least, most);
}

static void test_one(void **state)
{
    (void)state;
    struct hg_cli_progress p;
    hg_cli_progress_init(&p, "none");
    hg_cli_progress_stage(&p, "rendering");
    assert_left(&p, -1, -1);
    hg_cli_progress_update(&p, "samples", 0, 200);
    pass(&p, 35); // shaders are compiled
    assert_left(&p, -1, -1);
    hg_cli_progress_update(&p, "samples", 1, 200);
    assert_left(&p, -1, -1);
    pass(&p, 2);
    hg_cli_progress_update(&p, "samples", 11, 200);
    assert_left(&p, 37.8, 38);
    pass(&p, 20);
    hg_cli_progress_update(&p, "samples", 111, 200);
    assert_left(&p, 17.8, 18);
}

// A film that is taken up; a worker that was replaced begins again.
static void test_resumed(void **state)
{
    (void)state;
    struct hg_cli_progress p;
    hg_cli_progress_init(&p, "none");
    hg_cli_progress_update(&p, "samples", 100, 200);
    pass(&p, 35);
    hg_cli_progress_update(&p, "samples", 102, 200);
    pass(&p, 1);
    hg_cli_progress_update(&p, "samples", 104, 200);
    assert_left(&p, 48, 48.1);
    hg_cli_progress_update(&p, "samples", 0, 200);
    pass(&p, 9);
    hg_cli_progress_update(&p, "samples", 4, 200);
    pass(&p, 1);
    hg_cli_progress_update(&p, "samples", 8, 200);
    assert_left(&p, 48, 48.1);
}

static void test_frames(void **state)
{
    (void)state;
    struct hg_cli_progress p;
    hg_cli_progress_init(&p, "none");
    hg_cli_progress_frames(&p, 5);
    hg_cli_progress_frame(&p, 0); // was there
    hg_cli_progress_stage(&p, "rendering");
    assert_left(&p, -1, -1);
    hg_cli_progress_update(&p, "samples", 0, 20);
    pass(&p, 35);
    hg_cli_progress_update(&p, "samples", 10, 20);
    pass(&p, 5);
    hg_cli_progress_update(&p, "samples", 15, 20);
    assert_left(&p, 5 + 3 * 20, 66); // three frames of 20 samples after it
    hg_cli_progress_frame(&p, 45 * second_ns);
    hg_cli_progress_stage(&p, "rendering");
    assert_left(&p, 3 * 45 - 1, 3 * 45); // all that is known
    hg_cli_progress_update(&p, "samples", 0, 20);
    pass(&p, 1);
    hg_cli_progress_update(&p, "samples", 10, 20);
    pass(&p, 5);
    hg_cli_progress_update(&p, "samples", 15, 20);
    assert_left(&p, 5 + 2 * 11, 28); // as this one, not as the first
    hg_cli_progress_frame(&p, 12 * second_ns);
    hg_cli_progress_stage(&p, "rendering");
    assert_left(&p, 23.9, 24);
    hg_cli_progress_frame(&p, 14 * second_ns);
    pass(&p, 3);
    assert_left(&p, 9.9, 10);
    pass(&p, 30);
    assert_left(&p, 0, 0);
}

static void notice(struct hg_cli_progress *p, enum hg_status code, const char *what)
{
    const struct hgp_notice n = {
        .code = (uint16_t)code, .what = hgp_str_make(what), .reason = hgp_str_make("why")};
    hg_cli_on_notice(p, &n);
}

// With --strict warnings end a command: a worker that was replaced says nothing about the scene.
static void test_notices(void **state)
{
    (void)state;
    struct hg_cli_progress p;
    hg_cli_progress_init(&p, "none");
    notice(&p, HG_E_WORKER, "worker");
    assert_int_equal(p.replaced, 1);
    assert_int_equal(p.warnings, 0);
    notice(&p, HG_E_WORKER, "view_camera"); // it died twice over this, which was given up
    notice(&p, HG_E_FORMAT, "worker");
    assert_int_equal(p.replaced, 1);
    assert_int_equal(p.warnings, 2);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_one),
        cmocka_unit_test(test_resumed),
        cmocka_unit_test(test_frames),
        cmocka_unit_test(test_notices),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
