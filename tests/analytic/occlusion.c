// occlusion.c - light where things meet in pictures in motion: with ambient occlusion, and with
// what rays gather, they are nearer to path tracing, and nothing else is changed.
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "tests/analytic/path_rig.h"

enum { WIDTH = 192, HEIGHT = 128, CELL = 16, CELLS = WIDTH / CELL * (HEIGHT / CELL) };

static const float target[3] = {0, 0.2f, 0};
static const float outside[3] = {1.2f, 1.6f, 2.2f}, in_court[3] = {0.4f, 1.7f, 1.3f};
static const float *eye_at = outside;

static struct hg_view_params params_of(enum hg_view_ao ao)
{
    return (struct hg_view_params){.width = WIDTH,
        .height = HEIGHT,
        .samples = 8,
        .tonemap = HG_TONEMAP_LINEAR,
        .gi = HG_GI_PROBES,
        .exposure_ev = -1,
        .ao = ao};
}

// Boxes that are small beside the spacing of probes, on a wide floor.
static void make_boxes_on(struct rig *rig, float half)
{
    rig_scene(rig);
    struct hg_material *grey = path_rig_lambert(rig, 0.5f);
    path_rig_floor(rig, grey, half);
    for (int i = 0; i < 4; i++) {
        const float x = -0.9f + 0.6f * (float)i, z = -0.2f * (float)(i % 2);
        const float low[3] = {x, 0, z}, high[3] = {x + 0.4f, 0.5f, z + 0.4f};
        path_rig_box(rig, grey, low, high);
    }
    path_rig_environment(rig, 1);
}

static void make_boxes(struct rig *rig)
{
    make_boxes_on(rig, 12);
}

// The same in a closed room with a shining panel, where probes know all about the corners.
static void make_room(struct rig *rig)
{
    static const float box[2][3] = {{-3, -0.01f, -3}, {3, 3, 3}};
    static const float panel[4][3] = {
        {-0.5f, 2.95f, 0.5f}, {-0.5f, 2.95f, -0.5f}, {0.5f, 2.95f, -0.5f}, {0.5f, 2.95f, 0.5f}};
    make_boxes_on(rig, 3);
    path_rig_environment(rig, 0);
    struct hg_material *wall = path_rig_lambert(rig, 0.6f);
    for (int i = 0; i < 6; i++)
        rig_face(rig, wall, box, 1, i);
    struct hg_material *light = path_rig_lambert(rig, 0.0f);
    light->emissive[0] = light->emissive[1] = light->emissive[2] = 20.0f;
    rig_quad(rig, light, panel);
}

static void look(struct hg_view *view, int number)
{
    const float eye[3] = {eye_at[0] + 0.001f * (float)number, eye_at[1], eye_at[2]};
    path_rig_look(view, eye, target, 0.7f);
}

static void settle(struct hg_view *view)
{
    struct hg_error err = {0};
    struct hg_frame_info info = {0};
    look(view, 0);
    for (int i = 0; i < 100000 && !info.settled; i++)
        test_ok(hg_view_step(view, 16, &info, &err), &err);
    assert_true(info.settled);
}

// A picture in motion, once the field is there.
static void move(struct rig *rig, const struct hg_view_params *params, float cells[CELLS])
{
    struct hg_error err = {0};
    struct hg_frame_info info;
    struct hg_view *view = path_rig_view(rig, params);
    hg_view_set_final(view, false);
    for (int i = 48; i >= 0; i--) {
        look(view, i);
        test_ok(hg_view_step(view, 1, &info, &err), &err);
    }
    assert_false(info.settled);
    path_rig_cells(view, WIDTH, HEIGHT, CELL, cells);
    hg_view_destroy(view);
}

static void path_trace(struct rig *rig, float cells[CELLS])
{
    struct hg_view_params params = params_of(HG_AO_AUTO);
    params.mode = HG_MODE_PATH;
    params.gi = HG_GI_NONE;
    params.samples = 32; // of 256 pixels each cell
    struct hg_view *view = path_rig_view(rig, &params);
    settle(view);
    path_rig_cells(view, WIDTH, HEIGHT, CELL, cells);
    hg_view_destroy(view);
}

static double error_of(const float cells[CELLS], const float truth[CELLS], double *worst)
{
    double sum = 0;
    *worst = 0;
    for (int i = 0; i < CELLS; i++) {
        const double off = fabs((double)cells[i] / (double)truth[i] - 1);
        sum += off / CELLS;
        *worst = fmax(*worst, off);
    }
    return sum;
}

// Small things that probes do not see, in the open: half of the error. In a room that probes know
// it must not get worse.
static void test_nearer_to_paths(void **state)
{
    struct rig *rig = *state;
    float truth[CELLS], with[CELLS], without[CELLS];
    double worst[2];
    for (int i = 0; i < 2; i++) {
        (i ? make_room : make_boxes)(rig);
        path_trace(rig, truth);
        const struct hg_view_params on = params_of(HG_AO_AUTO), off = params_of(HG_AO_NONE);
        move(rig, &on, with);
        move(rig, &off, without);
        const double a = error_of(with, truth, &worst[0]), b = error_of(without, truth, &worst[1]);
        print_message("mean %g, worst %g with, %g, %g without\n", a, worst[0], b, worst[1]);
        const double most = i ? 1.0 : 0.7;
        if (!(a < most * b && worst[0] < most * worst[1]))
            fail_msg("mean %g, worst %g with, %g, %g without", a, worst[0], b, worst[1]);
    }
}

// Rays know what probes and the depth of the picture do not: the same room, and the boxes in the
// open.
static void test_gathered_is_nearer(void **state)
{
    struct rig *rig = *state;
    float truth[CELLS], cells[2][CELLS];
    double worst[2], mean[2];
    for (int i = 0; i < 2; i++) {
        (i ? make_room : make_boxes)(rig);
        path_trace(rig, truth);
        for (int k = 0; k < 2; k++) {
            struct hg_view_params params = params_of(HG_AO_AUTO);
            params.gi = k ? HG_GI_RAYS : HG_GI_PROBES;
            params.reflections = HG_REFLECTIONS_AUTO;
            move(rig, &params, cells[k]);
            mean[k] = error_of(cells[k], truth, &worst[k]);
        }
        print_message("gathered: mean %g, worst %g with, %g, %g without\n", mean[1], worst[1],
            mean[0], worst[0]);
        if (!(mean[1] < (i ? 0.8 : 0.7) * mean[0]))
            fail_msg("mean %g gathered, %g not", mean[1], mean[0]);
    }
}

// A court of black walls with a floor of rough metal. What the floor sees of the sky is 1; behind
// the walls the sky is eight times as bright.
static void make_court(struct rig *rig)
{
    static const float box[2][3] = {{-1.5f, -0.01f, -1.5f}, {1.5f, 2, 1.5f}};
    const uint32_t width = 64, height = 32;
    rig_scene(rig);
    struct hg_material *metal = path_rig_lambert(rig, 0.9f);
    metal->metallic = 1;
    metal->roughness = 0.6f;
    path_rig_floor(rig, metal, 1.5f);
    struct hg_material *wall = path_rig_lambert(rig, 0);
    wall->double_sided = true;
    for (int i = 0; i < 6; i++)
        if (i / 2 != 1)
            rig_face(rig, wall, box, 1, i);
    struct hg_environment *e = &rig->scene->environment;
    hg_image_finish(&e->image);
    test_ok(hg_image_create(width, height, HG_PIXEL_RGBA32F, NULL, &e->image), NULL);
    float *p = (float *)(void *)e->image.pixels;
    for (uint32_t i = 0; i < width * height * 4; i++) // from 28 degrees on: the walls reach to 33
        p[i] = i / 4 / width < height * 31 / 90 ? 1 : 8;
    e->kind = HG_ENV_IMAGE;
    e->intensity = 1;
    e->revision++;
}

static double light_of(const float cells[CELLS])
{
    double sum = 0;
    for (int i = 0; i < CELLS; i++)
        sum += (double)cells[i] / CELLS;
    return sum;
}

// What a rough surface mirrors of a sky that is not the same everywhere is what it sees of it.
static void test_mirrored_sky(void **state)
{
    struct rig *rig = *state;
    float truth[CELLS], cells[CELLS];
    make_court(rig);
    eye_at = in_court;
    path_trace(rig, truth);
    struct hg_view_params params = params_of(HG_AO_AUTO);
    params.gi = HG_GI_RAYS;
    params.reflections = HG_REFLECTIONS_AUTO;
    move(rig, &params, cells);
    eye_at = outside;
    const double ratio = light_of(cells) / light_of(truth);
    print_message("mirrored sky: %.3f of path mode\n", ratio);
    assert_true(fabs(ratio - 1) < 0.15);
}

// Settled pictures do not know of it, and no picture without light from probes does.
static void test_elsewhere(void **state)
{
    struct rig *rig = *state;
    struct hg_error err = {0};
    struct hg_refbuf *pictures[2];
    make_boxes(rig);
    for (int i = 0; i < 2; i++) {
        const struct hg_view_params params = params_of(i ? HG_AO_NONE : HG_AO_AUTO);
        struct hg_view *view = path_rig_view(rig, &params);
        settle(view);
        test_ok(hg_view_read_pixels(view, HG_PIXEL_RGBA8, &pictures[i], &err), &err);
        hg_view_destroy(view);
    }
    assert_memory_equal(pictures[0]->data, pictures[1]->data, pictures[0]->size);
    float cells[2][CELLS];
    for (int i = 0; i < 2; i++) {
        hg_refbuf_unref(pictures[i]);
        struct hg_view_params params = params_of(i ? HG_AO_NONE : HG_AO_AUTO);
        params.gi = HG_GI_NONE;
        move(rig, &params, cells[i]);
    }
    assert_memory_equal(cells[0], cells[1], sizeof cells[0]);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_nearer_to_paths),
        cmocka_unit_test(test_gathered_is_nearer), cmocka_unit_test(test_mirrored_sky),
        cmocka_unit_test(test_elsewhere)};
    return cmocka_run_group_tests(tests, rig_set_up, rig_tear_down);
}
