// render_shared_shadows.c - views of one scene share its shadow maps: what does not depend on their
// cameras is drawn once, atlases are few, and settled pictures are those of a view that is alone.
#include "renderer/internal.h"
#include "renderer/light/light_shared.h"
#include "tests/unit/render_rig.h"

#define VIEWS 5

static const struct hg_view_params params = {
    .width = 160, .height = 96, .samples = 6, .gi = HG_GI_NONE};

// A plate over a floor so wide that the sun has finer cascades, and a lamp.
static struct hg_scene *make_scene(void)
{
    const float grey[4] = {0.5f, 0.5f, 0.5f, 1};
    struct hg_scene *scene = rig_new_scene();
    rig_quad(scene, 1, 60, 0, grey)->mesh->parts[0].material->unlit = false;
    rig_quad(scene, 2, 0.8f, 0.7f, grey)->mesh->parts[0].material->unlit = false;
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

static void look(struct rig *rig, uint32_t from)
{
    const float turn = (float)from * 0.7f;
    const struct hg_view_camera camera = {
        .eye = {4 * sinf(turn), -4 * cosf(turn), 3 + 0.3f * (float)from}, .vfov_rad = 1};
    test_ok(hg_view_set_camera(rig->view, &camera, &rig->err), &rig->err);
}

// The first is the scene's owner.
static void open_views(struct rig *rigs, struct hg_renderer *renderer, uint32_t count)
{
    for (uint32_t i = 0; i < count; i++) {
        rigs[i] = (struct rig){.renderer = renderer, .scene = i > 0 ? rigs[0].scene : NULL};
        if (i > 0)
            rig_view(&rigs[i], &params);
        else
            rig_use_scene(&rigs[i], make_scene(), &params);
        hg_view_set_formats(rigs[i].view, 1u << HG_PIXEL_RGBA32F);
        look(&rigs[i], i);
    }
}

static void close_views(struct rig *rigs, uint32_t count)
{
    for (uint32_t i = 1; i < count; i++)
        hg_view_destroy(rigs[i].view);
    rig_close_scene(&rigs[0]);
}

static uint32_t drawn_maps(const struct rig *rig)
{
    uint32_t count, drawn = 0;
    const struct hg_shadow_map *maps = hg_lighting_shadow_maps(rig->view->state.lighting, &count);
    for (uint32_t i = 0; i < count; i++)
        drawn += maps[i].touched;
    return drawn;
}

static uint32_t atlases(const struct rig *rig)
{
    const struct hg_shadow_atlases *all = &rig->view->state.scene_gpu->light->atlases;
    uint32_t count = 0;
    for (uint32_t i = 0; i < HG_SHADOW_ATLASES; i++)
        count += all->items[i].image.width > 0;
    return count;
}

// The sun's map of the whole scene and the six of the lamp are drawn once, whoever needs them
// first.
static void test_motion(void **state)
{
    struct rig *rig = *state, views[VIEWS];
    uint32_t drawn = 0;
    open_views(views, rig->renderer, VIEWS);
    for (uint32_t round = 0; round < 4; round++)
        for (uint32_t i = 0; i < VIEWS; i++) {
            look(&views[i], i + round);
            rig_step(&views[i], 1);
            drawn += drawn_maps(&views[i]);
            assert_true(drawn >= 2 && drawn <= 7);
            assert_true(round < 3 || drawn_maps(&views[i]) == 0);
            assert_int_equal(atlases(&views[i]), 1);
        }
    close_views(views, VIEWS);
}

// A picture of a small movement; returns how many pages it draws.
static uint32_t move(struct rig *rig, uint32_t step)
{
    struct hg_lighting_stats stats;
    const struct hg_view_camera camera = {
        .eye = {1e-4 * step, -4, 0.8}, .target = {1e-4 * step, 6, 0}, .vfov_rad = 1};
    test_ok(hg_view_set_camera(rig->view, &camera, &rig->err), &rig->err);
    rig_step(rig, 1);
    hg_lighting_stats(rig->view->state.lighting, &stats);
    return stats.pages.drawn;
}

// Pages that one view has drawn are there for all: five views from about the same place draw as
// many as one, in one atlas.
static void test_pages(void **state)
{
    struct rig *rig = *state, views[VIEWS];
    struct hg_view_params paged = params;
    paged.shadow_maps = HG_SHADOW_MAPS_VIRTUAL;
    paged.temporal = HG_TEMPORAL_AUTO;
    uint32_t drawn[VIEWS] = {0};
    open_views(views, rig->renderer, VIEWS);
    for (uint32_t i = 0; i < VIEWS; i++) {
        test_ok(hg_view_set_params(views[i].view, &paged, &views[i].err), &views[i].err);
        hg_view_set_formats(views[i].view, 1u << HG_PIXEL_RGBA8);
    }
    struct hg_lighting_stats stats;
    for (uint32_t i = 0; i < VIEWS; i++)
        for (uint32_t step = 0; step < 12; step++) {
            drawn[i] += move(&views[i], step);
            assert_int_equal(atlases(&views[i]), 1);
        }
    hg_lighting_stats(views[0].view->state.lighting, &stats);
    print_message("%u pages asked for, %u drawn by the first view\n", stats.pages.asked, drawn[0]);
    assert_true(stats.pages.asked > 2);
    assert_int_equal(stats.pages.hits, stats.pages.asked);
    for (uint32_t i = 1; i < VIEWS; i++)
        assert_int_equal(drawn[i], 0);
    // One of them comes to rest, which takes another atlas: the others go on with their pages.
    for (uint32_t step = 0; step < 8; step++) {
        rig_step(&views[0], 1);
        drawn[1] += move(&views[1], step);
    }
    assert_int_equal(drawn[1], 0);
    close_views(views, VIEWS);
}

// Steps of all views in turn, the others while one of them moves, until all are settled.
static void settle_all(struct rig *views)
{
    uint32_t settled = 0;
    for (uint32_t round = 0; round < 2000 && settled < VIEWS; round++) {
        settled = 0;
        for (uint32_t i = 0; i < VIEWS; i++) {
            if (i == 0 && round < 4)
                look(&views[0], 9 + round % 2);
            settled += rig_step(&views[i], 1).settled && round >= 4;
            assert_true(atlases(&views[i]) <= HG_SHADOW_ATLASES);
        }
    }
    assert_int_equal(settled, VIEWS);
}

// More views refine at a time than there are atlases.
static void test_rest(void **state)
{
    struct rig *rig = *state, views[VIEWS], alone;
    struct hg_refbuf *got[VIEWS];
    open_views(views, rig->renderer, VIEWS);
    settle_all(views);
    assert_int_equal(atlases(&views[0]), 1);
    for (uint32_t i = 0; i < VIEWS; i++)
        got[i] = rig_pixels(&views[i], HG_PIXEL_RGBA32F);
    close_views(views, VIEWS);
    for (uint32_t i = 0; i < VIEWS; i++) {
        open_views(&alone, rig->renderer, 1);
        look(&alone, i > 0 ? i : 10);
        rig_settle(&alone, 1);
        struct hg_refbuf *want = rig_pixels(&alone, HG_PIXEL_RGBA32F);
        rig_assert_same(got[i], want);
        hg_refbuf_unref(want);
        hg_refbuf_unref(got[i]);
        close_views(&alone, 1);
    }
}

// A view that is closed while it has an atlas to itself leaves it to the others.
static void test_closed(void **state)
{
    struct rig *rig = *state, views[2];
    open_views(views, rig->renderer, 2);
    for (uint32_t i = 0; i < 2; i++)
        rig_step(&views[i], 1);
    rig_step(&views[1], 1); // refines
    hg_view_destroy(views[1].view);
    rig_settle(&views[0], 1);
    assert_int_equal(atlases(&views[0]), 1);
    close_views(views, 1);
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
        cmocka_unit_test(test_motion),
        cmocka_unit_test(test_pages),
        cmocka_unit_test(test_rest),
        cmocka_unit_test(test_closed),
    };
    return cmocka_run_group_tests(tests, open_renderer, close_renderer);
}
