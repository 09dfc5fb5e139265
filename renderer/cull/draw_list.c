// draw_list.c - see draw_list.h.
#include "renderer/cull/draw_list.h"

#include "base/alloc.h"

void hg_draw_list_reset(struct hg_draw_list *items)
{
    items->count = 0;
    hg_index_lists_reset(&items->listing);
}

void hg_draw_list_finish(struct hg_draw_list *items)
{
    hg_free(items->list);
    hg_index_lists_finish(&items->listing);
}

// --- early items ---------------------------------------------------------------------------------

static const struct hg_gpu_part *part_of(const struct hg_geometry *g, uint32_t part)
{
    return (const struct hg_gpu_part *)(const void *)g->tables.parts.shadow + part;
}

static struct hg_culling_item item_of(const struct hg_draw_list_run *a, uint32_t draw)
{
    const struct hg_geometry *g = a->geometry;
    const bool numbered = a->set->numbered;
    const struct hg_draw_entry *d = &g->draws[draw];
    const struct hg_gpu_part *part = part_of(g, d->gpu.part);
    struct hg_culling_item item = {.first_draw = draw,
        .draw_count = 1,
        .flags = hg_select_flags(g, a->view, draw),
        .part = d->gpu.part,
        .positions = part->positions,
        .vertices = part->vertices,
        .extra = part->extra,
        .chunk = HG_LOD_NONE,
        .first_primitive = HG_CLUSTER_NONE,
        .command = HG_CLUSTER_NONE,
        .list = HG_INDEX_LIST_NONE,
        .numbered = numbered && !d->deformed && d->part->numbered_indices != NULL};
    if (!item.numbered)
        return item;
    item.position_buffer = d->part->buffer.handle;
    item.position_offset = d->part->numbered_at.positions;
    item.positions = d->part->buffer.address + item.position_offset;
    return item;
}

static enum hg_status push_item(struct hg_draw_list *items, const struct hg_culling_item *item)
{
    const enum hg_status status =
        hg_grow(&items->list, &items->capacity, items->count + 1, sizeof *items->list);
    if (status == HG_OK)
        items->list[items->count++] = *item;
    return status;
}

static uint32_t corners_of(uint32_t flags)
{
    return flags & HG_DRAW_POINTS ? 1 : flags & HG_DRAW_LINES ? 2 : 3;
}

// The whole part, joined with the item before where that is the same part.
static enum hg_status add_whole(
    struct hg_draw_list *items, const struct hg_draw_list_run *a, uint32_t draw)
{
    const struct hg_geometry *g = a->geometry;
    const struct hg_culling_set *set = a->set;
    const struct hg_draw_entry *d = &g->draws[draw];
    struct hg_culling_item *last =
        items->count > set->first_item ? &items->list[items->count - 1] : NULL;
    if (last != NULL && last->index_buffer != VK_NULL_HANDLE && last->part == d->gpu.part &&
        last->flags == hg_select_flags(g, a->view, draw) &&
        last->first_draw + last->draw_count == draw) {
        last->draw_count++;
        return HG_OK;
    }
    struct hg_culling_item item = item_of(a, draw);
    item.index_count = d->part->index_count;
    item.primitive_count = d->part->primitive_count;
    item.index_buffer = d->part->buffer.handle;
    item.index_offset = item.numbered ? d->part->numbered_at.indices : d->part->layout.indices;
    return push_item(items, &item);
}

static const uint32_t *indices_of(const struct hg_culling_item *item, const struct hg_part_entry *p)
{
    if (item->chunk != HG_LOD_NONE)
        return p->clusters->chunks[item->chunk].indices;
    return item->numbered ? p->numbered_indices : p->indices;
}

static enum hg_status fill_list(struct hg_draw_list *items, const struct hg_draw_list_run *a,
    const struct hg_run *runs, uint32_t count, struct hg_culling_item *item)
{
    const struct hg_part_entry *part = a->geometry->draws[item->first_draw].part;
    struct hg_index_list list;
    hg_index_list_open(a->geometry, a->view, item, &list);
    enum hg_status status = hg_index_lists_begin(&items->listing, &list, &item->list);
    for (uint32_t i = 0; i < count && status == HG_OK; i++) {
        const struct hg_index_list_run run = {.indices = indices_of(item, part),
            .first = runs[i].first,
            .count = runs[i].count,
            .base = item->chunk != HG_LOD_NONE ? item->chunk << HG_LOD_SHIFT : 0};
        status = hg_index_lists_add(&items->listing, &run);
    }
    if (status == HG_OK)
        hg_index_lists_end(&items->listing);
    return status;
}

// Runs of one draw and chunk as one item of its own list of indices.
static enum hg_status add_listed(struct hg_draw_list *items, const struct hg_draw_list_run *a,
    const struct hg_run *runs, uint32_t count)
{
    struct hg_culling_item item = item_of(a, runs[0].draw);
    item.index_offset = items->listing.index_count * 4;
    item.chunk = runs[0].chunk;
    if (item.chunk != HG_LOD_NONE) {
        const struct hg_gpu_part *part =
            &a->geometry->draws[runs[0].draw].part->clusters->chunks[item.chunk].part;
        item.positions = part->positions;
        item.vertices = part->vertices;
        item.extra = part->extra;
    }
    for (uint32_t i = 0; i < count; i++)
        item.primitive_count += runs[i].count;
    item.index_count = item.primitive_count * corners_of(item.flags);
    const enum hg_status status = fill_list(items, a, runs, count, &item);
    if (status != HG_OK)
        return status;
    const struct hg_index_list *list = &items->listing.lists[item.list];
    item.joins = item.chunk != HG_LOD_NONE;
    item.listed = list->woven;
    if (item.listed) {
        item.numbered = true;
        item.position_offset = list->first_vertex * sizeof(struct hg_index_list_vertex);
    } else if (!item.numbered) {
        item.first_primitive = list->first_id;
    }
    return push_item(items, &item);
}

// Instances far away show the same clusters: they join the item before.
static bool joins(const struct hg_draw_list *items, const struct hg_draw_list_run *a,
    const struct hg_run *runs, uint32_t count)
{
    if (items->count == a->set->first_item)
        return false;
    const struct hg_culling_item *last = &items->list[items->count - 1];
    const struct hg_draw_entry *d = &a->geometry->draws[runs[0].draw];
    if (!last->joins || last->part != d->gpu.part ||
        last->flags != hg_select_flags(a->geometry, a->view, runs[0].draw) ||
        last->first_draw + last->draw_count != runs[0].draw || last->chunk != runs[0].chunk ||
        items->listing.lists[last->list].run_count != count)
        return false;
    for (uint32_t i = 0; i < count; i++) {
        const struct hg_index_list_run *c =
            &items->listing.runs[items->listing.lists[last->list].first_run + i];
        if (c->first != runs[i].first || c->count != runs[i].count)
            return false;
    }
    return true;
}

// Items of a draw of a baked part: one per chunk. Only draws of one chunk can be joined, so that
// items stay in draw order.
static enum hg_status add_chunks(struct hg_draw_list *items, const struct hg_draw_list_run *a,
    const struct hg_run *runs, uint32_t count)
{
    if (runs[0].chunk == runs[count - 1].chunk && joins(items, a, runs, count)) {
        items->list[items->count - 1].draw_count++;
        return HG_OK;
    }
    enum hg_status status = HG_OK;
    for (uint32_t i = 0, n; i < count && status == HG_OK; i += n) {
        for (n = 1; i + n < count && runs[i + n].chunk == runs[i].chunk;)
            n++;
        status = add_listed(items, a, &runs[i], n);
        // The last of several chunks of a draw is no start for others to join.
        if (status == HG_OK && n != count)
            items->list[items->count - 1].joins = false;
    }
    return status;
}

// The runs of one draw that come first; moves late ones behind them (in order).
static uint32_t split_runs(const struct hg_occlusion *o, struct hg_run *runs, uint32_t count,
    struct hg_selection *late, enum hg_status *status)
{
    uint32_t early = 0;
    for (uint32_t i = 0; i < count && *status == HG_OK; i++) {
        if (hg_occlusion_was_seen(o, runs[i].bit)) {
            runs[early++] = runs[i];
            continue;
        }
        *status = hg_grow(&late->items, &late->capacity, late->count + 1, sizeof *late->items);
        if (*status == HG_OK)
            late->items[late->count++] = runs[i];
    }
    return early;
}

// Items of one draw. With occlusion unseen runs go to `late`, the others become candidates.
static enum hg_status add_draw(struct hg_draw_list *items, const struct hg_draw_list_run *a,
    struct hg_run *runs, uint32_t count, struct hg_selection *late)
{
    enum hg_status status = HG_OK;
    struct hg_culling_set *set = a->set;
    const struct hg_draw_entry *d = &a->geometry->draws[runs[0].draw];
    uint32_t primitives = 0;
    if (a->occlusion != NULL)
        count = split_runs(a->occlusion, runs, count, late, &status);
    for (uint32_t i = 0; i < count && status == HG_OK; i++) {
        primitives += runs[i].count;
        if (a->occlusion != NULL && runs[i].bit != HG_RUN_NO_BIT)
            status = hg_occlusion_add(a->occlusion, &runs[i], HG_CLUSTER_NONE);
    }
    if (status != HG_OK || count == 0)
        return status;
    if (!(d->gpu.flags & (HG_DRAW_LINES | HG_DRAW_POINTS)))
        set->triangles += primitives;
    if (d->part->clusters != NULL)
        return add_chunks(items, a, runs, count);
    return primitives == d->part->primitive_count &&
                   !hg_index_list_culls_part(a->geometry, a->view, runs[0].draw)
               ? add_whole(items, a, runs[0].draw)
               : add_listed(items, a, runs, count);
}

// First index of the command and no offset of the buffer: lavapipe 22.3 forgets the latter in
// indirect draws.
static enum hg_status add_late_run(
    struct hg_draw_list *items, const struct hg_draw_list_run *a, const struct hg_run *run)
{
    struct hg_occlusion *o = a->occlusion;
    enum hg_status status = hg_occlusion_add(o, run, o->command_count);
    if (status == HG_OK)
        status = add_listed(items, a, run, 1);
    if (status != HG_OK)
        return status;
    struct hg_culling_item *item = &items->list[items->count - 1];
    items->listing.lists[item->list].backwards = true;
    item->command = o->command_count;
    item->candidate = o->count - 1;
    return hg_occlusion_add_command(
        o, &(struct hg_gpu_draw_command){.index_count = item->index_count,
               .first_index = (uint32_t)(item->index_offset / 4),
               .first_instance = run->draw});
}

// Backwards, draws and primitives: of surfaces at the same depth the last that is drawn is seen.
static enum hg_status add_late(
    struct hg_draw_list *items, const struct hg_draw_list_run *a, const struct hg_selection *late)
{
    enum hg_status status = HG_OK;
    struct hg_culling_set *set = a->set;
    set->first_late = items->count;
    for (uint32_t i = late->count; i > 0 && status == HG_OK; i--) {
        status = add_late_run(items, a, &late->items[i - 1]);
        set->late_triangles += late->items[i - 1].count;
    }
    set->late_count = items->count - set->first_late;
    return status;
}

static enum hg_status add_early(struct hg_draw_list *items, const struct hg_draw_list_run *a,
    struct hg_selection *runs, struct hg_selection *late)
{
    enum hg_status status = HG_OK;
    struct hg_culling_set *set = a->set;
    set->first_item = items->count;
    for (uint32_t i = 0; i < 4; i++)
        set->class_first[i] = items->count;
    for (uint32_t i = 0, n; i < runs->count && status == HG_OK; i += n) {
        struct hg_run *r = &runs->items[i];
        for (n = 1; i + n < runs->count && r[n].draw == r[0].draw;)
            n++;
        status = add_draw(items, a, r, n, late);
        const enum hg_draw_class class =
            hg_draw_class_of(hg_select_flags(a->geometry, a->view, r[0].draw));
        for (uint32_t c = class + 1u; c < 4; c++)
            set->class_first[c] = items->count;
    }
    set->item_count = items->count - set->first_item;
    return status;
}

enum hg_status hg_draw_list_add(
    struct hg_draw_list *items, const struct hg_draw_list_run *a, struct hg_selection *runs)
{
    struct hg_selection late = {0};
    const uint32_t before = a->occlusion != NULL ? a->occlusion->count : 0;
    a->set->first_candidate = before;
    enum hg_status status = add_early(items, a, runs, &late);
    if (status == HG_OK && a->occlusion != NULL)
        status = add_late(items, a, &late);
    if (a->occlusion != NULL)
        a->set->candidate_count = a->occlusion->count - before;
    hg_free(late.items);
    return status;
}

// --- after the sieve -----------------------------------------------------------------------------

// Returns how many triangles of the item are not drawn.
static uint32_t narrow_item(
    const struct hg_draw_list *items, struct hg_occlusion *o, struct hg_culling_item *item)
{
    if (item->list == HG_INDEX_LIST_NONE || !items->listing.lists[item->list].sieved)
        return 0;
    const uint32_t before = item->primitive_count;
    item->primitive_count = items->listing.lists[item->list].kept;
    item->index_count = item->primitive_count * 3;
    if (item->command != HG_CLUSTER_NONE) {
        o->commands[item->command].index_count = item->index_count;
        o->triangles[item->candidate] = item->primitive_count;
    }
    return before - item->primitive_count;
}

void hg_draw_list_narrow(
    struct hg_draw_list *items, struct hg_occlusion *o, struct hg_culling_set *set)
{
    for (uint32_t i = 0; i < set->item_count; i++)
        set->triangles -= narrow_item(items, o, &items->list[set->first_item + i]);
    for (uint32_t i = 0; i < set->late_count; i++)
        set->late_triangles -= narrow_item(items, o, &items->list[set->first_late + i]);
}
