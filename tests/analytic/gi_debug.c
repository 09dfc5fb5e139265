// gi_debug.c - debug views of global illumination and of shadows say what they should, and
// counters what the schedule of the field says.
#include <math.h>
#include <string.h>

#include "renderer/internal.h"
#include "shaders/shared/debug.h"
#include "tests/analytic/rig.h"

enum { WIDTH = 640, HEIGHT = 480 };

#define HALF_HEIGHT 3.2

// --- scenes --------------------------------------------------------------------------------------

// A room, and on its floor a solid block whose face to the camera (+z) is left out.
static void room_with_block(struct rig *rig)
{
    const float room[2][3] = {{-2, 0, -3}, {2, 3, 3}}, block[2][3] = {{-1, 0, -2}, {1, 2, 2}};
    rig_scene(rig);
    struct hg_material *m = rig_material(rig);
    for (int i = 0; i < 6; i++)
        rig_face(rig, m, room, 1, i);
    for (int i = 0; i < 5; i++)
        rig_face(rig, m, block, -1, i);
    m->emissive[1] = 0.1f;
}

// --- pictures ------------------------------------------------------------------------------------

// The direction is such that few probes of a grid are behind others.
static struct hg_view *open_view(struct rig *rig, enum hg_debug_view debug, bool parallel)
{
    struct hg_error err = {0};
    struct hg_view *view;
    const struct hg_view_params params = {
        .width = WIDTH, .height = HEIGHT, .debug_view = debug, .background = HG_BACKGROUND_NONE};
    const struct hg_view_camera camera = {.eye = {1.9f, 3.6f, 14},
        .target = {0, 1.5f, 0},
        .orthographic = parallel,
        .half_height = (float)HALF_HEIGHT,
        .vfov_rad = 0.3f};
    hg_scene_publish(rig->scene);
    test_ok(hg_view_create(rig->renderer, rig->scene, &view, &err), &err);
    test_ok(hg_view_set_params(view, &params, &err), &err);
    test_ok(hg_view_set_camera(view, &camera, &err), &err);
    return view;
}

static struct hg_refbuf *settle(struct hg_view *view)
{
    struct hg_error err = {0};
    struct hg_frame_info info = {0};
    struct hg_refbuf *pixels;
    for (int i = 0; i < 4000 && !info.settled; i++)
        test_ok(hg_view_step(view, 8, &info, &err), &err);
    assert_true(info.settled);
    test_ok(hg_view_read_pixels(view, HG_PIXEL_RGBA32F, &pixels, &err), &err);
    return pixels;
}

static const float *pixel_at(const struct hg_refbuf *pixels, int x, int y)
{
    return (const float *)(const void *)pixels->data + ((size_t)y * WIDTH + (size_t)x) * 4;
}

enum color { AWAKE_RIM, MOVED_RIM, INSIDE, UNNEEDED, GREY, OTHER, COLORS };

static enum color color_of(const float *p)
{
    static const float legend[4][3] = {
        {0.05f, 0.55f, 0.05f}, {0.85f, 0.75f, 0}, {0.8f, 0.02f, 0.02f}, {0.02f, 0.1f, 0.8f}};
    for (int i = 0; i < 4; i++)
        if (fabsf(p[0] - legend[i][0]) + fabsf(p[1] - legend[i][1]) + fabsf(p[2] - legend[i][2]) <
            0.01f)
            return (enum color)i;
    return fabsf(p[0] - p[1]) + fabsf(p[1] - p[2]) < 0.002f ? GREY : OTHER;
}

static void count_colors(const struct hg_refbuf *pixels, double counts[COLORS])
{
    memset(counts, 0, COLORS * sizeof *counts);
    for (int y = 0; y < HEIGHT; y++)
        for (int x = 0; x < WIDTH; x++)
            counts[color_of(pixel_at(pixels, x, y))]++;
}

// --- probes --------------------------------------------------------------------------------------

static void project(const struct hg_view *view, const double at[3], double px[2])
{
    struct hg_view_matrices m;
    double clip[4];
    hg_view_matrices(view, &m);
    for (int i = 0; i < 4; i++)
        clip[i] = (double)m.world_to_ndc[i] * at[0] + (double)m.world_to_ndc[4 + i] * at[1] +
                  (double)m.world_to_ndc[8 + i] * at[2] + (double)m.world_to_ndc[12 + i];
    px[0] = (clip[0] / clip[3] * 0.5 + 0.5) * WIDTH;
    px[1] = (0.5 - clip[1] / clip[3] * 0.5) * HEIGHT;
}

static void assert_in(double shown, uint32_t told)
{
    assert_true(shown <= 1.05 * told && shown >= 0.7 * told);
}

// Spheres are as many as the statistics say, by the area that each has.
static void test_states(void **state)
{
    struct rig *rig = *state;
    struct hg_gi_stats stats;
    double counts[COLORS];
    room_with_block(rig);
    struct hg_view *view = open_view(rig, HG_DEBUG_PROBES, true);
    struct hg_refbuf *pixels = settle(view);
    hg_gi_stats(view->state.scene_gpu->gi, &stats);
    count_colors(pixels, counts);
    const double radius =
        HG_DEBUG_PROBE_RADIUS * stats.grids[0].spacing * HEIGHT / (2 * HALF_HEIGHT);
    const double area = M_PI * radius * radius, rim = area * (1 - 0.8 * 0.8);
    const double inside = counts[INSIDE] / area, moved = counts[MOVED_RIM] / rim,
                 there = counts[AWAKE_RIM] / rim, unneeded = counts[UNNEEDED] / area;
    print_message(
        "probes %u; inside %u, shown %.1f; not needed %u, shown %.1f; moved %u, shown %.1f; "
        "at their place %u, shown %.1f\n",
        stats.probes, stats.inside, inside, stats.asleep - stats.inside, unneeded, stats.moved,
        moved, stats.probes - stats.asleep - stats.moved, there);
    // Some are behind others, or behind the block's top and side.
    assert_true(stats.inside > 100 && stats.moved > 20);
    assert_in(inside, stats.inside);
    assert_in(there, stats.probes - stats.asleep - stats.moved);
    assert_in(moved, stats.moved);
    assert_true(unneeded <= 1.05 * (stats.asleep - stats.inside));
    hg_refbuf_unref(pixels);
    hg_view_destroy(view);
}

// Probes that stand where the grid has them are seen there, and behind a surface not at all.
static void test_places(void **state)
{
    struct rig *rig = *state;
    room_with_block(rig);
    struct hg_view *view = open_view(rig, HG_DEBUG_PROBES, false);
    struct hg_refbuf *pixels = settle(view);
    const struct hg_gpu_probe_grid *p = &view->state.frame.probes.grids[0];
    double origin[3];
    uint32_t seen = 0, looked = 0;
    hg_geometry_origin(view->state.scene_gpu->geometry, origin);
    const float first[3] = {p->origin_ws.x, p->origin_ws.y, p->origin_ws.z};
    // A layer off the walls, around the block's open face, which probes behind it move away from.
    // Others may be before one of them.
    for (uint32_t y = 1; y + 1 < p->counts[1]; y++)
        for (uint32_t x = 1; x + 1 < p->counts[0]; x++) {
            const uint32_t cell[3] = {x, y, p->counts[2] - 3};
            double at[3], px[2];
            for (int a = 0; a < 3; a++)
                at[a] = origin[a] + (double)first[a] + (double)p->spacing * cell[a];
            if (fabs(at[0]) < 1.3 && at[1] < 2.3)
                continue;
            looked++;
            project(view, at, px);
            const float *c = pixel_at(pixels, (int)px[0], (int)px[1]);
            seen += color_of(c) == OTHER && c[1] > 2 * c[0]; // walls send green light alone
        }
    print_message("%u of %u probes are where the grid has them\n", seen, looked);
    assert_true(looked >= 20 && seen >= 0.9 * looked);
    hg_refbuf_unref(pixels);

    // A wall in between, of which so much is seen that it asks for no finer grids.
    struct hg_error err = {0};
    const struct hg_view_camera wide = {
        .eye = {1.9f, 3.6f, 14}, .target = {0, 1.5f, 0}, .vfov_rad = 1.15f};
    test_ok(hg_view_set_camera(view, &wide, &err), &err);
    const float wall[2][3] = {{-9, -9, 5}, {9, 9, 5.1f}};
    double counts[COLORS];
    rig_face(rig, rig_material(rig), wall, -1, 5);
    hg_scene_publish(rig->scene);
    pixels = settle(view);
    count_colors(pixels, counts);
    // The last layer of the grid may stand before the wall, moved off it.
    const struct hg_gpu_probe_grid *now = &view->state.frame.probes.grids[0];
    const double last = origin[2] + (double)now->origin_ws.z +
                        (double)now->spacing * (now->counts[2] - 1) + 0.5 * (double)now->spacing;
    print_message("behind a wall: %.0f px of spheres; the grid ends at %.2f\n",
        counts[AWAKE_RIM] + counts[MOVED_RIM] + counts[INSIDE], last);
    assert_true(counts[AWAKE_RIM] + counts[INSIDE] == 0);
    hg_refbuf_unref(pixels);
    hg_view_destroy(view);
}

// --- light ---------------------------------------------------------------------------------------

// In a room that emits 0.5 and sends half of it back the irradiance over pi is 1 everywhere.
static void test_irradiance(void **state)
{
    const float room[2][3] = {{-2, 0, -3}, {2, 3, 3}};
    struct rig *rig = *state;
    rig_scene(rig);
    struct hg_material *m = rig_material(rig);
    for (int c = 0; c < 3; c++) {
        m->base_color[c] = 0.5f;
        m->emissive[c] = 0.5f;
    }
    for (int i = 0; i < 6; i++)
        rig_face(rig, m, room, 1, i);
    struct hg_view *view = open_view(rig, HG_DEBUG_IRRADIANCE, true);
    struct hg_refbuf *pixels = settle(view);
    double sum = 0;
    uint32_t count = 0;
    for (int y = HEIGHT / 2 - 20; y < HEIGHT / 2 + 20; y++)
        for (int x = WIDTH / 2 - 20; x < WIDTH / 2 + 20; x++, count++)
            sum += (double)pixel_at(pixels, x, y)[1];
    const double shown = sum / count, light = HG_DEBUG_LIGHT_HALF * shown / (1 - shown);
    print_message("irradiance of a furnace of 1: %.4f\n", light);
    assert_true(fabs(light - 1) < 0.1);
    hg_refbuf_unref(pixels);
    hg_view_destroy(view);
}

// --- shadow maps ---------------------------------------------------------------------------------

// A sun from above: the floor is in more than one of its cascades; without shadows in none.
static void test_shadows(void **state)
{
    static const float levels[4][3] = {// of cascades, from the finest on
        {0.8f, 0.02f, 0.02f}, {0.9f, 0.25f, 0}, {0.85f, 0.75f, 0}, {0.05f, 0.55f, 0.05f}};
    struct rig *rig = *state;
    const float floor_box[2][3] = {{-40, -1, -40}, {40, 0, 40}};
    rig_scene(rig);
    rig_face(rig, rig_material(rig), floor_box, -1, 3);
    struct hg_light *sun = rig_light(
        rig, HG_LIGHT_DIRECTIONAL, (const double[3]){0, 5, 0}, (const double[3]){0.1, -1, 0.05});
    sun->casts_shadow = true;
    struct hg_view *view = open_view(rig, HG_DEBUG_SHADOWS, false);
    struct hg_error err = {0};
    const struct hg_view_camera low = {.eye = {0, 2, 0}, .target = {0, 0, -10}, .vfov_rad = 1};
    test_ok(hg_view_set_camera(view, &low, &err), &err);
    struct hg_refbuf *pixels = settle(view);
    uint32_t shown[4] = {0}, seen = 0;
    for (int y = 0; y < HEIGHT; y++)
        for (int x = 0; x < WIDTH; x++) {
            const float *p = pixel_at(pixels, x, y);
            for (int k = 0; k < 4; k++)
                for (int dark = 0; dark < 2; dark++) {
                    const float by = dark ? 0.6f : 1;
                    shown[k] += fabsf(p[0] - by * levels[k][0]) < 0.005f &&
                                fabsf(p[1] - by * levels[k][1]) < 0.005f;
                }
        }
    for (int k = 0; k < 4; k++)
        seen += shown[k] > 1000;
    print_message("shadow maps: %u, %u, %u, %u px\n", shown[0], shown[1], shown[2], shown[3]);
    assert_true(seen >= 2);
    hg_refbuf_unref(pixels);
    sun->casts_shadow = false;
    hg_scene_touch(rig->scene, &sun->head);
    hg_scene_publish(rig->scene);
    pixels = settle(view);
    double counts[COLORS];
    count_colors(pixels, counts);
    assert_true(counts[AWAKE_RIM] + counts[MOVED_RIM] + counts[INSIDE] + counts[OTHER] == 0);
    hg_refbuf_unref(pixels);
    hg_view_destroy(view);
}

// --- counters ------------------------------------------------------------------------------------

// A closed room that emits: rays of placed probes meet its walls, and there are no lights. The
// schedule is 3 rounds of 64 rays of all probes, then 8 to 64 of 24 and 4 of 96 of those awake: 64
// in a white room, where light never comes to its level.
static void test_counters(void **state)
{
    const float room[2][3] = {{-2, 0, -3}, {2, 3, 3}};
    struct rig *rig = *state;
    struct hg_gi_stats stats;
    rig_scene(rig);
    struct hg_material *m = rig_material(rig);
    m->emissive[0] = 1;
    for (int i = 0; i < 6; i++)
        rig_face(rig, m, room, 1, i);
    struct hg_view *view = open_view(rig, HG_DEBUG_IRRADIANCE, true);
    hg_view_set_final(view, true); // no rays for pictures in motion
    hg_refbuf_unref(settle(view));
    hg_gi_stats(view->state.scene_gpu->gi, &stats);
    const uint64_t awake = stats.probes - stats.asleep;
    print_message("%u probes, %u awake: %llu rays, %llu shaded, %llu updates\n", stats.probes,
        (unsigned)awake, (unsigned long long)stats.rays, (unsigned long long)stats.shaded,
        (unsigned long long)stats.updates);
    assert_int_equal(stats.rays, 3 * 64 * (uint64_t)stats.probes + (64 * 24 + 4 * 96) * awake);
    assert_int_equal(stats.updates, 68 * awake);
    assert_int_equal(stats.shaded, (64 * 24 + 4 * 96) * awake);
    assert_true(stats.misses < 3 * 64 * (uint64_t)stats.probes / 20); // while probes are placed
    assert_int_equal(stats.shadow_rays, 0);
    assert_true(stats.bytes > 0 && stats.structure_bytes > 0);
    hg_view_destroy(view);
}

// A small picture of 2 samples is gathered with 8 per pixel; each ray is shaded or has left the
// scene.
static void test_gathered(void **state)
{
    const float room[2][3] = {{-2, 0, -3}, {2, 3, 3}};
    struct rig *rig = *state;
    rig_scene(rig);
    struct hg_material *m = rig_material(rig);
    for (int i = 0; i < 6; i++)
        rig_face(rig, m, room, 1, i);
    struct hg_view *view = open_view(rig, HG_DEBUG_OFF, true);
    struct hg_error err = {0};
    const struct hg_view_params params = {
        .width = 64, .height = 48, .samples = 2, .gi = HG_GI_RAYS};
    struct hg_frame_info info = {0};
    test_ok(hg_view_set_params(view, &params, &err), &err);
    for (int i = 0; i < 4000 && !info.settled; i++)
        test_ok(hg_view_step(view, 8, &info, &err), &err);
    assert_true(info.settled);
    const struct hg_path_stats *g = &view->state.gi.gather.stats[0];
    const uint64_t rays = g->pieces[HG_PATH_PIECE_TRACE].items,
                   misses = g->pieces[HG_PATH_PIECE_MISS].items,
                   shaded = g->pieces[HG_PATH_PIECE_SHADE].items;
    print_message("gathered: %llu paths, %llu rays, %llu shaded, %llu left\n",
        (unsigned long long)g->paths, (unsigned long long)rays, (unsigned long long)shaded,
        (unsigned long long)misses);
    assert_int_equal(g->paths, 64 * 48 * 8);
    assert_int_equal(rays, shaded + misses);
    assert_true(misses > 0 && shaded > g->paths / 2);
    hg_view_destroy(view);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_states),
        cmocka_unit_test(test_places),
        cmocka_unit_test(test_irradiance),
        cmocka_unit_test(test_shadows),
        cmocka_unit_test(test_counters),
        cmocka_unit_test(test_gathered),
    };
    return cmocka_run_group_tests(tests, rig_set_up, rig_tear_down);
}
