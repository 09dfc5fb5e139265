// background.c - what is seen beside the scene, in both modes: display colours come out as they
// are, under any exposure and curve, and the blurred environment is the same in both.
#include <math.h>
#include <string.h>

#include "base/alloc.h"
#include "base/refbuf.h"
#include "tests/analytic/rig.h"

#define WIDTH  32
#define HEIGHT 18

static float eye_y; // of the camera, which looks at the origin from 6 m before it

static struct hg_refbuf *render(
    struct rig *rig, const struct hg_view_params *asked, enum hg_pixel_format format)
{
    const struct hg_view_camera camera = {.eye = {0, eye_y, 6}, .vfov_rad = 0.8f};
    struct hg_view_params params = *asked;
    struct hg_error err = {0};
    struct hg_frame_info info = {0};
    struct hg_refbuf *pixels;
    struct hg_view *view;
    params.width = WIDTH;
    params.height = HEIGHT;
    params.samples = params.mode == HG_MODE_PATH ? 16 : 4;
    params.filter = HG_FILTER_BOX;
    hg_scene_publish(rig->scene);
    test_ok(hg_view_create(rig->renderer, rig->scene, &view, &err), &err);
    test_ok(hg_view_set_params(view, &params, &err), &err);
    test_ok(hg_view_set_camera(view, &camera, &err), &err);
    for (int i = 0; i < 4000 && !info.settled; i++)
        test_ok(hg_view_step(view, 8, &info, &err), &err);
    assert_true(info.settled);
    test_ok(hg_view_read_pixels(view, format, &pixels, &err), &err);
    hg_view_destroy(view);
    return pixels;
}

static void open_scene(struct rig *rig)
{
    static const float wall[4][3] = {{-1, -1, 0}, {1, -1, 0}, {1, 1, 0}, {-1, 1, 0}};
    rig_scene(rig);
    (void)rig_quad(rig, rig_material(rig), wall);
    rig->scene->environment.kind = HG_ENV_COLOR;
    for (int c = 0; c < 3; c++)
        rig->scene->environment.color[c] = 0.2f;
}

static void test_display_color(void **state)
{
    // #ff8040 and its linear values.
    static const uint8_t expected[4] = {255, 128, 64, 255};
    static const float linear[3] = {1, 0.2158605f, 0.05126946f};
    static const enum hg_tonemap curves[] = {
        HG_TONEMAP_ACES, HG_TONEMAP_AGX, HG_TONEMAP_PBR_NEUTRAL, HG_TONEMAP_LINEAR};
    struct rig *rig = *state;
    open_scene(rig);
    for (int i = 0; i < 8; i++) {
        struct hg_view_params params = {.mode = i & 1 ? HG_MODE_PATH : HG_MODE_REALTIME,
            .background = HG_BACKGROUND_DISPLAY,
            .exposure_ev = (float)(i - 4),
            .tonemap = curves[i / 2],
            .trace = rig_trace(rig, HG_VIEW_TRACE_AUTO)};
        memcpy(params.background_color, linear, sizeof linear);
        struct hg_refbuf *shown = render(rig, &params, HG_PIXEL_RGBA8);
        struct hg_refbuf *light = render(rig, &params, HG_PIXEL_RGBA32F);
        assert_memory_equal(shown->data, expected, 4);
        assert_memory_equal(light->data, linear, sizeof linear);
        const uint8_t *middle = shown->data + (WIDTH * (HEIGHT / 2) + WIDTH / 2) * 4;
        assert_memory_not_equal(middle, expected, 3); // the wall
        assert_int_equal(middle[3], 255);
        hg_refbuf_unref(shown);
        hg_refbuf_unref(light);
    }
}

// A smooth gradient from an image whose left half is bright; no edge is left of it.
static void test_blur(void **state)
{
    struct rig *rig = *state;
    struct hg_refbuf *pictures[2];
    open_scene(rig);
    struct hg_environment *env = &rig->scene->environment;
    test_ok(hg_image_create(64, 32, HG_PIXEL_RGBA32F, NULL, &env->image), NULL);
    for (uint32_t i = 0; i < 64 * 32; i++)
        for (uint32_t c = 0; c < 4; c++)
            ((float *)env->image.pixels)[i * 4 + c] = i % 64 < 16 ? 1.0f : 0.0f;
    env->kind = HG_ENV_IMAGE; // the edge at u = 1/4 is -z, in the middle of the picture
    for (int i = 0; i < 2; i++) {
        const struct hg_view_params params = {.mode = i ? HG_MODE_PATH : HG_MODE_REALTIME,
            .background = HG_BACKGROUND_BLUR,
            .trace = rig_trace(rig, HG_VIEW_TRACE_AUTO)};
        pictures[i] = render(rig, &params, HG_PIXEL_RGBA32F);
    }
    const float *fast = (const float *)pictures[0]->data, *path = (const float *)pictures[1]->data;
    for (uint32_t x = 0; x < WIDTH; x++) {
        assert_true(fabsf(fast[x * 4] - path[x * 4]) < 0.03f);
        assert_true(fast[x * 4 + 3] == 1 && path[x * 4 + 3] == 1);
        assert_true(x == 0 || fabsf(fast[x * 4] - fast[x * 4 - 4]) < 0.2f);
    }
    assert_true(fabsf(fast[0] - fast[(WIDTH - 1) * 4]) > 0.3f);
    hg_refbuf_unref(pictures[0]);
    hg_refbuf_unref(pictures[1]);
}

// A wall of 2 x 2 m on the ground, y = -1, under a lamp behind it: alpha is the shadow before it,
// the same in both modes, and nothing is seen of the ground from below.
static void test_ground(void **state)
{
    static const double above[3] = {0, 9, -6}, down[3] = {0, -9, 6};
    struct rig *rig = *state;
    double shadow[3] = {0}, lit[3] = {0};
    open_scene(rig);
    rig_light(rig, HG_LIGHT_DIRECTIONAL, above, down)->casts_shadow = true;
    rig->scene->environment.color[0] = rig->scene->environment.color[1] =
        rig->scene->environment.color[2] = 0.02f;
    for (int i = 0; i < 3; i++) {
        const struct hg_view_params params = {.mode = i == 1 ? HG_MODE_PATH : HG_MODE_REALTIME,
            .background = HG_BACKGROUND_NONE,
            .ground = HG_GROUND_Y,
            .trace = rig_trace(rig, HG_VIEW_TRACE_AUTO)};
        eye_y = i == 2 ? -4.0f : 4.0f;
        struct hg_refbuf *pixels = render(rig, &params, HG_PIXEL_RGBA32F);
        const float *p = (const float *)pixels->data;
        for (uint32_t x = WIDTH / 2 - 2; x < WIDTH / 2 + 2; x++) {
            shadow[i] += (double)p[(WIDTH * (HEIGHT - 6) + x) * 4 + 3] / 4;  // before the wall
            lit[i] += (double)p[(WIDTH * (HEIGHT - 6) + x % 4) * 4 + 3] / 4; // beside it
        }
        hg_refbuf_unref(pixels);
    }
    eye_y = 0;
    print_message(
        "alpha in the shadow %.4f, path %.4f, from below %.4f; beside it %.4f, %.4f, %.4f\n",
        shadow[0], shadow[1], shadow[2], lit[0], lit[1], lit[2]);
    assert_true(shadow[0] > 0.6 && fabs(shadow[0] - shadow[1]) < 0.05);
    assert_true(lit[0] < 0.01 && lit[1] < 0.05);
    assert_true(shadow[2] == 0 && lit[2] == 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_display_color),
        cmocka_unit_test(test_blur),
        cmocka_unit_test(test_ground),
    };
    return cmocka_run_group_tests(tests, rig_set_up, rig_tear_down);
}
