// worker_turns.c - whose turn it is in a worker: shares of time for tenants by weight, then equal
// ones for their sessions, whatever their views and messages take. Needs a device; lavapipe will
// do.
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include "server/worker/turn.h"
#include "tests/system/worker_link_rig.h"

enum { SIDE = 64, SAMPLES = 256, VIEWS = 8, HONEST = 1, MANY = 2 };

// ---- shares -------------------------------------------------------------------------------------

// Steps of one take eighty times as long as those of the other.
static void test_shares_are_of_time(void **state)
{
    (void)state;
    enum { LONG = 400, SHORT = 5 };
    struct turn_clock clock = {0};
    struct turn slow = {0}, quick = {0};
    uint64_t slow_time = 0, quick_time = 0;
    for (int i = 0; i < 10000; i++)
        if (hg_turn_start(&clock, &slow) < hg_turn_start(&clock, &quick)) {
            hg_turn_serve(&clock, &slow, LONG);
            slow_time += LONG;
        } else {
            hg_turn_serve(&clock, &quick, SHORT);
            quick_time += SHORT;
        }
    assert_true(slow_time <= quick_time + LONG && quick_time <= slow_time + LONG);
}

// One of three times the weight has three quarters of the time.
static void test_shares_are_by_weight(void **state)
{
    (void)state;
    enum { STEP = 30, HEAVY = 3 * HG_TURN_WEIGHT };
    struct turn_clock clock = {0};
    struct turn light = {0}, heavy = {0};
    uint64_t light_time = 0, heavy_time = 0;
    for (int i = 0; i < 10000; i++)
        if (hg_turn_start(&clock, &light) < hg_turn_start(&clock, &heavy)) {
            hg_turn_serve(&clock, &light, hg_turn_cost(STEP, HG_TURN_WEIGHT));
            light_time += STEP;
        } else {
            hg_turn_serve(&clock, &heavy, hg_turn_cost(STEP, HEAVY));
            heavy_time += STEP;
        }
    assert_in_range(heavy_time, 3 * light_time - 3 * STEP, 3 * light_time + 3 * STEP);
}

// Who was away is next, and has not saved anything up.
static void test_a_rest_is_not_saved_up(void **state)
{
    (void)state;
    struct turn_clock clock = {0};
    struct turn busy = {0}, rested = {0};
    uint64_t steps = 0;
    hg_turn_serve(&clock, &rested, 10);
    for (int i = 0; i < 1000; i++)
        hg_turn_serve(&clock, &busy, 10);
    while (hg_turn_start(&clock, &rested) < hg_turn_start(&clock, &busy)) {
        hg_turn_serve(&clock, &rested, 1);
        steps++;
    }
    assert_in_range(steps, 10, 11);
}

// ---- a worker -----------------------------------------------------------------------------------

static void make_view(struct rig *rig, uint32_t channel, uint32_t view, uint32_t samples)
{
    link_expect(rig,
        link_ask(rig, channel, HGP_T_view_set,
            &(struct hgp_view_set){.view = view,
                .has_width = true,
                .width = SIDE,
                .has_height = true,
                .height = SIDE,
                .has_samples = true,
                .samples = samples,
                .has_gi = true,
                .gi = HGP_gi_NONE,
                .has_exposure_mode = true,
                .exposure_mode = HGP_exposure_mode_FIXED}),
        HGP_T_ok);
    link_expect(rig,
        link_ask(rig, channel, HGP_T_view_camera,
            &(struct hgp_view_camera){
                .view = view, .has_eye = true, .eye = {0, 0, 4}, .has_target = true}),
        HGP_T_ok);
}

static uint32_t ask_frame(struct rig *rig, uint32_t channel, uint32_t view, bool settled)
{
    return link_ask(rig, channel, HGP_T_frame_request,
        &(struct hgp_frame_request){.view = view, .settled = settled});
}

static void see_frame(struct rig *rig, uint32_t channel, uint32_t view)
{
    link_expect(rig, ask_frame(rig, channel, view, false), HGP_T_frame);
}

static void detach(struct rig *rig, uint32_t channel)
{
    link_ask(rig, channel, HGP_T_session_detach, &(struct hgp_session_detach){0});
}

static void attach(
    struct rig *rig, uint32_t channel, const char *scene, const char *tenant, uint32_t weight)
{
    link_attach(rig, channel, scene);
    link_ask(rig, channel, HGP_T_session_tenant,
        &(struct hgp_session_tenant){.tenant = hgp_str_make(tenant), .weight = weight});
}

// How many of the others are done before the honest one, whose picture takes twice as many samples
// as each of theirs.
static uint32_t done_before(struct rig *rig, uint32_t honest, const uint32_t (*others)[2])
{
    uint32_t done = 0;
    for (int i = 0; i < VIEWS; i++) {
        make_view(rig, others[i][0], others[i][1], SAMPLES / 2);
        see_frame(rig, others[i][0], others[i][1]);
    }
    make_view(rig, honest, 1, SAMPLES);
    see_frame(rig, honest, 1);
    see_frame(rig, honest, 1); // what the first one took is paid for
    for (int i = 0; i < VIEWS; i++)
        see_frame(rig, others[i][0], others[i][1]); // likewise
    for (int i = 0; i < VIEWS; i++)
        ask_frame(rig, others[i][0], others[i][1], true);
    const uint32_t wanted = ask_frame(rig, honest, 1, true);
    do {
        link_read(rig);
        done += rig->header.type == HGP_T_frame;
    } while (rig->header.type != HGP_T_frame || rig->header.request != wanted);
    assert_int_equal(rig->message.frame.samples, SAMPLES);
    print_message("%u of %d before it\n", done - 1, VIEWS);
    return done - 1;
}

// Half of the time is the honest one's: hardly any of the others is done. By view all would be.
static void expect_half(struct rig *rig, uint32_t honest, const uint32_t (*others)[2])
{
    assert_true(done_before(rig, honest, others) <= VIEWS / 2);
}

static void test_views_share_what_their_session_has(void **state)
{
    struct rig *rig = *state;
    uint32_t others[VIEWS][2];
    link_attach(rig, MANY, "a");
    link_attach(rig, HONEST, "b");
    for (uint32_t i = 0; i < VIEWS; i++) {
        others[i][0] = MANY;
        others[i][1] = i + 1;
    }
    expect_half(rig, HONEST, others);
    detach(rig, MANY);
    detach(rig, HONEST);
}

static void attach_all(struct rig *rig, uint32_t weight, uint32_t (*others)[2])
{
    attach(rig, HONEST, "b", "honest", weight);
    for (uint32_t i = 0; i < VIEWS; i++) {
        attach(rig, MANY + i, "a", "many", HG_TURN_WEIGHT);
        others[i][0] = MANY + i;
        others[i][1] = 1;
    }
}

static void detach_all(struct rig *rig)
{
    for (uint32_t i = 0; i < VIEWS; i++)
        detach(rig, MANY + i);
    detach(rig, HONEST);
}

static void test_sessions_share_what_their_tenant_has(void **state)
{
    struct rig *rig = *state;
    uint32_t others[VIEWS][2];
    attach_all(rig, HG_TURN_WEIGHT, others);
    expect_half(rig, HONEST, others);
    detach_all(rig);
}

// With a twentieth of the others' weight it has to wait for nearly all of them.
static void test_tenants_share_by_weight(void **state)
{
    struct rig *rig = *state;
    uint32_t others[VIEWS][2];
    attach_all(rig, HG_TURN_WEIGHT / 20, others);
    assert_true(done_before(rig, HONEST, others) > VIEWS / 2);
    detach_all(rig);
}

// A session that asks for a thousand things does not hold up one that asks for one.
static void test_messages_take_turns(void **state)
{
    enum { PICKS = 1000 };
    struct rig *rig = *state;
    uint32_t picked = 0;
    link_attach(rig, MANY, "a");
    link_attach(rig, HONEST, "b");
    make_view(rig, MANY, 1, 1);
    make_view(rig, HONEST, 1, 1);
    see_frame(rig, MANY, 1);
    see_frame(rig, HONEST, 1);
    see_frame(rig, HONEST, 1); // what the first one took is paid for
    struct hg_writer w = {0};  // all at once: the worker is not to be quicker than this program
    const uint32_t wanted = rig->next_request += PICKS + 1;
    for (uint32_t i = PICKS; i > 0; i--)
        assert_int_equal(
            hgp_encode(&w, HGP_VERSION_MAX, (struct hgp_envelope){HGP_T_pick, wanted - i, MANY},
                &(struct hgp_pick){.view = 1, .x = SIDE / 2, .y = SIDE / 2}, NULL),
            HG_OK);
    assert_int_equal(
        hgp_encode(&w, HGP_VERSION_MAX, (struct hgp_envelope){HGP_T_frame_request, wanted, HONEST},
            &(struct hgp_frame_request){.view = 1, .settled = true}, NULL),
        HG_OK);
    link_write(rig->fd, w.data, w.size);
    hg_writer_finish(&w);
    do {
        link_read(rig);
        picked += rig->header.type == HGP_T_picked;
    } while (rig->header.type != HGP_T_frame || rig->header.request != wanted);
    print_message("%u of %d before it\n", picked, PICKS);
    assert_true(picked < PICKS / 2);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_shares_are_of_time),
        cmocka_unit_test(test_shares_are_by_weight),
        cmocka_unit_test(test_a_rest_is_not_saved_up),
        cmocka_unit_test(test_views_share_what_their_session_has),
        cmocka_unit_test(test_sessions_share_what_their_tenant_has),
        cmocka_unit_test(test_tenants_share_by_weight),
        cmocka_unit_test(test_messages_take_turns),
    };
    return cmocka_run_group_tests(tests, link_start, link_stop);
}
