// gi_cascades.c - light from probes of small things in a scene that is 10 km wide.
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "renderer/internal.h"
#include "tests/analytic/gi_rig.h"

#define FAR_M 10000.0f
#define MOST_CAST                                                                                  \
    50000u // rays of a picture: a third to place probes, what waves go beyond that, updates

// --- scenes --------------------------------------------------------------------------------------

// A small thing far away, which the grid over the whole scene is wide for.
static void far_thing(struct rig *rig)
{
    const float thing[2][3] = {{FAR_M, 0, FAR_M}, {FAR_M + 1, 1, FAR_M + 1}};
    gi_solid(rig, gi_grey(rig, 0.5f, 0), thing);
}

// The panel room of tests/analytic/gi.c, half as large: 2 m wide.
static const float box[2][3] = {{-1, 0, -1.5f}, {1, 1.5f, 1.5f}};
static const struct gi_shot inside = {
    .eye = {0, 0.75f, 1.25f}, .target = {0, 0.7f, -1.5f}, .gi = HG_GI_PROBES, .samples = 16};

static void panel_room(struct rig *rig)
{
    rig_scene(rig);
    gi_room(rig, gi_grey(rig, 0.6f, 0), box);
    const float panel[2][3] = {{-0.5f, 1.45f, -0.75f}, {0.5f, 1.475f, 0.75f}};
    rig_face(rig, gi_grey(rig, 0, 5), panel, -1, 2); // its lower side
    rig_face(rig, gi_grey(rig, 0, 0), panel, -1, 3);
    far_thing(rig);
}

// A corridor whose walls emit 0.5 and send half of it back: light is 1 everywhere in it.
static void corridor(struct rig *rig)
{
    const float walls[2][3] = {{-1, 0, -20}, {1, 2, 4}};
    rig_scene(rig);
    gi_room(rig, gi_grey(rig, 0.5f, 0.5f), walls);
    far_thing(rig);
}

// --- pictures ------------------------------------------------------------------------------------

static void look(struct hg_view *view, const float eye[3], const float target[3])
{
    struct hg_error err = {0};
    struct hg_view_camera camera = {.vfov_rad = 1.2f};
    memcpy(camera.eye, eye, sizeof camera.eye);
    memcpy(camera.target, target, sizeof camera.target);
    test_ok(hg_view_set_camera(view, &camera, &err), &err);
}

static void step(struct hg_view *view)
{
    struct hg_error err = {0};
    struct hg_frame_info info;
    test_ok(hg_view_step(view, 1, &info, &err), &err);
}

static struct hg_refbuf *read_bytes(struct hg_view *view)
{
    struct hg_error err = {0};
    struct hg_refbuf *pixels;
    test_ok(hg_view_read_pixels(view, HG_PIXEL_RGBA8, &pixels, &err), &err);
    return pixels;
}

static void field_stats(const struct hg_view *view, struct hg_gi_stats *out)
{
    hg_gi_stats(view->state.scene_gpu->gi, out);
}

static void print_grids(const struct hg_gi_stats *s)
{
    for (uint32_t i = 0; i < s->grid_count; i++)
        print_message("%s%u of %u probes %.3g m apart",
            i > 0 ? ", " : "grids: ", s->grids[i].probes - s->grids[i].asleep, s->grids[i].probes,
            (double)s->grids[i].spacing);
    print_message("; %.1f MiB\n", (double)s->bytes / (1 << 20));
}

// --- tests ---------------------------------------------------------------------------------------

static struct hg_refbuf *truth; // of panel_room from `inside`, by paths

// Makes it where no test has.
static const struct hg_refbuf *path_traced(struct rig *rig)
{
    struct gi_shot path = inside;
    path.mode = HG_MODE_PATH;
    path.samples = 96;
    if (truth == NULL)
        truth = gi_take(rig, &path);
    return truth;
}

static int tear_down(void **state)
{
    hg_refbuf_unref(truth);
    return rig_tear_down(state);
}

// As close to path tracing as in a scene of its own.
static void test_room(void **state)
{
    static double limits[2][2] = {{0.10, 0.05}, {0.05, 0.03}};
    struct rig *rig = *state;
    panel_room(rig);
    struct hg_gi_stats stats;
    struct hg_refbuf *pixels[2];
    struct gi_shot rays = inside;
    rays.gi = HG_GI_RAYS;
    struct hg_view *view = gi_open_view(rig, &inside);
    hg_view_set_final(view, true); // the very first step is one of the settled field
    gi_settle(view, 8);
    pixels[0] = gi_read_floats(view);
    pixels[1] = gi_take(rig, &rays);
    field_stats(view, &stats);
    print_grids(&stats);
    hg_view_destroy(view);
    assert_true(stats.grids[0].spacing > 100 && stats.grids[stats.grid_count - 1].spacing < 0.3f);
    for (int i = 0; i < 2; i++) {
        gi_compare(gi_ways[i], pixels[i], path_traced(rig), 2, limits[i]);
        hg_refbuf_unref(pixels[i]);
    }
}

// The same of the dynamic field, once it has come to rest.
static void test_room_in_motion(void **state)
{
    struct rig *rig = *state;
    panel_room(rig);
    struct hg_view *view = gi_open_view(rig, &inside);
    for (int i = 0; i < 150; i++) {
        float eye[3];
        memcpy(eye, inside.eye, sizeof eye);
        eye[0] += i % 2 ? 1e-3f : 0;
        look(view, eye, inside.target);
        step(view);
    }
    const struct hg_refbuf *path = path_traced(rig);
    struct hg_refbuf *seen = read_bytes(view);
    double worst = 0, sum[2] = {0};
    for (int i = 0; i < 16; i++) {
        const int x = i % 4 * 2, y = i / 4 * 2, cells[4] = {x, y, x + 2, y + 2};
        const double want = gi_mean(path, cells), got = gi_mean_of_bytes(seen, cells);
        if (y == 0) // the panel
            continue;
        worst = fmax(worst, fabs(got / want - 1));
        sum[0] += got;
        sum[1] += want;
    }
    print_message("in motion: worst region off by %.3f, all by %.3f\n", worst, sum[0] / sum[1] - 1);
    assert_true(worst < 0.12 && fabs(sum[0] / sum[1] - 1) < 0.06);
    hg_refbuf_unref(seen);
    hg_view_destroy(view);
}

// Grids follow a camera that walks: light is there all the while, and changes by little. New ones
// are placed over some pictures, so none of these casts many rays.
static void test_walk(void **state)
{
    struct rig *rig = *state;
    corridor(rig);
    const struct gi_shot shot = {
        .eye = {0.2f, 1, 3}, .target = {0.2f, 1, -20}, .gi = HG_GI_PROBES, .samples = 4};
    struct hg_view *view = gi_open_view(rig, &shot);
    double before = 0, change = 0, least = 1e9, most = 0;
    struct hg_gi_stats stats;
    uint64_t bytes = 0, rays = 0, cast = 0;
    for (int i = 0; i < 200; i++) {
        // It stands until light has come to its level, then walks 16 m, turning its head.
        const float t = i < 60 ? 0 : (float)(i - 60) / 140;
        const float eye[3] = {0.2f + (i % 2 ? 1e-3f : 0), 1, 3 - 16 * t};
        const float target[3] = {0.2f + 3 * sinf(12 * t), 1, eye[2] - 6};
        look(view, eye, target);
        step(view);
        struct hg_refbuf *pixels = read_bytes(view);
        const double now = gi_mean_of_bytes(pixels, gi_all);
        hg_refbuf_unref(pixels);
        field_stats(view, &stats);
        bytes = stats.bytes > bytes ? stats.bytes : bytes;
        if (i >= 60) {
            change = fmax(change, fabs(now - before));
            least = fmin(least, now);
            most = fmax(most, now);
            cast = stats.rays - rays > cast ? stats.rays - rays : cast;
        }
        rays = stats.rays;
        before = now;
    }
    print_grids(&stats);
    print_message("a walk in a furnace of 1: %.3f to %.3f, from one picture to the next by at most "
                  "%.3f; at most %.1f MiB, %llu rays a picture\n",
        least, most, change, (double)bytes / (1 << 20), (unsigned long long)cast);
    assert_true(stats.grid_count > 2);
    assert_true(least > 0.95 && most < 1.05 && change < 0.02);
    assert_true(bytes < 140u << 20);
    assert_true(cast < MOST_CAST);
    hg_view_destroy(view);
}

// The settled field is a function of scene and camera, whatever was seen before, on any number of
// threads.
static void test_same_bytes(void **state)
{
    struct rig *rig = *state, alone = {0};
    struct hg_error err = {0};
    const struct hg_renderer_params one = {.threads = 1};
    const float aside[3] = {0.5f, 1, 0.2f}, there[3] = {-1, 0.2f, -1};
    struct gi_shot shot = inside;
    shot.gi = HG_GI_RAYS;
    panel_room(rig);
    struct hg_refbuf *first = gi_take(rig, &shot);
    test_ok(hg_renderer_create(&one, &alone.renderer, &err), &err);
    panel_room(&alone);
    struct hg_view *view = gi_open_view(&alone, &shot);
    look(view, aside, there); // at rest elsewhere, and on the way
    gi_settle(view, 1);
    for (int i = 0; i < 8; i++) {
        const float eye[3] = {0.4f - 0.05f * (float)i, 1, 0.2f + 0.1f * (float)i};
        look(view, eye, there);
        step(view);
    }
    look(view, shot.eye, shot.target);
    gi_settle(view, 1);
    struct hg_refbuf *second = gi_read_floats(view);
    hg_view_destroy(view);
    gi_assert_same(first, second);
    rig_finish(&alone);
}

// More cameras than have grids at a time come to rest in turn, each as it would alone.
static void test_many_views(void **state)
{
    enum { VIEWS = 5 }; // HG_GI_CAMERAS have grids
    struct rig *rig = *state;
    struct hg_error err = {0};
    struct hg_view *views[VIEWS];
    struct hg_refbuf *alone = NULL;
    bool all = false;
    panel_room(rig);
    for (int i = 0; i < VIEWS; i++) {
        struct gi_shot shot = inside;
        shot.eye[0] += 0.1f * (float)i;
        shot.target[1] += 0.1f * (float)i;
        shot.samples = 2;
        if (i == VIEWS - 1)
            alone = gi_take(rig, &shot);
        views[i] = gi_open_view(rig, &shot);
    }
    hg_scene_publish(rig->scene); // nothing is left of the field that the last view had alone
    for (int n = 0; n < 4000 && !all; n++) {
        all = true;
        for (int i = 0; i < VIEWS; i++) {
            struct hg_frame_info info;
            test_ok(hg_view_step(views[i], 4, &info, &err), &err);
            all = all && info.settled;
        }
    }
    assert_true(all);
    struct hg_refbuf *beside = gi_read_floats(views[VIEWS - 1]);
    assert_memory_equal(alone->data, beside->data, alone->size);
    hg_refbuf_unref(alone);
    hg_refbuf_unref(beside);
    for (int i = 0; i < VIEWS; i++)
        hg_view_destroy(views[i]);
}

int main(void)
{
    cmocka_set_test_filter(getenv("GI_ONLY")); // NULL: all
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_room),
        cmocka_unit_test(test_room_in_motion),
        cmocka_unit_test(test_walk),
        cmocka_unit_test(test_same_bytes),
        cmocka_unit_test(test_many_views),
    };
    return cmocka_run_group_tests(tests, rig_set_up, tear_down);
}
