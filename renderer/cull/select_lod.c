// select_lod.c - the cut through the hierarchy of a baked part that a view needs. See lod.h for the
// rule and why the cut has no cracks. A view that wants the whole of it (and draws nothing before
// it has) takes the cut as if every chunk were resident, and needs those chunks alone that it
// draws.
#include <float.h>
#include <math.h>
#include <stdlib.h>

#include "base/alloc.h"
#include "base/hash.h"
#include "renderer/cull/select.h"
#include "renderer/residency/residency.h"

#define STACK 256 // nodes: at most HG_LOD_NODE_WIDTH per level wait

// Bits of the history that all baked parts share: they are hints, equal ones only cost time.
#define LOD_BITS 22

struct walk {
    const struct hg_culling_view *view;
    const struct hg_object_view *object;
    struct hg_cluster_mesh *mesh;
    const struct hg_lod *lod;
    float world[12], scale; // scale: the most a length grows
    uint32_t draw, first_bit;
    struct hg_selection *out;
    enum hg_status status;
};

// Pixels that an error at a sphere may show.
static float projected(const struct walk *w, const float center[3], float radius, float error)
{
    const float *m = w->world;
    const float size = error * w->scale * w->view->px_scale;
    if (w->view->orthographic)
        return size;
    float distance2 = 0.0f;
    for (int i = 0; i < 3; i++) {
        const float at = m[i] * center[0] + m[3 + i] * center[1] + m[6 + i] * center[2] + m[9 + i];
        distance2 += (at - w->view->eye[i]) * (at - w->view->eye[i]);
    }
    return size / fmaxf(sqrtf(distance2) - radius * w->scale, w->view->near);
}

static bool is_wanted(const struct walk *w, const struct hg_lod_group *g, float *px)
{
    *px = FLT_MAX;
    if (g->error == FLT_MAX)
        return true;
    *px = projected(w, g->center, g->radius, g->error);
    return *px > w->view->error_px;
}

static bool is_resident(const struct walk *w, uint32_t chunk)
{
    const struct hg_chunk_state *c = &w->mesh->chunks[chunk];
    return c->slot != HG_RESIDENCY_NONE && (w->view->whole || !c->loose);
}

static bool is_used(const struct walk *w, uint32_t group)
{
    float px;
    const struct hg_lod_group *g = &w->lod->groups[group];
    return (w->view->whole || is_resident(w, g->chunk)) && is_wanted(w, g, &px);
}

static void want(struct walk *w, uint32_t chunk, float px)
{
    struct hg_selection *s = w->out;
    w->status = hg_grow(&s->wants, &s->want_capacity, s->want_count + 1, sizeof *s->wants);
    if (w->status == HG_OK)
        s->wants[s->want_count++] = (struct hg_chunk_want){w->mesh, chunk, px};
}

static uint32_t bit_of(const struct walk *w, uint32_t cluster)
{
    const uint64_t h = hg_hash_mix(0, (uint64_t)w->draw << 32 | cluster);
    return w->first_bit + (uint32_t)(h >> (64 - LOD_BITS));
}

uint32_t hg_select_lod_bits(void)
{
    return 1u << LOD_BITS;
}

// A cluster of the cut, if it may be seen. False: it may, but its chunk is not there.
static bool add_cluster(struct walk *w, uint32_t index, uint32_t chunk)
{
    const struct hg_lod_cluster *c = &w->lod->clusters[index];
    struct hg_meshlet m = {.cone_cutoff = fminf(1.0f, c->cone_cutoff + HG_CONE_MARGIN)};
    for (int i = 0; i < 3; i++) {
        m.center[i] = c->center[i];
        m.extent[i] = c->extent[i] + 1e-6f * (fabsf(c->center[i]) + c->extent[i]);
        m.cone_axis[i] = c->cone_axis[i];
    }
    if (hg_select_is_outside(w->object, &m) || hg_select_faces_away(w->object, &m))
        return true;
    if (!is_resident(w, chunk))
        return false;
    struct hg_selection *s = w->out;
    w->status = hg_grow(&s->items, &s->capacity, s->count + 1, sizeof *s->items);
    if (w->status != HG_OK)
        return true;
    s->items[s->count++] = (struct hg_run){.draw = w->draw,
        .chunk = chunk,
        .first = c->first_index / 3,
        .count = c->triangle_count,
        .bit = bit_of(w, index),
        .center = {m.center[0], m.center[1], m.center[2]},
        .extent = {m.extent[0], m.extent[1], m.extent[2]}};
    return true;
}

// Chunks that follow each other are in different shares, so that these are of about one size.
static bool is_shared(const struct walk *w, uint32_t chunk)
{
    const uint32_t key = w->mesh->number * 0x9e3779b9u + chunk;
    return w->view->shares < 2 || key % w->view->shares == w->view->share;
}

static void visit_group(struct walk *w, uint32_t index)
{
    const struct hg_lod_group *g = &w->lod->groups[index];
    float px;
    if (!is_shared(w, g->chunk) || !is_wanted(w, g, &px))
        return;
    bool there = w->view->whole || is_resident(w, g->chunk);
    const uint32_t end = there ? g->first_cluster + g->cluster_count : g->first_cluster;
    for (uint32_t c = g->first_cluster; c < end && w->status == HG_OK; c++) {
        const uint32_t made_from = w->lod->clusters[c].made_from;
        if (made_from == HG_LOD_NONE || !is_used(w, made_from))
            there = add_cluster(w, c, g->chunk) && there;
    }
    if (!there && w->status == HG_OK)
        want(w, g->chunk, px);
}

static bool may_show(const struct walk *w, const struct hg_lod_node *n)
{
    struct hg_meshlet box = {0};
    for (int i = 0; i < 3; i++) {
        box.center[i] = 0.5f * (n->min[i] + n->max[i]);
        box.extent[i] =
            0.5f * (n->max[i] - n->min[i]) + 1e-6f * (fabsf(n->min[i]) + fabsf(n->max[i]));
    }
    return !hg_select_is_outside(w->object, &box) &&
           (n->error == FLT_MAX ||
               projected(w, n->center, n->radius, n->error) > w->view->error_px);
}

static int by_place(const void *a, const void *b)
{
    const struct hg_run *x = a, *y = b;
    if (x->chunk != y->chunk)
        return x->chunk < y->chunk ? -1 : 1;
    return x->first < y->first ? -1 : x->first > y->first;
}

enum hg_status hg_select_lod(
    const struct hg_culling_view *view, const struct hg_lod_draw *draw, struct hg_selection *out)
{
    struct walk w = {.view = view,
        .object = draw->object,
        .mesh = draw->mesh,
        .lod = draw->mesh->lod,
        .draw = draw->draw,
        .first_bit = draw->first_bit,
        .out = out};
    for (int i = 0; i < 12; i++)
        w.world[i] = draw->world->m[i];
    w.scale = hg_matrix_max_stretch(draw->world);
    const uint32_t first_run = out->count;
    uint32_t stack[STACK], depth = 0;
    if (w.lod->node_count > 0)
        stack[depth++] = 0;
    while (depth > 0 && w.status == HG_OK) {
        const struct hg_lod_node *n = &w.lod->nodes[stack[--depth]];
        if (!may_show(&w, n))
            continue;
        for (uint32_t i = n->first; i < n->first + n->count && w.status == HG_OK; i++) {
            if (n->is_leaf)
                visit_group(&w, i);
            else if (depth < STACK)
                stack[depth++] = i;
            else
                w.status = HG_E_LIMIT; // a tree this deep is not made
        }
    }
    if (out->count > first_run)
        qsort(out->items + first_run, out->count - first_run, sizeof *out->items, by_place);
    return w.status;
}

// --- chunks that are wanted ----------------------------------------------------------------------

static int by_chunk(const void *a, const void *b)
{
    const struct hg_chunk_want *x = a, *y = b;
    if (x->mesh != y->mesh)
        return x->mesh->number < y->mesh->number ? -1 : 1;
    return x->chunk < y->chunk ? -1 : x->chunk > y->chunk;
}

// Each chunk once, with the largest of its priorities.
static void unite_wants(struct hg_selection *s)
{
    if (s->want_count == 0)
        return;
    qsort(s->wants, s->want_count, sizeof *s->wants, by_chunk);
    uint32_t count = 1;
    for (uint32_t i = 1; i < s->want_count; i++) {
        struct hg_chunk_want *last = &s->wants[count - 1];
        if (by_chunk(last, &s->wants[i]) != 0)
            s->wants[count++] = s->wants[i];
        else if (s->wants[i].priority > last->priority)
            last->priority = s->wants[i].priority;
    }
    s->want_count = count;
}

// A chunk needs the chunks of the parents of all its groups, also of those that are not seen.
static enum hg_status add_parents(struct hg_selection *s)
{
    for (uint32_t i = 0; i < s->want_count; i++) {
        const struct hg_chunk_want w = s->wants[i];
        for (uint32_t k = w.mesh->parent_first[w.chunk]; k < w.mesh->parent_first[w.chunk + 1];
             k++) {
            const uint32_t parent = w.mesh->parents[k];
            struct hg_chunk_state *state = &w.mesh->chunks[parent];
            if (hg_chunk_is_bound(state) || state->mark == s->mark)
                continue;
            state->mark = s->mark;
            const enum hg_status status =
                hg_grow(&s->wants, &s->want_capacity, s->want_count + 1, sizeof *s->wants);
            if (status != HG_OK)
                return status;
            s->wants[s->want_count++] = (struct hg_chunk_want){w.mesh, parent, w.priority};
        }
    }
    return HG_OK;
}

static void use_chunks(const struct hg_geometry *g, const struct hg_selection *s)
{
    for (uint32_t i = 0; i < s->count; i++) {
        const struct hg_run *run = &s->items[i];
        if (run->chunk != HG_LOD_NONE &&
            (i == 0 || run->chunk != run[-1].chunk || run->draw != run[-1].draw))
            hg_cluster_pool_use(g->pool, g->draws[run->draw].part->clusters, run->chunk);
    }
}

enum hg_status hg_select_wants(
    const struct hg_geometry *g, const struct hg_culling_view *view, struct hg_selection *s)
{
    use_chunks(g, s);
    unite_wants(s);
    s->mark = hg_cluster_pool_mark(g->pool);
    const bool alone = s->want_count == 0 || view->whole;
    const enum hg_status status = alone ? HG_OK : add_parents(s);
    unite_wants(s);
    return status;
}
