// render_shadow_pages.c - pictures in motion with the sun's virtual shadow map: edges near and far
// are where they belong to within texels of the picture's own size, pages are drawn once, again
// where something moved alone, and settled pictures know nothing of them.
#include "renderer/internal.h"
#include "tests/unit/render_rig.h"

#define WIDTH    480
#define HEIGHT   270
#define PICTURES 10     // in motion, until all pages are there
#define EDGE_PX  5.0f   // two pixels a texel at most: a filter of 1.5, and one of rounding
#define HALF     400.0f // of the floor: a texel of the whole map is 0.4 m

struct plate {
    float at[3], half; // its shadow lies straight below
};

static struct plate plates[] = {{{0.1f, -0.5f, 0.5f}, 0.4f}, {{-1, 40, 6}, 6}};

static void add_plate(struct hg_scene *scene, uint64_t id, const float at[3], float half)
{
    const float grey[4] = {0.5f, 0.5f, 0.5f, 1};
    struct hg_node *node = rig_quad(scene, id, half, 0, grey);
    node->mesh->parts[0].material->unlit = false;
    memcpy(node->translation, at, 3 * sizeof *at);
}

static void open_scene(struct rig *rig, enum hg_view_shadow_maps shadow_maps)
{
    const struct hg_view_params params = {.width = WIDTH,
        .height = HEIGHT,
        .samples = 4,
        .gi = HG_GI_NONE,
        .temporal = HG_TEMPORAL_AUTO,
        .shadow_maps = shadow_maps,
        .tonemap = HG_TONEMAP_LINEAR};
    struct hg_scene *scene = rig_new_scene();
    add_plate(scene, 1, (float[3]){0, 0, 0}, HALF);
    for (int i = 0; i < 2; i++)
        add_plate(scene, 2 + (uint64_t)i, plates[i].at, plates[i].half);
    rig_sun(scene, 7, 0, 1);
    rig_environment(scene, 0.1f, 0.1f, 0.1f);
    hg_scene_publish(scene);
    rig_use_scene(rig, scene, &params);
}

// Small steps, so that all ask for the same pages.
static void walk(struct rig *rig, int pictures)
{
    static int step;
    for (int i = 0; i < pictures; i++) {
        const double x = 1e-4 * (step++ % 7);
        const struct hg_view_camera camera = {
            .eye = {x, -4, 2}, .target = {x, 6, 0}, .vfov_rad = 1};
        test_ok(hg_view_set_camera(rig->view, &camera, &rig->err), &rig->err);
        assert_int_equal(rig_step(rig, 1).phase, HG_VIEW_DIRECT);
    }
}

static struct hg_shadow_page_stats pages_of(const struct rig *rig)
{
    struct hg_lighting_stats stats;
    hg_lighting_stats(rig->view->state.lighting, &stats);
    return stats.pages;
}

// Pixels of a plate's shadow whose light is not what it should be, farther from an edge than its
// texels explain.
static uint32_t wrong_pixels(struct rig *rig, const struct plate *plate, uint32_t *looked_at)
{
    const float eye[3] = {0, -4, 2}, way[2] = {10, -2}; // y and z of where it looks
    const float length = hypotf(way[0], way[1]), angle = 2 * tanf(0.5f) / HEIGHT;
    struct hg_refbuf *pixels = rig_pixels(rig, HG_PIXEL_RGBA8);
    uint32_t wrong = 0;
    *looked_at = 0;
    for (uint32_t v = 0; v < HEIGHT; v++)
        for (uint32_t u = 0; u < WIDTH; u++) {
            const float right = ((float)u + 0.5f - 0.5f * WIDTH) * angle;
            const float up = (0.5f * HEIGHT - (float)v - 0.5f) * angle;
            const float y = way[0] / length - up * way[1] / length;
            const float z = way[1] / length + up * way[0] / length;
            const float depth = -eye[2] / z; // to the floor
            const float x_m = right * depth - plate->at[0], y_m = eye[1] + y * depth - plate->at[1];
            const float from_edge = fabsf(x_m) - plate->half;
            // In the middle of the shadow, and not behind the plate.
            const float t = plate->at[2] / eye[2], behind = y_m + t * (eye[1] - plate->at[1] - y_m);
            if (!(z < 0) || fabsf(y_m) > 0.6f * plate->half ||
                (t < 1 && fabsf(behind) < 1.1f * plate->half) ||
                fabsf(from_edge) < EDGE_PX * depth * angle || from_edge > plate->half)
                continue;
            const bool dark = pixels->data[4 * (v * WIDTH + u)] < 100;
            wrong += dark != (from_edge < 0);
            ++*looked_at;
        }
    hg_refbuf_unref(pixels);
    return wrong;
}

static void test_edges(void **state)
{
    struct rig *rig = *state;
    uint32_t wrong[2][2], all;
    for (int paged = 0; paged < 2; paged++) {
        open_scene(rig, paged ? HG_SHADOW_MAPS_VIRTUAL : HG_SHADOW_MAPS_CASCADES);
        walk(rig, PICTURES);
        for (int i = 0; i < 2; i++) {
            wrong[paged][i] = wrong_pixels(rig, &plates[i], &all);
            print_message("%s, %s: %u of %u pixels are wrong\n", paged ? "pages" : "whole map",
                i > 0 ? "far" : "near", wrong[paged][i], all);
            assert_true(all > 100);
        }
        rig_close_scene(rig);
    }
    assert_true(wrong[0][0] > 100); // what the test can tell
    assert_int_equal(wrong[1][0], 0);
    assert_int_equal(wrong[1][1], 0);
}

static void test_moved(void **state)
{
    struct rig *rig = *state;
    uint32_t all;
    open_scene(rig, HG_SHADOW_MAPS_VIRTUAL);
    walk(rig, PICTURES);
    const struct hg_shadow_page_stats rest = pages_of(rig);
    print_message("%u pages asked for, %u held\n", rest.asked, rest.held);
    assert_true(rest.asked > 10);
    assert_int_equal(rest.hits, rest.asked);
    assert_int_equal(rest.drawn, 0);
    struct hg_node *node = (struct hg_node *)hg_scene_find(rig->scene, HG_OBJECT_NODE, 2);
    struct plate moved = plates[0];
    moved.at[0] -= 0.25f;
    memcpy(node->translation, moved.at, sizeof moved.at);
    hg_scene_touch(rig->scene, &node->head);
    hg_scene_publish(rig->scene);
    walk(rig, 1);
    const struct hg_shadow_page_stats after = pages_of(rig);
    print_message("%u of them are drawn again where a plate moved\n", after.drawn);
    assert_true(after.drawn > 0 && after.drawn < rest.asked / 2);
    assert_int_equal(after.hits + after.drawn, after.asked);
    walk(rig, PICTURES);
    assert_int_equal(wrong_pixels(rig, &moved, &all), 0);
    rig_close_scene(rig);
}

static struct hg_refbuf *settled(struct rig *rig)
{
    rig_settle(rig, 4);
    return rig_pixels(rig, HG_PIXEL_RGBA8);
}

static void test_settled(void **state)
{
    struct rig *rig = *state, fresh = {.renderer = rig->renderer};
    const struct hg_view_camera camera = {.eye = {0, -4, 2}, .target = {0, 6, 0}, .vfov_rad = 1};
    open_scene(rig, HG_SHADOW_MAPS_VIRTUAL);
    walk(rig, PICTURES);
    test_ok(hg_view_set_camera(rig->view, &camera, &rig->err), &rig->err);
    struct hg_refbuf *got = settled(rig);
    assert_int_equal(pages_of(rig).held, 0);
    open_scene(&fresh, HG_SHADOW_MAPS_CASCADES);
    test_ok(hg_view_set_camera(fresh.view, &camera, &fresh.err), &fresh.err);
    struct hg_refbuf *want = settled(&fresh);
    assert_memory_equal(got->data, want->data, (size_t)WIDTH * HEIGHT * 4);
    hg_refbuf_unref(got);
    hg_refbuf_unref(want);
    rig_close_scene(rig);
    rig_close_scene(&fresh);
}

static int open_renderer(void **state)
{
    static struct rig rig;
    rig_open(&rig, true);
    *state = &rig;
    return 0;
}

static int close_renderer(void **state)
{
    rig_close(*state);
    return 0;
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_edges), cmocka_unit_test(test_moved), cmocka_unit_test(test_settled)};
    return cmocka_run_group_tests(tests, open_renderer, close_renderer);
}
