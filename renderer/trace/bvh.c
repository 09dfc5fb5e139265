// bvh.c - see bvh.h.
#include "renderer/trace/bvh.h"

#include <float.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/alloc.h"
#include "base/jobs.h"
#include "renderer/trace/embree.h"

// Steps that a box is larger than exact on each side: more than the traversal rounds, and less than
// two.
#define MARGIN 0.75

struct hg_bvh_builder {
    RTCDevice device;
};

// While it is built: nodes with exact boxes, and leaves, told apart by a bit of their address.
struct node {
    struct hg_bvh_box box[2];
    void *child[2];
};
struct leaf {
    uint32_t count, items[HG_BVH_LEAF_MOST];
};
#define LEAF_BIT ((uintptr_t)1)

enum hg_status hg_bvh_builder_create(struct hg_bvh_builder **out, struct hg_error *err)
{
    *out = hg_calloc(1, sizeof **out);
    if (*out == NULL)
        return hg_error_set(err, HG_E_NOMEM, "ray tracing", NULL, "no memory");
    char config[32];
    snprintf(config, sizeof config, "threads=%u", hg_jobs_limit());
    (*out)->device = rtcNewDevice(config);
    if ((*out)->device != NULL)
        return HG_OK;
    hg_bvh_builder_destroy(*out);
    *out = NULL;
    return hg_error_set(err, HG_E_DEVICE, "ray tracing", NULL, "Embree refuses this machine");
}

void hg_bvh_builder_destroy(struct hg_bvh_builder *b)
{
    if (b == NULL)
        return;
    if (b->device != NULL)
        rtcReleaseDevice(b->device);
    hg_free(b);
}

void hg_bvh_finish(struct hg_bvh *bvh)
{
    hg_free(bvh->nodes);
    hg_free(bvh->order);
    memset(bvh, 0, sizeof *bvh);
}

uint64_t hg_bvh_build_bytes(uint64_t count)
{
    return count * (2 * sizeof(struct RTCBuildPrimitive) + sizeof(struct node) +
                       sizeof(struct leaf) + sizeof(struct hg_gpu_bvh_node));
}

// --- what the builder calls ----------------------------------------------------------------------

static void *make_node(RTCThreadLocalAllocator allocator, unsigned int children, void *user)
{
    (void)children;
    (void)user;
    struct node *node = rtcThreadLocalAlloc(allocator, sizeof *node, 16);
    memset(node, 0, sizeof *node);
    return node;
}

static void set_children(void *node, void **children, unsigned int count, void *user)
{
    (void)user;
    for (unsigned int i = 0; i < count && i < 2; i++)
        ((struct node *)node)->child[i] = children[i];
}

static void set_bounds(void *node, const struct RTCBounds **bounds, unsigned int count, void *user)
{
    (void)user;
    for (unsigned int i = 0; i < count && i < 2; i++)
        ((struct node *)node)->box[i] =
            (struct hg_bvh_box){{bounds[i]->lower_x, bounds[i]->lower_y, bounds[i]->lower_z},
                {bounds[i]->upper_x, bounds[i]->upper_y, bounds[i]->upper_z}};
}

static void *make_leaf(RTCThreadLocalAllocator allocator,
    const struct RTCBuildPrimitive *primitives, size_t count, void *user)
{
    (void)user;
    struct leaf *leaf = rtcThreadLocalAlloc(allocator, sizeof *leaf, 16);
    leaf->count = (uint32_t)count;
    for (size_t i = 0; i < count && i < HG_BVH_LEAF_MOST; i++)
        leaf->items[i] = primitives[i].primID;
    return (void *)((uintptr_t)leaf | LEAF_BIT);
}

static void *build_by_area(struct hg_bvh_builder *b, RTCBVH bvh, const struct hg_bvh_box *boxes,
    uint32_t count, uint32_t leaf_most)
{
    struct RTCBuildPrimitive *primitives =
        hg_calloc_aligned(32, (size_t)count * sizeof *primitives);
    if (primitives == NULL)
        return NULL;
    for (uint32_t i = 0; i < count; i++)
        primitives[i] = (struct RTCBuildPrimitive){.lower_x = boxes[i].min[0],
            .lower_y = boxes[i].min[1],
            .lower_z = boxes[i].min[2],
            .upper_x = boxes[i].max[0],
            .upper_y = boxes[i].max[1],
            .upper_z = boxes[i].max[2],
            .primID = i};
    struct RTCBuildArguments args = rtcDefaultBuildArguments();
    args.maxDepth = HG_BVH_DEPTH;
    args.maxLeafSize = leaf_most;
    args.bvh = bvh;
    args.primitives = primitives;
    args.primitiveCount = args.primitiveArrayCapacity = count;
    args.createNode = make_node;
    args.setNodeChildren = set_children;
    args.setNodeBounds = set_bounds;
    args.createLeaf = make_leaf;
    void *root = rtcBuildBVH(&args);
    const enum RTCError said = rtcGetDeviceError(b->device);
    hg_free(primitives);
    return said == RTC_ERROR_NONE ? root : NULL;
}

// --- halves of equal count -----------------------------------------------------------------------

struct halving {
    const struct hg_bvh_box *boxes;
    struct node *nodes;
    struct leaf *leaves;
    uint32_t node_count, leaf_count, leaf_most;
    int axis;
};

static void grow_box(struct hg_bvh_box *box, const struct hg_bvh_box *by)
{
    for (int i = 0; i < 3; i++) {
        box->min[i] = fminf(box->min[i], by->min[i]);
        box->max[i] = fmaxf(box->max[i], by->max[i]);
    }
}

static int by_middle(const void *a, const void *b, void *user)
{
    const struct halving *h = user;
    const uint32_t i = *(const uint32_t *)a, k = *(const uint32_t *)b;
    const float x = h->boxes[i].min[h->axis] + h->boxes[i].max[h->axis];
    const float y = h->boxes[k].min[h->axis] + h->boxes[k].max[h->axis];
    if (x != y)
        return x < y ? -1 : 1;
    return i < k ? -1 : i > k;
}

static struct hg_bvh_box box_of(const struct halving *h, const uint32_t *items, uint32_t count)
{
    struct hg_bvh_box box = h->boxes[items[0]];
    for (uint32_t i = 1; i < count; i++)
        grow_box(&box, &h->boxes[items[i]]);
    return box;
}

// Depth: the logarithm of count.
static void *halve(struct halving *h, uint32_t *items, uint32_t count, const struct hg_bvh_box *box)
{
    if (count <= h->leaf_most) {
        struct leaf *leaf = &h->leaves[h->leaf_count++];
        leaf->count = count;
        memcpy(leaf->items, items, count * sizeof *items);
        return (void *)((uintptr_t)leaf | LEAF_BIT);
    }
    struct node *node = &h->nodes[h->node_count++];
    h->axis = 0;
    for (int i = 1; i < 3; i++)
        if (box->max[i] - box->min[i] > box->max[h->axis] - box->min[h->axis])
            h->axis = i;
    qsort_r(items, count, sizeof *items, by_middle, h);
    const uint32_t half = count / 2;
    for (int i = 0; i < 2; i++) {
        uint32_t *first = items + (i == 0 ? 0 : half);
        const uint32_t n = i == 0 ? half : count - half;
        node->box[i] = box_of(h, first, n);
        node->child[i] = halve(h, first, n, &node->box[i]);
    }
    return node;
}

// --- to nodes of the device ----------------------------------------------------------------------

struct step {
    const void *from; // node or leaf
    uint32_t parent, depth;
    bool second;
};

struct flattening {
    struct hg_bvh *out;
    struct step *stack;
    size_t capacity;
    uint32_t count;
    struct hg_bvh_box *exact; // [node_count * 2]
    size_t exact_capacity;
};

static uint32_t quantise(double x, bool up)
{
    const double q = up ? ceil(x + MARGIN) : floor(x - MARGIN);
    return (uint32_t)(q < 0.0 ? 0.0 : q > 65535.0 ? 65535.0 : q);
}

static uint32_t axis_word(const struct hg_bvh *bvh, const struct hg_bvh_box *box, int axis)
{
    const double step = (double)bvh->step[axis], origin = (double)bvh->origin[axis];
    return quantise(((double)box->min[axis] - origin) / step, false) |
           quantise(((double)box->max[axis] - origin) / step, true) << 16;
}

// The grid: the tree with room for the margin, no finer than positions are.
static void lay_grid(struct hg_bvh *bvh)
{
    for (int i = 0; i < 3; i++) {
        const float low = bvh->bounds.min[i], high = bvh->bounds.max[i];
        const float far = fmaxf(fabsf(low), fabsf(high));
        const float step = fmaxf((high * 0.5f - low * 0.5f) / 32760.0f, far * 1e-6f);
        bvh->step[i] = fmaxf(step, 1e-30f);
        bvh->origin[i] = low - 2.0f * bvh->step[i];
    }
}

static void write_nodes(struct hg_bvh *bvh, const struct hg_bvh_box *exact)
{
    lay_grid(bvh);
    for (uint32_t i = 0; i < bvh->node_count; i++) {
        struct hg_gpu_bvh_node *n = &bvh->nodes[i];
        const struct hg_bvh_box *b = &exact[i * 2];
        n->x0 = axis_word(bvh, b, 0);
        n->y0 = axis_word(bvh, b, 1);
        n->z0 = axis_word(bvh, b, 2);
        n->x1 = axis_word(bvh, b + 1, 0);
        n->y1 = axis_word(bvh, b + 1, 1);
        n->z1 = axis_word(bvh, b + 1, 2);
    }
}

static enum hg_status push(struct flattening *f, const struct step *s)
{
    const enum hg_status status = hg_grow(&f->stack, &f->capacity, f->count + 1, sizeof *f->stack);
    if (status == HG_OK)
        f->stack[f->count++] = *s;
    return status;
}

static uint32_t add_leaf(struct hg_bvh *out, const struct leaf *leaf)
{
    const uint32_t ref = HG_BVH_LEAF | (leaf->count - 1) << HG_BVH_COUNT_SHIFT | out->item_count;
    memcpy(out->order + out->item_count, leaf->items, leaf->count * sizeof *leaf->items);
    out->item_count += leaf->count;
    return ref;
}

static enum hg_status add_node(
    struct flattening *f, const struct step *s, const struct node *node, uint32_t *ref)
{
    struct hg_bvh *out = f->out;
    *ref = out->node_count;
    if (s->depth >= HG_BVH_DEPTH)
        return HG_E_LIMIT;
    if (hg_grow(&out->nodes, &out->node_capacity, out->node_count + 1, sizeof *out->nodes) !=
            HG_OK ||
        hg_grow(&f->exact, &f->exact_capacity, (size_t)out->node_count * 2 + 2, sizeof *f->exact) !=
            HG_OK)
        return HG_E_NOMEM;
    memset(&out->nodes[out->node_count], 0, sizeof *out->nodes);
    memcpy(&f->exact[(size_t)out->node_count * 2], node->box, sizeof node->box);
    out->node_count++;
    enum hg_status status = HG_OK;
    for (int i = 1; i >= 0 && status == HG_OK; i--)
        status = push(f, &(struct step){node->child[i], *ref, s->depth + 1, i == 1});
    return status;
}

static enum hg_status flatten(struct flattening *f, const void *root)
{
    struct hg_bvh *out = f->out;
    enum hg_status status = push(f, &(struct step){.from = root, .parent = HG_BVH_NONE});
    while (status == HG_OK && f->count > 0) {
        const struct step s = f->stack[--f->count];
        const uintptr_t at = (uintptr_t)s.from;
        uint32_t ref = 0;
        if ((at & LEAF_BIT) != 0)
            ref = add_leaf(out, (const struct leaf *)(at & ~LEAF_BIT));
        else
            status = add_node(f, &s, s.from, &ref);
        if (s.parent == HG_BVH_NONE)
            out->root = ref;
        else if (s.second)
            out->nodes[s.parent].child1 = ref;
        else
            out->nodes[s.parent].child0 = ref;
    }
    return status;
}

static enum hg_status finish_tree(struct hg_bvh *out, const void *root)
{
    struct flattening f = {.out = out};
    out->node_count = out->item_count = 0;
    const enum hg_status status = flatten(&f, root);
    if (status == HG_OK)
        write_nodes(out, f.exact);
    hg_free(f.stack);
    hg_free(f.exact);
    return status;
}

static enum hg_status build_by_count(
    const struct hg_bvh_box *boxes, uint32_t count, uint32_t leaf_most, struct hg_bvh *out)
{
    struct halving h = {.boxes = boxes, .leaf_most = leaf_most};
    uint32_t *items = hg_calloc(count, sizeof *items);
    h.nodes = hg_calloc(count, sizeof *h.nodes);
    h.leaves = hg_calloc(count, sizeof *h.leaves);
    enum hg_status status =
        items != NULL && h.nodes != NULL && h.leaves != NULL ? HG_OK : HG_E_NOMEM;
    for (uint32_t i = 0; i < count && status == HG_OK; i++)
        items[i] = i;
    if (status == HG_OK)
        status = finish_tree(out, halve(&h, items, count, &out->bounds));
    hg_free(items);
    hg_free(h.nodes);
    hg_free(h.leaves);
    return status;
}

enum hg_status hg_bvh_build(struct hg_bvh_builder *b, const struct hg_bvh_box *boxes,
    uint32_t count, uint32_t leaf_most, struct hg_bvh *out)
{
    memset(out, 0, sizeof *out);
    out->root = HG_BVH_NONE;
    if (count == 0) {
        lay_grid(out);
        return HG_OK;
    }
    if (count > HG_BVH_FIRST)
        return HG_E_LIMIT;
    out->order = hg_calloc(count, sizeof *out->order);
    const RTCBVH bvh = out->order != NULL ? rtcNewBVH(b->device) : NULL;
    if (bvh == NULL) {
        hg_bvh_finish(out);
        return HG_E_NOMEM;
    }
    out->bounds = boxes[0];
    for (uint32_t i = 1; i < count; i++)
        grow_box(&out->bounds, &boxes[i]);
    const void *root = build_by_area(b, bvh, boxes, count, leaf_most);
    enum hg_status status = root != NULL ? finish_tree(out, root) : HG_E_LIMIT;
    rtcReleaseBVH(bvh);
    if (status == HG_E_LIMIT) // too deep
        status = build_by_count(boxes, count, leaf_most, out);
    if (status != HG_OK)
        hg_bvh_finish(out);
    return status;
}

// --- refit ---------------------------------------------------------------------------------------

static struct hg_bvh_box child_box(
    uint32_t ref, const struct hg_bvh_box *exact, const struct hg_bvh_box *items)
{
    struct hg_bvh_box box;
    if ((ref & HG_BVH_LEAF) == 0) {
        box = exact[(size_t)ref * 2];
        grow_box(&box, &exact[(size_t)ref * 2 + 1]);
        return box;
    }
    const uint32_t first = ref & HG_BVH_FIRST, count = (ref >> HG_BVH_COUNT_SHIFT & 7u) + 1;
    box = items[first];
    for (uint32_t i = 1; i < count; i++)
        grow_box(&box, &items[first + i]);
    return box;
}

enum hg_status hg_bvh_refit(struct hg_bvh *bvh, const struct hg_bvh_box *items)
{
    if (bvh->root == HG_BVH_NONE)
        return HG_OK;
    struct hg_bvh_box *exact = hg_calloc((size_t)bvh->node_count * 2, sizeof *exact);
    if (exact == NULL)
        return HG_E_NOMEM;
    for (uint32_t i = bvh->node_count; i > 0; i--) { // children come behind their parents
        exact[(size_t)i * 2 - 2] = child_box(bvh->nodes[i - 1].child0, exact, items);
        exact[(size_t)i * 2 - 1] = child_box(bvh->nodes[i - 1].child1, exact, items);
    }
    bvh->bounds = child_box(bvh->root, exact, items);
    write_nodes(bvh, exact);
    hg_free(exact);
    return HG_OK;
}
