// trace_rig.c - see trace_rig.h.
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "trace_rig.h"

#include "base/alloc.h"
#include "renderer/passes/skin.h"
#include "tests/support/check.h"

#define EDGE 2e-5 // barycentrics that rounding may turn

void rig_check(struct rig *r, enum hg_status status)
{
    test_ok(status, &r->err);
}

double rig_random(struct rig *r, double low, double high)
{
    r->random = r->random * 1664525u + 1013904223u;
    return low + (high - low) * (double)(r->random >> 8) * 0x1p-24;
}

struct rig *rig_open(enum hg_trace_backend backend)
{
    struct rig *r = hg_calloc(1, sizeof *r);
    assert_non_null(r);
    const struct hg_gpu_params params = {.validation_try = true};
    rig_check(r, hg_gpu_create(&params, &r->gpu, &r->err));
    r->jobs = hg_jobs_create(2);
    assert_non_null(r->jobs);
    rig_check(r, hg_scene_create(&r->scene));
    rig_check(r, hg_geometry_create(r->gpu, NULL, &r->geometry, &r->err));
    r->random = 7;
    r->backend = backend;
    return r;
}

void rig_close(struct rig *r)
{
    const uint32_t messages = hg_gpu_validation_messages(r->gpu);
    hg_trace_destroy(r->trace);
    hg_ray_geometry_free(r->ray_geometry);
    hg_gpu_buffer_destroy(r->gpu, &r->rays);
    hg_gpu_buffer_destroy(r->gpu, &r->hits);
    hg_gpu_buffer_destroy(r->gpu, &r->blocked);
    hg_geometry_destroy(r->geometry);
    hg_scene_destroy(r->scene);
    hg_jobs_destroy(r->jobs);
    hg_gpu_destroy(r->gpu);
    hg_free(r);
    assert_int_equal(messages, 0);
}

// --- scenes --------------------------------------------------------------------------------------

static void *copy(const void *data, size_t bytes)
{
    void *p = hg_calloc(1, bytes);
    assert_non_null(p);
    memcpy(p, data, bytes);
    return p;
}

struct hg_mesh *rig_mesh(struct rig *r, const float *positions, uint32_t vertex_count,
    const uint32_t *indices, uint32_t index_count)
{
    struct hg_object *object;
    rig_check(r, hg_scene_add(r->scene, HG_OBJECT_MESH, ++r->next_id, &object));
    struct hg_mesh *mesh = (struct hg_mesh *)object;
    mesh->parts = hg_calloc(1, sizeof *mesh->parts);
    assert_non_null(mesh->parts);
    mesh->part_count = 1;
    mesh->parts->topology = HG_TOPOLOGY_TRIANGLES;
    mesh->parts->vertex_count = vertex_count;
    mesh->parts->index_count = index_count;
    mesh->parts->positions = copy(positions, vertex_count * 12ull);
    mesh->parts->indices = copy(indices, index_count * 4ull);
    return mesh;
}

struct hg_mesh *rig_soup(struct rig *r, uint32_t triangles, double size)
{
    float *positions = hg_calloc(triangles * 9ull, sizeof *positions);
    uint32_t *indices = hg_calloc(triangles * 3ull, sizeof *indices);
    assert_non_null(positions);
    assert_non_null(indices);
    for (uint32_t i = 0; i < triangles * 3; i++) {
        indices[i] = i;
        for (uint32_t c = 0; c < 3; c++)
            positions[i * 3 + c] =
                i % 3 == 0 ? (float)rig_random(r, -1.0, 1.0)
                           : positions[(i - i % 3) * 3 + c] + (float)rig_random(r, -size, size);
    }
    struct hg_mesh *mesh = rig_mesh(r, positions, triangles * 3, indices, triangles * 3);
    hg_free(positions);
    hg_free(indices);
    return mesh;
}

struct hg_material *rig_material(struct rig *r, enum hg_alpha_mode mode)
{
    struct hg_object *object;
    rig_check(r, hg_scene_add(r->scene, HG_OBJECT_MATERIAL, ++r->next_id, &object));
    struct hg_material *material = (struct hg_material *)object;
    hg_material_set_defaults(material);
    material->alpha_mode = mode;
    return material;
}

struct hg_node *rig_node(struct rig *r, struct hg_mesh *mesh, const float matrix[16])
{
    struct hg_object *object;
    rig_check(r, hg_scene_add(r->scene, HG_OBJECT_NODE, ++r->next_id, &object));
    struct hg_node *node = (struct hg_node *)object;
    node->mesh = mesh;
    node->visible = true;
    if (matrix != NULL) {
        node->has_matrix = true;
        memcpy(node->matrix, matrix, sizeof node->matrix);
    }
    return node;
}

void rig_pose(struct rig *r)
{
    struct hg_gpu_cmd *cmd;
    hg_scene_publish(r->scene);
    hg_scene_update(r->scene);
    rig_check(r, hg_geometry_sync(r->geometry, r->scene, NULL, &r->err));
    rig_check(r, hg_gpu_begin(r->gpu, &cmd, &r->err));
    rig_check(r, hg_skin_record(cmd, r->geometry, &r->err));
    rig_check(r, hg_gpu_submit_and_wait(r->gpu, cmd, &r->err));
    hg_geometry_deforms_done(r->geometry);
}

static enum hg_status try_trace(
    struct rig *r, const struct hg_ray_geometry_lens *lens, uint64_t budget_bytes)
{
    rig_check(r, hg_ray_geometry_make(r->geometry, lens, r->jobs, &r->ray_geometry, &r->err));
    if (r->trace == NULL) {
        const struct hg_trace_params params = {
            .backend = r->backend, .jobs = r->jobs, .budget_bytes = budget_bytes};
        rig_check(r, hg_trace_create(r->gpu, &params, &r->trace, &r->err));
    }
    return hg_trace_sync(r->trace, r->ray_geometry, &r->err);
}

void rig_trace(struct rig *r, const struct hg_ray_geometry_lens *lens, uint64_t budget_bytes)
{
    rig_check(r, try_trace(r, lens, budget_bytes));
}

enum hg_status rig_try(struct rig *r, uint64_t budget_bytes)
{
    const struct hg_ray_geometry_lens lens = {.px_scale = 1000.0f, .near = 0.01f};
    rig_pose(r);
    return try_trace(r, &lens, budget_bytes);
}

void rig_sync(struct rig *r)
{
    rig_check(r, rig_try(r, 0));
}

// --- waves ---------------------------------------------------------------------------------------

struct hg_gpu_ray *rig_rays(struct rig *r, uint32_t count)
{
    const uint64_t n = count;
    rig_check(r, hg_gpu_buffer_reserve(r->gpu, HG_GPU_BUFFER_READBACK,
                     n * sizeof(struct hg_gpu_ray), "rays", &r->rays, &r->err));
    rig_check(r, hg_gpu_buffer_reserve(r->gpu, HG_GPU_BUFFER_READBACK,
                     n * sizeof(struct hg_gpu_hit), "hits", &r->hits, &r->err));
    rig_check(r, hg_gpu_buffer_reserve(
                     r->gpu, HG_GPU_BUFFER_READBACK, n * 4, "blocked", &r->blocked, &r->err));
    return r->rays.mapped;
}

void rig_fill_rays(struct rig *r, uint32_t count)
{
    struct hg_gpu_ray *rays = rig_rays(r, count);
    for (uint32_t i = 0; i < count; i++) {
        float *o = &rays[i].origin_ws.x, *d = &rays[i].direction_ws.x;
        for (int c = 0; c < 3; c++) {
            o[c] = (float)rig_random(r, -3.0, 3.0);
            d[c] = (float)rig_random(r, -1.0, 1.0) - o[c];
        }
        rays[i].t_min = 0.0f;
        rays[i].t_max = i % 3 == 0 ? (float)rig_random(r, 0.5, 1.5) : 1e30f;
        rays[i].time = 1.0f;
        rays[i].mask = HG_RAY_ALL;
    }
}

static struct hg_trace_wave wave_of(const struct rig *r, uint32_t count, bool coherent)
{
    return (struct hg_trace_wave){.rays = &r->rays,
        .hits = &r->hits,
        .blocked = &r->blocked,
        .count = count,
        .coherent = coherent};
}

const struct hg_gpu_hit *rig_closest(struct rig *r, uint32_t count, bool coherent)
{
    const struct hg_trace_wave wave = wave_of(r, count, coherent);
    memset(r->hits.mapped, 0x55, count * sizeof(struct hg_gpu_hit));
    rig_check(r, hg_trace_closest(r->trace, &wave, &r->err));
    return r->hits.mapped;
}

const uint32_t *rig_blocked(struct rig *r, uint32_t count, bool coherent)
{
    const struct hg_trace_wave wave = wave_of(r, count, coherent);
    memset(r->blocked.mapped, 0x55, count * 4ull);
    rig_check(r, hg_trace_blocked(r->trace, &wave, &r->err));
    return r->blocked.mapped;
}

// --- the reference -------------------------------------------------------------------------------

static void cross(const double a[3], const double b[3], double out[3])
{
    out[0] = a[1] * b[2] - a[2] * b[1];
    out[1] = a[2] * b[0] - a[0] * b[2];
    out[2] = a[0] * b[1] - a[1] * b[0];
}

static double dot(const double a[3], const double b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static void corner(
    const double m[16], const struct hg_mesh_part *part, uint32_t index, double out[3])
{
    const float *v = part->positions + (size_t)part->indices[index] * 3;
    for (int i = 0; i < 3; i++)
        out[i] = m[i] * v[0] + m[4 + i] * v[1] + m[8 + i] * v[2] + m[12 + i];
}

// Source: Moller and Trumbore 1997, "Fast, Minimum Storage Ray/Triangle Intersection".
static void try_triangle(const double p[3][3], const struct hg_gpu_ray *ray, struct rig_hit *best)
{
    const double o[3] = {ray->origin_ws.x, ray->origin_ws.y, ray->origin_ws.z};
    const double d[3] = {ray->direction_ws.x, ray->direction_ws.y, ray->direction_ws.z};
    double e1[3], e2[3], s[3], q[3], h[3];
    for (int i = 0; i < 3; i++) {
        e1[i] = p[1][i] - p[0][i];
        e2[i] = p[2][i] - p[0][i];
        s[i] = o[i] - p[0][i];
    }
    cross(d, e2, h);
    const double det = dot(e1, h);
    if (!(fabs(det) > 0.0))
        return;
    cross(s, e1, q);
    const double u = dot(s, h) / det, v = dot(d, q) / det, t = dot(e2, q) / det;
    const double w = 1.0 - u - v, least = fmin(u, fmin(v, w));
    // How far barycentrics may be off: rounding of the origin's distance over the triangle's size.
    const double size = sqrt(fmin(dot(e1, e1), dot(e2, e2))) * fabs(det) /
                        (sqrt(dot(e1, e1) * dot(e2, e2) * dot(d, d)) + 1e-300);
    const double slack = EDGE * (1.0 + 10.0 / (size + 1e-12) * 0.05);
    if (least < -slack || t < ray->t_min * (1 - 1e-5) || t > ray->t_max * (1.0 + 1e-5))
        return;
    if (least < slack || fabs(t - ray->t_max) < 1e-5 * t || fabs(t - ray->t_min) < 1e-5 * t) {
        if (!best->hit || t < best->t * (1.0 + 1e-5))
            best->near_edge = true;
        if (least < 0.0 || t <= ray->t_min || t >= ray->t_max)
            return;
    }
    if (best->hit && t >= best->t)
        return;
    best->hit = true;
    best->t = t;
}

struct rig_hit rig_reference(const struct rig *r, const struct hg_gpu_ray *ray)
{
    struct rig_hit best = {0};
    const struct hg_object_list *nodes = &r->scene->objects[HG_OBJECT_NODE];
    for (uint32_t i = 0; i < nodes->count; i++) {
        const struct hg_node *node = (const struct hg_node *)nodes->items[i];
        const struct hg_mesh_part *part = node->mesh->parts;
        double m[16], p[3][3];
        if (part->topology != HG_TOPOLOGY_TRIANGLES)
            continue;
        hg_matrix_from_float(node->world, m);
        for (uint32_t k = 0; k + 2 < part->index_count; k += 3) {
            for (uint32_t c = 0; c < 3; c++)
                corner(m, part, k + c, p[c]);
            try_triangle((const double(*)[3])p, ray, &best);
        }
    }
    return best;
}

void rig_position(const struct rig *r, const struct hg_gpu_hit *hit, double out[3])
{
    struct hg_draw_info info;
    assert_true(hg_geometry_draw_info(r->geometry, hit->draw, &info));
    const float none[3] = {0};
    const uint32_t primitive =
        hg_geometry_source_primitive(r->geometry, hit->draw, hit->primitive, none);
    const double weights[3] = {1.0 - (double)hit->u - hit->v, hit->u, hit->v};
    double m[16], p[3];
    hg_matrix_from_float(info.node->world, m);
    assert_true(primitive < info.mesh->parts[info.part].index_count / 3);
    memset(out, 0, 3 * sizeof *out);
    for (uint32_t c = 0; c < 3; c++) {
        corner(m, &info.mesh->parts[info.part], primitive * 3 + c, p);
        for (int i = 0; i < 3; i++)
            out[i] += weights[c] * p[i];
    }
}

static void compare_one(
    struct rig *r, const struct hg_gpu_ray *ray, const struct hg_gpu_hit *hit, uint32_t *edges)
{
    const struct rig_hit want = rig_reference(r, ray);
    const bool is_hit = hit->draw != HG_HIT_NONE;
    const bool same = is_hit == want.hit && (!is_hit || fabs(hit->t - want.t) <= 1e-4 * want.t);
    if (!same && !want.near_edge)
        fail_msg("ray (%g %g %g) (%g %g %g) to %g: %s at %g, should be %s at %g",
            (double)ray->origin_ws.x, (double)ray->origin_ws.y, (double)ray->origin_ws.z,
            (double)ray->direction_ws.x, (double)ray->direction_ws.y, (double)ray->direction_ws.z,
            (double)ray->t_max, is_hit ? "hit" : "none", (double)hit->t, want.hit ? "hit" : "none",
            want.t);
    *edges += !same;
    if (!is_hit)
        return;
    double p[3], far = 0.0;
    const float *o = &ray->origin_ws.x, *d = &ray->direction_ws.x;
    rig_position(r, hit, p);
    for (int i = 0; i < 3; i++)
        far = fmax(far, fabs(p[i] - o[i] - (double)hit->t * d[i]));
    assert_true(far < 2e-4);
}

uint32_t rig_compare(struct rig *r, uint32_t count, bool coherent)
{
    const struct hg_gpu_hit *hits = rig_closest(r, count, coherent);
    const uint32_t *blocked = rig_blocked(r, count, coherent);
    const struct hg_gpu_ray *rays = r->rays.mapped;
    uint32_t edges = 0;
    for (uint32_t i = 0; i < count; i++) {
        compare_one(r, &rays[i], &hits[i], &edges);
        assert_true(blocked[i] <= 1);
        if ((hits[i].draw != HG_HIT_NONE) != (blocked[i] != 0))
            edges++;
    }
    return edges;
}

enum hg_trace_backend rig_backend(int argc, char **argv)
{
    for (int b = HG_TRACE_EMBREE; b <= HG_TRACE_KHR && argc == 2; b++)
        if (strcmp(argv[1], hg_trace_backend_name((enum hg_trace_backend)b)) == 0)
            return (enum hg_trace_backend)b;
    return HG_TRACE_AUTO;
}

bool rig_has_ray_query(void)
{
    struct hg_gpu *gpu;
    struct hg_error err;
    const struct hg_gpu_params params = {0};
    if (hg_gpu_create(&params, &gpu, &err) != HG_OK)
        return false;
    const bool has = hg_gpu_get_caps(gpu)->ray_query;
    hg_gpu_destroy(gpu);
    return has;
}
