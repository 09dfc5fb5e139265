// render_levels_whole.c - pictures of levels beside those of the whole mesh: nothing pops in a
// zoom, neither surfaces nor shadows; depths are the same within the error; no specks.
#include "base/log.h"
#include "renderer/bench/depth.h"
#include "tests/support/test_data.h"
#include "tests/unit/render_levels_rig.h"

// --- zoom ----------------------------------------------------------------------------------------

#define ZOOMS 11

static void settle_at_one_pixel(struct rig *rig, float distance, struct hg_refbuf **out)
{
    const struct hg_view_params view = {.width = LEVELS_VIEW_PX,
        .height = LEVELS_VIEW_PX,
        .samples = 8,
        .seed = 5,
        .error_px = 1.0f};
    test_ok(hg_view_set_params(rig->view, &view, &rig->err), &rig->err);
    levels_look(rig, 0, distance);
    rig_settle(rig, 16);
    *out = rig_pixels(rig, HG_PIXEL_RGBA32F);
}

// A zoom by a tenth of a pixel at a time never changes more than with the whole mesh, shadows
// included: a level that popped in would stand out against steps so small.
static void test_zoom_does_not_pop(void **state)
{
    (void)state;
    levels_model = test_data(LEVELS_DRAGON);
    struct rig rigs[2];
    struct hg_refbuf *frames[2][ZOOMS];
    double worst = 0.0;
    for (int side = 0; side < 2; side++) {
        if (side == 0)
            levels_open(&rigs[0], 0);
        else
            levels_open_whole(&rigs[1]);
        for (int i = 0; i < ZOOMS; i++)
            settle_at_one_pixel(&rigs[side], 0.8f * powf(0.998f, (float)i), &frames[side][i]);
    }
    for (int i = 0; i + 1 < ZOOMS; i++) {
        struct hg_refbuf **l = &frames[0][i], **w = &frames[1][i];
        const double levels = rig_difference(l[0], l[1]), whole = rig_difference(w[0], w[1]);
        print_message("zoom %d: %.5f, whole mesh %.5f\n", i, levels, whole);
        worst = fmax(worst, levels / whole);
    }
    print_message("at most %.3f times the change of the whole mesh\n", worst);
    assert_true(worst <= 1.05);
    for (int side = 0; side < 2; side++) {
        for (int i = 0; i < ZOOMS; i++)
            hg_refbuf_unref(frames[side][i]);
        rig_close(&rigs[side]);
    }
    levels_model = NULL;
}

// Straight down on the plate, with everything above it cut off: nothing is seen but what is lit and
// what lies in the shadow of the statues.
static void settle_on_shadows(struct rig *rig, float height, struct hg_refbuf **out)
{
    const struct hg_view_params view = {.width = LEVELS_VIEW_PX,
        .height = LEVELS_VIEW_PX,
        .samples = 8,
        .seed = 5,
        .error_px = 1.0f};
    const struct hg_view_camera camera = {.eye = {0, height, -0.15f},
        .target = {0, 0, -0.15f},
        .up = {0, 0, -1},
        .near = height - 0.002f};
    test_ok(hg_view_set_params(rig->view, &view, &rig->err), &rig->err);
    test_ok(hg_view_set_camera(rig->view, &camera, &rig->err), &rig->err);
    rig_settle(rig, 16);
    *out = rig_pixels(rig, HG_PIXEL_RGBA32F);
}

// Share of the pixels that get less than 0.7 times the light of the brightest.
static double share_in_shadow(const struct hg_refbuf *picture)
{
    const float *p = (const float *)(const void *)picture->data;
    float most = 0.0f;
    uint32_t dark = 0;
    for (size_t i = 0; i < (size_t)LEVELS_VIEW_PX * LEVELS_VIEW_PX; i++)
        most = fmaxf(most, p[i * 4 + 1]);
    for (size_t i = 0; i < (size_t)LEVELS_VIEW_PX * LEVELS_VIEW_PX; i++)
        dark += p[i * 4 + 1] < 0.7f * most;
    return (double)dark / (LEVELS_VIEW_PX * LEVELS_VIEW_PX);
}

// The same of shadows alone: levels of what casts them must not show when they change.
static void test_shadows_do_not_pop(void **state)
{
    (void)state;
    struct rig rigs[2];
    struct hg_refbuf *frames[2][ZOOMS];
    double worst = 0.0;
    for (int side = 0; side < 2; side++) {
        if (side == 0)
            levels_open(&rigs[0], 0);
        else
            levels_open_whole(&rigs[1]);
        for (int i = 0; i < ZOOMS; i++)
            settle_on_shadows(&rigs[side], 0.8f * powf(0.998f, (float)i), &frames[side][i]);
    }
    const double dark = share_in_shadow(frames[1][0]);
    print_message("%.1f %% of the pixels in shadow, levels differ from the whole mesh by %.5f\n",
        100.0 * dark, rig_difference(frames[0][0], frames[1][0]));
    assert_true(dark > 0.02 && dark < 0.9);
    for (int i = 0; i + 1 < ZOOMS; i++) {
        const double levels = rig_difference(frames[0][i], frames[0][i + 1]);
        const double whole = rig_difference(frames[1][i], frames[1][i + 1]);
        print_message("zoom %d: %.5f, whole mesh %.5f\n", i, levels, whole);
        worst = fmax(worst, levels / whole);
    }
    print_message("at most %.3f times the change of the whole mesh\n", worst);
    assert_true(worst <= 1.1);
    for (int side = 0; side < 2; side++) {
        for (int i = 0; i < ZOOMS; i++)
            hg_refbuf_unref(frames[side][i]);
        rig_close(&rigs[side]);
    }
}

// --- depth ---------------------------------------------------------------------------------------

static struct hg_bench_depth_gap depth_gap(struct rig *levels, struct rig *whole, float error_px)
{
    const struct hg_view_params view = {.width = LEVELS_VIEW_PX,
        .height = LEVELS_VIEW_PX,
        .samples = 1,
        .seed = 5,
        .error_px = error_px};
    struct rig *rigs[2] = {levels, whole};
    struct hg_bench_depth depth[2];
    for (int side = 0; side < 2; side++) {
        test_ok(hg_view_set_params(rigs[side]->view, &view, &rigs[side]->err), &rigs[side]->err);
        levels_look(rigs[side], 0.02f, 0.45f);
        rig_settle(rigs[side], 16);
        test_ok(hg_bench_depth_read(rigs[side]->view, &depth[side], &rigs[side]->err),
            &rigs[side]->err);
    }
    const struct hg_bench_depth_gap gap =
        hg_bench_depth_compare(&depth[0], &depth[1], fminf(error_px, 1.0f));
    hg_bench_depth_finish(&depth[0]);
    hg_bench_depth_finish(&depth[1]);
    print_message("%.2f px: %llu of %llu pixels off, %llu far\n", (double)error_px,
        (unsigned long long)gap.off_px, (unsigned long long)gap.shown_px,
        (unsigned long long)gap.far_px);
    return gap;
}

// No pixel shows anything that the whole mesh does not show there but for the error asked for:
// no cracks, no silhouettes that moved. What is coarser than that is noticed.
static void test_depth_is_that_of_the_whole(void **state)
{
    (void)state;
    struct rig levels, whole;
    levels_open(&levels, 0);
    levels_open_whole(&whole);
    static const float errors[] = {0.25f, 0.5f, 1.0f};
    for (int i = 0; i < 3; i++) {
        const struct hg_bench_depth_gap gap = depth_gap(&levels, &whole, errors[i]);
        assert_true(gap.shown_px > 50000);
        assert_true(gap.off_px * 5000 <= gap.shown_px);
        assert_int_equal(gap.far_px, 0);
    }
    assert_true(depth_gap(&levels, &whole, 24.0f).off_px > 1000);
    rig_close(&levels);
    rig_close(&whole);
}

// --- specks --------------------------------------------------------------------------------------

static float light_at(const struct hg_refbuf *picture, uint32_t x, uint32_t y)
{
    const float *p =
        (const float *)(const void *)picture->data + ((size_t)y * LEVELS_VIEW_PX + x) * 4;
    return p[0] + p[1] + p[2];
}

// Pixels of a picture that are darker by a third than all that the other has within two pixels.
static uint32_t count_dark(const struct hg_refbuf *a, const struct hg_refbuf *b)
{
    uint32_t dark = 0;
    for (uint32_t y = 2; y + 2 < LEVELS_VIEW_PX; y++) {
        for (uint32_t x = 2; x + 2 < LEVELS_VIEW_PX; x++) {
            float least = 1e9f;
            for (uint32_t i = 0; i < 25; i++)
                least = fminf(least, light_at(b, x + i % 5 - 2, y + i / 5 - 2));
            dark += light_at(a, x, y) < 0.67f * least;
        }
    }
    return dark;
}

static struct hg_refbuf *settled(struct rig *rig, float error_px)
{
    const struct hg_view_params view = {.width = LEVELS_VIEW_PX,
        .height = LEVELS_VIEW_PX,
        .samples = 8,
        .seed = 5,
        .error_px = error_px};
    test_ok(hg_view_set_params(rig->view, &view, &rig->err), &rig->err);
    levels_look(rig, 0.02f, 0.45f);
    rig_settle(rig, 16);
    return rig_pixels(rig, HG_PIXEL_RGBA32F);
}

// Shadow maps show levels of their own: where they lie above those of the view, surfaces would be
// in their own shadow, in specks of a pixel or a few. There are hardly more of them than the whole
// mesh has against the levels.
static void test_no_specks(void **state)
{
    (void)state;
    struct rig levels, whole;
    levels_open(&levels, 0);
    levels_open_whole(&whole);
    static const float errors[] = {0.25f, 1.0f};
    struct hg_refbuf *full = settled(&whole, 1.0f);
    for (int i = 0; i < 2; i++) {
        struct hg_refbuf *picture = settled(&levels, errors[i]);
        const uint32_t dark = count_dark(picture, full), other = count_dark(full, picture);
        print_message(
            "%.2f px: %u dark specks, the whole mesh has %u\n", (double)errors[i], dark, other);
        assert_true(dark <= other + 8);
        hg_refbuf_unref(picture);
    }
    struct hg_refbuf *coarse = settled(&levels, 24.0f);
    const uint32_t noticed = count_dark(coarse, full);
    print_message("24 px: %u\n", noticed);
    assert_true(noticed > 8);
    hg_refbuf_unref(coarse);
    hg_refbuf_unref(full);
    rig_close(&levels);
    rig_close(&whole);
}

static int setup(void **state)
{
    (void)state;
    return test_folder_make(levels_cache_dir, "levels-whole") ? 0 : -1;
}

static int teardown(void **state)
{
    (void)state;
    return test_folder_remove(levels_cache_dir) ? 0 : -1;
}

int main(void)
{
    hg_log_set_sink(hg_log_sink_logfmt, (void *)(intptr_t)2);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_zoom_does_not_pop),
        cmocka_unit_test(test_shadows_do_not_pop),
        cmocka_unit_test(test_depth_is_that_of_the_whole),
        cmocka_unit_test(test_no_specks),
    };
    return test_run_group(tests, setup, teardown);
}
