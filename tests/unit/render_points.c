// render_points.c - clouds of points in pictures: areas against closed forms in both modes, what is
// lit, picks, and two million points that do not depend on the budget.

#include "base/alloc.h"
#include "base/log.h"
#include "renderer/internal.h"
#include "tests/support/folder.h"
#include "tests/unit/lod_points.h"
#include "tests/unit/render_rig.h"

#define MIB  (1ull << 20)
#define SIDE 160

static char cache_dir[TEST_FOLDER_MAX];

// A scene with nothing but a cloud, which is taken over, turned so that +y of it points at the eye.
static struct hg_scene *scene_of(struct hg_mesh_part *cloud)
{
    struct hg_scene *scene = rig_new_scene();
    struct hg_mesh *mesh = rig_add(scene, HG_OBJECT_MESH, 1);
    mesh->parts = hg_calloc(1, sizeof *mesh->parts);
    assert_non_null(mesh->parts);
    mesh->part_count = 1;
    mesh->parts[0] = *cloud;
    struct hg_node *node = rig_add(scene, HG_OBJECT_NODE, 1);
    node->mesh = mesh;
    node->rotation[0] = node->rotation[3] = 0.70710678f;
    hg_scene_publish(scene);
    return scene;
}

static void open_cloud(
    struct rig *rig, struct hg_mesh_part *cloud, enum hg_render_mode mode, uint64_t budget_bytes)
{
    const struct hg_renderer_params params = {
        .geometry_budget_bytes = budget_bytes, .cache_dir = cache_dir, .threads = 2};
    const struct hg_view_params view = {.width = SIDE,
        .height = SIDE,
        .mode = mode,
        .background = HG_BACKGROUND_NONE,
        .samples = 16};
    const struct hg_view_camera camera = {
        .eye = {0, 0, 3}, .orthographic = true, .half_height = 1.0f};
    *rig = (struct rig){0};
    test_ok(hg_renderer_create(&params, &rig->renderer, &rig->err), &rig->err);
    rig_use_scene(rig, scene_of(cloud), &view);
    test_ok(hg_view_set_camera(rig->view, &camera, &rig->err), &rig->err);
}

static void colors_of(struct hg_mesh_part *p, float red, float green, float blue)
{
    const float color[4] = {red, green, blue, 1};
    p->colors = hg_calloc(p->vertex_count, 16);
    assert_non_null(p->colors);
    for (size_t i = 0; i < p->vertex_count; i++)
        memcpy(p->colors + i * 4, color, sizeof color);
}

// Share of the picture that the cloud covers, and its mean colour.
static double covered(struct rig *rig, double mean[3])
{
    struct hg_refbuf *pixels = rig_pixels(rig, HG_PIXEL_RGBA32F);
    const float *p = (const float *)(const void *)pixels->data;
    double alpha = 0.0;
    memset(mean, 0, 3 * sizeof *mean);
    for (size_t i = 0; i < SIDE * SIDE; i++) {
        alpha += p[i * 4 + 3];
        for (size_t k = 0; k < 3; k++)
            mean[k] += p[i * 4 + k] * p[i * 4 + 3];
    }
    for (size_t k = 0; k < 3; k++)
        mean[k] /= fmax(alpha, 1e-9);
    hg_refbuf_unref(pixels);
    return alpha / (SIDE * SIDE);
}

// 49 discs that do not touch cover 49 pi r^2 of the 4 m^2, in both modes, with the colour they
// have.
static void test_areas_and_colours(void **state)
{
    (void)state;
    static const enum hg_render_mode modes[] = {HG_MODE_REALTIME, HG_MODE_PATH};
    double seen[2];
    for (int m = 0; m < 2; m++) {
        struct rig rig;
        double mean[3];
        struct hg_mesh_part cloud = points_grid(7, 0.25f);
        hg_free(cloud.normals);
        cloud.normals = NULL;
        colors_of(&cloud, 0.5f, 0.25f, 0.125f);
        cloud.point_diameter = 0.2f;
        open_cloud(&rig, &cloud, modes[m], 0);
        rig_environment(rig.scene, 3, 3, 3); // colours without normals are not lit
        rig_settle(&rig, 16);
        seen[m] = covered(&rig, mean);
        print_message("mode %d: %.5f covered, colour %.4f %.4f %.4f\n", m, seen[m], mean[0],
            mean[1], mean[2]);
        assert_true(fabs(seen[m] / (49 * M_PI * 0.01 / 4) - 1) < 0.01);
        for (int k = 0; k < 3; k++)
            assert_true(fabs(mean[k] - 0.5 / (1 << k)) < 0.004);
        rig_close_scene(&rig);
        rig_close(&rig);
    }
    assert_true(fabs(seen[0] / seen[1] - 1) < 0.01);
}

// A closed plane of lit discs under an environment of one: what it reflects, on either side.
static void test_planes_are_lit(void **state)
{
    (void)state;
    static const enum hg_render_mode modes[] = {HG_MODE_REALTIME, HG_MODE_PATH};
    double seen[2];
    for (int m = 0; m < 2; m++) {
        struct rig rig;
        double mean[3];
        struct hg_mesh_part cloud = points_plane(9000, false);
        hg_free(cloud.normals); // estimated
        cloud.normals = NULL;
        for (uint32_t i = 0; i < cloud.vertex_count * 3; i++)
            cloud.positions[i] *= 1.2f; // its edge is outside of the picture
        open_cloud(&rig, &cloud, modes[m], 0);
        rig_environment(rig.scene, 1, 1, 1);
        rig_settle(&rig, 16);
        assert_true(covered(&rig, mean) > 0.9999);
        seen[m] = mean[1];
        rig_close_scene(&rig);
        rig_close(&rig);
    }
    print_message("radiance %.4f in real time, %.4f path-traced\n", seen[0], seen[1]);
    assert_true(seen[0] > 0.5 && seen[0] < 1.05);
    assert_true(fabs(seen[0] / seen[1] - 1) < 0.05);
}

// The primitive of a pick is the number of the point.
static void test_picks_name_points(void **state)
{
    (void)state;
    struct rig rig;
    struct hg_mesh_part cloud = points_grid(5, 0.4f);
    cloud.point_diameter = 0.3f;
    open_cloud(&rig, &cloud, HG_MODE_REALTIME, 0);
    rig_settle(&rig, 16);
    for (uint32_t i = 0; i < 25; i++) {
        const float *at = rig.scene->objects[HG_OBJECT_MESH].count > 0
                              ? ((struct hg_mesh *)rig.scene->objects[HG_OBJECT_MESH].items[0])
                                        ->parts[0]
                                        .positions +
                                    (size_t)i * 3
                              : NULL;
        const uint32_t x = (uint32_t)((at[0] + 1.0f) * 0.5f * SIDE),
                       y = (uint32_t)((1.0f + at[2]) * 0.5f * SIDE);
        struct hg_pick pick;
        test_ok(hg_view_pick(rig.view, x, y, &pick, &rig.err), &rig.err);
        assert_true(pick.hit);
        assert_int_equal(pick.triangle, i);
    }
    rig_close_scene(&rig);
    rig_close(&rig);
}

#define POINTS 2000000u

static struct hg_refbuf *settle_with(uint64_t budget_bytes, uint64_t *peak_bytes)
{
    struct rig rig;
    struct hg_view_report report;
    struct hg_mesh_part cloud = points_sphere(POINTS, true);
    double mean[3];
    colors_of(&cloud, 0.25f, 0.5f, 0.25f);
    open_cloud(&rig, &cloud, HG_MODE_REALTIME, budget_bytes);
    rig_environment(rig.scene, 1, 1, 1);
    const struct hg_frame_info info = rig_settle(&rig, 16);
    hg_view_get_report(rig.view, &report);
    *peak_bytes = report.geometry.peak_bytes;
    print_message("%u points, budget %.0f MiB: peak %.1f MiB, %llu triangles drawn\n", POINTS,
        (double)budget_bytes / (double)MIB, (double)*peak_bytes / (double)MIB,
        (unsigned long long)info.triangles_drawn);
    assert_int_equal(info.missing_clusters, 0);
    assert_true(info.error_px <= 1.0f);
    // A disc of radius one in a square of two by two.
    assert_true(fabs(covered(&rig, mean) / (M_PI / 4) - 1) < 0.02);
    struct hg_refbuf *pixels = rig_pixels(&rig, HG_PIXEL_RGBA32F);
    rig_close_scene(&rig);
    rig_close(&rig);
    return pixels;
}

static void test_two_million_points_in_a_budget(void **state)
{
    (void)state;
    uint64_t peak, small;
    struct hg_refbuf *whole = settle_with(0, &peak), *pixels = settle_with(4 * MIB, &small);
    rig_assert_same(whole, pixels);
    assert_true(small < peak && small <= 5 * MIB);
    hg_refbuf_unref(whole);
    hg_refbuf_unref(pixels);
}

static int setup(void **state)
{
    (void)state;
    return test_folder_make(cache_dir, "render-points") ? 0 : -1;
}

static int teardown(void **state)
{
    (void)state;
    return test_folder_remove(cache_dir) ? 0 : -1;
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_areas_and_colours),
        cmocka_unit_test(test_planes_are_lit),
        cmocka_unit_test(test_picks_name_points),
        cmocka_unit_test(test_two_million_points_in_a_budget),
    };
    return cmocka_run_group_tests(tests, setup, teardown);
}
