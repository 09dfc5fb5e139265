// render_cryptomatte.c - Cryptomattes of path-traced views: shares of pixels to the closed form,
// names, manifest; planes that were asked for and planes that were not.
#include "base/alloc.h"
#include "renderer/image/cryptomatte.h"
#include "tests/unit/render_rig.h"

enum { SIDE = 32, SAMPLES = 64, RANKS = HG_MATTE_RANKS };

static void name(struct hg_object *object, const char *text)
{
    hg_free(object->name);
    object->name = hg_strdup(text);
    assert_non_null(object->name);
}

// A quad in the plane z, from x0 to x1 and y -1 to 1, that looks along +z.
static void add_quad(
    struct hg_scene *scene, uint64_t id, const char *text, const float x[2], float z)
{
    static const uint32_t indices[6] = {0, 1, 2, 0, 2, 3};
    static const float normals[12] = {0, 0, 1, 0, 0, 1, 0, 0, 1, 0, 0, 1};
    const float positions[12] = {x[0], -1, z, x[1], -1, z, x[1], 1, z, x[0], 1, z};
    struct hg_material *material = rig_add(scene, HG_OBJECT_MATERIAL, id);
    name(&material->head, "paint");
    struct hg_mesh *mesh = rig_add(scene, HG_OBJECT_MESH, id);
    rig_part(mesh, 4, positions, normals, 6, indices)->material = material;
    struct hg_node *node = rig_add(scene, HG_OBJECT_NODE, id);
    node->mesh = mesh;
    if (text)
        name(&node->head, text);
}

// Seen from +z, 32 px for 2 m: "near" covers columns 0 to 9 and three quarters of column 10; behind
// it a nameless one from the left edge to the middle of column 20.
static void open_scene(struct rig *rig, uint32_t planes)
{
    const struct hg_renderer_params params = {.threads = 2};
    const float px = 2.0f / SIDE;
    *rig = (struct rig){0};
    test_ok(hg_renderer_create(&params, &rig->renderer, &rig->err), &rig->err);
    assert_int_equal(hg_scene_create(&rig->scene), HG_OK);
    add_quad(rig->scene, 1, "near", (const float[2]){-1, -1 + 10.75f * px}, 0.5f);
    add_quad(rig->scene, 2, NULL, (const float[2]){-1, -1 + 20.5f * px}, 0);
    rig_environment(rig->scene, 1, 1, 1);
    hg_scene_publish(rig->scene);
    rig_view(rig, &(struct hg_view_params){.width = SIDE,
                      .height = SIDE,
                      .mode = HG_MODE_PATH,
                      .samples = SAMPLES,
                      .filter = HG_FILTER_BOX,
                      .background = HG_BACKGROUND_NONE,
                      .planes = planes});
    const struct hg_view_camera camera = {
        .eye = {0, 0, 3}, .orthographic = true, .half_height = 1, .near = 0.1f, .far = 10};
    test_ok(hg_view_set_camera(rig->view, &camera, &rig->err), &rig->err);
}

static float share(const struct hg_matte *matte, uint32_t x, const char *of)
{
    const float *rank =
        (const float *)(const void *)matte->ranks->data + (16 * SIDE + x) * 2 * RANKS;
    const uint32_t id = hg_cryptomatte_id(of);
    float sum = 0;
    for (int i = 0; i < RANKS; i++) {
        assert_true(i == 0 || rank[2 * i + 1] <= rank[2 * i - 1]);
        sum += memcmp(&rank[2 * i], &id, sizeof id) == 0 ? rank[2 * i + 1] : 0;
    }
    return sum;
}

static void assert_near(float seen, float wanted)
{
    if (!(fabsf(seen - wanted) < 0.04f)) // 64 points
        fail_msg("%g instead of %g", (double)seen, (double)wanted);
}

static void test_objects(void **state)
{
    (void)state;
    struct rig rig;
    struct hg_matte matte;
    open_scene(&rig, 1u << HG_PLANE_DRAWS);
    rig_settle(&rig, 16);
    test_ok(hg_view_read_matte(rig.view, HG_MATTE_OBJECT, &matte, &rig.err), &rig.err);
    assert_int_equal(matte.ranks->size, SIDE * SIDE * 2 * RANKS * sizeof(float));
    assert_true(share(&matte, 5, "near") == 1 && share(&matte, 5, "node 2") == 0);
    assert_near(share(&matte, 10, "near"), 0.75f);
    assert_near(share(&matte, 10, "node 2"), 0.25f);
    assert_true(share(&matte, 10, "near") + share(&matte, 10, "node 2") == 1);
    assert_true(share(&matte, 15, "node 2") == 1);
    assert_near(share(&matte, 20, "node 2"), 0.5f);
    assert_true(share(&matte, 25, "node 2") == 0 && share(&matte, 25, "near") == 0);
    char wanted[100];
    snprintf(wanted, sizeof wanted, "{\"near\":\"%08x\",\"node 2\":\"%08x\"}",
        hg_cryptomatte_id("near"), hg_cryptomatte_id("node 2"));
    assert_string_equal(matte.manifest, wanted);
    hg_cryptomatte_view_finish(&matte);
    rig_close(&rig);
}

// Names that are the same are one thing, whatever carries them.
static void test_materials_and_assets(void **state)
{
    (void)state;
    struct rig rig;
    struct hg_matte matte;
    struct hg_refbuf *color;
    open_scene(&rig, 1u << HG_PLANE_DRAWS);
    rig_settle(&rig, 16);
    test_ok(hg_view_read_matte(rig.view, HG_MATTE_MATERIAL, &matte, &rig.err), &rig.err);
    test_ok(hg_view_read_plane(rig.view, HG_PLANE_COLOR, &color, &rig.err), &rig.err);
    for (uint32_t x = 0; x < SIDE; x++) // coverage by other means
        assert_true(
            fabsf(share(&matte, x, "paint") -
                  ((const float *)(const void *)color->data)[(16 * SIDE + x) * 4 + 3]) < 1e-6f);
    hg_cryptomatte_view_finish(&matte);
    hg_refbuf_unref(color);
    test_ok(hg_view_read_matte(rig.view, HG_MATTE_ASSET, &matte, &rig.err), &rig.err);
    assert_true(share(&matte, 10, "client") == 1);
    assert_non_null(strstr(matte.manifest, "\"client\""));
    hg_cryptomatte_view_finish(&matte);
    rig_close(&rig);
}

// --- many draws in a pixel -----------------------------------------------------------------------

enum { LEAVES = 12, AT = 10 };

// Twelve nodes side by side in column AT and as wide as it, of two materials in turn and of one
// asset.
static void open_leaves(struct rig *rig, const struct hg_view_camera *camera, float alpha)
{
    const struct hg_renderer_params params = {.threads = 2};
    const float px = 2.0f / SIDE, left = -1 + AT * px, wide = px / LEAVES;
    *rig = (struct rig){0};
    test_ok(hg_renderer_create(&params, &rig->renderer, &rig->err), &rig->err);
    assert_int_equal(hg_scene_create(&rig->scene), HG_OK);
    for (int i = 0; i < LEAVES; i++) {
        const float x[2] = {left + (float)i * wide, left + (float)(i + 1) * wide};
        add_quad(rig->scene, (uint64_t)i + 1, NULL, x, 0);
        struct hg_material *m =
            (struct hg_material *)rig->scene->objects[HG_OBJECT_MATERIAL].items[i];
        name(&m->head, i % 2 == 0 ? "leaf" : "bark");
        m->alpha_mode = alpha < 1 ? HG_ALPHA_BLEND : HG_ALPHA_OPAQUE;
        m->base_color[3] = alpha;
    }
    rig_environment(rig->scene, 1, 1, 1);
    hg_scene_publish(rig->scene);
    rig_view(rig, &(struct hg_view_params){.width = SIDE,
                      .height = SIDE,
                      .mode = HG_MODE_PATH,
                      .samples = 4 * SAMPLES,
                      .filter = HG_FILTER_BOX,
                      .background = HG_BACKGROUND_NONE,
                      .planes = 1u << HG_PLANE_DRAWS,
                      .mattes = 1u << HG_MATTE_MATERIAL | 1u << HG_MATTE_ASSET});
    test_ok(hg_view_set_camera(rig->view, camera, &rig->err), &rig->err);
    rig_settle(rig, 16);
}

// More draws than a list has room for are no fewer of their material and asset: what a pixel has of
// these is its coverage, sample for sample. covered: of column AT; 0 = not known.
static void check_leaves(const struct hg_view_camera *camera, float alpha, float covered)
{
    struct rig rig;
    struct hg_matte materials, assets, none;
    struct hg_refbuf *color;
    open_leaves(&rig, camera, alpha);
    test_ok(hg_view_read_matte(rig.view, HG_MATTE_MATERIAL, &materials, &rig.err), &rig.err);
    test_ok(hg_view_read_matte(rig.view, HG_MATTE_ASSET, &assets, &rig.err), &rig.err);
    assert_int_equal(hg_view_read_matte(rig.view, HG_MATTE_OBJECT, &none, &rig.err), HG_E_STATE);
    test_ok(hg_view_read_plane(rig.view, HG_PLANE_COLOR, &color, &rig.err), &rig.err);
    float all = 0;
    for (uint32_t x = 0; x < SIDE; x++) {
        const float seen = ((const float *)(const void *)color->data)[(16 * SIDE + x) * 4 + 3];
        all += seen;
        assert_true(fabsf(share(&assets, x, "client") - seen) < 1e-6f);
        assert_true(
            fabsf(share(&materials, x, "leaf") + share(&materials, x, "bark") - seen) < 1e-6f);
    }
    assert_true(all > 0.4f); // px
    if (covered > 0) {
        assert_near(share(&assets, AT, "client"), covered);
        assert_near(share(&materials, AT, "leaf"), covered / 2);
    }
    hg_refbuf_unref(color);
    hg_cryptomatte_view_finish(&materials);
    hg_cryptomatte_view_finish(&assets);
    rig_close(&rig);
}

static void test_many_draws(void **state)
{
    (void)state;
    const struct hg_view_camera flat = {
        .eye = {0, 0, 3}, .orthographic = true, .half_height = 1, .near = 0.1f, .far = 10};
    check_leaves(&flat, 1.0f, 1.0f);
    check_leaves(&flat, 0.5f, 0.5f);
    // Far out of focus: many pixels see all of them.
    const float px = 2.0f / SIDE, across = -1 + (AT + 0.5f) * px;
    const struct hg_view_camera lens = {.eye = {across, 0, 3},
        .target = {across, 0, 0},
        .vfov_rad = 2 * atanf(1.0f / 3),
        .near = 0.1f,
        .far = 10,
        .lens_radius = 4 * px,
        .focus_distance = 1.5f};
    check_leaves(&lens, 1.0f, 0);
}

static void test_not_asked_for(void **state)
{
    (void)state;
    struct rig rig;
    struct hg_matte matte;
    open_scene(&rig, 1u << HG_PLANE_DEPTH);
    assert_int_equal(hg_view_read_matte(rig.view, HG_MATTE_OBJECT, &matte, &rig.err), HG_E_STATE);
    rig_settle(&rig, 16);
    assert_int_equal(hg_view_read_matte(rig.view, HG_MATTE_OBJECT, &matte, &rig.err), HG_E_STATE);
    assert_null(matte.ranks);
    rig_close(&rig);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_objects),
        cmocka_unit_test(test_materials_and_assets),
        cmocka_unit_test(test_many_draws),
        cmocka_unit_test(test_not_asked_for),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
