// render_moved_casters.c - where something moved, that part of the shadow maps alone is drawn
// again, and pictures are those of a view that sees the scene for the first time.
#include "renderer/internal.h"
#include "tests/unit/render_rig.h"

static const struct hg_view_params params = {
    .width = 200, .height = 120, .samples = 4, .gi = HG_GI_NONE};

static struct hg_node *add_plate(struct hg_scene *scene, uint64_t id, float half, float z)
{
    const float grey[4] = {0.5f, 0.5f, 0.5f, 1};
    struct hg_node *node = rig_quad(scene, id, half, z, grey);
    node->mesh->parts[0].material->unlit = false;
    return node;
}

// Two plates over a floor, under a sun and a lamp.
static struct hg_scene *make_scene(const float at[3])
{
    struct hg_scene *scene = rig_new_scene();
    add_plate(scene, 1, 5, 0);
    add_plate(scene, 2, 0.4f, 0.7f)->translation[0] = -1.2f;
    memcpy(add_plate(scene, 3, 0.3f, 0)->translation, at, 3 * sizeof *at);
    rig_sun(scene, 7, -0.2f, 0.98f);
    struct hg_light *lamp = rig_add(scene, HG_OBJECT_LIGHT, 8);
    struct hg_node *node = rig_add(scene, HG_OBJECT_NODE, 8);
    lamp->kind = HG_LIGHT_POINT;
    lamp->intensity = 4;
    lamp->color[0] = lamp->color[1] = lamp->color[2] = 1;
    lamp->casts_shadow = true;
    node->light = lamp;
    memcpy(node->translation, (float[3]){0.6f, -0.5f, 2}, sizeof(float[3]));
    rig_environment(scene, 0.1f, 0.1f, 0.1f);
    hg_scene_publish(scene);
    return scene;
}

static void open_scene(struct rig *rig, const float at[3])
{
    const struct hg_view_camera camera = {.eye = {0, -4, 4}, .vfov_rad = 1};
    rig_use_scene(rig, make_scene(at), &params);
    hg_view_set_formats(rig->view, 1u << HG_PIXEL_RGBA32F);
    test_ok(hg_view_set_camera(rig->view, &camera, &rig->err), &rig->err);
}

static struct hg_refbuf *settled(struct rig *rig)
{
    rig_settle(rig, 4);
    return rig_pixels(rig, HG_PIXEL_RGBA32F);
}

// The picture is that of a scene which never was otherwise; closes that.
static void assert_as_in(struct rig *fresh, const struct hg_refbuf *got)
{
    struct hg_refbuf *want = settled(fresh);
    rig_assert_same(got, want);
    hg_refbuf_unref(want);
    rig_close_scene(fresh);
}

// Of the maps that the newest picture drew again.
static float drawn_share(struct rig *rig)
{
    uint32_t count;
    const struct hg_shadow_map *maps = hg_lighting_shadow_maps(rig->view->state.lighting, &count);
    float drawn = 0, all = 0;
    for (uint32_t i = 0; i < count; i++) {
        const struct hg_shadow_rect *d = &maps[i].dirty;
        assert_true(maps[i].partly);
        drawn += (float)(d->x1 - d->x0) * (float)(d->y1 - d->y0);
        all += maps[i].gpu.size_px * maps[i].gpu.size_px;
    }
    assert_true(count > 6);
    return drawn / all;
}

static void test_moved(void **state)
{
    const float from[3] = {0.9f, 0, 0.4f}, to[3] = {1.3f, 0.2f, 0.6f};
    struct rig *rig = *state, fresh = {.renderer = rig->renderer};
    open_scene(rig, from);
    struct hg_refbuf *before = settled(rig);
    struct hg_node *node = (struct hg_node *)hg_scene_find(rig->scene, HG_OBJECT_NODE, 3);
    memcpy(node->translation, to, sizeof to);
    hg_scene_touch(rig->scene, &node->head);
    hg_scene_publish(rig->scene);
    rig_step(rig, 4);
    const float share = drawn_share(rig);
    print_message("%.2f %% of the texels are drawn again\n", 100 * (double)share);
    assert_true(share > 0 && share < 0.1f);
    struct hg_refbuf *after = settled(rig);
    assert_true(rig_difference(before, after) > 1e-3);
    open_scene(&fresh, to);
    assert_as_in(&fresh, after);
    hg_refbuf_unref(before);
    hg_refbuf_unref(after);
    rig_close_scene(rig);
}

static void hide(struct rig *rig)
{
    struct hg_node *node = (struct hg_node *)hg_scene_find(rig->scene, HG_OBJECT_NODE, 3);
    node->visible = false;
    hg_scene_touch(rig->scene, &node->head);
    hg_scene_publish(rig->scene);
}

// With one that goes the list of draws is another: all is drawn again.
static void test_removed(void **state)
{
    const float at[3] = {0.9f, 0, 0.4f};
    struct rig *rig = *state, fresh = {.renderer = rig->renderer};
    open_scene(rig, at);
    struct hg_refbuf *before = settled(rig);
    hide(rig);
    struct hg_refbuf *after = settled(rig);
    assert_true(rig_difference(before, after) > 3e-4);
    open_scene(&fresh, at);
    hide(&fresh);
    assert_as_in(&fresh, after);
    hg_refbuf_unref(before);
    hg_refbuf_unref(after);
    rig_close_scene(rig);
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
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_moved), cmocka_unit_test(test_removed)};
    return cmocka_run_group_tests(tests, open_renderer, close_renderer);
}
