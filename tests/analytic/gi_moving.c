// gi_moving.c - light in motion in a scene where something moves all the while: what stands still
// has hardly more error than where nothing moves.
#include <math.h>
#include <string.h>

#include "tests/analytic/path_rig.h"

enum {
    WIDTH = 96,
    HEIGHT = 64,
    CELL = 8,
    CELLS = WIDTH / CELL * (HEIGHT / CELL),
    PICTURES = 60,
    LAST = 8
};

static struct hg_node *moving; // behind the camera

// A deep court without a roof: the sun lights the top of one wall, all else is lit by that.
static void make_court(struct rig *rig)
{
    static const float box[2][3] = {{-2, 0, -2}, {2, 4, 2}};
    static const double above[3] = {0, 10, 0}, slanted[3] = {0.75, -0.65, 0};
    static const float low[3] = {1.5f, 0.2f, 1.5f}, high[3] = {1.6f, 0.3f, 1.6f};
    rig_scene(rig);
    struct hg_material *white = path_rig_lambert(rig, 0.8f);
    path_rig_box(rig, white, low, high);
    moving = (struct hg_node *)rig->scene->objects[HG_OBJECT_NODE].items[0];
    for (int i = 0; i < 6; i++)
        if (i != 3)
            rig_face(rig, white, box, 1, i);
    struct hg_light *sun = rig_light(rig, HG_LIGHT_DIRECTIONAL, above, slanted);
    sun->intensity = 6;
    sun->casts_shadow = true;
    path_rig_environment(rig, 0);
}

static const struct hg_view_params params = {.width = WIDTH,
    .height = HEIGHT,
    .samples = 8,
    .tonemap = HG_TONEMAP_LINEAR,
    .gi = HG_GI_RAYS,
    .reflections = HG_REFLECTIONS_AUTO,
    .ao = HG_AO_AUTO};

static void look(struct hg_view *view, int number)
{
    static const float target[3] = {-1, 0.8f, -2};
    const float eye[3] = {1.2f + 0.002f * (float)(number & 1), 1.2f, 1.4f};
    path_rig_look(view, eye, target, 0.8f);
}

static void settle(struct rig *rig, float cells[CELLS])
{
    struct hg_view *view = path_rig_view(rig, &params);
    look(view, 1);
    path_rig_settle(view);
    path_rig_cells(view, WIDTH, HEIGHT, CELL, cells);
    hg_view_destroy(view);
}

// Mean relative difference to the settled picture, over the last pictures.
static double error_in_motion(struct rig *rig, bool moves, const float truth[CELLS])
{
    struct hg_view *view = path_rig_view(rig, &params);
    double sum = 0;
    hg_view_set_final(view, false);
    for (int i = 0; i < PICTURES; i++) {
        struct hg_error err = {0};
        struct hg_frame_info info;
        float cells[CELLS];
        if (moves) {
            moving->translation[1] = 0.02f * (float)i;
            hg_scene_touch(rig->scene, &moving->head);
            hg_scene_publish(rig->scene);
        }
        look(view, i);
        test_ok(hg_view_step(view, 1, &info, &err), &err);
        path_rig_cells(view, WIDTH, HEIGHT, CELL, cells);
        for (int k = 0; k < CELLS && i >= PICTURES - LAST; k++)
            sum += fabs((double)cells[k] / (double)truth[k] - 1) / (CELLS * LAST);
    }
    hg_view_destroy(view);
    return sum;
}

static void test_holds_still(void **state)
{
    struct rig *rig = *state;
    float truth[CELLS];
    make_court(rig);
    settle(rig, truth);
    const double still = error_in_motion(rig, false, truth);
    const double moves = error_in_motion(rig, true, truth);
    print_message("off by %.4f, %.4f where a body moves\n", still, moves);
    if (!(moves < 1.3 * still))
        fail_msg("off by %g, %g where a body moves", still, moves);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_holds_still)};
    return cmocka_run_group_tests(tests, rig_set_up, rig_tear_down);
}
