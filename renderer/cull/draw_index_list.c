// draw_index_list.c - see draw_index_list.h.
#include "renderer/cull/draw_index_list.h"

#include <string.h>

#include "base/alloc.h"
#include "renderer/cull/select.h"

#define RUNS_PER_JOB  32
#define LISTS_PER_JOB 8
#define NOWHERE       UINT16_MAX

#define SIEVE_FROM 64 // triangles of a part

_Static_assert(3 * HG_INDEX_LIST_MOST_NUMBERS < NOWHERE, "places of woven vertices");

struct write {
    struct hg_index_lists *listing;
    struct hg_index_lists_memory memory;
};

void hg_index_lists_reset(struct hg_index_lists *l)
{
    l->list_count = l->run_count = l->id_count = 0;
    l->index_count = l->vertex_count = 0;
}

void hg_index_lists_finish(struct hg_index_lists *l)
{
    hg_free(l->lists);
    hg_free(l->runs);
    memset(l, 0, sizeof *l);
}

enum hg_status hg_index_lists_begin(
    struct hg_index_lists *l, const struct hg_index_list *list, uint32_t *index)
{
    const enum hg_status status =
        hg_grow(&l->lists, &l->list_capacity, l->list_count + 1, sizeof *l->lists);
    *index = HG_INDEX_LIST_NONE;
    if (status != HG_OK)
        return status;
    *index = l->list_count++;
    struct hg_index_list *to = &l->lists[*index];
    *to = *list;
    to->first_run = l->run_count;
    to->run_count = to->kept = 0;
    to->first_index = l->index_count;
    to->first_vertex = l->vertex_count;
    to->first_id = l->id_count;
    return HG_OK;
}

enum hg_status hg_index_lists_add(struct hg_index_lists *l, const struct hg_index_list_run *run)
{
    const enum hg_status status =
        hg_grow(&l->runs, &l->run_capacity, l->run_count + 1, sizeof *l->runs);
    if (status != HG_OK)
        return status;
    struct hg_index_list *list = &l->lists[l->list_count - 1];
    struct hg_index_list_run *to = &l->runs[l->run_count++];
    *to = *run;
    to->to = l->index_count;
    to->ids = l->id_count;
    to->list = l->list_count - 1;
    l->index_count += (uint64_t)run->count * list->corners;
    l->id_count += list->has_ids ? run->count : 0;
    list->run_count++;
    list->kept += run->count;
    return HG_OK;
}

void hg_index_lists_end(struct hg_index_lists *l)
{
    struct hg_index_list *list = &l->lists[l->list_count - 1];
    const uint64_t others = 2ull * list->kept;
    list->woven = list->woven && list->vertex_count <= HG_INDEX_LIST_MOST_WOVEN &&
                  list->kept <= HG_INDEX_LIST_MOST_NUMBERS;
    if (list->woven)
        l->vertex_count += list->kept + (others < list->vertex_count ? others : list->vertex_count);
}

// --- what lists are made of ----------------------------------------------------------------------

// Positions of the numbered list, on devices whose memory is that of the host.
static const float *positions_of(const struct hg_part_entry *part)
{
    return (const float *)(const void *)((const uint8_t *)part->buffer.mapped +
                                         part->numbered_at.positions);
}

bool hg_index_list_culls_part(
    const struct hg_geometry *g, const struct hg_culling_view *view, uint32_t draw)
{
    const struct hg_draw_entry *d = &g->draws[draw];
    return view->lens != NULL && view->numbered && !d->deformed &&
           d->part->numbered_indices != NULL && d->part->buffer.mapped != NULL &&
           d->part->primitive_count >= SIEVE_FROM;
}

static void open_sieve(const struct hg_geometry *g, const struct hg_culling_view *view,
    uint32_t draw, struct hg_index_list *list)
{
    const struct hg_draw_entry *d = &g->draws[draw];
    const struct hg_gpu_instance *instances = hg_geometry_instances(g);
    list->sieved = true;
    hg_triangle_cull_open(view, &instances[d->gpu.instance].world, &d->part->bounds,
        hg_select_flags(g, view, draw), &list->sieve);
}

// Chunks go through no sieve: of a cut that suits the view it drops one triangle of twenty, which
// is not worth the time.
void hg_index_list_open(const struct hg_geometry *g, const struct hg_culling_view *view,
    const struct hg_culling_item *item, struct hg_index_list *out)
{
    const struct hg_draw_entry *d = &g->draws[item->first_draw];
    *out = (struct hg_index_list){.corners = (item->flags & HG_DRAW_POINTS) != 0  ? 1
                                             : (item->flags & HG_DRAW_LINES) != 0 ? 2
                                                                                  : 3,
        .has_ids = !item->numbered};
    if (item->chunk == HG_LOD_NONE) {
        if (!hg_index_list_culls_part(g, view, item->first_draw))
            return;
        out->positions = positions_of(d->part);
        open_sieve(g, view, item->first_draw, out);
        return;
    }
    const struct hg_chunk_state *chunk = &d->part->clusters->chunks[item->chunk];
    if (!view->numbered || d->deformed || chunk->host_indices != NULL || out->corners != 3)
        return;
    out->woven = true;
    out->positions = (const float *)(const void *)((const uint8_t *)chunk->indices +
                                                   (chunk->part.positions - chunk->part.indices));
    out->vertex_count = d->part->clusters->lod->chunks[item->chunk].vertex_count;
}

// --- writing -------------------------------------------------------------------------------------

static void turn_around(uint32_t *indices, uint32_t *ids, uint32_t count, uint32_t corners)
{
    for (uint32_t low = 0, high = count; low + 1 < high--; low++) {
        if (ids != NULL) {
            const uint32_t id = ids[low];
            ids[low] = ids[high];
            ids[high] = id;
        }
        for (uint32_t k = 0; k < corners; k++) {
            const uint32_t index = indices[low * corners + k];
            indices[low * corners + k] = indices[high * corners + k];
            indices[high * corners + k] = index;
        }
    }
}

static void write_run(const struct write *w, struct hg_index_list_run *run)
{
    const struct hg_index_list *list = &w->listing->lists[run->list];
    const uint32_t *from = run->indices + (size_t)run->first * list->corners;
    const uint32_t number = run->base + run->first;
    uint32_t *to = w->memory.indices + run->to;
    uint32_t *ids = list->has_ids ? w->memory.ids + run->ids : NULL;
    run->kept = run->count;
    if (list->sieved) {
        const struct hg_triangle_list kept = {to, ids, number};
        run->kept = hg_triangle_cull_list(&list->sieve, list->positions, from, run->count, &kept);
    } else {
        memcpy(to, from, (size_t)run->count * list->corners * 4);
        for (uint32_t k = 0; ids != NULL && k < run->count; k++)
            ids[k] = number + k;
    }
    if (list->backwards)
        turn_around(to, ids, run->kept, list->corners);
}

static void write_runs(void *user, size_t job)
{
    const struct write *w = user;
    const size_t first = job * RUNS_PER_JOB;
    const size_t end = first + RUNS_PER_JOB;
    for (size_t i = first; i < end && i < w->listing->run_count; i++)
        write_run(w, &w->listing->runs[i]);
}

// Moves what was kept together, to the place of the first run.
static void pack(const struct write *w, struct hg_index_list *list)
{
    list->kept = 0;
    for (uint32_t i = list->first_run; i < list->first_run + list->run_count; i++) {
        const struct hg_index_list_run *run = &w->listing->runs[i];
        uint32_t *to = w->memory.indices + list->first_index + (size_t)list->kept * list->corners;
        if (to != w->memory.indices + run->to)
            memmove(to, w->memory.indices + run->to, (size_t)run->kept * list->corners * 4);
        if (list->has_ids)
            memmove(w->memory.ids + list->first_id + list->kept, w->memory.ids + run->ids,
                (size_t)run->kept * 4);
        list->kept += run->kept;
    }
}

static void put_vertex(const struct hg_index_list *list, uint32_t source, uint32_t number,
    struct hg_index_list_vertex *out)
{
    memcpy(out->position, list->positions + (size_t)source * 3, sizeof out->position);
    out->number = number;
}

// Vertex i is the first corner of triangle i; corners that are the first of none come behind.
static void weave(const struct write *w, const struct hg_index_list *list)
{
    uint16_t place[HG_INDEX_LIST_MOST_WOVEN];
    uint32_t *indices = w->memory.indices + list->first_index;
    const uint32_t *ids = w->memory.ids + list->first_id;
    struct hg_index_list_vertex *vertices = w->memory.vertices + list->first_vertex;
    uint32_t count = list->kept;
    memset(place, 0xff, list->vertex_count * sizeof *place);
    for (uint32_t i = 0; i < list->kept; i++) {
        put_vertex(list, indices[i * 3], ids[i], &vertices[i]);
        place[indices[i * 3]] = (uint16_t)i;
    }
    for (uint32_t i = 0; i < list->kept * 3; i++) {
        if (i % 3 == 0) {
            indices[i] = i / 3;
            continue;
        }
        uint16_t *at = &place[indices[i]];
        if (*at == NOWHERE) {
            put_vertex(list, indices[i], 0, &vertices[count]);
            *at = (uint16_t)count++;
        }
        indices[i] = *at;
    }
}

static void finish_lists(void *user, size_t job)
{
    const struct write *w = user;
    const size_t first = job * LISTS_PER_JOB;
    const size_t end = first + LISTS_PER_JOB;
    for (size_t i = first; i < end && i < w->listing->list_count; i++) {
        struct hg_index_list *list = &w->listing->lists[i];
        if (list->sieved)
            pack(w, list);
        if (list->woven)
            weave(w, list);
    }
}

static void spread(struct hg_jobs *jobs, size_t count, hg_jobs_fn *fn, struct write *w)
{
    if (count > 1 && jobs != NULL)
        hg_jobs_for(jobs, count, fn, w);
    else
        for (size_t i = 0; i < count; i++)
            fn(w, i);
}

void hg_index_lists_write(
    struct hg_index_lists *l, struct hg_jobs *jobs, const struct hg_index_lists_memory *memory)
{
    struct write w = {l, *memory};
    spread(jobs, ((size_t)l->run_count + RUNS_PER_JOB - 1) / RUNS_PER_JOB, write_runs, &w);
    spread(jobs, ((size_t)l->list_count + LISTS_PER_JOB - 1) / LISTS_PER_JOB, finish_lists, &w);
}
