// render_temporal.c - pictures in motion: motion vectors against closed forms, and what is made of
// several samples against settled pictures.

#include "base/alloc.h"
#include "renderer/internal.h"
#include "tests/unit/render_rig.h"

#define WIDTH  96
#define HEIGHT 64
#define AWAY   3.0f // of the camera from z = 0, metres
#define MOVE   0.05f

static const float GREY[4] = {0.4f, 0.4f, 0.4f, 1}, RED[4] = {0.9f, 0.05f, 0.05f, 1};

// threads 0: two, with validation.
static void open_rig(struct rig *rig, unsigned threads)
{
    if (threads == 0)
        rig_open(rig, true);
    else
        rig_open_with(rig, &(struct hg_renderer_params){.threads = threads});
    rig->renderer->context.overrides.keeps_motion = true;
    rig->scene = rig_new_scene();
    rig_environment(rig->scene, 0.05f, 0.1f, 0.3f);
}

static void open_scaled(struct rig *rig, enum hg_view_temporal temporal, float scale)
{
    const struct hg_view_params params = {.width = WIDTH,
        .height = HEIGHT,
        .samples = 32,
        .temporal = temporal,
        .scale = scale,
        .tonemap = HG_TONEMAP_LINEAR};
    hg_scene_publish(rig->scene);
    rig_view(rig, &params);
}

static void open_view(struct rig *rig, enum hg_view_temporal temporal)
{
    open_scaled(rig, temporal, 0);
}

static void look(struct rig *rig, float x, float y)
{
    const struct hg_view_camera camera = {.eye = {x, y, AWAY}, .target = {x, y, 0}};
    test_ok(hg_view_set_camera(rig->view, &camera, &rig->err), &rig->err);
}

static void touch(struct rig *rig, struct hg_node *node)
{
    hg_scene_touch(rig->scene, &node->head);
    hg_scene_publish(rig->scene);
}

// Pixels that one metre at z = 0 covers.
static float px_per_m(void)
{
    return 0.5f * HEIGHT / tanf(0.5f * 0.7853981634f) / AWAY;
}

// Motion vectors in the middle of the picture.
static void check_motion(struct rig *rig, float x, float y)
{
    assert_int_equal(rig_step(rig, 1).phase, HG_VIEW_DIRECT);
    const float *motion = rig_report(rig).motion;
    assert_non_null(motion);
    for (int row = HEIGHT / 2 - 3; row < HEIGHT / 2 + 3; row++)
        for (int column = WIDTH / 2 - 3; column < WIDTH / 2 + 3; column++) {
            const float *m = motion + 3 * (row * WIDTH + column);
            assert_float_equal(m[0], x, 0.02f);
            assert_float_equal(m[1], y, 0.02f);
            assert_true(m[2] > 0);
        }
}

// --- motion vectors ------------------------------------------------------------------------------

static void test_camera(void **state)
{
    (void)state;
    struct rig rig;
    open_rig(&rig, 0);
    rig_quad(rig.scene, 1, 1, 0, GREY);
    open_view(&rig, HG_TEMPORAL_AUTO);
    look(&rig, 0, 0);
    rig_step(&rig, 1);
    for (int i = 1; i < 4; i++) { // jittered from the second one on
        look(&rig, MOVE * (float)i, MOVE * (float)i);
        check_motion(&rig, MOVE * px_per_m(), -MOVE * px_per_m());
    }
    rig_step(&rig, 4); // samples of a view at rest are no pictures in motion
    look(&rig, 0, 3 * MOVE);
    check_motion(&rig, -3 * MOVE * px_per_m(), 0);
    rig_close(&rig);
}

static void test_node(void **state)
{
    (void)state;
    struct rig rig;
    open_rig(&rig, 0);
    rig_quad(rig.scene, 1, 8, -4, RED);
    struct hg_node *node = rig_quad(rig.scene, 2, 0.5f, 0, GREY);
    open_view(&rig, HG_TEMPORAL_AUTO);
    look(&rig, 0, 0);
    rig_step(&rig, 1);
    for (int i = 1; i < 3; i++) {
        node->translation[1] = MOVE * (float)i;
        touch(&rig, node);
        check_motion(&rig, 0, MOVE * px_per_m());
        // The wall behind it stands.
        const float *wall = rig_report(&rig).motion;
        assert_float_equal(wall[0], 0, 0.02f);
        assert_float_equal(wall[1], 0, 0.02f);
    }
    // Another node in front of it in the list changes all numbers; it is new itself.
    struct hg_node *other = rig_quad(rig.scene, 3, 0.1f, 0.5f, RED);
    other->translation[0] = 0.9f;
    node->translation[1] -= MOVE;
    touch(&rig, node);
    check_motion(&rig, 0, -MOVE * px_per_m());
    rig_close(&rig);
}

// A pose that nothing is known of takes no history from what was there before.
static void check_unknown(struct rig *rig)
{
    assert_int_equal(rig_step(rig, 1).phase, HG_VIEW_DIRECT);
    const float *motion = rig_report(rig).motion;
    for (int row = HEIGHT / 2 - 3; row < HEIGHT / 2 + 3; row++)
        for (int column = WIDTH / 2 - 3; column < WIDTH / 2 + 3; column++)
            assert_true(motion[3 * (row * WIDTH + column) + 2] == 0);
}

static void test_morph(void **state)
{
    (void)state;
    struct rig rig;
    const float delta[12] = {MOVE, 0, 0, MOVE, 0, 0, MOVE, 0, 0, MOVE, 0, 0};
    open_rig(&rig, 0);
    struct hg_node *node = rig_quad(rig.scene, 1, 1, 0, GREY);
    node->mesh->target_count = 1;
    node->mesh->weights = hg_calloc(1, sizeof *node->mesh->weights);
    node->mesh->parts->targets = hg_calloc(1, sizeof *node->mesh->parts->targets);
    node->mesh->parts->targets[0].positions = rig_copy(delta, sizeof delta);
    node->weights = hg_calloc(1, sizeof *node->weights);
    open_view(&rig, HG_TEMPORAL_AUTO);
    look(&rig, 0, 0);
    rig_step(&rig, 1);
    node->weights[0] = 1; // the part was not posed before
    touch(&rig, node);
    check_unknown(&rig);
    for (int i = 0; i < 2; i++) {
        node->weights[0] += 1;
        touch(&rig, node);
        check_motion(&rig, -MOVE * px_per_m(), 0);
    }
    look(&rig, 0, MOVE); // the camera moves on, and the pose stays
    check_motion(&rig, 0, -MOVE * px_per_m());
    rig_step(&rig, 4);
    look(&rig, MOVE, MOVE);
    node->weights[0] -= 1;
    touch(&rig, node);
    check_motion(&rig, 2 * MOVE * px_per_m(), 0);
    rig_close(&rig);
}

static void test_skin(void **state)
{
    (void)state;
    struct rig rig;
    const uint16_t joints[16] = {0};
    const float weights[16] = {1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0};
    float bind[1][16] = {{1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1}};
    open_rig(&rig, 0);
    struct hg_node *node = rig_quad(rig.scene, 1, 1, 0, GREY);
    struct hg_node *joint = rig_add(rig.scene, HG_OBJECT_NODE, 2);
    struct hg_skin skin = {.joints = &joint, .inverse_bind = bind, .joint_count = 1};
    node->skin = &skin;
    node->mesh->parts->joint_sets = 1;
    node->mesh->parts->joints = rig_copy(joints, sizeof joints);
    node->mesh->parts->weights = rig_copy(weights, sizeof weights);
    open_view(&rig, HG_TEMPORAL_AUTO);
    look(&rig, 0, 0);
    rig_step(&rig, 1);
    for (int i = 0; i < 3; i++) {
        joint->translation[0] += MOVE;
        joint->translation[1] += MOVE;
        touch(&rig, joint);
        check_motion(&rig, -MOVE * px_per_m(), MOVE * px_per_m());
    }
    rig_close(&rig);
}

// --- pictures ------------------------------------------------------------------------------------

// A fence of thin leaning bars before a wall.
static struct hg_node *add_fence(struct rig *rig)
{
    struct hg_node *first = NULL;
    rig_quad(rig->scene, 1, 8, -4, GREY);
    for (uint32_t i = 0; i < 9; i++) {
        struct hg_node *bar = rig_quad(rig->scene, 2 + i, 1, 0, i % 2 ? RED : GREY);
        bar->translation[0] = 0.25f * ((float)i - 4);
        bar->scale[0] = 0.03f;
        bar->rotation[2] = 0.087f;
        bar->rotation[3] = 0.9962f;
        bar->mesh->parts->material->base_color[1] = 0.9f;
        first = first == NULL ? bar : first;
    }
    return first;
}

static double difference(const struct hg_refbuf *a, const struct hg_refbuf *b)
{
    double sum = 0;
    assert_int_equal(a->size, b->size);
    for (size_t i = 0; i < a->size; i++)
        sum += abs((int)a->data[i] - (int)b->data[i]);
    return sum / (double)a->size;
}

static struct hg_refbuf *move_to(struct rig *rig, float x, float y)
{
    look(rig, x, y);
    assert_int_equal(rig_step(rig, 1).phase, HG_VIEW_DIRECT);
    return rig_pixels(rig, HG_PIXEL_RGBA8);
}

#define STEP_M 0.013f // not a whole number of pixels

// The picture after so many steps, and the settled one of the same camera.
static double error_after(struct rig *rig, int steps, struct hg_refbuf **picture)
{
    for (int i = 0; i <= steps; i++) {
        hg_refbuf_unref(*picture);
        *picture = move_to(rig, STEP_M * (float)i, 0.3f * STEP_M * (float)i);
    }
    rig_settle(rig, 16);
    struct hg_refbuf *settled = rig_pixels(rig, HG_PIXEL_RGBA8);
    const double error = difference(*picture, settled);
    hg_refbuf_unref(settled);
    return error;
}

static void test_error_falls(void **state)
{
    (void)state;
    double errors[2];
    for (int m = 0; m < 2; m++) {
        struct rig rig;
        struct hg_refbuf *picture = NULL;
        open_rig(&rig, 2);
        add_fence(&rig);
        open_view(&rig, (enum hg_view_temporal)m);
        errors[m] = error_after(&rig, 24, &picture);
        hg_refbuf_unref(picture);
        rig_close(&rig);
    }
    print_message("levels from the settled picture: %.3f of several samples, %.3f of one\n",
        errors[HG_TEMPORAL_AUTO], errors[HG_TEMPORAL_NONE]);
    assert_true(errors[HG_TEMPORAL_AUTO] < 0.6 * errors[HG_TEMPORAL_NONE]);
}

// Pictures that are drawn smaller come to the whole size.
static void test_scale(void **state)
{
    (void)state;
    static const float scales[] = {100, 77, 67, 50};
    double errors[4], one;
    for (int i = 0; i < 5; i++) {
        struct rig rig;
        struct hg_refbuf *picture = NULL;
        open_rig(&rig, i == 3 ? 0 : 2);
        add_fence(&rig);
        open_scaled(&rig, i < 4 ? HG_TEMPORAL_AUTO : HG_TEMPORAL_NONE, i < 4 ? scales[i] : 50);
        *(i < 4 ? &errors[i] : &one) = error_after(&rig, 24, &picture);
        hg_refbuf_unref(picture);
        rig_close(&rig);
    }
    print_message(
        "levels from the settled picture: %.3f %.3f %.3f %.3f of scales, %.3f of one sample\n",
        errors[0], errors[1], errors[2], errors[3], one);
    for (int i = 0; i < 4; i++)
        assert_true(errors[i] < one);
}

// Pictures of which every second pixel is shaded come near to the settled one as well, also with an
// odd number of columns, are the same bytes whatever the threads, and are of both halves in turn.
static void test_checkerboard(void **state)
{
    (void)state;
    for (uint32_t odd = 0; odd < 2; odd++) {
        double errors[3];
        struct hg_refbuf *moved[3] = {NULL, NULL, NULL};
        for (unsigned i = 0; i < 3; i++) {
            struct rig rig;
            open_rig(&rig, i + 1);
            add_fence(&rig);
            const struct hg_view_params params = {.width = WIDTH - odd,
                .height = HEIGHT,
                .samples = 32,
                .temporal = i < 2 ? HG_TEMPORAL_CHECKERBOARD : HG_TEMPORAL_NONE,
                .tonemap = HG_TONEMAP_LINEAR};
            hg_scene_publish(rig.scene);
            rig_view(&rig, &params);
            errors[i] = error_after(&rig, 24, &moved[i]);
            assert_int_equal(rig.view->state.targets.checkered.width, i < 2 ? WIDTH / 2 : 0);
            rig_close(&rig);
        }
        print_message("checkerboard: %.3f levels from the settled picture, %.3f of one sample\n",
            errors[0], errors[2]);
        assert_true(errors[0] < 0.75 * errors[2]);
        assert_memory_equal(moved[0]->data, moved[1]->data, moved[0]->size);
        for (int i = 0; i < 3; i++)
            hg_refbuf_unref(moved[i]);
    }
}

// What lies between shaded pixels of the first picture is made of its neighbours: a surface of one
// colour has it everywhere, up to an edge that runs along a column, a row or across.
static void test_checkerboard_holes(void **state)
{
    (void)state;
    enum { SIDE = 33 };
    static uint8_t half[SIDE * ((SIDE + 1) / 2) * 4], out[SIDE * SIDE * 4];
    static float depth[SIDE * SIDE];
    static const float slopes[3][2] = {{1, 0}, {0, 1}, {0.7f, 0.7f}};
    const double still[1][16] = {{1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1}};
    struct hg_jobs *jobs = hg_jobs_create(1);
    struct hg_temporal *history = NULL;
    assert_non_null(jobs);
    assert_int_equal(hg_temporal_create(SIDE, SIDE, &history), HG_OK);
    for (uint32_t k = 0; k < 6; k++) {
        const uint32_t first = k & 1;
        struct hg_temporal_stats stats;
        for (uint32_t y = 0; y < SIDE; y++)
            for (uint32_t x = 0; x < SIDE + 1; x++) {
                const float *s = slopes[k / 2];
                const bool near = s[0] * (float)x + s[1] * (float)y < 16;
                if (x < SIDE)
                    depth[y * SIDE + x] = near ? 0.5f : 0.1f;
                if (((x ^ y ^ first) & 1u) == 0)
                    memset(half + 4 * (y * ((SIDE + 1) / 2) + x / 2), near ? 200 : 40, 4);
            }
        for (size_t i = 3; i < sizeof half; i += 4)
            half[i] = 255;
        const struct hg_temporal_picture picture = {.width = SIDE,
            .height = SIDE,
            .rgba = half,
            .checkerboard = true,
            .first = first,
            .depth = depth,
            .to_previous = still,
            .matrix_count = 1};
        hg_temporal_forget(history);
        assert_int_equal(
            hg_temporal_resolve(history, jobs, &picture, HG_TEMPORAL_PICTURE, out, &stats), HG_OK);
        for (uint32_t i = 0; i < SIDE * SIDE; i++) {
            const float *s = slopes[k / 2];
            const float at = s[0] * (float)(i % SIDE) + s[1] * (float)(i / SIDE) - 16;
            if (at < -2 || at > 2) // the window of samples is wider than a pixel
                assert_int_equal(out[4 * i], at < 0 ? 200 : 40);
        }
    }
    hg_temporal_destroy(history);
    hg_jobs_destroy(jobs);
}

// What the debug view says of scales: all of the first picture's pixels are of its own samples,
// less of later ones; the colour is that of the scale.
static void test_scale_view(void **state)
{
    (void)state;
    static const struct {
        float scale;
        int full[3];
    } cases[] = {{100, {0, 255, 0}}, {75, {255, 255, 0}}, {50, {255, 0, 0}}};
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        struct rig rig;
        open_rig(&rig, 2);
        add_fence(&rig);
        const struct hg_view_params params = {.width = WIDTH,
            .height = HEIGHT,
            .debug_view = HG_DEBUG_SCALE,
            .temporal = HG_TEMPORAL_AUTO,
            .scale = cases[i].scale};
        hg_scene_publish(rig.scene);
        rig_view(&rig, &params);
        for (int k = 0; k < 2; k++) {
            struct hg_refbuf *picture = move_to(&rig, STEP_M * (float)k, 0);
            double mean[3] = {0};
            for (size_t at = 0; at < picture->size; at += 4)
                for (int c = 0; c < 3; c++)
                    mean[c] += (double)picture->data[at + (size_t)c] / (WIDTH * HEIGHT);
            for (int c = 0; c < 3; c++) {
                const double most = k == 0 ? cases[i].full[c] : 0.75 * cases[i].full[c];
                assert_true(mean[c] <= most && mean[c] >= (k == 0 ? most : 0.05 * most));
            }
            hg_refbuf_unref(picture);
        }
        rig_close(&rig);
    }
}

// Same requests, same bytes, whatever the threads; a view that rests forgets its motion.
static void test_same_bytes(void **state)
{
    (void)state;
    struct hg_refbuf *moved[2] = {NULL, NULL}, *settled[3] = {NULL, NULL, NULL};
    for (unsigned i = 0; i < 3; i++) {
        struct rig rig;
        open_rig(&rig, i + 1);
        add_fence(&rig);
        open_scaled(&rig, HG_TEMPORAL_AUTO, i < 2 ? 67 : 0);
        look(&rig, STEP_M * 5, 0.3f * STEP_M * 5);
        if (i < 2)
            error_after(&rig, 5, &moved[i]);
        else
            rig_settle(&rig, 16);
        settled[i] = rig_pixels(&rig, HG_PIXEL_RGBA32F);
        rig_close(&rig);
    }
    assert_memory_equal(moved[0]->data, moved[1]->data, moved[0]->size);
    rig_assert_same(settled[0], settled[2]);
    rig_assert_same(settled[1], settled[2]);
    for (int i = 0; i < 3; i++)
        hg_refbuf_unref(settled[i]);
    hg_refbuf_unref(moved[0]);
    hg_refbuf_unref(moved[1]);
}

// A target that no frame holds brings half of the sides, and one that all hold none less; at rest
// neither is seen.
static void test_target(void **state)
{
    (void)state;
    struct hg_refbuf *settled[2];
    for (int i = 0; i < 2; i++) {
        struct rig rig;
        open_rig(&rig, 2);
        add_fence(&rig);
        const struct hg_view_params params = {.width = WIDTH,
            .height = HEIGHT,
            .samples = 32,
            .temporal = HG_TEMPORAL_AUTO,
            .target_ms = i == 0 ? 1e-3f : 1e5f};
        hg_scene_publish(rig.scene);
        rig_view(&rig, &params);
        for (int k = 0; k < 8; k++)
            hg_refbuf_unref(move_to(&rig, STEP_M * (float)k, 0));
        const VkExtent2D drawn = rig.view->state.motion.temporal.drawn;
        assert_int_equal(drawn.width, i == 0 ? WIDTH / 2 : WIDTH);
        assert_int_equal(drawn.height, i == 0 ? HEIGHT / 2 : HEIGHT);
        char *stats;
        test_ok(hg_renderer_stats_json(rig.renderer, rig.view, &stats), &rig.err);
        assert_non_null(strstr(stats, i == 0 ? "\"motion\":{\"width\":48,\"height\":32,"
                                             : "\"motion\":{\"width\":96,\"height\":64,"));
        hg_free(stats);
        rig_settle(&rig, 16);
        settled[i] = rig_pixels(&rig, HG_PIXEL_RGBA8);
        rig_close(&rig);
    }
    rig_assert_same(settled[0], settled[1]);
    hg_refbuf_unref(settled[0]);
    hg_refbuf_unref(settled[1]);
}

// Sharpened pictures in motion are others, settled ones are not.
static void test_sharpen(void **state)
{
    (void)state;
    struct hg_refbuf *pictures[2][3];
    for (int i = 0; i < 2; i++) {
        struct rig rig;
        open_rig(&rig, 2);
        add_fence(&rig);
        const struct hg_view_params params = {.width = WIDTH,
            .height = HEIGHT,
            .samples = 8,
            .temporal = HG_TEMPORAL_AUTO,
            .scale = 67,
            .sharpen = i == 0 ? 0 : 1};
        hg_scene_publish(rig.scene);
        rig_view(&rig, &params);
        hg_refbuf_unref(move_to(&rig, 0, 0));
        pictures[i][0] = move_to(&rig, STEP_M, 0);
        pictures[i][1] = move_to(&rig, 2 * STEP_M, 0);
        rig_settle(&rig, 16);
        pictures[i][2] = rig_pixels(&rig, HG_PIXEL_RGBA8);
        rig_close(&rig);
    }
    for (int k = 0; k < 2; k++)
        assert_true(difference(pictures[0][k], pictures[1][k]) > 0.05);
    rig_assert_same(pictures[0][2], pictures[1][2]);
    for (int k = 0; k < 6; k++)
        hg_refbuf_unref(pictures[k / 3][k % 3]);
}

// A camera that jumps shows the picture of a view that never was elsewhere.
static void test_teleport(void **state)
{
    (void)state;
    struct hg_refbuf *pictures[2];
    for (int i = 0; i < 2; i++) {
        struct rig rig;
        open_rig(&rig, 2);
        add_fence(&rig);
        open_view(&rig, HG_TEMPORAL_AUTO);
        for (int k = 0; k < 4 && i == 0; k++)
            hg_refbuf_unref(move_to(&rig, STEP_M * (float)k, 0));
        const struct hg_view_camera back = {.eye = {0, 0, -9}, .target = {0.4f, 0, 0}};
        test_ok(hg_view_set_camera(rig.view, &back, &rig.err), &rig.err);
        rig_step(&rig, 1);
        pictures[i] = rig_pixels(&rig, HG_PIXEL_RGBA8);
        rig_close(&rig);
    }
    assert_memory_equal(pictures[0]->data, pictures[1]->data, pictures[0]->size);
    hg_refbuf_unref(pictures[0]);
    hg_refbuf_unref(pictures[1]);
}

// A fast body leaves the wall behind it as it was.
static void test_ghosts(void **state)
{
    (void)state;
    struct rig rig;
    open_rig(&rig, 2);
    rig_quad(rig.scene, 1, 8, -1, GREY);
    struct hg_node *body = rig_quad(rig.scene, 2, 0.3f, 0, RED);
    open_view(&rig, HG_TEMPORAL_AUTO);
    look(&rig, 0, 0);
    for (int i = 0; i < 8; i++) {
        body->translation[0] = -1.0f + 0.25f * (float)i; // 6 px
        touch(&rig, body);
        rig_step(&rig, 1);
    }
    struct hg_refbuf *moved = rig_pixels(&rig, HG_PIXEL_RGBA8);
    rig_settle(&rig, 16);
    struct hg_refbuf *settled = rig_pixels(&rig, HG_PIXEL_RGBA8);
    int worst = 0;
    const int edge = (int)(WIDTH / 2 + (body->translation[0] - 0.3f) * px_per_m()) - 2;
    for (int y = HEIGHT / 2 - 4; y < HEIGHT / 2 + 4; y++)
        for (int x = 4; x < edge; x++)
            for (int c = 0; c < 3; c++) {
                const int at = 4 * (y * WIDTH + x) + c;
                const int off = abs((int)moved->data[at] - (int)settled->data[at]);
                worst = off > worst ? off : worst;
            }
    print_message("ghost: %d of 255\n", worst);
    assert_true(worst <= 4);
    hg_refbuf_unref(moved);
    hg_refbuf_unref(settled);
    rig_close(&rig);
}

// Posed surfaces have history, and do not smear.
static void test_posed_edges(void **state)
{
    (void)state;
    double errors[2];
    for (int m = 0; m < 2; m++) {
        struct rig rig;
        const float delta[12] = {1, 0.3f, 0, 1, 0.3f, 0, 1, 0.3f, 0, 1, 0.3f, 0};
        open_rig(&rig, 2);
        struct hg_node *bar = add_fence(&rig);
        bar->mesh->target_count = 1;
        bar->mesh->weights = hg_calloc(1, sizeof *bar->mesh->weights);
        bar->mesh->parts->targets = hg_calloc(1, sizeof *bar->mesh->parts->targets);
        bar->mesh->parts->targets[0].positions = rig_copy(delta, sizeof delta);
        bar->weights = hg_calloc(1, sizeof *bar->weights);
        open_view(&rig, (enum hg_view_temporal)m);
        look(&rig, -1, 0);
        for (int i = 1; i < 24; i++) {
            bar->weights[0] = 0.4f * (float)i; // of 0.03 of a metre
            touch(&rig, bar);
            rig_step(&rig, 1);
        }
        struct hg_refbuf *moved = rig_pixels(&rig, HG_PIXEL_RGBA8);
        rig_settle(&rig, 16);
        struct hg_refbuf *settled = rig_pixels(&rig, HG_PIXEL_RGBA8);
        errors[m] = difference(moved, settled);
        hg_refbuf_unref(moved);
        hg_refbuf_unref(settled);
        rig_close(&rig);
    }
    print_message("posed: %.3f levels of several samples, %.3f of one\n", errors[HG_TEMPORAL_AUTO],
        errors[HG_TEMPORAL_NONE]);
    assert_true(errors[HG_TEMPORAL_AUTO] < 0.5 * errors[HG_TEMPORAL_NONE]);
}

// --- coming to rest ------------------------------------------------------------------------------

static struct hg_refbuf *settled_of(struct rig *rig, bool final)
{
    hg_view_set_final(rig->view, final);
    rig_settle(rig, 16);
    return rig_pixels(rig, HG_PIXEL_RGBA8);
}

// While light is gathered for a view that has come to rest, pictures of the whole size take the
// place of those in motion, each nearer to the settled one, and none is rougher than they are from
// then on. What is settled knows nothing of them.
static void test_comes_to_rest(void **state)
{
    (void)state;
    struct rig rig;
    open_rig(&rig, 2);
    add_fence(&rig);
    const struct hg_view_params params = {.width = WIDTH,
        .height = HEIGHT,
        .samples = 32,
        .gi = HG_GI_RAYS,
        .temporal = HG_TEMPORAL_AUTO,
        .scale = 50,
        .tonemap = HG_TONEMAP_LINEAR};
    hg_scene_publish(rig.scene);
    rig_view(&rig, &params);
    hg_view_set_final(rig.view, false);
    struct hg_refbuf *moved = NULL, *still = NULL;
    for (int i = 0; i < 6; i++) {
        hg_refbuf_unref(moved);
        moved = move_to(&rig, STEP_M * (float)i, 0);
    }
    assert_int_equal(rig.view->state.motion.temporal.drawn.width, WIDTH / 2);
    int pictures = 0;
    uint64_t number = rig.view->state.stats.number;
    struct hg_frame_info info = rig_step(&rig, 1);
    for (; info.phase == HG_VIEW_DIRECT; info = rig_step(&rig, 4)) {
        pictures += info.number > number;
        if (info.number > number) {
            hg_refbuf_unref(still);
            still = rig_pixels(&rig, HG_PIXEL_RGBA8);
        }
        number = info.number;
        assert_int_equal(rig.view->state.motion.temporal.drawn.width, WIDTH);
    }
    assert_int_equal(pictures, 8);
    for (; !info.settled; info = rig_step(&rig, 1)) {
        assert_true(info.number == number || info.samples >= 4);
        number = info.number;
    }
    struct hg_refbuf *settled = settled_of(&rig, false);
    const double before = difference(moved, settled), after = difference(still, settled);
    print_message("levels from the settled picture: %.3f in motion, %.3f at rest\n", before, after);
    assert_true(after < 0.6 * before);
    look(&rig, 0, STEP_M);
    hg_refbuf_unref(settled_of(&rig, true));
    look(&rig, STEP_M * 5, 0);
    struct hg_refbuf *final = settled_of(&rig, true);
    rig_assert_same(settled, final);
    hg_refbuf_unref(moved);
    hg_refbuf_unref(still);
    hg_refbuf_unref(settled);
    hg_refbuf_unref(final);
    rig_close(&rig);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_camera), cmocka_unit_test(test_node),
        cmocka_unit_test(test_morph), cmocka_unit_test(test_skin),
        cmocka_unit_test(test_error_falls), cmocka_unit_test(test_scale),
        cmocka_unit_test(test_checkerboard), cmocka_unit_test(test_checkerboard_holes),
        cmocka_unit_test(test_scale_view), cmocka_unit_test(test_same_bytes),
        cmocka_unit_test(test_target), cmocka_unit_test(test_sharpen),
        cmocka_unit_test(test_teleport), cmocka_unit_test(test_ghosts),
        cmocka_unit_test(test_posed_edges), cmocka_unit_test(test_comes_to_rest)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
