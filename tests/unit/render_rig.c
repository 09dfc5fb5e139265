#include "tests/unit/render_rig.h"

#include "base/alloc.h"
#include "renderer/internal.h"

// --- the renderer and its view -------------------------------------------------------------------

void rig_close(struct rig *rig)
{
    hg_view_destroy(rig->view);
    hg_scene_destroy(rig->scene);
    assert_int_equal(hg_renderer_validation_messages(rig->renderer), 0);
    hg_renderer_destroy(rig->renderer);
}

void rig_view(struct rig *rig, const struct hg_view_params *params)
{
    test_ok(hg_view_create(rig->renderer, rig->scene, &rig->view, &rig->err), &rig->err);
    test_ok(hg_view_set_params(rig->view, params, &rig->err), &rig->err);
}

struct hg_frame_info rig_step(struct rig *rig, uint32_t samples)
{
    struct hg_frame_info info;
    test_ok(hg_view_step(rig->view, samples, &info, &rig->err), &rig->err);
    return info;
}

struct hg_frame_info rig_settle(struct rig *rig, uint32_t samples)
{
    struct hg_frame_info info = {0};
    for (int i = 0; i < 4000 && !info.settled; i++)
        info = rig_step(rig, samples);
    assert_true(info.settled);
    return info;
}

struct hg_refbuf *rig_pixels(struct rig *rig, enum hg_pixel_format format)
{
    struct hg_refbuf *out;
    test_ok(hg_view_read_pixels(rig->view, format, &out, &rig->err), &rig->err);
    return out;
}

void rig_assert_same(const struct hg_refbuf *a, const struct hg_refbuf *b)
{
    size_t different = 0;
    assert_int_equal(a->size, b->size);
    for (size_t i = 0; i < a->size; i += 16)
        different += memcmp(a->data + i, b->data + i, 16) != 0;
    if (different > 0)
        fail_msg("%zu pixels differ", different);
}

// --- scenes --------------------------------------------------------------------------------------

double rig_difference(const struct hg_refbuf *a, const struct hg_refbuf *b)
{
    const float *p = (const float *)(const void *)a->data,
                *q = (const float *)(const void *)b->data;
    double sum = 0.0;
    for (size_t i = 0; i < a->size / 4; i++)
        sum += (double)fabsf(q[i] - p[i]);
    return sum / (double)(a->size / 4);
}

void *rig_add(struct hg_scene *scene, enum hg_object_kind kind, uint64_t id)
{
    struct hg_object *object;
    assert_int_equal(hg_scene_add(scene, kind, id, &object), HG_OK);
    return object;
}

void *rig_copy(const void *data, size_t size)
{
    void *copy = hg_calloc(1, size);
    assert_non_null(copy);
    memcpy(copy, data, size);
    return copy;
}

struct hg_mesh_part *rig_part(struct hg_mesh *mesh, uint32_t vertices, const float *positions,
    const float *normals, uint32_t indices, const uint32_t *index)
{
    struct hg_mesh_part *part = hg_calloc(1, sizeof *part);
    assert_non_null(part);
    mesh->parts = part;
    mesh->part_count = 1;
    part->topology = HG_TOPOLOGY_TRIANGLES;
    part->vertex_count = vertices;
    part->index_count = indices;
    part->indices = rig_copy(index, indices * sizeof *index);
    part->positions = rig_copy(positions, (size_t)vertices * 3 * sizeof *positions);
    part->normals = rig_copy(normals, (size_t)vertices * 3 * sizeof *normals);
    for (int k = 0; k < 3; k++) {
        part->bounds_min[k] = part->bounds_max[k] = positions[k];
        for (uint32_t i = 1; i < vertices; i++) {
            part->bounds_min[k] = fminf(part->bounds_min[k], positions[i * 3 + (uint32_t)k]);
            part->bounds_max[k] = fmaxf(part->bounds_max[k], positions[i * 3 + (uint32_t)k]);
        }
    }
    return part;
}

void rig_sun(struct hg_scene *scene, uint64_t id, float sin_half, float cos_half)
{
    struct hg_light *light = rig_add(scene, HG_OBJECT_LIGHT, id);
    light->intensity = 2;
    light->color[0] = light->color[1] = light->color[2] = 1;
    light->casts_shadow = true;
    struct hg_node *node = rig_add(scene, HG_OBJECT_NODE, id);
    node->light = light;
    node->rotation[0] = sin_half;
    node->rotation[3] = cos_half;
}

void rig_environment(struct hg_scene *scene, float red, float green, float blue)
{
    scene->environment.kind = HG_ENV_COLOR;
    scene->environment.intensity = 1;
    scene->environment.color[0] = red;
    scene->environment.color[1] = green;
    scene->environment.color[2] = blue;
    scene->environment.revision++;
}

struct hg_scene *rig_new_scene(void)
{
    struct hg_scene *scene;
    assert_int_equal(hg_scene_create(&scene), HG_OK);
    return scene;
}

// A quad about the origin of the xy plane, looking along +z, unlit.
struct hg_node *rig_quad(
    struct hg_scene *scene, uint64_t id, float half, float z, const float color[4])
{
    static const uint32_t indices[6] = {0, 1, 2, 0, 2, 3};
    static const float normals[12] = {0, 0, 1, 0, 0, 1, 0, 0, 1, 0, 0, 1};
    const float positions[12] = {-half, -half, 0, half, -half, 0, half, half, 0, -half, half, 0};
    struct hg_material *material = rig_add(scene, HG_OBJECT_MATERIAL, id);
    memcpy(material->base_color, color, sizeof material->base_color);
    material->unlit = true;
    material->alpha_mode = color[3] < 1 ? HG_ALPHA_BLEND : HG_ALPHA_OPAQUE;
    struct hg_mesh *mesh = rig_add(scene, HG_OBJECT_MESH, id);
    rig_part(mesh, 4, positions, normals, 6, indices)->material = material;
    struct hg_node *node = rig_add(scene, HG_OBJECT_NODE, id);
    node->mesh = mesh;
    node->translation[2] = z;
    return node;
}

struct hg_scene *rig_load(const char *path, struct hg_jobs *jobs)
{
    struct hg_error err = {0};
    struct hg_asset *asset;
    const struct hg_load_params params = {
        .path = path, .asset_number = 1, .scene_index = -1, .jobs = jobs};
    test_ok(hg_load_asset(&params, &asset, &err), &err);
    struct hg_scene *scene = rig_new_scene();
    assert_int_equal(hg_scene_add_asset(scene, asset, NULL), HG_OK);
    rig_environment(scene, 0.7f, 0.7f, 0.7f);
    rig_sun(scene, 7, -0.5f, 0.8660254f);
    hg_scene_publish(scene);
    return scene;
}

void rig_open_with(struct rig *rig, const struct hg_renderer_params *params)
{
    *rig = (struct rig){0};
    test_ok(hg_renderer_create(params, &rig->renderer, &rig->err), &rig->err);
}

void rig_open(struct rig *rig, bool validation)
{
    rig_open_with(rig, &(struct hg_renderer_params){.validation = validation, .threads = 2});
}

void rig_look_at_scene(struct rig *rig, float turn)
{
    float min[3], max[3], radius = 0;
    struct hg_view_camera camera = {0};
    hg_scene_update(rig->scene);
    assert_true(hg_scene_bounds(rig->scene, NULL, min, max));
    for (int i = 0; i < 3; i++) {
        camera.target[i] = 0.5f * (min[i] + max[i]);
        radius += (max[i] - min[i]) * (max[i] - min[i]);
    }
    radius = 0.9f * sqrtf(radius);
    camera.eye[0] = camera.target[0] + radius * sinf(turn);
    camera.eye[1] = camera.target[1] + 0.3f * radius;
    camera.eye[2] = camera.target[2] + radius * cosf(turn);
    test_ok(hg_view_set_camera(rig->view, &camera, &rig->err), &rig->err);
}

void rig_use_scene(struct rig *rig, struct hg_scene *scene, const struct hg_view_params *params)
{
    rig->scene = scene;
    rig_view(rig, params);
}

void rig_close_scene(struct rig *rig)
{
    hg_view_destroy(rig->view);
    hg_scene_destroy(rig->scene);
    rig->view = NULL;
    rig->scene = NULL;
}

struct hg_view_report rig_report(const struct rig *rig)
{
    struct hg_view_report report;
    hg_view_get_report(rig->view, &report);
    return report;
}
