// Automatic exposure through the facade: one value for every mode, size, seed and way to get there,
// that puts a grey card where it belongs.
#include <math.h>
#include <string.h>

#include "base/clock.h"
#include "renderer/camera/exposure.h"
#include "renderer/frame/exposure/meter.h"
#include "tests/analytic/path_rig.h"

static const float eye[3] = {0.5f, 2, 3}, target[3] = {0, 0, 0};

// A grey card under an environment, of which it shows nothing else.
static void make_card(struct rig *rig, float radiance)
{
    rig_scene(rig);
    path_rig_floor(rig, path_rig_lambert(rig, 0.18f), 20);
    path_rig_environment(rig, radiance);
}

static struct hg_frame_info settle(struct hg_view *view, uint32_t samples)
{
    struct hg_error err = {0};
    struct hg_frame_info info = {0};
    for (int i = 0; i < 100000 && !info.settled; i++)
        test_ok(hg_view_step(view, samples, &info, &err), &err);
    assert_true(info.settled);
    return info;
}

static struct hg_view *look(struct rig *rig, const struct hg_view_params *params)
{
    struct hg_view *view = path_rig_view(rig, params);
    const float down[3] = {0, -0.2f, 0};
    path_rig_look(view, eye, down, 0.6f);
    return view;
}

static struct hg_refbuf *pixels_of(struct hg_view *view, enum hg_pixel_format format)
{
    struct hg_error err = {0};
    struct hg_refbuf *out;
    test_ok(hg_view_read_pixels(view, format, &out, &err), &err);
    return out;
}

static const struct hg_view_params card_params = {
    .width = 48, .height = 32, .samples = 64, .exposure_mode = HG_EXPOSURE_AUTO};

// Light of 2^n gives -n stops, and the card the radiance of 0.18.
static void test_card(void **state)
{
    struct rig *rig = *state;
    static const float light[] = {1.0f / 64, 1.0f, 300.0f};
    for (int i = 0; i < 6; i++) {
        struct hg_view_params params = card_params;
        const float radiance = light[i / 2];
        params.mode = i % 2 ? HG_MODE_PATH : HG_MODE_REALTIME;
        make_card(rig, radiance);
        struct hg_view *view = look(rig, &params);
        const struct hg_frame_info info = settle(view, 8);
        assert_true(info.metered);
        assert_true(fabs((double)info.exposure_ev + log2((double)radiance)) < 1.0 / 32);
        struct hg_refbuf *pixels = pixels_of(view, HG_PIXEL_RGBA32F);
        const float *p = (const float *)(const void *)pixels->data + 4 * (16 * 48 + 24);
        if (fabs((double)p[1] / 0.18 - 1) > 0.03)
            fail_msg("light %g: the card is %g", (double)radiance, (double)p[1]);
        hg_refbuf_unref(pixels);
        hg_view_destroy(view);
    }
}

// A lamp over boxes: shadows, falloff, more than one colour.
static void make_still_life(struct rig *rig)
{
    static const float low[3] = {-0.5f, 0, -0.5f}, high[3] = {0.5f, 1, 0.5f};
    static const double at[3] = {1.5, 3, 1}, down[3] = {0, -1, 0};
    rig_scene(rig);
    path_rig_floor(rig, path_rig_lambert(rig, 0.5f), 2);
    path_rig_box(rig, path_rig_lambert(rig, 0.8f), low, high);
    struct hg_light *lamp = rig_light(rig, HG_LIGHT_POINT, at, down);
    lamp->intensity = 54351;
    lamp->casts_shadow = true;
}

// Mode, size, seed and samples do not matter; nor whether the view is watched on its way, steps of
// which size it takes, or what it has shown before.
static void test_one_value(void **state)
{
    struct rig *rig = *state;
    static const struct {
        struct hg_view_params params;
        bool watched, elsewhere;
    } rows[] = {{{.width = 96, .height = 64, .samples = 4}, false, false},
        {{.width = 240, .height = 160, .samples = 2, .seed = 7}, true, false},
        {{.width = 96, .height = 64, .samples = 3, .mode = HG_MODE_PATH}, false, false},
        {{.width = 150, .height = 100, .samples = 1, .seed = 3, .mode = HG_MODE_PATH}, true, true}};
    float ev = 0;
    make_still_life(rig);
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        struct hg_view_params params = rows[i].params;
        params.exposure_mode = HG_EXPOSURE_AUTO;
        struct hg_view *view = path_rig_view(rig, &params);
        hg_view_set_final(view, !rows[i].watched);
        if (rows[i].elsewhere) { // in the corner of the floor, far from the lamp
            const float there[3] = {-6, 5, -6};
            path_rig_look(view, there, target, 0.3f);
            settle(view, 1);
        }
        path_rig_look(view, eye, target, 0.8f);
        const struct hg_frame_info info = settle(view, rows[i].watched ? 1 : 8);
        assert_true(info.metered && info.exposure_ev < -6 && info.exposure_ev > -12);
        if (i > 0 && info.exposure_ev != ev)
            fail_msg("row %zu: %g instead of %g", i, (double)info.exposure_ev, (double)ev);
        ev = info.exposure_ev;
        hg_view_destroy(view);
    }
}

// The metered value stated for another view gives the same bytes; compensation is added to it.
static void test_stated(void **state)
{
    struct rig *rig = *state;
    make_still_life(rig);
    for (int i = 0; i < 4; i++) {
        struct hg_refbuf *pictures[2];
        struct hg_view_params params = {.width = 96,
            .height = 64,
            .samples = 4,
            .exposure_mode = HG_EXPOSURE_AUTO,
            .exposure_ev = i / 2 ? 1.25f : 0,
            .mode = i % 2 ? HG_MODE_PATH : HG_MODE_REALTIME};
        for (int k = 0; k < 2; k++) {
            struct hg_view *view = path_rig_view(rig, &params);
            hg_view_set_final(view, k == 0);
            path_rig_look(view, eye, target, 0.8f);
            const struct hg_frame_info info = settle(view, 4);
            assert_int_equal(info.metered, k == 0);
            pictures[k] = pixels_of(view, HG_PIXEL_RGBA8);
            params.exposure_mode = HG_EXPOSURE_FIXED;
            params.exposure_ev = info.exposure_ev;
            hg_view_destroy(view);
        }
        assert_memory_equal(pictures[0]->data, pictures[1]->data, pictures[0]->size);
        hg_refbuf_unref(pictures[0]);
        hg_refbuf_unref(pictures[1]);
    }
}

// A picture in motion keeps the exposure it had; the one at rest has its own, and says so.
static void test_motion(void **state)
{
    struct rig *rig = *state;
    struct hg_error err = {0};
    struct hg_frame_info info;
    const struct hg_view_params params = {
        .width = 96, .height = 64, .samples = 2, .exposure_mode = HG_EXPOSURE_AUTO};
    make_still_life(rig);
    struct hg_view *view = path_rig_view(rig, &params);
    hg_view_set_final(view, false);
    path_rig_look(view, eye, target, 0.8f);
    test_ok(hg_view_step(view, 1, &info, &err), &err);
    assert_true(!info.metered && !info.settled && info.exposure_ev == 0);
    const float rested = settle(view, 1).exposure_ev;
    const float away[3] = {0.2f, 9, 0.3f};
    path_rig_look(view, away, target, 0.2f);
    test_ok(hg_view_step(view, 1, &info, &err), &err);
    assert_true(!info.metered && !info.settled && info.exposure_ev == rested);
    assert_true(settle(view, 1).metered);
    hg_view_destroy(view);
}

static struct hg_frame_info step(struct hg_view *view)
{
    struct hg_error err = {0};
    struct hg_frame_info info;
    test_ok(hg_view_step(view, 1, &info, &err), &err);
    return info;
}

// Light that changes while a view is watched: its exposure comes step by step to the one that a
// view has which never showed anything else, and so do its bytes.
static void test_adaptation(void **state)
{
    struct rig *rig = *state;
    make_card(rig, 1);
    struct hg_view *view = look(rig, &card_params);
    hg_view_set_final(view, false);
    assert_true(settle(view, 8).exposure_ev == 0);
    path_rig_environment(rig, 64);
    hg_scene_publish(rig->scene);
    float ev = 0, between = 0;
    struct hg_frame_info info = {0};
    for (int i = 0; i < 10000 && !info.settled; i++) {
        info = step(view);
        assert_true(info.exposure_ev <= ev && info.exposure_ev >= -6.0f);
        assert_true(!info.settled || info.metered);
        between += info.exposure_ev < -0.5f && info.exposure_ev > -5.5f ? 1.0f : 0.0f;
        ev = info.exposure_ev;
    }
    assert_true(info.settled && ev == -6.0f && between > 3);
    struct hg_refbuf *adapted = pixels_of(view, HG_PIXEL_RGBA8);
    hg_view_destroy(view);
    view = look(rig, &card_params);
    assert_true(settle(view, 8).exposure_ev == -6.0f);
    struct hg_refbuf *fresh = pixels_of(view, HG_PIXEL_RGBA8);
    assert_memory_equal(adapted->data, fresh->data, fresh->size);
    hg_refbuf_unref(adapted);
    hg_refbuf_unref(fresh);
    hg_view_destroy(view);
}

static void look_aside(struct hg_view *view, int number)
{
    const float at[3] = {0.01f * (float)number, -0.2f, 0};
    path_rig_look(view, eye, at, 0.6f);
}

// A view that never rests adapts all the same; after a cut its first picture has its exposure.
static void test_adaptation_in_motion(void **state)
{
    struct rig *rig = *state;
    struct hg_view_params params = card_params;
    params.gi = HG_GI_PROBES; // which is what it is metered by
    make_card(rig, 1);
    struct hg_view *view = look(rig, &params);
    hg_view_set_final(view, false);
    assert_true(settle(view, 8).exposure_ev == 0);
    path_rig_environment(rig, 64);
    hg_scene_publish(rig->scene);
    struct hg_frame_info info = {0};
    for (int i = 0; i < 100000 && !(info.exposure_ev < -5.9f); i++) {
        const float before = info.exposure_ev;
        look_aside(view, i % 10 + 1);
        info = step(view);
        assert_true(!info.settled && info.exposure_ev <= before + 0.1f);
    }
    assert_true(info.exposure_ev < -5.9f);
    path_rig_environment(rig, 1);
    hg_scene_publish(rig->scene);
    for (int i = 0; i < 12; i++) { // probes follow; exposure takes longer
        look_aside(view, i % 10 + 1);
        info = step(view);
    }
    const float behind[3] = {0.5f, 2, -3}, down[3] = {0, -0.2f, 0};
    path_rig_look(view, behind, down, 0.6f);
    info = step(view);
    print_message("after a cut: %.3f EV\n", (double)info.exposure_ev);
    assert_true(!info.settled && fabsf(info.exposure_ev) < 0.1f);
    hg_view_destroy(view);
}

// A dark floor that mirrors a bright sky, of which only the meter of rest knows: what is shown
// stays when the camera begins to move, and is another one when light changes.
static void test_motion_keeps_rest(void **state)
{
    struct rig *rig = *state;
    struct hg_view_params params = card_params;
    params.gi = HG_GI_PROBES;
    rig_scene(rig);
    struct hg_material *m = path_rig_lambert(rig, 0.05f);
    m->specular.factor = 1;
    m->roughness = 0.2f;
    path_rig_floor(rig, m, 20);
    path_rig_environment(rig, 32);
    struct hg_view *view = look(rig, &params);
    hg_view_set_final(view, false);
    const float rest = settle(view, 8).exposure_ev;
    struct hg_frame_info info = {0};
    const uint64_t start = hg_clock_now_ns();
    float least = rest, most = rest;
    for (int i = 0; hg_clock_now_ns() - start < UINT64_C(1500000000); i++) {
        look_aside(view, i % 10 + 1);
        info = step(view);
        assert_false(info.settled);
        least = fminf(least, info.exposure_ev);
        most = fmaxf(most, info.exposure_ev);
    }
    print_message(
        "at rest %.3f EV, in motion %.3f to %.3f\n", (double)rest, (double)least, (double)most);
    assert_true(rest - least < 0.2f && most - rest < 0.2f);
    path_rig_environment(rig, 2);
    hg_scene_publish(rig->scene);
    for (int i = 0; i < 100000 && !(info.exposure_ev > rest + 3); i++) {
        look_aside(view, i % 10 + 1);
        info = step(view);
    }
    assert_true(info.exposure_ev > rest + 3);
    hg_view_destroy(view);
}

// What a picture of many samples says of the same view.
static float ev_of_samples(struct rig *rig, uint32_t samples)
{
    struct hg_view *view =
        look(rig, &(struct hg_view_params){.width = HG_METER_SIDE_PX,
                      .height = 36,
                      .mode = HG_MODE_PATH,
                      .samples = samples,
                      .filter = HG_FILTER_BOX,
                      .max_bounces = HG_METER_BOUNCES,
                      .planes = 1u << HG_PLANE_ALBEDO | 1u << HG_PLANE_EMISSION});
    path_rig_settle(view);
    struct hg_refbuf *color = path_rig_plane(view, HG_PLANE_COLOR),
                     *albedo = path_rig_plane(view, HG_PLANE_ALBEDO),
                     *emission = path_rig_plane(view, HG_PLANE_EMISSION);
    const float ev = hg_exposure_of_picture(&(struct hg_exposure_picture){.width = HG_METER_SIDE_PX,
        .height = 36,
        .color = (const float *)(const void *)color->data,
        .albedo = (const float *)(const void *)albedo->data,
        .emission = (const float *)(const void *)emission->data,
        .sun_stops = -INFINITY});
    hg_refbuf_unref(color);
    hg_refbuf_unref(albedo);
    hg_refbuf_unref(emission);
    hg_view_destroy(view);
    return ev;
}

// A room whose lamp shines at a bit of the ceiling: paths find that by chance.
static void test_noise(void **state)
{
    static const float box[2][3] = {{-3, -0.2f, -3}, {3, 3, 4}};
    static const float cup[2][3] = {{-0.2f, 2.6f, -0.2f}, {0.2f, 2.98f, 0.2f}};
    struct rig *rig = *state;
    struct hg_view_params params = card_params;
    params.height = 27; // the shape of the picture of many samples
    rig_scene(rig);
    struct hg_material *m = path_rig_lambert(rig, 0.6f);
    m->double_sided = true;
    for (int which = 0; which < 6; which++) {
        rig_face(rig, m, box, 1, which);
        if (which != 3) // its upper end
            rig_face(rig, m, cup, 1, which);
    }
    const double at[3] = {0, 2.7, 0}, down[3] = {0, -1, 0};
    struct hg_light *lamp = rig_light(rig, HG_LIGHT_POINT, at, down);
    lamp->casts_shadow = true;
    struct hg_view *view = look(rig, &params);
    const float metered = settle(view, 64).exposure_ev;
    hg_view_destroy(view);
    const float expected = ev_of_samples(rig, 1024);
    print_message("by light that paths find by chance: %.3f EV, %.3f expected\n", (double)metered,
        (double)expected);
    assert_true(expected > 2 && fabsf(metered - expected) < 0.75f);
}

// Settings of a camera: a card under light of L cd/m^2 comes out as 0.18 L / (1.2 * 2^EV100).
static void test_camera(void **state)
{
    struct rig *rig = *state;
    for (int i = 0; i < 2; i++) {
        struct hg_view_params params = card_params;
        params.mode = i ? HG_MODE_PATH : HG_MODE_REALTIME;
        params.exposure_mode = HG_EXPOSURE_CAMERA;
        params.f_number = 8; // EV100 12
        params.shutter_s = 1.0f / 64;
        params.exposure_ev = 1;
        make_card(rig, 4000);
        struct hg_view *view = look(rig, &params);
        const struct hg_frame_info info = settle(view, 8);
        assert_true(!info.metered && fabs((double)info.exposure_ev + 11 + log2(1.2)) < 1e-5);
        struct hg_refbuf *pixels = pixels_of(view, HG_PIXEL_RGBA32F);
        const float *p = (const float *)(const void *)pixels->data + 4 * (16 * 48 + 24);
        const double expected = 0.18 * 4000 / 1.2 / 2048;
        if (fabs((double)p[1] / expected - 1) > 0.03)
            fail_msg("the card is %g, not %g", (double)p[1], expected);
        hg_refbuf_unref(pixels);
        hg_view_destroy(view);
    }
}

static double exposure_after(struct hg_view *view)
{
    return -(double)settle(view, 8).exposure_ev - log2(1.2);
}

// What a file says of its camera counts until the view says otherwise, or looks through another
// one.
static void test_camera_of_file(void **state)
{
    struct rig *rig = *state;
    struct hg_view_params params = card_params;
    struct hg_error err = {0};
    struct hg_object *object;
    const struct hg_view_camera with = {.input_seq = 1};
    params.exposure_mode = HG_EXPOSURE_CAMERA;
    make_card(rig, 4000);
    assert_int_equal(hg_scene_add(rig->scene, HG_OBJECT_CAMERA, rig->next_id++, &object), HG_OK);
    struct hg_camera *camera = (struct hg_camera *)object;
    camera->optics = (struct hg_camera_optics){.f_number = 8, .shutter_s = 1.0f / 64, .iso = 400};
    assert_int_equal(hg_scene_add(rig->scene, HG_OBJECT_NODE, rig->next_id++, &object), HG_OK);
    struct hg_node *node = (struct hg_node *)object;
    node->camera = camera;
    node->translation[2] = 3;
    hg_scene_publish(rig->scene);
    struct hg_view *view = look(rig, &params);
    assert_true(fabs(exposure_after(view) - log2(16 * 16 * 100)) < 1e-4); // f/16, 1/100 s
    test_ok(hg_view_set_camera_node(view, node->head.id, &with, &err), &err);
    assert_true(fabs(exposure_after(view) - 10) < 1e-4); // 64 * 64 / 4
    params.f_number = 4;
    test_ok(hg_view_set_params(view, &params, &err), &err);
    assert_true(fabs(exposure_after(view) - 8) < 1e-4);
    path_rig_look(view, eye, target, 0.6f);
    assert_true(fabs(exposure_after(view) - log2(4 * 4 * 100)) < 1e-4);
    hg_view_destroy(view);
}

static struct hg_refbuf *picture_of(
    struct rig *rig, const struct hg_view_params *params, const struct hg_view_camera *camera)
{
    struct hg_view *view = path_rig_view(rig, params);
    path_rig_set_camera(view, camera);
    settle(view, 8);
    struct hg_refbuf *out = pixels_of(view, HG_PIXEL_RGBA8);
    hg_view_destroy(view);
    return out;
}

// The lens of an f-number and the blur of an exposure time are those of their formulas, to the
// byte.
static void test_camera_lens_and_shutter(void **state)
{
    struct rig *rig = *state;
    const struct hg_view_params plain = {
        .width = 48, .height = 32, .samples = 8, .mode = HG_MODE_PATH, .frame_s = 0.04f};
    const struct hg_view_camera still = {.eye = {0.5f, 2, 3}, .up = {0, 1, 0}, .vfov_rad = 0.8f};
    make_still_life(rig);
    for (int i = 0; i < 2; i++) {
        struct hg_view_params stated = plain, physical = plain;
        struct hg_view_camera camera = still, lens = still;
        if (i == 0) { // focal length 600 mm / (2 tan 0.4), f/1.4
            physical.f_number = 1.4f;
            physical.sensor_mm = 600;
            lens.lens_radius = 0.25e-3f * 600 / 1.4f / tanf(0.4f);
        } else { // a quarter of a frame about the pose
            const float next_eye[3] = {1.5f, 2, 3};
            camera.moves = true;
            memcpy(camera.next_eye, next_eye, sizeof next_eye);
            lens = camera;
            physical.shutter_s = 0.01f;
            stated.shutter_open = -0.125f;
            stated.shutter_close = 0.125f;
        }
        struct hg_refbuf *pictures[3] = {picture_of(rig, &physical, &camera),
            picture_of(rig, &stated, &lens), picture_of(rig, &plain, &camera)};
        assert_memory_equal(pictures[0]->data, pictures[1]->data, pictures[0]->size);
        assert_memory_not_equal(pictures[0]->data, pictures[2]->data, pictures[0]->size);
        for (int k = 0; k < 3; k++)
            hg_refbuf_unref(pictures[k]);
    }
}

// Nothing in view, and no light: exposure 0, and the view settles.
static void test_nothing(void **state)
{
    struct rig *rig = *state;
    for (int i = 0; i < 4; i++) {
        const struct hg_view_params params = {.width = 32,
            .height = 32,
            .samples = 1,
            .exposure_mode = HG_EXPOSURE_AUTO,
            .mode = i % 2 ? HG_MODE_PATH : HG_MODE_REALTIME};
        rig_scene(rig);
        if (i / 2)
            path_rig_floor(rig, path_rig_lambert(rig, 0.5f), 20);
        else
            path_rig_environment(rig, 50);
        struct hg_view *view = look(rig, &params);
        const struct hg_frame_info info = settle(view, 4);
        assert_true(info.metered && info.exposure_ev == 0);
        hg_view_destroy(view);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_card),
        cmocka_unit_test(test_one_value), cmocka_unit_test(test_stated),
        cmocka_unit_test(test_motion), cmocka_unit_test(test_adaptation),
        cmocka_unit_test(test_adaptation_in_motion), cmocka_unit_test(test_motion_keeps_rest),
        cmocka_unit_test(test_noise), cmocka_unit_test(test_camera),
        cmocka_unit_test(test_camera_of_file), cmocka_unit_test(test_camera_lens_and_shutter),
        cmocka_unit_test(test_nothing)};
    return cmocka_run_group_tests(tests, rig_set_up, rig_tear_down);
}
