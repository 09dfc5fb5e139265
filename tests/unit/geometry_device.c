// geometry_device.c - geometry on the device: surface points and derivatives against double
// precision, poses against a reference on the CPU, what is uploaded when, budgets, culling.
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "base/alloc.h"
#include "base/log.h"
#include "renderer/geometry/internal.h"
#include "renderer/geometry/visible.h"
#include "renderer/passes/facet.h"
#include "renderer/passes/skin.h"
#include "renderer/scene/load.h"
#include "shaders/shared/features.h"
#include "shaders/shared/frame.h"

#define TRIANGLES 40
#define QUERIES   4096
#define WIDTH     640
#define HEIGHT    360

struct query {
    uint32_t draw, triangle;
    float pixel[2];
};
struct answer {
    float position[3], normal[3], geometric[3], tangent[4], color[4];
    float uv0[2], uv0_dx[2], uv0_dy[2], uv1[2], depth, front;
};

struct fixture {
    struct hg_gpu *gpu;
    struct hg_error err;
    uint32_t random;
    bool facets; // surface points come from facets, not from vertices
};

static void check(struct fixture *f, enum hg_status status)
{
    if (status != HG_OK) {
        char text[1024];
        hg_error_format(&f->err, text, sizeof text);
        fail_msg("%s", text);
    }
}

static double random_in(struct fixture *f, double low, double high)
{
    f->random = f->random * 1664525u + 1013904223u;
    return low + (high - low) * (double)(f->random >> 8) * 0x1p-24;
}

static int setup(void **state)
{
    struct fixture *f = calloc(1, sizeof *f);
    assert_non_null(f);
    const struct hg_gpu_params params = {.validation_try = true};
    check(f, hg_gpu_create(&params, &f->gpu, &f->err));
    f->random = 5;
    *state = f;
    return 0;
}

static int teardown(void **state)
{
    struct fixture *f = *state;
    const uint32_t messages = hg_gpu_validation_messages(f->gpu);
    hg_gpu_destroy(f->gpu);
    free(f);
    return messages == 0 ? 0 : -1;
}

static void submit(struct fixture *f, struct hg_gpu_cmd *cmd)
{
    uint64_t value;
    check(f, hg_gpu_submit(f->gpu, cmd, &value, &f->err));
    check(f, hg_gpu_wait(f->gpu, value, &f->err));
}

// A sync and the batch that it belongs to.
static void sync(struct fixture *f, struct hg_geometry *g, struct hg_scene *scene)
{
    hg_scene_publish(scene);
    hg_scene_update(scene);
    check(f, hg_geometry_sync(g, scene, NULL, &f->err));
    struct hg_gpu_cmd *cmd;
    check(f, hg_gpu_begin(f->gpu, &cmd, &f->err));
    check(f, hg_skin_record(cmd, g, &f->err));
    submit(f, cmd);
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

static struct hg_mesh *add_mesh(struct fixture *f, struct hg_scene *scene, uint64_t id)
{
    enum { N = TRIANGLES * 3 };
    float positions[N * 3], normals[N * 3], tangents[N * 4], uv[N * 2], uv1[N * 2], colors[N * 4];
    uint32_t indices[N];
    for (int i = 0; i < N; i++) {
        float n[3], length = 0.0f;
        for (int c = 0; c < 3; c++) {
            const float center = (float)random_in(f, -1.0, 1.0);
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
            uv[i * 2 + c] = (float)random_in(f, -3.0, 3.0);
            uv1[i * 2 + c] = (float)random_in(f, 0.0, 1.0);
        }
        for (int c = 0; c < 4; c++)
            colors[i * 4 + c] = (float)random_in(f, 0.0, 1.0);
        indices[i] = (uint32_t)(N - 1 - i);
    }
    struct hg_object *object;
    check(f, hg_scene_add(scene, HG_OBJECT_MESH, id, &object));
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

static struct hg_node *add_node(
    struct fixture *f, struct hg_scene *scene, uint64_t id, struct hg_mesh *mesh)
{
    struct hg_object *object;
    check(f, hg_scene_add(scene, HG_OBJECT_NODE, id, &object));
    struct hg_node *node = (struct hg_node *)object;
    node->mesh = mesh;
    node->visible = true;
    return node;
}

// --- cameras, in double --------------------------------------------------------------------------

struct eye {
    double position[3], right[3], up[3], back[3];
    double focal, aspect; // perspective
    bool orthographic;
    double half_height;
};

static void cross3(const double a[3], const double b[3], double out[3])
{
    const double c[3] = {
        a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
    memcpy(out, c, sizeof c);
}

static double dot3(const double a[3], const double b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static void normalize3(double v[3])
{
    const double length = sqrt(dot3(v, v));
    for (int i = 0; i < 3; i++)
        v[i] /= length;
}

static struct eye look_at(const double position[3], const double target[3], bool orthographic)
{
    struct eye e = {.focal = 1.5,
        .aspect = (double)WIDTH / HEIGHT,
        .orthographic = orthographic,
        .half_height = 5.0};
    for (int i = 0; i < 3; i++) {
        e.position[i] = position[i];
        e.back[i] = position[i] - target[i];
    }
    const double up[3] = {0.1, 1.0, 0.2};
    normalize3(e.back);
    cross3(up, e.back, e.right);
    normalize3(e.right);
    cross3(e.back, e.right, e.up);
    return e;
}

// Rays through pixels, as shaders/shared/frame.h says.
static void fill_rays(const struct eye *e, const double eye[3], struct hg_gpu_camera *camera)
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

static void fill_camera(const struct eye *e, const double origin[3], struct hg_gpu_camera *camera)
{
    double view[16] = {0}, proj[16] = {0}, vp[16], eye[3];
    for (int i = 0; i < 3; i++)
        eye[i] = e->position[i] - origin[i];
    for (int c = 0; c < 3; c++) {
        view[c * 4] = e->right[c];
        view[c * 4 + 1] = e->up[c];
        view[c * 4 + 2] = e->back[c];
    }
    view[12] = -dot3(e->right, eye);
    view[13] = -dot3(e->up, eye);
    view[14] = -dot3(e->back, eye);
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

// Pixel of a point; false behind the eye or off the screen.
static bool project(const struct eye *e, const double p[3], double pixel[2])
{
    double d[3];
    for (int i = 0; i < 3; i++)
        d[i] = p[i] - e->position[i];
    const double depth = -dot3(e->back, d);
    if (depth < 0.05)
        return false;
    const double w = e->orthographic ? e->half_height : depth / e->focal;
    pixel[0] = (dot3(e->right, d) / (w * e->aspect) + 1.0) * 0.5 * WIDTH;
    pixel[1] = (1.0 - dot3(e->up, d) / w) * 0.5 * HEIGHT;
    return pixel[0] > 0 && pixel[0] < WIDTH && pixel[1] > 0 && pixel[1] < HEIGHT;
}

// Barycentrics of the point of a triangle's plane that a pixel sees.
static void intersect(const struct eye *e, double p[3][3], const double pixel[2], double b[3])
{
    const double x = (pixel[0] / WIDTH * 2.0 - 1.0) * e->aspect, y = 1.0 - pixel[1] / HEIGHT * 2.0;
    double start[3], ray[3], e1[3], e2[3], n[3], q[3], at[3];
    for (int i = 0; i < 3; i++) {
        const double off = x * e->right[i] + y * e->up[i];
        start[i] = e->position[i] + (e->orthographic ? off * e->half_height : 0.0);
        ray[i] = e->orthographic ? -e->back[i] : off - e->focal * e->back[i];
        e1[i] = p[1][i] - p[0][i];
        e2[i] = p[2][i] - p[0][i];
        q[i] = p[0][i] - start[i];
    }
    cross3(e1, e2, n);
    const double t = dot3(q, n) / dot3(ray, n);
    for (int i = 0; i < 3; i++)
        at[i] = start[i] + t * ray[i] - p[0][i];
    double c1[3], c2[3];
    cross3(at, e2, c1);
    cross3(e1, at, c2);
    b[1] = dot3(c1, n) / dot3(n, n);
    b[2] = dot3(c2, n) / dot3(n, n);
    b[0] = 1.0 - b[1] - b[2];
}

// --- surface points ------------------------------------------------------------------------------

struct truth {
    double position[3], uv[2], dx[2], dy[2], face[3], footprint;
    bool steep; // seen too edge-on for finite differences
};

static void corners_of(const struct hg_node *node, uint32_t triangle, double p[3][3], uint32_t i[3])
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

static void uv_at(const struct hg_node *node, const uint32_t i[3], const double b[3], double uv[2])
{
    for (int c = 0; c < 2; c++)
        uv[c] = b[0] * node->mesh->parts->uv[0][i[0] * 2 + (uint32_t)c] +
                b[1] * node->mesh->parts->uv[0][i[1] * 2 + (uint32_t)c] +
                b[2] * node->mesh->parts->uv[0][i[2] * 2 + (uint32_t)c];
}

static struct truth truth_at(
    const struct eye *e, const struct hg_node *node, uint32_t triangle, const double pixel[2])
{
    struct truth t = {0};
    double p[3][3], b[3], near[4][2];
    uint32_t index[3];
    const double h = 1e-3;
    corners_of(node, triangle, p, index);
    intersect(e, p, pixel, b);
    uv_at(node, index, b, t.uv);
    double e1[3], e2[3], to_eye[3];
    for (int c = 0; c < 3; c++) {
        t.position[c] = b[0] * p[0][c] + b[1] * p[1][c] + b[2] * p[2][c];
        e1[c] = p[1][c] - p[0][c];
        e2[c] = p[2][c] - p[0][c];
        to_eye[c] = e->orthographic ? e->back[c] : e->position[c] - t.position[c];
    }
    for (int k = 0; k < 4; k++) {
        const double moved[2] = {pixel[0] + (k == 0      ? h
                                                : k == 1 ? -h
                                                         : 0),
            pixel[1] + (k == 2      ? h
                           : k == 3 ? -h
                                    : 0)};
        double bb[3];
        intersect(e, p, moved, bb);
        uv_at(node, index, bb, near[k]);
    }
    for (int c = 0; c < 2; c++) {
        t.dx[c] = (near[0][c] - near[1][c]) / (2 * h);
        t.dy[c] = (near[2][c] - near[3][c]) / (2 * h);
        t.footprint = fmax(t.footprint, fmax(fabs(t.dx[c]), fabs(t.dy[c])));
    }
    cross3(e1, e2, t.face);
    normalize3(t.face);
    normalize3(to_eye);
    t.steep = fabs(dot3(t.face, to_eye)) < 0.05;
    return t;
}

static void run_queries(struct fixture *f, struct hg_geometry *g, const struct eye *e,
    const struct query *queries, struct answer *answers)
{
    struct hg_gpu_buffer in, out, frame_buffer;
    check(f, hg_gpu_buffer_create(
                 f->gpu, HG_GPU_BUFFER_UPLOAD, QUERIES * sizeof *queries, "queries", &in, &f->err));
    check(f, hg_gpu_buffer_create(f->gpu, HG_GPU_BUFFER_READBACK, QUERIES * sizeof *answers,
                 "answers", &out, &f->err));
    check(f,
        hg_gpu_buffer_create(f->gpu, HG_GPU_BUFFER_UPLOAD, 65536, "frame", &frame_buffer, &f->err));
    memcpy(in.mapped, queries, QUERIES * sizeof *queries);
    struct hg_gpu_frame *frame = frame_buffer.mapped;
    memset(frame, 0, sizeof *frame);
    double origin[3];
    hg_geometry_origin(g, origin);
    fill_camera(e, origin, &frame->camera);
    frame->inv_size = (struct hg_vec2){1.0f / WIDTH, 1.0f / HEIGHT};
    hg_geometry_fill(g, &frame->geometry);
    struct hg_gpu_bindings bindings = {0};
    bindings.uniforms[HG_BIND_FRAME - HG_BIND_UNIFORM_FIRST] =
        (struct hg_gpu_uniform){frame_buffer.address, 4096};
    const struct {
        uint64_t queries, answers;
        uint32_t count;
    } push = {in.address, out.address, QUERIES};
    const struct hg_gpu_pipeline_params params = {
        .compute = "test_fetch.comp", .spec = {f->facets}, .spec_count = 1};
    struct hg_gpu_cmd *cmd;
    if (f->facets)
        check(f, hg_geometry_sync_facets(g, true, &f->err));
    check(f, hg_gpu_begin(f->gpu, &cmd, &f->err));
    if (f->facets) {
        struct hg_pass pass = {
            .gpu = f->gpu, .cmd = cmd, .bindings = bindings, .features = HG_FEATURE_ALL};
        check(f, hg_facet_record(&pass, g, &f->err));
        assert_true(hg_geometry_facets(
            g, &bindings.uniforms[HG_BIND_FACETS - HG_BIND_UNIFORM_FIRST], &bindings.texels));
    }
    check(f, hg_gpu_cmd_bind(cmd, &bindings, &f->err));
    check(f, hg_gpu_cmd_pipeline(cmd, &params, &f->err));
    hg_gpu_cmd_push(cmd, &push, sizeof push);
    vkCmdDispatch(hg_gpu_cmd_handle(cmd), QUERIES / 64, 1, 1);
    hg_gpu_memory_barrier(cmd);
    submit(f, cmd);
    memcpy(answers, out.mapped, QUERIES * sizeof *answers);
    hg_gpu_buffer_destroy(f->gpu, &in);
    hg_gpu_buffer_destroy(f->gpu, &out);
    hg_gpu_buffer_destroy(f->gpu, &frame_buffer);
}

// Pixels inside random triangles of the nodes that the geometry draws.
static void make_queries(struct fixture *f, const struct hg_geometry *g, const struct eye *e,
    struct query *queries, const struct hg_node **nodes)
{
    for (int i = 0; i < QUERIES;) {
        struct hg_draw_info info;
        const uint32_t draw = (uint32_t)random_in(f, 0, g->draw_count);
        assert_true(hg_geometry_draw_info(g, draw, &info));
        const uint32_t triangle = (uint32_t)random_in(f, 0, TRIANGLES);
        double p[3][3], at[3], pixel[2];
        uint32_t index[3];
        corners_of(info.node, triangle, p, index);
        const double u = random_in(f, 0.02, 0.96), v = random_in(f, 0.02, 0.98 - u);
        for (int c = 0; c < 3; c++)
            at[c] = (1 - u - v) * p[0][c] + u * p[1][c] + v * p[2][c];
        if (!project(e, at, pixel))
            continue;
        nodes[i] = info.node;
        queries[i++] = (struct query){draw, triangle, {(float)pixel[0], (float)pixel[1]}};
    }
}

static void check_points_of(
    struct fixture *f, struct hg_geometry *g, const struct eye *e, double tolerance)
{
    static struct query queries[QUERIES];
    static struct answer answers[QUERIES];
    static const struct hg_node *nodes[QUERIES];
    make_queries(f, g, e, queries, nodes);
    run_queries(f, g, e, queries, answers);
    double origin[3], worst_position = 0, worst_uv = 0, worst_derivative = 0;
    hg_geometry_origin(g, origin);
    uint32_t compared = 0;
    for (int i = 0; i < QUERIES; i++) {
        const double pixel[2] = {queries[i].pixel[0], queries[i].pixel[1]};
        const struct truth t = truth_at(e, nodes[i], queries[i].triangle, pixel);
        const struct answer *a = &answers[i];
        if (t.steep)
            continue;
        compared++;
        const double reach = fmax(1.0, a->depth);
        for (int c = 0; c < 3; c++)
            worst_position =
                fmax(worst_position, fabs(a->position[c] + origin[c] - t.position[c]) / reach);
        for (int c = 0; c < 2; c++) {
            worst_uv = fmax(worst_uv, fabs(a->uv0[c] - t.uv[c]) / (1.0 + 100.0 * t.footprint));
            worst_derivative = fmax(worst_derivative,
                fmax(fabs(a->uv0_dx[c] - t.dx[c]), fabs(a->uv0_dy[c] - t.dy[c])) / t.footprint);
        }
        const bool mirrored = g->draws[queries[i].draw].gpu.flags & HG_DRAW_MIRRORED;
        const double side = mirrored ? -1.0 : 1.0;
        double facing = 0.0, to_eye = 0.0;
        for (int c = 0; c < 3; c++) {
            facing += side * t.face[c] * a->geometric[c];
            to_eye +=
                side * t.face[c] * (e->orthographic ? e->back[c] : e->position[c] - t.position[c]);
        }
        assert_true(facing > 0.999);
        assert_true((to_eye > 0.0) == (a->front > 0.5f));
    }
    print_message(
        "%s: %u points: position %.2e of the distance, uv %.2e, derivatives %.2e relative\n",
        f->facets ? "facets" : "vertices", compared, worst_position, worst_uv, worst_derivative);
    assert_true(compared > QUERIES / 2);
    assert_true(worst_position < tolerance);
    assert_true(worst_uv < tolerance * 10);
    assert_true(worst_derivative < tolerance * 100);
}

static void check_points(
    struct fixture *f, struct hg_geometry *g, const struct eye *e, double tolerance)
{
    for (int facets = 0; facets < 2; facets++) {
        f->facets = facets == 1;
        check_points_of(f, g, e, tolerance);
    }
    f->facets = false;
}

struct small_scene {
    struct hg_scene *scene;
    struct hg_geometry *geometry;
    struct hg_mesh *mesh;
    struct hg_node *nodes[2]; // the second is mirrored
};

static struct small_scene make_scene(struct fixture *f)
{
    struct small_scene s;
    check(f, hg_scene_create(&s.scene));
    check(f, hg_geometry_create(f->gpu, NULL, &s.geometry, &f->err));
    s.mesh = add_mesh(f, s.scene, 1);
    s.nodes[0] = add_node(f, s.scene, 1, s.mesh);
    s.nodes[1] = add_node(f, s.scene, 2, s.mesh);
    const float turn[4] = {0.1826f, 0.3651f, 0.5477f, 0.7303f};
    memcpy(s.nodes[0]->rotation, turn, sizeof turn);
    s.nodes[0]->scale[0] = 1.5f;
    s.nodes[0]->scale[1] = 0.5f;
    s.nodes[1]->translation[0] = 2.0f;
    s.nodes[1]->scale[2] = -1.25f;
    return s;
}

static void destroy_scene(struct small_scene *s)
{
    hg_geometry_destroy(s->geometry);
    hg_scene_destroy(s->scene);
}

static void test_points(void **state)
{
    struct fixture *f = *state;
    struct small_scene s = make_scene(f);
    sync(f, s.geometry, s.scene);
    const double outside[3] = {3, 4, 9}, inside[3] = {0.2, 0.3, 0.5}, target[3] = {0, 0.5, 0};
    const struct eye perspective = look_at(outside, target, false);
    const struct eye within = look_at(inside, outside, false); // corners behind the eye
    const struct eye orthographic = look_at(outside, target, true);
    check_points(f, s.geometry, &perspective, 2e-5);
    check_points(f, s.geometry, &within, 1e-4);
    check_points(f, s.geometry, &orthographic, 2e-5);
    destroy_scene(&s);
}

// A thousand kilometres from the scene's origin: the same precision, once the origin has moved.
static void test_large_world(void **state)
{
    struct fixture *f = *state;
    struct small_scene s = make_scene(f);
    for (int i = 0; i < 2; i++) {
        s.nodes[i]->translation[0] += 1.0e6f;
        s.nodes[i]->translation[2] -= 0.75e6f;
    }
    const double eye[3] = {1.0e6 + 3, 4, -0.75e6 + 9}, target[3] = {1.0e6, 0.5, -0.75e6};
    assert_true(hg_geometry_set_origin(s.geometry, eye));
    const double near[3] = {eye[0] + 1000, eye[1], eye[2] - 1000};
    assert_false(hg_geometry_set_origin(s.geometry, near)); // the same cell: nothing moves
    sync(f, s.geometry, s.scene);
    const struct eye perspective = look_at(eye, target, false);
    check_points(f, s.geometry, &perspective, 1e-4);
    destroy_scene(&s);
}

// Vertex attributes come back as they were given.
static void test_attributes(void **state)
{
    struct fixture *f = *state;
    struct small_scene s = make_scene(f);
    sync(f, s.geometry, s.scene);
    static struct query queries[QUERIES];
    static struct answer answers[QUERIES];
    const double eye[3] = {3, 4, 9}, target[3] = {0, 0.5, 0};
    const struct eye e = look_at(eye, target, false);
    const struct hg_mesh_part *part = s.mesh->parts;
    struct hg_draw_info info;
    uint32_t draw = 0;
    for (; hg_geometry_draw_info(s.geometry, draw, &info) && info.node != s.nodes[1]; draw++)
        ;
    uint32_t corner[QUERIES], count = 0;
    for (uint32_t k = 0; k < TRIANGLES * 3; k++) { // pixels of the corners
        double p[3][3], pixel[2];
        uint32_t index[3];
        corners_of(s.nodes[1], k / 3, p, index);
        if (!project(&e, p[k % 3], pixel))
            continue;
        corner[count] = index[k % 3];
        queries[count++] = (struct query){draw, k / 3, {(float)pixel[0], (float)pixel[1]}};
    }
    assert_true(count > 20);
    run_queries(f, s.geometry, &e, queries, answers);
    uint32_t good = 0;
    for (uint32_t k = 0; k < count; k++) {
        float worst = 0.0f;
        for (int c = 0; c < 4; c++)
            worst = fmaxf(
                worst, fabsf(answers[k].color[c] - part->colors[corner[k] * 4 + (uint32_t)c]));
        for (int c = 0; c < 2; c++)
            worst =
                fmaxf(worst, fabsf(answers[k].uv1[c] - part->uv[1][corner[k] * 2 + (uint32_t)c]));
        // Node 1 scales by (1, 1, -1.25): normals by the inverse.
        float n[3], length = 0.0f;
        memcpy(n, part->normals + corner[k] * 3, sizeof n);
        n[2] /= -1.25f;
        for (int c = 0; c < 3; c++)
            length += n[c] * n[c];
        for (int c = 0; c < 3; c++)
            worst = fmaxf(worst, fabsf(answers[k].normal[c] - n[c] / sqrtf(length)));
        good += worst < 2e-3f;
    }
    assert_true(good >= count * 95 / 100); // triangles seen edge-on are not exact
    destroy_scene(&s);
}

// --- poses ---------------------------------------------------------------------------------------

static void reference_vertex(const struct hg_node *node, const struct hg_mesh_part *part,
    uint32_t v, const double anchor[3], double position[3], double normal[3])
{
    const float *weights = node->weights != NULL ? node->weights : node->mesh->weights;
    for (int c = 0; c < 3; c++) {
        position[c] = part->positions[v * 3 + (uint32_t)c];
        normal[c] = part->normals[v * 3 + (uint32_t)c];
        for (uint32_t t = 0; t < node->mesh->target_count; t++) {
            if (part->targets[t].positions != NULL)
                position[c] += (double)weights[t] * part->targets[t].positions[v * 3 + (uint32_t)c];
            if (part->targets[t].normals != NULL)
                normal[c] += (double)weights[t] * part->targets[t].normals[v * 3 + (uint32_t)c];
        }
    }
    if (node->skin == NULL)
        return;
    double m[16] = {0};
    for (uint32_t k = v * part->joint_sets * 4; k < (v + 1) * part->joint_sets * 4; k++) {
        double world[16], bind[16];
        hg_matrix_from_float(node->skin->joints[part->joints[k]]->world, world);
        hg_matrix_from_float(node->skin->inverse_bind[part->joints[k]], bind);
        hg_matrix_multiply(world, bind, world);
        for (int i = 0; i < 16; i++)
            m[i] += part->weights[k] * world[i];
    }
    double p[3], columns[3][3], cofactor[3][3], n[3];
    for (int r = 0; r < 3; r++) {
        p[r] = m[r] * position[0] + m[4 + r] * position[1] + m[8 + r] * position[2] + m[12 + r] -
               anchor[r];
        for (int c = 0; c < 3; c++)
            columns[c][r] = m[c * 4 + r];
    }
    for (int c = 0; c < 3; c++)
        cross3(columns[(c + 1) % 3], columns[(c + 2) % 3], cofactor[c]);
    for (int r = 0; r < 3; r++)
        n[r] = cofactor[0][r] * normal[0] + cofactor[1][r] * normal[1] + cofactor[2][r] * normal[2];
    memcpy(position, p, sizeof p);
    memcpy(normal, n, sizeof n);
}

static void read_output(
    struct fixture *f, const struct hg_deform_entry *e, struct hg_gpu_buffer *back)
{
    check(f, hg_gpu_buffer_create(
                 f->gpu, HG_GPU_BUFFER_READBACK, e->output_bytes, "posed", back, &f->err));
    struct hg_gpu_cmd *cmd;
    check(f, hg_gpu_begin(f->gpu, &cmd, &f->err));
    const VkBufferCopy all = {0, 0, e->output_bytes};
    vkCmdCopyBuffer(hg_gpu_cmd_handle(cmd), e->output.handle, back->handle, 1, &all);
    hg_gpu_memory_barrier(cmd);
    submit(f, cmd);
}

static void check_pose(struct fixture *f, const struct hg_deform_entry *e, const char *name)
{
    const struct hg_mesh_part *part = &e->node_object->mesh->parts[e->part];
    struct hg_gpu_buffer back;
    read_output(f, e, &back);
    const float *positions = back.mapped;
    const struct hg_gpu_vertex *vertices =
        (const void *)((const uint8_t *)back.mapped + e->vertices_offset);
    double worst = 0, worst_normal = 0, size = 1e-3;
    for (uint32_t v = 0; v < e->vertex_count; v++) {
        double p[3], n[3], gap = 0, length = 0;
        float packed[3];
        reference_vertex(e->node_object, part, v, e->anchor, p, n);
        hg_unpack_normal(vertices[v].normal, packed);
        for (int c = 0; c < 3; c++) {
            size = fmax(size, fabs(p[c]));
            worst = fmax(worst, fabs(p[c] - positions[v * 3 + (uint32_t)c]));
            length += n[c] * n[c];
            // The bounds that culling uses hold every vertex.
            assert_true(positions[v * 3 + (uint32_t)c] >= e->bounds.min[c] - 1e-5 * size);
            assert_true(positions[v * 3 + (uint32_t)c] <= e->bounds.max[c] + 1e-5 * size);
        }
        for (int c = 0; c < 3; c++)
            gap = fmax(gap, fabs(n[c] / sqrt(length) - packed[c]));
        worst_normal = fmax(worst_normal, length > 1e-12 ? gap : 0);
    }
    print_message("%s: %u vertices, %u joints: position %.2e of the size, normal %.2e\n", name,
        e->vertex_count, e->joint_count, worst / size, worst_normal);
    assert_true(worst / size < 1e-5);
    assert_true(worst_normal < 2e-3);
    hg_gpu_buffer_destroy(f->gpu, &back);
}

static void check_file(struct fixture *f, const char *name)
{
    const char *root = getenv("HELIO_TEST_DATA");
    char path[1024];
    snprintf(path, sizeof path, "%s/khronos/%s", root != NULL ? root : "../shared/data", name);
    const struct hg_load_params params = {.path = path, .asset_number = 1, .scene_index = -1};
    struct hg_asset *asset;
    struct hg_scene *scene;
    struct hg_geometry *g;
    check(f, hg_load_asset(&params, &asset, &f->err));
    check(f, hg_scene_create(&scene));
    check(f, hg_scene_add_asset(scene, asset, NULL));
    check(f, hg_geometry_create(f->gpu, NULL, &g, &f->err));
    for (int step = 0; step < 3; step++) {
        check(f, hg_asset_pose(asset, -1, 0.31 * step));
        sync(f, g, scene);
        for (uint32_t i = 0; i < g->deform_count; i++)
            check_pose(f, &g->deforms[i], name);
    }
    assert_true(g->deform_count > 0);
    // The same pose again costs nothing.
    sync(f, g, scene);
    struct hg_geometry_stats stats;
    hg_geometry_stats(g, &stats);
    assert_int_equal(stats.uploaded_bytes, 0);
    assert_int_equal(stats.deforms_changed, 0);
    hg_geometry_destroy(g);
    hg_scene_destroy(scene);
}

static void test_poses(void **state)
{
    struct fixture *f = *state;
    check_file(f, "CesiumMan/glTF-Binary/CesiumMan.glb");
    check_file(f, "Fox/glTF-Binary/Fox.glb");
    check_file(f, "SimpleSkin/glTF/SimpleSkin.gltf");
    check_file(f, "AnimatedMorphCube/glTF-Binary/AnimatedMorphCube.glb");
}

// --- what is uploaded ----------------------------------------------------------------------------

static void test_only_what_changed(void **state)
{
    struct fixture *f = *state;
    struct small_scene s = make_scene(f);
    struct hg_geometry_stats stats;
    sync(f, s.geometry, s.scene);
    hg_geometry_stats(s.geometry, &stats);
    assert_int_equal(stats.parts_uploaded, 1);
    assert_int_equal(stats.triangles_total, 2 * TRIANGLES);
    const uint64_t first = stats.uploaded_bytes, shape = hg_geometry_shape_revision(s.geometry);
    sync(f, s.geometry, s.scene);
    hg_geometry_stats(s.geometry, &stats);
    assert_int_equal(stats.uploaded_bytes, 0);
    assert_int_equal(hg_geometry_shape_revision(s.geometry), shape);
    s.nodes[0]->translation[1] = 0.5f; // a moved node: one piece of the instance table
    hg_scene_touch(s.scene, &s.nodes[0]->head);
    sync(f, s.geometry, s.scene);
    hg_geometry_stats(s.geometry, &stats);
    assert_int_equal(stats.parts_uploaded, 0);
    assert_in_range(stats.uploaded_bytes, 1, 1024);
    assert_int_equal(hg_geometry_shape_revision(s.geometry), shape + 1);
    s.mesh->parts[0].positions[0] += 1.0f; // an edited mesh: its part
    hg_scene_touch(s.scene, &s.mesh->head);
    sync(f, s.geometry, s.scene);
    hg_geometry_stats(s.geometry, &stats);
    assert_int_equal(stats.parts_uploaded, 1);
    assert_true(stats.uploaded_bytes < first);
    destroy_scene(&s);
}

// A budget that is exactly enough works; one mesh more is refused before memory is taken; what was
// shown before stays.
static void test_budget(void **state)
{
    struct fixture *f = *state;
    struct small_scene s = make_scene(f);
    sync(f, s.geometry, s.scene);
    struct hg_geometry_stats stats;
    struct hg_gpu_memory_stats before, after;
    hg_geometry_stats(s.geometry, &stats);
    struct hg_geometry *tight;
    const struct hg_geometry_params params = {.budget_bytes = stats.used_bytes};
    check(f, hg_geometry_create(f->gpu, &params, &tight, &f->err));
    check(f, hg_geometry_sync(tight, s.scene, NULL, &f->err)); // exactly enough
    add_node(f, s.scene, 3, add_mesh(f, s.scene, 2));
    hg_scene_publish(s.scene);
    hg_scene_update(s.scene);
    hg_gpu_memory_stats(f->gpu, &before);
    assert_int_equal(hg_geometry_sync(tight, s.scene, NULL, &f->err), HG_E_LIMIT);
    hg_gpu_memory_stats(f->gpu, &after);
    assert_int_equal(before.used_bytes, after.used_bytes);
    assert_non_null(strstr(f->err.what, "geometry budget"));
    assert_int_equal(tight->draw_count, 2);
    hg_geometry_destroy(tight);
    destroy_scene(&s);
}

// Every allocation and every Vulkan call fails once: a status, what was shown stays, and the next
// sync succeeds.
static void test_faults(void **state)
{
    struct fixture *f = *state;
    struct small_scene s = make_scene(f);
    sync(f, s.geometry, s.scene);
    uint32_t failures = 0;
    for (int kind = 0; kind < 2; kind++) {
        enum hg_status status = HG_E_NOMEM;
        for (uint64_t n = 1; status != HG_OK && n < 200; n++) {
            s.mesh->parts[0].positions[0] += 1.0f;
            hg_scene_touch(s.scene, &s.mesh->head);
            hg_scene_publish(s.scene);
            hg_scene_update(s.scene);
            if (kind == 0)
                hg_alloc_fail_at(n);
            else
                hg_gpu_fail_at(n, VK_ERROR_OUT_OF_DEVICE_MEMORY);
            status = hg_geometry_sync(s.geometry, s.scene, NULL, &f->err);
            hg_alloc_fail_at(0);
            hg_gpu_fail_at(0, VK_SUCCESS);
            failures += status != HG_OK;
            assert_true(status == HG_OK || status == HG_E_NOMEM);
            assert_int_equal(s.geometry->draw_count, 2);
            struct hg_draw_info info;
            assert_true(hg_geometry_draw_info(s.geometry, 1, &info));
        }
        assert_int_equal(status, HG_OK);
        sync(f, s.geometry, s.scene);
    }
    assert_true(failures > 8);
    destroy_scene(&s);
}

// --- culling -------------------------------------------------------------------------------------

static bool draw_is_listed(const struct hg_visible *v, uint32_t set, uint32_t draw)
{
    const struct hg_visible_set *s = hg_visible_set(v, set);
    for (uint32_t i = 0; i < s->item_count; i++) {
        const struct hg_visible_item *item = hg_visible_item(v, s->first_item + i);
        if (draw - item->first_draw < item->draw_count)
            return true;
    }
    return false;
}

// Culling never drops a draw that has a corner on the screen, and does drop what is outside.
static void test_culling(void **state)
{
    struct fixture *f = *state;
    struct hg_scene *scene;
    struct hg_geometry *g;
    check(f, hg_scene_create(&scene));
    check(f, hg_geometry_create(f->gpu, NULL, &g, &f->err));
    struct hg_mesh *mesh = add_mesh(f, scene, 1);
    for (uint64_t i = 0; i < 400; i++) {
        struct hg_node *node = add_node(f, scene, i + 1, mesh);
        for (int c = 0; c < 3; c++) {
            node->translation[c] = (float)random_in(f, -60, 60);
            node->scale[c] = (float)random_in(f, 0.1, 2);
        }
    }
    sync(f, g, scene);
    struct hg_visible *v;
    check(f, hg_visible_create(f->gpu, &v, &f->err));
    const struct hg_visible_view off = {.plane_count = 0};
    check(f, hg_visible_add(v, g, &off, NULL, &f->err));
    assert_int_equal(hg_visible_set(v, 0)->item_count, 1); // instances of one part are one item
    assert_int_equal(hg_visible_item(v, 0)->draw_count, 400);
    const double eye[3] = {0, 0, 0}, target[3] = {1, 0.2, 0.4}, origin[3] = {0};
    const struct eye e = look_at(eye, target, false);
    struct hg_gpu_camera camera = {0};
    fill_camera(&e, origin, &camera);
    struct hg_visible_view cull = {.both_sides = true};
    cull.plane_count = hg_cull_planes(camera.view_proj.m, cull.planes);
    assert_int_equal(cull.plane_count, 5); // the far plane is at infinity
    check(f, hg_visible_add(v, g, &cull, NULL, &f->err));
    uint32_t must = 0;
    for (uint32_t d = 0; d < g->draw_count; d++) {
        bool on_screen = false;
        for (uint32_t t = 0; t < TRIANGLES && !on_screen; t++) {
            double p[3][3], pixel[2];
            uint32_t index[3];
            corners_of(g->draws[d].node, t, p, index);
            for (int k = 0; k < 3; k++)
                on_screen = on_screen || project(&e, p[k], pixel);
        }
        must += on_screen;
        if (on_screen)
            assert_true(draw_is_listed(v, 1, d));
    }
    uint32_t listed = 0;
    for (uint32_t d = 0; d < g->draw_count; d++)
        listed += draw_is_listed(v, 1, d);
    print_message("%u draws have corners on the screen, %u are drawn, of 400\n", must, listed);
    assert_true(must > 10 && listed < 200);
    hg_visible_destroy(v);
    hg_geometry_destroy(g);
    hg_scene_destroy(scene);
}

int main(void)
{
    hg_log_set_sink(hg_log_sink_logfmt, (void *)(intptr_t)2);
    hg_log_set_level(HG_LOG_WARN);
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_points),
        cmocka_unit_test(test_large_world), cmocka_unit_test(test_attributes),
        cmocka_unit_test(test_poses), cmocka_unit_test(test_only_what_changed),
        cmocka_unit_test(test_budget), cmocka_unit_test(test_faults),
        cmocka_unit_test(test_culling)};
    return cmocka_run_group_tests(tests, setup, teardown);
}
