// render_unlit_tiles.c - pictures in which cells without light are shaded without lights
// (passes/unlit_tiles.h) are the same bytes as pictures in which all are shaded alike: settled,
// with finer cascades and jitter, and in motion; with thin shadows, soft edges, holes, lines, and
// lights that end in the picture.

#include "base/alloc.h"
#include "renderer/internal.h"
#include "tests/unit/render_rig.h"

#define WIDTH_PX   333 // no multiple of a cell
#define HEIGHT_PX  190
#define SAMPLES    5
#define MOST_BOXES 64

// --- the scene: a hall of posts and slats under a roof with holes -------------------------------

struct boxes {
    float positions[MOST_BOXES * 24 * 3], normals[MOST_BOXES * 24 * 3];
    uint32_t indices[MOST_BOXES * 36];
    uint32_t count;
};

static void add_box(struct boxes *boxes, const float low[3], const float high[3])
{
    assert_true(boxes->count < MOST_BOXES);
    uint32_t vertex = boxes->count * 24, index = boxes->count * 36;
    for (int axis = 0; axis < 3; axis++)
        for (int side = 0; side < 2; side++) {
            const int u = (axis + 1) % 3, v = (axis + 2) % 3;
            for (int corner = 0; corner < 4; corner++) {
                float *p = boxes->positions + (vertex + (uint32_t)corner) * 3;
                float *n = boxes->normals + (vertex + (uint32_t)corner) * 3;
                p[axis] = side ? high[axis] : low[axis];
                p[u] = corner & 1 ? high[u] : low[u];
                p[v] = corner & 2 ? high[v] : low[v];
                n[axis] = side ? 1.0f : -1.0f;
            }
            const uint32_t order[2][6] = {{0, 2, 1, 1, 2, 3}, {0, 1, 2, 2, 1, 3}};
            for (int i = 0; i < 6; i++)
                boxes->indices[index++] = vertex + order[side][i];
            vertex += 4;
        }
    boxes->count++;
}

static void add_mesh(struct hg_scene *scene, uint64_t id, const struct boxes *boxes)
{
    struct hg_mesh *mesh = rig_add(scene, HG_OBJECT_MESH, id);
    rig_part(mesh, boxes->count * 24, boxes->positions, boxes->normals, boxes->count * 36,
        boxes->indices);
    struct hg_node *node = rig_add(scene, HG_OBJECT_NODE, 100 + id);
    node->mesh = mesh;
}

static void add_hall(struct hg_scene *scene)
{
    static struct boxes boxes;
    boxes.count = 0;
    memset(&boxes, 0, sizeof boxes);
    add_box(&boxes, (float[]){-9, -0.2f, -9}, (float[]){9, 0, 9});
    add_box(&boxes, (float[]){-6, 3, -6}, (float[]){0.5f, 3.2f, 6}); // half a roof
    for (int i = 0; i < 12; i++) { // slats from 1 to 12 cm, a hand apart, and their thin shadows
        const float x = 0.8f + 0.35f * (float)i;
        add_box(&boxes, (float[]){x, 2.9f, -6}, (float[]){x + 0.01f * (float)(i + 1), 3, 2});
    }
    for (int i = 0; i < 8; i++) { // posts
        const float x = -5.0f + 1.4f * (float)i, thick = 0.03f * (float)(i + 1);
        add_box(&boxes, (float[]){x, 0, -2}, (float[]){x + thick, 3, -2 + thick});
    }
    add_box(&boxes, (float[]){-4, 0.7f, 1}, (float[]){-2, 0.75f, 3}); // a table
    add_mesh(scene, 1, &boxes);
}

static struct hg_light *add_lamp(struct hg_scene *scene, uint64_t id, double x, double z)
{
    struct hg_light *light = rig_add(scene, HG_OBJECT_LIGHT, id);
    light->kind = HG_LIGHT_POINT;
    light->intensity = 6;
    light->color[0] = light->color[1] = light->color[2] = 1;
    light->range = 2.5f;
    struct hg_node *node = rig_add(scene, HG_OBJECT_NODE, id);
    node->light = light;
    node->translation[0] = (float)x;
    node->translation[1] = 1.0f;
    node->translation[2] = (float)z;
    return light;
}

enum lights { SUN, TWO_SUNS, SUN_AND_LAMPS, LIGHTS };

static struct hg_scene *make_scene(enum lights lights)
{
    struct hg_scene *scene;
    assert_int_equal(hg_scene_create(&scene), HG_OK);
    add_hall(scene);
    rig_sun(scene, 3, -0.5f, 0.8660254f);
    if (lights == TWO_SUNS)
        rig_sun(scene, 4, -0.65f, 0.76f);
    if (lights == SUN_AND_LAMPS) {
        add_lamp(scene, 5, -3.5, 0);
        add_lamp(scene, 6, 3, -4);
    }
    rig_environment(scene, 0.5f, 0.4f, 0.3f);
    hg_scene_publish(scene);
    return scene;
}

// --- pictures ------------------------------------------------------------------------------------

static const struct hg_view_camera poses[] = {
    {.eye = {-5, 1.6f, 5}, .target = {-1, 1, -3}},
    {.eye = {4, 1.2f, 4}, .target = {2, 0.3f, -4}},
    {.eye = {0.6f, 0.2f, 1}, .target = {3, 0.05f, -6}}, // along the floor
    {.eye = {-2, 9, 0.1f}, .target = {-2, 0, 0}},       // from above
    {.eye = {-3, 2.5f, 2}, .target = {-2, 0, -3}},
    {.eye = {-5, 3.6f, 5}, .target = {0, 0.8f, -1}, .orthographic = true, .half_height = 3},
};
#define POSES (sizeof poses / sizeof poses[0])

static void open_rig(struct rig *rig, enum hg_override unlit_tiles, enum lights lights)
{
    const struct hg_renderer_params params = {
        .threads = 2, .overrides = {.unlit_tiles = unlit_tiles}};
    const struct hg_view_params view = {
        .width = WIDTH_PX, .height = HEIGHT_PX, .samples = SAMPLES, .seed = 3};
    *rig = (struct rig){0};
    test_ok(hg_renderer_create(&params, &rig->renderer, &rig->err), &rig->err);
    rig->scene = make_scene(lights);
    rig_view(rig, &view);
}

static float share(const struct rig *rig)
{
    struct hg_view_report report;
    hg_view_get_report(rig->view, &report);
    return report.unlit_share;
}

static struct hg_refbuf *settle(struct rig *rig, const struct hg_view_camera *camera)
{
    test_ok(hg_view_set_camera(rig->view, camera, &rig->err), &rig->err);
    rig_settle(rig, 2);
    return rig_pixels(rig, HG_PIXEL_RGBA32F);
}

static struct hg_refbuf *move(struct rig *rig, const struct hg_view_camera *camera)
{
    test_ok(hg_view_set_camera(rig->view, camera, &rig->err), &rig->err);
    assert_int_equal(rig_step(rig, 1).phase, HG_VIEW_DIRECT);
    return rig_pixels(rig, HG_PIXEL_RGBA8);
}

typedef struct hg_refbuf *shoot_fn(struct rig *rig, const struct hg_view_camera *camera);

// Also that there was something to tell apart.
static void check(enum lights lights, shoot_fn *shoot, const char *name)
{
    struct rig on, off;
    float most = 0, least = 1;
    open_rig(&on, HG_OVERRIDE_ON, lights);
    open_rig(&off, HG_OVERRIDE_OFF, lights);
    for (size_t i = 0; i < POSES; i++) {
        struct hg_refbuf *a = shoot(&on, &poses[i]), *b = shoot(&off, &poses[i]);
        print_message("%s, pose %zu: %.3f of the cells are dark\n", name, i, (double)share(&on));
        assert_int_equal(a->size, b->size);
        size_t different = 0;
        for (size_t k = 0; k < a->size; k++)
            different += a->data[k] != b->data[k];
        if (different > 0)
            fail_msg("%s, pose %zu: %zu bytes differ", name, i, different);
        most = fmaxf(most, share(&on));
        least = fminf(least, share(&on));
        hg_refbuf_unref(a);
        hg_refbuf_unref(b);
    }
    assert_true(most > 0.2f && least < 0.1f);
    rig_close(&on);
    rig_close(&off);
}

static void test_settled(void **state)
{
    (void)state;
    check(SUN, settle, "settled, sun");
    check(TWO_SUNS, settle, "settled, two suns");
    check(SUN_AND_LAMPS, settle, "settled, sun and lamps");
}

static void test_in_motion(void **state)
{
    (void)state;
    check(SUN, move, "in motion, sun");
    check(SUN_AND_LAMPS, move, "in motion, sun and lamps");
}

// A caster that goes away takes its darkness along.
static void test_edit(void **state)
{
    (void)state;
    struct rig rig;
    open_rig(&rig, HG_OVERRIDE_ON, SUN);
    struct hg_refbuf *before = settle(&rig, &poses[0]);
    const float dark = share(&rig);
    struct hg_light *light = (struct hg_light *)hg_scene_find(rig.scene, HG_OBJECT_LIGHT, 3);
    assert_non_null(light);
    light->casts_shadow = false;
    hg_scene_touch(rig.scene, &light->head);
    hg_scene_publish(rig.scene);
    struct hg_refbuf *after = settle(&rig, &poses[0]);
    assert_true(dark > 0.2f);
    assert_true(share(&rig) == 0.0f);
    assert_int_not_equal(memcmp(before->data, after->data, before->size), 0);
    hg_refbuf_unref(before);
    hg_refbuf_unref(after);
    rig_close(&rig);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_settled),
        cmocka_unit_test(test_in_motion),
        cmocka_unit_test(test_edit),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
