// path_edits.c - path-traced views whose scene, camera or parameters change while samples come in:
// what settles at last is the picture of a view that has never seen anything else.
#include <math.h>
#include <string.h>

#include "renderer/internal.h"
#include "tests/analytic/path_rig.h"

#define BIT(plane) (1u << HG_PLANE_##plane)
#define PLANES                                                                                     \
    (BIT(ALBEDO) | BIT(NORMAL) | BIT(DEPTH) | BIT(DIRECT_DIFFUSE) | BIT(INDIRECT_DIFFUSE) |        \
        BIT(LIGHT_GROUPS) | BIT(DRAWS) | BIT(MOTION) | BIT(POSITION))

static const float eye[3] = {0.5f, 1.2f, 3.5f}, target[3] = {0, 0.5f, 0};

#define COMMON                                                                                     \
    .width = 64, .height = 40, .tonemap = HG_TONEMAP_LINEAR, .mode = HG_MODE_PATH, .seed = 7,      \
    .frame_s = 0.5f, .max_bounces = 3, .samples = 6

static const struct {
    const char *name;
    struct hg_view_params params;
} kinds[] = {
    {"plain", {COMMON}},
    {"denoised, planes", {COMMON, .denoise = HG_DENOISE_STILL, .planes = PLANES}},
    {"shutter", {COMMON, .shutter_open = -0.5f, .shutter_close = 0.5f, .planes = PLANES}},
};
enum { KINDS = sizeof kinds / sizeof *kinds };

struct state {
    struct rig *rig;
    struct hg_view *view;
    struct hg_view_params params;
    struct hg_view_camera camera;
};

// --- edits ---------------------------------------------------------------------------------------

static void *item(const struct state *s, enum hg_object_kind kind, uint32_t index)
{
    assert_true(index < s->rig->scene->objects[kind].count);
    return s->rig->scene->objects[kind].items[index];
}

static void touch(const struct state *s, void *object)
{
    hg_scene_touch(s->rig->scene, object);
    hg_scene_publish(s->rig->scene);
}

// Nodes of the room: floor, wall, ball, lamp; then the sun.
static void move_ball(struct state *s)
{
    struct hg_node *ball = item(s, HG_OBJECT_NODE, 2);
    ball->scale[1] = 1.3f;
    touch(s, ball);
}

static void move_lamp(struct state *s)
{
    struct hg_node *lamp = item(s, HG_OBJECT_NODE, 3);
    lamp->translation[0] += 0.5f;
    touch(s, lamp);
}

static void hide_wall(struct state *s)
{
    struct hg_node *wall = item(s, HG_OBJECT_NODE, 1);
    wall->visible = false;
    touch(s, wall);
}

static void remove_wall(struct state *s)
{
    struct hg_error err = {0};
    const struct hg_node *wall = item(s, HG_OBJECT_NODE, 1);
    test_ok(hg_scene_remove(s->rig->scene, HG_OBJECT_NODE, wall->head.id, &err), &err);
    hg_scene_publish(s->rig->scene);
}

static void paint_floor(struct state *s)
{
    struct hg_material *m = item(s, HG_OBJECT_MATERIAL, 0);
    m->base_color[0] = 0.1f;
    touch(s, m);
}

static void light_floor(struct state *s)
{
    struct hg_material *m = item(s, HG_OBJECT_MATERIAL, 0);
    m->emissive[2] = 0.7f;
    touch(s, m);
}

static void blend_floor(struct state *s)
{
    struct hg_material *m = item(s, HG_OBJECT_MATERIAL, 0);
    m->alpha_mode = HG_ALPHA_BLEND;
    m->base_color[3] = 0.4f;
    touch(s, m);
}

static void catch_shadows(struct state *s)
{
    struct hg_node *floor = item(s, HG_OBJECT_NODE, 0);
    floor->catches_shadows = true;
    touch(s, floor);
}

static void dim_sun(struct state *s)
{
    struct hg_light *sun = item(s, HG_OBJECT_LIGHT, 0);
    sun->intensity = 0.25f;
    touch(s, sun);
}

static void add_lamp(struct state *s)
{
    static const double at[3] = {-1, 1, 1}, down[3] = {0, -1, 0};
    rig_light(s->rig, HG_LIGHT_POINT, at, down);
    hg_scene_publish(s->rig->scene);
}

static void change_sky(struct state *s)
{
    path_rig_environment(s->rig, 1.5f);
    hg_scene_publish(s->rig->scene);
}

static void change_pose(struct state *s)
{
    path_rig_pose(s->rig, 1.4);
    hg_scene_publish(s->rig->scene);
}

static void set_params(struct state *s)
{
    struct hg_error err = {0};
    test_ok(hg_view_set_params(s->view, &s->params, &err), &err);
}

static void look_elsewhere(struct state *s)
{
    s->camera.eye[0] = -1.0f;
    path_rig_set_camera(s->view, &s->camera);
}

static void open_lens(struct state *s)
{
    s->camera.lens_radius = 0.1f;
    s->camera.focus_distance = 3.0f;
    path_rig_set_camera(s->view, &s->camera);
}

static void grow(struct state *s)
{
    s->params.width = 90;
    s->params.height = 50;
    set_params(s);
}

static void want_more(struct state *s)
{
    s->params.samples = 9;
    s->params.seed = 8;
    set_params(s);
}

static void want_less_noise(struct state *s)
{
    s->params.noise = 0.5f;
    s->params.clamp_indirect = 2.0f;
    set_params(s);
}

static void want_no_background(struct state *s)
{
    s->params.background = HG_BACKGROUND_NONE;
    s->params.filter = HG_FILTER_BOX;
    set_params(s);
}

// From what "plain" has to what "denoised, planes" has or back, whose kernels are there.
static void want_planes(struct state *s)
{
    const struct hg_view_params *other = &kinds[s->params.planes == 0].params;
    s->params.planes = other->planes;
    s->params.denoise = other->denoise;
    set_params(s);
}

// There and back again, with pictures of the other mode in between.
static void go_in_real_time(struct state *s)
{
    struct hg_error err = {0};
    struct hg_frame_info info;
    const struct hg_view_params path = s->params;
    s->params = (struct hg_view_params){.width = path.width, .height = path.height, .samples = 4};
    set_params(s);
    for (int i = 0; i < 3; i++)
        test_ok(hg_view_step(s->view, 1, &info, &err), &err);
    s->params = path;
    set_params(s);
}

// Another view of the scene is drawn in the middle.
static void look_twice(struct state *s)
{
    struct hg_error err = {0};
    struct hg_frame_info info;
    struct hg_view *other = path_rig_view(s->rig, &kinds[2].params);
    path_rig_look(other, target, eye, 0.8f);
    hg_view_set_final(other, false);
    for (int i = 0; i < 40; i++) {
        test_ok(hg_view_step(s->view, 1, &info, &err), &err);
        test_ok(hg_view_step(other, 1, &info, &err), &err);
    }
    hg_view_destroy(other);
}

static const struct {
    const char *name;
    void (*edit)(struct state *);
} edits[] = {{"ball", move_ball}, {"lamp", move_lamp}, {"hidden", hide_wall},
    {"removed", remove_wall}, {"painted", paint_floor}, {"emits", light_floor},
    {"catches", catch_shadows}, {"blended", blend_floor}, {"sun", dim_sun}, {"added", add_lamp},
    {"sky", change_sky}, {"pose", change_pose}, {"camera", look_elsewhere}, {"lens", open_lens},
    {"size", grow}, {"samples", want_more}, {"noise", want_less_noise},
    {"background", want_no_background}, {"planes", want_planes}, {"mode", go_in_real_time},
    {"two views", look_twice}};
enum { EDITS = sizeof edits / sizeof *edits };

// --- pictures ------------------------------------------------------------------------------------

// A scene of which edits but one, a catcher of shadows, leave the kernels as they are: a set takes
// seconds to compile.
static void open_scene(struct rig *rig)
{
    static const double high[3] = {1, 3, 1}, down[3] = {-0.3, -1, -0.2}, aside[3] = {1, 1, 1};
    static const float slide[9] = {-0.3f, 0, 0, 0, 0, 0, 0.3f, 0.1f, 0};
    path_rig_room(rig);
    rig_light(rig, HG_LIGHT_DIRECTIONAL, high, down)->casts_shadow = true;
    rig_light(rig, HG_LIGHT_POINT, aside, down)->intensity = 0.1f;
    const struct hg_object_list *nodes = &rig->scene->objects[HG_OBJECT_NODE];
    path_rig_animate(rig, (struct hg_node *)nodes->items[2], HG_ANIM_TRANSLATION, 3, slide);
    path_rig_pose(rig, 1.0);
}

static struct hg_refbuf *settled(struct hg_view *view)
{
    struct hg_error err = {0};
    struct hg_refbuf *out;
    path_rig_settle(view);
    test_ok(hg_view_read_pixels(view, HG_PIXEL_RGBA32F, &out, &err), &err);
    return out;
}

static void expect_as_fresh(struct rig *rig, int kind, int edit)
{
    struct hg_error err = {0};
    struct hg_frame_info info = {0};
    open_scene(rig);
    struct state s = {rig, path_rig_view(rig, &kinds[kind].params), kinds[kind].params,
        {.vfov_rad = 0.8f, .moves = kind == 2, .next_eye = {0.6f, 1.2f, 3.5f}}};
    memcpy(s.camera.eye, eye, sizeof eye);
    memcpy(s.camera.target, target, sizeof target);
    memcpy(s.camera.next_target, target, sizeof target);
    path_rig_set_camera(s.view, &s.camera);
    hg_view_set_final(s.view, false);
    rig->renderer->context.overrides.path_slice_ns = 1; // pieces of waves
    for (int more = 3; info.samples < 3 || more-- > 0;)
        test_ok(hg_view_step(s.view, 1, &info, &err), &err);
    edits[edit].edit(&s);
    rig->renderer->context.overrides.path_slice_ns = 0;
    struct hg_refbuf *edited = settled(s.view);
    struct hg_view *view = path_rig_view(rig, &s.params);
    path_rig_set_camera(view, &s.camera);
    struct hg_refbuf *fresh = settled(view);
    assert_int_equal(edited->size, fresh->size);
    const float *a = (const float *)(const void *)edited->data;
    const float *b = (const float *)(const void *)fresh->data;
    double most = 0;
    uint32_t differ = 0;
    for (size_t i = 0; i < fresh->size / sizeof *a; i++) {
        differ += memcmp(&a[i], &b[i], sizeof *a) != 0;
        most = fmax(most, fabs((double)a[i] - (double)b[i]));
    }
    if (differ > 0)
        fail_msg("%s, %s: %u of %zu numbers differ, by %g at most", kinds[kind].name,
            edits[edit].name, differ, fresh->size / sizeof *a, most);
    hg_refbuf_unref(edited);
    hg_refbuf_unref(fresh);
    hg_view_destroy(view);
    hg_view_destroy(s.view);
}

// Every edit of a plain picture, and of one of the two others in turn.
static void test_edits(void **state)
{
    for (int edit = 0; edit < EDITS; edit++) {
        expect_as_fresh(*state, 0, edit);
        expect_as_fresh(*state, 1 + edit % (KINDS - 1), edit);
    }
}

// Two views that look at one scene from far apart, in turns: each gets to its end.
static void test_far_apart(void **state)
{
    struct rig *rig = *state;
    struct hg_error err = {0};
    struct hg_frame_info info[2] = {{0}};
    struct hg_view *views[2];
    static const float away[3] = {20000, 1.2f, 3.5f}, there[3] = {20000, 0.5f, 0};
    open_scene(rig);
    for (int i = 0; i < 2; i++) {
        struct hg_view_params params = kinds[i == 0 ? 0 : 2].params;
        views[i] = path_rig_view(rig, &params);
        path_rig_look(views[i], i ? away : eye, i ? there : target, 0.8f);
        hg_view_set_final(views[i], false);
    }
    for (int steps = 0; steps < 600 && !(info[0].settled && info[1].settled); steps++) {
        for (int i = 0; i < 2; i++)
            test_ok(hg_view_step(views[i], 1, &info[i], &err), &err);
    }
    print_message("far apart: %u and %u samples\n", info[0].samples, info[1].samples);
    assert_true(info[0].settled && info[1].settled);
    struct hg_refbuf *pixels, *fresh;
    test_ok(hg_view_read_pixels(views[0], HG_PIXEL_RGBA32F, &pixels, &err), &err);
    hg_view_destroy(views[0]);
    hg_view_destroy(views[1]);
    views[0] = path_rig_view(rig, &kinds[0].params);
    path_rig_look(views[0], eye, target, 0.8f);
    fresh = settled(views[0]);
    assert_memory_equal(pixels->data, fresh->data, fresh->size);
    hg_refbuf_unref(pixels);
    hg_refbuf_unref(fresh);
    hg_view_destroy(views[0]);
}

// What is picked stands where the scene has it, though another view has posed it at other times.
static void test_picked(void **state)
{
    struct rig *rig = *state;
    struct hg_error err = {0};
    struct hg_frame_info info;
    struct hg_pick before, after;
    open_scene(rig);
    struct hg_view *view = path_rig_view(rig, &kinds[0].params);
    struct hg_view *other = path_rig_view(rig, &kinds[2].params);
    path_rig_look(view, eye, (const float[3]){0.2f, 0.4f, 0}, 0.8f);
    path_rig_look(other, eye, target, 0.8f);
    path_rig_settle(view);
    test_ok(hg_view_pick(view, 32, 20, &before, &err), &err);
    assert_true(before.hit);
    rig->renderer->context.overrides.path_slice_ns = 1;
    for (int i = 0; i < 12; i++) {
        test_ok(hg_view_step(other, 1, &info, &err), &err);
        test_ok(hg_view_pick(view, 32, 20, &after, &err), &err);
        assert_true(after.hit && after.node == before.node);
        assert_memory_equal(after.position, before.position, sizeof before.position);
    }
    rig->renderer->context.overrides.path_slice_ns = 0;
    hg_view_destroy(view);
    hg_view_destroy(other);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_edits),
        cmocka_unit_test(test_far_apart), cmocka_unit_test(test_picked)};
    return cmocka_run_group_tests(tests, rig_set_up, rig_tear_down);
}
