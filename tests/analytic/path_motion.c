// path_motion.c - motion blur and the motion plane of path-traced pictures against closed forms:
// what moves in a straight line, turns, is skinned or morphed, cameras that move, lights that move.
#include <math.h>
#include <string.h>

#include "base/alloc.h"
#include "renderer/internal.h"
#include "shaders/shared/path.h"
#include "tests/analytic/path_rig.h"

enum { WIDTH = 96, HEIGHT = 32 };

static const struct hg_view_params defaults = {.width = WIDTH,
    .height = HEIGHT,
    .tonemap = HG_TONEMAP_LINEAR,
    .background = HG_BACKGROUND_NONE,
    .mode = HG_MODE_PATH,
    .filter = HG_FILTER_BOX,
    .samples = 64,
    .frame_s = 0.5f,
    .shutter_open = -0.5f,
    .shutter_close = 0.5f};

// --- scenes --------------------------------------------------------------------------------------

static struct hg_material *glow(struct rig *rig, float radiance)
{
    struct hg_material *m = rig_material(rig);
    for (int i = 0; i < 3; i++) {
        m->base_color[i] = 0.0f;
        m->emissive[i] = radiance;
    }
    m->specular.is_set = true;
    m->specular.factor = 0.0f;
    m->double_sided = true;
    return m;
}

// In the plane z = 0, around x.
static struct hg_node *bar(struct rig *rig, struct hg_material *m, float x, float half)
{
    const float corners[4][3] = {
        {x - half, -9, 0}, {x + half, -9, 0}, {x + half, 9, 0}, {x - half, 9, 0}};
    return rig_quad(rig, m, corners);
}

// --- pictures ------------------------------------------------------------------------------------

// Straight at z = 0, a pixel is 1 / 16 m: x from -3 to 3.
static const struct hg_view_camera straight = {
    .eye = {0, 0, 5}, .target = {0, 0, 0}, .orthographic = true, .half_height = 1};

static struct hg_view *settled(
    struct rig *rig, const struct hg_view_params *params, const struct hg_view_camera *camera)
{
    struct hg_view *view = path_rig_view(rig, params);
    path_rig_set_camera(view, camera);
    path_rig_settle(view);
    return view;
}

// Mean of each column of the picture's first channel.
static void columns(struct hg_view *view, double out[WIDTH])
{
    struct hg_refbuf *color = path_rig_plane(view, HG_PLANE_COLOR);
    const float *at = (const float *)(const void *)color->data;
    for (int x = 0; x < WIDTH; x++) {
        out[x] = 0;
        for (int y = 0; y < HEIGHT; y++)
            out[x] += (double)at[(y * WIDTH + x) * 4] / HEIGHT;
    }
    hg_refbuf_unref(color);
}

// Share of the time in which a bar covers x, whose centre goes evenly from a to b.
static double covered(double x, double half, double a, double b)
{
    const double low = fmax(fmin(a, b), x - half), high = fmin(fmax(a, b), x + half);
    return fmax(high - low, 0) / fabs(b - a);
}

// The same over the width of a pixel.
static double expected_at(int column, double half, double a, double b)
{
    double sum = 0;
    for (int i = 0; i < 64; i++)
        sum += covered((column + (i + 0.5) / 64) / 16 - 3, half, a, b) / 64;
    return sum;
}

static double worst(const double got[WIDTH], double half, double a, double b)
{
    double most = 0;
    for (int x = 0; x < WIDTH; x++)
        most = fmax(most, fabs(got[x] - expected_at(x, half, a, b)));
    return most;
}

static void render_columns(struct rig *rig, const struct hg_view_params *params,
    const struct hg_view_camera *camera, double out[WIDTH])
{
    struct hg_view *view = settled(rig, params, camera);
    columns(view, out);
    hg_view_destroy(view);
}

// --- what moves ----------------------------------------------------------------------------------

// 2 m a second; a frame is half a second.
static const float slide_more[9] = {-2, 0, 0, 0, 0, 0, 2, 0, 0};

static void test_straight(void **state)
{
    struct rig *rig = *state;
    static const enum hg_view_trace traces[2] = {HG_VIEW_TRACE_EMBREE, HG_VIEW_TRACE_COMPUTE};
    double got[2][WIDTH], apart = 0;
    for (int i = 0; i < 2; i++) {
        rig_scene(rig);
        path_rig_animate(
            rig, bar(rig, glow(rig, 1.0f), 0, 0.4f), HG_ANIM_TRANSLATION, 3, slide_more);
        path_rig_pose(rig, 1.0);
        struct hg_view_params params = defaults;
        params.trace = traces[i];
        render_columns(rig, &params, &straight, got[i]);
        const double off = worst(got[i], 0.4, -0.5, 0.5);
        print_message("bar that slides: %.4f off at most\n", off);
        assert_true(off < 0.01);
    }
    for (int x = 0; x < WIDTH; x++)
        apart = fmax(apart, fabs(got[0][x] - got[1][x]));
    print_message("backends: %.5f apart at most\n", apart);
    assert_true(apart < 0.002);
}

// The shutter opens at the pose.
static void test_late(void **state)
{
    struct rig *rig = *state;
    double got[WIDTH];
    rig_scene(rig);
    path_rig_animate(rig, bar(rig, glow(rig, 1.0f), 0, 0.4f), HG_ANIM_TRANSLATION, 3, slide_more);
    path_rig_pose(rig, 1.0);
    struct hg_view_params params = defaults;
    params.shutter_open = 0.0f;
    params.shutter_close = 0.75f;
    render_columns(rig, &params, &straight, got);
    assert_true(worst(got, 0.4, 0.0, 0.75) < 0.01);
}

static struct hg_node *joint(struct rig *rig)
{
    struct hg_object *object;
    assert_int_equal(hg_scene_add(rig->scene, HG_OBJECT_NODE, rig->next_id++, &object), HG_OK);
    return (struct hg_node *)object;
}

static void tell(struct hg_node *node, const float translation[3], const float rotation[4])
{
    node->moves = true;
    memcpy(node->next.translation, translation, sizeof node->next.translation);
    memcpy(node->next.rotation, rotation, sizeof node->next.rotation);
    memcpy(node->next.scale, node->scale, sizeof node->next.scale);
}

static void test_camera(void **state)
{
    struct rig *rig = *state;
    double got[WIDTH];
    rig_scene(rig);
    bar(rig, glow(rig, 1.0f), 0, 0.4f);
    struct hg_view_camera camera = straight;
    camera.moves = true;
    memcpy(camera.next_eye, camera.eye, sizeof camera.eye);
    memcpy(camera.next_target, camera.target, sizeof camera.target);
    camera.next_eye[0] = camera.next_target[0] = -1.0f;
    render_columns(rig, &defaults, &camera, got);
    print_message("camera that slides: %.4f off at most\n", worst(got, 0.4, -0.5, 0.5));
    assert_true(worst(got, 0.4, -0.5, 0.5) < 0.01);
}

// A client says where it will be, or where a node above it will be that is turned.
static void test_told(void **state)
{
    struct rig *rig = *state;
    double got[WIDTH];
    for (int above = 0; above < 2; above++) {
        rig_scene(rig);
        struct hg_node *node = bar(rig, glow(rig, 1.0f), 0, 0.4f);
        if (above) {
            const float turned[4] = {0, 0, 0.70710678f, 0.70710678f};
            struct hg_node *over = joint(rig);
            memcpy(over->rotation, turned, sizeof turned);
            for (int i = 0; i < 4; i++)
                node->rotation[i] = i < 3 ? -turned[i] : turned[i];
            assert_int_equal(hg_scene_set_parent(rig->scene, node, over), HG_OK);
            node = over;
        }
        tell(node, (const float[3]){1, 0, 0}, node->rotation);
        render_columns(rig, &defaults, &straight, got);
        print_message("told: %.4f off at most\n", worst(got, 0.4, -0.5, 0.5));
        assert_true(worst(got, 0.4, -0.5, 0.5) < 0.01);
        assert_true(node->translation[0] == 0.0f && node->moves);
    }
}

// The same way for all vertices, by a target and by a joint.
static void test_morph(void **state)
{
    struct rig *rig = *state;
    static const float weights[3] = {0, 0.5f, 1};
    double got[WIDTH];
    rig_scene(rig);
    struct hg_node *node = bar(rig, glow(rig, 1.0f), -1, 0.4f);
    struct hg_mesh *mesh = node->mesh;
    mesh->target_count = 1;
    mesh->weights = hg_calloc(1, sizeof(float));
    node->weights = hg_calloc(1, sizeof(float));
    struct hg_morph_target *target = mesh->parts[0].targets = hg_calloc(1, sizeof *target);
    assert_true(target != NULL && node->weights != NULL && mesh->weights != NULL);
    target->positions = hg_calloc(12, sizeof(float));
    assert_non_null(target->positions);
    for (int i = 0; i < 4; i++)
        target->positions[i * 3] = 2.0f;
    mesh->parts[0].bounds_max[0] += 2.0f;
    path_rig_animate(rig, node, HG_ANIM_WEIGHTS, 3, weights);
    path_rig_pose(rig, 1.0);
    render_columns(rig, &defaults, &straight, got);
    print_message("morph: %.4f off at most\n", worst(got, 0.4, -0.25, 0.25));
    assert_true(worst(got, 0.4, -0.25, 0.25) < 0.01);
    path_rig_pose(rig, 0.0); // no weight is in effect at the pose itself
    struct hg_view_params params = defaults;
    params.shutter_open = 0.0f;
    render_columns(rig, &params, &straight, got);
    assert_true(worst(got, 0.4, -1.0, -0.75) < 0.01);
}

static void test_skin(void **state)
{
    struct rig *rig = *state;
    double got[WIDTH];
    rig_scene(rig);
    struct hg_node *node = bar(rig, glow(rig, 1.0f), 0, 0.4f), *bone = joint(rig);
    struct hg_mesh_part *part = &node->mesh->parts[0];
    struct hg_asset *asset = path_rig_asset(rig);
    asset->skins = hg_calloc(1, sizeof *asset->skins);
    assert_non_null(asset->skins);
    node->skin = asset->skins[0] = hg_calloc(1, sizeof *node->skin);
    assert_non_null(node->skin);
    asset->skin_count = 1;
    node->skin->joint_count = 1;
    node->skin->joints = hg_calloc(1, sizeof(struct hg_node *));
    assert_non_null(node->skin->joints);
    node->skin->joints[0] = bone;
    part->joint_sets = 1;
    part->joints = hg_calloc(16, sizeof(uint16_t));
    part->weights = hg_calloc(16, sizeof(float));
    assert_true(part->joints != NULL && part->weights != NULL);
    for (int i = 0; i < 4; i++)
        part->weights[i * 4] = 1.0f;
    path_rig_animate(rig, bone, HG_ANIM_TRANSLATION, 3, slide_more);
    path_rig_pose(rig, 1.0);
    render_columns(rig, &defaults, &straight, got);
    print_message("skin: %.4f off at most\n", worst(got, 0.4, -0.5, 0.5));
    assert_true(worst(got, 0.4, -0.5, 0.5) < 0.01);
}

// A sector of 20 degrees that turns by 90: covered at an angle for the share of the time that it
// takes to pass. Chords in place of arcs would be far off.
static void check_turn(struct rig *rig, bool told)
{
    const float w = 0.17632698f; // tan 10 degrees
    const float corners[4][3] = {{0, 0, 0}, {20, -20 * w, 0}, {20, 20 * w, 0}, {0, 0, 0}};
    const float turns[12] = {
        0, 0, -0.70710678f, 0.70710678f, 0, 0, 0, 1, 0, 0, 0.70710678f, 0.70710678f};
    rig_scene(rig);
    struct hg_node *node = rig_quad(rig, glow(rig, 1.0f), corners);
    if (told) {
        tell(node, node->translation, turns + 8);
    } else {
        path_rig_animate(rig, node, HG_ANIM_ROTATION, 3, turns); // 90 degrees a second
        path_rig_pose(rig, 1.0);
    }
    struct hg_view_params params = defaults;
    params.width = params.height = 64;
    params.samples = 256;
    params.frame_s = 1.0f;
    struct hg_view *view = settled(rig, &params, &straight);
    struct hg_refbuf *color = path_rig_plane(view, HG_PLANE_COLOR);
    const float *at = (const float *)(const void *)color->data;
    double sum = 0, want = 0, most = 0, ring[90] = {0}, wants[90] = {0};
    int counts[90] = {0};
    for (int i = 0; i < 64 * 64; i++) {
        const double x = (i % 64 + 0.5) / 32 - 1, y = 1 - (i / 64 + 0.5) / 32;
        const double radius = sqrt(x * x + y * y), angle = atan2(y, x) * 180 / M_PI;
        if (radius < 0.3 || radius > 1 || fabs(angle) >= 66)
            continue;
        const int bin = (int)((angle + 66) / 4);
        wants[bin] += covered(angle, 10, -45, 45);
        ring[bin] += (double)at[i * 4];
        counts[bin]++;
        sum += (double)at[i * 4];
        want += covered(angle, 10, -45, 45);
    }
    for (int i = 0; i < 33; i++)
        most = fmax(most, fabs(ring[i] - wants[i]) / counts[i]);
    print_message("sector that turns: %.4f of %.4f, %.4f off at most\n", sum, want, most);
    assert_true(fabs(sum / want - 1) < 0.005 && most < 0.01);
    hg_refbuf_unref(color);
    hg_view_destroy(view);
}

static void test_turn(void **state)
{
    check_turn(*state, false);
    check_turn(*state, true);
}

// Two turns in the shutter: a blade's end stays on its circle, within what 64 chords are off it
// (two thirds of 0.48 % in the mean; with 16 it would be 5 %).
static void test_turns_twice(void **state)
{
    struct rig *rig = *state;
    const float blade[4][3] = {
        {0.75f, -0.05f, 0}, {0.85f, -0.05f, 0}, {0.85f, 0.05f, 0}, {0.75f, 0.05f, 0}};
    const float h = 0.70710678f, turns[36] = {0, 0, 0, 1, 0, 0, h, h, 0, 0, 1, 0, 0, 0, h, -h, 0, 0,
                                     0, -1, 0, 0, -h, -h, 0, 0, -1, 0, 0, 0, -h, h, 0, 0, 0, 1};
    rig_scene(rig);
    path_rig_animate(rig, rig_quad(rig, glow(rig, 1.0f), blade), HG_ANIM_ROTATION, 9, turns);
    path_rig_pose(rig, 4.0);
    struct hg_view_params params = defaults;
    params.width = params.height = 128;
    params.frame_s = 8.0f;
    struct hg_view *view = settled(rig, &params, &straight);
    struct hg_refbuf *color = path_rig_plane(view, HG_PLANE_COLOR);
    const float *at = (const float *)(const void *)color->data;
    double sum = 0, radii = 0, want = 0;
    for (int i = 0; i < 128 * 128; i++) {
        const double x = (i % 128 + 0.5) / 64 - 1, y = 1 - (i / 128 + 0.5) / 64;
        sum += (double)at[i * 4];
        radii += (double)at[i * 4] * sqrt(x * x + y * y);
    }
    for (int i = 0; i < 100; i++)
        want += hypot(0.755 + 0.01 * (i % 10), 0.01 * (i / 10) - 0.045) / 100;
    print_message(
        "two turns: mean radius %.5f of %.5f, area %.5f of 0.01\n", radii / sum, want, sum / 4096);
    assert_true(fabs(radii / sum / want - 1) < 0.005);
    assert_true(fabs(sum / 4096 / 0.01 - 1) < 0.01);
    hg_refbuf_unref(color);
    hg_view_destroy(view);
}

// --- what does not -------------------------------------------------------------------------------

static void lit_floor(struct rig *rig, bool moves)
{
    const float floor[4][3] = {{-3, -1, 2}, {3, -1, 2}, {3, -1, -2}, {-3, -1, -2}};
    const float lamp[4][3] = {
        {-0.4f, 0, -0.4f}, {0.4f, 0, -0.4f}, {0.4f, 0, 0.4f}, {-0.4f, 0, 0.4f}};
    static const float tilt[12] = {0, 0, -0.5f, 0.8660254f, 0, 0, 0, 1, 0, 0, 0.5f, 0.8660254f};
    static const float rest[9] = {0};
    rig_scene(rig);
    struct hg_material *white = rig_material(rig);
    white->specular.is_set = true;
    white->specular.factor = 0.0f;
    rig_quad(rig, white, floor);
    struct hg_material *light = glow(rig, 4.0f);
    light->double_sided = false; // shines down
    struct hg_node *node = rig_quad(rig, light, lamp);
    path_rig_animate(rig, node, HG_ANIM_TRANSLATION, 3, moves ? slide_more : rest);
    if (moves)
        path_rig_animate(rig, node, HG_ANIM_ROTATION, 3, tilt);
    path_rig_pose(rig, 1.0);
}

static const struct hg_view_camera above = {
    .eye = {0, 5, 0.01f}, .target = {0, -1, 0}, .vfov_rad = 0.6f};

// A shutter over what stands still is the same picture to the bit.
static void test_still(void **state)
{
    struct rig *rig = *state;
    struct hg_refbuf *color[2];
    lit_floor(rig, false);
    for (int i = 0; i < 2; i++) {
        struct hg_view_params params = defaults;
        if (i == 0)
            params.shutter_open = params.shutter_close = 0.0f;
        struct hg_view *view = settled(rig, &params, &above);
        color[i] = path_rig_plane(view, HG_PLANE_COLOR);
        hg_view_destroy(view);
    }
    assert_memory_equal(color[0]->data, color[1]->data, color[0]->size);
    hg_refbuf_unref(color[0]);
    hg_refbuf_unref(color[1]);
}

static double mean_of(struct rig *rig, const struct hg_view_params *params)
{
    double got[WIDTH], sum = 0;
    render_columns(rig, params, &above, got);
    for (int x = 0; x < WIDTH; x++)
        sum += got[x] / WIDTH;
    return sum;
}

// A lamp that slides and turns: rays to it, rays that run into it, both; and the mean of pictures
// of many moments.
static void test_lamp(void **state)
{
    struct rig *rig = *state;
    double mean[4] = {0};
    for (uint32_t use = 1; use <= 3; use++) {
        lit_floor(rig, true);
        rig->renderer->context.overrides.path_estimators = use;
        struct hg_view_params params = defaults;
        params.samples = use == HG_PATH_USE_SURFACES ? 1024 : 128;
        params.max_bounces = 2;
        mean[use - 1] = mean_of(rig, &params);
    }
    rig->renderer->context.overrides.path_estimators = 0;
    for (int i = 0; i < 16; i++) {
        lit_floor(rig, true);
        path_rig_pose(rig, 1.0 + ((i + 0.5) / 16 - 0.5) * 0.5);
        struct hg_view_params params = defaults;
        params.samples = 32;
        params.max_bounces = 2;
        params.shutter_open = params.shutter_close = 0.0f;
        mean[3] += mean_of(rig, &params) / 16;
    }
    print_message(
        "lamp that moves: %.5f %.5f %.5f, moments %.5f\n", mean[0], mean[1], mean[2], mean[3]);
    for (int i = 0; i < 3; i++)
        assert_true(fabs(mean[i] / mean[3] - 1.0) < 0.01);
}

// --- frames before and after ---------------------------------------------------------------------

// 1 m a frame and 16 px a metre; the camera goes the other way by a quarter of that.
static void check_vectors(struct rig *rig, bool told)
{
    rig_scene(rig);
    struct hg_node *node = bar(rig, glow(rig, 1.0f), 0, 0.4f);
    if (told)
        tell(node, (const float[3]){1, 0, 0}, node->rotation);
    else
        path_rig_animate(rig, node, HG_ANIM_TRANSLATION, 3, slide_more);
    struct hg_material *m = glow(rig, 0.5f);
    const float wall[4][3] = {{-9, -9, -1}, {9, -9, -1}, {9, 9, -1}, {-9, 9, -1}};
    rig_quad(rig, m, wall);
    if (!told)
        path_rig_pose(rig, 1.0);
    for (int i = 0; i < 4; i++) {
        struct hg_view_params params = defaults;
        struct hg_view_camera camera = straight;
        params.samples = 4;
        params.planes = 1u << HG_PLANE_MOTION;
        if (i < 2)
            params.shutter_open = params.shutter_close = 0.0f;
        camera.moves = i % 2 == 1;
        memcpy(camera.next_eye, camera.eye, sizeof camera.eye);
        memcpy(camera.next_target, camera.target, sizeof camera.target);
        camera.next_eye[0] = camera.next_target[0] = -0.25f;
        struct hg_view *view = settled(rig, &params, &camera);
        struct hg_refbuf *motion = path_rig_plane(view, HG_PLANE_MOTION);
        const float *at = (const float *)(const void *)motion->data + HEIGHT / 2 * WIDTH * 4;
        const float pan = camera.moves ? 4.0f : 0.0f;
        const int places[2] = {WIDTH / 2, 4};
        for (int k = 0; k < 2; k++) {
            const float *v = at + places[k] * 4, far = pan + (k == 0 ? 16.0f : 0.0f);
            if (k == 0 && i >= 2)
                continue; // bar and wall, mixed
            assert_true(fabsf(v[0] + far) < 0.01f && fabsf(v[2] - far) < 0.01f);
            assert_true(fabsf(v[1]) < 0.01f && fabsf(v[3]) < 0.01f);
        }
        hg_refbuf_unref(motion);
        hg_view_destroy(view);
    }
}

static void test_vectors(void **state)
{
    check_vectors(*state, false);
    check_vectors(*state, true);
}

// A camera that turns about its own place: points at any distance and the background move alike.
static void test_vectors_turn(void **state)
{
    struct rig *rig = *state;
    const float half[4][3] = {{0, -9, -5}, {9, -9, -5}, {9, 9, -5}, {0, 9, -5}};
    const float turn = 0.05f;
    rig_scene(rig);
    rig_quad(rig, glow(rig, 1.0f), half);
    struct hg_view_params params = defaults;
    params.samples = 4;
    params.shutter_open = params.shutter_close = 0.0f;
    params.planes = 1u << HG_PLANE_MOTION;
    struct hg_view_camera camera = {.eye = {0, 0, 0}, .target = {0, 0, -1}, .vfov_rad = 0.5f};
    camera.moves = true;
    camera.next_target[0] = tanf(turn);
    camera.next_target[2] = -1.0f;
    struct hg_view *view = settled(rig, &params, &camera);
    struct hg_refbuf *motion = path_rig_plane(view, HG_PLANE_MOTION);
    const float *at = (const float *)(const void *)motion->data + HEIGHT / 2 * WIDTH * 4;
    const double focal = HEIGHT / 2 / tan(0.25); // px
    for (int x = 8; x < WIDTH; x += 16) {
        const double angle = atan((x + 0.5 - WIDTH / 2) / focal);
        const double back = focal * (tan(angle + (double)turn) - tan(angle));
        const double on = focal * (tan(angle - (double)turn) - tan(angle));
        assert_true(fabs((double)at[x * 4] - back) < 0.05);
        assert_true(fabs((double)at[x * 4 + 2] - on) < 0.05);
    }
    hg_refbuf_unref(motion);
    hg_view_destroy(view);
}

// --- punctual lights -----------------------------------------------------------------------------

static void lambert_floor(struct rig *rig)
{
    const float floor[4][3] = {{-4, -1, 2}, {4, -1, 2}, {4, -1, -2}, {-4, -1, -2}};
    rig_scene(rig);
    rig->scene->environment.kind = HG_ENV_NONE;
    rig_quad(rig, path_rig_lambert(rig, 0.5f), floor);
}

// Light of a point 1 m above the floor, whose x goes evenly from a to b, on the pixels of a column:
// the integral of du / (r^2 + u^2)^(3/2) is u / (r^2 sqrt(r^2 + u^2)).
static double lit_from(int column, double a, double b)
{
    double sum = 0;
    for (int i = 0; i < 8 * HEIGHT; i++) {
        const double x = (column + 0.5) / 16 - 3, z = (i + 0.5) / (8 * HEIGHT) * 2 - 1;
        const double r2 = 1 + z * z, u0 = a - x, u1 = b - x;
        const double whole = u1 / (r2 * sqrt(r2 + u1 * u1)) - u0 / (r2 * sqrt(r2 + u0 * u0));
        sum += whole / (b - a) / (8 * HEIGHT);
    }
    return 0.5 / M_PI * sum;
}

static void test_point(void **state)
{
    static const struct hg_view_camera flat = {.eye = {0, 5, 0},
        .target = {0, 0, 0},
        .up = {0, 0, -1},
        .orthographic = true,
        .half_height = 1};
    struct rig *rig = *state;
    static const double at[3] = {0, 0, 0}, down[3] = {0, -1, 0};
    static const float keys[9] = {-2, 0, 0, 0, 0, 0, 2, 0, 0};
    double got[WIDTH], most = 0;
    lambert_floor(rig);
    struct hg_light *light = rig_light(rig, HG_LIGHT_POINT, at, down);
    path_rig_animate(rig, rig_node_of(rig, light), HG_ANIM_TRANSLATION, 3, keys);
    path_rig_pose(rig, 1.0);
    struct hg_view_params params = defaults;
    params.samples = 256;
    render_columns(rig, &params, &flat, got);
    for (int x = 0; x < WIDTH; x++)
        most = fmax(most, fabs(got[x] / lit_from(x, -0.5, 0.5) - 1.0));
    print_message("point light that slides: %.4f off at most\n", most);
    assert_true(most < 0.01);
}

// A spot light and a sun that turn, with what moves in between: the mean of pictures of moments.
static void turning_lights(struct rig *rig, bool sized)
{
    static const double at[3] = {0.5, 0.5, 0}, down[3] = {0, -1, 0};
    static const float turn[2][12] = {
        {-0.92388f, 0, 0, 0.382683f, -0.707107f, 0, 0, 0.707107f, -0.382683f, 0, 0, 0.92388f},
        {0, 0.5f, 0, 0.8660254f, -0.5f, 0, 0, 0.8660254f, -0.8660254f, 0, 0, 0.5f}};
    static const float rise[9] = {-1, 0, 0, 0.5f, 0.5f, 0, 1, 2, 0};
    lambert_floor(rig);
    for (int i = 0; i < 2; i++) {
        struct hg_light *light =
            rig_light(rig, i == 0 ? HG_LIGHT_SPOT : HG_LIGHT_DIRECTIONAL, at, down);
        light->intensity = i == 0 ? 4.0f : 0.5f;
        if (sized && i == 0) {
            light->kind = HG_LIGHT_RECTANGLE;
            light->width = 0.6f;
            light->height = 0.2f;
        } else if (sized) {
            light->angular_diameter_rad = 0.2f;
        }
        struct hg_node *node = rig_node_of(rig, light);
        path_rig_animate(rig, node, HG_ANIM_ROTATION, 3, turn[i]);
        if (i == 0)
            path_rig_animate(rig, node, HG_ANIM_TRANSLATION, 3, rise);
    }
}

static void check_turning_lights(struct rig *rig, bool sized)
{
    enum { MOMENTS = 32 };
    double got[WIDTH], still[WIDTH], want[WIDTH] = {0}, most = 0, mean = 0, change = 0;
    struct hg_view_params params = defaults;
    params.samples = 512;
    params.max_bounces = 2;
    turning_lights(rig, sized);
    path_rig_pose(rig, 1.0);
    render_columns(rig, &params, &above, got);
    params.samples = 8;
    params.shutter_open = params.shutter_close = 0.0f;
    for (int i = 0; i < MOMENTS; i++) {
        turning_lights(rig, sized);
        path_rig_pose(rig, 1.0 + ((i + 0.5) / MOMENTS - 0.5) * 0.5);
        params.seed = (uint32_t)i; // all samples of a pass lie at one place in their pixels
        render_columns(rig, &params, &above, still);
        for (int x = 0; x < WIDTH; x++)
            want[x] += still[x] / MOMENTS;
    }
    for (int x = 0; x < WIDTH; x++)
        mean += want[x] / WIDTH;
    for (int x = 0; x < WIDTH; x++) {
        most = fmax(most, fabs(got[x] - want[x]) / mean);
        change = fmax(change, fabs(still[x] - want[x]) / mean);
    }
    print_message("lights that turn%s: %.4f of the mean off at most, a moment %.2f\n",
        sized ? ", with sizes" : "", most, change);
    assert_true(most < 0.02);
    assert_true(change > 0.2); // it matters
}

static void test_turning_lights(void **state)
{
    check_turning_lights(*state, false);
}

// A rectangle and a sun with a disc: rays that run into them meet them where they are at their
// time.
static void test_turning_sizes(void **state)
{
    check_turning_lights(*state, true);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_straight),
        cmocka_unit_test(test_late),
        cmocka_unit_test(test_camera),
        cmocka_unit_test(test_told),
        cmocka_unit_test(test_morph),
        cmocka_unit_test(test_skin),
        cmocka_unit_test(test_turn),
        cmocka_unit_test(test_turns_twice),
        cmocka_unit_test(test_still),
        cmocka_unit_test(test_lamp),
        cmocka_unit_test(test_point),
        cmocka_unit_test(test_turning_lights),
        cmocka_unit_test(test_turning_sizes),
        cmocka_unit_test(test_vectors),
        cmocka_unit_test(test_vectors_turn),
    };
    return cmocka_run_group_tests(tests, rig_set_up, rig_tear_down);
}
