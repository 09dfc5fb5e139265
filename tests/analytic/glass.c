// glass.c - what smooth glass shows of a closed room: a ball, a pane and a thin-walled bubble,
// against path tracing, under a sky that is brighter than the room and must not be seen.
#include <math.h>

#include "renderer/internal.h"
#include "tests/analytic/gi_rig.h"

enum { COLUMNS = 8, ROWS = 6 };

static const float hall_box[2][3] = {{-2, 0, -3}, {2, 3, 3}};

static struct hg_material *glass(struct rig *rig, float thickness)
{
    struct hg_material *m = rig_material(rig);
    m->transmission = 1;
    m->roughness = 0;
    m->volume.thickness = thickness;
    m->double_sided = true;
    return m;
}

// Walls of six colours that shine a little.
static void hall(struct rig *rig)
{
    static const float colors[6][3] = {{0.8f, 0.1f, 0.1f}, {0.1f, 0.7f, 0.1f}, {0.5f, 0.5f, 0.1f},
        {0.6f, 0.6f, 0.6f}, {0.1f, 0.1f, 0.8f}, {0.5f, 0.1f, 0.5f}};
    rig_scene(rig);
    gi_sky(rig, 4);
    for (int i = 0; i < 6; i++) {
        struct hg_material *m = rig_material(rig);
        for (int c = 0; c < 3; c++) {
            m->base_color[c] = colors[i][c];
            m->emissive[c] = 0.5f * colors[i][c];
        }
        rig_face(rig, m, hall_box, 1, i);
    }
}

static void ball(struct rig *rig)
{
    hall(rig);
    rig_sphere(rig, glass(rig, 1.8f), (const float[3]){0, 1.4f, -0.4f}, 0.9f, 24);
}

static void pane(struct rig *rig)
{
    hall(rig);
    const float corners[4][3] = {
        {-1.2f, 0.4f, -0.2f}, {1.2f, 0.4f, 0.4f}, {1.2f, 2.4f, 0.4f}, {-1.2f, 2.4f, -0.2f}};
    rig_quad(rig, glass(rig, 0), corners);
}

static void bubble(struct rig *rig)
{
    hall(rig);
    rig_sphere(rig, glass(rig, 0), (const float[3]){0, 1.4f, -0.4f}, 0.9f, 24);
}

// --- pictures ------------------------------------------------------------------------------------

static const struct gi_shot shot = {
    .eye = {0.4f, 1.5f, 2.4f}, .target = {0, 1.4f, -3}, .samples = 4};

static struct hg_refbuf *take(struct rig *rig, enum hg_view_gi gi, enum hg_render_mode mode)
{
    struct gi_shot with = shot;
    with.gi = gi;
    with.mode = mode;
    with.samples = mode == HG_MODE_PATH ? 64 : 4;
    return gi_take(rig, &with);
}

struct error {
    double worst, mean; // of means of COLUMNS x ROWS regions, over the mean of the picture
    double middle;      // of pixels of the middle of the picture, likewise
};

static struct error compare(
    const char *name, const struct hg_refbuf *got, const struct hg_refbuf *want)
{
    const float *a = (const float *)(const void *)got->data;
    const float *b = (const float *)(const void *)want->data;
    double off[ROWS * COLUMNS * 3] = {0}, all = 0;
    struct error e = {0};
    for (int i = 0; i < GI_WIDTH * GI_HEIGHT; i++)
        for (int c = 0; c < 3; c++) {
            const int x = i % GI_WIDTH * COLUMNS / GI_WIDTH, y = i / GI_WIDTH * ROWS / GI_HEIGHT;
            off[(y * COLUMNS + x) * 3 + c] += (double)(a[4 * i + c] - b[4 * i + c]);
            all += (double)b[4 * i + c];
            if (x >= 2 && x < COLUMNS - 2 && y >= 1 && y < ROWS - 1)
                e.middle += fabs((double)(a[4 * i + c] - b[4 * i + c]));
        }
    e.middle *= ROWS * COLUMNS / (all * (ROWS - 2) * (COLUMNS - 4));
    for (int i = 0; i < ROWS * COLUMNS * 3; i++) {
        e.worst = fmax(e.worst, fabs(off[i]) * ROWS * COLUMNS * 3 / all);
        e.mean += fabs(off[i]) / all;
    }
    print_message(
        "%s: regions off by %.3f in the mean, %.3f at worst, pixels of the middle by %.3f\n", name,
        e.mean, e.worst, e.middle);
    return e;
}

// --- tests ---------------------------------------------------------------------------------------

// At rest paths bring what glass shows: a ball has the room inverted, which layers by themselves do
// not know (worst region 0.178).
static void test_rest(void **state)
{
    struct rig *rig = *state;
    static const struct {
        const char *name;
        void (*make)(struct rig *);
        double worst, middle;
    } rooms[] = {
        {"ball", ball, 0.14, 0.09}, {"pane", pane, 0.1, 0.07}, {"bubble", bubble, 0.2, 0.09}};
    for (size_t i = 0; i < sizeof rooms / sizeof *rooms; i++) {
        rooms[i].make(rig);
        struct hg_refbuf *truth = take(rig, HG_GI_NONE, HG_MODE_PATH);
        struct hg_refbuf *rays = take(rig, HG_GI_RAYS, HG_MODE_REALTIME);
        const struct error e = compare(rooms[i].name, rays, truth);
        assert_true(e.worst < rooms[i].worst && e.middle < rooms[i].middle);
        hg_refbuf_unref(truth);
        hg_refbuf_unref(rays);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_rest),
    };
    return cmocka_run_group_tests(tests, rig_set_up, rig_tear_down);
}
