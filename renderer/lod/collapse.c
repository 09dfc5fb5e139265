// collapse.c - which edge is collapsed next, and the collapse: costs by quadrics, a heap of
// positions by the cost of their best one, and what a collapse must not do.
#include <math.h>
#include <string.h>

#include "renderer/lod/simplifier.h"

#define DEEP        1.5f // a depth cost this much above the quadric's is looked into
#define FLIP_COSINE 0.2f // a triangle may turn by less than this says
#define FLIP_LOOSE  0.0f
#define SHORT       2e-6f // of a collapse's squared length: where nothing else tells, short ones go

// ---- heap of positions by cost ------------------------------------------------------------------

// Costs are not negative, so their bits have the order of their values.
static uint64_t entry_of(float cost, uint32_t position)
{
    uint32_t bits;
    memcpy(&bits, &cost, sizeof bits);
    return (uint64_t)bits << 32 | position;
}

static void put(struct hg_lod_simplifier *s, uint32_t slot, uint64_t e)
{
    s->heap[slot] = e;
    s->place[(uint32_t)e] = slot;
}

static uint32_t sift_up(struct hg_lod_simplifier *s, uint32_t slot, uint64_t e)
{
    while (slot > 0 && e < s->heap[(slot - 1) / 2]) {
        put(s, slot, s->heap[(slot - 1) / 2]);
        slot = (slot - 1) / 2;
    }
    return slot;
}

static uint32_t sift_down(struct hg_lod_simplifier *s, uint32_t slot, uint64_t e)
{
    for (;;) {
        uint32_t child = slot * 2 + 1;
        if (child >= s->heap_count)
            return slot;
        child += child + 1 < s->heap_count && s->heap[child + 1] < s->heap[child];
        if (s->heap[child] >= e)
            return slot;
        put(s, slot, s->heap[child]);
        slot = child;
    }
}

// Puts an entry where it belongs, from a slot that is free.
static void settle(struct hg_lod_simplifier *s, uint32_t slot, uint64_t e)
{
    const uint32_t up = sift_up(s, slot, e);
    put(s, up < slot ? up : sift_down(s, slot, e), e);
}

static void heap_remove(struct hg_lod_simplifier *s, uint32_t p)
{
    const uint32_t slot = s->place[p];
    if (slot == HG_LOD_NONE)
        return;
    s->place[p] = HG_LOD_NONE;
    s->heap_count--;
    if (slot < s->heap_count)
        settle(s, slot, s->heap[s->heap_count]);
}

static void heap_set(struct hg_lod_simplifier *s, uint32_t p, float cost)
{
    s->cost[p] = cost;
    settle(s, s->place[p] == HG_LOD_NONE ? s->heap_count++ : s->place[p], entry_of(cost, p));
}

// ---- neighbours ---------------------------------------------------------------------------------

// stamp[] says which neighbours the ring has already, slot[] where.
static uint32_t ring_add(struct hg_lod_simplifier *s, struct hg_lod_ring *r, uint32_t p)
{
    if (s->stamp[p] == s->now) {
        uint8_t *uses = &r->uses[s->slot[p]];
        *uses = (uint8_t)(*uses < 255 ? *uses + 1 : 255);
        return s->slot[p];
    }
    if (r->count == HG_LOD_RING_MAX) {
        r->full = true;
        return HG_LOD_RING_MAX;
    }
    s->stamp[p] = s->now;
    s->slot[p] = (uint8_t)r->count;
    r->uses[r->count] = 1;
    r->at[r->count] = p;
    return r->count++;
}

// Neighbours of a position and how often edges are used; drops dead corners.
void hg_lod_gather(struct hg_lod_simplifier *s, uint32_t position, struct hg_lod_ring *r)
{
    const struct hg_lod_patch *p = &s->patch;
    uint8_t ahead[HG_LOD_RING_MAX + 1] = {0};
    r->count = r->odd = r->twisted = 0;
    r->full = false;
    s->now++;
    uint32_t *link = &s->patch.head[position], last = HG_LOD_NONE;
    while (*link != HG_LOD_NONE) {
        const uint32_t c = *link;
        if (p->triangles[c / 4][0] == HG_LOD_NONE) {
            *link = p->next[c]; // drop it
            continue;
        }
        uint32_t at[3];
        hg_lod_corner_places(p, c, at);
        ahead[ring_add(s, r, at[1])]++;
        ring_add(s, r, at[2]);
        last = c;
        link = &p->next[c];
    }
    s->patch.tail[position] = last;
    for (uint32_t i = 0; i < r->count; i++) {
        r->odd += r->uses[i] != 2;
        r->twisted += ahead[i] != 1;
    }
}

// The same of a plain position: the next corners of its triangles are its neighbours.
static void gather_plain(struct hg_lod_simplifier *s, uint32_t position, struct hg_lod_ring *r)
{
    const struct hg_lod_patch *p = &s->patch;
    uint32_t *link = &s->patch.head[position], last = HG_LOD_NONE;
    r->count = r->odd = r->twisted = 0;
    r->full = false;
    while (*link != HG_LOD_NONE) {
        static const uint8_t turn[4] = {1, 2, 0, 0};
        const uint32_t c = *link;
        if (p->triangles[c / 4][0] == HG_LOD_NONE) {
            *link = p->next[c]; // drop it
            continue;
        }
        if (r->count < HG_LOD_RING_MAX)
            r->at[r->count++] = p->places[c / 4][turn[c % 4]];
        else
            r->full = true;
        last = c;
        link = &p->next[c];
    }
    s->patch.tail[position] = last;
}

typedef int32_t lanes __attribute__((vector_size(32)));

// Whether every edge of a position has two triangles that are turned the same way: then it has as
// many neighbours as triangles, and each of them is once the next and once the last corner. Fills
// the ring when it is so. Positions with more than 8 triangles are not looked at.
static bool gather_if_plain(struct hg_lod_simplifier *s, uint32_t position, struct hg_lod_ring *r)
{
    const struct hg_lod_patch *p = &s->patch;
    union {
        lanes all;
        int32_t at[8];
    } next = {{-1, -1, -1, -1, -1, -1, -1, -1}};
    int32_t last[8];
    uint32_t n = 0;
    for (uint32_t c = p->head[position]; c != HG_LOD_NONE; c = p->next[c]) {
        uint32_t at[3];
        if (n == 8)
            return false;
        hg_lod_corner_places(p, c, at);
        next.at[n] = (int32_t)at[1];
        last[n++] = (int32_t)at[2];
    }
    lanes twice = {0};
    for (uint32_t i = 0; i < n; i++)
        twice += (next.all == next.at[i]) + (next.all == last[i]) * 16;
    for (uint32_t i = 0; i < n; i++)
        if (twice[i] != -17)
            return false;
    memcpy(r->at, next.at, sizeof next.at);
    r->count = n;
    r->odd = r->twisted = 0;
    r->full = false;
    return true;
}

// ---- cost of a collapse -------------------------------------------------------------------------

static double distance_of_looks(const struct hg_lod_patch *p, uint32_t a, uint32_t b)
{
    const uint32_t n = p->attribute_count;
    double sum = 0.0;
    for (uint32_t k = 0; k < n; k++) {
        const double d =
            (double)p->attributes[(size_t)a * n + k] - (double)p->attributes[(size_t)b * n + k];
        sum += d * d;
    }
    return sum;
}

// The vertex at position `to` that vertex v becomes: one that shares a triangle with it, else the
// one that looks most like it.
static uint32_t partner(const struct hg_lod_patch *p, uint32_t v, uint32_t to)
{
    const uint32_t first = p->vertex_first[to];
    if (p->vertex_next[first] == HG_LOD_NONE)
        return first;
    HG_LOD_FOR_CORNERS(p, p->position_of[v], c)
    {
        uint32_t w[3];
        hg_lod_corner_vertices(p, c, w);
        for (int k = 1; w[0] == v && k < 3; k++)
            if (p->position_of[w[k]] == to)
                return w[k];
    }
    uint32_t best = first;
    double least = INFINITY;
    for (uint32_t w = first; w != HG_LOD_NONE; w = p->vertex_next[w]) {
        const double d = distance_of_looks(p, v, w);
        if (d < least) {
            least = d;
            best = w;
        }
    }
    return best;
}

HG_LOD_INLINE struct hg_lod_looks looks_of(const struct hg_lod_simplifier *s, uint32_t vertex)
{
    const uint32_t n = s->patch.attribute_count;
    return (struct hg_lod_looks){
        &s->looks[vertex], &s->gradients[(size_t)vertex * n], n, s->looks_area[vertex]};
}

// What the quadrics of a position say about a place that lies by (at, 1) away, and those of its
// vertices about the ones of `to`; anything not below `bound` when it is not below that.
static inline float collapse_sum(const struct hg_lod_simplifier *s,
    const struct hg_lod_quadric *shape, uint32_t from, uint32_t to, hg_lod_vec at, float bound)
{
    const struct hg_lod_patch *p = &s->patch;
    const uint32_t n = p->attribute_count;
    float sum = fabsf(hg_lod_quadric_at(shape, at)) +
                SHORT * s->area[from] * (hg_lod_vec_sum(at * at) - 1.0f);
    for (uint32_t v = p->vertex_first[from]; n > 0 && sum < bound && v != HG_LOD_NONE;
         v = p->vertex_next[v]) {
        if (!(s->looks_area[v] > 0.0f))
            continue;
        uint32_t w = p->vertex_first[to];
        if (p->vertex_next[w] != HG_LOD_NONE)
            w = partner(p, v, to);
        const struct hg_lod_looks looks = looks_of(s, v);
        sum += fabsf(hg_lod_looks_at(
            &looks, at, p->attributes + (size_t)v * n, p->attributes + (size_t)w * n));
    }
    return sum;
}

// Cost of a collapse; anything not below `limit` when it is not below that.
static float collapse_cost(
    const struct hg_lod_simplifier *s, uint32_t from, uint32_t to, float limit)
{
    hg_lod_vec at = hg_lod_vec_at(&s->patch, to) - hg_lod_vec_at(&s->patch, from);
    at[3] = 1.0f;
    return collapse_sum(s, &s->shape[from], from, to, at, limit * s->root[from]) / s->root[from];
}

static bool turns(const struct hg_lod_patch *p, uint32_t corner, hg_lod_vec to, float cosine)
{
    uint32_t at[3];
    hg_lod_corner_places(p, corner, at);
    const hg_lod_vec b = hg_lod_vec_at(p, at[1]), e = hg_lod_vec_at(p, at[2]) - b;
    const hg_lod_vec n0 = hg_lod_vec_cross(e, hg_lod_vec_at(p, at[0]) - b),
                     n1 = hg_lod_vec_cross(e, to - b);
    const float along = hg_lod_vec_dot(n0, n1), limit = cosine * cosine;
    return along <= 0.0f ||
           along * along <= limit * hg_lod_vec_dot(n0, n0) * hg_lod_vec_dot(n1, n1);
}

// Positions that are neighbours of both ends must be those of the triangles at the edge (the link
// condition; Dey et al. 1999, "Topology preserving edge contraction").
static bool keeps_topology(struct hg_lod_simplifier *s, uint32_t from, uint32_t to)
{
    const struct hg_lod_patch *p = &s->patch;
    const uint32_t near = ++s->now;
    uint32_t shared = 0, common = 0;
    HG_LOD_FOR_CORNERS(p, from, c)
    {
        uint32_t at[3];
        hg_lod_corner_places(p, c, at);
        const uint32_t a = at[1], b = at[2];
        shared += a == to || b == to;
        s->stamp[a] = s->stamp[b] = near;
    }
    s->stamp[to] = 0;
    HG_LOD_FOR_CORNERS(p, to, c)
    {
        uint32_t at[3];
        hg_lod_corner_places(p, c, at);
        for (int k = 1; k < 3; k++) {
            const uint32_t a = at[k];
            common += s->stamp[a] == near;
            if (s->stamp[a] == near)
                s->stamp[a] = 0;
        }
    }
    return common <= shared;
}

// Whether a triangle that moves would lie on one that `to` has: a closed piece would fall flat.
static bool falls_flat(const struct hg_lod_patch *p, uint32_t corner, uint32_t to)
{
    uint32_t v[3];
    hg_lod_corner_places(p, corner, v);
    const uint32_t a = v[1], b = v[2];
    HG_LOD_FOR_CORNERS(p, to, c)
    {
        uint32_t w[3];
        hg_lod_corner_places(p, c, w);
        const uint32_t x = w[1], y = w[2];
        if ((x == a && y == b) || (x == b && y == a))
            return true;
    }
    return false;
}

static bool is_valid(struct hg_lod_simplifier *s, uint32_t from, uint32_t to)
{
    const struct hg_lod_patch *p = &s->patch;
    uint32_t lost = 0, left = 0, last = HG_LOD_NONE;
    HG_LOD_FOR_CORNERS(p, from, c)
    {
        uint32_t v[3];
        hg_lod_corner_places(p, c, v);
        if (v[1] == to || v[2] == to) {
            lost++;
            continue;
        }
        if (turns(p, c, hg_lod_vec_at(p, to), s->permissive ? FLIP_LOOSE : FLIP_COSINE))
            return false;
        left++;
        last = c;
    }
    if (s->permissive)
        return lost < p->live;
    if (!keeps_topology(s, from, to))
        return false;
    if (left > 1)
        return true;
    HG_LOD_FOR_CORNERS(p, to, c)
    left++;
    // Something of the piece must be left, and not flat: with three triangles around `from` the
    // last one may fall on one of `to`.
    return left > lost && (last == HG_LOD_NONE || !falls_flat(p, last, to));
}

// Planes say little about how deep a narrow pit is, or how high a spike: what the position itself
// would move away from the surface, in the terms of collapse_cost. Anything up to `enough` when it
// is no more than that.
static float depth_cost(const struct hg_lod_simplifier *s, uint32_t from, uint32_t to, float enough)
{
    const struct hg_lod_patch *p = &s->patch;
    const float root = s->root[from];
    float least = INFINITY;
    HG_LOD_FOR_CORNERS(p, from, c)
    {
        uint32_t at[3];
        hg_lod_corner_places(p, c, at);
        if (at[1] == to || at[2] == to)
            continue;
        least = fminf(least,
            hg_lod_distance2(p->point[from], p->point[to], p->point[at[1]], p->point[at[2]]));
        if (least * root <= enough)
            break;
    }
    if (least == INFINITY) {
        least = 0.0f;
        for (int k = 0; k < 3; k++)
            least += (p->point[from][k] - p->point[to][k]) * (p->point[from][k] - p->point[to][k]);
    }
    return least * root;
}

static void choose(struct hg_lod_simplifier *s, uint32_t from, uint32_t target, float cost)
{
    s->target[from] = target;
    s->stale[from] = false;
    if (target == HG_LOD_NONE)
        heap_remove(s, from);
    else
        heap_set(s, from, cost);
}

// The cheapest of all neighbours of a position without open edges, whether it may be or not.
static void choose_plain(struct hg_lod_simplifier *s, uint32_t from, const struct hg_lod_ring *r)
{
    const struct hg_lod_quadric shape = s->shape[from];
    const hg_lod_vec here = hg_lod_vec_at(&s->patch, from);
    float best = INFINITY;
    uint32_t target = HG_LOD_NONE;
    for (uint32_t i = 0; i < r->count && !r->full; i++) {
        hg_lod_vec at = hg_lod_vec_at(&s->patch, r->at[i]) - here;
        at[3] = 1.0f;
        const float sum = collapse_sum(s, &shape, from, r->at[i], at, best);
        if (sum < best) {
            best = sum;
            target = r->at[i];
        }
    }
    s->rim[from] = s->sure[from] = false;
    choose(s, from, target, best / s->root[from]);
}

bool hg_lod_choose_if_plain(struct hg_lod_simplifier *s, uint32_t position)
{
    struct hg_lod_ring r;
    if (!gather_if_plain(s, position, &r))
        return false;
    s->plain[position] = true;
    choose_plain(s, position, &r);
    return true;
}

// The same with `check` only among valid ones and by depth too, and at open edges.
static void choose_any(
    struct hg_lod_simplifier *s, uint32_t from, const struct hg_lod_ring *r, bool check)
{
    float best = INFINITY;
    uint32_t target = HG_LOD_NONE;
    for (uint32_t i = 0; i < r->count && !r->full; i++) {
        // An open edge (or one where sheets meet) is followed along, and its ends stay.
        if (r->odd > 0 && !s->permissive && (r->uses[i] == 2 || r->odd != 2))
            continue;
        float cost = collapse_cost(s, from, r->at[i], best);
        if (check && cost < best)
            cost = fmaxf(cost, depth_cost(s, from, r->at[i], cost));
        if (cost < best && (!check || is_valid(s, from, r->at[i]))) {
            best = cost;
            target = r->at[i];
        }
    }
    s->rim[from] = r->odd > 0;
    s->sure[from] = check;
    choose(s, from, target, best);
}

static void gather_any(struct hg_lod_simplifier *s, uint32_t position, struct hg_lod_ring *r)
{
    if (s->plain[position])
        gather_plain(s, position, r);
    else
        hg_lod_gather(s, position, r);
}

// Finds the best collapse of a position; with `check` only among valid ones, and by depth too.
void hg_lod_evaluate(struct hg_lod_simplifier *s, uint32_t from, bool check)
{
    struct hg_lod_ring r;
    if (s->patch.fixed[from] || s->patch.into[from] != from)
        return;
    gather_any(s, from, &r);
    if (s->plain[from] && !check)
        choose_plain(s, from, &r);
    else
        choose_any(s, from, &r, check);
}

// ---- the collapse -------------------------------------------------------------------------------

// What vertex v has seen goes to w, which lies by (t, 0) farther.
static void merge_looks(struct hg_lod_simplifier *s, uint32_t v, uint32_t w, hg_lod_vec t)
{
    const struct hg_lod_patch *p = &s->patch;
    const uint32_t n = p->attribute_count;
    const struct hg_lod_looks from = looks_of(s, v), to = looks_of(s, w);
    if (p->fixed[p->position_of[w]])
        return;
    s->mean[w] += s->mean[v];
    hg_lod_looks_move(&from, t, p->attributes + (size_t)v * n, p->attributes + (size_t)w * n);
    hg_lod_quadric_add(to.quadric, from.quadric);
    s->looks_area[w] += s->looks_area[v];
    for (uint32_t k = 0; k < n; k++)
        to.gradients[k] += from.gradients[k];
}

// Moves the triangles of `from` to `to`; those at the edge go. Vertices of `from` remember their
// partner in vertex_global's place of `become`.
static void move_triangles(struct hg_lod_simplifier *s, uint32_t from, uint32_t to)
{
    struct hg_lod_patch *p = &s->patch;
    uint32_t old[HG_LOD_RING_MAX], become[HG_LOD_RING_MAX], n = 0;
    const hg_lod_vec step = hg_lod_vec_at(p, to) - hg_lod_vec_at(p, from);
    for (uint32_t v = p->vertex_first[from]; v != HG_LOD_NONE && n < HG_LOD_RING_MAX;
         v = p->vertex_next[v]) {
        old[n] = v;
        become[n] = partner(p, v, to);
        merge_looks(s, v, become[n++], step);
    }
    HG_LOD_FOR_CORNERS(p, from, c)
    {
        uint32_t v[3], i = 0;
        hg_lod_corner_vertices(p, c, v);
        if (p->position_of[v[1]] == to || p->position_of[v[2]] == to) {
            p->triangles[c / 4][0] = HG_LOD_NONE;
            p->live--;
            continue;
        }
        while (i + 1 < n && old[i] != v[0])
            i++;
        p->triangles[c / 4][c % 4] = become[i];
        p->places[c / 4][c % 4] = to;
    }
    if (p->head[from] != HG_LOD_NONE) {
        p->next[p->tail[to]] = p->head[from];
        p->tail[to] = p->tail[from];
        p->head[from] = HG_LOD_NONE;
    }
}

// A neighbour of what was collapsed has other collapses to choose from now: `to` instead of `from`.
// What is left of the others costs what it did, so its cost stays a lower bound.
static void update(struct hg_lod_simplifier *s, uint32_t position, uint32_t from, uint32_t to)
{
    if (s->patch.fixed[position])
        return;
    if (position == to || s->target[position] == HG_LOD_NONE || s->rim[position] || s->permissive) {
        hg_lod_evaluate(s, position, false);
        return;
    }
    const float cost = collapse_cost(s, position, to, s->cost[position]);
    if (cost >= s->cost[position]) {
        s->stale[position] |= s->target[position] == from;
        return;
    }
    s->target[position] = to;
    s->sure[position] = s->stale[position] = false;
    heap_set(s, position, cost);
}

static void collapse(struct hg_lod_simplifier *s, uint32_t from, uint32_t to)
{
    struct hg_lod_patch *p = &s->patch;
    struct hg_lod_ring r;
    gather_any(s, from, &r);
    heap_remove(s, from);
    move_triangles(s, from, to);
    if (!p->fixed[to]) {
        hg_lod_quadric_move(&s->shape[from], hg_lod_vec_at(p, to) - hg_lod_vec_at(p, from));
        hg_lod_quadric_add(&s->shape[to], &s->shape[from]);
        s->area[to] += s->area[from];
        s->root[to] = sqrtf(s->area[to] + HG_LOD_LEAST_AREA);
    }
    p->into[from] = to;
    s->plain[to] = s->plain[to] && s->plain[from]; // sheets may meet at `to` now
    for (uint32_t i = 0; i < r.count; i++)
        update(s, r.at[i], from, to);
}

void hg_lod_collapse(struct hg_lod_simplifier *s, uint32_t target)
{
    struct hg_lod_patch *p = &s->patch;
    while (p->live > target && s->heap_count > 0) {
        const uint32_t from = (uint32_t)s->heap[0];
        const uint32_t to = s->target[from];
        if (s->stale[from] || p->into[to] != to) {
            hg_lod_evaluate(s, from, false);
            continue;
        }
        const float most = s->cost[from] * DEEP;
        const bool deep = !s->sure[from] && depth_cost(s, from, to, most) > most;
        if (!deep && is_valid(s, from, to))
            collapse(s, from, to);
        else
            hg_lod_evaluate(s, from, true);
    }
}
