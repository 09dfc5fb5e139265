// render_levels_rig.c - see render_levels_rig.h.
#include "tests/unit/render_levels_rig.h"

#include "base/alloc.h"
#include "renderer/internal.h"

char levels_cache_dir[TEST_FOLDER_MAX];
const char *levels_model;
bool levels_without_sun;

static struct hg_mesh *load_statue(struct hg_scene *scene, struct hg_jobs *jobs)
{
    struct hg_error err = {0};
    struct hg_asset *asset;
    const struct hg_load_params params = {
        .path = levels_model != NULL ? levels_model : TEST_MODELS "/statue.ply.gz",
        .asset_number = 1,
        .scene_index = -1,
        .jobs = jobs};
    test_ok(hg_load_asset(&params, &asset, &err), &err);
    struct hg_mesh *mesh = asset->meshes[0];
    for (uint32_t i = 0; i < asset->node_count; i++)
        asset->nodes[i]->visible = false;
    assert_int_equal(hg_scene_add_asset(scene, asset, NULL), HG_OK);
    return mesh;
}

// A plate of 1 m in the plane y = 0.
static struct hg_mesh *add_plate(struct hg_scene *scene)
{
    static const uint32_t indices[6] = {0, 1, 2, 0, 2, 3};
    static const float normals[12] = {0, 1, 0, 0, 1, 0, 0, 1, 0, 0, 1, 0};
    static const float positions[12] = {-1, 0, 1, 1, 0, 1, 1, 0, -1, -1, 0, -1};
    struct hg_mesh *mesh = rig_add(scene, HG_OBJECT_MESH, 1);
    rig_part(mesh, 4, positions, normals, 6, indices);
    return mesh;
}

static struct hg_scene *make_scene(struct hg_jobs *jobs)
{
    struct hg_scene *scene;
    assert_int_equal(hg_scene_create(&scene), HG_OK);
    struct hg_mesh *statue = load_statue(scene, jobs), *plate = add_plate(scene);
    struct hg_node *node = rig_add(scene, HG_OBJECT_NODE, 1);
    node->mesh = plate;
    node = rig_add(scene, HG_OBJECT_NODE, 2);
    node->mesh = statue;
    node->instance_count = 3;
    node->instances = hg_calloc(3, sizeof *node->instances);
    assert_non_null(node->instances);
    for (int i = 0; i < 3; i++) {
        float *m = node->instances[i];
        m[0] = m[5] = m[10] = m[15] = 1.0f;
        m[12] = i == 0 ? 0.0f : i == 1 ? -0.15f : 0.12f;
        m[13] = levels_model != NULL ? -0.053f : 0.098f;
        m[14] = i == 0 ? 0.0f : -0.2f * (float)i;
    }
    if (!levels_without_sun)
        rig_sun(scene, 3, -0.5f, 0.8660254f);
    rig_environment(scene, 0.5f, 0.5f, 0.5f);
    hg_scene_publish(scene);
    return scene;
}

void levels_open(struct rig *rig, uint64_t budget_bytes)
{
    const struct hg_renderer_params params = {
        .geometry_budget_bytes = budget_bytes, .cache_dir = levels_cache_dir, .threads = 2};
    const struct hg_view_params view = {.width = LEVELS_VIEW_PX,
        .height = LEVELS_VIEW_PX,
        .samples = LEVELS_SAMPLES,
        .seed = 5,
        .error_px = LEVELS_ERROR_PX};
    *rig = (struct rig){0};
    test_ok(hg_renderer_create(&params, &rig->renderer, &rig->err), &rig->err);
    rig->scene = make_scene(hg_renderer_jobs(rig->renderer));
    rig_view(rig, &view);
}

void levels_look(struct rig *rig, float x, float distance)
{
    const struct hg_view_camera camera = {
        .eye = {x, 0.15f + 0.3f * distance, distance}, .target = {x, 0.05f, 0}};
    test_ok(hg_view_set_camera(rig->view, &camera, &rig->err), &rig->err);
}

void levels_open_whole(struct rig *rig)
{
    levels_open(rig, 0);
    hg_view_destroy(rig->view);
    rig->renderer->context.bake_from = HG_GEOMETRY_BAKE_NONE;
    test_ok(hg_view_create(rig->renderer, rig->scene, &rig->view, &rig->err), &rig->err);
}
