#include "tests/analytic/rig.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/alloc.h"
#include "renderer/internal.h"

void rig_init(struct rig *rig)
{
    struct hg_error err = {0};
    struct hg_renderer_params params = {0};
    *rig = (struct rig){0};
    test_ok(hg_renderer_create(&params, &rig->renderer, &err), &err);
}

void rig_finish(struct rig *rig)
{
    hg_scene_destroy(rig->scene);
    hg_renderer_destroy(rig->renderer);
}

int rig_set_up(void **state)
{
    static struct rig rig;
    rig_init(&rig);
    *state = &rig;
    return 0;
}

int rig_tear_down(void **state)
{
    rig_finish(*state);
    return 0;
}

void rig_scene(struct rig *rig)
{
    struct hg_error err = {0};
    hg_scene_destroy(rig->scene);
    test_ok(hg_scene_create(&rig->scene), &err);
    rig->next_id = 1;
}

void *rig_object(struct rig *rig, enum hg_object_kind kind)
{
    struct hg_object *object;
    struct hg_error err = {0};
    test_ok(hg_scene_add(rig->scene, kind, rig->next_id++, &object), &err);
    return object;
}

struct hg_material *rig_material(struct rig *rig)
{
    struct hg_material *material = rig_object(rig, HG_OBJECT_MATERIAL);
    material->metallic = 0;
    material->roughness = 1;
    return material;
}

static void *copy(const void *data, size_t bytes)
{
    void *out = hg_calloc(1, bytes);
    assert_non_null(out);
    return memcpy(out, data, bytes);
}

struct hg_node *rig_mesh(struct rig *rig, struct hg_material *material,
    const struct rig_vertices *vertices, uint32_t indices, const uint32_t *index)
{
    const float *positions = vertices->positions;
    struct hg_mesh *mesh = rig_object(rig, HG_OBJECT_MESH);
    struct hg_node *node = rig_object(rig, HG_OBJECT_NODE);
    struct hg_mesh_part *part = hg_calloc(1, sizeof *part);
    assert_non_null(part);
    mesh->parts = part;
    mesh->part_count = 1;
    part->topology = HG_TOPOLOGY_TRIANGLES;
    part->vertex_count = vertices->count;
    part->index_count = indices;
    part->material = material;
    part->indices = copy(index, indices * sizeof *index);
    part->positions = copy(positions, vertices->count * 3 * sizeof(float));
    part->normals = copy(vertices->normals, vertices->count * 3 * sizeof(float));
    for (int a = 0; a < 3; a++) {
        part->bounds_min[a] = part->bounds_max[a] = positions[a];
        for (uint32_t v = 1; v < vertices->count; v++) {
            part->bounds_min[a] = fminf(part->bounds_min[a], positions[v * 3 + a]);
            part->bounds_max[a] = fmaxf(part->bounds_max[a], positions[v * 3 + a]);
        }
    }
    node->mesh = mesh;
    return node;
}

struct hg_node *rig_quad(struct rig *rig, struct hg_material *material, const float corners[4][3])
{
    static const uint32_t index[6] = {0, 1, 2, 0, 2, 3};
    static const float uv[8] = {0, 0, 1, 0, 1, 1, 0, 1};
    float normals[12], n[3], a[3], b[3];
    for (int i = 0; i < 3; i++) {
        a[i] = corners[1][i] - corners[0][i];
        b[i] = corners[2][i] - corners[0][i];
    }
    for (int i = 0; i < 3; i++)
        n[i] = a[(i + 1) % 3] * b[(i + 2) % 3] - a[(i + 2) % 3] * b[(i + 1) % 3];
    float l = sqrtf(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
    for (int i = 0; i < 12; i++)
        normals[i] = n[i % 3] / l;
    const struct rig_vertices vertices = {4, &corners[0][0], normals};
    struct hg_node *node = rig_mesh(rig, material, &vertices, 6, index);
    node->mesh->parts[0].uv[0] = copy(uv, sizeof uv);
    return node;
}

struct hg_texture *rig_bars(struct rig *rig)
{
    enum { BARS_SIDE = 256 }; // finer than what rays see of it
    struct hg_texture *t = rig_object(rig, HG_OBJECT_TEXTURE);
    t->image = hg_calloc(1, sizeof *t->image);
    assert_non_null(t->image);
    t->image->refs = 1;
    t->image->label = hg_strdup("bars");
    t->image->pixels_srgb = true;
    test_ok(hg_image_create(BARS_SIDE, BARS_SIDE, HG_PIXEL_RGBA8, NULL, &t->image->pixels), NULL);
    uint8_t *texels = t->image->pixels.pixels;
    memset(texels, 255, 4 * BARS_SIDE * BARS_SIDE);
    for (int i = 0; i < BARS_SIDE * BARS_SIDE; i++)
        texels[4 * i + 3] = i % BARS_SIDE * 8 / BARS_SIDE % 2 ? 255 : 0;
    return t;
}

struct hg_node *rig_plane(struct rig *rig, struct hg_material *material)
{
    static const float corners[4][3] = {{-9, 0, 9}, {9, 0, 9}, {9, 0, -9}, {-9, 0, -9}};
    return rig_quad(rig, material, corners);
}

struct hg_node *rig_face(
    struct rig *rig, struct hg_material *material, const float box[2][3], int side, int which)
{
    const int axis = which / 2, high = which % 2, u = (axis + 1) % 3, v = (axis + 2) % 3;
    float corners[4][3];
    for (int i = 0; i < 4; i++) {
        const int turn = (high == 1) == (side > 0) ? 3 - i : i; // counter-clockwise from the front
        corners[i][axis] = box[high][axis];
        corners[i][u] = box[turn == 1 || turn == 2][u];
        corners[i][v] = box[turn >= 2][v];
    }
    return rig_quad(rig, material, (const float(*)[3])corners);
}

struct hg_node *rig_sphere(
    struct rig *rig, struct hg_material *material, const float center[3], float radius, int rings)
{
    const uint32_t rows = (uint32_t)rings, columns = 2 * rows;
    const uint32_t vertices = (rows + 1) * (columns + 1), indices = rows * columns * 6;
    float *positions = hg_calloc(vertices, 3 * sizeof(float));
    float *normals = hg_calloc(vertices, 3 * sizeof(float));
    uint32_t *index = hg_calloc(indices, sizeof *index), used = 0;
    assert_true(positions && normals && index);
    for (uint32_t v = 0; v < vertices; v++) {
        double theta = M_PI * (v / (columns + 1)) / rows;
        double phi = 2 * M_PI * (v % (columns + 1)) / columns;
        double n[3] = {sin(theta) * cos(phi), cos(theta), -sin(theta) * sin(phi)};
        for (int a = 0; a < 3; a++) {
            normals[v * 3 + a] = (float)n[a];
            positions[v * 3 + a] = (float)((double)center[a] + n[a] * (double)radius);
        }
    }
    for (uint32_t y = 0; y < rows; y++)
        for (uint32_t x = 0; x < columns; x++) {
            uint32_t a = y * (columns + 1) + x, b = a + columns + 1;
            const uint32_t quad[6] = {a, b, a + 1, a + 1, b, b + 1};
            memcpy(index + used, quad, sizeof quad);
            used += 6;
        }
    const struct rig_vertices all = {vertices, positions, normals};
    struct hg_node *node = rig_mesh(rig, material, &all, indices, index);
    hg_free(positions);
    hg_free(normals);
    hg_free(index);
    return node;
}

// Turns -z into a direction.
static void aim(struct hg_node *node, const double direction[3])
{
    const double *v = direction, l = sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
    double d[3] = {v[0] / l, v[1] / l, v[2] / l};
    double q[4] = {d[1], -d[0], 0, 1 - d[2]}; // half way: cross((0, 0, -1), d), 1 + dot
    double n = sqrt(q[0] * q[0] + q[1] * q[1] + q[3] * q[3]);
    for (int i = 0; i < 4 && n > 1e-9; i++)
        node->rotation[i] = (float)(q[i] / n);
    if (n <= 1e-9) { // straight back: half a turn about y
        const float turn[4] = {0, 1, 0, 0};
        memcpy(node->rotation, turn, sizeof turn);
    }
}

struct hg_light *rig_light(
    struct rig *rig, unsigned kind, const double at[3], const double direction[3])
{
    struct hg_light *light = rig_object(rig, HG_OBJECT_LIGHT);
    struct hg_node *node = rig_object(rig, HG_OBJECT_NODE);
    light->kind = kind;
    light->intensity = 1;
    light->casts_shadow = false;
    light->inner_cone_rad = 0.3f;
    light->outer_cone_rad = 0.6f;
    node->light = light;
    for (int a = 0; a < 3; a++) {
        light->color[a] = 1;
        node->translation[a] = (float)at[a];
    }
    aim(node, direction);
    return light;
}

struct hg_node *rig_node_of(struct rig *rig, const struct hg_light *light)
{
    const struct hg_object_list *nodes = &rig->scene->objects[HG_OBJECT_NODE];
    for (uint32_t i = 0; i < nodes->count; i++)
        if (((struct hg_node *)nodes->items[i])->light == light)
            return (struct hg_node *)nodes->items[i];
    fail_msg("no node has the light");
    return NULL;
}

static bool looks_down(const struct rig_camera *c)
{
    return fabs(c->eye[0] - c->target[0]) + fabs(c->eye[2] - c->target[2]) < 1e-9;
}

struct hg_refbuf *rig_render(struct rig *rig, const struct rig_camera *c)
{
    struct hg_error err = {0};
    struct hg_view *view;
    struct hg_frame_info info = {0};
    struct hg_refbuf *pixels;
    const struct hg_view_params params = {.width = c->width,
        .gi = c->gi,
        .height = c->height,
        .tonemap = HG_TONEMAP_LINEAR,
        .background = HG_BACKGROUND_NONE,
        .samples = c->samples,
        .seed = c->seed,
        .mode = c->mode,
        .trace = rig_trace(rig, HG_VIEW_TRACE_AUTO),
        .max_bounces = c->max_bounces,
        .filter = HG_FILTER_BOX};
    struct hg_view_camera camera = {.vfov_rad = (float)c->vfov_rad};
    for (int a = 0; a < 3; a++) {
        camera.eye[a] = (float)c->eye[a];
        camera.target[a] = (float)c->target[a];
    }
    if (looks_down(c))
        camera.up[2] = -1;
    hg_scene_publish(rig->scene);
    test_ok(hg_view_create(rig->renderer, rig->scene, &view, &err), &err);
    test_ok(hg_view_set_params(view, &params, &err), &err);
    test_ok(hg_view_set_camera(view, &camera, &err), &err);
    for (int i = 0; i < 40000 && !info.settled; i++)
        test_ok(hg_view_step(view, 8, &info, &err), &err);
    assert_true(info.settled);
    test_ok(hg_view_read_pixels(view, HG_PIXEL_RGBA32F, &pixels, &err), &err);
    hg_view_destroy(view);
    return pixels;
}

enum hg_view_trace rig_trace(const struct rig *rig, enum hg_view_trace asked)
{
    const char *where = getenv("RIG_TRACE");
    if (asked != HG_VIEW_TRACE_AUTO || where == NULL)
        return asked;
    assert_string_equal(where, "device");
    return hg_gpu_get_caps(rig->renderer->context.gpu)->ray_query ? HG_VIEW_TRACE_KHR
                                                                  : HG_VIEW_TRACE_COMPUTE;
}

static void unit(double v[3])
{
    double l = sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
    for (int i = 0; i < 3; i++)
        v[i] /= l;
}

static void cross(const double a[3], const double b[3], double out[3])
{
    for (int i = 0; i < 3; i++)
        out[i] = a[(i + 1) % 3] * b[(i + 2) % 3] - a[(i + 2) % 3] * b[(i + 1) % 3];
}

void rig_ray(const struct rig_camera *c, double x, double y, double direction[3])
{
    double f[3], r[3], u[3], up[3] = {0, looks_down(c) ? 0 : 1, looks_down(c) ? -1 : 0};
    for (int i = 0; i < 3; i++)
        f[i] = c->target[i] - c->eye[i];
    unit(f);
    cross(f, up, r);
    unit(r);
    cross(r, f, u);
    double k = tan(c->vfov_rad / 2), aspect = (double)c->width / c->height;
    double sx = (2 * x / c->width - 1) * k * aspect, sy = (1 - 2 * y / c->height) * k;
    for (int i = 0; i < 3; i++)
        direction[i] = f[i] + r[i] * sx + u[i] * sy;
    unit(direction);
}
