// simplify.c - a group of clusters with half the triangles: edges are collapsed onto one of
// their ends, cheapest first, by quadrics of shape and attributes.
//
// A collapse maps one position to another, so whatever had no border before has none after: seen as
// a chain of oriented triangles, the border of the result is the image of the border, and locked
// positions are their own image. That is why the cuts of the hierarchy cannot crack.
//
// Vertices never move off the lattice and attributes are never blended: a vertex that goes takes
// its triangles to a vertex of the other position, the one on its side of the seam if there is one.
#include <math.h>
#include <string.h>

#include "base/alloc.h"
#include "renderer/geometry/lod/internal.h"
#include "renderer/geometry/lod/quadric.h"

#define DEEP        1.5f   // a depth cost this much above the quadric's is looked into
#define LEAST_AREA  1e-12f // squared edge lengths
#define RING_MAX    48     // positions with more neighbours stay
#define OPEN_WEIGHT 4.0f   // of the planes that hold open edges, against the triangle's
#define SEAM_WEIGHT 0.5f   // of those that hold seams
#define SLIVER      1e-7f  // squared sine below which a triangle has no gradients
#define FLIP_COSINE 0.2f   // a triangle may turn by less than this says
#define FLIP_LOOSE  0.0f
#define SHORT       2e-6f // of a collapse's squared length: where nothing else tells, short ones go
#define JUMP        2.5f  // an error so many times that of the level below is looked into

struct ring {
    uint32_t at[RING_MAX];  // neighbour positions
    uint8_t uses[RING_MAX]; // triangles at the edge to it
    uint32_t count, odd;    // odd: edges without exactly two triangles
    uint32_t twisted;       // edges that two triangles have in the same direction
    bool full;
};

struct simplifier {
    struct hg_lod_patch patch;
    struct hg_lod_quadric *shape; // [position_count]
    struct hg_lod_quadric *looks; // [vertex_count]
    hg_lod_vec *gradients;        // [vertex_count * attribute_count]
    hg_lod_vec *mean;             // [vertex_count] normals by area; all 0: no normals
    float *area, *looks_area;     // [position_count], [vertex_count] of the triangles in them
    float *root;                  // [position_count] of `area`
    float *cost;                  // [position_count] of the best collapse
    uint32_t *target;             // [position_count]
    uint64_t *heap;               // [position_count] bits of the cost, then the position
    uint32_t *place;              // in the heap, HG_LOD_NONE: not in it
    uint32_t heap_count;
    uint32_t *stamp, now; // [position_count] marks of a search
    uint8_t *slot;        // [position_count] in the ring
    uint8_t *plain;       // [position_count] all its edges have two triangles, turned the same way
    uint8_t *rim;         // [position_count] has open edges
    uint8_t *sure;        // [position_count] depth is in the cost
    uint8_t *stale;       // [position_count] the cost is a lower bound: evaluate first
    bool permissive;      // give up topology and open edges
    void *memory;
};

// ---- heap of positions by cost ------------------------------------------------------------------

// Costs are not negative, so their bits have the order of their values.
static uint64_t entry_of(float cost, uint32_t position)
{
    uint32_t bits;
    memcpy(&bits, &cost, sizeof bits);
    return (uint64_t)bits << 32 | position;
}

static void put(struct simplifier *s, uint32_t slot, uint64_t e)
{
    s->heap[slot] = e;
    s->place[(uint32_t)e] = slot;
}

static uint32_t sift_up(struct simplifier *s, uint32_t slot, uint64_t e)
{
    while (slot > 0 && e < s->heap[(slot - 1) / 2]) {
        put(s, slot, s->heap[(slot - 1) / 2]);
        slot = (slot - 1) / 2;
    }
    return slot;
}

static uint32_t sift_down(struct simplifier *s, uint32_t slot, uint64_t e)
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
static void settle(struct simplifier *s, uint32_t slot, uint64_t e)
{
    const uint32_t up = sift_up(s, slot, e);
    put(s, up < slot ? up : sift_down(s, slot, e), e);
}

static void heap_remove(struct simplifier *s, uint32_t p)
{
    const uint32_t slot = s->place[p];
    if (slot == HG_LOD_NONE)
        return;
    s->place[p] = HG_LOD_NONE;
    s->heap_count--;
    if (slot < s->heap_count)
        settle(s, slot, s->heap[s->heap_count]);
}

static void heap_set(struct simplifier *s, uint32_t p, float cost)
{
    s->cost[p] = cost;
    settle(s, s->place[p] == HG_LOD_NONE ? s->heap_count++ : s->place[p], entry_of(cost, p));
}

// ---- neighbours ---------------------------------------------------------------------------------

// Next corner of a live triangle from `corner` on; drops dead ones from the list.
static uint32_t live_corner(const struct hg_lod_patch *p, uint32_t corner)
{
    while (corner != HG_LOD_NONE && p->triangles[corner / 4][0] == HG_LOD_NONE)
        corner = p->next[corner];
    return corner;
}

#define FOR_CORNERS(patch, position, c)                                                            \
    for (uint32_t c = live_corner(patch, (patch)->head[position]); c != HG_LOD_NONE;               \
         c = live_corner(patch, (patch)->next[c]))

// Positions of the corner and of the next two.
static void corner_places(const struct hg_lod_patch *p, uint32_t corner, uint32_t at[3])
{
    static const uint8_t turn[3][3] = {{0, 1, 2}, {1, 2, 0}, {2, 0, 1}};
    const uint32_t *t = p->places[corner / 4];
    const uint8_t *k = turn[corner % 4];
    at[0] = t[k[0]];
    at[1] = t[k[1]];
    at[2] = t[k[2]];
}

static void corner_vertices(const struct hg_lod_patch *p, uint32_t corner, uint32_t v[3])
{
    const uint32_t *t = p->triangles[corner / 4];
    const uint32_t k = corner % 4;
    v[0] = t[k];
    v[1] = t[k == 2 ? 0 : k + 1];
    v[2] = t[k == 0 ? 2 : k - 1];
}

// stamp[] says which neighbours the ring has already, slot[] where.
static uint32_t ring_add(struct simplifier *s, struct ring *r, uint32_t p)
{
    if (s->stamp[p] == s->now) {
        uint8_t *uses = &r->uses[s->slot[p]];
        *uses = (uint8_t)(*uses < 255 ? *uses + 1 : 255);
        return s->slot[p];
    }
    if (r->count == RING_MAX) {
        r->full = true;
        return RING_MAX;
    }
    s->stamp[p] = s->now;
    s->slot[p] = (uint8_t)r->count;
    r->uses[r->count] = 1;
    r->at[r->count] = p;
    return r->count++;
}

// Neighbours of a position and how often edges are used; drops dead corners.
static void gather(struct simplifier *s, uint32_t position, struct ring *r)
{
    const struct hg_lod_patch *p = &s->patch;
    uint8_t ahead[RING_MAX + 1] = {0};
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
        corner_places(p, c, at);
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
static void gather_plain(struct simplifier *s, uint32_t position, struct ring *r)
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
        if (r->count < RING_MAX)
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
static bool gather_if_plain(struct simplifier *s, uint32_t position, struct ring *r)
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
        corner_places(p, c, at);
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

// ---- quadrics -----------------------------------------------------------------------------------

static hg_lod_vec vec_cross(hg_lod_vec a, hg_lod_vec b)
{
    return (hg_lod_vec){
        a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0], 0.0f};
}

static hg_lod_vec vec_at(const struct hg_lod_patch *p, uint32_t position)
{
    return hg_lod_vec_load(p->point[position]);
}

static float vec_dot(hg_lod_vec a, hg_lod_vec b)
{
    return hg_lod_vec_sum(a * b);
}

// e1, e2: edges from the first corner; normal: their cross product.
static void add_attributes(
    struct simplifier *s, uint32_t t, hg_lod_vec e1, hg_lod_vec e2, hg_lod_vec normal)
{
    const struct hg_lod_patch *p = &s->patch;
    const uint32_t n = p->attribute_count, *v = p->triangles[t];
    const float *a0 = p->attributes + (size_t)v[0] * n, *a1 = p->attributes + (size_t)v[1] * n,
                *a2 = p->attributes + (size_t)v[2] * n;
    const float normal2 = vec_dot(normal, normal), area = 0.5f * sqrtf(normal2);
    const bool sliver = normal2 <= SLIVER * vec_dot(e1, e1) * vec_dot(e2, e2);
    const float inverse = sliver ? 0.0f : 1.0f / normal2;
    const hg_lod_vec along1 = vec_cross(e2, normal) * inverse;
    const hg_lod_vec along2 = vec_cross(normal, e1) * inverse;
    struct hg_lod_quadric q = {0};
    hg_lod_vec gradients[HG_LOD_ATTRIBUTES];
    for (uint32_t k = 0; k < n; k++) {
        const hg_lod_vec g = along1 * (a1[k] - a0[k]) + along2 * (a2[k] - a0[k]);
        hg_lod_quadric_add_plane(&q, g, area);
        gradients[k] = g * area;
    }
    for (int i = 0; i < 3; i++) {
        if (p->fixed[p->places[t][i]])
            continue; // nothing is asked of what cannot move
        struct hg_lod_quadric *to = &s->looks[v[i]];
        hg_lod_vec *slope = &s->gradients[(size_t)v[i] * n];
        to->x += q.x;
        to->y += q.y;
        to->z += q.z;
        s->looks_area[v[i]] += area;
        for (uint32_t k = 0; k < n; k++)
            slope[k] += gradients[k];
    }
}

static void add_triangle(struct simplifier *s, uint32_t t)
{
    const struct hg_lod_patch *p = &s->patch;
    const uint32_t *at = p->places[t];
    if (p->fixed[at[0]] && p->fixed[at[1]] && p->fixed[at[2]])
        return;
    const hg_lod_vec a = vec_at(p, at[0]);
    const hg_lod_vec e1 = vec_at(p, at[1]) - a, e2 = vec_at(p, at[2]) - a;
    const hg_lod_vec normal = vec_cross(e1, e2);
    const float length = sqrtf(vec_dot(normal, normal)), area = 0.5f * length;
    if (!(length > 0.0f))
        return;
    struct hg_lod_quadric q = {0};
    hg_lod_quadric_add_plane(&q, normal / length, area);
    for (int i = 0; i < 3; i++) {
        struct hg_lod_quadric *to = &s->shape[at[i]];
        if (p->fixed[at[i]])
            continue;
        to->x += q.x;
        to->y += q.y;
        to->z += q.z;
        s->area[at[i]] += area;
    }
    if (p->attribute_count > 0)
        add_attributes(s, t, e1, e2, normal);
}

// A plane through the edge from corner 0 to `other` of a triangle, upright on the triangle.
static void add_upright(
    struct simplifier *s, uint32_t position, const uint32_t v[3], uint32_t other, float weight)
{
    const struct hg_lod_patch *p = &s->patch;
    const hg_lod_vec a = vec_at(p, position), edge = vec_at(p, other) - a;
    const hg_lod_vec normal =
        vec_cross(vec_at(p, p->position_of[v[1]]) - a, vec_at(p, p->position_of[v[2]]) - a);
    const hg_lod_vec upright = vec_cross(edge, normal);
    const float length = sqrtf(vec_dot(upright, upright));
    if (length > 0.0f)
        hg_lod_quadric_add_plane(
            &s->shape[position], upright / length, weight * vec_dot(edge, edge));
}

static bool is_seam(const struct hg_lod_patch *p, uint32_t position)
{
    return p->vertex_next[p->vertex_first[position]] != HG_LOD_NONE;
}

// Planes along open edges and seams, so that they keep their shape.
static void add_edges(struct simplifier *s, uint32_t position)
{
    const struct hg_lod_patch *p = &s->patch;
    struct ring r;
    gather(s, position, &r);
    s->plain[position] = r.odd == 0 && r.twisted == 0 && !r.full;
    if (r.odd == 0 && !is_seam(p, position))
        return;
    uint32_t sides[RING_MAX][2]; // vertex at the neighbour and here, of the first triangle
    memset(sides, 0xff, sizeof sides);
    FOR_CORNERS(p, position, c)
    {
        uint32_t v[3];
        corner_vertices(p, c, v);
        for (int k = 1; k < 3; k++) {
            const uint32_t other = p->position_of[v[k]];
            uint32_t i = 0;
            while (i < r.count && r.at[i] != other)
                i++;
            if (i == r.count)
                continue;
            if (r.uses[i] != 2)
                add_upright(s, position, v, other, OPEN_WEIGHT);
            else if (sides[i][0] == HG_LOD_NONE)
                memcpy(sides[i], (uint32_t[]){v[k], v[0]}, sizeof sides[i]);
            else if (sides[i][0] != v[k] || sides[i][1] != v[0])
                add_upright(s, position, v, other, SEAM_WEIGHT);
        }
    }
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
    FOR_CORNERS(p, p->position_of[v], c)
    {
        uint32_t w[3];
        corner_vertices(p, c, w);
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

// What the quadrics of a position say about a place that lies by (at, 1) away, and those of its
// vertices about the ones of `to`; anything not below `bound` when it is not below that.
static inline float collapse_sum(const struct simplifier *s, const struct hg_lod_quadric *shape,
    uint32_t from, uint32_t to, hg_lod_vec at, float bound)
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
        sum += fabsf(hg_lod_looks_at(&s->looks[v], &s->gradients[(size_t)v * n], n,
            s->looks_area[v], at, p->attributes + (size_t)v * n, p->attributes + (size_t)w * n));
    }
    return sum;
}

// Cost of a collapse; anything not below `limit` when it is not below that.
static float collapse_cost(const struct simplifier *s, uint32_t from, uint32_t to, float limit)
{
    hg_lod_vec at = vec_at(&s->patch, to) - vec_at(&s->patch, from);
    at[3] = 1.0f;
    return collapse_sum(s, &s->shape[from], from, to, at, limit * s->root[from]) / s->root[from];
}

static bool turns(const struct hg_lod_patch *p, uint32_t corner, hg_lod_vec to, float cosine)
{
    uint32_t at[3];
    corner_places(p, corner, at);
    const hg_lod_vec b = vec_at(p, at[1]), e = vec_at(p, at[2]) - b;
    const hg_lod_vec n0 = vec_cross(e, vec_at(p, at[0]) - b), n1 = vec_cross(e, to - b);
    const float along = vec_dot(n0, n1), limit = cosine * cosine;
    return along <= 0.0f || along * along <= limit * vec_dot(n0, n0) * vec_dot(n1, n1);
}

// Positions that are neighbours of both ends must be those of the triangles at the edge (the link
// condition; Dey et al. 1999, "Topology preserving edge contraction").
static bool keeps_topology(struct simplifier *s, uint32_t from, uint32_t to)
{
    const struct hg_lod_patch *p = &s->patch;
    const uint32_t near = ++s->now;
    uint32_t shared = 0, common = 0;
    FOR_CORNERS(p, from, c)
    {
        uint32_t at[3];
        corner_places(p, c, at);
        const uint32_t a = at[1], b = at[2];
        shared += a == to || b == to;
        s->stamp[a] = s->stamp[b] = near;
    }
    s->stamp[to] = 0;
    FOR_CORNERS(p, to, c)
    {
        uint32_t at[3];
        corner_places(p, c, at);
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
    corner_places(p, corner, v);
    const uint32_t a = v[1], b = v[2];
    FOR_CORNERS(p, to, c)
    {
        uint32_t w[3];
        corner_places(p, c, w);
        const uint32_t x = w[1], y = w[2];
        if ((x == a && y == b) || (x == b && y == a))
            return true;
    }
    return false;
}

static bool is_valid(struct simplifier *s, uint32_t from, uint32_t to)
{
    const struct hg_lod_patch *p = &s->patch;
    uint32_t lost = 0, left = 0, last = HG_LOD_NONE;
    FOR_CORNERS(p, from, c)
    {
        uint32_t v[3];
        corner_places(p, c, v);
        if (v[1] == to || v[2] == to) {
            lost++;
            continue;
        }
        if (turns(p, c, vec_at(p, to), s->permissive ? FLIP_LOOSE : FLIP_COSINE))
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
    FOR_CORNERS(p, to, c)
    left++;
    // Something of the piece must be left, and not flat: with three triangles around `from` the
    // last one may fall on one of `to`.
    return left > lost && (last == HG_LOD_NONE || !falls_flat(p, last, to));
}

// Planes say little about how deep a narrow pit is, or how high a spike: what the position itself
// would move away from the surface, in the terms of collapse_cost. Anything up to `enough` when it
// is no more than that.
static float depth_cost(const struct simplifier *s, uint32_t from, uint32_t to, float enough)
{
    const struct hg_lod_patch *p = &s->patch;
    const float root = s->root[from];
    float least = INFINITY;
    FOR_CORNERS(p, from, c)
    {
        uint32_t at[3];
        corner_places(p, c, at);
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

static void choose(struct simplifier *s, uint32_t from, uint32_t target, float cost)
{
    s->target[from] = target;
    s->stale[from] = false;
    if (target == HG_LOD_NONE)
        heap_remove(s, from);
    else
        heap_set(s, from, cost);
}

// The cheapest of all neighbours of a position without open edges, whether it may be or not.
static void choose_plain(struct simplifier *s, uint32_t from, const struct ring *r)
{
    const struct hg_lod_quadric shape = s->shape[from];
    const hg_lod_vec here = vec_at(&s->patch, from);
    float best = INFINITY;
    uint32_t target = HG_LOD_NONE;
    for (uint32_t i = 0; i < r->count && !r->full; i++) {
        hg_lod_vec at = vec_at(&s->patch, r->at[i]) - here;
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

// The same with `check` only among valid ones and by depth too, and at open edges.
static void choose_any(struct simplifier *s, uint32_t from, const struct ring *r, bool check)
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

static void gather_any(struct simplifier *s, uint32_t position, struct ring *r)
{
    if (s->plain[position])
        gather_plain(s, position, r);
    else
        gather(s, position, r);
}

// Finds the best collapse of a position; with `check` only among valid ones, and by depth too.
static void evaluate(struct simplifier *s, uint32_t from, bool check)
{
    struct ring r;
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
static void merge_looks(struct simplifier *s, uint32_t v, uint32_t w, hg_lod_vec t)
{
    const struct hg_lod_patch *p = &s->patch;
    const uint32_t n = p->attribute_count;
    hg_lod_vec *from = &s->gradients[(size_t)v * n], *to = &s->gradients[(size_t)w * n];
    if (p->fixed[p->position_of[w]])
        return;
    s->mean[w] += s->mean[v];
    hg_lod_looks_move(&s->looks[v], from, n, s->looks_area[v], t, p->attributes + (size_t)v * n,
        p->attributes + (size_t)w * n);
    hg_lod_quadric_add(&s->looks[w], &s->looks[v]);
    s->looks_area[w] += s->looks_area[v];
    for (uint32_t k = 0; k < n; k++)
        to[k] += from[k];
}

// Moves the triangles of `from` to `to`; those at the edge go. Vertices of `from` remember their
// partner in vertex_global's place of `become`.
static void move_triangles(struct simplifier *s, uint32_t from, uint32_t to)
{
    struct hg_lod_patch *p = &s->patch;
    uint32_t old[RING_MAX], become[RING_MAX], n = 0;
    const hg_lod_vec step = vec_at(p, to) - vec_at(p, from);
    for (uint32_t v = p->vertex_first[from]; v != HG_LOD_NONE && n < RING_MAX;
         v = p->vertex_next[v]) {
        old[n] = v;
        become[n] = partner(p, v, to);
        merge_looks(s, v, become[n++], step);
    }
    FOR_CORNERS(p, from, c)
    {
        uint32_t v[3], i = 0;
        corner_vertices(p, c, v);
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
static void update(struct simplifier *s, uint32_t position, uint32_t from, uint32_t to)
{
    if (s->patch.fixed[position])
        return;
    if (position == to || s->target[position] == HG_LOD_NONE || s->rim[position] || s->permissive) {
        evaluate(s, position, false);
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

static void collapse(struct simplifier *s, uint32_t from, uint32_t to)
{
    struct hg_lod_patch *p = &s->patch;
    struct ring r;
    gather_any(s, from, &r);
    heap_remove(s, from);
    move_triangles(s, from, to);
    if (!p->fixed[to]) {
        hg_lod_quadric_move(&s->shape[from], vec_at(p, to) - vec_at(p, from));
        hg_lod_quadric_add(&s->shape[to], &s->shape[from]);
        s->area[to] += s->area[from];
        s->root[to] = sqrtf(s->area[to] + LEAST_AREA);
    }
    p->into[from] = to;
    s->plain[to] = s->plain[to] && s->plain[from]; // sheets may meet at `to` now
    for (uint32_t i = 0; i < r.count; i++)
        update(s, r.at[i], from, to);
}

static uint32_t vertices_at(const struct hg_lod_patch *p, uint32_t position)
{
    uint32_t n = 0;
    for (uint32_t v = p->vertex_first[position]; v != HG_LOD_NONE; v = p->vertex_next[v])
        n++;
    return n;
}

static void run(struct simplifier *s, uint32_t target)
{
    struct hg_lod_patch *p = &s->patch;
    while (p->live > target && s->heap_count > 0) {
        const uint32_t from = (uint32_t)s->heap[0];
        const uint32_t to = s->target[from];
        if (s->stale[from] || p->into[to] != to) {
            evaluate(s, from, false);
            continue;
        }
        const float most = s->cost[from] * DEEP;
        const bool deep = !s->sure[from] && depth_cost(s, from, to, most) > most;
        if (!deep && is_valid(s, from, to))
            collapse(s, from, to);
        else
            evaluate(s, from, true);
    }
}

// Shapes and topology are given up, so nothing is plain any more.
static void run_permissive(struct simplifier *s, uint32_t target)
{
    s->permissive = true;
    memset(s->plain, 0, s->patch.position_count);
    for (uint32_t i = 0; i < s->patch.position_count; i++)
        evaluate(s, i, false);
    run(s, target);
}

static enum hg_status take(struct simplifier *s)
{
    const struct hg_lod_patch *p = &s->patch;
    const size_t n = p->position_count, v = p->vertex_count, gradients = v * p->attribute_count;
    const size_t bytes = (n + v) * sizeof *s->shape + (gradients + v) * sizeof *s->gradients +
                         n * sizeof *s->heap + (n * 6 + v) * sizeof(float) + n * 5;
    s->memory = hg_calloc(1, bytes);
    if (s->memory == NULL)
        return HG_E_NOMEM;
    s->shape = s->memory; // aligned to 16 bytes
    s->looks = s->shape + n;
    s->gradients = (hg_lod_vec *)(void *)(s->looks + v);
    s->mean = s->gradients + gradients;
    s->heap = (uint64_t *)(void *)(s->mean + v);
    s->area = (float *)(void *)(s->heap + n);
    s->looks_area = s->area + n;
    s->root = s->looks_area + v;
    s->cost = s->root + n;
    s->target = (uint32_t *)(void *)(s->cost + n);
    s->place = s->target + n;
    s->stamp = s->place + n;
    s->slot = (uint8_t *)(s->stamp + n);
    s->plain = s->slot + n;
    s->rim = s->plain + n;
    s->sure = s->rim + n;
    s->stale = s->sure + n;
    memset(s->place, 0xff, n * sizeof *s->place);
    return HG_OK;
}

static bool has_normals(const struct hg_lod_patch *p)
{
    return p->job->mesh->format.normal >= 0 && p->weight[0] > 0.0f;
}

// Finds what kind of position it is and its first collapse.
static void prepare_position(struct simplifier *s, uint32_t position)
{
    struct ring r;
    if (!is_seam(&s->patch, position) && gather_if_plain(s, position, &r)) {
        s->plain[position] = true;
        choose_plain(s, position, &r);
        return;
    }
    add_edges(s, position);
    evaluate(s, position, false);
}

static enum hg_status prepare(struct simplifier *s)
{
    const struct hg_lod_patch *p = &s->patch;
    if (take(s) != HG_OK)
        return HG_E_NOMEM;
    for (uint32_t t = 0; t < p->triangle_count; t++)
        add_triangle(s, t);
    for (uint32_t i = 0; i < p->position_count; i++) {
        if (vertices_at(p, i) >= RING_MAX)
            s->patch.fixed[i] = 1;
        s->root[i] = sqrtf(s->area[i] + LEAST_AREA);
        if (!p->fixed[i])
            prepare_position(s, i);
    }
    for (uint32_t v = 0; has_normals(p) && v < p->vertex_count; v++)
        for (int k = 0; k < 3; k++)
            s->mean[v][k] = s->looks_area[v] * p->attributes[(size_t)v * p->attribute_count + k];
    return HG_OK;
}

// What is left stands for what went: a small triangle shades as its surroundings did on the mean.
static enum hg_status turn_normals(struct simplifier *s, struct hg_lod_simplify_job *job)
{
    const struct hg_lod_patch *p = &s->patch;
    job->mean_count = 0;
    if (!has_normals(p))
        return HG_OK;
    job->means = hg_calloc(p->vertex_count, sizeof *job->means);
    if (job->means == NULL)
        return HG_E_NOMEM;
    for (uint32_t v = 0; v < p->vertex_count; v++) {
        const uint32_t position = p->position_of[v];
        const float length = sqrtf(vec_dot(s->mean[v], s->mean[v]));
        if (p->fixed[position] || p->into[position] != position || !(length > 0.0f))
            continue;
        float *normal = p->attributes + (size_t)v * p->attribute_count;
        for (int k = 0; k < 3; k++)
            normal[k] = s->mean[v][k] / length * p->weight[k];
        job->means[job->mean_count++] =
            (struct hg_lod_mean){p->vertex_global[v], hg_lod_normal_word(normal)};
    }
    return HG_OK;
}

// What is left, in the old order; samples name triangles by their new numbers.
static void write_back(const struct hg_lod_patch *p, struct hg_lod_simplify_job *job)
{
    uint32_t n = 0, *number = p->next; // corners are no longer looked for
    for (uint32_t t = 0; t < p->triangle_count; t++) {
        if (p->triangles[t][0] == HG_LOD_NONE)
            continue;
        for (int k = 0; k < 3; k++)
            job->triangles[n * 3 + (uint32_t)k] = p->vertex_global[p->triangles[t][k]];
        number[t] = n++;
    }
    for (uint32_t i = 0; i < job->sample_count; i++)
        if (job->samples[i].triangle != HG_LOD_NONE)
            job->samples[i].triangle = number[job->samples[i].triangle];
    job->triangle_count = n;
}

// Simplifies a fresh patch of the job and measures its samples.
static enum hg_status attempt(
    struct simplifier *s, struct hg_lod_simplify_job *job, bool permissive)
{
    *s = (struct simplifier){0};
    enum hg_status status = hg_lod_patch_init(&s->patch, job);
    if (status == HG_OK)
        status = prepare(s);
    if (status != HG_OK)
        return status;
    if (!permissive)
        run(s, job->target_count);
    if (permissive || s->patch.live > job->target_count + job->triangle_count / 8)
        run_permissive(s, job->target_count);
    status = turn_normals(s, job);
    if (status == HG_OK)
        status = hg_lod_measure(&s->patch, &job->error);
    return status;
}

static void close(struct simplifier *s)
{
    hg_free(s->memory);
    hg_lod_patch_finish(&s->patch);
}

static float worst_of(const struct hg_lod_simplify_job *job)
{
    float worst = 0.0f;
    for (uint32_t i = 0; i < job->sample_count; i++)
        worst = fmaxf(worst, job->samples[i].distance);
    return worst;
}

// Scans have handles and tunnels by the hundred. When what is left of a surface is hardly more than
// they need, keeping them costs whole limbs: then the surface is better off without.
static enum hg_status attempt_again(
    struct simplifier *s, struct hg_lod_simplify_job *job, struct hg_lod_sample *samples)
{
    struct simplifier other;
    struct hg_lod_simplify_job loose = *job;
    loose.samples = samples;
    loose.means = NULL;
    const enum hg_status status = attempt(&other, &loose, true);
    const bool better = status == HG_OK && loose.error < job->error;
    if (better) {
        memcpy(job->samples, samples, job->sample_count * sizeof *samples);
        job->error = loose.error;
        job->mean_count = loose.mean_count;
        struct hg_lod_mean *means = job->means;
        job->means = loose.means;
        loose.means = means;
        other.patch.job = job;
        close(s);
        *s = other;
    } else {
        close(&other);
    }
    hg_free(loose.means);
    return status;
}

enum hg_status hg_lod_simplify(struct hg_lod_simplify_job *job)
{
    struct simplifier s = {0};
    const float before = worst_of(job);
    struct hg_lod_sample *samples = hg_calloc(job->sample_count, sizeof *samples);
    enum hg_status status = samples != NULL ? HG_OK : HG_E_NOMEM;
    job->error = 0.0f;
    if (status == HG_OK && job->sample_count > 0)
        memcpy(samples, job->samples, job->sample_count * sizeof *samples);
    if (status == HG_OK)
        status = attempt(&s, job, false);
    if (status == HG_OK && before > 0.0f && job->error > JUMP * before)
        status = attempt_again(&s, job, samples);
    if (status == HG_OK)
        write_back(&s.patch, job);
    close(&s);
    hg_free(samples);
    return status;
}
