// geometry_points.c - surface points and derivatives on the device, from vertices and from facets,
// against double precision.
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "base/log.h"
#include "geometry_device.h"
#include "renderer/passes/triangle_cache.h"
#include "shaders/shared/features.h"
#include "shaders/shared/frame.h"

#define QUERIES 4096

struct query {
    uint32_t draw, triangle;
    float pixel[2];
};
struct answer {
    float position[3], normal[3], geometric[3], tangent[4], color[4];
    float uv0[2], uv0_dx[2], uv0_dy[2], uv1[2], depth, front;
};

// Barycentrics of the point of a triangle's plane that a pixel sees.
static void intersect(const struct geo_eye *e, double p[3][3], const double pixel[2], double b[3])
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
    geo_cross(e1, e2, n);
    const double t = geo_dot(q, n) / geo_dot(ray, n);
    for (int i = 0; i < 3; i++)
        at[i] = start[i] + t * ray[i] - p[0][i];
    double c1[3], c2[3];
    geo_cross(at, e2, c1);
    geo_cross(e1, at, c2);
    b[1] = geo_dot(c1, n) / geo_dot(n, n);
    b[2] = geo_dot(c2, n) / geo_dot(n, n);
    b[0] = 1.0 - b[1] - b[2];
}

struct truth {
    double position[3], uv[2], dx[2], dy[2], face[3], footprint;
    bool steep; // seen too edge-on for finite differences
};

static void uv_at(const struct hg_node *node, const uint32_t i[3], const double b[3], double uv[2])
{
    for (int c = 0; c < 2; c++)
        uv[c] = b[0] * node->mesh->parts->uv[0][i[0] * 2 + (uint32_t)c] +
                b[1] * node->mesh->parts->uv[0][i[1] * 2 + (uint32_t)c] +
                b[2] * node->mesh->parts->uv[0][i[2] * 2 + (uint32_t)c];
}

static struct truth truth_at(
    const struct geo_eye *e, const struct hg_node *node, uint32_t triangle, const double pixel[2])
{
    struct truth t = {0};
    double p[3][3], b[3], near[4][2];
    uint32_t index[3];
    const double h = 1e-3;
    geo_corners(node, triangle, p, index);
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
    geo_cross(e1, e2, t.face);
    geo_normalize(t.face);
    geo_normalize(to_eye);
    t.steep = fabs(geo_dot(t.face, to_eye)) < 0.05;
    return t;
}

static void run_queries(struct geo *f, struct hg_geometry *g, const struct geo_eye *e,
    const struct query *queries, struct answer *answers)
{
    struct hg_gpu_buffer in, out, frame_buffer;
    geo_check(f, hg_gpu_buffer_create(f->gpu, HG_GPU_BUFFER_UPLOAD, QUERIES * sizeof *queries,
                     "queries", &in, &f->err));
    geo_check(f, hg_gpu_buffer_create(f->gpu, HG_GPU_BUFFER_READBACK, QUERIES * sizeof *answers,
                     "answers", &out, &f->err));
    geo_check(f,
        hg_gpu_buffer_create(f->gpu, HG_GPU_BUFFER_UPLOAD, 65536, "frame", &frame_buffer, &f->err));
    memcpy(in.mapped, queries, QUERIES * sizeof *queries);
    struct hg_gpu_frame *frame = frame_buffer.mapped;
    memset(frame, 0, sizeof *frame);
    double origin[3];
    hg_geometry_origin(g, origin);
    geo_fill_camera(e, origin, &frame->camera);
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
        geo_check(f, hg_geometry_sync_triangle_cache(g, true, &f->err));
    geo_check(f, hg_gpu_begin(f->gpu, &cmd, &f->err));
    if (f->facets) {
        struct hg_pass pass = {
            .gpu = f->gpu, .cmd = cmd, .bindings = bindings, .features = HG_FEATURE_ALL};
        geo_check(f, hg_triangle_cache_record(&pass, g, &f->err));
        assert_true(hg_geometry_triangle_cache(g,
            &bindings.uniforms[HG_BIND_TRIANGLE_CACHE - HG_BIND_UNIFORM_FIRST], &bindings.texels));
    }
    geo_check(f, hg_gpu_cmd_bind(cmd, &bindings, &f->err));
    geo_check(f, hg_gpu_cmd_pipeline(cmd, &params, &f->err));
    hg_gpu_cmd_push(cmd, &push, sizeof push);
    vkCmdDispatch(hg_gpu_cmd_handle(cmd), QUERIES / 64, 1, 1);
    hg_gpu_memory_barrier(cmd);
    geo_submit(f, cmd);
    if (f->facets)
        hg_geometry_triangle_cache_done(g);
    memcpy(answers, out.mapped, QUERIES * sizeof *answers);
    hg_gpu_buffer_destroy(f->gpu, &in);
    hg_gpu_buffer_destroy(f->gpu, &out);
    hg_gpu_buffer_destroy(f->gpu, &frame_buffer);
}

// Pixels inside random triangles of the nodes that the geometry draws.
static void make_queries(struct geo *f, const struct hg_geometry *g, const struct geo_eye *e,
    struct query *queries, const struct hg_node **nodes)
{
    for (int i = 0; i < QUERIES;) {
        struct hg_draw_info info;
        const uint32_t draw = (uint32_t)geo_random(f, 0, g->draw_count);
        assert_true(hg_geometry_draw_info(g, draw, &info));
        const uint32_t triangle =
            (uint32_t)geo_random(f, 0, info.node->mesh->parts->index_count / 3);
        double p[3][3], at[3], pixel[2];
        uint32_t index[3];
        geo_corners(info.node, triangle, p, index);
        const double u = geo_random(f, 0.02, 0.96), v = geo_random(f, 0.02, 0.98 - u);
        for (int c = 0; c < 3; c++)
            at[c] = (1 - u - v) * p[0][c] + u * p[1][c] + v * p[2][c];
        if (!geo_project(e, at, pixel))
            continue;
        nodes[i] = info.node;
        queries[i++] = (struct query){draw, triangle, {(float)pixel[0], (float)pixel[1]}};
    }
}

static void check_points_of(
    struct geo *f, struct hg_geometry *g, const struct geo_eye *e, double tolerance)
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
    struct geo *f, struct hg_geometry *g, const struct geo_eye *e, double tolerance)
{
    for (int facets = 0; facets < 2; facets++) {
        f->facets = facets == 1;
        check_points_of(f, g, e, tolerance);
    }
    f->facets = false;
}

static void test_points(void **state)
{
    struct geo *f = *state;
    struct geo_scene s = geo_make_scene(f);
    geo_sync(f, s.geometry, s.scene);
    const double outside[3] = {3, 4, 9}, inside[3] = {0.2, 0.3, 0.5}, target[3] = {0, 0.5, 0};
    const struct geo_eye perspective = geo_look_at(outside, target, false);
    const struct geo_eye within = geo_look_at(inside, outside, false); // corners behind the eye
    const struct geo_eye orthographic = geo_look_at(outside, target, true);
    check_points(f, s.geometry, &perspective, 2e-5);
    check_points(f, s.geometry, &within, 1e-4);
    check_points(f, s.geometry, &orthographic, 2e-5);
    geo_destroy_scene(&s);
}

// Draws that go and come back have their own facets: while one is gone those behind it lie
// elsewhere, over what was behind them.
static void test_hidden_and_shown(void **state)
{
    struct geo *f = *state;
    struct geo_scene s = geo_make_scene(f);
    const double eye[3] = {3, 4, 9}, target[3] = {0, 0.5, 0};
    const struct geo_eye e = geo_look_at(eye, target, false);
    s.nodes[0]->mesh = geo_add_mesh(f, s.scene, 2);
    s.nodes[0]->mesh->parts->index_count = 30; // a smaller one before a larger one
    for (int i = 0; i < 3; i++) {
        s.nodes[0]->visible = i != 1;
        hg_scene_touch(s.scene, &s.nodes[0]->head);
        geo_sync(f, s.geometry, s.scene);
        assert_int_equal(s.geometry->draw_count, i == 1 ? 1 : 2);
        f->facets = true;
        check_points_of(f, s.geometry, &e, 2e-5);
        f->facets = false;
    }
    geo_destroy_scene(&s);
}

// A thousand kilometres from the scene's origin: the same precision, once the origin has moved.
static void test_large_world(void **state)
{
    struct geo *f = *state;
    struct geo_scene s = geo_make_scene(f);
    for (int i = 0; i < 2; i++) {
        s.nodes[i]->translation[0] += 1.0e6f;
        s.nodes[i]->translation[2] -= 0.75e6f;
    }
    const double eye[3] = {1.0e6 + 3, 4, -0.75e6 + 9}, target[3] = {1.0e6, 0.5, -0.75e6};
    assert_true(hg_geometry_set_origin(s.geometry, eye));
    const double near[3] = {eye[0] + 1000, eye[1], eye[2] - 1000};
    assert_false(hg_geometry_set_origin(s.geometry, near)); // the same cell: nothing moves
    geo_sync(f, s.geometry, s.scene);
    const struct geo_eye perspective = geo_look_at(eye, target, false);
    check_points(f, s.geometry, &perspective, 1e-4);
    geo_destroy_scene(&s);
}

// Vertex attributes come back as they were given.
static void test_attributes(void **state)
{
    struct geo *f = *state;
    struct geo_scene s = geo_make_scene(f);
    geo_sync(f, s.geometry, s.scene);
    static struct query queries[QUERIES];
    static struct answer answers[QUERIES];
    const double eye[3] = {3, 4, 9}, target[3] = {0, 0.5, 0};
    const struct geo_eye e = geo_look_at(eye, target, false);
    const struct hg_mesh_part *part = s.mesh->parts;
    struct hg_draw_info info;
    uint32_t draw = 0;
    for (; hg_geometry_draw_info(s.geometry, draw, &info) && info.node != s.nodes[1]; draw++)
        ;
    uint32_t corner[QUERIES], count = 0;
    for (uint32_t k = 0; k < TRIANGLES * 3; k++) { // pixels of the corners
        double p[3][3], pixel[2];
        uint32_t index[3];
        geo_corners(s.nodes[1], k / 3, p, index);
        if (!geo_project(&e, p[k % 3], pixel))
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
    geo_destroy_scene(&s);
}

int main(void)
{
    hg_log_set_sink(hg_log_sink_logfmt, (void *)(intptr_t)2);
    hg_log_set_level(HG_LOG_WARN);
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_points),
        cmocka_unit_test(test_hidden_and_shown), cmocka_unit_test(test_large_world),
        cmocka_unit_test(test_attributes)};
    return cmocka_run_group_tests(tests, geo_setup, geo_teardown);
}
