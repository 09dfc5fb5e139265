// lod_meshes.h - mesh parts made by formulas, for the tests of cluster hierarchies.
#ifndef HG_TESTS_LOD_MESHES_H
#define HG_TESTS_LOD_MESHES_H

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/alloc.h"
#include "renderer/scene/scene.h"

static inline struct hg_mesh_part lod_part(uint32_t vertices, uint32_t indices)
{
    struct hg_mesh_part p = {.vertex_count = vertices, .index_count = indices};
    p.indices = hg_calloc(indices, 4);
    p.positions = hg_calloc(vertices, 12);
    p.normals = hg_calloc(vertices, 12);
    p.uv[0] = hg_calloc(vertices, 8);
    if (p.indices == NULL || p.positions == NULL || p.normals == NULL || p.uv[0] == NULL)
        abort();
    return p;
}

static inline void lod_part_finish(struct hg_mesh_part *p)
{
    hg_free(p->indices);
    hg_free(p->positions);
    hg_free(p->normals);
    hg_free(p->tangents);
    hg_free(p->uv[0]);
    hg_free(p->uv[1]);
    hg_free(p->colors);
    memset(p, 0, sizeof *p);
}

static inline void lod_grid_indices(struct hg_mesh_part *p, uint32_t nx, uint32_t ny)
{
    uint32_t n = 0;
    for (uint32_t y = 0; y < ny; y++) {
        for (uint32_t x = 0; x < nx; x++) {
            const uint32_t a = y * (nx + 1) + x, b = a + 1, c = a + nx + 1, d = c + 1;
            const uint32_t t[6] = {a, c, b, b, c, d};
            memcpy(p->indices + n, t, sizeof t);
            n += 6;
        }
    }
}

// Heights over a square of one metre per cell: open border, hills of several sizes.
static inline struct hg_mesh_part lod_terrain(uint32_t cells)
{
    struct hg_mesh_part p = lod_part((cells + 1) * (cells + 1), cells * cells * 6);
    for (uint32_t i = 0; i < p.vertex_count; i++) {
        const float x = (float)(i % (cells + 1)), y = (float)(i / (cells + 1));
        float h = 0.0f, dx = 0.0f, dy = 0.0f;
        for (int o = 0; o < 4; o++) {
            const float f = 0.05f * (float)(1 << o), a = 4.0f / (float)(1 << o);
            h += a * sinf(f * x + (float)o) * cosf(f * y * 1.1f);
            dx += a * f * cosf(f * x + (float)o) * cosf(f * y * 1.1f);
            dy -= a * f * 1.1f * sinf(f * x + (float)o) * sinf(f * y * 1.1f);
        }
        const float l = 1.0f / sqrtf(dx * dx + dy * dy + 1.0f);
        const float at[3] = {x, h, y}, normal[3] = {-dx * l, l, -dy * l};
        memcpy(p.positions + i * 3, at, sizeof at);
        memcpy(p.normals + i * 3, normal, sizeof normal);
        p.uv[0][i * 2] = x / (float)cells;
        p.uv[0][i * 2 + 1] = y / (float)cells;
    }
    lod_grid_indices(&p, cells, cells);
    return p;
}

// Closed torus with uv seams, tangents and bumps; `stretch` scales it.
static inline struct hg_mesh_part lod_torus(uint32_t nx, uint32_t ny, float stretch)
{
    struct hg_mesh_part p = lod_part((nx + 1) * (ny + 1), nx * ny * 6);
    p.tangents = hg_calloc(p.vertex_count, 16);
    if (p.tangents == NULL)
        abort();
    for (uint32_t i = 0; i < p.vertex_count; i++) {
        const uint32_t x = i % (nx + 1), y = i / (nx + 1);
        const float u = (float)x / (float)nx, v = (float)y / (float)ny;
        // The seam's two sides must be the same to the last bit.
        const float a = 6.2831853f * (float)(x % nx) / (float)nx;
        const float b = 6.2831853f * (float)(y % ny) / (float)ny;
        const float r = 0.4f + 0.03f * sinf(7.0f * a) * cosf(5.0f * b);
        const float at[3] = {stretch * (1.0f + r * cosf(b)) * cosf(a), stretch * r * sinf(b),
            stretch * (1.0f + r * cosf(b)) * sinf(a)};
        const float normal[3] = {cosf(b) * cosf(a), sinf(b), cosf(b) * sinf(a)};
        const float tangent[4] = {-sinf(a), 0.0f, cosf(a), 1.0f};
        memcpy(p.positions + i * 3, at, sizeof at);
        memcpy(p.normals + i * 3, normal, sizeof normal);
        memcpy(p.tangents + i * 4, tangent, sizeof tangent);
        p.uv[0][i * 2] = u * 4.0f;
        p.uv[0][i * 2 + 1] = v;
    }
    lod_grid_indices(&p, nx, ny);
    return p;
}

static inline uint32_t lod_random(uint32_t *state)
{
    *state = *state * 1664525u + 1013904223u;
    return *state >> 8;
}

static inline float lod_random_unit(uint32_t *state)
{
    return (float)lod_random(state) / 16777216.0f;
}

// Triangles that share nothing, flat normals, colours and a second uv set.
static inline struct hg_mesh_part lod_soup(uint32_t triangles)
{
    struct hg_mesh_part p = lod_part(triangles * 3, triangles * 3);
    uint32_t state = 7;
    p.uv[1] = hg_calloc(p.vertex_count, 8);
    p.colors = hg_calloc(p.vertex_count, 16);
    if (p.uv[1] == NULL || p.colors == NULL)
        abort();
    for (uint32_t i = 0; i < p.vertex_count; i++) {
        const uint32_t t = i / 3;
        for (uint32_t k = 0; k < 3; k++) {
            const float base = (float)((t >> (5 * k)) & 31);
            p.positions[i * 3 + k] = base + 0.8f * lod_random_unit(&state);
        }
        p.normals[i * 3 + t % 3] = t & 1 ? 1.0f : -1.0f;
        for (uint32_t k = 0; k < 2; k++) {
            p.uv[0][i * 2 + k] = lod_random_unit(&state);
            p.uv[1][i * 2 + k] = 8.0f * lod_random_unit(&state);
        }
        for (uint32_t k = 0; k < 4; k++)
            p.colors[i * 4 + k] = lod_random_unit(&state);
        p.indices[i] = i;
    }
    return p;
}

// A closed box of cells with flat normals: every edge of a cell is a seam of normals.
static inline struct hg_mesh_part lod_flat(uint32_t nx, uint32_t ny)
{
    struct hg_mesh_part smooth = lod_torus(nx, ny, 3.0f);
    struct hg_mesh_part p = lod_part(smooth.index_count, smooth.index_count);
    for (uint32_t i = 0; i < p.index_count; i += 3) {
        float *q[3], e[2][3], n[3];
        for (uint32_t k = 0; k < 3; k++) {
            p.indices[i + k] = i + k;
            q[k] = p.positions + (i + k) * 3;
            memcpy(q[k], smooth.positions + smooth.indices[i + k] * 3, 12);
        }
        for (int k = 0; k < 3; k++) {
            e[0][k] = q[1][k] - q[0][k];
            e[1][k] = q[2][k] - q[0][k];
        }
        n[0] = e[0][1] * e[1][2] - e[0][2] * e[1][1];
        n[1] = e[0][2] * e[1][0] - e[0][0] * e[1][2];
        n[2] = e[0][0] * e[1][1] - e[0][1] * e[1][0];
        const float l = sqrtf(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
        for (uint32_t k = 0; k < 9; k++)
            p.normals[i * 3 + k] = l > 0.0f ? n[k % 3] / l : 0.0f;
    }
    lod_part_finish(&smooth);
    return p;
}

#endif
