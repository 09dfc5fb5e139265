// point_tree.c - see point_tree.h.
#include "renderer/lod/point_tree.h"

#include <float.h>
#include <stdatomic.h>
#include <string.h>

#include "base/alloc.h"
#include "base/spill.h"

#define WIDE_LEVELS 7u // levels whose nodes are split one level after the other, for the threads
#define GATHER_FROM (1u << 20) // points

static void swap_items(struct hg_point_item *a, struct hg_point_item *b)
{
    const struct hg_point_item t = *a;
    *a = *b;
    *b = t;
}

// A total order, so that a split does not depend on how it is found.
static inline bool before(const struct hg_point_item *a, const struct hg_point_item *b, int axis)
{
    const float x = a->at[axis], y = b->at[axis];
    return (x < y) | ((x == y) & (a->number < b->number));
}

static struct hg_point_item pivot_of(
    const struct hg_point_item *items, uint32_t low, uint32_t high, int axis)
{
    const struct hg_point_item *a = &items[low], *b = &items[low + (high - low) / 2],
                               *c = &items[high - 1];
    if (before(b, a, axis)) {
        const struct hg_point_item *t = a;
        a = b;
        b = t;
    }
    return before(c, a, axis) ? *a : before(b, c, axis) ? *b : *c;
}

// Hoare 1961, "Algorithm 65: find", with his partition: repeated items do not degrade it.
void hg_point_select(struct hg_point_item *items, uint32_t count, uint32_t nth, int axis)
{
    int64_t low = 0, high = (int64_t)count - 1;
    while (low < high) {
        const struct hg_point_item pivot = pivot_of(items, (uint32_t)low, (uint32_t)high + 1, axis);
        int64_t i = low, j = high;
        while (i <= j) {
            while (before(&items[i], &pivot, axis))
                i++;
            while (before(&pivot, &items[j], axis))
                j--;
            if (i <= j)
                swap_items(&items[i++], &items[j--]);
        }
        if ((int64_t)nth <= j)
            high = j;
        else if ((int64_t)nth >= i)
            low = i;
        else
            return;
    }
}

int hg_point_longest_axis(const struct hg_point_item *items, uint32_t count)
{
    float min[3] = {FLT_MAX, FLT_MAX, FLT_MAX}, max[3] = {-FLT_MAX, -FLT_MAX, -FLT_MAX};
    for (uint32_t i = 0; i < count; i++) {
        for (int k = 0; k < 3; k++) {
            const float v = items[i].at[k];
            min[k] = v < min[k] ? v : min[k];
            max[k] = v > max[k] ? v : max[k];
        }
    }
    int axis = 0;
    for (int k = 1; k < 3; k++)
        if (max[k] - min[k] > max[axis] - min[axis])
            axis = k;
    return axis;
}

// ---- splits -------------------------------------------------------------------------------------

struct splitting {
    struct hg_point_tree *tree;
    const struct hg_mesh_part *part;
    uint32_t level;
    bool below;         // all levels below the node, too
    uint32_t *numbers;  // [1 << WIDE_LEVELS] of the points that part the wide nodes
    atomic_bool failed; // for want of memory
};

static void split_node(const struct splitting *s, uint32_t level, uint32_t node)
{
    struct hg_point_tree *t = s->tree;
    if (level >= t->depth)
        return;
    const uint32_t first = hg_point_tree_first(t, level, node);
    const uint32_t middle = hg_point_tree_first(t, level + 1, node * 2 + 1);
    const uint32_t end = hg_point_tree_first(t, level, node + 1);
    const int axis = hg_point_longest_axis(t->items + first, end - first);
    const uint32_t at = (1u << level) + node;
    hg_point_select(t->items + first, end - first, middle - first, axis);
    t->axes[at] = (uint8_t)axis;
    t->splits[at] = t->items[middle].at[axis];
    if (level < WIDE_LEVELS)
        s->numbers[at] = t->items[middle].number;
    if (!s->below)
        return;
    split_node(s, level + 1, node * 2);
    split_node(s, level + 1, node * 2 + 1);
}

static void split_job(void *user, size_t node)
{
    const struct splitting *s = user;
    split_node(s, s->level, (uint32_t)node);
}

static void each_node(struct splitting *s, struct hg_jobs *jobs, hg_jobs_fn *fn)
{
    if (jobs != NULL)
        hg_jobs_for(jobs, (size_t)1 << s->level, fn, s);
    for (size_t i = 0; jobs == NULL && i < (size_t)1 << s->level; i++)
        fn(s, i);
}

// ---- attributes ---------------------------------------------------------------------------------

// The wide node that a point is in.
static uint32_t wide_node(const struct splitting *s, const struct hg_point_item *item)
{
    const struct hg_point_tree *t = s->tree;
    uint32_t at = 1;
    while (at < 1u << WIDE_LEVELS) {
        const int axis = t->axes[at];
        struct hg_point_item split = {.number = s->numbers[at]};
        split.at[axis] = t->splits[at];
        at = at * 2 + !before(item, &split, axis);
    }
    return at - (1u << WIDE_LEVELS);
}

// One pass over the part; each wide node has a range that is filled from its beginning.
static void gather_attributes(const struct splitting *s)
{
    const struct hg_mesh_part *part = s->part;
    struct hg_point_tree *t = s->tree;
    uint32_t next[1u << WIDE_LEVELS];
    for (uint32_t node = 0; node < 1u << WIDE_LEVELS; node++)
        next[node] = hg_point_tree_first(t, WIDE_LEVELS, node);
    for (uint32_t i = 0; i < t->count; i++) {
        const size_t vertex = part->indices[(size_t)i * t->stride];
        struct hg_point_item item = {.number = i};
        memcpy(item.at, part->positions + vertex * 3, sizeof item.at);
        const size_t to = next[wide_node(s, &item)]++;
        if (t->normals != NULL)
            memcpy(t->normals + to * 3, part->normals + vertex * 3, 3 * sizeof(float));
        if (t->colors != NULL)
            memcpy(t->colors + to * 4, part->colors + vertex * 4, 4 * sizeof(float));
    }
}

// Numbers of a wide node's points: their ranks in it, by a bit per point of the tree.
static void renumber_job(void *user, size_t node)
{
    struct splitting *s = user;
    const struct hg_point_tree *t = s->tree;
    const uint32_t first = hg_point_tree_first(t, WIDE_LEVELS, (uint32_t)node);
    const uint32_t end = hg_point_tree_first(t, WIDE_LEVELS, (uint32_t)node + 1);
    const size_t words = (size_t)t->count / 64 + 1;
    uint64_t *bits = hg_calloc(words, sizeof *bits);
    uint32_t *ranks = hg_calloc(words, sizeof *ranks);
    if (bits == NULL || ranks == NULL) {
        atomic_store(&s->failed, true);
    } else {
        for (uint32_t i = first; i < end; i++)
            bits[t->items[i].number / 64] |= UINT64_C(1) << t->items[i].number % 64;
        uint32_t rank = first;
        for (size_t w = 0; w < words; w++) {
            ranks[w] = rank;
            rank += (uint32_t)__builtin_popcountll(bits[w]);
        }
        for (uint32_t i = first; i < end; i++) {
            const uint32_t number = t->items[i].number;
            const uint64_t below = bits[number / 64] & ((UINT64_C(1) << number % 64) - 1);
            t->items[i].number = ranks[number / 64] + (uint32_t)__builtin_popcountll(below);
        }
    }
    hg_free(bits);
    hg_free(ranks);
}

// Comparisons within wide nodes give the same as before: ranks are in the order of numbers.
static enum hg_status gather_all(struct splitting *s, struct hg_jobs *jobs)
{
    struct hg_point_tree *t = s->tree;
    const struct hg_mesh_part *part = s->part;
    if (part->normals != NULL)
        t->normals = hg_spill_scratch((size_t)t->count * 3, sizeof *t->normals);
    if (part->colors != NULL)
        t->colors = hg_spill_scratch((size_t)t->count * 4, sizeof *t->colors);
    if ((part->normals != NULL && t->normals == NULL) ||
        (part->colors != NULL && t->colors == NULL))
        return HG_E_NOMEM;
    gather_attributes(s);
    each_node(s, jobs, renumber_job);
    t->gathered = true;
    return atomic_load(&s->failed) ? HG_E_NOMEM : HG_OK;
}

static enum hg_status split_all(
    struct hg_point_tree *t, const struct hg_mesh_part *part, bool gather, struct hg_jobs *jobs)
{
    uint32_t numbers[1u << WIDE_LEVELS];
    struct splitting s = {.tree = t, .part = part, .numbers = numbers};
    for (; s.level < WIDE_LEVELS && s.level < t->depth; s.level++)
        each_node(&s, jobs, split_job);
    if (s.level >= t->depth)
        return HG_OK;
    const enum hg_status status = gather && t->count >= GATHER_FROM ? gather_all(&s, jobs) : HG_OK;
    s.below = true;
    if (status == HG_OK)
        each_node(&s, jobs, split_job);
    return status;
}

// ---- tree ---------------------------------------------------------------------------------------

enum hg_status hg_point_tree_build(const struct hg_mesh_part *part, uint32_t stride, bool gather,
    struct hg_jobs *jobs, struct hg_point_tree *out)
{
    memset(out, 0, sizeof *out);
    out->stride = stride;
    out->count = (uint32_t)(((uint64_t)part->index_count + stride - 1) / stride);
    while (
        out->count >> out->depth > HG_POINT_TREE_LEAF ||
        (out->count >> out->depth == HG_POINT_TREE_LEAF && out->count & ((1u << out->depth) - 1)))
        out->depth++;
    out->items = hg_spill_scratch(out->count, sizeof *out->items);
    out->splits = hg_spill_scratch((size_t)1 << out->depth, sizeof *out->splits);
    out->axes = hg_spill_scratch((size_t)1 << out->depth, sizeof *out->axes);
    if (out->items == NULL || out->splits == NULL || out->axes == NULL) {
        hg_point_tree_finish(out);
        return HG_E_NOMEM;
    }
    for (uint32_t i = 0; i < out->count; i++) {
        const size_t vertex = part->indices[(size_t)i * stride];
        memcpy(out->items[i].at, part->positions + vertex * 3, sizeof out->items[i].at);
        out->items[i].number = i;
    }
    const enum hg_status status = split_all(out, part, gather, jobs);
    if (status != HG_OK)
        hg_point_tree_finish(out);
    return status;
}

void hg_point_tree_finish(struct hg_point_tree *tree)
{
    hg_free(tree->items);
    hg_free(tree->splits);
    hg_free(tree->axes);
    hg_free(tree->normals);
    hg_free(tree->colors);
    memset(tree, 0, sizeof *tree);
}
