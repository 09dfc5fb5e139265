// render_blend.c - blended surfaces: in depth order whatever the order of draws, the same bytes
// however much memory their lists have, and what stands for them in motion.
#include "renderer/image/metrics.h"
#include "renderer/internal.h"
#include "tests/unit/render_rig.h"

#define SIDE   48
#define SHEETS 90
#define EYE_Z  4.0f
#define VFOV   0.8f
#define WIDE   320
#define HIGH   180

static const float background[3] = {0.3f, 0.6f, 0.1f};

struct sheet {
    float half, z, color[4];
    bool opaque;
};

static uint32_t next_random(uint32_t *seed)
{
    *seed = *seed * 1664525u + 1013904223u;
    return *seed >> 8;
}

static float next_float(uint32_t *seed)
{
    return (float)next_random(seed) / 16777216.0f;
}

// Sheets of many sizes, of alpha 0, 1 and all between, two of them not blended.
static void make_sheets(struct sheet *sheets, uint32_t count)
{
    uint32_t seed = 7;
    for (uint32_t i = 0; i < count; i++) {
        struct sheet *s = &sheets[i];
        s->half = 0.1f + 2.5f * next_float(&seed);
        s->z = -0.031f * (float)i;
        for (int c = 0; c < 3; c++)
            s->color[c] = next_float(&seed);
        const uint32_t kind = next_random(&seed) % 12;
        s->color[3] = kind == 0 ? 0.0f : kind == 1 ? 1.0f : 0.3f * next_float(&seed);
        s->opaque = i == count / 2 || i == count - 1;
        if (kind == 1 || s->opaque) // all does not end in front
            s->half *= 0.4f;
    }
}

static struct hg_scene *make_scene(const struct sheet *sheets, uint32_t count, uint32_t stride)
{
    struct hg_scene *scene = rig_new_scene();
    for (uint32_t k = 0; k < count; k++) {
        const struct sheet *s = &sheets[k * stride % count]; // ids in another order
        rig_quad(scene, k + 1, s->half, s->z, s->color);
        struct hg_material *m =
            (struct hg_material *)hg_scene_find(scene, HG_OBJECT_MATERIAL, k + 1);
        m->alpha_mode = s->opaque ? HG_ALPHA_OPAQUE : HG_ALPHA_BLEND;
    }
    hg_scene_publish(scene);
    return scene;
}

static void look(struct rig *rig, float x)
{
    const struct hg_view_camera camera = {
        .eye = {x, 0, EYE_Z}, .target = {x, 0, 0}, .vfov_rad = VFOV};
    test_ok(hg_view_set_camera(rig->view, &camera, &rig->err), &rig->err);
}

static void open_view(
    struct rig *rig, const struct sheet *sheets, uint32_t stride, uint32_t samples)
{
    const struct hg_view_params params = {.width = SIDE,
        .height = SIDE,
        .samples = samples,
        .tonemap = HG_TONEMAP_LINEAR,
        .background = HG_BACKGROUND_COLOR,
        .background_color = {background[0], background[1], background[2]}};
    rig_use_scene(rig, make_scene(sheets, SHEETS, stride), &params);
    look(rig, 0.0f);
}

// What a pixel's centre shows; sheets are sorted already. False: an edge is near.
static bool composite(const struct sheet *sheets, uint32_t x, uint32_t y, double want[3])
{
    const double scale = tan(0.5 * (double)VFOV) / SIDE;
    const double dx = (2 * (x + 0.5) - SIDE) * scale, dy = (2 * (y + 0.5) - SIDE) * scale;
    double through = 1;
    memset(want, 0, 3 * sizeof *want);
    for (uint32_t i = 0; i < SHEETS; i++) {
        const struct sheet *s = &sheets[i];
        const double deep = (double)EYE_Z - (double)s->z;
        const double out = fmax(fabs(dx), fabs(dy)) * deep - (double)s->half;
        if (fabs(out) < 1e-3)
            return false;
        if (out > 0)
            continue;
        double alpha = s->opaque ? 1 : (double)s->color[3];
        if (alpha < 0.5 / 255) // takes no layer
            alpha = 0;
        for (int c = 0; c < 3; c++)
            want[c] += through * alpha * (double)s->color[c];
        through *= 1 - alpha;
    }
    for (int c = 0; c < 3; c++)
        want[c] += through * (double)background[c];
    return true;
}

static void test_order(void **state)
{
    (void)state;
    struct rig rig;
    struct sheet sheets[SHEETS];
    make_sheets(sheets, SHEETS);
    rig_open(&rig, true);
    open_view(&rig, sheets, 7, 1);
    rig_settle(&rig, 1);
    struct hg_refbuf *image = rig_pixels(&rig, HG_PIXEL_RGBA32F);
    uint32_t compared = 0;
    for (uint32_t i = 0; i < SIDE * SIDE; i++) {
        double want[3];
        float got[4];
        memcpy(got, image->data + (size_t)i * 16, sizeof got);
        if (!composite(sheets, i % SIDE, i / SIDE, want))
            continue;
        for (int c = 0; c < 3; c++)
            assert_float_equal(got[c], want[c], 2e-5f);
        compared++;
    }
    assert_true(compared > SIDE * SIDE * 3 / 4);
    hg_refbuf_unref(image);
    rig_close(&rig);
}

// A settled picture of several samples.
static struct hg_refbuf *settled(struct rig *rig, const struct sheet *sheets, uint32_t stride)
{
    open_view(rig, sheets, stride, 4);
    rig_settle(rig, 4);
    return rig_pixels(rig, HG_PIXEL_RGBA32F);
}

static void test_order_of_draws(void **state)
{
    (void)state;
    static const uint32_t strides[] = {7, 89, 31};
    struct rig rig;
    struct sheet sheets[SHEETS];
    make_sheets(sheets, SHEETS);
    rig_open(&rig, false);
    struct hg_refbuf *first = settled(&rig, sheets, 1);
    for (size_t i = 0; i < sizeof strides / sizeof *strides; i++) {
        rig_close_scene(&rig);
        struct hg_refbuf *other = settled(&rig, sheets, strides[i]);
        rig_assert_same(first, other);
        hg_refbuf_unref(other);
    }
    hg_refbuf_unref(first);
    rig_close(&rig);
}

// Lists that are drawn in strips, and lists that grow, hold the same.
static void test_memory(void **state)
{
    (void)state;
    struct rig rig;
    struct sheet sheets[SHEETS];
    make_sheets(sheets, SHEETS);
    rig_open(&rig, false);
    struct hg_refbuf *all = settled(&rig, sheets, 1);
    assert_int_equal(rig_report(&rig).blend.strips, 1);
    rig_close_scene(&rig);
    struct hg_debug_overrides *over = &rig.renderer->context.overrides;
    over->blend_most_nodes = 6000;
    open_view(&rig, sheets, 1, 4);
    rig_settle(&rig, 4);
    assert_true(rig_report(&rig).blend.strips > 4);
    struct hg_refbuf *strips = rig_pixels(&rig, HG_PIXEL_RGBA32F);
    rig_assert_same(all, strips);
    hg_refbuf_unref(strips);
    rig_close_scene(&rig);
    over->blend_most_nodes = 0;
    over->blend_first_nodes = 500;
    open_view(&rig, sheets, 1, 4);
    rig_settle(&rig, 4);
    assert_int_equal(rig_report(&rig).blend.strips, 1);
    struct hg_refbuf *grown = rig_pixels(&rig, HG_PIXEL_RGBA32F);
    rig_assert_same(all, grown);
    hg_refbuf_unref(grown);
    rig_close_scene(&rig);
    over->blend_most_nodes = 64; // too few for any strip: it settles all the same
    open_view(&rig, sheets, 1, 4);
    rig_settle(&rig, 4);
    hg_refbuf_unref(all);
    rig_close(&rig);
}

// RGBA8: mean of the light of all pixels.
static double mean_light(const struct hg_refbuf *image)
{
    double sum = 0;
    for (size_t i = 0; i < image->size; i++)
        sum += i % 4 < 3 ? pow(image->data[i] / 255.0, 2.2) : 0;
    return sum / (double)(image->size / 4 * 3);
}

// The newest picture in motion after a look at x, RGBA8.
static struct hg_refbuf *moved(struct rig *rig, float x)
{
    look(rig, x);
    rig_step(rig, 1);
    return rig_pixels(rig, HG_PIXEL_RGBA8);
}

// Pictures in motion with many blended surfaces take some of them per pixel in place of lists; the
// settled one after them is that of a view that never moved.
static void test_motion(void **state)
{
    (void)state;
    struct rig rig;
    struct sheet sheets[SHEETS];
    make_sheets(sheets, SHEETS);
    rig_open(&rig, false);
    struct hg_refbuf *never_moved = settled(&rig, sheets, 1);
    rig_close_scene(&rig);
    open_view(&rig, sheets, 1, 4);
    struct hg_refbuf *lists = moved(&rig, 0.2f);
    assert_int_equal(rig_report(&rig).blend.without_lists, 0);
    hg_refbuf_unref(moved(&rig, 0.1f));
    struct hg_refbuf *some = moved(&rig, 0.2f);
    assert_int_equal(rig_report(&rig).blend.without_lists, 2);
    // Single pixels are one surface or another; the mean over the picture is that of blending.
    print_message("mean light %.4f, blended %.4f\n", mean_light(some), mean_light(lists));
    assert_memory_not_equal(lists->data, some->data, lists->size);
    assert_float_equal(mean_light(some) / mean_light(lists), 1.0, 0.03);
    look(&rig, 0.0f);
    rig_settle(&rig, 4);
    struct hg_refbuf *rests = rig_pixels(&rig, HG_PIXEL_RGBA32F);
    rig_assert_same(never_moved, rests);
    hg_refbuf_unref(rests);
    hg_refbuf_unref(some);
    hg_refbuf_unref(lists);
    hg_refbuf_unref(never_moved);
    rig_close(&rig);
}

// LDR-FLIP of two pictures of a street under 200 leaf cards.
static double flip(const struct hg_refbuf *a, const struct hg_refbuf *b)
{
    const struct hg_image images[2] = {
        {.width = WIDE, .height = HIGH, .size_bytes = a->size, .pixels = (void *)a->data},
        {.width = WIDE, .height = HIGH, .size_bytes = b->size, .pixels = (void *)b->data}};
    struct hg_error err = {0};
    double value;
    const struct hg_image_pair pair = {&images[0], &images[1], NULL};
    test_ok(hg_image_compare(&pair, HG_METRIC_FLIP, &value, NULL, &err), &err);
    return value;
}

static void look_along_street(struct rig *rig, float z)
{
    const struct hg_view_camera camera = {
        .eye = {0, 1.7f, z}, .target = {0, 2, z - 9}, .vfov_rad = 0.9f};
    test_ok(hg_view_set_camera(rig->view, &camera, &rig->err), &rig->err);
}

// In motion as good as one sample can be, nearly: what is left is that edges are not smooth.
static void test_foliage(void **state)
{
    (void)state;
    struct rig rig;
    const struct hg_view_params params = {.width = WIDE, .height = HIGH, .samples = 8};
    rig_open(&rig, false);
    rig_use_scene(&rig, rig_load(TEST_MODELS "/leaves.glb", NULL), &params);
    look_along_street(&rig, 9);
    rig_settle(&rig, 8);
    struct hg_refbuf *rests = rig_pixels(&rig, HG_PIXEL_RGBA8);
    look_along_street(&rig, 8.5f);
    rig_step(&rig, 1);
    look_along_street(&rig, 9);
    rig_step(&rig, 1);
    assert_true(rig_report(&rig).blend.without_lists > 0);
    struct hg_refbuf *moves = rig_pixels(&rig, HG_PIXEL_RGBA8);
    rig.renderer->context.overrides.blend_lists = true;
    look_along_street(&rig, 8.5f);
    rig_step(&rig, 1);
    look_along_street(&rig, 9);
    rig_step(&rig, 1);
    struct hg_refbuf *lists = rig_pixels(&rig, HG_PIXEL_RGBA8);
    const double apart = flip(rests, moves), least = flip(rests, lists);
    print_message("FLIP against the settled picture: %.4f, with lists %.4f\n", apart, least);
    assert_true(apart < least + 0.02);
    hg_refbuf_unref(lists);
    hg_refbuf_unref(moves);
    hg_refbuf_unref(rests);
    rig_close(&rig);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_order),
        cmocka_unit_test(test_order_of_draws), cmocka_unit_test(test_memory),
        cmocka_unit_test(test_motion), cmocka_unit_test(test_foliage)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
