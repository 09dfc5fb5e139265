// compile.c - the order of passes, what is left out, how long images are needed.
#include <string.h>

#include "base/alloc.h"
#include "renderer/graph/internal.h"

#define WORDS (HG_GRAPH_MAX_PASSES / 64)

struct set { // of passes
    uint64_t bits[WORDS];
};

static void add(struct set *set, uint32_t i)
{
    set->bits[i / 64] |= UINT64_C(1) << i % 64;
}

static bool has(const struct set *set, uint32_t i)
{
    return (set->bits[i / 64] >> i % 64 & 1) != 0;
}

struct work {
    const struct hg_graph_plan *plan;
    struct set before[HG_GRAPH_MAX_PASSES]; // passes that come first
    struct set feeds[HG_GRAPH_MAX_PASSES];  // of those, the ones whose results are read
    struct set live;
};

struct effect { // of one pass on one resource
    bool reads, writes;
};

static struct effect effect_on(const struct hg_graph_node *node, uint32_t resource)
{
    struct effect e = {false, false};
    for (uint32_t i = 0; i < node->use_count; i++) {
        if (node->uses[i].resource != resource)
            continue;
        e.reads |= hg_graph_meanings[node->uses[i].how].reads;
        e.writes |= hg_graph_meanings[node->uses[i].how].writes;
    }
    return e;
}

static enum hg_status nothing_writes(
    const struct work *w, uint32_t pass, uint32_t resource, struct hg_error *err)
{
    return hg_error_set(err, HG_E_INVAL, "frame graph", w->plan->nodes[pass].name,
        "reads %s, which no pass writes before", w->plan->resources[resource].name);
}

// Passes wait for others because of one resource.
struct chain {
    uint32_t writer;    // newest; HG_GRAPH_NONE
    struct set readers; // of what it wrote
    struct set early;   // readers that came before any writer
    uint32_t first_early;
};

static void wait_for_all(struct work *w, uint32_t pass, const struct set *others)
{
    for (uint32_t i = 0; i < WORDS; i++)
        w->before[pass].bits[i] |= others->bits[i];
}

static void note_write(struct work *w, struct chain *c, uint32_t pass)
{
    if (c->writer != HG_GRAPH_NONE)
        add(&w->before[pass], c->writer);
    wait_for_all(w, pass, &c->readers);
    c->readers = (struct set){{0}};
    for (uint32_t i = 0; c->writer == HG_GRAPH_NONE && i < w->plan->node_count; i++) {
        if (!has(&c->early, i))
            continue;
        add(&w->before[i], pass);
        add(&w->feeds[i], pass);
        add(&c->readers, i);
    }
    c->writer = pass;
}

static enum hg_status follow(struct work *w, uint32_t resource, struct hg_error *err)
{
    const struct hg_graph_resource *r = &w->plan->resources[resource];
    const bool empty = r->kind == HG_GRAPH_OWN && r->life != HG_GRAPH_PERSISTENT;
    struct chain c = {.writer = HG_GRAPH_NONE, .first_early = HG_GRAPH_NONE};
    for (uint32_t pass = 0; pass < w->plan->node_count; pass++) {
        const struct effect e = effect_on(&w->plan->nodes[pass], resource);
        if (e.reads && c.writer != HG_GRAPH_NONE) {
            add(&w->before[pass], c.writer);
            add(&w->feeds[pass], c.writer);
        } else if (e.reads && empty && e.writes) {
            return nothing_writes(w, pass, resource, err);
        } else if (e.reads && empty) {
            c.first_early = c.first_early == HG_GRAPH_NONE ? pass : c.first_early;
            add(&c.early, pass);
        }
        if (e.writes)
            note_write(w, &c, pass);
        else if (e.reads && !has(&c.early, pass))
            add(&c.readers, pass);
    }
    if (c.writer == HG_GRAPH_NONE && c.first_early != HG_GRAPH_NONE)
        return nothing_writes(w, c.first_early, resource, err);
    return HG_OK;
}

// The pass that has the last word on a resource.
static uint32_t last_writer(const struct hg_graph_plan *plan, uint32_t resource)
{
    for (uint32_t pass = plan->node_count; pass > 0; pass--) {
        if (effect_on(&plan->nodes[pass - 1], resource).writes)
            return pass - 1;
    }
    return HG_GRAPH_NONE;
}

// Marks what a resource's contents at the end of the frame depend on; *again when that is new.
static void want(struct work *w, uint32_t resource, bool *again)
{
    const uint32_t pass = last_writer(w->plan, resource);
    if (pass == HG_GRAPH_NONE || has(&w->live, pass))
        return;
    add(&w->live, pass);
    *again = true;
}

static void want_inputs(struct work *w, uint32_t pass, bool *again)
{
    const struct hg_graph_node *node = &w->plan->nodes[pass];
    for (uint32_t i = 0; i < WORDS; i++) {
        const uint64_t more = w->feeds[pass].bits[i] & ~w->live.bits[i];
        w->live.bits[i] |= more;
        *again |= more != 0;
    }
    for (uint32_t i = 0; i < node->use_count; i++) { // of the next frame this is the one before
        const struct hg_graph_resource *r = &w->plan->resources[node->uses[i].resource];
        if (r->kind == HG_GRAPH_PREVIOUS)
            want(w, r->current, again);
    }
}

static void find_live(struct work *w)
{
    bool again = true;
    for (uint32_t i = 0; i < w->plan->node_count; i++)
        if (w->plan->nodes[i].keep)
            add(&w->live, i);
    for (uint32_t i = 0; i < w->plan->resource_count; i++)
        if (w->plan->resources[i].wanted)
            want(w, i, &again);
    while (again) {
        again = false;
        for (uint32_t i = 0; i < w->plan->node_count; i++)
            if (has(&w->live, i))
                want_inputs(w, i, &again);
    }
}

static bool is_ready(const struct work *w, uint32_t pass, const struct set *done)
{
    for (uint32_t i = 0; i < WORDS; i++) {
        if ((w->before[pass].bits[i] & w->live.bits[i] & ~done->bits[i]) != 0)
            return false;
    }
    return true;
}

static enum hg_status refuse_cycle(
    const struct work *w, const struct set *done, struct hg_error *err)
{
    uint32_t pass = 0, other = 0;
    while (!has(&w->live, pass) || has(done, pass))
        pass++;
    while (!has(&w->before[pass], other) || !has(&w->live, other) || has(done, other))
        other++;
    return hg_error_set(err, HG_E_INVAL, "frame graph", w->plan->nodes[pass].name,
        "waits for %s, which waits for it", w->plan->nodes[other].name);
}

// Of the passes that can run the one that was declared first.
static enum hg_status sort(struct work *w, struct hg_graph_plan *plan, struct hg_error *err)
{
    struct set done = {{0}};
    plan->order_count = 0;
    for (;;) {
        uint32_t next = HG_GRAPH_NONE;
        bool left = false;
        for (uint32_t i = 0; i < plan->node_count && next == HG_GRAPH_NONE; i++) {
            if (!has(&w->live, i) || has(&done, i))
                continue;
            left = true;
            if (is_ready(w, i, &done))
                next = i;
        }
        if (!left)
            return HG_OK;
        if (next == HG_GRAPH_NONE)
            return refuse_cycle(w, &done, err);
        add(&done, next);
        plan->order[plan->order_count++] = next;
    }
}

// From the first to the last pass that touches it; to all of the execution when that is one which
// runs once and others use it again and again.
static void find_life(struct hg_graph_plan *plan, uint32_t resource)
{
    struct hg_graph_slot *slot = &plan->slots[resource];
    bool once = false, often = false;
    slot->first = HG_GRAPH_NONE;
    for (uint32_t place = 0; place < plan->order_count; place++) {
        const struct hg_graph_node *node = &plan->nodes[plan->order[place]];
        bool used = false;
        for (uint32_t i = 0; i < node->use_count; i++)
            used |= node->uses[i].resource == resource;
        if (!used)
            continue;
        slot->first = slot->first == HG_GRAPH_NONE ? place : slot->first;
        slot->last = place;
        once |= node->once;
        often |= !node->once;
    }
    if (once && often) {
        slot->first = 0;
        slot->last = plan->order_count - 1;
    }
}

// Fills order and the slots' lifetimes of a plan whose declarations are set.
static enum hg_status order_passes(struct hg_graph_plan *plan, struct hg_error *err)
{
    struct work *w = hg_calloc(1, sizeof *w);
    if (w == NULL)
        return hg_error_set(err, HG_E_NOMEM, "frame graph", NULL, "out of host memory");
    w->plan = plan;
    enum hg_status status = HG_OK;
    for (uint32_t i = 0; i < plan->resource_count && status == HG_OK; i++)
        if (plan->resources[i].kind != HG_GRAPH_PREVIOUS)
            status = follow(w, i, err);
    if (status == HG_OK) {
        find_live(w);
        status = sort(w, plan, err);
    }
    for (uint32_t i = 0; i < plan->resource_count && status == HG_OK; i++)
        find_life(plan, i);
    hg_free(w);
    return status;
}

// --- plans ---------------------------------------------------------------------------------------

static bool is_plan_of(const struct hg_graph_plan *plan, const struct hg_graph_frame *frame)
{
    return plan->used > 0 && plan->width == frame->width && plan->height == frame->height &&
           plan->resource_count == frame->resource_count && plan->node_count == frame->node_count &&
           memcmp(plan->resources, frame->resources,
               frame->resource_count * sizeof frame->resources[0]) == 0 &&
           memcmp(plan->nodes, frame->nodes, frame->node_count * sizeof frame->nodes[0]) == 0;
}

// The one that was not used for the longest time.
static struct hg_graph_plan *oldest_plan(struct hg_graph *graph)
{
    struct hg_graph_plan *oldest = &graph->plans[0];
    for (uint32_t i = 1; i < HG_GRAPH_PLANS; i++)
        if (graph->plans[i].used < oldest->used)
            oldest = &graph->plans[i];
    return oldest;
}

static void empty_plan(struct hg_graph *graph, struct hg_graph_plan *plan)
{
    hg_graph_drop_images(graph, plan);
    hg_free(plan->resources);
    hg_free(plan->nodes);
    hg_free(plan->slots);
    hg_free(plan->order);
    *plan = (struct hg_graph_plan){0};
}

static enum hg_status copy_frame(
    struct hg_graph_plan *plan, const struct hg_graph_frame *frame, struct hg_error *err)
{
    plan->resources = hg_calloc(frame->resource_count, sizeof *plan->resources);
    plan->nodes = hg_calloc(frame->node_count, sizeof *plan->nodes);
    plan->slots = hg_calloc(frame->resource_count, sizeof *plan->slots);
    plan->order = hg_calloc(frame->node_count, sizeof *plan->order);
    if (plan->resources == NULL || plan->nodes == NULL || plan->slots == NULL ||
        plan->order == NULL)
        return hg_error_set(err, HG_E_NOMEM, "frame graph", NULL, "out of host memory");
    plan->width = frame->width;
    plan->height = frame->height;
    plan->resource_count = frame->resource_count;
    plan->node_count = frame->node_count;
    memcpy(plan->resources, frame->resources, frame->resource_count * sizeof *plan->resources);
    memcpy(plan->nodes, frame->nodes, frame->node_count * sizeof *plan->nodes);
    return HG_OK;
}

// Images of another size go at once: those of the view that is left are large.
static void follow_size(struct hg_graph *graph)
{
    const struct hg_graph_frame *frame = graph->frame;
    if (graph->width != frame->width || graph->height != frame->height) {
        for (uint32_t i = 0; i < HG_GRAPH_PLANS; i++)
            empty_plan(graph, &graph->plans[i]);
        hg_gpu_memory_destroy(graph->gpu, &graph->heap);
    }
    graph->width = frame->width;
    graph->height = frame->height;
}

enum hg_status hg_graph_compile(struct hg_graph *graph, struct hg_error *err)
{
    graph->plan = NULL;
    if (graph->is_refused) {
        *err = graph->refused;
        return HG_E_INVAL;
    }
    follow_size(graph);
    struct hg_graph_plan *plan = NULL;
    for (uint32_t i = 0; i < HG_GRAPH_PLANS; i++)
        if (is_plan_of(&graph->plans[i], graph->frame))
            plan = &graph->plans[i];
    enum hg_status status = HG_OK;
    if (plan == NULL) {
        plan = oldest_plan(graph);
        empty_plan(graph, plan);
        status = copy_frame(plan, graph->frame, err);
        if (status == HG_OK)
            status = order_passes(plan, err);
        graph->compilations++;
    }
    if (status == HG_OK)
        status = hg_graph_make_stores(graph, plan, err);
    if (status == HG_OK)
        status = hg_graph_place_all(graph, plan, err);
    if (status != HG_OK) {
        empty_plan(graph, plan);
        return status;
    }
    plan->used = graph->number;
    graph->plan = plan;
    hg_graph_drop_old_stores(graph);
    return HG_OK;
}
