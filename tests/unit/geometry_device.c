// geometry_device.c - see geometry_device.h.
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "geometry_device.h"

#include "base/alloc.h"
#include "base/log.h"
#include "renderer/passes/skin.h"
#include "tests/support/check.h"

void geo_check(struct geo *f, enum hg_status status)
{
    test_ok(status, &f->err);
}

double geo_random(struct geo *f, double low, double high)
{
    f->random = f->random * 1664525u + 1013904223u;
    return low + (high - low) * (double)(f->random >> 8) * 0x1p-24;
}

int geo_setup(void **state)
{
    struct geo *f = calloc(1, sizeof *f);
    assert_non_null(f);
    const struct hg_gpu_params params = {.validation_try = true};
    geo_check(f, hg_gpu_create(&params, &f->gpu, &f->err));
    f->random = 5;
    *state = f;
    return 0;
}

int geo_teardown(void **state)
{
    struct geo *f = *state;
    const uint32_t messages = hg_gpu_validation_messages(f->gpu);
    hg_gpu_destroy(f->gpu);
    free(f);
    return messages == 0 ? 0 : -1;
}

void geo_submit(struct geo *f, struct hg_gpu_cmd *cmd)
{
    geo_check(f, hg_gpu_submit_and_wait(f->gpu, cmd, &f->err));
}

void geo_sync(struct geo *f, struct hg_geometry *g, struct hg_scene *scene)
{
    hg_scene_publish(scene);
    hg_scene_update(scene);
    geo_check(f, hg_geometry_sync(g, scene, NULL, &f->err));
    struct hg_gpu_cmd *cmd;
    geo_check(f, hg_gpu_begin(f->gpu, &cmd, &f->err));
    geo_check(f, hg_skin_record(cmd, g, &f->err));
    geo_submit(f, cmd);
    hg_geometry_deforms_done(g);
}

// --- a mesh of random triangles ------------------------------------------------------------------

static void *copy(const void *data, size_t bytes)
{
    void *p = hg_calloc(1, bytes);
    assert_non_null(p);
    memcpy(p, data, bytes);
    return p;
}

struct hg_mesh *geo_add_mesh(struct geo *f, struct hg_scene *scene, uint64_t id)
{
    enum { N = TRIANGLES * 3 };
    float positions[N * 3], normals[N * 3], tangents[N * 4], uv[N * 2], uv1[N * 2], colors[N * 4];
    uint32_t indices[N];
    for (int i = 0; i < N; i++) {
        float n[3], length = 0.0f;
        for (int c = 0; c < 3; c++) {
            const float center = (float)geo_random(f, -1.0, 1.0);
            positions[i * 3 + c] =
                i % 3 == 0 ? 4.0f * center : positions[(i - i % 3) * 3 + c] + center;
            n[c] = center + 0.01f;
            length += n[c] * n[c];
        }
        for (int c = 0; c < 3; c++)
            normals[i * 3 + c] = n[c] / sqrtf(length);
        tangents[i * 4] = normals[i * 3 + 1];
        tangents[i * 4 + 1] = -normals[i * 3];
        tangents[i * 4 + 2] = 0.0f;
        const float t = hypotf(tangents[i * 4], tangents[i * 4 + 1]);
        for (int c = 0; c < 2; c++)
            tangents[i * 4 + c] = t > 0.0f ? tangents[i * 4 + c] / t : (float)(c == 0);
        tangents[i * 4 + 3] = 1.0f;
        for (int c = 0; c < 2; c++) {
            uv[i * 2 + c] = (float)geo_random(f, -3.0, 3.0);
            uv1[i * 2 + c] = (float)geo_random(f, 0.0, 1.0);
        }
        for (int c = 0; c < 4; c++)
            colors[i * 4 + c] = (float)geo_random(f, 0.0, 1.0);
        indices[i] = (uint32_t)(N - 1 - i);
    }
    struct hg_object *object;
    geo_check(f, hg_scene_add(scene, HG_OBJECT_MESH, id, &object));
    struct hg_mesh *mesh = (struct hg_mesh *)object;
    mesh->parts = hg_calloc(1, sizeof *mesh->parts);
    assert_non_null(mesh->parts);
    mesh->part_count = 1;
    struct hg_mesh_part *part = mesh->parts;
    part->topology = HG_TOPOLOGY_TRIANGLES;
    part->vertex_count = part->index_count = N;
    part->indices = copy(indices, sizeof indices);
    part->positions = copy(positions, sizeof positions);
    part->normals = copy(normals, sizeof normals);
    part->tangents = copy(tangents, sizeof tangents);
    part->uv[0] = copy(uv, sizeof uv);
    part->uv[1] = copy(uv1, sizeof uv1);
    part->colors = copy(colors, sizeof colors);
    return mesh;
}

struct hg_node *geo_add_node(
    struct geo *f, struct hg_scene *scene, uint64_t id, struct hg_mesh *mesh)
{
    struct hg_object *object;
    geo_check(f, hg_scene_add(scene, HG_OBJECT_NODE, id, &object));
    struct hg_node *node = (struct hg_node *)object;
    node->mesh = mesh;
    node->visible = true;
    return node;
}

// --- cameras, in double --------------------------------------------------------------------------

void geo_cross(const double a[3], const double b[3], double out[3])
{
    const double c[3] = {
        a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
    memcpy(out, c, sizeof c);
}

double geo_dot(const double a[3], const double b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

void geo_normalize(double v[3])
{
    const double length = sqrt(geo_dot(v, v));
    for (int i = 0; i < 3; i++)
        v[i] /= length;
}

struct geo_eye geo_look_at(const double position[3], const double target[3], bool orthographic)
{
    struct geo_eye e = {.focal = 1.5,
        .aspect = (double)WIDTH / HEIGHT,
        .orthographic = orthographic,
        .half_height = 5.0};
    for (int i = 0; i < 3; i++) {
        e.position[i] = position[i];
        e.back[i] = position[i] - target[i];
    }
    const double up[3] = {0.1, 1.0, 0.2};
    geo_normalize(e.back);
    geo_cross(up, e.back, e.right);
    geo_normalize(e.right);
    geo_cross(e.back, e.right, e.up);
    return e;
}

// Rays through pixels, as shaders/shared/frame.h says.
static void fill_rays(const struct geo_eye *e, const double eye[3], struct hg_gpu_camera *camera)
{
    const double half = e->orthographic ? e->half_height : 1.0 / e->focal;
    float *origin = &camera->ray_origin_ws.x, *x = &camera->ray_x_ws.x, *y = &camera->ray_y_ws.x;
    for (int i = 0; i < 3; i++) {
        const double middle = e->orthographic ? eye[i] : -e->back[i];
        origin[i] = (float)(middle - e->right[i] * half * e->aspect + e->up[i] * half);
        x[i] = (float)(e->right[i] * half * e->aspect * 2.0 / WIDTH);
        y[i] = (float)(-e->up[i] * half * 2.0 / HEIGHT);
    }
}

void geo_fill_camera(const struct geo_eye *e, const double origin[3], struct hg_gpu_camera *camera)
{
    double view[16] = {0}, proj[16] = {0}, vp[16], eye[3];
    for (int i = 0; i < 3; i++)
        eye[i] = e->position[i] - origin[i];
    for (int c = 0; c < 3; c++) {
        view[c * 4] = e->right[c];
        view[c * 4 + 1] = e->up[c];
        view[c * 4 + 2] = e->back[c];
    }
    view[12] = -geo_dot(e->right, eye);
    view[13] = -geo_dot(e->up, eye);
    view[14] = -geo_dot(e->back, eye);
    view[15] = 1.0;
    if (e->orthographic) {
        proj[0] = 1.0 / (e->half_height * e->aspect);
        proj[5] = -1.0 / e->half_height;
        proj[10] = 0.001;
        proj[14] = 0.5;
        proj[15] = 1.0;
    } else {
        proj[0] = e->focal / e->aspect;
        proj[5] = -e->focal;
        proj[11] = -1.0;
        proj[14] = 0.01;
    }
    hg_matrix_multiply(proj, view, vp);
    for (int i = 0; i < 16; i++) {
        camera->proj.m[i] = (float)proj[i];
        camera->view_proj.m[i] = (float)vp[i];
    }
    fill_rays(e, eye, camera);
    camera->orthographic = e->orthographic;
    camera->eye_ws = (struct hg_vec3){(float)eye[0], (float)eye[1], (float)eye[2]};
    camera->forward_ws =
        (struct hg_vec3){(float)-e->back[0], (float)-e->back[1], (float)-e->back[2]};
}

bool geo_project(const struct geo_eye *e, const double p[3], double pixel[2])
{
    double d[3];
    for (int i = 0; i < 3; i++)
        d[i] = p[i] - e->position[i];
    const double depth = -geo_dot(e->back, d);
    if (depth < 0.05)
        return false;
    const double w = e->orthographic ? e->half_height : depth / e->focal;
    pixel[0] = (geo_dot(e->right, d) / (w * e->aspect) + 1.0) * 0.5 * WIDTH;
    pixel[1] = (1.0 - geo_dot(e->up, d) / w) * 0.5 * HEIGHT;
    return pixel[0] > 0 && pixel[0] < WIDTH && pixel[1] > 0 && pixel[1] < HEIGHT;
}

// --- scenes --------------------------------------------------------------------------------------

void geo_corners(const struct hg_node *node, uint32_t triangle, double p[3][3], uint32_t i[3])
{
    const struct hg_mesh_part *part = node->mesh->parts;
    double m[16];
    hg_matrix_from_float(node->world, m);
    for (int k = 0; k < 3; k++) {
        i[k] = part->indices[triangle * 3 + (uint32_t)k];
        const float *v = part->positions + i[k] * 3;
        for (int r = 0; r < 3; r++)
            p[k][r] = m[r] * v[0] + m[4 + r] * v[1] + m[8 + r] * v[2] + m[12 + r];
    }
}

struct geo_scene geo_make_scene(struct geo *f)
{
    struct geo_scene s;
    geo_check(f, hg_scene_create(&s.scene));
    geo_check(f, hg_geometry_create(f->gpu, NULL, &s.geometry, &f->err));
    s.mesh = geo_add_mesh(f, s.scene, 1);
    s.nodes[0] = geo_add_node(f, s.scene, 1, s.mesh);
    s.nodes[1] = geo_add_node(f, s.scene, 2, s.mesh);
    const float turn[4] = {0.1826f, 0.3651f, 0.5477f, 0.7303f};
    memcpy(s.nodes[0]->rotation, turn, sizeof turn);
    s.nodes[0]->scale[0] = 1.5f;
    s.nodes[0]->scale[1] = 0.5f;
    s.nodes[1]->translation[0] = 2.0f;
    s.nodes[1]->scale[2] = -1.25f;
    return s;
}

void geo_destroy_scene(struct geo_scene *s)
{
    hg_geometry_destroy(s->geometry);
    hg_scene_destroy(s->scene);
}
