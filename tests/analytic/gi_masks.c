// gi_masks.c - light through the holes of alpha masks: a court below a roof of fine black bars,
// every second one a hole, has half of the light that it has without a roof. The sky's comes
// by rays of probes and cells, the sun's by shadow rays of what they meet.
#include <math.h>

#include "tests/analytic/path_rig.h"

enum {
    WIDTH = 96,
    HEIGHT = 64,
    CELL = 32,
    CELLS = WIDTH / CELL * (HEIGHT / CELL),
    PICTURES = 40,
    BARS = 8, // times four of the texture
};

static const float court[2][3] = {{-2, 0, -2}, {2, 3, 2}};

static void make_roof(struct rig *rig)
{
    static const float corners[4][3] = {{-2, 3, -2}, {2, 3, -2}, {2, 3, 2}, {-2, 3, 2}};
    struct hg_material *black = path_rig_lambert(rig, 0);
    struct hg_texture_ref *bars = &black->slots[HG_SLOT_BASE_COLOR];
    black->alpha_mode = HG_ALPHA_MASK;
    black->alpha_cutoff = 0.5f;
    black->double_sided = true;
    bars->texture = rig_bars(rig);
    bars->uv_transform[0] = BARS;
    rig_quad(rig, black, corners);
}

static void make_court(struct rig *rig, bool sunny, bool roof)
{
    static const double above[3] = {0, 10, 0}, down[3] = {0, -1, 0};
    rig_scene(rig);
    struct hg_material *grey = path_rig_lambert(rig, 0.5f);
    for (int i = 0; i < 6; i++)
        if (i != 3)
            rig_face(rig, grey, court, 1, i);
    if (roof)
        make_roof(rig);
    if (sunny) {
        struct hg_light *sun = rig_light(rig, HG_LIGHT_DIRECTIONAL, above, down);
        sun->intensity = 5;
        sun->casts_shadow = true;
    }
    path_rig_environment(rig, sunny ? 0 : 1);
}

// Mean of a wall that the sun does not reach.
static double wall_of(struct rig *rig, enum hg_view_gi gi, bool moves)
{
    static const float target[3] = {-2, 1.5f, 0};
    const struct hg_view_params params = {.width = WIDTH,
        .height = HEIGHT,
        .samples = 8,
        .tonemap = HG_TONEMAP_LINEAR,
        .gi = gi,
        .reflections = HG_REFLECTIONS_AUTO,
        .ao = HG_AO_AUTO};
    struct hg_view *view = path_rig_view(rig, &params);
    float cells[CELLS];
    double sum = 0;
    hg_view_set_final(view, !moves);
    for (int i = moves ? PICTURES - 1 : 0; i >= 0; i--) {
        const float eye[3] = {1.8f, 1.5f + 0.002f * (float)i, 0};
        struct hg_error err = {0};
        struct hg_frame_info info;
        path_rig_look(view, eye, target, 0.5f);
        if (moves)
            test_ok(hg_view_step(view, 1, &info, &err), &err);
        else
            path_rig_settle(view);
    }
    path_rig_cells(view, WIDTH, HEIGHT, CELL, cells);
    for (int i = 0; i < CELLS; i++)
        sum += (double)cells[i] / CELLS;
    hg_view_destroy(view);
    return sum;
}

static void test_half(void **state)
{
    struct rig *rig = *state;
    static const struct {
        const char *what;
        bool sunny, moves;
        enum hg_view_gi gi;
        double most; // off from a half
    } rows[] = {{"sky, probes at rest", false, false, HG_GI_PROBES, 0.025},
        {"sky, in motion", false, true, HG_GI_RAYS, 0.025},
        {"sun, probes at rest", true, false, HG_GI_PROBES, 0.025},
        {"sun, in motion", true, true, HG_GI_RAYS, 0.025}};
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        make_court(rig, rows[i].sunny, false);
        const double open = wall_of(rig, rows[i].gi, rows[i].moves);
        make_court(rig, rows[i].sunny, true);
        const double share = wall_of(rig, rows[i].gi, rows[i].moves) / open;
        print_message("%s: %.4f of %.4f\n", rows[i].what, share, open);
        if (!(open > 0.05 && fabs(share - 0.5) < rows[i].most))
            fail_msg("%s: %g of %g", rows[i].what, share, open);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_half)};
    return cmocka_run_group_tests(tests, rig_set_up, rig_tear_down);
}
