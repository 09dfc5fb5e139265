// render_faults.c - every Vulkan call of a view's life fails once, the device is lost, and
// validation has nothing to say.
#include <unistd.h>

#include "base/alloc.h"
#include "base/log.h"
#include "renderer/gpu/gpu.h"
#include "tests/support/test_data.h"
#include "tests/unit/render_rig.h"

static void check_silent(struct rig *rig, const char *path)
{
    const struct hg_view_params params = {.width = 48, .height = 32, .samples = 2};
    rig_use_scene(rig, rig_load(path, hg_renderer_jobs(rig->renderer)), &params);
    rig_look_at_scene(rig, 0.3f);
    rig_settle(rig, 1);
    rig_look_at_scene(rig, 1.3f);
    rig_settle(rig, 2);
    for (int format = HG_PIXEL_RGBA8; format <= HG_PIXEL_RGBA32F; format++)
        hg_refbuf_unref(rig_pixels(rig, (enum hg_pixel_format)format));
    struct hg_pick pick;
    test_ok(hg_view_pick(rig->view, 24, 16, &pick, &rig->err), &rig->err);
    rig_close_scene(rig);
    assert_int_equal(hg_renderer_validation_messages(rig->renderer), 0);
}

static void close_silent(struct rig *rig)
{
    char *text;
    assert_int_equal(hg_renderer_stats_json(rig->renderer, NULL, &text), HG_OK);
    hg_free(text);
    rig_close(rig);
}

static void test_validation_is_silent(void **state)
{
    static const char *const paths[] = {PANES, KNOT, WORM, MORPH, "demo:"};
    (void)state;
    struct rig rig;
    rig_open(&rig, true);
    test_ok(hg_renderer_warm_up(rig.renderer, NULL, NULL, &rig.err), &rig.err);
    for (size_t i = 0; i < sizeof paths / sizeof paths[0]; i++)
        check_silent(&rig, paths[i]);
    close_silent(&rig);
}

static void test_validation_is_silent_with_samples(void **state)
{
    static const char *const names[] = {
        "khronos/AlphaBlendModeTest/glTF-Binary/AlphaBlendModeTest.glb",
        "khronos/CesiumMan/glTF-Binary/CesiumMan.glb",
        "khronos/LightsPunctualLamp/glTF/LightsPunctualLamp.gltf",
        "khronos/MeshPrimitiveModes/glTF/MeshPrimitiveModes.gltf",
        "khronos/TextureSettingsTest/glTF-Binary/TextureSettingsTest.glb",
        "khronos/MorphPrimitivesTest/glTF-Binary/MorphPrimitivesTest.glb",
        "khronos/SimpleInstancing/glTF-Binary/SimpleInstancing.glb"};
    enum { COUNT = sizeof names / sizeof names[0] };
    (void)state;
    struct rig rig;
    for (size_t i = 0; i < COUNT; i++)
        (void)test_data(names[i]); // ends the test here if one is missing
    rig_open(&rig, true);
    for (size_t i = 0; i < COUNT; i++)
        check_silent(&rig, test_data(names[i]));
    close_silent(&rig);
}

static enum hg_status try_view(struct rig *rig, struct hg_scene *scene)
{
    const struct hg_view_params params = {.width = 16, .height = 16, .samples = 1};
    struct hg_frame_info info;
    struct hg_refbuf *image = NULL;
    enum hg_status status = hg_view_create(rig->renderer, scene, &rig->view, &rig->err);
    if (status == HG_OK)
        status = hg_view_set_params(rig->view, &params, &rig->err);
    for (int i = 0; i < 3 && status == HG_OK; i++)
        status = hg_view_step(rig->view, 1, &info, &rig->err);
    if (status == HG_OK)
        status = hg_view_read_pixels(rig->view, HG_PIXEL_RGBA8, &image, &rig->err);
    hg_refbuf_unref(image);
    return status;
}

// Every Vulkan call of a view's life fails once: a status, no leak, and the next view works.
static void test_failing_calls(void **state)
{
    (void)state;
    struct rig rig;
    const float glass[4] = {1, 1, 1, 0.5f};
    rig_open(&rig, true);
    struct hg_scene *scene = rig_new_scene();
    rig_quad(scene, 1, 1, 0, glass);
    hg_scene_publish(scene);
    for (uint64_t n = 1; n < 2000; n += n < 60 ? 1 : 7) {
        hg_gpu_fail_at(n, VK_ERROR_OUT_OF_DEVICE_MEMORY);
        const enum hg_status status = try_view(&rig, scene);
        const bool failed = hg_gpu_call_count() >= n;
        hg_gpu_fail_at(0, VK_SUCCESS);
        hg_view_destroy(rig.view);
        rig.view = NULL;
        assert_true(status == HG_OK || status == HG_E_NOMEM || status == HG_E_LIMIT);
        if (!failed)
            break;
        assert_int_not_equal(status, HG_OK);
    }
    assert_int_equal(try_view(&rig, scene), HG_OK);
    assert_int_equal(hg_renderer_validation_messages(rig.renderer), 0);
    rig.scene = scene;
    rig_close(&rig);
}

// A lit quad before much background.
static struct hg_scene *lit_scene(void)
{
    const float grey[4] = {0.5f, 0.5f, 0.5f, 1};
    struct hg_scene *scene = rig_new_scene();
    struct hg_node *node = rig_quad(scene, 1, 0.5f, 0, grey);
    ((struct hg_material *)(void *)scene->objects[HG_OBJECT_MATERIAL].items[0])->unlit = false;
    (void)node;
    rig_environment(scene, 0.5f, 0.6f, 0.7f);
    rig_sun(scene, 7, -0.5f, 0.8660254f);
    hg_scene_publish(scene);
    return scene;
}

// Steps with the n-th call failing, if there are so many, and then without. *failed: it did.
static void follow(struct rig *rig, const struct hg_view_params *params, uint64_t n, bool *failed,
    struct hg_refbuf *out[2])
{
    const struct hg_view_camera camera = {.eye = {0, 0.5f, 4},
        .moves = true,
        .next_eye = {0.1f, 0.5f, 4},
        .next_target = {0.1f, 0, 0}};
    struct hg_frame_info info = {0};
    enum hg_status status = HG_OK;
    rig_view(rig, params);
    test_ok(hg_view_set_camera(rig->view, &camera, &rig->err), &rig->err);
    hg_gpu_fail_at(n, VK_ERROR_OUT_OF_DEVICE_MEMORY);
    while (status == HG_OK && !info.settled)
        status = hg_view_step(rig->view, 2, &info, &rig->err);
    *failed = n > 0 && hg_gpu_call_count() >= n;
    hg_gpu_fail_at(0, VK_SUCCESS);
    assert_true(status == HG_OK || status == HG_E_NOMEM || status == HG_E_LIMIT);
    rig_settle(rig, 2);
    out[0] = rig_pixels(rig, HG_PIXEL_RGBA32F);
    test_ok(hg_view_read_plane(rig->view, HG_PLANE_MOTION, &out[1], &rig->err), &rig->err);
    hg_view_destroy(rig->view);
    rig->view = NULL;
}

// Every Vulkan call of a view whose rays are followed fails once: then the same view goes on, to
// the picture and the plane that there would have been.
static void test_failing_rays(void **state)
{
    (void)state;
    struct hg_view_params params[] = {{.mode = HG_MODE_PATH, .shutter_close = 0.5f},
        {.mode = HG_MODE_PATH}, {.mode = HG_MODE_REALTIME}};
    struct rig rig;
    rig_open(&rig, true);
    rig.scene = lit_scene();
    for (int i = 0; i < 3; i++) {
        params[i].width = params[i].height = 20;
        params[i].samples = 2;
        params[i].planes = 1u << HG_PLANE_MOTION;
        struct hg_refbuf *whole[2], *got[2];
        bool failed;
        uint64_t n = 1;
        follow(&rig, &params[i], 0, &failed, whole);
        for (failed = true; failed; n += n < 40 ? 1 : 29) {
            follow(&rig, &params[i], n, &failed, got);
            for (int k = 0; k < 2; k++) {
                assert_int_equal(whole[k]->size, got[k]->size);
                assert_memory_equal(whole[k]->data, got[k]->data, got[k]->size);
                hg_refbuf_unref(got[k]);
            }
        }
        print_message("%d: %u calls\n", i, (unsigned)n);
        hg_refbuf_unref(whole[0]);
        hg_refbuf_unref(whole[1]);
    }
    assert_int_equal(hg_renderer_validation_messages(rig.renderer), 0);
    rig_close(&rig);
}

static void test_device_lost(void **state)
{
    (void)state;
    struct rig rig;
    const float white[4] = {1, 1, 1, 1};
    struct hg_frame_info info;
    struct hg_scene *scene = rig_new_scene();
    rig_quad(scene, 1, 1, 0, white);
    hg_scene_publish(scene);
    rig_open(&rig, false);
    assert_int_equal(try_view(&rig, scene), HG_OK);
    struct hg_view_camera camera = {.eye = {0, 1, 3}};
    test_ok(hg_view_set_camera(rig.view, &camera, &rig.err), &rig.err);
    hg_gpu_fail_at(1, VK_ERROR_DEVICE_LOST);
    assert_int_equal(hg_view_step(rig.view, 1, &info, &rig.err), HG_E_DEVICE_LOST);
    hg_gpu_fail_at(0, VK_SUCCESS);
    assert_int_equal(hg_view_step(rig.view, 1, &info, &rig.err), HG_E_DEVICE_LOST);
    hg_view_destroy(rig.view);
    hg_renderer_destroy(rig.renderer);
    rig_open(&rig, false); // the scene outlives the renderer
    assert_int_equal(try_view(&rig, scene), HG_OK);
    rig.scene = scene;
    rig_close(&rig);
}

int main(void)
{
    hg_log_set_sink(hg_log_sink_logfmt, (void *)(intptr_t)STDERR_FILENO);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_validation_is_silent),
        cmocka_unit_test(test_validation_is_silent_with_samples),
        cmocka_unit_test(test_failing_calls),
        cmocka_unit_test(test_failing_rays),
        cmocka_unit_test(test_device_lost),
    };
    return test_run_group(tests, NULL, NULL);
}
