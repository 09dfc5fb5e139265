// render_path_lease.c - views of a scene that rest take turns with what their paths need: only so
// many have such at a time, all are settled in the end, with the pictures that a view alone has,
// and one that moves on or is left does not hold up the others.
#include "base/clock.h"
#include "renderer/internal.h"
#include "tests/unit/render_rig.h"

enum { VIEWS = 4, ROUNDS = 3000 };

static const struct hg_view_params params = {
    .width = 48, .height = 32, .samples = 2, .gi = HG_GI_RAYS, .exposure_mode = HG_EXPOSURE_AUTO};
static struct rig rigs[VIEWS];

static void open_views(uint32_t count)
{
    rig_open(&rigs[0], false);
    rig_use_scene(&rigs[0], rig_load(KNOT, hg_renderer_jobs(rigs[0].renderer)), &params);
    for (uint32_t i = 1; i < count; i++) {
        rigs[i] = (struct rig){.renderer = rigs[0].renderer, .scene = rigs[0].scene};
        rig_view(&rigs[i], &params);
    }
    for (uint32_t i = 0; i < count; i++)
        rig_look_at_scene(&rigs[i], (float)i);
}

static void close_views(uint32_t count)
{
    for (uint32_t i = 1; i < count; i++)
        hg_view_destroy(rigs[i].view);
    rig_close_scene(&rigs[0]);
    rig_close(&rigs[0]);
}

static uint32_t count_paths(void)
{
    uint32_t count = 0;
    for (uint32_t i = 0; i < VIEWS; i++) {
        const struct hg_view_state *s = &rigs[i].view->state;
        count += s->path != NULL || s->gi.gather.path != NULL;
    }
    return count;
}

static bool is_gathering(const struct rig *rig)
{
    return rig->view->state.gi.gather.path != NULL;
}

static void test_all_settle(void **state)
{
    (void)state;
    struct hg_refbuf *alone[VIEWS];
    for (uint32_t i = 0; i < VIEWS; i++) {
        open_views(1);
        rig_look_at_scene(&rigs[0], (float)i);
        rig_settle(&rigs[0], 1);
        alone[i] = rig_pixels(&rigs[0], HG_PIXEL_RGBA32F);
        close_views(1);
    }
    uint32_t settled = 0, waited = 0;
    open_views(VIEWS);
    for (uint32_t round = 0; round < ROUNDS && settled < VIEWS; round++) {
        settled = 0;
        for (uint32_t i = 0; i < VIEWS; i++) {
            const struct hg_frame_info info = rig_step(&rigs[i], 1);
            settled += info.settled;
            waited += info.waits;
            assert_false(info.settled && info.waits);
            assert_true(count_paths() <= HG_PATH_LEASES);
        }
    }
    assert_int_equal(settled, VIEWS);
    assert_true(waited > 0);
    for (uint32_t i = 0; i < VIEWS; i++) {
        struct hg_refbuf *pixels = rig_pixels(&rigs[i], HG_PIXEL_RGBA32F);
        rig_assert_same(alone[i], pixels);
        hg_refbuf_unref(pixels);
        hg_refbuf_unref(alone[i]);
    }
    close_views(VIEWS);
}

// Two views are at it, and a third one waits.
static void begin(void)
{
    bool waits = false;
    open_views(3);
    for (uint32_t round = 0; round < ROUNDS && !is_gathering(&rigs[0]); round++)
        rig_step(&rigs[0], 1);
    for (uint32_t round = 0; round < ROUNDS && !is_gathering(&rigs[1]); round++)
        rig_step(&rigs[1], 1);
    for (uint32_t round = 0; round < 10 && !waits; round++)
        waits = rig_step(&rigs[2], 1).waits;
    assert_true(waits);
}

static void assert_goes_on(void)
{
    assert_false(rig_step(&rigs[2], 1).waits);
    assert_int_equal(is_gathering(&rigs[0]) + is_gathering(&rigs[1]), 1);
    close_views(3);
}

static void test_one_moves_on(void **state)
{
    (void)state;
    begin();
    rig_look_at_scene(&rigs[1], 0.5f);
    assert_goes_on();
}

// No other view waits for it, and it keeps its buffers for a second.
static void test_a_long_motion(void **state)
{
    (void)state;
    begin();
    for (int i = 0; i < HG_PATH_LEASES; i++) // however long the steps before took
        rigs[0].view->state.scene_gpu->leases[i].used_ns = hg_clock_now_ns();
    rig_look_at_scene(&rigs[1], 0.5f);
    rig_step(&rigs[1], 1);
    assert_true(is_gathering(&rigs[1]));
    for (int i = 0; i < HG_PATH_LEASES; i++)
        rigs[0].view->state.scene_gpu->leases[i].used_ns -= UINT64_C(2000000000);
    rig_look_at_scene(&rigs[1], 0.6f);
    rig_step(&rigs[1], 1);
    assert_false(is_gathering(&rigs[1]) || rigs[1].view->state.path != NULL);
    assert_true(is_gathering(&rigs[0]));
    close_views(3);
}

static void test_one_is_left(void **state)
{
    (void)state;
    begin();
    rigs[0].view->state.scene_gpu->leases[0].used_ns -= UINT64_C(60000000000);
    assert_goes_on();
}

static void test_one_ends(void **state)
{
    (void)state;
    begin();
    hg_view_destroy(rigs[1].view);
    rig_view(&rigs[1], &params);
    assert_goes_on();
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_all_settle),
        cmocka_unit_test(test_one_moves_on),
        cmocka_unit_test(test_a_long_motion),
        cmocka_unit_test(test_one_is_left),
        cmocka_unit_test(test_one_ends),
    };
    return cmocka_run_group_tests_name("render_path_lease", tests, NULL, NULL);
}
