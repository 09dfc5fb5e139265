// point_tree.c - see point_tree.h.
#include "renderer/lod/point_tree.h"

#include <float.h>
#include <string.h>

#include "base/alloc.h"
#include "base/spill.h"

#define WIDE_LEVELS 7u // levels whose nodes are split one level after the other, for the threads

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

struct splitting {
    struct hg_point_tree *tree;
    uint32_t level;
    bool below; // all levels below the node, too
};

static void split_node(struct hg_point_tree *t, uint32_t level, uint32_t node, bool below)
{
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
    if (!below)
        return;
    split_node(t, level + 1, node * 2, true);
    split_node(t, level + 1, node * 2 + 1, true);
}

static void split_job(void *user, size_t node)
{
    const struct splitting *s = user;
    split_node(s->tree, s->level, (uint32_t)node, s->below);
}

static void split_all(struct hg_point_tree *t, struct hg_jobs *jobs)
{
    for (uint32_t level = 0; level <= WIDE_LEVELS && level < t->depth; level++) {
        struct splitting s = {t, level, level == WIDE_LEVELS};
        if (jobs != NULL)
            hg_jobs_for(jobs, (size_t)1 << level, split_job, &s);
        for (size_t i = 0; jobs == NULL && i < (size_t)1 << level; i++)
            split_job(&s, i);
    }
}

enum hg_status hg_point_tree_build(const struct hg_mesh_part *part, uint32_t stride,
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
    split_all(out, jobs);
    return HG_OK;
}

void hg_point_tree_finish(struct hg_point_tree *tree)
{
    hg_free(tree->items);
    hg_free(tree->splits);
    hg_free(tree->axes);
    memset(tree, 0, sizeof *tree);
}
