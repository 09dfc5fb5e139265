// open_sky.c - what sees an uneven environment with nothing in the way has its irradiance in
// motion, without noise: closed form is the picture without global illumination.
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/hash.h"
#include "tests/analytic/path_rig.h"

enum { SIDE = 128, CELL = 8, ACROSS = SIDE / CELL, CELLS = ACROSS * ACROSS, PICTURES = 12 };

static struct hg_node *moving; // behind the camera

// Patches of light of many strengths, as in a studio; the brightest are peaks.
static void make_environment(struct rig *rig)
{
    const uint32_t width = 64, height = 32, patch = 4;
    struct hg_environment *e = &rig->scene->environment;
    hg_image_finish(&e->image);
    test_ok(hg_image_create(width, height, HG_PIXEL_RGBA32F, NULL, &e->image), NULL);
    float *p = (float *)(void *)e->image.pixels;
    for (uint32_t i = 0; i < width * height; i++) {
        const uint32_t at = i / width / patch * width + i % width / patch;
        const double strength = (double)(hg_hash_mix(7, at) & 0xffff) / 0xffff;
        for (uint32_t c = 0; c < 4; c++)
            p[4 * i + c] = (float)exp(4 * strength - 3 + 0.3 * c);
    }
    e->kind = HG_ENV_IMAGE;
    e->intensity = 0.1f;
    e->revision++;
}

static void make_scene(struct rig *rig)
{
    static const float low[3] = {-0.5f, -0.5f, -0.5f}, high[3] = {0.5f, 0.5f, 0.5f};
    static const float far_low[3] = {2.9f, 4.9f, 2.9f}, far_high[3] = {3, 5, 3};
    rig_scene(rig);
    struct hg_material *white = path_rig_lambert(rig, 0.8f);
    path_rig_box(rig, white, low, high);
    path_rig_box(rig, white, far_low, far_high);
    moving = (struct hg_node *)rig->scene->objects[HG_OBJECT_NODE].items[1];
    make_environment(rig);
}

// number: of the picture; the camera comes to the same place with 0.
static void show(struct rig *rig, struct hg_view *view, int number, bool moves)
{
    static const float target[3];
    const float eye[3] = {1 + 0.002f * (float)number, 0.9f, 1.2f};
    struct hg_error err = {0};
    struct hg_frame_info info;
    if (moves) {
        moving->translation[1] = 0.01f * (float)number;
        hg_scene_touch(rig->scene, &moving->head);
        hg_scene_publish(rig->scene);
    }
    path_rig_look(view, eye, target, 0.7f);
    test_ok(hg_view_step(view, 1, &info, &err), &err);
}

static void render(struct rig *rig, enum hg_view_gi gi, bool moves, float cells[CELLS])
{
    const struct hg_view_params params = {.width = SIDE,
        .height = SIDE,
        .samples = 8,
        .tonemap = HG_TONEMAP_LINEAR,
        .exposure_ev = 3,
        .gi = gi,
        .reflections = HG_REFLECTIONS_AUTO,
        .ao = HG_AO_AUTO,
        .background = HG_BACKGROUND_COLOR};
    struct hg_view *view = path_rig_view(rig, &params);
    hg_view_set_final(view, false);
    for (int i = PICTURES - 1; i >= 0; i--)
        show(rig, view, i, moves);
    path_rig_cells(view, SIDE, SIDE, CELL, cells);
    hg_view_destroy(view);
}

// Of cells that lie on one face of the box: the mean and the largest difference.
static void expect_even(
    const char *what, const float cells[CELLS], const float truth[CELLS], const double most[2])
{
    double sum = 0, worst = 0;
    int count = 0;
    for (int y = 1; y + 1 < ACROSS; y++)
        for (int x = 1; x + 1 < ACROSS; x++) {
            const int i = y * ACROSS + x, around[] = {i - 1, i + 1, i - ACROSS, i + ACROSS};
            bool inside = truth[i] > 0.02f;
            for (int k = 0; k < 4; k++)
                inside &= fabsf(truth[around[k]] / truth[i] - 1) < 0.02f;
            if (!inside)
                continue;
            const double off = fabs((double)cells[i] / (double)truth[i] - 1);
            sum += off;
            worst = fmax(worst, off);
            count++;
        }
    print_message("%s: %d cells, mean %.4f, worst %.4f\n", what, count, sum / count, worst);
    assert_true(count > 20);
    if (!(sum < most[0] * count && worst < most[1]))
        fail_msg("%s: mean %g, worst %g", what, sum / count, worst);
}

static void test_even(void **state)
{
    struct rig *rig = *state;
    float truth[CELLS], cells[CELLS];
    static const struct {
        const char *what;
        enum hg_view_gi gi;
        bool moves;
        double most[2];
    } rows[] = {{"probes", HG_GI_PROBES, false, {0.01, 0.03}},
        {"rays", HG_GI_RAYS, false, {0.002, 0.01}},
        {"rays, in a scene that changes", HG_GI_RAYS, true, {0.003, 0.02}}};
    make_scene(rig);
    render(rig, HG_GI_NONE, false, truth);
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        render(rig, rows[i].gi, rows[i].moves, cells);
        expect_even(rows[i].what, cells, truth, rows[i].most);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_even)};
    return cmocka_run_group_tests(tests, rig_set_up, rig_tear_down);
}
