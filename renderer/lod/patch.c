// patch.c - the triangles of a group in a small mesh of their own, fit for the cache.
#include <math.h>
#include <string.h>

#include "base/alloc.h"
#include "renderer/lod/internal.h"

#define AHEAD 8u // triangles from one that is asked for to when it is looked at

static uint32_t hash(uint32_t v)
{
    v *= 0x9e3779b1u;
    return v ^ v >> 16;
}

// One block for all arrays; sizes are those of the worst case, every corner on its own.
static enum hg_status take(struct hg_lod_patch *p, uint32_t triangles, uint32_t attributes)
{
    const size_t corners = (size_t)triangles * 3;
    size_t table = 16;
    while (table < corners)
        table *= 2;
    p->table.mask = (uint32_t)table - 1;
    const size_t words = (size_t)triangles * 12 + corners * (8 + 4 + attributes) + table;
    uint32_t *at =
        hg_realloc(NULL, words + corners / 4 + 4, 4); // not cleared: all but `table` is set
    p->memory = at;
    if (at == NULL)
        return HG_E_NOMEM;
    memset(at, 0, table * sizeof *at);
    p->table.slots = at;
    at += table;
    p->triangles = (uint32_t(*)[4])(void *)at;
    at += (size_t)triangles * 4;
    p->places = (uint32_t(*)[4])(void *)at;
    at += (size_t)triangles * 4;
    p->next = at;
    at += (size_t)triangles * 4;
    p->point = (float(*)[4])(void *)at; // all before it are of multiples of 16 bytes
    at += corners * 4;
    uint32_t **arrays[] = {&p->head, &p->tail, &p->global, &p->into, &p->vertex_first,
        &p->position_of, &p->vertex_next, &p->vertex_global};
    for (size_t i = 0; i < sizeof arrays / sizeof *arrays; i++) {
        *arrays[i] = at;
        at += corners;
    }
    p->attributes = (float *)at;
    at += corners * attributes;
    p->fixed = (uint8_t *)at;
    return HG_OK;
}

uint32_t hg_lod_patch_find(const struct hg_lod_patch *p, uint32_t global)
{
    for (uint32_t slot = hash(global) & p->table.mask; p->table.slots[slot] != 0;
         slot = (slot + 1) & p->table.mask)
        if (p->global[p->table.slots[slot] - 1] == global)
            return p->table.slots[slot] - 1;
    return HG_LOD_NONE;
}

static uint32_t add_position(struct hg_lod_patch *p, uint32_t global)
{
    uint32_t slot = hash(global) & p->table.mask;
    for (; p->table.slots[slot] != 0; slot = (slot + 1) & p->table.mask)
        if (p->global[p->table.slots[slot] - 1] == global)
            return p->table.slots[slot] - 1;
    const uint32_t i = p->position_count++;
    p->table.slots[slot] = i + 1;
    p->global[i] = global;
    p->into[i] = i;
    p->fixed[i] = p->job->locked[global];
    hg_lod_expect(&p->job->mesh->lattice[global]);
    p->head[i] = p->tail[i] = p->vertex_first[i] = HG_LOD_NONE;
    return i;
}

static uint32_t add_vertex(struct hg_lod_patch *p, uint32_t global)
{
    const uint32_t position = add_position(p, p->job->mesh->position_of[global]);
    for (uint32_t v = p->vertex_first[position]; v != HG_LOD_NONE; v = p->vertex_next[v])
        if (p->vertex_global[v] == global)
            return v;
    const uint32_t v = p->vertex_count++;
    hg_lod_expect(p->job->mesh->words + (size_t)global * p->job->mesh->format.words);
    p->vertex_global[v] = global;
    p->position_of[v] = position;
    p->vertex_next[v] = p->vertex_first[position];
    p->vertex_first[position] = v;
    return v;
}

static void add_triangles(struct hg_lod_patch *p)
{
    const struct hg_lod_simplify_job *job = p->job;
    for (uint32_t t = 0; t < p->triangle_count; t++) {
        for (uint32_t k = 0; k < 3; k++) {
            if (t + AHEAD < p->triangle_count)
                hg_lod_expect(&job->mesh->position_of[job->triangles[(size_t)(t + AHEAD) * 3 + k]]);
            const uint32_t corner = t * 4 + k;
            const uint32_t v = add_vertex(p, p->job->triangles[(size_t)t * 3 + k]);
            const uint32_t position = p->position_of[v];
            p->triangles[t][k] = v;
            p->places[t][k] = position;
            p->next[corner] = HG_LOD_NONE;
            if (p->tail[position] == HG_LOD_NONE)
                p->head[position] = corner;
            else
                p->next[p->tail[position]] = corner;
            p->tail[position] = corner;
        }
    }
}

// Origin and unit (mean edge) from the lattice; integers keep far-away parts exact.
static void set_frame(struct hg_lod_patch *p)
{
    const struct hg_lod_mesh *m = p->job->mesh;
    memcpy(p->frame.origin, m->lattice[p->global[0]], sizeof p->frame.origin);
    for (uint32_t i = 0; i < p->position_count; i++) {
        for (int k = 0; k < 3; k++)
            p->point[i][k] = (float)(m->lattice[p->global[i]][k] - p->frame.origin[k]);
        p->point[i][3] = 0.0f;
    }
    double sum = 0.0;
    for (uint32_t t = 0; t < p->triangle_count; t++) {
        float lengths = 0.0f;
        for (int k = 0; k < 3; k++) {
            const float *a = p->point[p->places[t][k]],
                        *b = p->point[p->places[t][k < 2 ? k + 1 : 0]];
            const float d[3] = {a[0] - b[0], a[1] - b[1], a[2] - b[2]};
            lengths += sqrtf(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]);
        }
        sum += (double)lengths;
    }
    const double mean = sum / (p->triangle_count * 3.0);
    p->frame.scale = (float)(1.0 / mean);
    p->frame.unit = (float)(mean * (double)m->format.quantum);
    for (uint32_t i = 0; i < p->position_count; i++)
        for (int k = 0; k < 3; k++)
            p->point[i][k] *= p->frame.scale;
}

// Units of surface per uv: from the areas in space and in the uv plane.
static float uv_scale(const struct hg_lod_patch *p, uint32_t first)
{
    double space = 0.0, plane = 0.0;
    for (uint32_t t = 0; t < p->triangle_count; t++) {
        const float *c[3], *a[3];
        for (int k = 0; k < 3; k++) {
            c[k] = p->point[p->places[t][k]];
            a[k] = p->attributes + (size_t)p->triangles[t][k] * p->attribute_count + first;
        }
        float e[2][3], n[3];
        for (int k = 0; k < 3; k++) {
            e[0][k] = c[1][k] - c[0][k];
            e[1][k] = c[2][k] - c[0][k];
        }
        n[0] = e[0][1] * e[1][2] - e[0][2] * e[1][1];
        n[1] = e[0][2] * e[1][0] - e[0][0] * e[1][2];
        n[2] = e[0][0] * e[1][1] - e[0][1] * e[1][0];
        space += (double)sqrtf(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
        plane += fabs((double)((a[1][0] - a[0][0]) * (a[2][1] - a[0][1]) -
                               (a[1][1] - a[0][1]) * (a[2][0] - a[0][0])));
    }
    return plane > 0.0 ? (float)sqrt(space / plane) : 0.0f;
}

static void set_weights(struct hg_lod_patch *p)
{
    const struct hg_lod_format *f = &p->job->mesh->format;
    const struct hg_lod_weights *w = &p->job->weights;
    uint32_t n = 0;
    for (int k = 0; f->normal >= 0 && k < 3; k++)
        p->weight[n++] = w->normal;
    for (int set = 0; set < 2; set++) {
        if ((set == 0 ? f->uv : f->uv1) < 0)
            continue;
        const float scale = w->uv > 0.0f ? uv_scale(p, n) * w->uv : 0.0f;
        p->weight[n++] = scale;
        p->weight[n++] = scale;
    }
    while (n < p->attribute_count)
        p->weight[n++] = w->color;
    for (size_t v = 0; v < p->vertex_count; v++)
        for (uint32_t k = 0; k < n; k++)
            p->attributes[v * n + k] *= p->weight[k];
}

enum hg_status hg_lod_patch_init(struct hg_lod_patch *p, const struct hg_lod_simplify_job *job)
{
    const struct hg_lod_format *f = &job->mesh->format;
    memset(p, 0, sizeof *p);
    p->job = job;
    p->triangle_count = p->live = job->triangle_count;
    p->attribute_count = (f->normal >= 0 ? 3u : 0u) + (f->uv >= 0 ? 2u : 0u) +
                         (f->uv1 >= 0 ? 2u : 0u) + (f->color >= 0 ? 4u : 0u);
    if (take(p, job->triangle_count, p->attribute_count) != HG_OK)
        return HG_E_NOMEM;
    add_triangles(p);
    for (uint32_t v = 0; v < p->vertex_count; v++) {
        float values[HG_LOD_ATTRIBUTES];
        const uint32_t n =
            hg_lod_attributes(f, job->mesh->words + (size_t)p->vertex_global[v] * f->words, values);
        memcpy(p->attributes + (size_t)v * n, values, n * sizeof *values);
    }
    set_frame(p);
    set_weights(p);
    return HG_OK;
}

void hg_lod_patch_finish(struct hg_lod_patch *p)
{
    hg_free(p->memory);
    memset(p, 0, sizeof *p);
}
