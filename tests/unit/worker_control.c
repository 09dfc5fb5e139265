// worker_control.c - the controller of a subscribed view against a link that is simulated to the
// nanosecond: rate, round trip, stalls.
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include <math.h>

#include "server/worker/view/view_control.h"

#define MS        1000000u
#define SECOND_NS 1000000000u
enum { RENDER_MS = 8, ENCODE_MS = 4, CLIENT_CLOCK = 77777777, MOST = 256 };

// A bottleneck with a queue without end, and what is in it.
struct link {
    double rate; // bytes a second
    uint64_t one_way_ns, free_ns, stalled_until_ns;
    bool names; // the client names frames
    struct {
        uint64_t number, begin_ns, begun_ns, arrived_ns;
    } under_way[MOST];
    uint32_t count, most;
    uint64_t newest_age_ns; // of the frame that came last: from the begin of its rendering
};

struct view {
    struct hg_control control;
    struct hg_control_goal goal;
    struct link link;
    uint64_t now_ns, number, frames; // frames: delivered
    double bytes_at_80;
    uint8_t least, newest; // qualities
};

static struct view make_view(double rate, uint32_t rtt_ms)
{
    return (struct view){.control = {.informed = true},
        .goal = {.fps = 30, .quality = 80, .sharing = 1},
        .link = {.rate = rate, .one_way_ns = (uint64_t)rtt_ms * MS / 2, .names = true},
        .now_ns = SECOND_NS,
        .bytes_at_80 = 60000,
        .least = 255};
}

// Sizes fall with the quality, not quite as the controller's table has it.
static uint64_t size_of(const struct view *v, uint8_t quality)
{
    return (uint64_t)(v->bytes_at_80 * pow(quality / 80.0, 0.9));
}

static void deliver_until(struct view *v, uint64_t now_ns)
{
    struct link *l = &v->link;
    uint32_t done = 0;
    for (; done < l->count && l->under_way[done].arrived_ns + l->one_way_ns <= now_ns; done++) {
        struct hg_control_delivery d = {.number = l->under_way[done].number,
            .at_ns = l->under_way[done].arrived_ns + l->one_way_ns,
            .begun_ns = l->under_way[done].begun_ns + CLIENT_CLOCK,
            .received_ns = l->under_way[done].arrived_ns + CLIENT_CLOCK};
        if (l->names)
            hg_control_delivered(&v->control, &d);
        l->newest_age_ns = l->under_way[done].arrived_ns - l->under_way[done].begin_ns;
        v->frames++;
    }
    for (uint32_t i = done; i < l->count; i++)
        l->under_way[i - done] = l->under_way[i];
    l->count -= done;
}

static void send(struct view *v, uint64_t begin_ns)
{
    struct link *l = &v->link;
    const struct hg_control_choice choice = hg_control_choose(&v->control, &v->goal);
    const uint64_t sent_ns = begin_ns + (RENDER_MS + ENCODE_MS) * MS;
    const uint64_t bytes = size_of(v, choice.quality);
    uint64_t start_ns = sent_ns > l->free_ns ? sent_ns : l->free_ns;
    start_ns = start_ns > l->stalled_until_ns ? start_ns : l->stalled_until_ns;
    l->free_ns = start_ns + (uint64_t)((double)bytes / l->rate * 1e9);
    hg_control_queued(&v->control, ++v->number, begin_ns, MS);
    hg_control_sent(&v->control, &(struct hg_control_sent){.number = v->number,
                                     .bytes = bytes,
                                     .encode_ns = ENCODE_MS * MS,
                                     .sent_ns = sent_ns,
                                     .quality = choice.quality,
                                     .lossy = true});
    assert_true(l->count < MOST);
    l->under_way[l->count].number = v->number;
    l->under_way[l->count].begin_ns = begin_ns;
    l->under_way[l->count].begun_ns = start_ns + l->one_way_ns;
    l->under_way[l->count++].arrived_ns = l->free_ns + l->one_way_ns;
    l->most = l->count > l->most ? l->count : l->most;
    v->newest = choice.quality;
    v->least = choice.quality < v->least ? choice.quality : v->least;
}

// The camera moves all the while; rendering and encoding take turns.
static void run(struct view *v, uint64_t ns)
{
    const uint64_t end_ns = v->now_ns + ns;
    v->frames = 0;
    v->least = 255;
    v->link.most = 0;
    for (; v->now_ns < end_ns; v->now_ns += MS) {
        deliver_until(v, v->now_ns);
        if (hg_control_due_ns(&v->control, v->now_ns) > v->now_ns)
            continue;
        send(v, v->now_ns);
        v->now_ns += (RENDER_MS + ENCODE_MS) * MS;
    }
}

static void test_a_fast_link_gets_the_quality_that_was_asked_for(void **state)
{
    (void)state;
    struct view v = make_view(100e6, 1);
    run(&v, SECOND_NS);
    assert_int_equal(v.newest, 80);
    assert_true(v.frames > 60); // as fast as they are made
    assert_true(v.link.most <= 3);
}

static void test_quality_holds_the_frame_rate_of_a_narrow_link(void **state)
{
    (void)state;
    struct view v = make_view(1.0e6, 20); // 8 Mbit/s: 33 kB a frame
    run(&v, 3 * (uint64_t)SECOND_NS);
    v.frames = 0;
    run(&v, 2 * (uint64_t)SECOND_NS);
    assert_in_range(v.frames, 54, 90);
    assert_true(v.newest < 80 && v.newest >= 25);
    assert_true(v.link.newest_age_ns < 120 * MS);
}

static void test_a_narrower_link_than_any_quality_gets_fewer_frames_and_no_queue(void **state)
{
    (void)state;
    struct view v = make_view(125e3, 20); // 1 Mbit/s
    run(&v, 4 * (uint64_t)SECOND_NS);
    run(&v, 4 * (uint64_t)SECOND_NS);
    assert_int_equal(v.newest, HG_CONTROL_LEAST_QUALITY);
    const double bytes = (double)size_of(&v, v.newest);
    assert_true((double)v.frames > 0.75 * 4 * 125e3 / bytes); // the link is used
    assert_true(v.link.most <= 2);
    assert_true(v.link.newest_age_ns < (uint64_t)(2.5e9 * bytes / 125e3) + 40 * MS);
}

static void test_it_recovers_when_the_link_does(void **state)
{
    (void)state;
    struct view v = make_view(2.5e6, 20); // 20 Mbit/s
    run(&v, 3 * (uint64_t)SECOND_NS);
    const uint8_t before = v.newest;
    assert_true(before >= 70);
    v.link.rate = 125e3; // 1 Mbit/s
    run(&v, 2 * (uint64_t)SECOND_NS);
    run(&v, 3 * (uint64_t)SECOND_NS);
    assert_true(v.newest <= 25);
    assert_true(v.link.most <= 2); // what was sent has drained
    v.link.rate = 2.5e6;
    run(&v, 2 * (uint64_t)SECOND_NS);
    assert_true(v.newest >= before - 5);
    assert_true(v.frames >= 45);
}

static void test_a_long_round_trip_does_not_lower_the_frame_rate(void **state)
{
    (void)state;
    struct view v = make_view(2.5e6, 300);
    run(&v, 3 * (uint64_t)SECOND_NS);
    run(&v, 2 * (uint64_t)SECOND_NS);
    assert_true(v.frames >= 54);
    assert_true(v.newest >= 70);
    assert_true(v.link.newest_age_ns < 150 * MS + 80 * MS); // one way, and itself
}

static void test_a_stall_freezes_the_picture_and_leaves_no_queue(void **state)
{
    (void)state;
    struct view v = make_view(2.5e6, 40);
    run(&v, 2 * (uint64_t)SECOND_NS);
    const uint64_t number = v.number;
    v.link.stalled_until_ns = v.now_ns + 3 * (uint64_t)SECOND_NS;
    run(&v, 3 * (uint64_t)SECOND_NS);
    assert_true(v.number - number <= 8); // what was begun before it was overdue
    assert_true(v.control.held >= 1);
    assert_true(hg_control_due_ns(&v.control, v.now_ns) == UINT64_MAX);
    run(&v, SECOND_NS);
    assert_true(v.frames >= 20);
    assert_true(v.link.newest_age_ns < 120 * MS);
}

static void test_a_client_that_names_no_frames_is_bounded_by_its_credit_alone(void **state)
{
    (void)state;
    struct view v = make_view(125e3, 20);
    v.link.names = v.control.informed = false;
    for (int i = 0; i < 3 * HG_CONTROL_FLIGHTS; i++) {
        assert_true(hg_control_due_ns(&v.control, v.now_ns) <= v.now_ns);
        send(&v, v.now_ns);
        assert_int_equal(v.newest, 80);
        v.now_ns += 20 * MS;
        deliver_until(&v, v.now_ns);
        v.link.count = 0;
    }
    assert_int_equal(v.control.count, HG_CONTROL_FLIGHTS);
}

static void test_views_that_move_share_the_time_of_a_frame(void **state)
{
    (void)state;
    struct hg_control c = {0};
    struct hg_control_goal goal = {.fps = 25, .quality = 80, .sharing = 1};
    const float alone = hg_control_choose(&c, &goal).target_ms;
    goal.sharing = 4;
    assert_float_equal((double)hg_control_choose(&c, &goal).target_ms, (double)alone / 4, 1e-3);
    goal.fps = 0; // nothing gives way
    assert_true(hg_control_choose(&c, &goal).target_ms == 0);
    assert_int_equal(hg_control_choose(&c, &goal).quality, 80);
}

static void test_an_encoder_that_does_not_hold_the_frame_rate(void **state)
{
    (void)state;
    struct hg_control c = {0};
    hg_control_set_encoding(&c, 9);
    for (uint64_t i = 1; i <= 20; i++) {
        assert_false(hg_control_encoder_is_slow(&c, i < 10 ? 30.0f : 0.0f));
        hg_control_sent(&c, &(struct hg_control_sent){.number = i,
                                .bytes = 1000,
                                .encode_ns = 80 * MS,
                                .sent_ns = i * SECOND_NS,
                                .quality = 80,
                                .lossy = true});
    }
    assert_true(hg_control_encoder_is_slow(&c, 30));
    assert_false(hg_control_encoder_is_slow(&c, 10));
    hg_control_set_encoding(&c, 5); // what is known of one says nothing of another
    assert_false(hg_control_encoder_is_slow(&c, 30));
}

// Frames of quality 40 at 30 frames a second need about 900 kB/s here.
static void test_a_link_is_narrow_where_pictures_are_poor(void **state)
{
    (void)state;
    struct view wide = make_view(2e6, 20), narrow = make_view(0.5e6, 20);
    run(&wide, 2 * (uint64_t)SECOND_NS);
    run(&narrow, 2 * (uint64_t)SECOND_NS);
    assert_false(hg_control_is_narrow(&wide.control, 30));
    assert_true(hg_control_is_narrow(&narrow.control, 30));
    assert_false(hg_control_is_narrow(&narrow.control, 5));
    assert_false(hg_control_is_narrow(&narrow.control, 0)); // nothing gives way
    hg_control_forget_encoder(&narrow.control);
    assert_false(hg_control_is_narrow(&narrow.control, 30)); // not known
}

static void test_a_frame_that_cannot_be_encoded_holds_nothing_up(void **state)
{
    (void)state;
    struct hg_control c = {0};
    hg_control_begin(&c, true);
    hg_control_queued(&c, 1, SECOND_NS, MS);
    hg_control_queued(&c, 2, SECOND_NS, MS);
    assert_true(hg_control_due_ns(&c, SECOND_NS) == UINT64_MAX); // nothing is known yet
    hg_control_sent(&c, &(struct hg_control_sent){.failed = true});
    assert_true(hg_control_due_ns(&c, SECOND_NS) <= SECOND_NS);
}

static void test_nonsense_from_a_client_does_no_harm(void **state)
{
    (void)state;
    struct view v = make_view(2.5e6, 20);
    run(&v, SECOND_NS);
    const struct hg_control_delivery odd[] = {{.number = UINT64_MAX},
        {.number = UINT64_MAX, .at_ns = UINT64_MAX, .rtt_ns = UINT64_MAX},
        {.number = 0, .at_ns = v.now_ns, .begun_ns = UINT64_MAX, .received_ns = 1},
        {.number = v.number + 1, .at_ns = v.now_ns, .begun_ns = 1, .received_ns = UINT64_MAX}};
    for (size_t i = 0; i < sizeof odd / sizeof *odd; i++) {
        hg_control_delivered(&v.control, &odd[i]);
        hg_control_choose(&v.control, &v.goal);
        assert_true(hg_control_due_ns(&v.control, v.now_ns) != 1);
        hg_control_queued(&v.control, v.number + 2 + i, v.now_ns, 0);
        hg_control_sent(&v.control, &(struct hg_control_sent){.number = v.number + 2 + i,
                                        .bytes = 1000,
                                        .sent_ns = v.now_ns,
                                        .quality = 80,
                                        .lossy = true});
    }
    hg_control_begin(&v.control, true); // and begins again
    assert_true(hg_control_due_ns(&v.control, v.now_ns) <= v.now_ns);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_a_fast_link_gets_the_quality_that_was_asked_for),
        cmocka_unit_test(test_quality_holds_the_frame_rate_of_a_narrow_link),
        cmocka_unit_test(test_a_narrower_link_than_any_quality_gets_fewer_frames_and_no_queue),
        cmocka_unit_test(test_it_recovers_when_the_link_does),
        cmocka_unit_test(test_a_long_round_trip_does_not_lower_the_frame_rate),
        cmocka_unit_test(test_a_stall_freezes_the_picture_and_leaves_no_queue),
        cmocka_unit_test(test_a_client_that_names_no_frames_is_bounded_by_its_credit_alone),
        cmocka_unit_test(test_views_that_move_share_the_time_of_a_frame),
        cmocka_unit_test(test_an_encoder_that_does_not_hold_the_frame_rate),
        cmocka_unit_test(test_a_link_is_narrow_where_pictures_are_poor),
        cmocka_unit_test(test_a_frame_that_cannot_be_encoded_holds_nothing_up),
        cmocka_unit_test(test_nonsense_from_a_client_does_no_harm),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
