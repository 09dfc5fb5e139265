// skinned_lod.c - see skinned_lod.h. Levels are made by meshoptimizer (Garland and Heckbert 1997)
// and measured here.
#include "renderer/lod/skinned_lod.h"

#include <math.h>
#include <meshoptimizer.h>
#include <stdlib.h>
#include <string.h>

#include "base/alloc.h"
#include "renderer/lod/internal.h"

#define LEAST_TRIANGLES 64u // of a level
#define ENOUGH          0.85f
#define CELLS_MOST      96u   // of a grid, along a side
#define NORMAL_WEIGHT   0.35f // as of lod.h
#define UV_WEIGHT       0.5f
#define BETWEEN         1.2f // what is not a sample may be a little farther away

// ---- triangles of a level by place --------------------------------------------------------------

struct grid {
    const float *positions;
    const uint32_t *triangles; // [count * 3]
    uint32_t count;
    float min[3], side;
    uint32_t size[3];
    uint32_t *starts, *items; // of each cell
};

static uint32_t cell_of(const struct grid *g, int axis, float at)
{
    const float c = (at - g->min[axis]) / g->side;
    return !(c > 0.0f) ? 0 : c >= (float)g->size[axis] ? g->size[axis] - 1 : (uint32_t)c;
}

// Cells that the box of a triangle touches.
static void cells_of(const struct grid *g, uint32_t t, uint32_t low[3], uint32_t high[3])
{
    for (int k = 0; k < 3; k++) {
        float min = INFINITY, max = -INFINITY;
        for (uint32_t i = 0; i < 3; i++) {
            const float at = g->positions[(size_t)g->triangles[t * 3 + i] * 3 + (size_t)k];
            min = fminf(min, at);
            max = fmaxf(max, at);
        }
        low[k] = cell_of(g, k, min);
        high[k] = cell_of(g, k, max);
    }
}

static size_t cell_at(const struct grid *g, uint32_t x, uint32_t y, uint32_t z)
{
    return ((size_t)z * g->size[1] + y) * g->size[0] + x;
}

// Counts (fill false) or lists the triangles of each cell.
static void sort_in(struct grid *g, bool fill)
{
    for (uint32_t t = 0; t < g->count; t++) {
        uint32_t a[3], b[3];
        cells_of(g, t, a, b);
        for (uint32_t z = a[2]; z <= b[2]; z++)
            for (uint32_t y = a[1]; y <= b[1]; y++)
                for (uint32_t x = a[0]; x <= b[0]; x++) {
                    uint32_t *start = &g->starts[cell_at(g, x, y, z)];
                    if (fill)
                        g->items[(*start)++] = t;
                    else
                        start[1]++;
                }
    }
}

static void set_cells(struct grid *g, const struct hg_mesh_part *part)
{
    float longest = 0.0f, size[3];
    for (int k = 0; k < 3; k++) {
        float min = INFINITY, max = -INFINITY;
        for (size_t v = 0; v < part->vertex_count; v++) {
            min = fminf(min, part->positions[v * 3 + (size_t)k]);
            max = fmaxf(max, part->positions[v * 3 + (size_t)k]);
        }
        g->min[k] = min;
        size[k] = max - min;
        longest = fmaxf(longest, size[k]);
    }
    // About one triangle per cell of the surface.
    const float cells = fminf((float)CELLS_MOST, fmaxf(1.0f, sqrtf(0.5f * (float)g->count)));
    g->side = longest > 0.0f ? longest / cells : 1.0f;
    for (int k = 0; k < 3; k++)
        g->size[k] = (uint32_t)(size[k] / g->side) + 1;
}

static enum hg_status open_grid(struct grid *g, const struct hg_mesh_part *part)
{
    set_cells(g, part);
    const size_t cells = (size_t)g->size[0] * g->size[1] * g->size[2];
    g->starts = hg_calloc(cells + 2, sizeof *g->starts);
    if (g->starts == NULL)
        return HG_E_NOMEM;
    sort_in(g, false);
    for (size_t i = 0; i < cells; i++)
        g->starts[i + 1] += g->starts[i];
    g->items = hg_calloc(g->starts[cells], sizeof *g->items);
    if (g->items == NULL)
        return HG_E_NOMEM;
    sort_in(g, true);
    memmove(g->starts + 1, g->starts, cells * sizeof *g->starts); // filling moved them on
    g->starts[0] = 0;
    return HG_OK;
}

static void close_grid(struct grid *g)
{
    hg_free(g->starts);
    hg_free(g->items);
}

struct place {
    float distance2, weights[3];
    uint32_t triangle;
};

static void look_in(const struct grid *g, size_t cell, const float at[4], struct place *best)
{
    for (uint32_t i = g->starts[cell]; i < g->starts[cell + 1]; i++) {
        const uint32_t *t = g->triangles + (size_t)g->items[i] * 3;
        float w[3];
        const float d = hg_lod_closest(at, g->positions + (size_t)t[0] * 3,
            g->positions + (size_t)t[1] * 3, g->positions + (size_t)t[2] * 3, w);
        if (d < best->distance2 || (d == best->distance2 && g->items[i] < best->triangle)) {
            best->distance2 = d;
            best->triangle = g->items[i];
            memcpy(best->weights, w, sizeof best->weights);
        }
    }
}

// The cells of ring `r` around a cell; false: all of them lie outside.
static bool look_around(const struct grid *g, const uint32_t at[3], uint32_t r,
    const float point[4], struct place *best)
{
    bool inside = false;
    int64_t low[3], high[3];
    for (int k = 0; k < 3; k++) {
        low[k] = (int64_t)at[k] - r;
        high[k] = (int64_t)at[k] + r;
        inside = inside || low[k] >= 0 || high[k] < (int64_t)g->size[k];
    }
    for (int64_t z = low[2]; z <= high[2]; z++)
        for (int64_t y = low[1]; y <= high[1]; y++) {
            const bool face = z == low[2] || z == high[2] || y == low[1] || y == high[1];
            const int64_t step = face || r == 0 ? 1 : high[0] - low[0];
            for (int64_t x = low[0]; x <= high[0]; x += step)
                if (x >= 0 && y >= 0 && z >= 0 && x < g->size[0] && y < g->size[1] &&
                    z < g->size[2])
                    look_in(g, cell_at(g, (uint32_t)x, (uint32_t)y, (uint32_t)z), point, best);
        }
    return inside;
}

static struct place nearest(const struct grid *g, const float point[3])
{
    struct place best = {.distance2 = INFINITY, .triangle = UINT32_MAX};
    const float at[4] = {point[0], point[1], point[2], 0.0f};
    uint32_t cell[3];
    for (int k = 0; k < 3; k++)
        cell[k] = cell_of(g, k, point[k]);
    for (uint32_t r = 0;; r++) {
        const float reach = ((float)r - 1.0f) * g->side; // nothing nearer is in this ring
        if (r > 0 && best.triangle != UINT32_MAX && reach > 0.0f && reach * reach > best.distance2)
            break;
        if (!look_around(g, cell, r, at, &best))
            break;
    }
    return best;
}

// ---- the error of a level -----------------------------------------------------------------------

struct measure {
    const struct hg_mesh_part *part;
    uint32_t target_count;
    const struct grid *grid;
    struct hg_skinned_lod_level *level;
    struct candidate *candidates; // [vertex_count]
    const uint32_t *shared;       // [vertex_count] how many are at its position
};

struct candidate { // a sample, by what is to be expected of it
    float weight;
    uint32_t triangle; // of the level
    struct hg_skinned_lod_sample sample;
};

static float gap_of(const float *values, uint32_t n,
    const struct hg_skinned_lod_sample *s) // length of the difference
{
    float sum = 0.0f;
    for (uint32_t k = 0; k < n; k++) {
        float v = values[(size_t)s->vertex * n + k];
        for (int i = 0; i < 3; i++)
            v -= s->weights[i] * values[(size_t)s->corners[i] * n + k];
        sum += v * v;
    }
    return sqrtf(sum);
}

static float joint_weight(const struct hg_mesh_part *part, uint32_t vertex, uint32_t joint)
{
    const size_t n = (size_t)part->joint_sets * 4;
    float sum = 0.0f;
    for (size_t k = vertex * n; k < (vertex + 1) * n; k++)
        sum += part->joints[k] == joint ? part->weights[k] : 0.0f;
    return sum;
}

// How much a vertex and its place differ in what moves them, 0..2.
static float skin_gap(const struct hg_mesh_part *part, const struct hg_skinned_lod_sample *s)
{
    const size_t n = (size_t)part->joint_sets * 4;
    float gap = 0.0f;
    for (int i = -1; i < 3; i++) {
        const uint32_t v = i < 0 ? s->vertex : s->corners[i];
        for (size_t k = v * n; k < (v + 1) * n; k++) {
            if (part->weights[k] == 0.0f)
                continue;
            float difference = joint_weight(part, s->vertex, part->joints[k]);
            for (int c = 0; c < 3; c++)
                difference -= s->weights[c] * joint_weight(part, s->corners[c], part->joints[k]);
            gap = fmaxf(gap, fabsf(difference));
        }
    }
    return gap;
}

static int by_weight(const void *a, const void *b)
{
    const struct candidate *x = a, *y = b;
    if (x->weight != y->weight)
        return x->weight > y->weight ? -1 : 1;
    return x->sample.vertex < y->sample.vertex ? -1 : x->sample.vertex > y->sample.vertex;
}

// The first of each triangle of the level, so that they lie in all places.
static enum hg_status keep_samples(struct measure *m)
{
    struct hg_skinned_lod_level *l = m->level;
    if (m->part->joints == NULL)
        return HG_OK;
    qsort(m->candidates, m->part->vertex_count, sizeof *m->candidates, by_weight);
    uint8_t *taken = hg_calloc(m->grid->count, 1);
    l->samples = hg_calloc(HG_SKINNED_LOD_SAMPLES, sizeof *l->samples);
    for (uint32_t i = 0; taken != NULL && l->samples != NULL && i < m->part->vertex_count &&
                         l->sample_count < HG_SKINNED_LOD_SAMPLES;
         i++) {
        if (taken[m->candidates[i].triangle])
            continue;
        taken[m->candidates[i].triangle] = 1;
        l->samples[l->sample_count++] = m->candidates[i].sample;
    }
    const bool done = taken != NULL && l->samples != NULL;
    hg_free(taken);
    return done ? HG_OK : HG_E_NOMEM;
}

// Mean edge of the level and metres of surface per uv.
static void scales(const struct measure *m, float *edge, float *per_uv)
{
    const struct hg_mesh_part *p = m->part;
    double edges = 0.0, uvs = 0.0;
    for (uint32_t i = 0; i < m->grid->count * 3; i++) {
        const uint32_t a = m->grid->triangles[i];
        const uint32_t b = m->grid->triangles[i % 3 == 2 ? i - 2 : i + 1];
        double length2 = 0.0, uv2 = 0.0;
        for (size_t k = 0; k < 3; k++) {
            const double d = (double)p->positions[a * 3ul + k] - (double)p->positions[b * 3ul + k];
            length2 += d * d;
        }
        for (size_t k = 0; p->uv[0] != NULL && k < 2; k++) {
            const double d = (double)p->uv[0][a * 2ul + k] - (double)p->uv[0][b * 2ul + k];
            uv2 += d * d;
        }
        edges += sqrt(length2);
        uvs += sqrt(uv2);
    }
    *edge = (float)(edges / (m->grid->count * 3.0));
    *per_uv = uvs > 0.0 ? (float)(edges / uvs) : 0.0f;
}

static void measure_vertices(struct measure *m)
{
    const struct hg_mesh_part *p = m->part;
    struct hg_skinned_lod_level *l = m->level;
    double normals = 0.0, uvs = 0.0;
    float edge, per_uv;
    scales(m, &edge, &per_uv);
    const float reach = // of the part: a joint moves what is near to it less than that
        m->grid->side * (float)(m->grid->size[0] + m->grid->size[1] + m->grid->size[2]);
    for (uint32_t v = 0; v < p->vertex_count; v++) {
        const struct place at = nearest(m->grid, p->positions + (size_t)v * 3);
        struct hg_skinned_lod_sample s = {.vertex = v};
        for (uint32_t i = 0; i < 3; i++) {
            s.corners[i] = m->grid->triangles[at.triangle * 3 + i];
            s.weights[i] = at.weights[i];
        }
        const float distance = sqrtf(at.distance2);
        l->error = fmaxf(l->error, distance);
        for (uint32_t t = 0; l->morph_errors != NULL && t < m->target_count; t++)
            if (p->targets[t].positions != NULL)
                l->morph_errors[t] =
                    fmaxf(l->morph_errors[t], gap_of(p->targets[t].positions, 3, &s));
        const bool alone = m->shared[v] == 1; // which side of a seam is near says nothing
        const float turned = alone && p->normals != NULL ? gap_of(p->normals, 3, &s) : 0.0f;
        const float moved = alone && p->uv[0] != NULL ? gap_of(p->uv[0], 2, &s) : 0.0f;
        normals += (double)turned * (double)turned;
        uvs += (double)moved * (double)moved;
        if (p->joints != NULL)
            m->candidates[v] =
                (struct candidate){skin_gap(p, &s) + distance / reach, at.triangle, s};
    }
    const float looks = sqrtf((float)(normals / p->vertex_count)) * NORMAL_WEIGHT * edge;
    const float slide = sqrtf((float)(uvs / p->vertex_count)) * UV_WEIGHT * per_uv;
    l->error = fmaxf(l->error, fmaxf(looks, slide));
}

// How many vertices there are at the position of each.
static enum hg_status count_shared(const struct hg_mesh_part *part, uint32_t *shared)
{
    const uint32_t n = part->vertex_count, whole = (n + 2) / 3 * 3; // it asks for triangles
    const struct meshopt_Stream positions = {part->positions, 12, 12};
    uint32_t *first = hg_calloc(n, sizeof *first), *uses = hg_calloc(n, sizeof *uses);
    uint32_t *all = hg_calloc(whole, sizeof *all);
    const bool taken = first != NULL && uses != NULL && all != NULL;
    if (taken) {
        for (uint32_t v = 0; v < n; v++)
            all[v] = v;
        meshopt_generateVertexRemapMulti(first, all, whole, n, &positions, 1);
        for (uint32_t v = 0; v < n; v++)
            uses[first[v]]++;
        for (uint32_t v = 0; v < n; v++)
            shared[v] = uses[first[v]];
    }
    hg_free(first);
    hg_free(uses);
    hg_free(all);
    return taken ? HG_OK : HG_E_NOMEM;
}

static enum hg_status measure_level(const struct hg_mesh_part *part, uint32_t target_count,
    const uint32_t *triangles, const uint32_t *shared, struct hg_skinned_lod_level *level)
{
    struct grid grid = {
        .positions = part->positions, .triangles = triangles, .count = level->count};
    struct measure m = {.part = part,
        .target_count = target_count,
        .grid = &grid,
        .level = level,
        .shared = shared};
    enum hg_status status = open_grid(&grid, part);
    m.candidates = hg_calloc(part->vertex_count, sizeof *m.candidates);
    if (part->targets != NULL && target_count > 0)
        level->morph_errors = hg_calloc(target_count, sizeof *level->morph_errors);
    if (m.candidates == NULL ||
        (part->targets != NULL && target_count > 0 && level->morph_errors == NULL))
        status = HG_E_NOMEM;
    if (status == HG_OK) {
        measure_vertices(&m);
        status = keep_samples(&m);
    }
    hg_free(m.candidates);
    close_grid(&grid);
    return status;
}

// ---- building -----------------------------------------------------------------------------------

// For every triangle of the levels the part's triangle nearest to its middle, by place.
static enum hg_status find_sources(const struct hg_mesh_part *part, struct hg_skinned_lod_levels *l)
{
    struct grid grid = {
        .positions = part->positions, .triangles = part->indices, .count = part->index_count / 3};
    l->sources = hg_calloc(l->index_count / 3, sizeof *l->sources);
    enum hg_status status = l->sources != NULL ? open_grid(&grid, part) : HG_E_NOMEM;
    for (uint32_t t = 0; status == HG_OK && t < l->index_count / 3; t++) {
        float middle[3] = {0};
        for (size_t i = 0; i < 3; i++)
            for (size_t k = 0; k < 3; k++)
                middle[k] += part->positions[l->indices[t * 3 + i] * 3ul + k] / 3.0f;
        l->sources[t] = nearest(&grid, middle).triangle;
    }
    close_grid(&grid);
    return status;
}

static enum hg_status add_level(const struct hg_mesh_part *part, uint32_t target_count,
    const uint32_t *from, uint32_t from_count, const uint32_t *shared,
    struct hg_skinned_lod_levels *l)
{
    struct hg_skinned_lod_level *level = &l->items[l->count];
    uint32_t *to = l->indices + l->index_count;
    const size_t wanted = from_count / 6 * 3;
    const size_t left = meshopt_simplify(to, from, from_count, part->positions, part->vertex_count,
        3 * sizeof *part->positions, wanted, 1.0f, 0, NULL);
    if (left / 3 < LEAST_TRIANGLES || (float)left > ENOUGH * (float)from_count)
        return HG_E_NOTFOUND; // as coarse as it gets
    level->first = part->index_count / 3 + l->index_count / 3;
    level->count = (uint32_t)(left / 3);
    l->index_count += (uint32_t)left;
    l->count++;
    return measure_level(part, target_count, to, shared, level);
}

enum hg_status hg_skinned_lod_build(
    const struct hg_mesh_part *part, uint32_t target_count, struct hg_skinned_lod_levels *out)
{
    const bool posed = part->joints != NULL || (part->targets != NULL && target_count > 0);
    *out = (struct hg_skinned_lod_levels){0};
    if (!posed || part->topology != HG_TOPOLOGY_TRIANGLES ||
        part->index_count / 3 < HG_SKINNED_LOD_FROM)
        return HG_OK;
    // meshopt_simplify may write as much as it reads.
    out->indices = hg_calloc((size_t)part->index_count * 2, sizeof *out->indices);
    uint32_t *shared = hg_calloc(part->vertex_count, sizeof *shared);
    enum hg_status status = out->indices != NULL && shared != NULL ? HG_OK : HG_E_NOMEM;
    if (status == HG_OK)
        status = count_shared(part, shared);
    const uint32_t *from = part->indices;
    uint32_t count = part->index_count;
    while (status == HG_OK && out->count < HG_SKINNED_LOD_LEVELS) {
        status = add_level(part, target_count, from, count, shared, out);
        if (status == HG_OK) {
            count = out->items[out->count - 1].count * 3;
            from = out->indices + out->index_count - count;
        }
    }
    hg_free(shared);
    if (status == HG_E_NOTFOUND)
        status = HG_OK;
    if (status == HG_OK && out->count > 0)
        status = find_sources(part, out);
    if (status != HG_OK || out->count == 0)
        hg_skinned_lod_finish(out);
    return status;
}

void hg_skinned_lod_finish(struct hg_skinned_lod_levels *l)
{
    for (uint32_t i = 0; i < HG_SKINNED_LOD_LEVELS; i++) {
        hg_free(l->items[i].morph_errors);
        hg_free(l->items[i].samples);
    }
    hg_free(l->indices);
    hg_free(l->sources);
    *l = (struct hg_skinned_lod_levels){0};
}

// ---- poses --------------------------------------------------------------------------------------

static void pose_vertex(const struct hg_mesh_part *part, const struct hg_skinned_lod_pose *pose,
    uint32_t vertex, float weight, float sum[3])
{
    const size_t n = (size_t)part->joint_sets * 4;
    const float *p = part->positions + (size_t)vertex * 3;
    for (size_t k = vertex * n; k < (vertex + 1) * n; k++) {
        const float w = weight * part->weights[k];
        if (w == 0.0f || part->joints[k] >= pose->joint_count)
            continue;
        const float *m = pose->matrices[part->joints[k]].m;
        for (int c = 0; c < 3; c++)
            sum[c] += w * (m[c] * p[0] + m[3 + c] * p[1] + m[6 + c] * p[2] + m[9 + c]);
    }
}

static float posed_gap(const struct hg_mesh_part *part, const struct hg_skinned_lod_pose *pose,
    const struct hg_skinned_lod_sample *s)
{
    float gap[3] = {0};
    pose_vertex(part, pose, s->vertex, 1.0f, gap);
    for (int i = 0; i < 3; i++)
        pose_vertex(part, pose, s->corners[i], -s->weights[i], gap);
    return sqrtf(gap[0] * gap[0] + gap[1] * gap[1] + gap[2] * gap[2]);
}

void hg_skinned_lod_errors(const struct hg_skinned_lod_levels *levels,
    const struct hg_mesh_part *part, const struct hg_skinned_lod_pose *pose,
    float errors[HG_SKINNED_LOD_LEVELS])
{
    float last = 0.0f;
    for (uint32_t i = 0; i < levels->count; i++) {
        const struct hg_skinned_lod_level *l = &levels->items[i];
        float morphs = 0.0f;
        for (uint32_t t = 0;
             pose->weights != NULL && l->morph_errors != NULL && t < pose->target_count; t++)
            morphs += fabsf(pose->weights[t]) * l->morph_errors[t];
        morphs *= pose->stretch;
        // Samples are posed without their targets, so what these part them by comes on top.
        float error = l->error * pose->stretch + morphs;
        for (uint32_t k = 0; pose->matrices != NULL && k < l->sample_count; k++)
            error = fmaxf(error, BETWEEN * posed_gap(part, pose, &l->samples[k]) + morphs);
        errors[i] = last = fmaxf(last, error);
    }
}
