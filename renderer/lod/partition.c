// partition.c - clusters into groups: neighbours that share much of their border are merged
// pairwise, best pairs first, until groups are large enough.
//
// Edges of a border that was locked one level below are short and many, so the pairs across it
// share the most edges and are merged: borders move from level to level.
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/alloc.h"
#include "base/spill.h"
#include "renderer/lod/internal.h"

#define EDGES_GUESS  48u // of a cluster's border
#define GROUP_WANTED 16u // clusters
#define GROUP_SMALL  8u  // smaller groups look for any neighbour that has room
#define GROUP_BYTES  (HG_LOD_CHUNK_BYTES - 64u) // streams are padded

struct link {              // between clusters, later between groups; a < b
    uint32_t a, b, weight; // shared edges
};

struct open_edge {
    uint64_t key;          // positions, smaller first
    uint32_t cluster, met; // met: another cluster has it too
};

struct graph {
    uint32_t clusters, groups;
    uint32_t *group_of;              // [clusters]
    uint32_t *size, *bytes, *border; // of each group: clusters, decoded bytes, open edges
    uint32_t *joined, *map;          // [clusters] scratch: by a round; to new numbers
    struct link *links;
    size_t link_count, link_capacity;
    struct candidate *candidates; // [link_count]
    size_t candidate_capacity;
};

static uint32_t hash_edge(uint64_t key)
{
    key *= 0x9e3779b97f4a7c15ull;
    return (uint32_t)(key >> 32);
}

// Edges that only one triangle of the cluster has. Returns their number.
static uint32_t open_edges(const struct hg_lod_mesh *m, const uint32_t *triangles, uint32_t count,
    uint64_t out[HG_LOD_CLUSTER_TRIANGLES * 3])
{
    uint64_t keys[1024];
    uint8_t uses[1024] = {0}; // 0: the slot is free
    uint16_t slots[HG_LOD_CLUSTER_TRIANGLES * 3 + 1];
    uint32_t edges = 0, n = 0;
    for (uint32_t t = 0; t < count; t++) {
        const uint32_t *v = triangles + (size_t)t * 3;
        const uint32_t at[4] = {
            m->position_of[v[0]], m->position_of[v[1]], m->position_of[v[2]], m->position_of[v[0]]};
        for (int k = 0; k < 3; k++) {
            const uint32_t a = at[k], b = at[k + 1];
            const uint64_t key = a < b ? (uint64_t)a << 32 | b : (uint64_t)b << 32 | a;
            uint32_t slot = hash_edge(key) & 1023;
            while (uses[slot] != 0 && keys[slot] != key)
                slot = (slot + 1) & 1023;
            keys[slot] = key; // whether it is new or not: nothing to guess
            slots[edges] = (uint16_t)slot;
            edges += uses[slot] == 0;
            uses[slot] = (uint8_t)(uses[slot] + (uses[slot] < 2));
        }
    }
    for (uint32_t i = 0; i < edges; i++) {
        out[n] = keys[slots[i]];
        n += uses[slots[i]] == 1;
    }
    return n;
}

static enum hg_status collect_edges(const struct hg_lod_mesh *m, const struct hg_lod_pool *pool,
    struct open_edge **edges, size_t *capacity, size_t *count, uint32_t *border)
{
    uint64_t keys[HG_LOD_CLUSTER_TRIANGLES * 3];
    for (uint32_t c = 0; c < pool->count; c++) {
        const uint32_t n = open_edges(m, pool->triangles[c], pool->triangle_count[c], keys);
        if (hg_grow(edges, capacity, *count + n, sizeof **edges) != HG_OK)
            return HG_E_NOMEM;
        for (uint32_t i = 0; i < n; i++)
            (*edges)[(*count)++] = (struct open_edge){keys[i], c, 0};
        border[c] = n;
    }
    return HG_OK;
}

// Counts an edge where `other` meets `cluster`, whose links are those from `first` on.
static enum hg_status count_link(struct graph *g, size_t first, uint32_t other, uint32_t cluster)
{
    for (size_t i = g->link_count; i > first; i--) {
        if (g->links[i - 1].a == other) {
            g->links[i - 1].weight++;
            return HG_OK;
        }
    }
    const enum hg_status status =
        hg_grow(&g->links, &g->link_capacity, g->link_count + 1, sizeof *g->links);
    if (status == HG_OK)
        g->links[g->link_count++] = (struct link){other, cluster, 1};
    return status;
}

// Links of clusters that meet (at an edge of more, the first two). Edges of a cluster follow each
// other.
static enum hg_status find_links(struct graph *g, struct open_edge *edges, size_t count)
{
    size_t size = 16;
    while (size < count * 2)
        size *= 2;
    uint32_t *table = hg_spill_scratch(size, sizeof *table);
    if (table == NULL)
        return HG_E_NOMEM;
    enum hg_status status = HG_OK;
    size_t first = 0;
    for (size_t i = 0; i < count && status == HG_OK; i++) {
        if (i > 0 && edges[i].cluster != edges[i - 1].cluster)
            first = g->link_count;
        size_t slot = hash_edge(edges[i].key) & (size - 1);
        while (table[slot] != 0 && edges[table[slot] - 1].key != edges[i].key)
            slot = (slot + 1) & (size - 1);
        if (table[slot] == 0) {
            table[slot] = (uint32_t)i + 1;
            continue;
        }
        const uint32_t other = edges[table[slot] - 1].cluster;
        edges[table[slot] - 1].met = 1;
        edges[i].met = 1;
        status = count_link(g, first, other, edges[i].cluster);
    }
    hg_free(table);
    return status;
}

// ---- merging ------------------------------------------------------------------------------------

struct candidate {
    float score;
    uint32_t a, b, weight;
};

static int compare_links(const void *left, const void *right)
{
    const struct link *x = left, *y = right;
    if (x->a != y->a)
        return x->a < y->a ? -1 : 1;
    return x->b < y->b ? -1 : x->b > y->b;
}

// Makes the links those between groups, after `map` gave old groups their new numbers.
static void map_links(struct graph *g)
{
    size_t n = 0;
    for (size_t i = 0; i < g->link_count; i++) {
        struct link l = g->links[i];
        l.a = g->map[l.a];
        l.b = g->map[l.b];
        if (l.a != l.b)
            g->links[n++] = (struct link){l.a < l.b ? l.a : l.b, l.a < l.b ? l.b : l.a, l.weight};
    }
    if (n > 1)
        qsort(g->links, n, sizeof *g->links, compare_links);
    g->link_count = 0;
    for (size_t i = 0; i < n; i++) {
        struct link *last = g->link_count > 0 ? &g->links[g->link_count - 1] : NULL;
        if (last != NULL && last->a == g->links[i].a && last->b == g->links[i].b)
            last->weight += g->links[i].weight;
        else
            g->links[g->link_count++] = g->links[i];
    }
}

static int compare_candidates(const void *left, const void *right)
{
    const struct candidate *x = left, *y = right;
    if (x->score != y->score)
        return x->score > y->score ? -1 : 1;
    if (x->a != y->a)
        return x->a < y->a ? -1 : 1;
    return x->b < y->b ? -1 : x->b > y->b;
}

static bool fits(const struct graph *g, uint32_t a, uint32_t b, uint32_t most)
{
    return g->size[a] + g->size[b] <= most && g->bytes[a] + g->bytes[b] <= GROUP_BYTES;
}

static size_t list_candidates(struct graph *g, uint32_t most)
{
    size_t n = 0;
    for (size_t i = 0; i < g->link_count; i++) {
        const struct link *l = &g->links[i];
        if (!fits(g, l->a, l->b, most))
            continue;
        if (most > GROUP_WANTED && g->size[l->a] >= GROUP_SMALL && g->size[l->b] >= GROUP_SMALL)
            continue;
        const uint32_t less = g->border[l->a] < g->border[l->b] ? g->border[l->a] : g->border[l->b];
        const float share = (float)l->weight / (float)(less > 0 ? less : 1);
        g->candidates[n++] = (struct candidate){
            share / (float)(g->size[l->a] + g->size[l->b]), l->a, l->b, l->weight};
    }
    qsort(g->candidates, n, sizeof *g->candidates, compare_candidates);
    return n;
}

static void join(struct graph *g, uint32_t a, uint32_t b, uint32_t weight)
{
    const uint32_t border = g->border[a] + g->border[b];
    g->size[a] += g->size[b];
    g->bytes[a] += g->bytes[b];
    g->border[a] = border > 2 * weight ? border - 2 * weight : 0;
    g->joined[b] = a;
}

static void begin_round(struct graph *g)
{
    for (uint32_t i = 0; i < g->groups; i++)
        g->joined[i] = i;
}

// Gives the groups that are left consecutive numbers.
static void end_round(struct graph *g)
{
    uint32_t n = 0;
    for (uint32_t i = 0; i < g->groups; i++) {
        if (g->joined[i] != i)
            continue;
        g->size[n] = g->size[i];
        g->bytes[n] = g->bytes[i];
        g->border[n] = g->border[i];
        g->map[i] = n++;
    }
    for (uint32_t i = 0; i < g->groups; i++)
        if (g->joined[i] != i)
            g->map[i] = g->map[g->joined[i]];
    for (uint32_t c = 0; c < g->clusters; c++)
        g->group_of[c] = g->map[g->group_of[c]];
    g->groups = n;
    map_links(g);
}

// Every group is joined to one other at most. Returns how many were.
static uint32_t merge_round(struct graph *g, uint32_t most)
{
    uint32_t merges = 0;
    const size_t n = list_candidates(g, most);
    begin_round(g);
    uint8_t *taken = (uint8_t *)g->map; // map is written at the end of the round
    memset(taken, 0, g->groups);
    for (size_t i = 0; i < n; i++) {
        const struct candidate *c = &g->candidates[i];
        if (taken[c->a] || taken[c->b])
            continue;
        taken[c->a] = taken[c->b] = 1;
        join(g, c->a, c->b, c->weight);
        merges++;
    }
    end_round(g);
    return merges;
}

// ---- order in space -----------------------------------------------------------------------------

static uint32_t spread(float v)
{
    uint32_t x = (uint32_t)(v < 0.0f ? 0.0f : v > 1023.0f ? 1023.0f : v);
    x = (x | x << 16) & 0x030000ffu;
    x = (x | x << 8) & 0x0300f00fu;
    x = (x | x << 4) & 0x030c30c3u;
    return (x | x << 2) & 0x09249249u;
}

// 30-bit Morton code of a point in a box.
static uint32_t morton_of(const float point[3], const float min[3], const float max[3])
{
    float size = 0.0f;
    for (int k = 0; k < 3; k++)
        size = fmaxf(size, max[k] - min[k]);
    const float scale = size > 0.0f ? 1023.0f / size : 0.0f;
    return spread((point[0] - min[0]) * scale) | spread((point[1] - min[1]) * scale) << 1 |
           spread((point[2] - min[2]) * scale) << 2;
}

struct place {
    uint32_t code, group;
};

static int compare_places(const void *left, const void *right)
{
    const struct place *x = left, *y = right;
    if (x->code != y->code)
        return x->code < y->code ? -1 : 1;
    return x->group < y->group ? -1 : x->group > y->group;
}

static void place_groups(
    const struct graph *g, const struct hg_lod_pool *pool, struct place *places, float (*sum)[3])
{
    float min[3] = {INFINITY, INFINITY, INFINITY}, max[3] = {-INFINITY, -INFINITY, -INFINITY};
    memset(sum, 0, g->groups * sizeof *sum);
    for (uint32_t c = 0; c < g->clusters; c++) {
        const uint32_t group = g->group_of[c];
        for (int k = 0; k < 3; k++) {
            min[k] = fminf(min[k], pool->center[c][k]);
            max[k] = fmaxf(max[k], pool->center[c][k]);
            sum[group][k] += pool->center[c][k] / (float)g->size[group];
        }
    }
    for (uint32_t i = 0; i < g->groups; i++)
        places[i] = (struct place){morton_of(sum[i], min, max), i};
    qsort(places, g->groups, sizeof *places, compare_places);
}

// Small groups that have no neighbour with room are joined with those next to them in space.
static void merge_places(struct graph *g, const struct place *places)
{
    begin_round(g);
    for (uint32_t i = 0, open = HG_LOD_NONE; i < g->groups; i++) {
        const uint32_t group = places[i].group;
        if (g->size[group] >= GROUP_SMALL)
            continue;
        if (open != HG_LOD_NONE && g->size[open] < GROUP_WANTED &&
            fits(g, open, group, HG_LOD_GROUP_CLUSTERS))
            join(g, open, group, 0);
        else
            open = group;
    }
    end_round(g);
}

// ---- all of it ----------------------------------------------------------------------------------

static void mark_open(const struct open_edge *edges, size_t count, uint8_t *open)
{
    for (size_t i = 0; open != NULL && i < count; i++)
        if (!edges[i].met)
            open[edges[i].key >> 32] = open[edges[i].key & 0xffffffffu] = 1;
}

static enum hg_status init_graph(struct graph *g, const struct hg_lod_mesh *m,
    const struct hg_lod_pool *pool, uint32_t *group_of, uint8_t *open)
{
    g->clusters = g->groups = pool->count;
    g->group_of = group_of;
    uint32_t **arrays[] = {&g->size, &g->bytes, &g->border, &g->joined, &g->map};
    for (size_t i = 0; i < sizeof arrays / sizeof *arrays; i++)
        if ((*arrays[i] = hg_calloc(pool->count, sizeof **arrays[i])) == NULL)
            return HG_E_NOMEM;
    const uint32_t vertex_bytes =
        12 + (uint32_t)sizeof(struct hg_gpu_vertex) + m->format.extra_words * 4;
    for (uint32_t c = 0; c < pool->count; c++) {
        group_of[c] = g->joined[c] = g->map[c] = c;
        g->size[c] = 1;
        g->bytes[c] = pool->triangle_count[c] * 12 + pool->vertex_count[c] * vertex_bytes;
    }
    size_t capacity = (size_t)pool->count * EDGES_GUESS, count = 0;
    struct open_edge *edges = hg_spill_scratch(capacity, sizeof *edges);
    if (edges == NULL)
        return HG_E_NOMEM;
    enum hg_status status = collect_edges(m, pool, &edges, &capacity, &count, g->border);
    if (status == HG_OK)
        status = find_links(g, edges, count);
    if (status == HG_OK)
        mark_open(edges, count, open);
    hg_free(edges);
    if (status == HG_OK) {
        map_links(g);
        status = hg_grow(
            &g->candidates, &g->candidate_capacity, g->link_count + 1, sizeof *g->candidates);
    }
    return status;
}

static enum hg_status merge_all(struct graph *g, const struct hg_lod_pool *pool)
{
    while (merge_round(g, GROUP_WANTED) > 0) {
    }
    while (merge_round(g, HG_LOD_GROUP_CLUSTERS) > 0) {
    }
    struct place *places = hg_calloc(g->clusters, sizeof *places);
    float(*sum)[3] = hg_calloc(g->clusters, sizeof *sum);
    enum hg_status status = HG_E_NOMEM;
    if (places != NULL && sum != NULL) {
        place_groups(g, pool, places, sum);
        merge_places(g, places);
        place_groups(g, pool, places, sum);
        for (uint32_t i = 0; i < g->groups; i++)
            g->map[places[i].group] = i;
        for (uint32_t c = 0; c < g->clusters; c++)
            g->group_of[c] = g->map[g->group_of[c]];
        status = HG_OK;
    }
    hg_free(places);
    hg_free(sum);
    return status;
}

enum hg_status hg_lod_partition(const struct hg_lod_mesh *mesh, const struct hg_lod_pool *pool,
    uint32_t *group_of, uint32_t *group_count, uint8_t *open)
{
    struct graph g = {0};
    *group_count = 0;
    enum hg_status status = init_graph(&g, mesh, pool, group_of, open);
    if (status == HG_OK)
        status = merge_all(&g, pool);
    if (status == HG_OK)
        *group_count = g.groups;
    uint32_t *arrays[] = {g.size, g.bytes, g.border, g.joined, g.map};
    for (size_t i = 0; i < sizeof arrays / sizeof *arrays; i++)
        hg_free(arrays[i]);
    hg_free(g.links);
    hg_free(g.candidates);
    return status;
}
