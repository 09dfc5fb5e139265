// visible.c - see visible.h.
#include "renderer/geometry/visible.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/alloc.h"
#include "renderer/geometry/hosted.h"
#include "renderer/geometry/listed.h"
#include "renderer/geometry/select.h"

// Triangles. The test takes 3.5 ms at 1280x720 on two cores, a hidden triangle saves 0.2 us, and a
// walk through Sponza hides 4 of 100: it pays from 400 thousand.
#define OCCLUSION_FROM 400000u
#define ERROR_STEP     1.25f
#define MOST_ERROR_PX  1e6f
#define CALM           6 // frames that fit before the error is lowered
#define MOST_ROUNDS    4 // of loading before chunks must be driving each other out

struct hg_visible {
    struct hg_gpu *gpu;
    uint64_t occlusion_from;
    struct hg_selection runs; // of the set that is being added
    struct hg_visible_set *sets;
    size_t set_capacity;
    uint32_t set_count;
    struct hg_visible_item *items;
    size_t item_capacity;
    uint32_t item_count;
    struct hg_listing listing;
    struct hg_hosted hosted;
    struct hg_gpu_candidate *candidates;
    uint32_t *candidate_bits, *candidate_triangles;
    size_t candidate_capacity, bit_capacity, triangle_capacity;
    uint32_t candidate_count;
    struct hg_gpu_draw_command *commands;
    size_t command_capacity;
    uint32_t command_count;

    struct hg_gpu_buffer indices, ids, vertices, candidate_buffer, command_buffer, flags;
    struct hg_gpu_buffer depth, blocks, seen;

    uint64_t layout; // of the draws that the history is of
    uint32_t *history;
    size_t history_capacity;
    uint32_t history_bits;
    float bias;    // on the error of views that do not wait; 0 = 1
    uint32_t calm; // frames since they wanted more than the budget holds
    bool crowded;  // the newest views wanted more than the budget holds
    bool tested;   // flags of set 0 are those of its newest sample
};

#define BUFFERS(v)                                                                                 \
    {                                                                                              \
        &(v)->indices, &(v)->ids, &(v)->vertices, &(v)->candidate_buffer, &(v)->command_buffer,    \
            &(v)->flags, &(v)->depth, &(v)->blocks, &(v)->seen, &(v)->hosted.pixels                \
    }

enum hg_status hg_visible_create(struct hg_gpu *gpu, struct hg_visible **out, struct hg_error *err)
{
    *out = hg_calloc(1, sizeof **out);
    if (*out == NULL)
        return hg_error_set(err, HG_E_NOMEM, "draw lists", NULL, "no memory");
    (*out)->gpu = gpu;
    (*out)->occlusion_from = OCCLUSION_FROM;
    return HG_OK;
}

void hg_visible_destroy(struct hg_visible *v)
{
    if (v == NULL)
        return;
    struct hg_gpu_buffer *buffers[] = BUFFERS(v);
    for (size_t i = 0; i < sizeof buffers / sizeof buffers[0]; i++)
        hg_gpu_buffer_destroy(v->gpu, buffers[i]);
    hg_free(v->runs.items);
    hg_free(v->runs.wants);
    hg_free(v->sets);
    hg_free(v->items);
    hg_listing_finish(&v->listing);
    hg_hosted_finish(v->gpu, &v->hosted);
    hg_free(v->candidates);
    hg_free(v->candidate_bits);
    hg_free(v->candidate_triangles);
    hg_free(v->commands);
    hg_free(v->history);
    hg_free(v);
}

void hg_visible_relax(struct hg_visible *v)
{
    if (v->calm < CALM)
        return;
    v->bias = fmaxf(v->bias / ERROR_STEP, 1.0f);
    v->calm = 0;
}

void hg_visible_set_occlusion_from(struct hg_visible *v, uint64_t triangles)
{
    v->occlusion_from = triangles > 0 ? triangles : OCCLUSION_FROM;
}

// --- history -------------------------------------------------------------------------------------

static bool was_seen(const struct hg_visible *v, uint32_t bit)
{
    return bit >= v->history_bits || (v->history[bit / 32] >> bit % 32 & 1u) != 0;
}

// What the newest sample saw. Runs that were not in the frustum keep their bits.
static void learn(struct hg_visible *v)
{
    const uint32_t *flags = v->flags.mapped;
    const struct hg_visible_set *set = &v->sets[0];
    for (int pass = 0; pass < 2;
         pass++) { // first hidden ones: a run may be one of several of a bit
        for (uint32_t i = 0; i < set->candidate_count; i++) {
            const uint32_t bit = v->candidate_bits[set->first_candidate + i];
            if (bit >= v->history_bits)
                continue;
            if (pass == 0)
                v->history[bit / 32] &= ~(1u << bit % 32);
            else if (flags[set->first_candidate + i] != 0)
                v->history[bit / 32] |= 1u << bit % 32;
        }
    }
}

// Another list of draws: everything counts as seen.
static enum hg_status keep_history(struct hg_visible *v, const struct hg_geometry *g)
{
    const uint32_t bits = g->bit_count + (g->pool != NULL ? hg_select_lod_bits() : 0);
    const size_t words = ((size_t)bits + 31) / 32;
    if (v->layout == g->bit_layout && v->history_bits == bits)
        return HG_OK;
    v->history_bits = 0;
    const enum hg_status status =
        hg_grow(&v->history, &v->history_capacity, words, sizeof *v->history);
    if (status != HG_OK)
        return status;
    if (words > 0)
        memset(v->history, 0xff, words * sizeof *v->history);
    v->history_bits = bits;
    v->layout = g->bit_layout;
    return HG_OK;
}

static struct hg_hosted_history history_of(const struct hg_visible *v, bool known)
{
    return (struct hg_hosted_history){known ? v->history : NULL, known ? v->history_bits : 0};
}

void hg_visible_reset(struct hg_visible *v)
{
    const struct hg_hosted_history history = history_of(v, true);
    if (v->tested && v->set_count > 0)
        learn(v);
    hg_hosted_reset(&v->hosted, &history);
    // Evenly coarser while not all fits; finer again, slowly, when it does.
    if (v->crowded)
        v->bias = fminf(fmaxf(v->bias, 1.0f) * ERROR_STEP, MOST_ERROR_PX);
    v->calm = v->crowded ? 0 : v->calm < CALM ? v->calm + 1 : CALM;
    v->crowded = false;
    v->tested = false;
    hg_listing_reset(&v->listing);
    v->set_count = v->item_count = v->candidate_count = v->command_count = 0;
}

// --- items ---------------------------------------------------------------------------------------

// What is being added.
struct adding {
    const struct hg_geometry *g;
    const struct hg_visible_view *view;
    struct hg_visible_set *set;
    struct hg_selection *late; // runs that come later; NULL: no occlusion
};

static const struct hg_gpu_part *part_of(const struct hg_geometry *g, uint32_t part)
{
    return (const struct hg_gpu_part *)(const void *)g->part_table.shadow + part;
}

static struct hg_visible_item item_of(const struct hg_geometry *g, uint32_t draw, bool numbered)
{
    const struct hg_draw_entry *d = &g->draws[draw];
    const struct hg_gpu_part *part = part_of(g, d->gpu.part);
    struct hg_visible_item item = {.first_draw = draw,
        .draw_count = 1,
        .flags = d->gpu.flags,
        .part = d->gpu.part,
        .positions = part->positions,
        .vertices = part->vertices,
        .extra = part->extra,
        .chunk = HG_LOD_NONE,
        .first_primitive = HG_CLUSTER_NONE,
        .command = HG_CLUSTER_NONE,
        .list = HG_LISTED_NONE,
        .numbered = numbered && !d->deformed && d->part->numbered_indices != NULL};
    if (!item.numbered)
        return item;
    item.position_buffer = d->part->buffer.handle;
    item.position_offset = d->part->numbered_positions_at;
    item.positions = d->part->buffer.address + item.position_offset;
    return item;
}

static enum hg_status push_item(struct hg_visible *v, const struct hg_visible_item *item)
{
    const enum hg_status status =
        hg_grow(&v->items, &v->item_capacity, v->item_count + 1, sizeof *v->items);
    if (status == HG_OK)
        v->items[v->item_count++] = *item;
    return status;
}

static uint32_t corners_of(uint32_t flags)
{
    return flags & HG_DRAW_POINTS ? 1 : flags & HG_DRAW_LINES ? 2 : 3;
}

// The whole part, joined with the item before where that is the same part.
static enum hg_status add_whole(struct hg_visible *v, const struct adding *a, uint32_t draw)
{
    const struct hg_geometry *g = a->g;
    const struct hg_visible_set *set = a->set;
    const struct hg_draw_entry *d = &g->draws[draw];
    struct hg_visible_item *last =
        v->item_count > set->first_item ? &v->items[v->item_count - 1] : NULL;
    if (last != NULL && last->index_buffer != VK_NULL_HANDLE && last->part == d->gpu.part &&
        last->flags == d->gpu.flags && last->first_draw + last->draw_count == draw) {
        last->draw_count++;
        return HG_OK;
    }
    struct hg_visible_item item = item_of(g, draw, set->numbered);
    item.index_count = d->part->index_count;
    item.primitive_count = d->part->primitive_count;
    item.index_buffer = d->part->buffer.handle;
    item.index_offset = item.numbered ? d->part->numbered_at : d->part->layout.indices;
    return push_item(v, &item);
}

static const uint32_t *indices_of(const struct hg_visible_item *item, const struct hg_part_entry *p)
{
    if (item->chunk != HG_LOD_NONE)
        return p->clusters->chunks[item->chunk].indices;
    return item->numbered ? p->numbered_indices : p->indices;
}

static enum hg_status fill_list(struct hg_visible *v, const struct adding *a,
    const struct hg_run *runs, uint32_t count, struct hg_visible_item *item)
{
    const struct hg_part_entry *part = a->g->draws[item->first_draw].part;
    struct hg_list list;
    hg_list_open(a->g, a->view, item, &list);
    enum hg_status status = hg_listing_begin(&v->listing, &list, &item->list);
    for (uint32_t i = 0; i < count && status == HG_OK; i++) {
        const struct hg_listed_run run = {.indices = indices_of(item, part),
            .first = runs[i].first,
            .count = runs[i].count,
            .base = item->chunk != HG_LOD_NONE ? item->chunk << HG_LOD_SHIFT : 0};
        status = hg_listing_add(&v->listing, &run);
    }
    if (status == HG_OK)
        hg_listing_end(&v->listing);
    return status;
}

// Runs of one draw and chunk as one item of its own list of indices.
static enum hg_status add_listed(
    struct hg_visible *v, const struct adding *a, const struct hg_run *runs, uint32_t count)
{
    struct hg_visible_item item = item_of(a->g, runs[0].draw, a->set->numbered);
    item.index_offset = v->listing.index_count * 4;
    item.chunk = runs[0].chunk;
    if (item.chunk != HG_LOD_NONE) {
        const struct hg_gpu_part *part =
            &a->g->draws[runs[0].draw].part->clusters->chunks[item.chunk].part;
        item.positions = part->positions;
        item.vertices = part->vertices;
        item.extra = part->extra;
    }
    for (uint32_t i = 0; i < count; i++)
        item.primitive_count += runs[i].count;
    item.index_count = item.primitive_count * corners_of(item.flags);
    const enum hg_status status = fill_list(v, a, runs, count, &item);
    if (status != HG_OK)
        return status;
    const struct hg_list *list = &v->listing.lists[item.list];
    item.joins = item.chunk != HG_LOD_NONE;
    item.listed = list->woven;
    if (item.listed) {
        item.numbered = true;
        item.position_offset = list->first_vertex * sizeof(struct hg_listed_vertex);
    } else if (!item.numbered) {
        item.first_primitive = list->first_id;
    }
    return push_item(v, &item);
}

// Instances far away show the same clusters: they join the item before.
static bool joins(
    const struct hg_visible *v, const struct adding *a, const struct hg_run *runs, uint32_t count)
{
    if (v->item_count == a->set->first_item)
        return false;
    const struct hg_visible_item *last = &v->items[v->item_count - 1];
    const struct hg_draw_entry *d = &a->g->draws[runs[0].draw];
    if (!last->joins || last->part != d->gpu.part || last->flags != d->gpu.flags ||
        last->first_draw + last->draw_count != runs[0].draw || last->chunk != runs[0].chunk ||
        v->listing.lists[last->list].run_count != count)
        return false;
    for (uint32_t i = 0; i < count; i++) {
        const struct hg_listed_run *c =
            &v->listing.runs[v->listing.lists[last->list].first_run + i];
        if (c->first != runs[i].first || c->count != runs[i].count)
            return false;
    }
    return true;
}

// Items of a draw of a baked part: one per chunk. Only draws of one chunk can be joined, so that
// items stay in draw order.
static enum hg_status add_chunks(
    struct hg_visible *v, const struct adding *a, const struct hg_run *runs, uint32_t count)
{
    if (runs[0].chunk == runs[count - 1].chunk && joins(v, a, runs, count)) {
        v->items[v->item_count - 1].draw_count++;
        return HG_OK;
    }
    enum hg_status status = HG_OK;
    for (uint32_t i = 0, n; i < count && status == HG_OK; i += n) {
        for (n = 1; i + n < count && runs[i + n].chunk == runs[i].chunk;)
            n++;
        status = add_listed(v, a, &runs[i], n);
        // The last of several chunks of a draw is no start for others to join.
        if (status == HG_OK && n != count)
            v->items[v->item_count - 1].joins = false;
    }
    return status;
}

static enum hg_status add_candidate(
    struct hg_visible *v, struct hg_visible_set *set, const struct hg_run *run, uint32_t command)
{
    const size_t need = (size_t)v->candidate_count + 1;
    if (hg_grow(&v->candidates, &v->candidate_capacity, need, sizeof *v->candidates) != HG_OK ||
        hg_grow(&v->candidate_bits, &v->bit_capacity, need, sizeof *v->candidate_bits) != HG_OK ||
        hg_grow(&v->candidate_triangles, &v->triangle_capacity, need,
            sizeof *v->candidate_triangles) != HG_OK)
        return HG_E_NOMEM;
    const uint32_t i = v->candidate_count++;
    v->candidates[i] = (struct hg_gpu_candidate){.draw = run->draw,
        .command = command,
        .center = {run->center[0], run->center[1], run->center[2]},
        .extent = {run->extent[0], run->extent[1], run->extent[2]}};
    v->candidate_bits[i] = run->bit;
    v->candidate_triangles[i] = run->count;
    set->candidate_count++;
    return HG_OK;
}

// The runs of one draw that come first; moves late ones behind them (in order).
static uint32_t split_runs(const struct hg_visible *v, struct hg_run *runs, uint32_t count,
    struct hg_selection *late, enum hg_status *status)
{
    uint32_t early = 0;
    for (uint32_t i = 0; i < count && *status == HG_OK; i++) {
        if (was_seen(v, runs[i].bit)) {
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
static enum hg_status add_draw(
    struct hg_visible *v, const struct adding *a, struct hg_run *runs, uint32_t count)
{
    enum hg_status status = HG_OK;
    struct hg_visible_set *set = a->set;
    struct hg_selection *late = a->late;
    const struct hg_draw_entry *d = &a->g->draws[runs[0].draw];
    uint32_t primitives = 0;
    if (late != NULL)
        count = split_runs(v, runs, count, late, &status);
    for (uint32_t i = 0; i < count && status == HG_OK; i++) {
        primitives += runs[i].count;
        if (late != NULL && runs[i].bit != HG_RUN_NO_BIT)
            status = add_candidate(v, set, &runs[i], HG_CLUSTER_NONE);
    }
    if (status != HG_OK || count == 0)
        return status;
    if (!(d->gpu.flags & (HG_DRAW_LINES | HG_DRAW_POINTS)))
        set->triangles += primitives;
    if (d->part->clusters != NULL)
        return add_chunks(v, a, runs, count);
    return primitives == d->part->primitive_count &&
                   !hg_list_sieves_part(a->g, a->view, runs[0].draw)
               ? add_whole(v, a, runs[0].draw)
               : add_listed(v, a, runs, count);
}

// Backwards, draws and primitives: of surfaces at the same depth the last that is drawn is seen.
// First index of the command and no offset of the buffer: lavapipe 22.3 forgets the latter in
// indirect draws.
static enum hg_status add_late(struct hg_visible *v, const struct adding *a)
{
    enum hg_status status = HG_OK;
    struct hg_visible_set *set = a->set;
    const struct hg_selection *late = a->late;
    set->first_late = v->item_count;
    for (uint32_t i = late->count; i > 0 && status == HG_OK; i--) {
        const struct hg_run *run = &late->items[i - 1];
        status =
            hg_grow(&v->commands, &v->command_capacity, v->command_count + 1, sizeof *v->commands);
        if (status == HG_OK)
            status = add_candidate(v, set, run, v->command_count);
        if (status == HG_OK)
            status = add_listed(v, a, run, 1);
        if (status != HG_OK)
            break;
        struct hg_visible_item *item = &v->items[v->item_count - 1];
        v->listing.lists[item->list].backwards = true;
        item->command = v->command_count;
        item->candidate = v->candidate_count - 1;
        v->commands[v->command_count++] =
            (struct hg_gpu_draw_command){.index_count = item->index_count,
                .first_index = (uint32_t)(item->index_offset / 4),
                .first_instance = run->draw};
        set->late_triangles += run->count;
    }
    set->late_count = v->item_count - set->first_late;
    return status;
}

static enum hg_draw_class class_of(uint32_t flags)
{
    return flags & HG_DRAW_BLEND  ? HG_DRAW_CLASS_BLEND
           : flags & HG_DRAW_MASK ? HG_DRAW_CLASS_MASK
                                  : HG_DRAW_CLASS_OPAQUE;
}

static enum hg_status add_items(struct hg_visible *v, const struct adding *a)
{
    enum hg_status status = HG_OK;
    struct hg_visible_set *set = a->set;
    for (uint32_t i = 0; i < 4; i++)
        set->class_first[i] = v->item_count;
    for (uint32_t i = 0, n; i < v->runs.count && status == HG_OK; i += n) {
        struct hg_run *runs = &v->runs.items[i];
        for (n = 1; i + n < v->runs.count && runs[n].draw == runs[0].draw;)
            n++;
        status = add_draw(v, a, runs, n);
        const enum hg_draw_class class = class_of(a->g->draws[runs[0].draw].gpu.flags);
        for (uint32_t c = class + 1u; c < 4; c++)
            set->class_first[c] = v->item_count;
    }
    set->item_count = v->item_count - set->first_item;
    if (status == HG_OK && a->late != NULL)
        status = add_late(v, a);
    return status;
}

static uint64_t triangles_of(const struct hg_selection *runs)
{
    uint64_t sum = 0;
    for (uint32_t i = 0; i < runs->count; i++)
        sum += runs->items[i].count;
    return sum;
}

static enum hg_status select_once(struct hg_visible *v, const struct hg_geometry *g,
    const struct hg_visible_view *view, struct hg_jobs *jobs, struct hg_error *err)
{
    v->runs.count = v->runs.want_count = 0;
    const enum hg_status status = hg_select(g, view, jobs, &v->runs);
    if (status != HG_OK)
        return hg_error_set(err, status, "draw lists", NULL, "no memory");
    if (hg_select_wants(g, view, &v->runs) != HG_OK)
        return hg_error_set(err, HG_E_NOMEM, "draw lists", NULL, "no memory");
    return HG_OK;
}

// A new frame for the pool: what earlier frames used may go, what the sets before use may not.
static void tick(const struct hg_visible *v, const struct hg_geometry *g)
{
    hg_cluster_pool_tick(g->pool);
    for (uint32_t i = 0; i < v->item_count; i++)
        if (v->items[i].chunk != HG_LOD_NONE)
            hg_cluster_pool_use(
                g->pool, g->draws[v->items[i].first_draw].part->clusters, v->items[i].chunk);
    hg_hosted_use(&v->hosted, g);
}

// One attempt to have all that is missing. *fits: all of it found room. What earlier frames left
// must not decide that: when there is no room, their chunks go, and what these are parts of as
// well.
static enum hg_status load_wanted(struct hg_visible *v, const struct hg_geometry *g,
    const struct hg_visible_view *view, struct hg_jobs *jobs, bool *fits, struct hg_error *err)
{
    enum hg_status status = HG_OK;
    uint32_t before = UINT32_MAX; // at first only what was not used in this frame goes
    *fits = false;
    while (status == HG_OK && !*fits && v->runs.want_count < before) {
        before = before == UINT32_MAX ? before - 1 : v->runs.want_count;
        status = hg_cluster_pool_load(g->pool, v->runs.wants, v->runs.want_count, view->whole, err);
        *fits = status == HG_OK;
        if (status == HG_E_AGAIN) {
            hg_cluster_pool_loosen(g->pool);
            tick(v, g);
            status = HG_OK;
        }
        if (status == HG_OK)
            status = select_once(v, g, view, jobs, err);
    }
    *fits = *fits || v->runs.want_count == 0;
    return status;
}

// Selects what the view shows. A view that waits loads what is missing; when the budget does not
// hold all of it, the error is raised for all parts alike until it does.
static enum hg_status select_runs(struct hg_visible *v, const struct hg_geometry *g,
    struct hg_visible_view *view, struct hg_jobs *jobs, bool *crowded, struct hg_error *err)
{
    *crowded = false;
    enum hg_status status = select_once(v, g, view, jobs, err);
    if (status == HG_OK && v->runs.want_count > 0 && !view->wait)
        *crowded = hg_cluster_pool_request(g->pool, v->runs.wants, v->runs.want_count);
    for (uint32_t round = 1; status == HG_OK && v->runs.want_count > 0 && view->wait; round++) {
        bool fits;
        status = load_wanted(v, g, view, jobs, &fits, err);
        if (status != HG_OK || (fits && round < MOST_ROUNDS))
            continue;
        round = 0;
        *crowded = v->runs.want_count > 0;
        if (view->whole || view->error_px >= MOST_ERROR_PX)
            break;
        view->error_px *= ERROR_STEP;
        status = select_once(v, g, view, jobs, err);
    }
    return status;
}

enum hg_status hg_visible_add(struct hg_visible *v, const struct hg_geometry *geometry,
    const struct hg_visible_view *wanted, struct hg_jobs *jobs, struct hg_error *err)
{
    struct hg_visible_view view = *wanted;
    struct hg_visible_set set = {.first_item = v->item_count,
        .first_candidate = v->candidate_count,
        .numbered = wanted->numbered};
    struct hg_selection late = {0};
    if (!view.wait && v->bias > 1.0f)
        view.error_px *= v->bias;
    bool crowded;
    enum hg_status status = select_runs(v, geometry, &view, jobs, &crowded, err);
    if (status != HG_OK)
        return status;
    v->crowded |= crowded && !view.wait;
    set.missing = v->runs.want_count;
    set.error_px = view.error_px;
    set.crowded = crowded || view.error_px > wanted->error_px;
    if (view.history)
        status = keep_history(v, geometry);
    const struct hg_hosted_history history = history_of(v, view.history);
    if (status == HG_OK && view.host != NULL)
        status =
            hg_hosted_take(&v->hosted, geometry, &view, &history, v->set_count, jobs, &v->runs);
    set.hosted = v->hosted.count > 0 && v->hosted.set == v->set_count;
    // What is in front of the host's pixels at the same depth must not depend on phases.
    const bool occlusion =
        view.history && !set.hosted && triangles_of(&v->runs) >= v->occlusion_from;
    if (status == HG_OK)
        status = add_items(v, &(struct adding){geometry, &view, &set, occlusion ? &late : NULL});
    hg_free(late.items);
    if (status == HG_OK)
        status = hg_grow(&v->sets, &v->set_capacity, v->set_count + 1, sizeof *v->sets);
    if (status != HG_OK)
        return hg_error_set(err, status, "draw lists", NULL, "no memory");
    v->sets[v->set_count++] = set;
    return HG_OK;
}

uint32_t hg_visible_count(const struct hg_visible *v)
{
    return v->set_count;
}

const struct hg_visible_set *hg_visible_set(const struct hg_visible *v, uint32_t set)
{
    return &v->sets[set];
}

const struct hg_visible_item *hg_visible_item(const struct hg_visible *v, uint32_t index)
{
    return &v->items[index];
}

// --- device --------------------------------------------------------------------------------------

struct need {
    struct hg_gpu_buffer *buffer;
    enum hg_gpu_buffer_kind kind;
    uint64_t bytes;
    const char *name;
};

static enum hg_status reserve(
    struct hg_visible *v, const struct need *needs, size_t count, struct hg_error *err)
{
    enum hg_status status = HG_OK;
    for (size_t i = 0; i < count && status == HG_OK; i++)
        if (needs[i].bytes > 0)
            status = hg_gpu_buffer_reserve(
                v->gpu, needs[i].kind, needs[i].bytes, needs[i].name, needs[i].buffer, err);
    return status;
}

// What came through its sieve is what is drawn of an item. Returns how many triangles are not.
static uint32_t narrow_item(struct hg_visible *v, struct hg_visible_item *item)
{
    if (item->list == HG_LISTED_NONE || !v->listing.lists[item->list].sieved)
        return 0;
    const uint32_t before = item->primitive_count;
    item->primitive_count = v->listing.lists[item->list].kept;
    item->index_count = item->primitive_count * 3;
    if (item->command != HG_CLUSTER_NONE) {
        v->commands[item->command].index_count = item->index_count;
        v->candidate_triangles[item->candidate] = item->primitive_count;
    }
    return before - item->primitive_count;
}

static void narrow_sets(struct hg_visible *v)
{
    for (uint32_t i = 0; i < v->set_count; i++) {
        struct hg_visible_set *set = &v->sets[i];
        for (uint32_t k = 0; k < set->item_count; k++)
            set->triangles -= narrow_item(v, &v->items[set->first_item + k]);
        for (uint32_t k = 0; k < set->late_count; k++)
            set->late_triangles -= narrow_item(v, &v->items[set->first_late + k]);
    }
}

enum hg_status hg_visible_upload(struct hg_visible *v, struct hg_jobs *jobs, struct hg_error *err)
{
    const uint64_t candidates = v->candidate_count;
    const uint64_t command_bytes = v->command_count * sizeof *v->commands;
    const struct need needs[] = {
        {&v->indices, HG_GPU_BUFFER_UPLOAD, v->listing.index_count * 4, "listed indices"},
        {&v->ids, HG_GPU_BUFFER_UPLOAD, v->listing.id_count * 4ull, "listed primitives"},
        {&v->vertices, HG_GPU_BUFFER_UPLOAD,
            v->listing.vertex_count * sizeof(struct hg_listed_vertex), "listed vertices"},
        {&v->candidate_buffer, HG_GPU_BUFFER_UPLOAD, candidates * sizeof *v->candidates,
            "candidates"},
        {&v->command_buffer, HG_GPU_BUFFER_UPLOAD, command_bytes, "late draws"},
        {&v->flags, HG_GPU_BUFFER_READBACK, candidates * 4, "visible candidates"},
    };
    const enum hg_status status = reserve(v, needs, sizeof needs / sizeof needs[0], err);
    if (status != HG_OK)
        return status;
    const struct hg_listing_memory memory = {v->indices.mapped, v->ids.mapped, v->vertices.mapped};
    hg_listing_write(&v->listing, jobs, &memory);
    narrow_sets(v);
    if (candidates > 0)
        memcpy(v->candidate_buffer.mapped, v->candidates, candidates * sizeof *v->candidates);
    if (command_bytes > 0)
        memcpy(v->command_buffer.mapped, v->commands, command_bytes);
    return HG_OK;
}

void hg_visible_draw(
    const struct hg_visible *v, struct hg_gpu_cmd *cmd, const struct hg_visible_item *item)
{
    const VkCommandBuffer handle = hg_gpu_cmd_handle(cmd);
    const VkBuffer indices =
        item->index_buffer != VK_NULL_HANDLE ? item->index_buffer : v->indices.handle;
    vkCmdBindIndexBuffer(handle, indices, item->command == HG_CLUSTER_NONE ? item->index_offset : 0,
        VK_INDEX_TYPE_UINT32);
    const VkBuffer vertices = item->listed ? v->vertices.handle : item->position_buffer;
    if (item->numbered)
        vkCmdBindVertexBuffers(handle, 0, 1, &vertices, &item->position_offset);
    if (item->command == HG_CLUSTER_NONE)
        vkCmdDrawIndexed(handle, item->index_count, item->draw_count, 0, 0, item->first_draw);
    else
        vkCmdDrawIndexedIndirect(handle, v->command_buffer.handle,
            (uint64_t)item->command * sizeof *v->commands, 1, sizeof *v->commands);
}

void hg_visible_fill(
    const struct hg_visible *v, const struct hg_visible_item *item, struct hg_gpu_item *out)
{
    *out = (struct hg_gpu_item){.positions = item->positions,
        .vertices = item->vertices,
        .extra = item->extra,
        .depth = v->depth.address,
        .seen = v->seen.address};
    if (item->first_primitive != HG_CLUSTER_NONE)
        out->primitives = v->ids.address + item->first_primitive * 4ull;
}

// --- what the host draws -------------------------------------------------------------------------

enum hg_status hg_visible_host(struct hg_visible *v, const struct hg_visible_lens *lens,
    uint32_t slot, uint32_t slots, struct hg_jobs *jobs, struct hg_error *err)
{
    return hg_hosted_draw(&v->hosted, v->gpu, lens, slot, slots, jobs, err);
}

void hg_visible_copy_hosted(const struct hg_visible *v, struct hg_gpu_cmd *cmd, uint32_t slot,
    struct hg_gpu_image *visibility, struct hg_gpu_image *depth, VkRect2D area)
{
    hg_hosted_copy(&v->hosted, cmd, slot, visibility, depth, area);
}

// --- occlusion -----------------------------------------------------------------------------------

static enum hg_status reserve_pyramid(
    struct hg_visible *v, const struct hg_gpu_image *depth, bool late, struct hg_error *err)
{
    const uint64_t px = (uint64_t)depth->width * depth->height;
    const uint64_t side = HG_OCCLUSION_BLOCK;
    const uint64_t fine = ((depth->width + side - 1) / side) * ((depth->height + side - 1) / side);
    const struct need needs[] = {
        {&v->depth, HG_GPU_BUFFER_DEVICE, px * 4, "depth of the first phase"},
        {&v->blocks, HG_GPU_BUFFER_DEVICE, fine * 8, "depth pyramid"},
        {&v->seen, HG_GPU_BUFFER_DEVICE, late ? px * 8 : 0, "ids of the first phase"},
    };
    return reserve(v, needs, sizeof needs / sizeof needs[0], err);
}

struct kernel {
    const char *shader;
    uint32_t variant, groups[2];
};

static enum hg_status dispatch(struct hg_gpu_cmd *cmd, const struct kernel *kernel, uint32_t tables,
    uint32_t features, const struct hg_gpu_occlusion *push, struct hg_error *err)
{
    const struct hg_gpu_pipeline_params params = {
        .compute = kernel->shader, .spec = {0, tables, features, kernel->variant}, .spec_count = 4};
    const enum hg_status status = hg_gpu_cmd_pipeline(cmd, &params, err);
    if (status != HG_OK)
        return status;
    hg_gpu_cmd_push(cmd, push, sizeof *push);
    vkCmdDispatch(hg_gpu_cmd_handle(cmd), kernel->groups[0], kernel->groups[1], 1);
    hg_gpu_memory_barrier(cmd);
    return HG_OK;
}

enum hg_status hg_visible_test(struct hg_visible *v, struct hg_gpu_cmd *cmd, uint32_t set_index,
    struct hg_gpu_image *depth, struct hg_gpu_image *visibility, uint32_t tables, uint32_t features,
    struct hg_error *err)
{
    const struct hg_visible_set *set = &v->sets[set_index];
    const struct hg_gpu_region all = {.width = depth->width, .height = depth->height};
    enum hg_status status = reserve_pyramid(v, depth, set->late_count > 0, err);
    if (status != HG_OK)
        return status;
    hg_gpu_image_read(cmd, depth, &all, &v->depth, 0);
    if (set->late_count > 0)
        hg_gpu_image_read(cmd, visibility, &all, &v->seen, 0);
    hg_gpu_memory_barrier(cmd);
    const struct hg_gpu_occlusion push = {
        .candidates =
            v->candidate_buffer.address + set->first_candidate * (uint64_t)sizeof *v->candidates,
        .visible = v->flags.address + set->first_candidate * 4ull,
        .commands = v->command_buffer.address,
        .depth = v->depth.address,
        .blocks = v->blocks.address,
        .candidate_count = set->candidate_count,
        .width = depth->width,
        .height = depth->height};
    const uint32_t b = HG_OCCLUSION_BLOCK, w = HG_OCCLUSION_WIDE;
    const uint32_t fine[2] = {(depth->width + b - 1) / b, (depth->height + b - 1) / b};
    const struct kernel kernels[] = {
        {"occlusion_reduce.comp", 0, {(fine[0] + 7) / 8, (fine[1] + 7) / 8}},
        {"occlusion_reduce.comp", 1,
            {((fine[0] + w - 1) / w + 7) / 8, ((fine[1] + w - 1) / w + 7) / 8}},
        {"occlusion_test.comp", 0,
            {(set->candidate_count + HG_CLUSTER_GROUP - 1) / HG_CLUSTER_GROUP, 1}},
    };
    for (size_t i = 0; i < sizeof kernels / sizeof kernels[0] && status == HG_OK; i++)
        status = dispatch(cmd, &kernels[i], tables, features, &push, err);
    v->tested = v->tested || (status == HG_OK && set_index == 0);
    return status;
}

void hg_visible_stats(const struct hg_visible *v, struct hg_visible_stats *out)
{
    *out = (struct hg_visible_stats){0};
    const struct hg_gpu_buffer *all[] = BUFFERS(v);
    for (size_t i = 0; i < sizeof all / sizeof all[0]; i++)
        out->bytes += all[i]->size_bytes;
    if (v->set_count == 0)
        return;
    const struct hg_visible_set *set = &v->sets[0];
    out->triangles = set->triangles + (set->hosted ? hg_hosted_triangles(&v->hosted) : 0);
    out->late = set->late_count;
    for (uint32_t i = 0; i < set->item_count; i++)
        out->draws += v->items[set->first_item + i].draw_count;
    const uint32_t *flags = v->flags.mapped;
    for (uint32_t i = 0; v->tested && i < set->candidate_count; i++) {
        const bool seen = flags[set->first_candidate + i] != 0;
        out->hidden += !seen;
        if (seen && v->candidates[set->first_candidate + i].command != HG_CLUSTER_NONE)
            out->triangles += v->candidate_triangles[set->first_candidate + i];
    }
}
