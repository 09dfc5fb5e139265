#include "renderer/light/emitters/light_tree.h"

#include <math.h>

#include "base/alloc.h"
#include "base/checked.h"
#include "renderer/math/vec.h"

#define BINS      16
#define TASK_SIZE 4096 // subtrees of at most this many items are built by one thread
#define SLACK_RAD 3e-4 // by which cones are widened: more than axes are rounded

// What a node bounds, in full precision.
struct bounds {
    float min[3], max[3];
    double axis[3], theta_o, theta_e;
    float power, range; // range: INFINITY = no end
    bool two_sided;
};

// A range of items that becomes the subtree below `slot`; its other nodes lie from `base` on.
struct task {
    uint32_t slot, base, first, count, depth, trail;
};

struct build {
    const struct hg_light_item *items;
    uint32_t *order; // items of the tree
    struct bounds *bounds;
    struct hg_light_tree *tree;
    struct task *tasks;
    size_t task_capacity;
    uint32_t task_count;
    bool collects; // ranges of TASK_SIZE become tasks
    enum hg_status status;
};

// --- bounds --------------------------------------------------------------------------------------

static struct bounds bounds_of(const struct hg_light_item *item)
{
    struct bounds b = {.theta_o = acos((double)hg_clampf(item->cos_o, -1, 1)),
        .theta_e = acos((double)hg_clampf(item->cos_e, -1, 1)),
        .power = item->power,
        .range = item->range > 0 ? item->range : INFINITY,
        .two_sided = item->two_sided && item->cos_o > -1};
    for (int a = 0; a < 3; a++) {
        b.min[a] = item->min[a];
        b.max[a] = item->max[a];
        b.axis[a] = (double)item->axis[a];
    }
    return b;
}

// The smallest cone about two; both sides: whichever way round `b` is closer.
static void merge_cones(struct bounds *a, const struct bounds *b)
{
    const bool flips = a->two_sided && b->two_sided;
    if (a->two_sided != b->two_sided) {
        a->theta_o = HG_PI;
        a->two_sided = false;
        return;
    }
    double dot = 0, r[3], length = 0;
    for (int i = 0; i < 3; i++)
        dot += a->axis[i] * b->axis[i];
    const double sign = flips && dot < 0 ? -1 : 1;
    const double apart = acos(fmax(-1, fmin(1, dot * sign)));
    if (fmin(apart + b->theta_o, HG_PI) <= a->theta_o)
        return;
    if (fmin(apart + a->theta_o, HG_PI) <= b->theta_o) {
        a->theta_o = b->theta_o;
        memcpy(a->axis, b->axis, sizeof a->axis);
        return;
    }
    const double theta = (a->theta_o + apart + b->theta_o) / 2;
    const double turn = theta - a->theta_o; // of a's axis towards b's
    for (int i = 0; i < 3; i++) {
        r[i] = sign * b->axis[i] - dot * sign * a->axis[i];
        length += r[i] * r[i];
    }
    length = sqrt(length);
    if (theta >= HG_PI || length < 1e-9) {
        a->theta_o = HG_PI;
        a->two_sided = false;
        return;
    }
    for (int i = 0; i < 3; i++)
        a->axis[i] = a->axis[i] * cos(turn) + r[i] / length * sin(turn);
    a->theta_o = theta;
}

static struct bounds merge(struct bounds a, const struct bounds *b)
{
    for (int i = 0; i < 3; i++) {
        a.min[i] = fminf(a.min[i], b->min[i]);
        a.max[i] = fmaxf(a.max[i], b->max[i]);
    }
    merge_cones(&a, b);
    a.theta_e = fmax(a.theta_e, b->theta_e);
    a.power += b->power;
    a.range = fmaxf(a.range, b->range);
    return a;
}

static uint32_t snorm16(double v)
{
    return (uint32_t)(uint16_t)(int16_t)lrint(fmax(-1, fmin(1, v)) * 32767);
}

// As hg_oct_decode of lib/octahedral.glsl reads it.
static uint32_t pack_axis(const double v[3])
{
    const double l = fabs(v[0]) + fabs(v[1]) + fabs(v[2]);
    if (!(l > 0))
        return 0;
    double x = v[0] / l, y = v[1] / l;
    if (v[2] < 0) {
        const double fx = (1 - fabs(y)) * (x >= 0 ? 1 : -1);
        y = (1 - fabs(x)) * (y >= 0 ? 1 : -1);
        x = fx;
    }
    return snorm16(x) | snorm16(y) << 16;
}

// Rounded conservatively, so that bounds contain all emitters.
static void store(struct hg_gpu_light_node *node, const struct bounds *b)
{
    const double cos_o = cos(fmin(HG_PI, b->theta_o + SLACK_RAD)), cos_e = cos(b->theta_e);
    node->min = (struct hg_vec3){b->min[0], b->min[1], b->min[2]};
    node->max = (struct hg_vec3){b->max[0], b->max[1], b->max[2]};
    node->power = b->power;
    node->inv_range_sq = isinf(b->range) ? 0 : 1 / (b->range * b->range);
    node->axis = pack_axis(b->axis);
    node->angles = (uint32_t)((cos_o + 1) / 2 * 65535) |
                   (uint32_t)(fmax(0, cos_e + 1 - 1e-6) / 2 * 32767) << 16 |
                   (b->two_sided ? 0x80000000u : 0);
}

// --- splitting -----------------------------------------------------------------------------------

typedef int32_t hg_i4 __attribute__((vector_size(16)));

struct bin {
    hg_v4 min, max, axis; // axis: sum of power * axis
    float power;
    uint32_t count;
};

static struct bin bin_empty(void)
{
    const float inf = INFINITY;
    return (struct bin){.min = {inf, inf, inf, 0}, .max = {-inf, -inf, -inf, 0}};
}

// Lane by lane.
static hg_v4 choose(hg_v4 a, hg_v4 b, hg_i4 first)
{
    return (hg_v4)(((hg_i4)a & first) | ((hg_i4)b & ~first));
}

static hg_v4 least(hg_v4 a, hg_v4 b)
{
    return choose(a, b, a < b);
}

static hg_v4 most(hg_v4 a, hg_v4 b)
{
    return choose(a, b, a > b);
}

static void bin_join(struct bin *a, const struct bin *b)
{
    a->min = least(a->min, b->min);
    a->max = most(a->max, b->max);
    a->axis += b->axis;
    a->power += b->power;
    a->count += b->count;
}

// SAOH cost: power times area times the spread of orientations, which is estimated by the length of
// the mean normal. A single direction counts as a quarter of the sphere.
static double bin_cost(const struct bin *b)
{
    const hg_v4 e = b->max - b->min;
    const double area = (double)(e[0] * e[1] + e[1] * e[2] + e[2] * e[0]);
    const double diagonal = (double)(e[0] * e[0] + e[1] * e[1] + e[2] * e[2]);
    const double mean =
        sqrt((double)(b->axis[0] * b->axis[0] + b->axis[1] * b->axis[1] + b->axis[2] * b->axis[2]));
    const double spread = b->power > 0 ? 1 - fmin(1, mean / (double)b->power) : 0;
    return (double)b->power * (1 + 3 * spread) * (2 * area + 0.1 * diagonal);
}

static hg_v4 center_of(const struct hg_light_item *item)
{
    return (hg_v4){0.5f * item->min[0] + 0.5f * item->max[0],
        0.5f * item->min[1] + 0.5f * item->max[1], 0.5f * item->min[2] + 0.5f * item->max[2], 0};
}

static uint32_t bin_index(const hg_v4 center, const hg_v4 low, const hg_v4 scale, int axis)
{
    const float at = (center[axis] - low[axis]) * scale[axis];
    return at >= BINS ? BINS - 1 : at > 0 ? (uint32_t)at : 0;
}

static void fill_bins(
    const struct build *b, const struct task *t, hg_v4 low, hg_v4 scale, struct bin bins[3][BINS])
{
    for (int i = 0; i < 3 * BINS; i++)
        bins[i / BINS][i % BINS] = bin_empty();
    for (uint32_t i = 0; i < t->count; i++) {
        const struct hg_light_item *item = &b->items[b->order[t->first + i]];
        const hg_v4 center = center_of(item);
        const float sharp = item->cos_o > -1 && !item->two_sided ? item->power : 0;
        const struct bin one = {.min = {item->min[0], item->min[1], item->min[2], 0},
            .max = {item->max[0], item->max[1], item->max[2], 0},
            .axis = {item->axis[0] * sharp, item->axis[1] * sharp, item->axis[2] * sharp, 0},
            .power = item->power,
            .count = 1};
        for (int a = 0; a < 3; a++)
            bin_join(&bins[a][bin_index(center, low, scale, a)], &one);
    }
}

// Cheapest plane; its axis and the first bin behind it. False: none leaves items on both sides.
static bool choose_plane(
    const struct bin bins[3][BINS], const hg_v4 extent, int *axis, uint32_t *plane)
{
    const float longest = fmaxf(extent[0], fmaxf(extent[1], extent[2]));
    double best = INFINITY;
    bool found = false;
    for (int a = 0; a < 3; a++) {
        struct bin after[BINS], before = bin_empty();
        if (!(extent[a] > 0))
            continue;
        after[BINS - 1] = bins[a][BINS - 1];
        for (uint32_t i = BINS - 1; i-- > 0;) {
            after[i] = bins[a][i];
            bin_join(&after[i], &after[i + 1]);
        }
        for (uint32_t i = 1; i < BINS; i++) {
            bin_join(&before, &bins[a][i - 1]);
            if (before.count == 0 || after[i].count == 0)
                continue;
            const double cost =
                (bin_cost(&before) + bin_cost(&after[i])) * (double)longest / (double)extent[a];
            if (!found || cost < best) {
                best = cost;
                *axis = a;
                *plane = i;
                found = true;
            }
        }
    }
    return found;
}

static uint32_t log2_up(uint32_t n)
{
    return n < 2 ? 0 : 32 - (uint32_t)__builtin_clz(n - 1);
}

// Partitions the items by the cheapest plane; returns the number of items before it. Splits in half
// where no plane is better, or where the tree would get too deep.
static uint32_t split(const struct build *b, const struct task *t)
{
    const float inf = INFINITY;
    hg_v4 low = {inf, inf, inf, 0}, high = {-inf, -inf, -inf, 0}, scale = {0, 0, 0, 0};
    struct bin bins[3][BINS];
    uint32_t *order = b->order + t->first, plane = 0, front = 0;
    int axis = 0;
    if (t->depth + 1 + log2_up(t->count) >= HG_EMITTER_MAX_DEPTH)
        return t->count / 2;
    for (uint32_t i = 0; i < t->count; i++) {
        const hg_v4 center = center_of(&b->items[order[i]]);
        low = least(low, center);
        high = most(high, center);
    }
    const hg_v4 extent = high - low;
    for (int a = 0; a < 3; a++)
        scale[a] = extent[a] > 0 && isfinite(BINS / extent[a]) ? BINS / extent[a] : 0;
    fill_bins(b, t, low, scale, bins);
    if (!choose_plane((const struct bin(*)[BINS])bins, extent, &axis, &plane))
        return t->count / 2;
    for (uint32_t i = 0; i < t->count; i++) {
        const uint32_t item = order[i];
        if (bin_index(center_of(&b->items[item]), low, scale, axis) < plane) {
            order[i] = order[front];
            order[front++] = item;
        }
    }
    return front;
}

// --- building ------------------------------------------------------------------------------------

static void make_leaf(const struct build *b, const struct task *t)
{
    const uint32_t item = b->order[t->first];
    b->tree->nodes[t->slot].child = HG_EMITTER_IS_LEAF | item;
    b->tree->trails[item] = t->trail;
    b->bounds[t->slot] = bounds_of(&b->items[item]);
}

static bool put_off(struct build *b, const struct task *t)
{
    if (!b->collects || t->count > TASK_SIZE)
        return false;
    if (hg_grow(&b->tasks, &b->task_capacity, b->task_count + 1, sizeof *b->tasks) != HG_OK)
        b->status = HG_E_NOMEM;
    else
        b->tasks[b->task_count++] = *t;
    return true;
}

// A subtree of n items takes its slot and 2 n - 2 nodes from base on: two children, then all below
// the first, then all below the second.
static void build_range(struct build *b, const struct task *t)
{
    if (t->count == 1) {
        make_leaf(b, t);
        return;
    }
    if (put_off(b, t))
        return;
    const uint32_t n = split(b, t);
    const struct task first = {t->base, t->base + 2, t->first, n, t->depth + 1, t->trail};
    const struct task second = {t->base + 1, t->base + 2 * n, t->first + n, t->count - n,
        t->depth + 1, t->trail | 1u << t->depth};
    b->tree->nodes[t->slot].child = t->base;
    build_range(b, &first);
    build_range(b, &second);
}

static void build_task(void *user, size_t index)
{
    const struct build *b = user;
    struct build mine = *b;
    mine.collects = false;
    build_range(&mine, &b->tasks[index]);
}

// Children lie behind their parents. Returns the depth.
static uint32_t bound_all(struct build *b)
{
    uint32_t depth = 0;
    for (uint32_t i = b->tree->node_count; i-- > 0;) {
        struct hg_gpu_light_node *node = &b->tree->nodes[i];
        if ((node->child & HG_EMITTER_IS_LEAF) == 0)
            b->bounds[i] = merge(b->bounds[node->child], &b->bounds[node->child + 1]);
        store(node, &b->bounds[i]);
    }
    // The path to each leaf, one bit per level.
    for (uint32_t i = 0; i < b->tree->leaf_count; i++) {
        const uint32_t trail = b->tree->trails[b->order[i]];
        uint32_t steps = 0;
        for (uint32_t at = 0; (b->tree->nodes[at].child & HG_EMITTER_IS_LEAF) == 0; steps++)
            at = b->tree->nodes[at].child + (trail >> steps & 1);
        depth = steps > depth ? steps : depth;
    }
    return depth;
}

static bool is_good(const struct hg_light_item *item)
{
    bool good = item->power > 0 && isfinite(item->power) && isfinite(item->range);
    for (int a = 0; a < 3; a++)
        good = good && isfinite(item->min[a]) && isfinite(item->max[a]) &&
               isfinite(item->axis[a]) && item->min[a] <= item->max[a];
    return good && item->cos_o >= -1 && item->cos_e >= -1;
}

static enum hg_status allocate(struct build *b, uint32_t count)
{
    struct hg_light_tree *tree = b->tree;
    tree->trails = hg_calloc((size_t)count + 1, sizeof *tree->trails);
    b->order = hg_calloc((size_t)count + 1, sizeof *b->order);
    if (!tree->trails || !b->order)
        return HG_E_NOMEM;
    for (uint32_t i = 0; i < count; i++) {
        tree->trails[i] = HG_EMITTER_NONE;
        if (is_good(&b->items[i]))
            b->order[tree->leaf_count++] = i;
    }
    if (tree->leaf_count == 0)
        return HG_OK;
    tree->node_count = 2 * tree->leaf_count - 1;
    tree->nodes = hg_calloc(tree->node_count, sizeof *tree->nodes);
    b->bounds = hg_calloc(tree->node_count, sizeof *b->bounds);
    return tree->nodes && b->bounds ? HG_OK : HG_E_NOMEM;
}

enum hg_status hg_light_tree_build(const struct hg_light_item *items, uint32_t count,
    struct hg_jobs *jobs, struct hg_light_tree *out)
{
    *out = (struct hg_light_tree){0};
    struct build b = {.items = items, .tree = out, .collects = true};
    b.status = count < 1u << 30 ? allocate(&b, count) : HG_E_NOMEM;
    if (!b.status && out->leaf_count > 0) {
        build_range(&b, &(struct task){.slot = 0, .base = 1, .count = out->leaf_count});
        if (!b.status)
            hg_jobs_for(jobs, b.task_count, build_task, &b);
        if (!b.status)
            out->depth = bound_all(&b);
    }
    hg_free(b.order);
    hg_free(b.bounds);
    hg_free(b.tasks);
    if (b.status)
        hg_light_tree_finish(out);
    return b.status;
}

void hg_light_tree_finish(struct hg_light_tree *tree)
{
    hg_free(tree->nodes);
    hg_free(tree->trails);
    *tree = (struct hg_light_tree){0};
}
