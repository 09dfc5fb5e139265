// What the images of a view take, against what the device gave: a larger picture takes as much more
// as is said, at rest; a picture in motion adds its own.
#include "renderer/frame/view_bytes.h"
#include "renderer/internal.h"
#include "tests/unit/render_rig.h"

static struct rig rig;

static uint64_t used_bytes(void)
{
    struct hg_gpu_memory_stats memory;
    hg_gpu_memory_stats(rig.renderer->gpu, &memory);
    return memory.used_bytes;
}

static struct hg_view_bytes settle(uint32_t side, uint64_t *used)
{
    struct hg_view_bytes bytes;
    const struct hg_view_params params = {.width = side, .height = side, .samples = 2};
    test_ok(hg_view_set_params(rig.view, &params, &rig.err), &rig.err);
    rig_settle(&rig, 1);
    hg_refbuf_unref(rig_pixels(&rig, HG_PIXEL_RGBA8));
    hg_view_bytes_get(&rig.view->state, &bytes);
    *used = used_bytes();
    return bytes;
}

static void test_growth(void **state)
{
    (void)state;
    uint64_t small_used, large_used;
    const struct hg_view_params params = {.width = 64, .height = 64, .samples = 2};
    rig_open(&rig, false);
    rig_use_scene(&rig, rig_load(KNOT, hg_renderer_jobs(rig.renderer)), &params);
    rig_look_at_scene(&rig, 0);
    const struct hg_view_bytes small = settle(64, &small_used), large = settle(512, &large_used);
    const double said = (double)(large.still - small.still),
                 used = (double)(large_used - small_used);
    assert_true(said > 512.0 * 512 * 20); // visibility, depth, accumulated colour
    assert_true(said > 0.9 * used && said < 1.1 * used);
    assert_int_equal(small.motion, 0);

    const struct hg_view_params moving = {
        .width = 512, .height = 512, .samples = 2, .temporal = HG_TEMPORAL_AUTO};
    struct hg_view_bytes moved;
    test_ok(hg_view_set_params(rig.view, &moving, &rig.err), &rig.err);
    for (int i = 1; i <= 3; i++) {
        rig_look_at_scene(&rig, 0.1f * (float)i);
        rig_step(&rig, 1);
    }
    hg_view_bytes_get(&rig.view->state, &moved);
    assert_true(moved.motion > 512u * 512 * 4); // a history of colours at least
    rig_close_scene(&rig);
    rig_close(&rig);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_growth)};
    return cmocka_run_group_tests_name("render_view_bytes", tests, NULL, NULL);
}
