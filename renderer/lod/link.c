// link.c - what follows from the tables of a hierarchy: who is whose parent, and the tree by
// which it is traversed.
#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/alloc.h"
#include "renderer/lod/internal.h"

// ---- parents ------------------------------------------------------------------------------------

// Clusters are in the order of their groups, so the parents of each group come out sorted.
static void count_parents(struct hg_lod_file *f, uint32_t *last, bool fill)
{
    for (uint32_t i = 0; i < f->lod.group_count; i++) {
        last[i] = HG_LOD_NONE;
        if (fill)
            f->groups[i].parent_count = 0;
    }
    for (uint32_t i = 0; i < f->lod.cluster_count; i++) {
        const uint32_t child = f->clusters[i].made_from, group = f->clusters[i].group;
        if (child == HG_LOD_NONE || last[child] == group)
            continue;
        last[child] = group;
        struct hg_lod_group *g = &f->groups[child];
        if (fill)
            f->parents[g->first_parent + g->parent_count] = group;
        g->parent_count++;
    }
}

static enum hg_status link_parents(struct hg_lod_file *f)
{
    uint32_t *last = hg_calloc(f->lod.group_count, sizeof *last);
    if (last == NULL)
        return HG_E_NOMEM;
    count_parents(f, last, false);
    uint32_t total = 0;
    for (uint32_t i = 0; i < f->lod.group_count; i++) {
        f->groups[i].first_parent = total;
        total += f->groups[i].parent_count;
    }
    f->parents = hg_calloc(total, sizeof *f->parents);
    f->lod.parent_count = total;
    if (f->parents != NULL)
        count_parents(f, last, true);
    hg_free(last);
    return f->parents != NULL ? HG_OK : HG_E_NOMEM;
}

// ---- nodes --------------------------------------------------------------------------------------

static void start_box(struct hg_lod_node *n)
{
    for (int k = 0; k < 3; k++) {
        n->min[k] = INFINITY;
        n->max[k] = -INFINITY;
    }
}

static void add_box(struct hg_lod_node *n, const float min[3], const float max[3])
{
    for (int k = 0; k < 3; k++) {
        n->min[k] = fminf(n->min[k], min[k]);
        n->max[k] = fmaxf(n->max[k], max[k]);
    }
}

static void set_sphere(struct hg_lod_node *n, const struct hg_lod_sphere *spheres, uint32_t count)
{
    const struct hg_lod_sphere s = hg_lod_sphere_around(spheres, count);
    memcpy(n->center, s.center, sizeof n->center);
    n->radius = s.radius;
}

static struct hg_lod_node leaf_of(const struct hg_lod_file *f, uint32_t first, uint32_t count)
{
    struct hg_lod_node n = {.first = first, .count = count, .is_leaf = 1};
    struct hg_lod_sphere spheres[HG_LOD_NODE_WIDTH];
    start_box(&n);
    for (uint32_t i = 0; i < count; i++) {
        const struct hg_lod_group *g = &f->groups[first + i];
        memcpy(spheres[i].center, g->center, sizeof g->center);
        spheres[i].radius = g->radius;
        n.error = fmaxf(n.error, g->error);
        for (uint32_t c = 0; c < g->cluster_count; c++) {
            const struct hg_lod_cluster *cluster = &f->clusters[g->first_cluster + c];
            float min[3], max[3];
            for (int k = 0; k < 3; k++) {
                min[k] = cluster->center[k] - cluster->extent[k];
                max[k] = cluster->center[k] + cluster->extent[k];
            }
            add_box(&n, min, max);
        }
    }
    set_sphere(&n, spheres, count);
    return n;
}

static struct hg_lod_node node_above(
    const struct hg_lod_node *nodes, uint32_t first, uint32_t count)
{
    struct hg_lod_node n = {.first = first, .count = count};
    struct hg_lod_sphere spheres[HG_LOD_NODE_WIDTH];
    start_box(&n);
    for (uint32_t i = 0; i < count; i++) {
        const struct hg_lod_node *child = &nodes[first + i];
        memcpy(spheres[i].center, child->center, sizeof child->center);
        spheres[i].radius = child->radius;
        n.error = fmaxf(n.error, child->error);
        add_box(&n, child->min, child->max);
    }
    set_sphere(&n, spheres, count);
    return n;
}

// Leaves hold groups of one level only: coarse ones are not visited for the sake of fine ones.
static uint32_t make_leaves(const struct hg_lod_file *f, struct hg_lod_node *out)
{
    uint32_t n = 0;
    for (uint32_t i = 0; i < f->lod.group_count;) {
        uint32_t count = 1;
        while (count < HG_LOD_NODE_WIDTH && i + count < f->lod.group_count &&
               f->groups[i + count].level == f->groups[i].level)
            count++;
        out[n++] = leaf_of(f, i, count);
        i += count;
    }
    return n;
}

#define DEPTH_MAX 16 // 8^16 groups

// Layers of the tree, leaves first; returns how many, their beginnings in starts[].
static uint32_t make_layers(
    const struct hg_lod_file *f, struct hg_lod_node *nodes, uint32_t starts[DEPTH_MAX + 1])
{
    uint32_t layers = 1;
    starts[1] = make_leaves(f, nodes);
    while (starts[layers] - starts[layers - 1] > 1 && layers < DEPTH_MAX) {
        const uint32_t end = starts[layers];
        uint32_t out = end;
        for (uint32_t i = starts[layers - 1]; i < end; i += HG_LOD_NODE_WIDTH) {
            const uint32_t count = end - i < HG_LOD_NODE_WIDTH ? end - i : HG_LOD_NODE_WIDTH;
            nodes[out++] = node_above(nodes, i, count);
        }
        starts[++layers] = out;
    }
    return layers;
}

// The tree is made from the leaves up in one array, then its layers are turned: root first.
static enum hg_status link_nodes(struct hg_lod_file *f)
{
    const size_t bound = (size_t)f->lod.group_count * 2 + DEPTH_MAX;
    struct hg_lod_node *nodes = hg_calloc(bound, sizeof *nodes);
    f->nodes = hg_calloc(bound, sizeof *f->nodes);
    if (nodes == NULL || f->nodes == NULL) {
        hg_free(nodes);
        return HG_E_NOMEM;
    }
    uint32_t starts[DEPTH_MAX + 1] = {0}, out = 0;
    const uint32_t layers = f->lod.group_count > 0 ? make_layers(f, nodes, starts) : 0;
    for (uint32_t l = layers; l-- > 0;) {
        const uint32_t below = out + (starts[l + 1] - starts[l]); // where the layer below will be
        for (uint32_t i = starts[l]; i < starts[l + 1]; i++) {
            f->nodes[out] = nodes[i];
            if (!nodes[i].is_leaf)
                f->nodes[out].first = nodes[i].first - starts[l - 1] + below;
            out++;
        }
    }
    f->lod.node_count = out;
    hg_free(nodes);
    return HG_OK;
}

enum hg_status hg_lod_link(struct hg_lod_file *f)
{
    enum hg_status status = link_parents(f);
    if (status == HG_OK)
        status = link_nodes(f);
    f->lod.parents = f->parents;
    f->lod.nodes = f->nodes;
    return status;
}
