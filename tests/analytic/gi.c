// gi.c - light from probes against closed forms, path tracing and itself.
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/alloc.h"
#include "renderer/internal.h"
#include "tests/analytic/gi_rig.h"

// --- closed forms --------------------------------------------------------------------------------

static const float box[2][3] = {{-2, 0, -3}, {2, 3, 3}};
static const struct gi_shot inside = {
    .eye = {0, 1.5f, 2.5f}, .target = {0, 1.4f, -3}, .gi = HG_GI_PROBES, .samples = 16};

// One level of 255 in sRGB is 1 / 255 / 12.92.
static void test_closed_box(void **state)
{
    struct rig *rig = *state;
    rig_scene(rig);
    gi_room(rig, gi_grey(rig, 0.8f, 0), box);
    gi_sky(rig, 1);
    struct hg_refbuf *pixels[2];
    gi_take_both(rig, &inside, pixels);
    for (int i = 0; i < 2; i++) {
        const double dark = gi_mean(pixels[i], gi_all);
        print_message("closed box under a sky of 1, %s: mean %.6f\n", gi_ways[i], dark);
        assert_true(dark <= 1.0 / 255 / 12.92);
        hg_refbuf_unref(pixels[i]);
    }
}

// Walls that emit 0.5 and send back about half: the light in the room is 0.5 / (1 - albedo).
static void furnace_room(struct rig *rig)
{
    rig_scene(rig);
    gi_room(rig, gi_grey(rig, 0.5f, 0.5f), box);
}

static void test_furnace_room(void **state)
{
    struct rig *rig = *state;
    furnace_room(rig);
    struct gi_shot shot = inside;
    struct hg_refbuf *pixels[2];
    gi_take_both(rig, &shot, pixels);
    shot.mode = HG_MODE_PATH;
    shot.samples = 16; // every path is worth nearly the same
    struct hg_refbuf *path = gi_take(rig, &shot);
    for (int i = 0; i < 2; i++) {
        gi_compare(i ? "furnace room, rays" : "furnace room, probes", pixels[i], path, 0,
            (double[2]){0.05, 0.05});
        hg_refbuf_unref(pixels[i]);
    }
    hg_refbuf_unref(path);
}

// A sphere whose vertices a target brings from near the origin to where they belong.
static void morph(struct rig *rig, struct hg_node *node)
{
    struct hg_mesh *mesh = node->mesh;
    struct hg_mesh_part *part = &mesh->parts[0];
    struct hg_morph_target *target = part->targets = hg_calloc(1, sizeof *target);
    mesh->target_count = 1;
    mesh->weights = hg_calloc(1, sizeof(float));
    node->weights = hg_calloc(1, sizeof(float));
    assert_true(target != NULL && mesh->weights != NULL && node->weights != NULL);
    target->positions = hg_calloc(part->vertex_count * 3, sizeof(float));
    assert_non_null(target->positions);
    for (uint32_t i = 0; i < part->vertex_count * 3; i++) {
        target->positions[i] = 0.999f * part->positions[i];
        part->positions[i] -= target->positions[i];
    }
    node->weights[0] = 1;
    hg_scene_touch(rig->scene, &node->head);
}

enum { BALLS = 7 };

// Where a ball of test_open_furnace is: rows of four and of three in the plane z = 0.
static void ball_at(int ball, float at[2])
{
    at[0] = 1.3f * (float)(ball % 4) - (ball < 4 ? 1.95f : 1.3f);
    at[1] = ball < 4 ? 0.7f : -0.7f;
}

static void add_ball(struct rig *rig, int ball)
{
    float at[2];
    ball_at(ball, at);
    struct hg_material *m = gi_grey(rig, 1, 0);
    m->metallic = ball == 1 || ball == 2 ? 1 : 0;
    m->roughness = ball == 2 ? 0.4f : ball == 3 ? 0.1f : 1;
    for (int c = 0; c < 3 && ball == 4; c++)
        m->sheen.color[c] = 1;
    m->sheen.roughness = 0.5f;
    m->diffuse_transmission.factor = ball == 6 ? 1 : 0;
    if (ball == 6) { // flat, facing the eye
        const float leaf[2][3] = {
            {at[0] - 0.5f, at[1] - 0.5f, -1}, {at[0] + 0.5f, at[1] + 0.5f, 0}};
        rig_face(rig, m, leaf, -1, 5);
        return;
    }
    struct hg_node *node = rig_sphere(rig, m, (const float[3]){at[0], at[1], 0}, 0.5f, 24);
    if (ball == 5)
        morph(rig, node);
}

// Of 4 x 4 pixels in its middle, from an eye at (0, 0, distance).
static double ball_mean(const struct hg_refbuf *pixels, int ball, float distance)
{
    const float *p = (const float *)(const void *)pixels->data;
    const float scale = GI_HEIGHT / 2 / tanf(0.6f) / distance; // pixels per metre
    float at[2];
    double sum = 0;
    ball_at(ball, at);
    const int x = (int)lrintf(GI_WIDTH / 2 + scale * at[0]) - 2,
              y = (int)lrintf(GI_HEIGHT / 2 - scale * at[1]) - 2;
    for (int i = 0; i < 16; i++)
        sum += (double)p[((y + i / 4) * GI_WIDTH + x + i % 4) * 4 + 1];
    return sum / 16;
}

// Under a uniform sky a white ball or leaf is as bright as the sky, whatever way it sends light on,
// and whatever else is as white beside it.
static void test_open_furnace(void **state)
{
    static const char *const balls[BALLS] = {
        "white", "rough metal", "metal", "smooth", "cloth", "morphed", "leaf"};
    struct rig *rig = *state;
    rig_scene(rig);
    for (int ball = 0; ball < BALLS; ball++)
        add_ball(rig, ball);
    gi_sky(rig, 1);
    const struct gi_shot shot = {.eye = {0, 0, 4}, .gi = HG_GI_PROBES, .samples = 16};
    struct hg_refbuf *pixels[2];
    gi_take_both(rig, &shot, pixels);
    for (int i = 0; i < 2; i++) {
        for (int ball = 0; ball < BALLS; ball++) {
            const double white = ball_mean(pixels[i], ball, shot.eye[2]);
            print_message("%s ball under a sky of 1, %s: %.4f\n", balls[ball], gi_ways[i], white);
            assert_true(fabs(white - 1) <= 0.03);
        }
        hg_refbuf_unref(pixels[i]);
    }
}

// A white ball that is all of a scene grows and shrinks from picture to picture, and the bounds of
// the scene with it: it has the light of the sky in each of them.
static void test_furnace_in_motion(void **state)
{
    struct rig *rig = *state;
    struct hg_error err = {0};
    const struct gi_shot shot = {.eye = {0, 0, 2.5f}, .gi = HG_GI_PROBES, .samples = 4};
    const int middle[4] = {3, 3, 5, 5};
    double least = 1e9, most = 0;
    rig_scene(rig);
    struct hg_node *node = rig_sphere(rig, gi_grey(rig, 1, 0), (const float[3]){0}, 0.5f, 24);
    gi_sky(rig, 1);
    struct hg_view *view = gi_open_view(rig, &shot);
    gi_settle(view, 4);
    for (int i = 1; i <= 40; i++) {
        struct hg_frame_info info;
        struct hg_refbuf *pixels;
        for (int a = 0; a < 3; a++)
            node->scale[a] = 1.2f + 0.6f * fabsf(sinf(0.3f * (float)i));
        hg_scene_touch(rig->scene, &node->head);
        hg_scene_publish(rig->scene);
        test_ok(hg_view_step(view, 1, &info, &err), &err);
        assert_false(info.settled);
        test_ok(hg_view_read_pixels(view, HG_PIXEL_RGBA8, &pixels, &err), &err);
        const double white = gi_mean_of_bytes(pixels, middle);
        least = fmin(least, white);
        most = fmax(most, white);
        hg_refbuf_unref(pixels);
    }
    print_message("a ball that grows under a sky of 1: %.3f to %.3f\n", least, most);
    assert_true(least > 0.75 && most < 1.05);
    hg_view_destroy(view);
}

// An environment with a lamp in it that few rays would find: 3 degrees wide, a third of all light.
static void lamp_in_environment(struct rig *rig)
{
    struct hg_environment *e = &rig->scene->environment;
    const uint32_t width = 256, height = 128;
    hg_image_finish(&e->image);
    test_ok(hg_image_create(width, height, HG_PIXEL_RGBA32F, NULL, &e->image), NULL);
    float *p = (float *)(void *)e->image.pixels;
    for (uint32_t i = 0; i < width * height; i++)
        for (uint32_t c = 0; c < 4; c++)
            p[i * 4 + c] = i % width / 2 == 75 && i / width / 2 == 20 ? 3000 : 1;
    e->kind = HG_ENV_IMAGE;
    e->intensity = 1;
    e->rotation_rad = 0.7f;
    e->revision++;
}

// A ball in the open has the light of the whole environment, which is known: probes agree
// everywhere on it, also where each of them found it by rays of its own.
static void test_lamp_in_environment(void **state)
{
    struct rig *rig = *state;
    rig_scene(rig);
    rig_sphere(rig, gi_grey(rig, 1, 0), (const float[3]){0, 0, 0}, 1, 24);
    lamp_in_environment(rig);
    struct gi_shot shot = {.eye = {0, 0, 3}, .gi = HG_GI_PROBES, .samples = 32};
    struct hg_refbuf *probes = gi_take(rig, &shot);
    shot.gi = HG_GI_NONE;
    struct hg_refbuf *whole = gi_take(rig, &shot);
    gi_compare("lamp in the environment", probes, whole, 2, (double[2]){0.06, 0.03});
    hg_refbuf_unref(probes);
    hg_refbuf_unref(whole);
}

// --- against path tracing ------------------------------------------------------------------------

// Probes and rays from within the box; limits as of compare.
static void against_path(struct rig *rig, int first, double limits[2][2])
{
    struct gi_shot shot = inside;
    struct hg_refbuf *pixels[2];
    gi_take_both(rig, &shot, pixels);
    shot.mode = HG_MODE_PATH;
    shot.samples = 48; // noise of a square: 1.6 %
    struct hg_refbuf *path = gi_take(rig, &shot);
    for (int i = 0; i < 2; i++) {
        gi_compare(gi_ways[i], pixels[i], path, first, limits[i]);
        hg_refbuf_unref(pixels[i]);
    }
    hg_refbuf_unref(path);
}

// A court with that lamp above.
static void test_court(void **state)
{
    struct rig *rig = *state;
    rig_scene(rig);
    for (int which = 0; which < 6; which++)
        if (which != 3) // the ceiling
            rig_face(rig, gi_grey(rig, 0.6f, 0), box, 1, which);
    lamp_in_environment(rig);
    against_path(rig, 4, (double[2][2]){{0.15, 0.05}, {0.08, 0.03}});
}

static void panel_room(struct rig *rig)
{
    rig_scene(rig);
    gi_room(rig, gi_grey(rig, 0.6f, 0), box);
    const float panel[2][3] = {{-1, 2.9f, -1.5f}, {1, 2.95f, 1.5f}};
    rig_face(rig, gi_grey(rig, 0, 5), panel, -1, 2); // its lower side
    rig_face(rig, gi_grey(rig, 0, 0), panel, -1, 3);
}

static void test_panel_room(void **state)
{
    struct rig *rig = *state;
    panel_room(rig);
    against_path(rig, 2, (double[2][2]){{0.11, 0.05}, {0.05, 0.03}});
}

// Two rooms with a wall of 10 cm between; all light is in one of them.
static void test_wall(void **state)
{
    struct rig *rig = *state;
    rig_scene(rig);
    struct hg_material *m = gi_grey(rig, 0.7f, 0);
    const float both[2][3] = {{-4, 0, -3}, {4, 3, 3}},
                wall[2][3] = {{-0.05f, 0, -3}, {0.05f, 3, 3}};
    const float lamp[2][3] = {{1.5f, 2.8f, -1}, {3, 2.9f, 1}};
    gi_room(rig, m, both);
    gi_solid(rig, m, wall);
    gi_solid(rig, gi_grey(rig, 0, 8), lamp);
    struct gi_shot shot = inside;
    memcpy(shot.eye, (const float[3]){2, 1.5f, 2.5f}, sizeof shot.eye);
    memcpy(shot.target, (const float[3]){0.5f, 1, -3}, sizeof shot.target);
    struct hg_refbuf *bright[2], *dark[2];
    struct hg_view *keeper = gi_keep_field(rig, &shot);
    gi_take_both(rig, &shot, bright);
    shot.eye[0] = -2;
    shot.target[0] = -0.5f;
    gi_take_both(rig, &shot, dark);
    hg_view_destroy(keeper);
    for (int i = 0; i < 2; i++) {
        const double a = gi_mean(dark[i], gi_all), b = gi_mean(bright[i], gi_all);
        print_message("behind a wall of 10 cm, %s: %.5f of %.3f, %.4f\n", gi_ways[i], a, b, a / b);
        assert_true(b > 0.1);
        assert_true(a <= 0.01 * b);
        hg_refbuf_unref(bright[i]);
        hg_refbuf_unref(dark[i]);
    }
}

// --- rest and motion -----------------------------------------------------------------------------

static struct hg_light *lamp_room(struct rig *rig)
{
    rig_scene(rig);
    gi_room(rig, gi_grey(rig, 0.6f, 0), box);
    const float block[2][3] = {{-0.8f, 0, -1.5f}, {0.2f, 1.2f, -0.7f}};
    gi_solid(rig, gi_grey(rig, 0.4f, 0), block);
    struct hg_light *lamp = rig_light(
        rig, HG_LIGHT_POINT, (const double[3]){1.2, 2.2, -1}, (const double[3]){0, -1, 0});
    lamp->intensity = 8;
    lamp->casts_shadow = true;
    return lamp;
}

static void set_lamp(struct rig *rig, struct hg_light *lamp, float intensity)
{
    lamp->intensity = intensity;
    hg_scene_touch(rig->scene, &lamp->head);
    hg_scene_publish(rig->scene);
}

// The same bytes with another number of threads, other steps, and after another past.
static void test_same_bytes(void **state)
{
    struct rig *rig = *state, alone = {0};
    struct hg_error err = {0};
    const struct hg_renderer_params one = {.threads = 1};
    struct gi_shot shot = inside;
    shot.gi = HG_GI_RAYS;
    shot.samples = 4;
    lamp_room(rig);
    struct hg_refbuf *first = gi_take(rig, &shot);
    test_ok(hg_renderer_create(&one, &alone.renderer, &err), &err);
    struct hg_light *lamp = lamp_room(&alone);
    lamp->intensity = 1; // a history of another light and another camera, in steps of a sample
    shot.eye[0] = 1;
    struct hg_view *view = gi_open_view(&alone, &shot);
    struct hg_frame_info info;
    for (int i = 0; i < 3; i++)
        test_ok(hg_view_step(view, 1, &info, &err), &err);
    set_lamp(&alone, lamp, 8);
    const struct hg_view_camera camera = {.vfov_rad = 1.2f,
        .eye = {inside.eye[0], inside.eye[1], inside.eye[2]},
        .target = {inside.target[0], inside.target[1], inside.target[2]}};
    test_ok(hg_view_set_camera(view, &camera, &err), &err);
    gi_settle(view, 1);
    struct hg_refbuf *second = gi_read_floats(view);
    hg_view_destroy(view);
    gi_assert_same(first, second);
    rig_finish(&alone);
}

static bool probes_rest(const struct hg_view *view)
{
    struct hg_view_report report;
    hg_view_get_report(view, &report);
    return report.field_is_settled;
}

static bool is_same(const struct hg_refbuf *a, const struct hg_refbuf *b)
{
    return a->size == b->size && memcmp(a->data, b->data, a->size) == 0;
}

// An allocation fails where light begins to be gathered: the picture is that of the same level, of
// a lower one, or an error.
static void test_no_memory(void **state)
{
    enum { TRIES = 12, LEVELS = 3 };
    static const enum hg_view_gi levels[LEVELS] = {HG_GI_RAYS, HG_GI_PROBES, HG_GI_NONE};
    struct rig *rig = *state;
    struct gi_shot shot = inside;
    shot.samples = 1;
    struct hg_refbuf *want[LEVELS];
    uint32_t found[LEVELS] = {0}, errors = 0;
    lamp_room(rig);
    struct hg_view *keeper = gi_keep_field(rig, &shot);
    for (int i = LEVELS; i-- > 0;) {
        shot.gi = levels[i];
        want[i] = gi_take(rig, &shot);
    }
    for (int i = 0; i < TRIES; i++) {
        struct hg_error err = {0};
        struct hg_frame_info info = {0};
        enum hg_status status = HG_OK;
        struct hg_view *view = gi_open_view(rig, &shot);
        for (int k = 0; k < 4000 && (k == 0 || !probes_rest(view)); k++)
            test_ok(hg_view_step(view, 8, &info, &err), &err);
        hg_alloc_fail_at(1 + (uint64_t)i);
        for (int k = 0; k < 4000 && !info.settled && status == HG_OK; k++)
            status = hg_view_step(view, 8, &info, &err);
        hg_alloc_fail_at(0);
        if (status == HG_OK) {
            struct hg_refbuf *got = gi_read_floats(view);
            int level = 0;
            while (level < LEVELS && !is_same(got, want[level]))
                level++;
            assert_in_range(level, 0, LEVELS - 1);
            found[level]++;
            hg_refbuf_unref(got);
        } else {
            assert_int_equal(status, HG_E_NOMEM);
            errors++;
        }
        hg_view_destroy(view);
    }
    hg_view_destroy(keeper);
    print_message("rays %u, probes %u, none %u, errors %u\n", found[0], found[1], found[2], errors);
    assert_true(found[1] > 0);
    for (int i = 0; i < LEVELS; i++)
        hg_refbuf_unref(want[i]);
}

// Light that is switched on is there within 15 pictures of a moving view, seen where the lamp's own
// light does not come: the shadow of the block.
static void test_lamp_switched(void **state)
{
    struct rig *rig = *state;
    struct hg_error err = {0};
    struct hg_light *lamp = lamp_room(rig);
    struct hg_frame_info info;
    lamp->intensity = 0.001f;
    struct hg_view *view = gi_open_view(rig, &inside);
    double seen[64] = {0}, final = 0;
    struct hg_refbuf *pixels;
    for (int i = 0; i < 200; i++) {
        struct hg_view_camera camera = {.vfov_rad = 1.2f};
        memcpy(camera.eye, inside.eye, sizeof camera.eye);
        memcpy(camera.target, inside.target, sizeof camera.target);
        camera.eye[0] = i % 2 ? 0.001f : 0; // it moves
        if (i == 5)
            set_lamp(rig, lamp, 8);
        test_ok(hg_view_set_camera(view, &camera, &err), &err);
        test_ok(hg_view_step(view, 1, &info, &err), &err);
        test_ok(hg_view_read_pixels(view, HG_PIXEL_RGBA8, &pixels, &err), &err);
        final = gi_mean_of_bytes(pixels, (const int[4]){2, 6, 4, 7});
        if (i >= 5 && i < 69)
            seen[i - 5] = final;
        hg_refbuf_unref(pixels);
    }
    gi_settle(view, 8);
    test_ok(hg_view_read_pixels(view, HG_PIXEL_RGBA8, &pixels, &err), &err);
    const double rest = gi_mean_of_bytes(pixels, (const int[4]){2, 6, 4, 7});
    print_message("lamp switched on: after 1, 5, 10, 15 and 60 pictures %.2f %.2f %.2f %.2f %.2f "
                  "of %.4f; at rest "
                  "%.4f\n",
        seen[0] / final, seen[4] / final, seen[9] / final, seen[14] / final, seen[59] / final,
        final, rest);
    assert_true(final > 0.001);
    assert_true(fabs(seen[14] / final - 1) <= 0.10 && fabs(seen[59] / final - 1) <= 0.03);
    assert_true(fabs(final / rest - 1) <= 0.08);
    hg_refbuf_unref(pixels);
    hg_view_destroy(view);
}

// Of a view that comes to rest one picture more is displayed once the settled field is complete,
// while light is still to be gathered.
static void test_shown_on_the_way(void **state)
{
    struct rig *rig = *state;
    struct hg_error err = {0};
    panel_room(rig);
    struct gi_shot shot = inside;
    shot.gi = HG_GI_RAYS;
    struct hg_view *view = gi_open_view(rig, &shot);
    struct hg_frame_info info = {0}, first, shown = {0};
    struct hg_refbuf *pixels[2];
    test_ok(hg_view_step(view, 1, &first, &err), &err);
    assert_int_equal(first.samples, 1);
    for (int i = 0; i < 4000 && shown.number == 0; i++) {
        test_ok(hg_view_step(view, 1, &info, &err), &err);
        shown = info.number != first.number ? info : shown;
    }
    assert_int_equal(shown.number, first.number + 1);
    assert_int_equal(shown.samples, 1);
    test_ok(hg_view_read_pixels(view, HG_PIXEL_RGBA8, &pixels[0], &err), &err);
    test_ok(hg_view_step(view, 1, &info, &err), &err);
    assert_int_equal(info.number, shown.number); // now light is gathered
    gi_settle(view, 8);
    test_ok(hg_view_read_pixels(view, HG_PIXEL_RGBA8, &pixels[1], &err), &err);
    const double here = gi_mean_of_bytes(pixels[0], gi_all),
                 rest = gi_mean_of_bytes(pixels[1], gi_all);
    print_message("on the way %.4f, at rest %.4f\n", here, rest);
    assert_true(fabs(here / rest - 1) <= 0.06);
    hg_refbuf_unref(pixels[0]);
    hg_refbuf_unref(pixels[1]);
    hg_view_destroy(view);
}

// The camera a little aside, and one picture of the way there.
static struct hg_refbuf *take_in_motion(struct hg_view *view)
{
    struct hg_error err = {0};
    struct hg_frame_info info;
    struct hg_refbuf *pixels;
    struct hg_writer graph = {0};
    struct hg_view_camera camera = {.vfov_rad = 1.2f};
    memcpy(camera.eye, inside.eye, sizeof camera.eye);
    memcpy(camera.target, inside.target, sizeof camera.target);
    camera.eye[0] += 1e-4f;
    test_ok(hg_view_set_camera(view, &camera, &err), &err);
    test_ok(hg_view_step(view, 1, &info, &err), &err);
    assert_false(info.settled);
    test_ok(hg_view_read_pixels(view, HG_PIXEL_RGBA8, &pixels, &err), &err);
    hg_view_print_graph(view, HG_GRAPH_TEXT, &graph);
    hg_write_u8(&graph, 0);
    assert_non_null(strstr((const char *)graph.data, "probe light"));
    hg_writer_finish(&graph);
    return pixels;
}

// Light from probes in motion, looked up at every fourth pixel, is that of pictures at rest.
static void test_motion_agrees(void **state)
{
    struct rig *rig = *state;
    struct hg_error err = {0};
    for (int scene = 0; scene < 2; scene++) {
        struct gi_shot shot = inside;
        shot.samples = 64;
        if (scene == 0)
            furnace_room(rig);
        else
            panel_room(rig);
        struct hg_view *view = gi_open_view(rig, &shot);
        struct hg_refbuf *rest, *motion;
        double worst = 0;
        gi_settle(view, 8);
        test_ok(hg_view_read_pixels(view, HG_PIXEL_RGBA8, &rest, &err), &err);
        motion = take_in_motion(view);
        for (int i = 0; i < 16; i++) {
            const int x = i % 4 * 2, y = i / 4 * 2, cells[4] = {x, y, x + 2, y + 2};
            const double want = gi_mean_of_bytes(rest, cells),
                         seen = gi_mean_of_bytes(motion, cells);
            worst = fmax(worst, fabs(seen / want - 1));
        }
        print_message("motion: worst region off by %.1f %%, in all %+.1f %%\n", 100 * worst,
            100 * (gi_mean_of_bytes(motion, gi_all) / gi_mean_of_bytes(rest, gi_all) - 1));
        assert_true(worst < 0.08); // of 16 x 12 texels
        assert_true(
            fabs(gi_mean_of_bytes(motion, gi_all) / gi_mean_of_bytes(rest, gi_all) - 1) < 0.02);
        hg_refbuf_unref(rest);
        hg_refbuf_unref(motion);
        hg_view_destroy(view);
    }
}

// Bars as wide as a pixel before a sky: each gets light, though few of the pixels that are looked
// up show one.
static void test_motion_has_thin_things(void **state)
{
    struct rig *rig = *state;
    struct gi_shot shot = inside;
    rig_scene(rig);
    for (int i = 0; i < 9; i++) {
        const float x = -2 + 0.47f * (float)i, bar[2][3] = {{x, 0, -2}, {x + 0.13f, 3, -1.9f}};
        gi_solid(rig, gi_grey(rig, 0.5f, 0), bar);
    }
    gi_sky(rig, 1);
    struct hg_view *view = gi_open_view(rig, &shot);
    gi_settle(view, 8);
    struct hg_refbuf *pixels = take_in_motion(view);
    uint32_t seen = 0;
    double least = 1;
    for (size_t i = 0; i < GI_WIDTH * GI_HEIGHT; i++) {
        const uint8_t *px = pixels->data + 4 * i;
        seen += px[3] == 255;
        if (px[3] == 255)
            least = fmin(least, px[1] / 255.0);
    }
    print_message("bars in motion: %u px, the darkest %.3f (sRGB)\n", seen, least);
    assert_true(seen > 100 && least > 0.55); // 0.5 of light is 0.735
    hg_refbuf_unref(pixels);
    hg_view_destroy(view);
}

// What a view shows whose camera turned in path mode, before paths are there.
static struct hg_refbuf *take_preview(struct rig *rig, enum hg_view_gi gi)
{
    struct hg_error err = {0};
    struct hg_frame_info info;
    struct hg_refbuf *pixels;
    struct gi_shot shot = inside;
    shot.gi = gi;
    struct hg_view *view = gi_open_view(rig, &shot);
    gi_settle(view, 8);
    const struct hg_view_params params = {.width = GI_WIDTH,
        .height = GI_HEIGHT,
        .tonemap = HG_TONEMAP_LINEAR,
        .background = HG_BACKGROUND_NONE,
        .samples = 8,
        .mode = HG_MODE_PATH,
        .gi = gi,
        .filter = HG_FILTER_BOX};
    struct hg_view_camera camera = {.vfov_rad = 1.2f};
    memcpy(camera.eye, inside.eye, sizeof camera.eye);
    memcpy(camera.target, inside.target, sizeof camera.target);
    camera.target[0] += 1;
    test_ok(hg_view_set_params(view, &params, &err), &err);
    test_ok(hg_view_set_camera(view, &camera, &err), &err);
    test_ok(hg_view_step(view, 1, &info, &err), &err);
    assert_int_equal(info.samples, 0);
    test_ok(hg_view_read_pixels(view, HG_PIXEL_RGBA8, &pixels, &err), &err);
    hg_view_destroy(view);
    return pixels;
}

// Light that was gathered for the pixels of the picture before is not in it.
static void test_preview_of_paths(void **state)
{
    struct rig *rig = *state;
    panel_room(rig);
    struct hg_view *keeper = gi_keep_field(rig, &inside);
    struct hg_refbuf *rays = take_preview(rig, HG_GI_RAYS),
                     *probes = take_preview(rig, HG_GI_PROBES);
    hg_view_destroy(keeper);
    assert_true(gi_mean_of_bytes(rays, gi_all) > 0.01);
    assert_memory_equal(rays->data, probes->data, rays->size);
    hg_refbuf_unref(rays);
    hg_refbuf_unref(probes);
}

// Nothing of it is in pictures that do not ask for it.
static void test_none_is_as_before(void **state)
{
    struct rig *rig = *state;
    lamp_room(rig);
    struct gi_shot shot = inside;
    shot.gi = HG_GI_NONE;
    struct hg_refbuf *before = gi_take(rig, &shot);
    shot.gi = HG_GI_PROBES;
    struct hg_refbuf *probes = gi_take(rig, &shot);
    shot.gi = HG_GI_NONE;
    struct hg_refbuf *after = gi_take(rig, &shot);
    assert_memory_equal(before->data, after->data, before->size);
    assert_memory_not_equal(before->data, probes->data, before->size);
    hg_refbuf_unref(before);
    hg_refbuf_unref(probes);
    hg_refbuf_unref(after);
}

int main(void)
{
    cmocka_set_test_filter(getenv("GI_ONLY")); // NULL: all
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_closed_box),
        cmocka_unit_test(test_furnace_room),
        cmocka_unit_test(test_open_furnace),
        cmocka_unit_test(test_furnace_in_motion),
        cmocka_unit_test(test_lamp_in_environment),
        cmocka_unit_test(test_court),
        cmocka_unit_test(test_panel_room),
        cmocka_unit_test(test_wall),
        cmocka_unit_test(test_same_bytes),
        cmocka_unit_test(test_no_memory),
        cmocka_unit_test(test_lamp_switched),
        cmocka_unit_test(test_shown_on_the_way),
        cmocka_unit_test(test_motion_agrees),
        cmocka_unit_test(test_motion_has_thin_things),
        cmocka_unit_test(test_preview_of_paths),
        cmocka_unit_test(test_none_is_as_before),
    };
    return cmocka_run_group_tests(tests, rig_set_up, rig_tear_down);
}
