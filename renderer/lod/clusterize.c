// clusterize.c - triangles cut into clusters by recursive bisection of their centres, across the
// axis where fewest are met: every cluster is as full as its neighbours, and all threads make the
// same cuts.
#include <float.h>
#include <string.h>

#include "base/alloc.h"
#include "base/spill.h"
#include "renderer/lod/internal.h"

#define LENGTH_SAMPLES 64u // triangles of a range whose lengths are looked at

struct item {
    float center[3];
    uint32_t triangle;
};

struct range {
    uint32_t first, count, clusters;
};

struct cutter {
    const struct hg_lod_mesh *mesh;
    const uint32_t *triangles;
    struct item *items;
    struct range *from, *to; // two per range of `from`; count 0: none
    uint32_t count;
};

static void each(struct hg_jobs *jobs, size_t count, hg_jobs_fn *fn, void *user)
{
    if (jobs != NULL) {
        hg_jobs_for(jobs, count, fn, user);
        return;
    }
    for (size_t i = 0; i < count; i++)
        fn(user, i);
}

// Mean lengths of triangles along the axes, of some that lie evenly in the range.
static void mean_lengths(
    const struct cutter *c, const struct item *items, uint32_t count, float mean[3])
{
    const uint32_t step = (count + LENGTH_SAMPLES - 1) / LENGTH_SAMPLES;
    int64_t sum[3] = {0};
    uint32_t n = 0;
    for (uint64_t i = 0; i < count; i += step, n++) {
        const uint32_t *v = c->triangles + (size_t)items[i].triangle * 3;
        const int32_t *p[3];
        for (int j = 0; j < 3; j++)
            p[j] = c->mesh->lattice[c->mesh->position_of[v[j]]];
        for (int k = 0; k < 3; k++) {
            const int32_t low = p[0][k] < p[1][k] ? p[0][k] : p[1][k];
            const int32_t high = p[0][k] > p[1][k] ? p[0][k] : p[1][k];
            sum[k] += (int64_t)(high > p[2][k] ? high : p[2][k]) - (low < p[2][k] ? low : p[2][k]);
        }
    }
    for (int k = 0; k < 3; k++)
        mean[k] = (float)sum[k] / (float)n;
}

// The axis across which a plane meets the fewest triangles: its share is their mean length to that
// of the range. On smooth surfaces with even triangles that is the longest one; on rough ones (a
// wood, spikes) cuts across the height would tear every triangle from its neighbours.
static int best_axis(const struct cutter *c, const struct item *items, uint32_t count)
{
    float min[3], max[3], mean[3];
    memcpy(min, items[0].center, sizeof min);
    memcpy(max, items[0].center, sizeof max);
    for (uint32_t i = 1; i < count; i++) {
        for (int k = 0; k < 3; k++) {
            const float v = items[i].center[k];
            min[k] = v < min[k] ? v : min[k];
            max[k] = v > max[k] ? v : max[k];
        }
    }
    mean_lengths(c, items, count, mean);
    // Triangles that lie flat meet no plane along them: then length alone tells.
    const float least = 1e-3f * (mean[0] + mean[1] + mean[2]) + FLT_MIN;
    int axis = 0;
    float most = -1.0f;
    for (int k = 0; k < 3; k++) {
        const float by = (max[k] - min[k]) / (mean[k] + least);
        if (by > most) {
            axis = k;
            most = by;
        }
    }
    return axis;
}

static void swap_items(struct item *a, struct item *b)
{
    const struct item t = *a;
    *a = *b;
    *b = t;
}

// A total order, so that a cut does not depend on how it is found.
static inline bool before(const struct item *a, const struct item *b, int axis)
{
    const float x = a->center[axis], y = b->center[axis];
    return (x < y) | ((x == y) & (a->triangle < b->triangle));
}

static struct item median3(
    const struct item *a, const struct item *b, const struct item *c, int axis)
{
    const struct item *small = before(a, b, axis) ? a : b, *large = small == a ? b : a;
    return before(c, small, axis) ? *small : before(large, c, axis) ? *large : *c;
}

static struct item pivot_of(const struct item *items, uint32_t count, int axis)
{
    struct item m[3];
    if (count < 64)
        return median3(&items[0], &items[count / 2], &items[count - 1], axis);
    for (uint32_t i = 0; i < 3; i++) {
        const struct item *at = items + (uint64_t)(count - 3) * i / 3;
        m[i] = median3(at, at + count / 9, at + count / 9 * 2, axis);
    }
    return median3(&m[0], &m[1], &m[2], axis);
}

// Moves the `nth` first to the front (Hoare 1961, "Algorithm 65: find"); the loop that parts them
// is Lomuto's and has no branches to guess.
static void select_items(struct item *items, uint32_t count, uint32_t nth, int axis)
{
    uint32_t low = 0, high = count;
    while (high - low > 1 && nth > low && nth < high) {
        const struct item pivot = pivot_of(items + low, high - low, axis);
        uint32_t less = low;
        for (uint32_t i = low; i < high; i++) {
            const struct item t = items[i];
            items[i] = items[less];
            items[less] = t;
            less += before(&t, &pivot, axis);
        }
        if (nth <= less) {
            high = less;
        } else if (less > low) {
            low = less;
        } else { // the pivot was the least
            while (items[less].triangle != pivot.triangle)
                less++;
            swap_items(&items[less], &items[low++]);
        }
    }
}

static void split_range(void *user, size_t index)
{
    struct cutter *c = user;
    const struct range r = c->from[index];
    struct range *to = &c->to[index * 2];
    to[0] = r;
    to[1] = (struct range){0};
    if (r.clusters < 2)
        return;
    const uint32_t left = r.clusters / 2;
    const uint32_t half = (uint32_t)((uint64_t)r.count * left / r.clusters);
    struct item *items = c->items + r.first;
    select_items(items, r.count, half, best_axis(c, items, r.count));
    to[0] = (struct range){r.first, half, left};
    to[1] = (struct range){r.first + half, r.count - half, r.clusters - left};
}

// At least as many as there are distinct vertices: what is forgotten is counted again.
static uint32_t vertex_bound(const struct cutter *c, const struct range *r)
{
    uint32_t table[256] = {0}, bound = 0;
    for (uint32_t i = 0; i < r->count; i++) {
        const uint32_t *t = c->triangles + (size_t)c->items[r->first + i].triangle * 3;
        for (int k = 0; k < 3; k++) {
            uint32_t *slot = &table[t[k] * 0x9e3779b1u >> 24];
            bound += *slot != t[k] + 1;
            *slot = t[k] + 1;
        }
    }
    return bound;
}

// A cluster of triangles that share few vertices must be cut once more.
static void limit_vertices(void *user, size_t index)
{
    struct cutter *c = user;
    struct range *r = &c->from[index];
    if (r->clusters != 1 || r->count * 3 <= HG_LOD_CLUSTER_VERTICES ||
        vertex_bound(c, r) <= HG_LOD_CLUSTER_VERTICES)
        return;
    uint32_t table[1024] = {0}, distinct = 0;
    for (uint32_t i = 0; i < r->count; i++) {
        const uint32_t *t = c->triangles + (size_t)c->items[r->first + i].triangle * 3;
        for (int k = 0; k < 3; k++) {
            uint32_t slot = t[k] * 0x9e3779b1u >> 22;
            while (table[slot] != 0 && table[slot] != t[k] + 1)
                slot = (slot + 1) & 1023;
            distinct += table[slot] == 0;
            table[slot] = t[k] + 1;
        }
    }
    if (distinct > HG_LOD_CLUSTER_VERTICES)
        r->clusters = 2;
}

#define CENTER_BLOCK 4096u

static void make_items(void *user, size_t block)
{
    struct cutter *c = user;
    const size_t first = block * CENTER_BLOCK;
    const size_t end = first + CENTER_BLOCK < c->count ? first + CENTER_BLOCK : c->count;
    for (size_t t = first; t < end; t++) {
        const uint32_t *v = c->triangles + t * 3;
        for (int k = 0; k < 3; k++) {
            int64_t sum = 0;
            for (int i = 0; i < 3; i++)
                sum += c->mesh->lattice[c->mesh->position_of[v[i]]][k];
            c->items[t].center[k] = (float)sum;
        }
        c->items[t].triangle = (uint32_t)t;
    }
}

static uint32_t pack_ranges(struct range *from, const struct range *to, uint32_t count)
{
    uint32_t n = 0;
    for (uint32_t i = 0; i < count * 2; i++)
        if (to[i].count > 0)
            from[n++] = to[i];
    return n;
}

static bool any_to_split(const struct range *ranges, uint32_t count)
{
    for (uint32_t i = 0; i < count; i++)
        if (ranges[i].clusters > 1)
            return true;
    return false;
}

static uint32_t cut_all(struct cutter *c, struct hg_jobs *jobs)
{
    uint32_t n = 1;
    c->from[0] = (struct range){
        0, c->count, (c->count + HG_LOD_CLUSTER_TRIANGLES - 1) / HG_LOD_CLUSTER_TRIANGLES};
    for (bool checked = false;;) {
        while (any_to_split(c->from, n)) {
            each(jobs, n, split_range, c);
            n = pack_ranges(c->from, c->to, n);
        }
        if (checked)
            return n;
        each(jobs, n, limit_vertices, c); // halves have less than the limit: once is enough
        checked = true;
    }
}

static void reorder(struct cutter *c, uint32_t *triangles, uint32_t *copy)
{
    memcpy(copy, triangles, (size_t)c->count * 12);
    for (size_t i = 0; i < c->count; i++)
        memcpy(triangles + i * 3, copy + (size_t)c->items[i].triangle * 3, 12);
}

enum hg_status hg_lod_cut(const struct hg_lod_mesh *mesh, uint32_t *triangles, uint32_t count,
    struct hg_lod_cut *out, struct hg_jobs *jobs)
{
    out->count = 0;
    out->starts[0] = 0;
    if (count == 0)
        return HG_OK;
    const size_t most = hg_lod_cut_bound(count);
    struct cutter c = {.mesh = mesh, .triangles = triangles, .count = count};
    c.items = hg_spill_scratch(count, sizeof *c.items);
    c.from = hg_spill_scratch(most, sizeof *c.from);
    c.to = hg_spill_scratch(most * 2, sizeof *c.to);
    uint32_t *copy = hg_spill_scratch(count, 12);
    enum hg_status status = HG_OK;
    if (c.items == NULL || c.from == NULL || c.to == NULL || copy == NULL) {
        status = HG_E_NOMEM;
    } else {
        each(jobs, (count + CENTER_BLOCK - 1) / CENTER_BLOCK, make_items, &c);
        out->count = cut_all(&c, jobs);
        for (uint32_t i = 0; i < out->count; i++)
            out->starts[i] = c.from[i].first;
        out->starts[out->count] = count;
        reorder(&c, triangles, copy);
        for (uint32_t i = 0; out->order != NULL && i < count; i++)
            out->order[i] = c.items[i].triangle;
    }
    hg_free(c.items);
    hg_free(c.from);
    hg_free(c.to);
    hg_free(copy);
    return status;
}
