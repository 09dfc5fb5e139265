// path_rig.c - views and scenes of the tests of path-traced pictures.
#include "tests/analytic/path_rig.h"

#include <math.h>
#include <string.h>

#include "base/alloc.h"
#include "renderer/internal.h"

void path_rig_set_camera(struct hg_view *view, const struct hg_view_camera *camera)
{
    struct hg_error err = {0};
    test_ok(hg_view_set_camera(view, camera, &err), &err);
}

void path_rig_look(struct hg_view *view, const float eye[3], const float target[3], float vfov_rad)
{
    struct hg_view_camera camera = {.vfov_rad = vfov_rad};
    memcpy(camera.eye, eye, sizeof camera.eye);
    memcpy(camera.target, target, sizeof camera.target);
    camera.up[fabsf(eye[1] - target[1]) > 10.0f * fabsf(eye[2] - target[2]) ? 2 : 1] = 1.0f;
    path_rig_set_camera(view, &camera);
}

struct hg_view *path_rig_view(struct rig *rig, const struct hg_view_params *params)
{
    struct hg_error err = {0};
    struct hg_view *view;
    hg_scene_publish(rig->scene);
    test_ok(hg_view_create(rig->renderer, rig->scene, &view, &err), &err);
    struct hg_view_params p = *params;
    p.trace = rig_trace(rig, p.trace);
    test_ok(hg_view_set_params(view, &p, &err), &err);
    hg_view_set_final(view, true);
    return view;
}

struct hg_view_report path_rig_report(const struct hg_view *view)
{
    struct hg_view_report report;
    hg_view_get_report(view, &report);
    return report;
}

static bool take_steps(struct hg_view *view, int steps)
{
    struct hg_error err = {0};
    struct hg_frame_info info = {0};
    for (int i = 0; i < steps && !info.settled; i++)
        test_ok(hg_view_step(view, 8, &info, &err), &err);
    return info.settled;
}

void path_rig_settle(struct hg_view *view)
{
    assert_true(take_steps(view, 100000));
}

void path_rig_steps(struct hg_view *view, int steps)
{
    (void)take_steps(view, steps);
}

struct hg_refbuf *path_rig_plane(struct hg_view *view, enum hg_plane plane)
{
    struct hg_error err = {0};
    struct hg_refbuf *out;
    test_ok(hg_view_read_plane(view, plane, &out, &err), &err);
    return out;
}

static float linear(uint8_t v)
{
    const float c = (float)v / 255.0f;
    return c <= 0.04045f ? c / 12.92f : powf((c + 0.055f) / 1.055f, 2.4f);
}

void path_rig_cells(struct hg_view *view, int width, int height, int cell, float *cells)
{
    const int across = width / cell;
    struct hg_error err = {0};
    struct hg_refbuf *pixels;
    test_ok(hg_view_read_pixels(view, HG_PIXEL_RGBA8, &pixels, &err), &err);
    assert_int_equal(pixels->size, 4 * width * height);
    memset(cells, 0, (size_t)(across * (height / cell)) * sizeof *cells);
    for (int i = 0; i < width * height; i++)
        cells[i / width / cell * across + i % width / cell] +=
            linear(pixels->data[4 * i + 1]) / (float)(cell * cell);
    hg_refbuf_unref(pixels);
}

void path_rig_environment(struct rig *rig, float radiance)
{
    struct hg_environment *e = &rig->scene->environment;
    e->kind = HG_ENV_COLOR;
    e->intensity = 1.0f;
    e->color[0] = e->color[1] = e->color[2] = radiance;
    e->revision++;
}

struct hg_material *path_rig_lambert(struct rig *rig, float albedo)
{
    struct hg_material *m = rig_material(rig);
    m->specular.factor = 0.0f;
    m->specular.is_set = true;
    for (int i = 0; i < 3; i++)
        m->base_color[i] = albedo;
    return m;
}

void path_rig_floor(struct rig *rig, struct hg_material *m, float half)
{
    const float corners[4][3] = {
        {-half, 0, half}, {half, 0, half}, {half, 0, -half}, {-half, 0, -half}};
    rig_quad(rig, m, corners);
}

void path_rig_box(struct rig *rig, struct hg_material *m, const float low[3], const float high[3])
{
    static const uint32_t quad[6] = {0, 1, 2, 0, 2, 3};
    float positions[72], normals[72];
    uint32_t index[36];
    for (int face = 0; face < 6; face++) {
        const int axis = face / 2, u = (axis + 1) % 3, v = (axis + 2) % 3, side = face % 2;
        for (int k = 0; k < 4; k++) {
            float *p = positions + (face * 4 + k) * 3, *n = normals + (face * 4 + k) * 3;
            const bool a = k == 1 || k == 2, b = k >= 2; // corners around the face
            n[0] = n[1] = n[2] = 0.0f;
            n[axis] = side ? 1.0f : -1.0f;
            p[axis] = side ? high[axis] : low[axis];
            p[u] = (side ? a : b) ? high[u] : low[u];
            p[v] = (side ? b : a) ? high[v] : low[v];
        }
        for (int k = 0; k < 6; k++)
            index[face * 6 + k] = (uint32_t)face * 4 + quad[k];
    }
    rig_mesh(rig, m, &(struct rig_vertices){24, positions, normals}, 36, index);
}

void path_rig_room(struct rig *rig)
{
    const float lamp[4][3] = {
        {-0.4f, 1.5f, -0.4f}, {0.4f, 1.5f, -0.4f}, {0.4f, 1.5f, 0.4f}, {-0.4f, 1.5f, 0.4f}};
    const float wall[4][3] = {{-2, 0, -1}, {2, 0, -1}, {2, 2, -1}, {-2, 2, -1}};
    const float center[3] = {0.2f, 0.4f, 0};
    rig_scene(rig);
    path_rig_environment(rig, 0.2f);
    path_rig_floor(rig, path_rig_lambert(rig, 0.6f), 3);
    struct hg_material *shiny = rig_material(rig);
    shiny->roughness = 0.4f;
    shiny->metallic = 1.0f;
    rig_quad(rig, shiny, wall);
    rig_sphere(rig, rig_material(rig), center, 0.4f, 48);
    struct hg_material *light = path_rig_lambert(rig, 0.0f);
    light->emissive[0] = light->emissive[1] = light->emissive[2] = 4.0f;
    light->double_sided = true;
    rig_quad(rig, light, lamp);
}

struct hg_asset *path_rig_asset(struct rig *rig)
{
    struct hg_asset *asset = hg_scene_find_asset(rig->scene, 7);
    if (asset != NULL)
        return asset;
    asset = hg_calloc(1, sizeof *asset);
    assert_non_null(asset);
    asset->number = 7;
    asset->animations = hg_calloc(1, sizeof *asset->animations);
    assert_non_null(asset->animations);
    asset->animation_count = 1;
    assert_int_equal(hg_scene_add_asset(rig->scene, asset, NULL), HG_OK);
    return asset;
}

void path_rig_animate(struct rig *rig, struct hg_node *node, enum hg_anim_path path, uint32_t keys,
    const float *values)
{
    struct hg_animation *a = &path_rig_asset(rig)->animations[0];
    const uint32_t width = path == HG_ANIM_ROTATION  ? 4
                           : path == HG_ANIM_WEIGHTS ? node->mesh->target_count
                                                     : 3;
    struct hg_anim_channel *more =
        hg_realloc(a->channels, a->channel_count + 1, sizeof *a->channels);
    assert_non_null(more);
    a->channels = more;
    struct hg_anim_channel *c = &a->channels[a->channel_count++];
    *c = (struct hg_anim_channel){.node = node,
        .path = path,
        .interpolation = HG_ANIM_LINEAR,
        .key_count = keys,
        .width = width,
        .times = hg_calloc(keys, sizeof(float)),
        .values = hg_calloc((size_t)keys * width, sizeof(float))};
    assert_true(c->times != NULL && c->values != NULL);
    for (uint32_t i = 0; i < keys; i++)
        c->times[i] = (float)i;
    memcpy(c->values, values, (size_t)keys * width * sizeof(float));
}

void path_rig_pose(struct rig *rig, double time_s)
{
    assert_int_equal(hg_asset_pose(path_rig_asset(rig), -1, time_s), HG_OK);
}
