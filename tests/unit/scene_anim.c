// Poses against closed forms (glTF 2.0, section 3.11 and appendix C). Every animation goes through
// the loader.
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <cmocka.h>

#include <math.h>

#include "scene_memory.h"

#define ROOT_HALF 0.70710678f

static struct memory_gltf file;

struct channel {
    const char *path, *interpolation, *type;
    uint32_t keys, values; // elements of the output accessor
    const float *times, *output;
    size_t output_bytes;
};

// One node with a mesh of two morph targets, moved by one channel.
static struct hg_asset *load_channel(const struct channel *c)
{
    memset(&file, 0, sizeof file);
    uint32_t input = memory_floats(&file, "SCALAR", c->keys, c->times, c->keys * sizeof(float));
    uint32_t output = memory_floats(&file, c->type, c->values, c->output, c->output_bytes);
    uint32_t zero =
        memory_accessor(&file, -1, FLOAT, "VEC3", 3, ",\"min\":[0,0,0],\"max\":[0,0,0]");
    char rest[1024];
    snprintf(rest, sizeof rest,
        "\"scene\":0,\"scenes\":[{\"nodes\":[0]}],\"nodes\":[{\"mesh\":0}],"
        "\"meshes\":[{\"primitives\":[{\"attributes\":{\"POSITION\":%u},"
        "\"targets\":[{\"POSITION\":%u},{\"POSITION\":%u}]}]}],"
        "\"animations\":[{\"samplers\":[{\"input\":%u,\"output\":%u%s%s%s}],"
        "\"channels\":[{\"sampler\":0,\"target\":{\"node\":0,\"path\":\"%s\"}}]}]",
        zero, zero, zero, input, output, c->interpolation ? ",\"interpolation\":\"" : "",
        c->interpolation ? c->interpolation : "", c->interpolation ? "\"" : "", c->path);
    struct hg_asset *asset;
    struct hg_error err;
    if (memory_load(&file, rest, &asset, &err) != HG_OK)
        fail_msg("%s at '%s'", err.reason, err.where);
    assert_int_equal(asset->animation_count, 1);
    assert_int_equal(asset->animations[0].channel_count, 1);
    assert_true(asset->animations[0].duration_s == (double)c->times[c->keys - 1]);
    return asset;
}

static void expect(struct hg_asset *asset, double t, const float *pose, const float *want, int n)
{
    assert_int_equal(hg_asset_pose(asset, 0, t), HG_OK);
    for (int i = 0; i < n; i++)
        if (!(fabsf(pose[i] - want[i]) <= 2e-6f * fmaxf(1, fabsf(want[i]))))
            fail_msg(
                "t %g, component %d: %.8g, expected %.8g", t, i, (double)pose[i], (double)want[i]);
}

static const float times[] = {0.5f, 1, 3};
static const float points[] = {1, -2, 4, 3, 2, 0, -5, 6, 8};

static void test_step(void **state)
{
    (void)state;
    const struct channel c = {"translation", "STEP", "VEC3", 3, 3, times, points, sizeof points};
    struct hg_asset *asset = load_channel(&c);
    const float *pose = asset->nodes[0]->translation;
    static const struct {
        double t;
        int key;
    } at[] = {{-1, 0}, {0, 0}, {0.5, 0}, {0.999, 0}, {1, 1}, {2.999, 1}, {3, 2}, {99, 2}, {0.7, 0}};
    for (size_t i = 0; i < sizeof at / sizeof *at; i++)
        expect(asset, at[i].t, pose, points + (size_t)at[i].key * 3, 3);
    hg_asset_destroy(asset);
}

static void test_linear(void **state)
{
    (void)state;
    static const char *const paths[] = {"translation", "scale"};
    static const char *const names[] = {"LINEAR", NULL}; // the default is linear
    for (int p = 0; p < 2; p++) {
        const struct channel c = {paths[p], names[p], "VEC3", 3, 3, times, points, sizeof points};
        struct hg_asset *asset = load_channel(&c);
        const float *pose = p ? asset->nodes[0]->scale : asset->nodes[0]->translation;
        for (int i = 0; i <= 40; i++) {
            float t = -0.25f + 0.1f * (float)i, want[3];
            float clamped = fminf(fmaxf(t, 0.5f), 3);
            int k = clamped >= 1;
            float s = (clamped - times[k]) / (times[k + 1] - times[k]);
            for (int a = 0; a < 3; a++)
                want[a] = points[k * 3 + a] * (1 - s) + points[k * 3 + 3 + a] * s;
            expect(asset, (double)t, pose, want, 3);
        }
        hg_asset_destroy(asset);
    }
}

static bool tells_of_times(const struct hg_asset *asset, const char *what)
{
    bool told = false;
    for (uint32_t i = 0; i < asset->warning_count; i++)
        told |= strstr(asset->warnings[i].reason, "INPUT_NON_INCREASING") != NULL &&
                strstr(asset->warnings[i].reason, what) != NULL;
    return told;
}

// Two keys at one time are a step, keys that go back in time are dropped; both are warned of.
static void test_times_that_do_not_grow(void **state)
{
    (void)state;
    static const float odd[] = {0, 1, 1, 1, 0.5f, NAN, 2}, end[] = {0, 2};
    static const float values[] = {0, 0, 0, 1, 0, 0, 7, 0, 0, 5, 0, 0, 9, 0, 0, 9, 0, 0, 6, 0, 0};
    const struct channel c = {"translation", "LINEAR", "VEC3", 7, 7, odd, values, sizeof values};
    struct hg_asset *asset = load_channel(&c);
    const float *pose = asset->nodes[0]->translation;
    static const float at[][2] = {
        {0, 0}, {0.5f, 0.5f}, {0.999f, 0.999f}, {1, 5}, {1.5f, 5.5f}, {2, 6}};
    assert_int_equal(asset->animations[0].channels[0].key_count, 4);
    for (size_t i = 0; i < sizeof at / sizeof *at; i++)
        expect(asset, (double)at[i][0], pose, (const float[]){at[i][1], 0, 0}, 3);
    assert_true(tells_of_times(asset, "at time 2; 4 of 7 keys are used"));
    hg_asset_destroy(asset);
    const struct channel sound = {
        "translation", "STEP", "VEC3", 2, 2, end, values, 6 * sizeof(float)};
    asset = load_channel(&sound);
    assert_false(tells_of_times(asset, ""));
    hg_asset_destroy(asset);
}

// A turn about z by `angle` has the quaternion (0, 0, sin angle/2, cos angle/2).
static void test_slerp(void **state)
{
    (void)state;
    static const float unit[] = {0, 1, 2};
    const float quarter = 1.57079633f;
    // 0, 90 degrees stored with the opposite sign, 180: each quarter is the short way.
    static const float turns[] = {0, 0, 0, 1, 0, 0, -ROOT_HALF, -ROOT_HALF, 0, 0, 1, 0};
    const struct channel c = {"rotation", "LINEAR", "VEC4", 3, 3, unit, turns, sizeof turns};
    struct hg_asset *asset = load_channel(&c);
    const float *q = asset->nodes[0]->rotation;
    for (int i = 0; i <= 20; i++) {
        double t = i * 0.1;
        assert_int_equal(hg_asset_pose(asset, 0, t), HG_OK);
        float half = (float)t * quarter / 2;
        float sign = q[2] * sinf(half) + q[3] * cosf(half) < 0 ? -1.0f : 1.0f;
        float want[4] = {0, 0, sign * sinf(half), sign * cosf(half)};
        expect(asset, t, q, want, 4);
    }
    hg_asset_destroy(asset);
    // An arc too short for sin: still between the ends and of length 1.
    static const float close[] = {0, 0, 0, 1, 0, 0, 1e-4f, 1, 0, 0, 2e-4f, 1};
    const struct channel small = {"rotation", "LINEAR", "VEC4", 3, 3, unit, close, sizeof close};
    asset = load_channel(&small);
    expect(asset, 0.5, asset->nodes[0]->rotation, (const float[]){0, 0, 5e-5f, 1}, 4);
    hg_asset_destroy(asset);
}

// The Hermite spline of a cubic polynomial is the polynomial itself.
static float cubic(int axis, float t)
{
    static const float k[3][4] = {{1, 2, -3, 0.5f}, {0, -1, 0.25f, 0.75f}, {4, 0, 1, -1}};
    const float *p = k[axis];
    return p[0] + t * (p[1] + t * (p[2] + t * p[3]));
}

static float cubic_slope(int axis, float t)
{
    static const float k[3][3] = {{2, -6, 1.5f}, {-1, 0.5f, 2.25f}, {0, 2, -3}};
    return k[axis][0] + t * (k[axis][1] + t * k[axis][2]);
}

static void test_cubic(void **state)
{
    (void)state;
    float values[27];
    for (int key = 0; key < 3; key++)
        for (int a = 0; a < 3; a++) {
            values[key * 9 + a] = cubic_slope(a, times[key]); // in-tangent
            values[key * 9 + 3 + a] = cubic(a, times[key]);
            values[key * 9 + 6 + a] = cubic_slope(a, times[key]); // out-tangent
        }
    // The first in-tangent and the last out-tangent have no meaning.
    values[0] = values[1] = values[2] = 1e6f;
    values[24] = values[25] = values[26] = -1e6f;
    const struct channel c = {
        "translation", "CUBICSPLINE", "VEC3", 3, 9, times, values, sizeof values};
    struct hg_asset *asset = load_channel(&c);
    for (int i = 0; i <= 40; i++) {
        float t = -0.25f + 0.1f * (float)i, clamped = fminf(fmaxf(t, 0.5f), 3), want[3];
        for (int a = 0; a < 3; a++)
            want[a] = cubic(a, clamped);
        assert_int_equal(hg_asset_pose(asset, 0, (double)t), HG_OK);
        for (int a = 0; a < 3; a++)
            assert_float_equal(asset->nodes[0]->translation[a], want[a], 3e-5f);
    }
    hg_asset_destroy(asset);
}

// Halfway with zero tangents is the mean; rotations are made unit after the spline.
static void test_cubic_rotation(void **state)
{
    (void)state;
    static const float unit[] = {0, 1};
    static const float values[] = {0, 0, 0, 0, 0, 0, 0, 1, 0, 0, 0, 0, //
        0, 0, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0};
    const struct channel c = {"rotation", "CUBICSPLINE", "VEC4", 2, 6, unit, values, sizeof values};
    struct hg_asset *asset = load_channel(&c);
    const float *q = asset->nodes[0]->rotation;
    expect(asset, 0.5, q, (const float[]){0, ROOT_HALF, 0, ROOT_HALF}, 4);
    // s = 1/4: the weights are 27/32 and 5/32.
    float n = sqrtf(27 * 27 + 5 * 5);
    expect(asset, 0.25, q, (const float[]){0, 5 / n, 0, 27 / n}, 4);
    expect(asset, 1, q, (const float[]){0, 1, 0, 0}, 4);
    hg_asset_destroy(asset);
}

static void test_weights(void **state)
{
    (void)state;
    static const float weights[] = {0, 1, 1, 0.5f, 0.25f, 0};
    const struct channel c = {"weights", "LINEAR", "SCALAR", 3, 6, times, weights, sizeof weights};
    struct hg_asset *asset = load_channel(&c);
    const float *w = asset->nodes[0]->weights;
    assert_non_null(w);
    expect(asset, 0, w, weights, 2);
    expect(asset, 0.75, w, (const float[]){0.5f, 0.75f}, 2);
    expect(asset, 2, w, (const float[]){0.625f, 0.25f}, 2);
    expect(asset, 7, w, weights + 4, 2);
    hg_asset_destroy(asset);
    // in, value, out of both targets per key
    static const float unit[] = {0, 2};
    static const float spline[] = {0, 0, 0, 1, 1, 0, 0, 0, 1, 0, 0, 0};
    const struct channel s = {
        "weights", "CUBICSPLINE", "SCALAR", 2, 12, unit, spline, sizeof spline};
    asset = load_channel(&s);
    // s = 1/2: 1/2 v0 + dt/8 b0 + 1/2 v1
    expect(asset, 1, asset->nodes[0]->weights, (const float[]){0.75f, 0.5f}, 2);
    hg_asset_destroy(asset);
}

static void test_normalized_outputs(void **state)
{
    (void)state;
    static const float unit[] = {0, 1};
    static const int16_t turns[] = {0, 0, 0, 32767, 0, 32767, 0, 0};
    memset(&file, 0, sizeof file);
    memory_floats(&file, "SCALAR", 2, unit, sizeof unit);
    uint32_t view = memory_view(&file, turns, sizeof turns, 0);
    memory_accessor(&file, (int)view, SHORT, "VEC4", 2, ",\"normalized\":true");
    struct hg_asset *asset;
    struct hg_error err;
    enum hg_status status = memory_load(&file,
        "\"scene\":0,\"scenes\":[{\"nodes\":[0]}],\"nodes\":[{}],"
        "\"animations\":[{\"samplers\":[{\"input\":0,\"output\":1}],"
        "\"channels\":[{\"sampler\":0,\"target\":{\"node\":0,\"path\":\"rotation\"}}]}]",
        &asset, &err);
    assert_int_equal(status, HG_OK);
    expect(asset, 0.5, asset->nodes[0]->rotation, (const float[]){0, ROOT_HALF, 0, ROOT_HALF}, 4);
    hg_asset_destroy(asset);
}

static void test_single_key_and_numbers(void **state)
{
    (void)state;
    const struct channel c = {"scale", "LINEAR", "VEC3", 1, 1, times, points, 3 * sizeof(float)};
    struct hg_asset *asset = load_channel(&c);
    for (int i = -1; i < 3; i++)
        expect(asset, i, asset->nodes[0]->scale, points, 3);
    assert_int_equal(hg_asset_pose(asset, -1, 0), HG_OK);
    assert_int_equal(hg_asset_pose(asset, 1, 0), HG_E_NOTFOUND);
    assert_int_equal(hg_asset_pose(asset, -2, 0), HG_E_NOTFOUND);
    hg_asset_destroy(asset);
}

// Code that keeps what was made from a node must see that a pose changed it.
static void test_poses_raise_revisions(void **state)
{
    (void)state;
    const struct channel c = {"translation", NULL, "VEC3", 3, 3, times, points, sizeof points};
    struct hg_asset *asset = load_channel(&c);
    struct hg_scene *scene;
    assert_int_equal(hg_scene_create(&scene), HG_OK);
    assert_int_equal(hg_scene_add_asset(scene, asset, NULL), HG_OK);
    for (int i = 0; i < 5; i++)
        hg_scene_publish(scene);
    const struct hg_node *node = asset->nodes[0];
    const uint64_t before = node->head.revision;
    assert_true(before < scene->revision);
    assert_int_equal(hg_asset_pose(asset, 1, 1), HG_E_NOTFOUND);
    assert_int_equal(node->head.revision, before);
    assert_int_equal(hg_asset_pose(asset, 0, 1), HG_OK);
    assert_int_equal(node->head.revision, scene->revision + 1);
    hg_scene_publish(scene);
    assert_int_equal(node->head.revision, scene->revision);
    hg_scene_destroy(scene);
}

// A node that a client moves after it was posed goes its own way at other times, comes back to the
// bit, and follows the animation again from the next pose on.
static void test_next_places(void **state)
{
    (void)state;
    const struct channel c = {"translation", NULL, "VEC3", 3, 3, times, points, sizeof points};
    const float frames[] = {0.5f, -1, 1, 0.25f}, place[3] = {0.1f, 0.2f, 0.3f};
    struct hg_asset *asset = load_channel(&c);
    struct hg_pose_kept kept = {0};
    struct hg_scene *scene;
    assert_int_equal(hg_scene_create(&scene), HG_OK);
    assert_int_equal(hg_scene_add_asset(scene, asset, NULL), HG_OK);
    assert_false(hg_scene_moves(scene));
    assert_int_equal(hg_asset_pose(asset, 0, 1), HG_OK);
    struct hg_node *node = asset->nodes[0];
    memcpy(node->translation, place, sizeof place);
    node->moves = true;
    for (int i = 0; i < 3; i++) {
        node->next.translation[i] = place[i] + (float)i;
        node->next.scale[i] = 3;
    }
    node->next.rotation[2] = node->next.rotation[3] = sqrtf(0.5f); // 90 degrees about z
    for (int k = 0; k < 4; k++) {
        const float f = frames[k], half = f * (float)M_PI / 4;
        assert_int_equal(hg_scene_pose_shift(scene, (double)f, (double)f, &kept), HG_OK);
        for (int i = 0; i < 3; i++) {
            assert_float_equal(node->translation[i], place[i] + f * (float)i, 1e-6f);
            assert_float_equal(node->scale[i], 1 + 2 * f, 1e-6f);
        }
        assert_float_equal(node->rotation[2], sinf(half), 1e-6f);
        assert_float_equal(node->rotation[3], cosf(half), 1e-6f);
    }
    hg_scene_pose_restore(scene, &kept);
    assert_memory_equal(node->translation, place, sizeof place);
    assert_true(node->rotation[3] == 1 && node->scale[0] == 1);
    assert_true(hg_scene_moves(scene) && node->moves);
    assert_int_equal(hg_asset_pose(asset, 0, 1), HG_OK);
    assert_false(node->moves);
    hg_scene_destroy(scene);
}

// What was posed has its rest pose for a while, and comes back to the bit.
static void test_rest_pose(void **state)
{
    (void)state;
    const struct channel c = {"translation", NULL, "VEC3", 3, 3, times, points, sizeof points};
    static const float rest[3];
    struct hg_asset *asset = load_channel(&c);
    struct hg_pose_kept kept = {0};
    struct hg_scene *scene;
    assert_int_equal(hg_scene_create(&scene), HG_OK);
    assert_int_equal(hg_scene_add_asset(scene, asset, NULL), HG_OK);
    const float *at = asset->nodes[0]->translation;
    for (int k = 0; k < 3; k++) {
        assert_int_equal(hg_asset_pose(asset, 0, (double)times[k]), HG_OK);
        assert_int_equal(hg_scene_pose_rest(scene, &kept), HG_OK);
        assert_memory_equal(at, rest, sizeof rest);
        hg_scene_pose_restore(scene, &kept);
        assert_memory_equal(at, &points[(ptrdiff_t)3 * k], sizeof rest);
    }
    hg_scene_destroy(scene);
}

// Animations of one key of two nodes: "walk" and "run" both move the first node, "door" sizes the
// second one, and so does the last one, which sizes the first one as well.
static struct hg_asset *load_conflicts(struct hg_scene **scene)
{
    static const float zero = 0, walk[] = {1, 0, 0}, run[] = {2, 0, 0}, door[] = {1, 3, 1};
    memset(&file, 0, sizeof file);
    memory_floats(&file, "SCALAR", 1, &zero, sizeof zero);
    memory_floats(&file, "VEC3", 1, walk, sizeof walk);
    memory_floats(&file, "VEC3", 1, run, sizeof run);
    memory_floats(&file, "VEC3", 1, door, sizeof door);
    struct hg_asset *asset;
    struct hg_error err;
    if (memory_load(&file,
            "\"scene\":0,\"scenes\":[{\"nodes\":[0,1]}],\"nodes\":[{},{}],\"animations\":["
            "{\"samplers\":[{\"input\":0,\"output\":1}],\"channels\":["
            "{\"sampler\":0,\"target\":{\"node\":0,\"path\":\"translation\"}}]},"
            "{\"samplers\":[{\"input\":0,\"output\":2}],\"channels\":["
            "{\"sampler\":0,\"target\":{\"node\":0,\"path\":\"translation\"}},"
            "{\"sampler\":0,\"target\":{\"node\":1,\"path\":\"translation\"}}]},"
            "{\"samplers\":[{\"input\":0,\"output\":3}],\"channels\":["
            "{\"sampler\":0,\"target\":{\"node\":1,\"path\":\"scale\"}}]},"
            "{\"samplers\":[{\"input\":0,\"output\":3}],\"channels\":["
            "{\"sampler\":0,\"target\":{\"node\":1,\"path\":\"scale\"}},"
            "{\"sampler\":0,\"target\":{\"node\":0,\"path\":\"scale\"}}]}]",
            &asset, &err) != HG_OK)
        fail_msg("%s at '%s'", err.reason, err.where);
    assert_int_equal(hg_scene_create(scene), HG_OK);
    assert_int_equal(hg_scene_add_asset(*scene, asset, NULL), HG_OK);
    return asset;
}

static void expect_places(const struct hg_asset *asset, float first, float second, float height)
{
    assert_true(asset->nodes[0]->translation[0] == first);
    assert_true(asset->nodes[1]->translation[0] == second);
    assert_true(asset->nodes[1]->scale[1] == height);
}

// Of animations that move the same things one is posed at a time; what it alone moved goes back to
// rest.
static void test_conflicts(void **state)
{
    (void)state;
    struct hg_scene *scene;
    struct hg_asset *asset = load_conflicts(&scene);
    struct hg_pose_kept kept = {0};
    enum { WALK, RUN, DOOR, SAME };
    assert_false(asset->animations[WALK].conflicts);
    assert_true(asset->animations[RUN].conflicts);
    assert_false(asset->animations[DOOR].conflicts);
    assert_false(asset->animations[SAME].conflicts); // what it shares it moves alike
    assert_false(hg_scene_moves(scene));
    expect_places(asset, 0, 0, 1);
    assert_int_equal(hg_asset_pose(asset, -1, 0), HG_OK);
    expect_places(asset, 1, 0, 3);
    assert_int_equal(hg_asset_pose(asset, RUN, 0), HG_OK);
    expect_places(asset, 2, 2, 3);
    assert_false(asset->animations[WALK].posed);
    assert_true(asset->animations[DOOR].posed);
    assert_int_equal(hg_asset_pose(asset, WALK, 0), HG_OK);
    expect_places(asset, 1, 0, 3);
    const uint64_t revision = asset->nodes[1]->head.revision;
    hg_scene_publish(scene);
    assert_int_equal(hg_asset_pose(asset, RUN, 0), HG_OK);
    assert_int_equal(hg_scene_pose_shift(scene, 0.5, 1, &kept), HG_OK);
    expect_places(asset, 2, 2, 3); // the walk, which came before, has no say in other times
    hg_scene_pose_restore(scene, &kept);
    hg_scene_publish(scene);
    assert_int_equal(hg_asset_pose(asset, -1, 0), HG_OK);
    expect_places(asset, 1, 0, 3);
    assert_true(asset->nodes[1]->head.revision > revision); // it went back
    hg_scene_destroy(scene);
}

// Of the takes of Blender's FBX files the one whose action is that of its object goes before
// others.
static void test_takes_of_objects(void **state)
{
    (void)state;
    static const float zero = 0, one[] = {1, 0, 0}, two[] = {2, 0, 0};
    memset(&file, 0, sizeof file);
    memory_floats(&file, "SCALAR", 1, &zero, sizeof zero);
    memory_floats(&file, "VEC3", 1, one, sizeof one);
    memory_floats(&file, "VEC3", 1, two, sizeof two);
    struct hg_scene *scene;
    struct hg_asset *asset;
    struct hg_error err;
#define TAKE(name, output)                                                                         \
    "{\"name\":\"" name "\",\"samplers\":[{\"input\":0,\"output\":" #output "}],\"channels\":["    \
    "{\"sampler\":0,\"target\":{\"node\":0,\"path\":\"translation\"}}]}"
    if (memory_load(&file,
            "\"scene\":0,\"scenes\":[{\"nodes\":[0]}],\"nodes\":[{}],\"animations\":[" TAKE(
                "hub|camAction", 1) "," TAKE("hub|hubAction", 2) "," TAKE("hub|", 1) "]",
            &asset, &err) != HG_OK)
        fail_msg("%s at '%s'", err.reason, err.where);
    assert_int_equal(hg_scene_create(&scene), HG_OK);
    assert_int_equal(hg_scene_add_asset(scene, asset, NULL), HG_OK);
    assert_true(asset->animations[0].conflicts && asset->animations[2].conflicts);
    assert_false(asset->animations[1].conflicts);
    assert_int_equal(hg_asset_pose(asset, -1, 0), HG_OK);
    assert_true(asset->nodes[0]->translation[0] == 2);
    hg_scene_destroy(scene);
}

// Two vertices of a skin with one joint: weights of joints that do not exist go to those that do.
static void test_joints_beyond_the_skin(void **state)
{
    (void)state;
    memset(&file, 0, sizeof file);
    static const uint8_t joints[] = {0, 7, 0, 0, 9, 200, 3, 1, 0, 0, 0, 0};
    static const float weights[] = {0.25f, 0.75f, 0, 0, 0.5f, 0.25f, 0.25f, 0, 1, 0, 0, 0};
    memory_floats(&file, "VEC3", 3, points, 9 * sizeof(float));
    uint32_t view = memory_view(&file, joints, sizeof joints, 4);
    memory_accessor(&file, (int)view, UBYTE, "VEC4", 3, "");
    memory_floats(&file, "VEC4", 3, weights, sizeof weights);
    struct hg_asset *asset;
    struct hg_error err;
    enum hg_status status = memory_load(&file,
        "\"scene\":0,\"scenes\":[{\"nodes\":[0,1]}],\"nodes\":[{\"mesh\":0,\"skin\":0},{}],"
        "\"skins\":[{\"joints\":[1]}],\"meshes\":[{\"primitives\":[{\"attributes\":"
        "{\"POSITION\":0,\"JOINTS_0\":1,\"WEIGHTS_0\":2}}]}]",
        &asset, &err);
    if (status)
        fail_msg("%s at '%s'", err.reason, err.where);
    const struct hg_mesh_part *part = &asset->meshes[0]->parts[0];
    assert_int_equal(part->joint_sets, 1);
    for (int v = 0; v < 3; v++)
        for (int i = 0; i < 4; i++) {
            assert_int_equal(part->joints[v * 4 + i], 0);
            assert_float_equal(part->weights[v * 4 + i], i == 0 ? 1 : 0, 1e-6f);
        }
    bool told = false;
    for (uint32_t i = 0; i < asset->warning_count; i++)
        told |= strstr(asset->warnings[i].reason, "ACCESSOR_JOINTS_INDEX_OOB: 4 joints") != NULL;
    assert_true(told);
    hg_asset_destroy(asset);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_step), cmocka_unit_test(test_linear),
        cmocka_unit_test(test_times_that_do_not_grow), cmocka_unit_test(test_slerp),
        cmocka_unit_test(test_cubic), cmocka_unit_test(test_cubic_rotation),
        cmocka_unit_test(test_weights), cmocka_unit_test(test_normalized_outputs),
        cmocka_unit_test(test_single_key_and_numbers), cmocka_unit_test(test_poses_raise_revisions),
        cmocka_unit_test(test_next_places), cmocka_unit_test(test_rest_pose),
        cmocka_unit_test(test_conflicts), cmocka_unit_test(test_takes_of_objects),
        cmocka_unit_test(test_joints_beyond_the_skin)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
