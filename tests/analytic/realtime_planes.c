// realtime_planes.c - planes of real-time pictures: those of path-traced ones to the bit where both
// modes see the same surfaces, and what the picture shows where they do not.
#include <math.h>
#include <string.h>

#include "base/alloc.h"
#include "renderer/internal.h"
#include "tests/analytic/path_rig.h"

enum { SIDE = 48 };

#define BIT(plane) (1u << HG_PLANE_##plane)

static const uint32_t all = BIT(ALBEDO) | BIT(NORMAL) | BIT(GEOMETRIC_NORMAL) | BIT(DEPTH) |
                            BIT(POSITION) | BIT(EMISSION) | BIT(MOTION) | BIT(OBJECT) |
                            BIT(MATERIAL) | BIT(SAMPLES) | BIT(DRAWS);

static const struct hg_view_params defaults = {
    .width = SIDE, .height = SIDE, .tonemap = HG_TONEMAP_LINEAR, .samples = 16, .seed = 7};

static const float *floats(const struct hg_refbuf *b)
{
    return (const float *)(const void *)b->data;
}

static struct hg_view *settled(
    struct rig *rig, const struct hg_view_params *params, const struct hg_view_camera *camera)
{
    struct hg_view *view = path_rig_view(rig, params);
    path_rig_set_camera(view, camera);
    path_rig_settle(view);
    return view;
}

static const struct hg_view_camera moving = {.eye = {0.5f, 1.2f, 3.5f},
    .target = {0, 0.5f, 0},
    .up = {0, 1, 0},
    .vfov_rad = 0.8f,
    .moves = true,
    .next_eye = {0.6f, 1.2f, 3.4f},
    .next_target = {0, 0.5f, 0}};

// A pane that lets half of what is behind it be seen, and a ball that slides.
static void put_things(struct rig *rig)
{
    const float pane[4][3] = {
        {-1, 0.2f, 1.2f}, {-0.2f, 0.2f, 1.2f}, {-0.2f, 1, 1.2f}, {-1, 1, 1.2f}};
    const float center[3] = {0, 0, 0}, slide[2][3] = {{-0.6f, 0.3f, 0.3f}, {0.4f, 0.3f, 0.3f}};
    struct hg_material *m = rig_material(rig);
    m->alpha_mode = HG_ALPHA_BLEND;
    m->base_color[1] = 0.3f;
    m->base_color[3] = 0.5f;
    m->double_sided = true;
    rig_quad(rig, m, pane);
    struct hg_node *ball = rig_sphere(rig, rig_material(rig), center, 0.3f, 24);
    path_rig_animate(rig, ball, HG_ANIM_TRANSLATION, 2, &slide[0][0]);
    path_rig_pose(rig, 0.5);
}

static void fill(struct rig *rig)
{
    path_rig_room(rig);
    put_things(rig);
}

static void expect_same(struct hg_view *a, struct hg_view *b, uint32_t planes)
{
    for (uint32_t i = 0; i < HG_PLANE_COUNT; i++) {
        if ((planes >> i & 1u) == 0)
            continue;
        struct hg_refbuf *x = path_rig_plane(a, (enum hg_plane)i);
        struct hg_refbuf *y = path_rig_plane(b, (enum hg_plane)i);
        double sum = 0;
        for (size_t k = 0; k < x->size / 4; k++)
            sum += fabs((double)floats(x)[k]);
        print_message("%s: sum %.3f\n", hg_plane_name((enum hg_plane)i), sum);
        assert_true(sum > 1);
        assert_int_equal(x->size, y->size);
        assert_memory_equal(x->data, y->data, x->size);
        hg_refbuf_unref(x);
        hg_refbuf_unref(y);
    }
}

static void test_as_paths(void **state)
{
    struct rig *rig = *state;
    struct hg_view_params params = defaults;
    params.planes = all;
    fill(rig);
    struct hg_view *drawn = settled(rig, &params, &moving), *again;
    params.mode = HG_MODE_PATH;
    struct hg_view *traced = settled(rig, &params, &moving);
    expect_same(drawn, traced, all);
    params.mode = HG_MODE_REALTIME;
    again = settled(rig, &params, &moving);
    expect_same(drawn, again, all);
    hg_view_destroy(again);
    hg_view_destroy(traced);
    hg_view_destroy(drawn);
}

// Before much background paths branch at what the camera sees; the first branch tells the planes.
static void test_before_background(void **state)
{
    struct rig *rig = *state;
    struct hg_view_params params = defaults;
    const uint32_t planes = all & ~BIT(EMISSION);
    params.planes = all;
    rig_scene(rig);
    path_rig_environment(rig, 0.2f);
    put_things(rig);
    struct hg_view *drawn = settled(rig, &params, &moving);
    params.mode = HG_MODE_PATH;
    struct hg_view *traced = settled(rig, &params, &moving);
    assert_true(path_rig_report(traced).path.branch_bits > 0);
    expect_same(drawn, traced, planes);
    struct hg_refbuf *light = path_rig_plane(drawn, HG_PLANE_EMISSION);
    for (size_t i = 0; i < light->size / 4; i++) // of the environment, wherever it is seen
        assert_true((double)floats(light)[i] < 0.2 * 1.00001);
    hg_refbuf_unref(light);
    hg_view_destroy(traced);
    hg_view_destroy(drawn);
}

// The picture itself is the one without planes, to the bit.
static void test_picture_stays(void **state)
{
    struct rig *rig = *state;
    struct hg_error err = {0};
    struct hg_refbuf *pixels[2];
    struct hg_view_params params = defaults;
    fill(rig);
    for (int i = 0; i < 2; i++) {
        params.planes = i == 0 ? 0 : all;
        struct hg_view *view = settled(rig, &params, &moving);
        test_ok(hg_view_read_pixels(view, HG_PIXEL_RGBA32F, &pixels[i], &err), &err);
        hg_view_destroy(view);
    }
    assert_memory_equal(pixels[0]->data, pixels[1]->data, pixels[0]->size);
    hg_refbuf_unref(pixels[0]);
    hg_refbuf_unref(pixels[1]);
}

static float at(const struct hg_refbuf *b, uint32_t x, uint32_t y)
{
    return floats(b)[y * SIDE + x];
}

static bool inside(const struct hg_refbuf *objects, uint32_t x, uint32_t y)
{
    for (uint32_t i = 0; i < 25; i++)
        if (at(objects, x + i % 5 - 2, y + i / 5 - 2) != at(objects, x, y))
            return false;
    return true;
}

// Away from edges planes tell what a pick of the picture's visibility buffer tells. Of a wall with
// one side nothing is seen from behind.
static void test_as_picked(void **state)
{
    struct rig *rig = *state;
    const float wall[4][3] = {{0.2f, 0, 1}, {1.2f, 0, 1}, {1.2f, 1, 1}, {0.2f, 1, 1}};
    const float turned[4][3] = {{-1, 0, 1}, {-1, 1, 1}, {-0.2f, 1, 1}, {-0.2f, 0, 1}};
    struct hg_view_params params = defaults;
    struct hg_error err = {0};
    uint32_t compared = 0, through = 0;
    path_rig_room(rig);
    rig_quad(rig, rig_material(rig), wall);
    const uint64_t hidden = rig_quad(rig, rig_material(rig), turned)->head.id;
    params.planes = BIT(OBJECT) | BIT(POSITION) | BIT(GEOMETRIC_NORMAL) | BIT(DEPTH);
    struct hg_view *view = settled(rig, &params, &moving);
    struct hg_refbuf *objects = path_rig_plane(view, HG_PLANE_OBJECT);
    struct hg_refbuf *places = path_rig_plane(view, HG_PLANE_POSITION);
    params.mode = HG_MODE_PATH;
    struct hg_view *traced = settled(rig, &params, &moving);
    struct hg_refbuf *both = path_rig_plane(traced, HG_PLANE_OBJECT);
    for (uint32_t y = 2; y + 2 < SIDE; y++)
        for (uint32_t x = 2; x + 2 < SIDE; x++) {
            struct hg_pick pick;
            through += at(both, x, y) == (float)(hidden + 1);
            assert_true(at(objects, x, y) != (float)(hidden + 1));
            if (!inside(objects, x, y) || at(objects, x, y) == 0)
                continue;
            test_ok(hg_view_pick(view, x, y, &pick, &err), &err);
            assert_true(pick.hit);
            assert_true((float)(pick.node + 1) == at(objects, x, y));
            for (int c = 0; c < 3; c++) {
                const float *p = floats(places) + (y * SIDE + x) * 3;
                assert_true(fabs((double)p[c] - (double)pick.position[c]) < 0.05);
            }
            compared++;
        }
    print_message("%u pixels as picked, %u of the wall behind\n", compared, through);
    assert_true(compared > SIDE * SIDE / 3 && through > 20);
    hg_refbuf_unref(objects);
    hg_refbuf_unref(places);
    hg_refbuf_unref(both);
    hg_view_destroy(traced);
    hg_view_destroy(view);
}

// A view that was looked through before, step by step, has the planes of one that was not.
static void test_after_motion(void **state)
{
    struct rig *rig = *state;
    struct hg_view_params params = defaults;
    struct hg_view_camera other = moving;
    struct hg_error err = {0};
    struct hg_frame_info info = {0};
    struct hg_refbuf *none;
    params.planes = all;
    fill(rig);
    other.eye[0] = -0.5f;
    struct hg_view *view = settled(rig, &params, &moving);
    hg_view_set_final(view, false);
    path_rig_set_camera(view, &other);
    test_ok(hg_view_step(view, 1, &info, &err), &err);
    assert_false(info.settled);
    assert_int_equal(hg_view_read_plane(view, HG_PLANE_DEPTH, &none, &err), HG_E_STATE);
    path_rig_set_camera(view, &moving);
    test_ok(hg_view_step(view, 1, &info, &err), &err);
    path_rig_set_camera(view, &other);
    path_rig_settle(view);
    struct hg_view *fresh = settled(rig, &params, &other);
    expect_same(view, fresh, all);
    hg_view_destroy(fresh);
    hg_view_destroy(view);
}

// Another view of the scene poses it at times of its own shutter meanwhile: what is traced of this
// one stays where it is.
static void test_beside_shutter(void **state)
{
    struct rig *rig = *state;
    struct hg_view_params params = defaults, open = defaults;
    struct hg_error err = {0};
    struct hg_frame_info info = {0}, none;
    uint32_t steps = 0;
    params.planes = all;
    params.samples = 256;
    fill(rig);
    struct hg_view *alone = settled(rig, &params, &moving);
    open.mode = HG_MODE_PATH;
    open.samples = 4096;
    open.shutter_open = 0.5f;
    open.shutter_close = 1.0f;
    struct hg_view *other = path_rig_view(rig, &open), *view = path_rig_view(rig, &params);
    path_rig_set_camera(other, &moving);
    path_rig_set_camera(view, &moving);
    while (!info.settled && steps < 10000) {
        test_ok(hg_view_step(view, 16, &info, &err), &err);
        steps += path_rig_report(view).traces;
        test_ok(hg_view_step(other, 1, &none, &err), &err);
    }
    assert_true(info.settled && steps > 4);
    expect_same(alone, view, all);
    hg_view_destroy(view);
    hg_view_destroy(other);
    hg_view_destroy(alone);
}

static void test_refused(void **state)
{
    struct rig *rig = *state;
    static const uint32_t light[] = {HG_PLANE_DIRECT_DIFFUSE, HG_PLANE_INDIRECT_TRANSMISSION,
        HG_PLANE_VARIANCE, HG_PLANE_LIGHT_GROUPS, HG_PLANE_NOISY};
    struct hg_view_params params = defaults;
    struct hg_refbuf *none;
    struct hg_error err = {0};
    path_rig_room(rig);
    params.planes = BIT(DEPTH);
    struct hg_view *view = settled(rig, &params, &moving);
    assert_int_equal(hg_view_read_plane(view, HG_PLANE_COLOR, &none, &err), HG_E_STATE);
    assert_int_equal(hg_view_read_plane(view, HG_PLANE_VARIANCE, &none, &err), HG_E_STATE);
    assert_int_equal(hg_view_read_plane(view, HG_PLANE_NORMAL, &none, &err), HG_E_STATE);
    for (size_t i = 0; i < sizeof light / sizeof *light; i++) {
        params.planes = 1u << light[i] | BIT(DEPTH);
        assert_int_equal(hg_view_set_params(view, &params, &err), HG_E_UNSUPPORTED);
        assert_non_null(strstr(err.reason, hg_plane_name((enum hg_plane)light[i])));
    }
    hg_view_destroy(view);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_as_paths),
        cmocka_unit_test(test_before_background),
        cmocka_unit_test(test_picture_stays),
        cmocka_unit_test(test_as_picked),
        cmocka_unit_test(test_after_motion),
        cmocka_unit_test(test_beside_shutter),
        cmocka_unit_test(test_refused),
    };
    return cmocka_run_group_tests(tests, rig_set_up, rig_tear_down);
}
