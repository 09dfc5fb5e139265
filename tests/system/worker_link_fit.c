// worker_link_fit.c - view_fit and the camera of a view that was given none, at a real
// helio-worker: measured in the pictures. Needs a device; lavapipe will do.
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "tests/system/worker_link_rig.h"

enum { VIEW = 1, BOX = FIRST_ID, OTHER = FIRST_ID + 1, EYE = FIRST_ID + 2 };

static const float degree = 0.01745329f;

// ---- scene and pictures
// --------------------------------------------------------------------------

static void set_box(struct rig *rig, uint64_t id, const float half[3])
{
    float corners[8 * 3];
    static const uint32_t faces[] = {0, 2, 3, 0, 3, 1, 4, 5, 7, 4, 7, 6, 0, 1, 5, 0, 5, 4, 2, 6, 7,
        2, 7, 3, 0, 4, 6, 0, 6, 2, 1, 3, 7, 1, 7, 5};
    for (int c = 0; c < 8; c++)
        for (int i = 0; i < 3; i++)
            corners[c * 3 + i] = c >> i & 1 ? half[i] : -half[i];
    struct hgp_mesh_part part = {.mode = HGP_primitive_mode_TRIANGLES,
        .positions = {(const uint8_t *)corners, sizeof corners},
        .indices = {(const uint8_t *)faces, sizeof faces}};
    struct hgp_mesh_set mesh = {.mesh = id};
    mesh.parts.items = &part;
    mesh.parts.count = 1;
    struct hgp_node_set node = {.node = id, .has_mesh = true, .mesh = id};
    link_expect(rig, link_ask(rig, 1, HGP_T_mesh_set, &mesh), HGP_T_ok);
    link_expect(rig, link_ask(rig, 1, HGP_T_node_set, &node), HGP_T_ok);
}

static void set_view(struct rig *rig, uint32_t width, uint32_t height)
{
    struct hgp_view_set view = {.view = VIEW,
        .has_width = true,
        .width = width,
        .has_height = true,
        .height = height,
        .has_samples = true,
        .samples = 1,
        .has_background = true,
        .background = HGP_background_NONE,
        .has_gi = true,
        .gi = HGP_gi_NONE,
        .has_exposure_mode = true, // metering traces paths for each camera
        .exposure_mode = HGP_exposure_mode_FIXED};
    link_expect(rig, link_ask(rig, 1, HGP_T_view_set, &view), HGP_T_ok);
}

static const struct hgp_frame *take_frame(struct rig *rig)
{
    struct hgp_frame_request request = {
        .view = VIEW, .settled = true, .has_encoding = true, .encoding = HGP_encoding_RAW_RGBA8};
    link_expect(rig, link_ask(rig, 1, HGP_T_frame_request, &request), HGP_T_frame);
    return &rig->message.frame;
}

static struct hgp_view_fitted ask_fit(struct rig *rig, struct hgp_view_fit fit)
{
    fit.view = VIEW;
    link_expect(rig, link_ask(rig, 1, HGP_T_view_fit, &fit), HGP_T_view_fitted);
    return rig->message.view_fitted;
}

static void look(struct rig *rig, const struct hgp_view_fitted *fitted)
{
    struct hgp_view_camera camera = {.view = VIEW,
        .has_camera = fitted->camera != 0,
        .camera = fitted->camera,
        .has_eye = true,
        .has_target = true,
        .has_up = true,
        .has_kind = true,
        .kind = fitted->kind,
        .has_half_height = true,
        .half_height = fitted->half_height,
        .has_vfov_rad = true,
        .vfov_rad = fitted->vfov_rad};
    memcpy(camera.eye, fitted->eye, sizeof camera.eye);
    memcpy(camera.target, fitted->target, sizeof camera.target);
    memcpy(camera.up, fitted->up, sizeof camera.up);
    link_expect(rig, link_ask(rig, 1, HGP_T_view_camera, &camera), HGP_T_ok);
}

// Free pixels at left, right, top and bottom of what is drawn, as shares of the picture.
static void measure(const struct hgp_frame *frame, double margins[4])
{
    const uint32_t w = frame->width, h = frame->height;
    uint32_t low[2] = {w, h}, high[2] = {0, 0};
    for (uint32_t y = 0; y < h; y++)
        for (uint32_t x = 0; x < w; x++)
            if (frame->data.data[(y * w + x) * 4 + 3] > 127) {
                low[0] = x < low[0] ? x : low[0];
                low[1] = y < low[1] ? y : low[1];
                high[0] = x + 1 > high[0] ? x + 1 : high[0];
                high[1] = y + 1 > high[1] ? y + 1 : high[1];
            }
    assert_true(high[0] > low[0]);
    margins[0] = (double)low[0] / w;
    margins[1] = (double)(w - high[0]) / w;
    margins[2] = (double)low[1] / h;
    margins[3] = (double)(h - high[1]) / h;
}

// What is drawn fills 80 to 90 % of the picture's width or height, and nothing is cut off.
static void check_fill(const struct hgp_frame *frame)
{
    double m[4];
    measure(frame, m);
    const double across = 1 - m[0] - m[1], up = 1 - m[2] - m[3];
    const double fill = fmax(across, up);
    if (!(fill >= 0.80 && fill <= 0.90))
        print_error("fills %g x %g of %u x %u\n", across, up, frame->width, frame->height);
    assert_true(fill >= 0.80 && fill <= 0.90);
    for (int i = 0; i < 4; i++)
        assert_true(m[i] > 0.02);
}

// ---- tests
// ---------------------------------------------------------------------------------------

static void test_all_views_fill_the_picture(void **state)
{
    struct rig *rig = *state;
    static const float shapes[][3] = {
        {1, 1, 1}, {0.5f, 8, 0.5f}, {10, 0.4f, 10}, {0.01f, 0.02f, 0.03f}};
    static const uint32_t sizes[][2] = {{160, 90}, {100, 100}, {90, 160}};
    static const float angles[][2] = {
        {35, 25}, {0, 0}, {180, 0}, {-90, 0}, {90, 0}, {0, 90}, {0, -90}, {45, 35.26439f}};
    link_attach(rig, 1, "a");
    for (size_t s = 0; s < sizeof shapes / sizeof *shapes; s++)
        for (size_t z = 0; z < sizeof sizes / sizeof *sizes; z++) {
            set_box(rig, BOX, shapes[s]);
            set_view(rig, sizes[z][0], sizes[z][1]);
            for (size_t a = 0; a < sizeof angles / sizeof *angles; a += z ? 4 : 1)
                for (int kind = 0; kind < (a == 0 && z < 2 ? 2 : 1); kind++) {
                    struct hgp_view_fitted fitted =
                        ask_fit(rig, (struct hgp_view_fit){.has_azimuth_rad = a > 0,
                                         .azimuth_rad = angles[a][0] * degree,
                                         .has_elevation_rad = a > 0,
                                         .elevation_rad = angles[a][1] * degree,
                                         .has_kind = true,
                                         .kind = (enum hgp_camera_kind)kind});
                    assert_false(fitted.empty);
                    look(rig, &fitted);
                    check_fill(take_frame(rig));
                }
        }
}

static void test_what_is_fitted(void **state)
{
    struct rig *rig = *state;
    link_attach(rig, 1, "a");
    set_view(rig, 96, 96);
    struct hgp_view_fitted fitted = ask_fit(rig, (struct hgp_view_fit){0});
    assert_true(fitted.empty);
    look(rig, &fitted); // a camera nevertheless
    set_box(rig, BOX, (float[3]){1, 1, 1});
    set_box(rig, OTHER, (float[3]){1, 1, 1});
    struct hgp_node_set node = {.node = OTHER, .has_translation = true, .translation = {100, 0, 0}};
    link_expect(rig, link_ask(rig, 1, HGP_T_node_set, &node), HGP_T_ok);
    // Both; one of them; one that is seen.
    fitted = ask_fit(rig, (struct hgp_view_fit){0});
    look(rig, &fitted);
    check_fill(take_frame(rig));
    assert_true(fitted.target[0] > 10);
    fitted = ask_fit(rig, (struct hgp_view_fit){.has_node = true, .node = OTHER});
    assert_true(fabsf(fitted.target[0] - 100) < 0.5f);
    look(rig, &fitted);
    check_fill(take_frame(rig));
    node = (struct hgp_node_set){.node = OTHER, .has_visible = true};
    link_expect(rig, link_ask(rig, 1, HGP_T_node_set, &node), HGP_T_ok);
    fitted = ask_fit(rig, (struct hgp_view_fit){0});
    assert_true(fabsf(fitted.target[0]) < 0.5f);
    // A margin of its own, and a lens.
    const float near = fitted.eye[1];
    fitted = ask_fit(rig, (struct hgp_view_fit){.has_margin = true, .margin = 0.5f});
    assert_true(fitted.eye[1] > 1.3f * near);
    fitted = ask_fit(rig, (struct hgp_view_fit){.has_vfov_rad = true, .vfov_rad = 0.1f});
    assert_true(fitted.eye[1] > 4 * near && fitted.vfov_rad == 0.1f);
    struct hgp_view_fit bad = {.view = VIEW, .has_node = true, .node = 77};
    link_expect_error(rig, link_ask(rig, 1, HGP_T_view_fit, &bad), HG_E_NOTFOUND, "node");
    bad = (struct hgp_view_fit){.view = VIEW + 1};
    link_expect_error(rig, link_ask(rig, 1, HGP_T_view_fit, &bad), HG_E_NOTFOUND, NULL);
}

// Twelve times around a long box that stands beside the origin: nothing is cut off.
static void test_a_turntable_stays_in_the_picture(void **state)
{
    struct rig *rig = *state;
    link_attach(rig, 1, "a");
    set_view(rig, 96, 64);
    set_box(rig, BOX, (float[3]){0.5f, 1, 4});
    struct hgp_node_set node = {.node = BOX, .has_translation = true, .translation = {7, 0, 3}};
    link_expect(rig, link_ask(rig, 1, HGP_T_node_set, &node), HGP_T_ok);
    struct hgp_view_fitted start =
        ask_fit(rig, (struct hgp_view_fit){.has_turntable = true, .turntable = true});
    assert_true(fabsf(start.target[0] - 7) < 1e-3f && fabsf(start.target[2] - 3) < 1e-3f);
    double most = 0;
    for (int i = 0; i < 12; i++) {
        struct hgp_view_fitted turned = start;
        const float c = cosf((float)i * 30 * degree), s = sinf((float)i * 30 * degree);
        const float x = start.eye[0] - start.target[0], z = start.eye[2] - start.target[2];
        turned.eye[0] = start.target[0] + c * x + s * z;
        turned.eye[2] = start.target[2] - s * x + c * z;
        look(rig, &turned);
        double m[4];
        measure(take_frame(rig), m);
        for (int k = 0; k < 4; k++)
            assert_true(m[k] > 0.02);
        most = fmax(most, fmax(1 - m[0] - m[1], 1 - m[2] - m[3]));
    }
    assert_true(most > 0.75);
}

// Until the answer; returns the number of notices about cameras.
static int ask_cameras(struct rig *rig)
{
    struct hgp_view_fit fit = {.view = VIEW, .has_cameras = true, .cameras = true};
    const uint32_t request = link_ask(rig, 1, HGP_T_view_fit, &fit);
    for (int notices = 0;;) {
        link_read(rig);
        if (rig->header.request != request)
            continue;
        if (rig->header.type == HGP_T_notice) {
            const struct hgp_notice *n = &rig->message.notice;
            assert_true(n->what.size == 3 && memcmp(n->what.data, "eye", 3) == 0);
            notices++;
            continue;
        }
        assert_int_equal(rig->header.type, HGP_T_view_fitted);
        return notices;
    }
}

static void place_camera(struct rig *rig, float y, const float rotation[4], const float scale[3])
{
    struct hgp_camera_set lens = {.camera = EYE, .has_vfov_rad = true, .vfov_rad = 0.8f};
    struct hgp_node_set node = {.node = EYE,
        .has_camera = true,
        .camera = EYE,
        .has_translation = true,
        .translation = {0, y, 6},
        .has_rotation = true,
        .has_scale = true,
        .has_name = true,
        .name = hgp_str_make("eye")};
    memcpy(node.rotation, rotation, sizeof node.rotation);
    memcpy(node.scale, scale, sizeof node.scale);
    link_expect(rig, link_ask(rig, 1, HGP_T_camera_set, &lens), HGP_T_ok);
    link_expect(rig, link_ask(rig, 1, HGP_T_node_set, &node), HGP_T_ok);
}

static void test_a_camera_that_sees_nothing_is_passed_over(void **state)
{
    struct rig *rig = *state;
    static const float ahead[4] = {0, 0, 0, 1}, behind[4] = {0, 1, 0, 0}, one[3] = {1, 1, 1};
    link_attach(rig, 1, "a");
    set_view(rig, 96, 64);
    place_camera(rig, 0, ahead, one);
    assert_int_equal(ask_cameras(rig), 0); // no geometry that it could miss
    assert_int_equal(rig->message.view_fitted.camera, EYE);
    set_box(rig, BOX, (float[3]){1, 1, 1});
    assert_int_equal(ask_cameras(rig), 0);
    assert_int_equal(rig->message.view_fitted.camera, EYE);
    place_camera(rig, 0, behind, one);
    assert_int_equal(ask_cameras(rig), 1);
    assert_int_equal(rig->message.view_fitted.camera, 0);
    struct hgp_view_fitted fitted = rig->message.view_fitted;
    look(rig, &fitted);
    check_fill(take_frame(rig));
    place_camera(rig, 5, ahead, one); // looks over the box
    assert_int_equal(ask_cameras(rig), 1);
    place_camera(rig, 3, ahead, one); // the box reaches into the picture's lower edge
    assert_int_equal(ask_cameras(rig), 0);
    place_camera(rig, 0, ahead, (float[3]){0, 1, 1}); // no direction is its right
    assert_int_equal(ask_cameras(rig), 1);
    // A lens whose far plane lies before everything.
    place_camera(rig, 0, ahead, one);
    struct hgp_camera_set lens = {
        .camera = EYE, .has_near = true, .near = 0.1f, .has_far = true, .far = 4};
    link_expect(rig, link_ask(rig, 1, HGP_T_camera_set, &lens), HGP_T_ok);
    assert_int_equal(ask_cameras(rig), 1);
}

// Sends what view_fit answers, and takes the picture's hash.
static void hash_of_fit(struct rig *rig, bool cameras, uint8_t hash[32])
{
    struct hgp_view_fitted fitted =
        ask_fit(rig, (struct hgp_view_fit){.has_cameras = true, .cameras = cameras});
    look(rig, &fitted);
    memcpy(hash, take_frame(rig)->hash, 32);
}

static void reopen_view(struct rig *rig)
{
    link_expect(
        rig, link_ask(rig, 1, HGP_T_view_close, &(struct hgp_view_close){.view = VIEW}), HGP_T_ok);
    set_view(rig, 96, 64);
}

static void test_a_view_without_a_camera_shows_the_scene(void **state)
{
    struct rig *rig = *state;
    uint8_t fitted[32], before[32];
    link_attach(rig, 1, "a");
    set_view(rig, 96, 64);
    set_box(rig, BOX, (float[3]){1, 2, 1});
    check_fill(take_frame(rig));
    memcpy(before, rig->message.frame.hash, 32);
    hash_of_fit(rig, false, fitted);
    assert_memory_equal(before, fitted, 32);
    // It follows the scene and the picture's shape ...
    reopen_view(rig);
    set_box(rig, OTHER, (float[3]){1, 4, 4});
    check_fill(take_frame(rig));
    set_view(rig, 40, 96);
    check_fill(take_frame(rig));
    // ... also to a camera of the scene ...
    reopen_view(rig);
    place_camera(rig, 0, (float[4]){0, 0, 0, 1}, (float[3]){1, 1, 1});
    memcpy(before, take_frame(rig)->hash, 32);
    hash_of_fit(rig, true, fitted);
    assert_memory_equal(before, fitted, 32);
    hash_of_fit(rig, false, fitted);
    assert_memory_not_equal(before, fitted, 32);
    // ... until it is given one.
    struct hgp_view_camera lens = {.view = VIEW, .has_vfov_rad = true, .vfov_rad = 0.8f};
    reopen_view(rig);
    link_expect(rig, link_ask(rig, 1, HGP_T_view_camera, &lens), HGP_T_ok);
    memcpy(before, take_frame(rig)->hash, 32);
    place_camera(rig, 1, (float[4]){0, 0, 0, 1}, (float[3]){1, 1, 1});
    assert_memory_equal(before, take_frame(rig)->hash, 32);
}

// A triangle that goes half a metre to the right within a second.
static const char moving[] =
    "{\"asset\":{\"version\":\"2.0\"},\"scene\":0,\"scenes\":[{\"nodes\":[0]}],"
    "\"nodes\":[{\"mesh\":0}],\"meshes\":[{\"primitives\":[{\"attributes\":{\"POSITION\":0}}]}],"
    "\"animations\":[{\"samplers\":[{\"input\":1,\"output\":2}],"
    "\"channels\":[{\"sampler\":0,\"target\":{\"node\":0,\"path\":\"translation\"}}]}],"
    "\"accessors\":[{\"bufferView\":0,\"componentType\":5126,\"count\":3,\"type\":\"VEC3\","
    "\"min\":[-1,-1,0],\"max\":[1,1,0]},"
    "{\"bufferView\":1,\"componentType\":5126,\"count\":2,\"type\":\"SCALAR\",\"min\":[0],"
    "\"max\":[1]},{\"bufferView\":2,\"componentType\":5126,\"count\":2,\"type\":\"VEC3\"}],"
    "\"bufferViews\":[{\"buffer\":0,\"byteLength\":36},"
    "{\"buffer\":0,\"byteOffset\":36,\"byteLength\":8},"
    "{\"buffer\":0,\"byteOffset\":44,\"byteLength\":24}],"
    "\"buffers\":[{\"byteLength\":68,\"uri\":\"data:application/octet-stream;base64,"
    "AACAvwAAgL8AAAAAAACAPwAAgL8AAAAAAAAAAAAAgD8AAAAAAAAAAAAAgD8AAAAAAAAAAAAAAAAAAAA/AAAA"
    "AAAAAAA="
    "\"}]}";

// The camera of a view that was given none stays where it is while an animation plays.
static void test_an_animation_does_not_move_the_camera(void **state)
{
    struct rig *rig = *state;
    const struct hgp_asset_load load = {.asset = FIRST_ID, .path = hgp_str_make("moving.gltf")};
    double still[4], posed[4];
    char path[TEST_FOLDER_MAX + 32];
    snprintf(path, sizeof path, "%s/moving.gltf", rig->root);
    FILE *file = fopen(path, "w");
    assert_non_null(file);
    assert_true(fputs(moving, file) >= 0);
    assert_int_equal(fclose(file), 0);
    link_attach(rig, 1, "a");
    set_view(rig, 96, 64);
    link_expect(rig, link_ask(rig, 1, HGP_T_asset_load, &load), HGP_T_asset_loaded);
    measure(take_frame(rig), still);
    for (int i = 0; i < 2; i++) {
        const struct hgp_animation_set pose = {
            .asset = FIRST_ID, .animation = 0, .time_s = (double)(1 - i)};
        link_expect(rig, link_ask(rig, 1, HGP_T_animation_set, &pose), HGP_T_ok);
        measure(take_frame(rig), posed);
        assert_true(fabs(posed[0] - still[0] - (i ? 0 : 0.1)) < 0.06);
    }
}

// A view that looked through a camera which is removed shows the scene, as one without a camera.
static void test_a_camera_may_be_removed(void **state)
{
    struct rig *rig = *state;
    const struct hgp_view_camera through = {.view = VIEW, .has_camera = true, .camera = EYE};
    const struct hgp_object_remove remove = {.kind = HGP_object_kind_NODE, .object = EYE};
    uint8_t fitted[32];
    link_attach(rig, 1, "a");
    set_view(rig, 96, 64);
    set_box(rig, BOX, (float[3]){1, 2, 1});
    memcpy(fitted, take_frame(rig)->hash, 32);
    place_camera(rig, 1, (float[4]){0, 0, 0, 1}, (float[3]){1, 1, 1});
    link_expect(rig, link_ask(rig, 1, HGP_T_view_camera, &through), HGP_T_ok);
    assert_memory_not_equal(fitted, take_frame(rig)->hash, 32);
    link_expect(rig, link_ask(rig, 1, HGP_T_object_remove, &remove), HGP_T_ok);
    check_fill(take_frame(rig));
    assert_memory_equal(fitted, rig->message.frame.hash, 32);
}

static void expect_same_as_environment(
    struct rig *rig, enum hgp_environment_kind kind, enum hgp_environment_kind other)
{
    uint8_t before[32];
    struct hgp_environment_set set = {.has_kind = true, .kind = kind};
    memcpy(before, take_frame(rig)->hash, 32);
    link_expect(rig, link_ask(rig, 1, HGP_T_environment_set, &set), HGP_T_ok);
    assert_memory_equal(before, take_frame(rig)->hash, 32);
    set.kind = other;
    link_expect(rig, link_ask(rig, 1, HGP_T_environment_set, &set), HGP_T_ok);
    assert_memory_not_equal(before, take_frame(rig)->hash, 32);
    set.kind = HGP_environment_kind_AUTO;
    link_expect(rig, link_ask(rig, 1, HGP_T_environment_set, &set), HGP_T_ok);
    assert_memory_equal(before, take_frame(rig)->hash, 32);
}

static void set_environment(struct rig *rig, enum hgp_environment_kind kind)
{
    const struct hgp_environment_set set = {.has_kind = true, .kind = kind};
    link_expect(rig, link_ask(rig, 1, HGP_T_environment_set, &set), HGP_T_ok);
}

// The fill is neither nothing nor the whole sky.
static void expect_fill(struct rig *rig)
{
    uint8_t before[32];
    memcpy(before, take_frame(rig)->hash, 32);
    set_environment(rig, HGP_environment_kind_SKY);
    assert_memory_not_equal(before, take_frame(rig)->hash, 32);
    set_environment(rig, HGP_environment_kind_NONE);
    assert_memory_not_equal(before, take_frame(rig)->hash, 32);
    set_environment(rig, HGP_environment_kind_AUTO);
    assert_memory_equal(before, take_frame(rig)->hash, 32);
}

static void test_a_scene_without_an_environment_is_lit(void **state)
{
    struct rig *rig = *state;
    link_attach(rig, 1, "a");
    set_view(rig, 64, 64);
    set_box(rig, BOX, (float[3]){1, 1, 1});
    expect_same_as_environment(rig, HGP_environment_kind_SKY, HGP_environment_kind_NONE);
    // With a lamp of its own the sky is a fill.
    struct hgp_light_set lamp = {.light = OTHER, .has_intensity = true, .intensity = 5};
    struct hgp_node_set node = {.node = OTHER, .has_light = true, .light = OTHER};
    link_expect(rig, link_ask(rig, 1, HGP_T_light_set, &lamp), HGP_T_ok);
    link_expect(rig, link_ask(rig, 1, HGP_T_node_set, &node), HGP_T_ok);
    expect_fill(rig);
}

// All tests share a worker, whose shaders are compiled once; each has a scene of its own, whose sky
// comes from the cache.
int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_teardown(test_all_views_fill_the_picture, link_detach),
        cmocka_unit_test_teardown(test_what_is_fitted, link_detach),
        cmocka_unit_test_teardown(test_a_turntable_stays_in_the_picture, link_detach),
        cmocka_unit_test_teardown(test_a_camera_that_sees_nothing_is_passed_over, link_detach),
        cmocka_unit_test_teardown(test_a_view_without_a_camera_shows_the_scene, link_detach),
        cmocka_unit_test_teardown(test_an_animation_does_not_move_the_camera, link_detach),
        cmocka_unit_test_teardown(test_a_camera_may_be_removed, link_detach),
        cmocka_unit_test_teardown(test_a_scene_without_an_environment_is_lit, link_detach),
    };
    return cmocka_run_group_tests(tests, link_start_with_cache, link_stop);
}
