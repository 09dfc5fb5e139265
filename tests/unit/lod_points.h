// lod_points.h - point clouds made by formulas, for the tests of discs and their hierarchies.
#ifndef HG_TESTS_LOD_POINTS_H
#define HG_TESTS_LOD_POINTS_H

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/alloc.h"
#include "renderer/scene/scene.h"

static inline float points_random(uint32_t *seed)
{
    *seed = *seed * 1664525u + 1013904223u;
    return (float)(*seed >> 8) * 0x1p-24f;
}

// All at the origin, without normals and colours.
static inline struct hg_mesh_part points_make(uint32_t count)
{
    struct hg_mesh_part p = {
        .topology = HG_TOPOLOGY_POINTS, .vertex_count = count, .index_count = count};
    p.indices = hg_calloc(count, 4);
    p.positions = hg_calloc(count, 12);
    if (p.indices == NULL || p.positions == NULL)
        abort();
    for (uint32_t i = 0; i < count; i++)
        p.indices[i] = i;
    return p;
}

static inline void points_finish(struct hg_mesh_part *p)
{
    hg_free(p->indices);
    hg_free(p->positions);
    hg_free(p->normals);
    hg_free(p->colors);
    memset(p, 0, sizeof *p);
}

static inline void points_normals(struct hg_mesh_part *p, float x, float y, float z)
{
    p->normals = hg_calloc(p->vertex_count, 12);
    if (p->normals == NULL)
        abort();
    for (uint32_t i = 0; i < p->vertex_count; i++) {
        p->normals[i * 3] = x;
        p->normals[i * 3 + 1] = y;
        p->normals[i * 3 + 2] = z;
    }
}

// side x side points of the plane y = 0 about the origin, with normals.
static inline struct hg_mesh_part points_grid(uint32_t side, float step)
{
    struct hg_mesh_part p = points_make(side * side);
    for (uint32_t i = 0; i < side * side; i++) {
        p.positions[i * 3] = ((float)(i % side) - 0.5f * (float)(side - 1)) * step;
        p.positions[i * 3 + 2] = ((float)(i / side) - 0.5f * (float)(side - 1)) * step;
    }
    points_normals(&p, 0, 1, 0);
    return p;
}

// Random points of the square of 2 m in the plane y = 0, with normals; uneven: several times as
// many on the right as on the left.
static inline struct hg_mesh_part points_plane(uint32_t count, bool uneven)
{
    struct hg_mesh_part p = points_make(count);
    uint32_t seed = 17;
    for (uint32_t i = 0; i < count; i++) {
        const float x = points_random(&seed);
        p.positions[i * 3] = uneven ? 2.0f * powf(x, 0.6f) - 1.0f : 2.0f * x - 1.0f;
        p.positions[i * 3 + 2] = 2.0f * points_random(&seed) - 1.0f;
    }
    points_normals(&p, 0, 1, 0);
    return p;
}

// Random points of the unit sphere.
static inline struct hg_mesh_part points_sphere(uint32_t count, bool normals)
{
    struct hg_mesh_part p = points_make(count);
    uint32_t seed = 3;
    for (uint32_t i = 0; i < count; i++) {
        const float y = 2.0f * points_random(&seed) - 1.0f, r = sqrtf(1.0f - y * y);
        const float a = 6.2831853f * points_random(&seed);
        const float at[3] = {r * cosf(a), y, r * sinf(a)};
        memcpy(p.positions + i * 3, at, sizeof at);
    }
    if (normals) {
        p.normals = hg_calloc(count, 12);
        if (p.normals == NULL)
            abort();
        memcpy(p.normals, p.positions, (size_t)count * 12);
    }
    return p;
}

#endif
