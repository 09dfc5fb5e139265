// render_blended_shadows.c - blended surfaces cast shadows in shadow maps that are as dark in the
// mean as their alpha says, of suns and lamps, one behind the other, and other ones when their
// alpha changes; transmissive ones as dark as rays to lights say.
#include "renderer/view_look.h"
#include "tests/unit/render_rig.h"

#define ALPHAS 2

static const struct hg_view_params params = {
    .width = 160, .height = 96, .samples = 8, .gi = HG_GI_NONE};

// Plates over a floor, all of which but the floor blend; 0: no plate.
static struct hg_scene *make_scene(bool lamp, const float alpha[ALPHAS])
{
    struct hg_scene *scene = rig_new_scene();
    rig_quad(scene, 1, 5, 0, (float[4]){0.5f, 0.5f, 0.5f, 1})->mesh->parts[0].material->unlit =
        false;
    for (uint32_t i = 0; i < ALPHAS; i++)
        if (alpha[i] > 0)
            rig_quad(
                scene, 2 + i, 1.5f, 2 + 0.3f * (float)i, (float[4]){0.5f, 0.5f, 0.5f, alpha[i]});
    if (!lamp) {
        rig_sun(scene, 7, 0, 1);
    } else {
        struct hg_light *light = rig_add(scene, HG_OBJECT_LIGHT, 8);
        struct hg_node *node = rig_add(scene, HG_OBJECT_NODE, 8);
        light->kind = HG_LIGHT_POINT;
        light->intensity = 40;
        light->color[0] = light->color[1] = light->color[2] = 1;
        light->casts_shadow = true;
        node->light = light;
        node->translation[2] = 5;
    }
    rig_environment(scene, 0, 0, 0);
    hg_scene_publish(scene);
    return scene;
}

static void open_scene(struct rig *rig, bool lamp, const float alpha[ALPHAS])
{
    const struct hg_view_camera camera = {.eye = {0, -4, 1.4f}, .vfov_rad = 0.5f};
    rig_use_scene(rig, make_scene(lamp, alpha), &params);
    hg_view_set_formats(rig->view, 1u << HG_PIXEL_RGBA32F);
    test_ok(hg_view_set_camera(rig->view, &camera, &rig->err), &rig->err);
}

// Mean of the floor in the middle of the picture, all of which the plates shade; and the deviation
// from it.
static double floor_light(struct rig *rig, double *deviation)
{
    struct hg_refbuf *pixels = rig_pixels(rig, HG_PIXEL_RGBA32F);
    const float *p = (const float *)pixels->data;
    double sum = 0, squares = 0;
    uint32_t count = 0;
    for (uint32_t y = 36; y < 60; y++)
        for (uint32_t x = 60; x < 100; x++, count++) {
            const double v = (double)p[(y * params.width + x) * 4];
            sum += v;
            squares += v * v;
        }
    hg_refbuf_unref(pixels);
    sum /= count;
    *deviation = sqrt(fmax(squares / count - sum * sum, 0));
    return sum;
}

// The settled floor without plates.
static double lit_floor(struct rig *rig, bool lamp)
{
    const float none[ALPHAS] = {0};
    double off;
    open_scene(rig, lamp, none);
    rig_settle(rig, 8);
    const double lit = floor_light(rig, &off);
    rig_close_scene(rig);
    return lit;
}

// Share of light that arrives, in the first picture and in the settled one.
static void check_share(struct rig *rig, bool lamp, const float alpha[ALPHAS])
{
    const double lit = lit_floor(rig, lamp);
    const double want = (1 - (double)alpha[0]) * (1 - (double)alpha[1]);
    double off;
    open_scene(rig, lamp, alpha);
    rig_step(rig, 1);
    const double first = floor_light(rig, &off) / lit;
    rig_settle(rig, 8);
    const double settled = floor_light(rig, &off) / lit;
    print_message("%s, %.2f and %.2f: %.3f of the light in the first picture, %.3f settled, want "
                  "%.3f; deviation %.3f\n",
        lamp ? "lamp" : "sun", (double)alpha[0], (double)alpha[1], first, settled, want, off / lit);
    assert_true(fabs(first - want) < 0.03);
    assert_true(fabs(settled - want) < 0.02);
    assert_true(off / lit < 0.1);
    rig_close_scene(rig);
}

static void test_share(void **state)
{
    static const float alphas[][ALPHAS] = {
        {0.25f, 0}, {0.5f, 0}, {0.8f, 0}, {0.5f, 0.5f}, {0.3f, 0.6f}};
    for (uint32_t i = 0; i < sizeof alphas / sizeof *alphas; i++)
        for (int lamp = 0; lamp < 2; lamp++)
            check_share(*state, lamp != 0, alphas[i]);
}

static void make_pane(
    struct rig *rig, float color, float transmission, float thickness, float roughness)
{
    struct hg_material *m = (struct hg_material *)hg_scene_find(rig->scene, HG_OBJECT_MATERIAL, 2);
    m->base_color[0] = m->base_color[1] = m->base_color[2] = color;
    m->unlit = false;
    m->metallic = 0;
    m->roughness = roughness;
    m->transmission = transmission;
    m->volume.thickness = thickness;
    m->volume.attenuation_distance = INFINITY;
    hg_scene_touch(rig->scene, &m->head);
    hg_scene_publish(rig->scene);
}

// A plate that transmits lets straight through what its Fresnel reflectance and colour leave, if it
// is thin and smooth; what is thick, or rougher, holds all light back. Clear
// panes hold back none, nor do those that scatter light to what is behind them.
static void test_panes(void **state)
{
    static const struct {
        float color, transmission, thickness, roughness;
        double want;
    } panes[] = {{0.5f, 1, 0, 0, 0.48}, {1, 0.5f, 0, 0, 0.48}, {1, 1, 0, 0, 1}, {1, 1, 0.1f, 0, 0},
        {1, 1, 0, 0.2f, 0}, {1, 1, 0, 0.4f, 1}};
    const float alpha[ALPHAS] = {1, 0};
    struct rig *rig = *state;
    const double lit = lit_floor(rig, false);
    double off;
    for (uint32_t i = 0; i < sizeof panes / sizeof *panes; i++) {
        open_scene(rig, false, alpha);
        make_pane(
            rig, panes[i].color, panes[i].transmission, panes[i].thickness, panes[i].roughness);
        rig_settle(rig, 8);
        const double share = floor_light(rig, &off) / lit;
        print_message("pane %u: %.3f of the light, want %.3f\n", i, share, panes[i].want);
        assert_true(fabs(share - panes[i].want) < 0.02);
        rig_close_scene(rig);
    }
}

// What changed is drawn again: the picture is that of a scene that never was otherwise.
static void test_edit(void **state)
{
    const float before[ALPHAS] = {0.3f, 0}, after[ALPHAS] = {0.8f, 0};
    struct rig *rig = *state, fresh = {.renderer = rig->renderer};
    open_scene(rig, false, before);
    rig_settle(rig, 8);
    struct hg_material *material =
        (struct hg_material *)hg_scene_find(rig->scene, HG_OBJECT_MATERIAL, 2);
    material->base_color[3] = after[0];
    hg_scene_touch(rig->scene, &material->head);
    struct hg_node *node = (struct hg_node *)hg_scene_find(rig->scene, HG_OBJECT_NODE, 2);
    node->translation[0] = 0.4f;
    hg_scene_touch(rig->scene, &node->head);
    hg_scene_publish(rig->scene);
    rig_settle(rig, 8);
    struct hg_refbuf *got = rig_pixels(rig, HG_PIXEL_RGBA32F);
    open_scene(&fresh, false, after);
    node = (struct hg_node *)hg_scene_find(fresh.scene, HG_OBJECT_NODE, 2);
    node->translation[0] = 0.4f;
    hg_scene_touch(fresh.scene, &node->head);
    hg_scene_publish(fresh.scene);
    rig_settle(&fresh, 8);
    struct hg_refbuf *want = rig_pixels(&fresh, HG_PIXEL_RGBA32F);
    rig_assert_same(got, want);
    hg_refbuf_unref(got);
    hg_refbuf_unref(want);
    rig_close_scene(&fresh);
    rig_close_scene(rig);
}

// Views share shadow maps: what one hides, or sees through, casts the shadow that it has in the
// scene.
static void test_looks(void **state)
{
    const float alpha[ALPHAS] = {0.5f, 0};
    const struct hg_node_look looks[] = {{.node = 2, .set = HG_LOOK_HIDDEN, .hidden = true},
        {.node = 2, .set = HG_LOOK_ALPHA, .alpha = 0.3f}};
    struct rig *rig = *state;
    const double lit = lit_floor(rig, false);
    double off;
    for (uint32_t i = 0; i < 2; i++) {
        const struct hg_view_overrides overrides = {.items = &looks[i], .count = 1};
        open_scene(rig, false, alpha);
        test_ok(hg_view_set_overrides(rig->view, &overrides, &rig->err), &rig->err);
        rig_settle(rig, 8);
        const double share = floor_light(rig, &off) / lit;
        print_message("look %u: %.3f of the light\n", i, share);
        assert_true(fabs(share - 0.5) < 0.02);
        rig_close_scene(rig);
    }
}

static int open_renderer(void **state)
{
    static struct rig rig;
    rig_open(&rig, false);
    *state = &rig;
    return 0;
}

static int close_renderer(void **state)
{
    rig_close(*state);
    return 0;
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_share), cmocka_unit_test(test_panes),
        cmocka_unit_test(test_edit), cmocka_unit_test(test_looks)};
    return cmocka_run_group_tests(tests, open_renderer, close_renderer);
}
