// Normals of morph targets that state none (mesh_tools.h).
#include <stdlib.h>
#include <string.h>

#include "base/alloc.h"
#include "renderer/scene/mesh_tools.h"
#include "renderer/scene/xform.h"

struct place {   // of vertices that are one point of one smooth surface
    float at[6]; // position, normal
    uint32_t vertex;
};

static int compare_places(const void *a, const void *b)
{
    const struct place *x = a, *y = b;
    for (int i = 0; i < 6; i++)
        if (x->at[i] < y->at[i] || x->at[i] > y->at[i])
            return x->at[i] < y->at[i] ? -1 : 1;
    return 0;
}

// group [vertex_count]: a number for each place.
static bool group_vertices(const struct hg_mesh_part *part, uint32_t *group)
{
    struct place *places = hg_calloc(part->vertex_count, sizeof *places);
    uint32_t last = 0;
    if (!places)
        return false;
    for (uint32_t v = 0; v < part->vertex_count; v++) {
        memcpy(places[v].at, part->positions + (size_t)v * 3, 3 * sizeof(float));
        memcpy(places[v].at + 3, part->normals + (size_t)v * 3, 3 * sizeof(float));
        places[v].vertex = v;
    }
    qsort(places, part->vertex_count, sizeof *places, compare_places);
    for (uint32_t i = 0; i < part->vertex_count; i++) {
        last += i > 0 && compare_places(&places[i - 1], &places[i]) != 0;
        group[places[i].vertex] = last;
    }
    hg_free(places);
    return true;
}

static void corner_at(const struct hg_mesh_part *part, const float *delta, uint32_t v, float out[3])
{
    for (uint32_t i = 0; i < 3; i++)
        out[i] = part->positions[(size_t)v * 3 + i] + (delta ? delta[(size_t)v * 3 + i] : 0);
}

// Sums of triangles' normals by group, weighted by their areas, then of length 1; delta may be
// NULL.
static void sum_normals(
    const struct hg_mesh_part *part, const float *delta, const uint32_t *group, float *sums)
{
    for (uint32_t t = 0; t + 2 < part->index_count; t += 3) {
        const uint32_t *corner = part->indices + t;
        float a[3], b[3], c[3], n[3];
        corner_at(part, delta, corner[0], a);
        corner_at(part, delta, corner[1], b);
        corner_at(part, delta, corner[2], c);
        for (int i = 0; i < 3; i++) {
            b[i] -= a[i];
            c[i] -= a[i];
        }
        hg_cross3(b, c, n);
        for (int k = 0; k < 3; k++)
            for (int i = 0; i < 3; i++)
                sums[(size_t)group[corner[k]] * 3 + i] += n[i];
    }
    for (uint32_t v = 0; v < part->vertex_count; v++)
        hg_normalize3(sums + (size_t)v * 3);
}

enum hg_status hg_part_make_target_normals(
    const struct hg_mesh_part *part, const float *positions, float *normals)
{
    const size_t count = part->vertex_count;
    uint32_t *group = hg_calloc(count, sizeof *group);
    float *before = hg_calloc(count, 3 * sizeof *before),
          *after = hg_calloc(count, 3 * sizeof *after);
    const bool ok = group && before && after && group_vertices(part, group);
    if (ok) {
        sum_normals(part, NULL, group, before);
        sum_normals(part, positions, group, after);
    }
    for (size_t v = 0; ok && v < count; v++) {
        const float *from = part->normals + v * 3;
        const float *a = before + (size_t)group[v] * 3, *b = after + (size_t)group[v] * 3;
        float n[3];
        for (int i = 0; i < 3; i++)
            n[i] = from[i] + b[i] - a[i];
        const bool sound = hg_normalize3(n);
        for (int i = 0; i < 3; i++)
            normals[v * 3 + i] = sound ? n[i] - from[i] : 0;
    }
    hg_free(group);
    hg_free(before);
    hg_free(after);
    return ok ? HG_OK : HG_E_NOMEM;
}
