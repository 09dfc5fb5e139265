// residency.c - see residency.h. Items are nodes of one array, found through a hash table of node
// numbers (linear probing, deletion by shifting back). Resident nodes that are not pinned are in a
// list ordered by last use, requested ones in a binary heap ordered by priority.
#include "renderer/residency/residency.h"

#include <string.h>

#include "base/alloc.h"
#include "base/checked.h"

#define NONE             UINT32_MAX
#define DEFAULT_REQUESTS 4096
#define DEFAULT_PATIENCE 8

enum state { FREE, REQUESTED, IN_FLIGHT, RESIDENT };

struct node {
    uint64_t key;
    uint32_t state;
    uint32_t frame;        // of the last use or request
    uint32_t slot, pins;   // resident
    uint32_t older, newer; // resident: the list; free: older = next free node
    uint32_t heap;         // place in the heap, requested
    float priority;
};

struct hg_residency {
    struct hg_residency_params params;
    uint32_t frame;
    struct node *nodes;
    uint32_t node_count, free_node;
    uint32_t *table; // node numbers, NONE = empty
    uint32_t table_mask;
    uint32_t *slots;                       // node of each slot, NONE = free
    uint32_t *free_slots, free_slot_count; // a stack, lowest slot on top
    uint32_t oldest, newest;
    uint32_t *heap, heap_count;
    struct hg_residency_stats stats;
};

// --- memory --------------------------------------------------------------------------------------

static uint32_t table_size(uint32_t nodes)
{
    uint32_t size = 16;
    while (size < 2 * nodes)
        size *= 2;
    return size;
}

static uint32_t hash(uint64_t key)
{
    key ^= key >> 32; // finaliser of splitmix64
    key *= 0xbf58476d1ce4e5b9ull;
    key ^= key >> 29;
    key *= 0x94d049bb133111ebull;
    return (uint32_t)(key >> 32);
}

enum hg_status hg_residency_create(
    const struct hg_residency_params *params, struct hg_residency **out)
{
    *out = NULL;
    struct hg_residency *r = hg_calloc(1, sizeof *r);
    if (r == NULL)
        return HG_E_NOMEM;
    r->params = *params;
    if (r->params.requests == 0)
        r->params.requests = DEFAULT_REQUESTS;
    if (r->params.patience == 0)
        r->params.patience = DEFAULT_PATIENCE;
    r->params.slots = 0;
    r->oldest = r->newest = r->free_node = NONE;
    r->heap = hg_calloc(r->params.requests, sizeof *r->heap);
    const enum hg_status status =
        r->heap != NULL ? hg_residency_resize(r, params->slots) : HG_E_NOMEM;
    if (status != HG_OK) {
        hg_residency_destroy(r);
        return status;
    }
    *out = r;
    return HG_OK;
}

void hg_residency_destroy(struct hg_residency *r)
{
    if (r == NULL)
        return;
    hg_free(r->nodes);
    hg_free(r->table);
    hg_free(r->slots);
    hg_free(r->free_slots);
    hg_free(r->heap);
    hg_free(r);
}

static void fill_table(struct hg_residency *r)
{
    memset(r->table, 0xff, ((size_t)r->table_mask + 1) * sizeof *r->table);
    for (uint32_t i = 0; i < r->node_count; i++) {
        if (r->nodes[i].state == FREE)
            continue;
        uint32_t at = hash(r->nodes[i].key) & r->table_mask;
        while (r->table[at] != NONE)
            at = (at + 1) & r->table_mask;
        r->table[at] = i;
    }
}

static void link_free(struct hg_residency *r, uint32_t from)
{
    for (uint32_t i = r->node_count; i-- > from;) {
        r->nodes[i] = (struct node){.key = HG_RESIDENCY_NO_KEY, .older = r->free_node};
        r->free_node = i;
    }
    r->free_slot_count = 0;
    for (uint32_t i = r->params.slots; i-- > 0;)
        if (r->slots[i] == NONE)
            r->free_slots[r->free_slot_count++] = i;
}

// Arrays only grow: fewer slots leave room that is used again.
enum hg_status hg_residency_resize(struct hg_residency *r, uint32_t slots)
{
    size_t nodes;
    if (!hg_add_size(slots, r->params.requests, &nodes) || nodes > UINT32_MAX / 4)
        return HG_E_NOMEM;
    const uint32_t had = r->node_count;
    if (nodes > had) {
        const uint32_t size = table_size((uint32_t)nodes);
        uint32_t *table = hg_calloc(size, sizeof *table);
        struct node *n = hg_realloc(r->nodes, nodes, sizeof *n);
        r->nodes = n != NULL ? n : r->nodes;
        uint32_t *s = hg_realloc(r->slots, slots > 0 ? slots : 1, sizeof *s);
        r->slots = s != NULL ? s : r->slots;
        uint32_t *f = hg_realloc(r->free_slots, slots > 0 ? slots : 1, sizeof *f);
        r->free_slots = f != NULL ? f : r->free_slots;
        if (table == NULL || n == NULL || s == NULL || f == NULL) {
            hg_free(table);
            return HG_E_NOMEM;
        }
        hg_free(r->table);
        r->table = table;
        r->table_mask = size - 1;
        r->node_count = (uint32_t)nodes;
    }
    for (uint32_t i = r->params.slots; i < slots; i++)
        r->slots[i] = NONE;
    r->params.slots = slots;
    link_free(r, nodes > had ? had : r->node_count);
    fill_table(r);
    return HG_OK;
}

// --- nodes ---------------------------------------------------------------------------------------

static uint32_t find(const struct hg_residency *r, uint64_t key)
{
    for (uint32_t at = hash(key) & r->table_mask; r->table[at] != NONE;
         at = (at + 1) & r->table_mask)
        if (r->nodes[r->table[at]].key == key)
            return r->table[at];
    return NONE;
}

static uint32_t add(struct hg_residency *r, uint64_t key)
{
    const uint32_t i = r->free_node;
    r->free_node = r->nodes[i].older;
    r->nodes[i] = (struct node){.key = key, .frame = r->frame, .older = NONE, .newer = NONE};
    uint32_t at = hash(key) & r->table_mask;
    while (r->table[at] != NONE)
        at = (at + 1) & r->table_mask;
    r->table[at] = i;
    return i;
}

static void forget(struct hg_residency *r, uint32_t i)
{
    uint32_t hole = hash(r->nodes[i].key) & r->table_mask;
    while (r->table[hole] != i)
        hole = (hole + 1) & r->table_mask;
    // Later entries of the run move up when their own place does not lie behind the hole.
    for (uint32_t at = (hole + 1) & r->table_mask; r->table[at] != NONE;
         at = (at + 1) & r->table_mask) {
        const uint32_t home = hash(r->nodes[r->table[at]].key) & r->table_mask;
        if (((at - home) & r->table_mask) < ((at - hole) & r->table_mask))
            continue;
        r->table[hole] = r->table[at];
        hole = at;
    }
    r->table[hole] = NONE;
    r->nodes[i] = (struct node){.key = HG_RESIDENCY_NO_KEY, .older = r->free_node};
    r->free_node = i;
}

// --- the list of resident items that are not pinned
// ------------------------------------------------------------------

static void unlink_node(struct hg_residency *r, uint32_t i)
{
    struct node *n = &r->nodes[i];
    if (n->older != NONE)
        r->nodes[n->older].newer = n->newer;
    else
        r->oldest = n->newer;
    if (n->newer != NONE)
        r->nodes[n->newer].older = n->older;
    else
        r->newest = n->older;
    n->older = n->newer = NONE;
}

static void link_newest(struct hg_residency *r, uint32_t i)
{
    struct node *n = &r->nodes[i];
    n->older = r->newest;
    n->newer = NONE;
    if (r->newest != NONE)
        r->nodes[r->newest].newer = i;
    else
        r->oldest = i;
    r->newest = i;
}

// --- the heap of requests ------------------------------------------------------------------------

static bool before(const struct node *a, const struct node *b)
{
    return a->priority != b->priority ? a->priority > b->priority : a->key < b->key;
}

static void put_heap(struct hg_residency *r, uint32_t at, uint32_t i)
{
    r->heap[at] = i;
    r->nodes[i].heap = at;
}

// Moves node i from place `at` to where it belongs.
static void settle(struct hg_residency *r, uint32_t at, uint32_t i)
{
    const struct node *n = &r->nodes[i];
    while (at > 0 && before(n, &r->nodes[r->heap[(at - 1) / 2]])) {
        put_heap(r, at, r->heap[(at - 1) / 2]);
        at = (at - 1) / 2;
    }
    for (;;) {
        uint32_t child = 2 * at + 1;
        if (child >= r->heap_count)
            break;
        if (child + 1 < r->heap_count &&
            before(&r->nodes[r->heap[child + 1]], &r->nodes[r->heap[child]]))
            child++;
        if (!before(&r->nodes[r->heap[child]], n))
            break;
        put_heap(r, at, r->heap[child]);
        at = child;
    }
    put_heap(r, at, i);
}

static void leave_heap(struct hg_residency *r, uint32_t i)
{
    const uint32_t at = r->nodes[i].heap, last = r->heap[--r->heap_count];
    if (last != i)
        settle(r, at, last);
}

// --- frames and uses -----------------------------------------------------------------------------

void hg_residency_tick(struct hg_residency *r)
{
    r->frame++;
    for (uint32_t at = r->heap_count; at-- > 0;) {
        // What takes the place of a request that leaves may not have been looked at yet.
        while (at < r->heap_count && r->frame - r->nodes[r->heap[at]].frame > r->params.patience) {
            const uint32_t i = r->heap[at];
            leave_heap(r, i);
            forget(r, i);
        }
    }
}

uint32_t hg_residency_frame(const struct hg_residency *r)
{
    return r->frame;
}

uint32_t hg_residency_find(const struct hg_residency *r, uint64_t key)
{
    const uint32_t i = find(r, key);
    return i != NONE && r->nodes[i].state == RESIDENT ? r->nodes[i].slot : HG_RESIDENCY_NONE;
}

uint64_t hg_residency_item(const struct hg_residency *r, uint32_t slot)
{
    return r->slots[slot] != NONE ? r->nodes[r->slots[slot]].key : HG_RESIDENCY_NO_KEY;
}

bool hg_residency_is_in_flight(const struct hg_residency *r, uint64_t key)
{
    const uint32_t i = find(r, key);
    return i != NONE && r->nodes[i].state == IN_FLIGHT;
}

void hg_residency_use(struct hg_residency *r, uint32_t slot)
{
    const uint32_t i = r->slots[slot];
    if (i == NONE || r->nodes[i].frame == r->frame)
        return;
    r->nodes[i].frame = r->frame;
    if (r->nodes[i].pins > 0)
        return;
    unlink_node(r, i);
    link_newest(r, i);
}

void hg_residency_pin(struct hg_residency *r, uint32_t slot)
{
    const uint32_t i = r->slots[slot];
    if (i == NONE || r->nodes[i].pins++ > 0)
        return;
    unlink_node(r, i); // pinned items are in no list
    r->stats.pinned++;
}

void hg_residency_unpin(struct hg_residency *r, uint32_t slot)
{
    const uint32_t i = r->slots[slot];
    if (i == NONE || r->nodes[i].pins == 0 || --r->nodes[i].pins > 0)
        return;
    r->nodes[i].frame = r->frame; // the list is in order of use
    link_newest(r, i);
    r->stats.pinned--;
}

uint32_t hg_residency_age(const struct hg_residency *r, uint32_t slot)
{
    return r->slots[slot] != NONE ? r->frame - r->nodes[r->slots[slot]].frame : UINT32_MAX;
}

// --- requests ------------------------------------------------------------------------------------

// Least urgent request; leaves of the heap are enough to look at.
static uint32_t least_urgent(const struct hg_residency *r)
{
    uint32_t worst = r->heap[r->heap_count / 2];
    for (uint32_t at = r->heap_count / 2 + 1; at < r->heap_count; at++)
        if (before(&r->nodes[worst], &r->nodes[r->heap[at]]))
            worst = r->heap[at];
    return worst;
}

// Room for one more request, made by dropping a less urgent one when the queue is full.
static bool make_room(struct hg_residency *r, uint64_t key, float priority)
{
    if (r->heap_count + r->stats.in_flight < r->params.requests)
        return true;
    r->stats.refused++;
    if (r->heap_count == 0)
        return false;
    const uint32_t worst = least_urgent(r);
    const struct node probe = {.key = key, .priority = priority};
    if (!before(&probe, &r->nodes[worst]))
        return false;
    leave_heap(r, worst);
    forget(r, worst);
    return true;
}

bool hg_residency_request(struct hg_residency *r, uint64_t key, float priority)
{
    uint32_t i = find(r, key);
    if (i != NONE && r->nodes[i].state != REQUESTED)
        return false;
    if (i == NONE) {
        if (!make_room(r, key, priority))
            return false;
        i = add(r, key);
        r->nodes[i].state = REQUESTED;
        r->nodes[i].priority = priority;
        r->stats.requests++;
        settle(r, r->heap_count++, i);
        return true;
    }
    struct node *n = &r->nodes[i];
    if (n->frame != r->frame || priority > n->priority) {
        n->priority = priority;
        settle(r, n->heap, i);
    }
    n->frame = r->frame;
    return true;
}

bool hg_residency_next(struct hg_residency *r, uint64_t *key, float *priority)
{
    *key = HG_RESIDENCY_NO_KEY;
    *priority = 0.0f;
    if (r->heap_count == 0)
        return false;
    const uint32_t i = r->heap[0];
    leave_heap(r, i);
    r->nodes[i].state = IN_FLIGHT;
    r->stats.in_flight++;
    *key = r->nodes[i].key;
    *priority = r->nodes[i].priority;
    return true;
}

void hg_residency_cancel(struct hg_residency *r, uint64_t key)
{
    const uint32_t i = find(r, key);
    if (i == NONE || r->nodes[i].state != IN_FLIGHT)
        return;
    r->stats.in_flight--;
    forget(r, i);
}

void hg_residency_put_back(struct hg_residency *r, uint64_t key)
{
    const uint32_t i = find(r, key);
    if (i == NONE || r->nodes[i].state != IN_FLIGHT)
        return;
    r->stats.in_flight--;
    r->nodes[i].state = REQUESTED;
    settle(r, r->heap_count++, i);
}

void hg_residency_drop_requests(struct hg_residency *r)
{
    while (r->heap_count > 0)
        forget(r, r->heap[--r->heap_count]);
}

// --- slots ---------------------------------------------------------------------------------------

static bool may_go(const struct hg_residency *r, uint32_t i, enum hg_residency_force force)
{
    const uint32_t age = r->frame - r->nodes[i].frame;
    return force == HG_RESIDENCY_ANY ||
           age > (force == HG_RESIDENCY_UNUSED ? 0 : r->params.hysteresis);
}

uint32_t hg_residency_available(const struct hg_residency *r, enum hg_residency_force force)
{
    uint32_t count = r->free_slot_count;
    for (uint32_t i = r->oldest; i != NONE && may_go(r, i, force); i = r->nodes[i].newer)
        count++;
    return count;
}

void hg_residency_remove(struct hg_residency *r, uint32_t slot)
{
    const uint32_t i = r->slots[slot];
    if (i == NONE)
        return;
    if (r->nodes[i].pins > 0)
        r->stats.pinned--;
    else
        unlink_node(r, i);
    forget(r, i);
    r->slots[slot] = NONE;
    r->free_slots[r->free_slot_count++] = slot;
}

enum hg_status hg_residency_place(struct hg_residency *r, uint64_t key,
    enum hg_residency_force force, uint32_t *slot, uint64_t *evicted)
{
    *slot = HG_RESIDENCY_NONE;
    *evicted = HG_RESIDENCY_NO_KEY;
    uint32_t i = find(r, key);
    if (i != NONE && r->nodes[i].state == RESIDENT) {
        *slot = r->nodes[i].slot;
        hg_residency_use(r, *slot);
        return HG_OK;
    }
    if (r->free_slot_count == 0) {
        const uint32_t victim = r->oldest;
        if (victim == NONE || !may_go(r, victim, force))
            return HG_E_AGAIN;
        *evicted = r->nodes[victim].key;
        r->stats.evicted++;
        hg_residency_remove(r, r->nodes[victim].slot);
    }
    if (i == NONE)
        i = add(r, key);
    else if (r->nodes[i].state == REQUESTED)
        leave_heap(r, i);
    else
        r->stats.in_flight--;
    *slot = r->free_slots[--r->free_slot_count];
    r->slots[*slot] = i;
    r->nodes[i].state = RESIDENT;
    r->nodes[i].slot = *slot;
    r->nodes[i].frame = r->frame;
    r->stats.placed++;
    link_newest(r, i);
    return HG_OK;
}

void hg_residency_stats(const struct hg_residency *r, struct hg_residency_stats *out)
{
    *out = r->stats;
    out->slots = r->params.slots;
    out->resident = r->params.slots - r->free_slot_count;
    out->requested = r->heap_count;
}
