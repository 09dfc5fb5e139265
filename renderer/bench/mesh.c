#include "renderer/bench/mesh.h"

#include <math.h>
#include <meshoptimizer.h>
#include <string.h>

#include "base/alloc.h"
#include "base/spill.h"

static enum hg_status add_part(struct hg_bench_scene *s, uint32_t vertices, uint32_t indices,
    struct hg_material *material, struct hg_mesh **out)
{
    enum hg_status status = hg_bench_scene_add(s, HG_OBJECT_MESH, out);
    if (status != HG_OK)
        return status;
    struct hg_mesh_part *part = hg_calloc(1, sizeof *part);
    if (part == NULL)
        return HG_E_NOMEM;
    (*out)->parts = part;
    (*out)->part_count = 1;
    part->topology = HG_TOPOLOGY_TRIANGLES;
    part->material = material;
    part->positions = hg_spill_calloc(vertices, 3 * sizeof *part->positions);
    part->normals = hg_spill_calloc(vertices, 3 * sizeof *part->normals);
    part->indices = hg_spill_calloc(indices, sizeof *part->indices);
    if (part->positions == NULL || part->normals == NULL || part->indices == NULL)
        return HG_E_NOMEM;
    part->vertex_count = vertices;
    part->index_count = indices;
    s->unique_triangles += indices / 3;
    return HG_OK;
}

static void set_bounds(struct hg_mesh_part *part)
{
    for (int c = 0; c < 3; c++) {
        float low = part->positions[c], high = low;
        for (uint32_t i = 1; i < part->vertex_count; i++) {
            low = fminf(low, part->positions[3 * (size_t)i + (size_t)c]);
            high = fmaxf(high, part->positions[3 * (size_t)i + (size_t)c]);
        }
        part->bounds_min[c] = low;
        part->bounds_max[c] = high;
    }
}

enum hg_status hg_bench_mesh_quad(
    struct hg_bench_scene *s, float side_m, struct hg_material *material, struct hg_mesh **out)
{
    static const float corners[4][2] = {{-0.5f, 0.5f}, {-0.5f, -0.5f}, {0.5f, -0.5f}, {0.5f, 0.5f}};
    static const uint32_t indices[6] = {0, 1, 2, 0, 2, 3};
    enum hg_status status = add_part(s, 4, 6, material, out);
    if (status != HG_OK)
        return status;
    struct hg_mesh_part *part = (*out)->parts;
    part->uv[0] = hg_calloc(4, 2 * sizeof(float));
    if (part->uv[0] == NULL)
        return HG_E_NOMEM;
    for (size_t i = 0; i < 4; i++) {
        part->positions[3 * i] = corners[i][0] * side_m;
        part->positions[3 * i + 1] = corners[i][1] * side_m;
        part->normals[3 * i + 2] = 1.0f;
        part->uv[0][2 * i] = corners[i][0] + 0.5f;
        part->uv[0][2 * i + 1] = 0.5f - corners[i][1];
    }
    memcpy(part->indices, indices, sizeof indices);
    set_bounds(part);
    return HG_OK;
}

// Across `axis`, at its low or high end, counter-clockwise from outside.
static void box_face(struct hg_mesh_part *part, const float box[2][3], uint32_t which)
{
    const uint32_t axis = which / 2, high = which % 2, u = (axis + 1) % 3, v = (axis + 2) % 3;
    const uint32_t turns[6] = {0, 1, 2, 0, 2, 3};
    for (uint32_t i = 0; i < 4; i++) {
        const uint32_t turn = high ? i : 3 - i, at = 3 * (4 * which + i);
        part->positions[at + axis] = box[high][axis];
        part->positions[at + u] = box[turn == 1 || turn == 2][u];
        part->positions[at + v] = box[turn >= 2][v];
        part->normals[at + axis] = high ? 1.0f : -1.0f;
    }
    for (uint32_t i = 0; i < 6; i++)
        part->indices[6 * which + i] = 4 * which + turns[i];
}

enum hg_status hg_bench_mesh_box(struct hg_bench_scene *s, const float box[2][3],
    struct hg_material *material, struct hg_mesh **out)
{
    const enum hg_status status = add_part(s, 24, 36, material, out);
    for (uint32_t i = 0; i < 6 && status == HG_OK; i++)
        box_face((*out)->parts, box, i);
    if (status == HG_OK)
        set_bounds((*out)->parts);
    return status;
}

// --- grids ---------------------------------------------------------------------------------------

struct grid_job {
    const struct hg_bench_grid *grid;
    struct hg_mesh_part *part;
};

static void grid_vertex(const struct hg_bench_grid *g, uint32_t x, uint32_t z, float *position)
{
    const float u = (float)x / (float)g->cells, v = (float)z / (float)g->cells;
    position[0] = u * g->side_m;
    position[1] = g->height(g->user, u, v);
    position[2] = v * g->side_m;
}

static void grid_normal(const struct hg_bench_grid *g, uint32_t x, uint32_t z, float *normal)
{
    float west[3], east[3], north[3], south[3];
    grid_vertex(g, x > 0 ? x - 1 : 0, z, west);
    grid_vertex(g, x < g->cells ? x + 1 : x, z, east);
    grid_vertex(g, x, z > 0 ? z - 1 : 0, north);
    grid_vertex(g, x, z < g->cells ? z + 1 : z, south);
    const float dx = (east[1] - west[1]) / (east[0] - west[0]);
    const float dz = (south[1] - north[1]) / (south[2] - north[2]);
    const float scale = 1.0f / sqrtf(dx * dx + dz * dz + 1.0f);
    normal[0] = -dx * scale;
    normal[1] = scale;
    normal[2] = -dz * scale;
}

static void grid_row(void *user, size_t z)
{
    const struct grid_job *job = user;
    const uint32_t n = job->grid->cells;
    for (uint32_t x = 0; x <= n; x++) {
        const size_t at = 3 * (z * (n + 1) + x);
        grid_vertex(job->grid, x, (uint32_t)z, &job->part->positions[at]);
        grid_normal(job->grid, x, (uint32_t)z, &job->part->normals[at]);
    }
    for (uint32_t x = 0; x < n && z < n; x++) {
        uint32_t *i = &job->part->indices[6 * (z * n + x)];
        const uint32_t a = (uint32_t)z * (n + 1) + x, b = a + n + 1;
        const uint32_t cell[6] = {a, b, a + 1, a + 1, b, b + 1};
        memcpy(i, cell, sizeof cell);
    }
}

enum hg_status hg_bench_mesh_grid(struct hg_bench_scene *s, const struct hg_bench_grid *grid,
    struct hg_material *material, struct hg_jobs *jobs, struct hg_mesh **out)
{
    const uint32_t n = grid->cells;
    enum hg_status status = add_part(s, (n + 1) * (n + 1), 6 * n * n, material, out);
    if (status != HG_OK)
        return status;
    struct grid_job job = {grid, (*out)->parts};
    hg_jobs_for(jobs, n + 1, grid_row, &job);
    set_bounds(job.part);
    return HG_OK;
}

// --- balls ---------------------------------------------------------------------------------------

static void ball_vertex(uint32_t ring, uint32_t segment, uint32_t rings, float *p, float *n)
{
    const float v = (float)M_PI * (float)ring / (float)rings;
    const float u = (float)M_PI * (float)(segment % (2 * rings)) / (float)rings;
    n[0] = sinf(v) * cosf(u);
    n[1] = cosf(v);
    n[2] = sinf(v) * sinf(u);
    const float lump = hg_bench_noise(7, 4.0f * n[0] + 9.0f * n[1], 4.0f * n[2] - 5.0f * n[1]) +
                       0.2f * hg_bench_noise(8, 30.0f * n[0] + 40.0f * n[1], 30.0f * n[2]);
    for (int c = 0; c < 3; c++)
        p[c] = n[c] * (0.7f + 0.25f * lump);
    p[1] += 1.0f;
}

enum hg_status hg_bench_mesh_ball(
    struct hg_bench_scene *s, uint32_t rings, struct hg_material *material, struct hg_mesh **out)
{
    const uint32_t width = 2 * rings + 1;
    enum hg_status status = add_part(s, (rings + 1) * width, 12 * rings * rings, material, out);
    if (status != HG_OK)
        return status;
    struct hg_mesh_part *part = (*out)->parts;
    uint32_t *index = part->indices;
    for (uint32_t r = 0; r <= rings; r++) {
        for (uint32_t k = 0; k < width; k++) {
            const size_t at = 3 * ((size_t)r * width + k);
            ball_vertex(r, k, rings, &part->positions[at], &part->normals[at]);
            if (r == rings || k == width - 1)
                continue;
            const uint32_t a = r * width + k, b = a + width;
            const uint32_t cell[6] = {a, a + 1, b, a + 1, b + 1, b};
            memcpy(index, cell, sizeof cell);
            index += 6;
        }
    }
    set_bounds(part);
    return HG_OK;
}

// --- fewer triangles -----------------------------------------------------------------------------

static enum hg_status thin_part(struct hg_mesh_part *part, uint32_t thin)
{
    uint32_t *indices = hg_spill_calloc(part->index_count, sizeof *indices);
    if (indices == NULL)
        return HG_E_NOMEM;
    const size_t wanted = part->index_count / 3 / thin * 3;
    const size_t left = meshopt_simplify(indices, part->indices, part->index_count, part->positions,
        part->vertex_count, 3 * sizeof *part->positions, wanted, 1.0f, 0, NULL);
    hg_free(part->indices);
    part->indices = indices;
    part->index_count = (uint32_t)left;
    return HG_OK;
}

enum hg_status hg_bench_mesh_decimate(struct hg_mesh *mesh, uint32_t thin)
{
    enum hg_status status = HG_OK;
    for (uint32_t i = 0; i < mesh->part_count && status == HG_OK; i++)
        status = thin_part(&mesh->parts[i], thin);
    return status;
}
