// lod_simplify.c - a group of clusters with half the triangles: edges are collapsed onto one of
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
#include "renderer/geometry/lod_internal.h"
#include "renderer/geometry/lod_quadric.h"

#define DEEP        1.5f  // a depth cost this much above the quadric's is looked into
#define LEAST_AREA  1e-12 // squared edge lengths
#define RING_MAX    48    // positions with more neighbours stay
#define OPEN_WEIGHT 4.0   // of the planes that hold open edges, against the triangle's
#define SEAM_WEIGHT 0.5   // of those that hold seams
#define FLIP_COSINE 0.2f  // a triangle may turn by less than this says
#define FLIP_LOOSE  0.0f
#define JUMP        2.5f // an error so many times that of the level below is looked into

struct ring {
    uint32_t at[RING_MAX];  // neighbour positions
    uint8_t uses[RING_MAX]; // triangles at the edge to it
    uint32_t count, odd;    // odd: edges without exactly two triangles
    bool full;
};

struct simplifier {
    struct hg_lod_patch patch;
    struct hg_lod_quadric *shape;      // [position_count]
    struct hg_lod_quadric *looks;      // [vertex_count]
    struct hg_lod_gradient *gradients; // [vertex_count * attribute_count]
    double *root;                      // [position_count] of the area of `shape`
    float *cost;                       // [position_count] of the best collapse
    uint32_t *target;                  // [position_count]
    uint32_t *heap, *place;            // place: in the heap, HG_LOD_NONE: not in it
    uint32_t heap_count;
    uint32_t *stamp, now; // [position_count] marks of a search
    uint8_t *slot, *rim,
        *sure;       // [position_count] in the ring; has open edges; depth is in the cost
    bool permissive; // give up topology and open edges
    void *memory;
};

// ---- heap of positions by cost ------------------------------------------------------------------

static bool before(const struct simplifier *s, uint32_t a, uint32_t b)
{
    return s->cost[a] < s->cost[b] || (s->cost[a] == s->cost[b] && a < b);
}

static void put(struct simplifier *s, uint32_t slot, uint32_t p)
{
    s->heap[slot] = p;
    s->place[p] = slot;
}

static void sift_up(struct simplifier *s, uint32_t slot)
{
    const uint32_t p = s->heap[slot];
    while (slot > 0 && before(s, p, s->heap[(slot - 1) / 2])) {
        put(s, slot, s->heap[(slot - 1) / 2]);
        slot = (slot - 1) / 2;
    }
    put(s, slot, p);
}

static void sift_down(struct simplifier *s, uint32_t slot)
{
    const uint32_t p = s->heap[slot];
    for (;;) {
        uint32_t child = slot * 2 + 1;
        if (child >= s->heap_count)
            break;
        if (child + 1 < s->heap_count && before(s, s->heap[child + 1], s->heap[child]))
            child++;
        if (!before(s, s->heap[child], p))
            break;
        put(s, slot, s->heap[child]);
        slot = child;
    }
    put(s, slot, p);
}

static void heap_remove(struct simplifier *s, uint32_t p)
{
    const uint32_t slot = s->place[p];
    if (slot == HG_LOD_NONE)
        return;
    s->place[p] = HG_LOD_NONE;
    const uint32_t last = s->heap[--s->heap_count];
    if (last == p)
        return;
    put(s, slot, last);
    sift_up(s, slot);
    sift_down(s, s->place[last]);
}

static void heap_set(struct simplifier *s, uint32_t p, float cost)
{
    s->cost[p] = cost;
    if (s->place[p] == HG_LOD_NONE)
        put(s, s->heap_count++, p);
    sift_up(s, s->place[p]);
    sift_down(s, s->place[p]);
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
static void ring_add(struct simplifier *s, struct ring *r, uint32_t p)
{
    if (s->stamp[p] == s->now) {
        uint8_t *uses = &r->uses[s->slot[p]];
        *uses = (uint8_t)(*uses < 255 ? *uses + 1 : 255);
        return;
    }
    if (r->count == RING_MAX) {
        r->full = true;
        return;
    }
    s->stamp[p] = s->now;
    s->slot[p] = (uint8_t)r->count;
    r->uses[r->count] = 1;
    r->at[r->count++] = p;
}

static void gather(struct simplifier *s, uint32_t position, struct ring *r)
{
    const struct hg_lod_patch *p = &s->patch;
    r->count = r->odd = 0;
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
        ring_add(s, r, at[1]);
        ring_add(s, r, at[2]);
        last = c;
        link = &p->next[c];
    }
    s->patch.tail[position] = last;
    for (uint32_t i = 0; i < r->count; i++)
        r->odd += r->uses[i] != 2;
}

// ---- quadrics -----------------------------------------------------------------------------------

static void sub(const float a[3], const float b[3], double out[3])
{
    for (int k = 0; k < 3; k++)
        out[k] = (double)a[k] - (double)b[k];
}

static void cross(const double a[3], const double b[3], double out[3])
{
    out[0] = a[1] * b[2] - a[2] * b[1];
    out[1] = a[2] * b[0] - a[0] * b[2];
    out[2] = a[0] * b[1] - a[1] * b[0];
}

static double dot(const double a[3], const double b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static void add_attributes(
    struct simplifier *s, const uint32_t v[3], const double e1[3], const double e2[3], double area)
{
    const struct hg_lod_patch *p = &s->patch;
    const uint32_t n = p->attribute_count;
    const float *origin = p->point[p->position_of[v[0]]];
    const double m11 = dot(e1, e1), m22 = dot(e2, e2), m12 = dot(e1, e2);
    const double det = m11 * m22 - m12 * m12;
    const double inverse = det > 1e-9 * m11 * m22 ? 1.0 / det : 0.0;
    struct hg_lod_quadric q = {.weight = area};
    struct hg_lod_gradient gradients[HG_LOD_ATTRIBUTES];
    for (uint32_t k = 0; k < n; k++) {
        const double a0 = p->attributes[(size_t)v[0] * n + k];
        const double d1 = p->attributes[(size_t)v[1] * n + k] - a0;
        const double d2 = p->attributes[(size_t)v[2] * n + k] - a0;
        const double along1 = (d1 * m22 - d2 * m12) * inverse;
        const double along2 = (d2 * m11 - d1 * m12) * inverse;
        double g[3], d = a0;
        for (int i = 0; i < 3; i++) {
            g[i] = along1 * e1[i] + along2 * e2[i];
            d -= g[i] * (double)origin[i];
        }
        hg_lod_quadric_add_plane(&q, g, d, area);
        gradients[k] = (struct hg_lod_gradient){area * g[0], area * g[1], area * g[2], area * d};
    }
    for (int i = 0; i < 3; i++) {
        if (p->fixed[p->position_of[v[i]]])
            continue; // nothing is asked of what cannot move
        hg_lod_quadric_add(&s->looks[v[i]], &q);
        for (uint32_t k = 0; k < n; k++) {
            struct hg_lod_gradient *to = &s->gradients[(size_t)v[i] * n + k];
            to->x += gradients[k].x;
            to->y += gradients[k].y;
            to->z += gradients[k].z;
            to->d += gradients[k].d;
        }
    }
}

static void add_triangle(struct simplifier *s, uint32_t t)
{
    const struct hg_lod_patch *p = &s->patch;
    const uint32_t *v = p->triangles[t];
    const float *a = p->point[p->position_of[v[0]]];
    double e1[3], e2[3], normal[3];
    sub(p->point[p->position_of[v[1]]], a, e1);
    sub(p->point[p->position_of[v[2]]], a, e2);
    cross(e1, e2, normal);
    const double length = sqrt(dot(normal, normal)), area = 0.5 * length;
    if (!(length > 0.0))
        return;
    double d = 0.0;
    for (int k = 0; k < 3; k++) {
        normal[k] /= length;
        d -= normal[k] * (double)a[k];
    }
    struct hg_lod_quadric q = {.weight = area};
    hg_lod_quadric_add_plane(&q, normal, d, area);
    bool moves = false;
    for (int i = 0; i < 3; i++) {
        moves = moves || !p->fixed[p->places[t][i]];
        if (!p->fixed[p->places[t][i]])
            hg_lod_quadric_add(&s->shape[p->places[t][i]], &q);
    }
    if (p->attribute_count > 0 && moves)
        add_attributes(s, v, e1, e2, area);
}

// A plane through the edge from corner 0 to `other` of a triangle, upright on the triangle.
static void add_upright(
    struct simplifier *s, uint32_t position, const uint32_t v[3], uint32_t other, double weight)
{
    const struct hg_lod_patch *p = &s->patch;
    const float *a = p->point[position];
    double e1[3], e2[3], edge[3], normal[3], upright[3];
    sub(p->point[p->position_of[v[1]]], a, e1);
    sub(p->point[p->position_of[v[2]]], a, e2);
    sub(p->point[other], a, edge);
    cross(e1, e2, normal);
    cross(edge, normal, upright);
    const double length = sqrt(dot(upright, upright));
    if (!(length > 0.0))
        return;
    double d = 0.0;
    for (int k = 0; k < 3; k++) {
        upright[k] /= length;
        d -= upright[k] * (double)a[k];
    }
    hg_lod_quadric_add_plane(&s->shape[position], upright, d, weight * dot(edge, edge));
}

// Planes along open edges and seams, so that they keep their shape.
static void add_edges(struct simplifier *s, uint32_t position)
{
    const struct hg_lod_patch *p = &s->patch;
    struct ring r;
    gather(s, position, &r);
    const bool seam = p->vertex_next[p->vertex_first[position]] != HG_LOD_NONE;
    if (r.odd == 0 && !seam)
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

// Cost of a collapse; anything not below `limit` when it is not below that.
static float collapse_cost(const struct simplifier *s, uint32_t from, uint32_t to, float limit)
{
    const struct hg_lod_patch *p = &s->patch;
    const float *at = p->point[to];
    const uint32_t n = p->attribute_count;
    const double bound = (double)limit * s->root[from];
    double sum = fabs(hg_lod_quadric_at(&s->shape[from], at));
    for (uint32_t v = p->vertex_first[from]; n > 0 && sum < bound && v != HG_LOD_NONE;
         v = p->vertex_next[v]) {
        const struct hg_lod_quadric *q = &s->looks[v];
        if (!(q->weight > 0.0))
            continue;
        const uint32_t w = partner(p, v, to);
        sum += fabs(hg_lod_quadric_at(q, at) + hg_lod_gradients_at(&s->gradients[(size_t)v * n], n,
                                                   q->weight, at, p->attributes + (size_t)w * n));
    }
    return (float)(sum / s->root[from]);
}

static bool turns(const struct hg_lod_patch *p, uint32_t corner, const float to[3], float cosine)
{
    uint32_t at[3];
    corner_places(p, corner, at);
    const float *b = p->point[at[1]], *c = p->point[at[2]];
    double e[3], old1[3], new1[3], n0[3], n1[3];
    sub(c, b, e);
    sub(p->point[at[0]], b, old1);
    sub(to, b, new1);
    cross(e, old1, n0);
    cross(e, new1, n1);
    const double along = dot(n0, n1), limit = (double)(cosine * cosine);
    return along <= 0.0 || along * along <= limit * dot(n0, n0) * dot(n1, n1);
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
        if (turns(p, c, p->point[to], s->permissive ? FLIP_LOOSE : FLIP_COSINE))
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
// would move away from the surface, in the terms of collapse_cost.
static float depth_cost(const struct simplifier *s, uint32_t from, uint32_t to)
{
    const struct hg_lod_patch *p = &s->patch;
    float least = INFINITY;
    FOR_CORNERS(p, from, c)
    {
        uint32_t at[3];
        corner_places(p, c, at);
        if (at[1] == to || at[2] == to)
            continue;
        least = fminf(least,
            hg_lod_distance2(p->point[from], p->point[to], p->point[at[1]], p->point[at[2]]));
    }
    if (least == INFINITY) {
        least = 0.0f;
        for (int k = 0; k < 3; k++)
            least += (p->point[from][k] - p->point[to][k]) * (p->point[from][k] - p->point[to][k]);
    }
    return least * (float)s->root[from];
}

// Finds the best collapse of a position; with `check` only among valid ones, and by depth too.
static void evaluate(struct simplifier *s, uint32_t from, bool check)
{
    const struct hg_lod_patch *p = &s->patch;
    struct ring r;
    if (p->fixed[from] || p->into[from] != from)
        return;
    gather(s, from, &r);
    float best = INFINITY;
    uint32_t target = HG_LOD_NONE;
    for (uint32_t i = 0; i < r.count && !r.full; i++) {
        // An open edge (or one where sheets meet) is followed along, and its ends stay.
        if (r.odd > 0 && !s->permissive && (r.uses[i] == 2 || r.odd != 2))
            continue;
        float cost = collapse_cost(s, from, r.at[i], best);
        if (check && cost < best)
            cost = fmaxf(cost, depth_cost(s, from, r.at[i]));
        if (cost < best && (!check || is_valid(s, from, r.at[i]))) {
            best = cost;
            target = r.at[i];
        }
    }
    s->target[from] = target;
    s->rim[from] = r.odd > 0;
    s->sure[from] = check;
    if (target == HG_LOD_NONE)
        heap_remove(s, from);
    else
        heap_set(s, from, best);
}

// ---- the collapse -------------------------------------------------------------------------------

static void merge_looks(struct simplifier *s, uint32_t from, uint32_t to)
{
    const uint32_t n = s->patch.attribute_count;
    hg_lod_quadric_add(&s->looks[to], &s->looks[from]);
    for (uint32_t k = 0; k < n; k++) {
        const struct hg_lod_gradient *g = &s->gradients[(size_t)from * n + k];
        struct hg_lod_gradient *h = &s->gradients[(size_t)to * n + k];
        h->x += g->x;
        h->y += g->y;
        h->z += g->z;
        h->d += g->d;
    }
}

// Moves the triangles of `from` to `to`; those at the edge go. Vertices of `from` remember their
// partner in vertex_global's place of `become`.
static void move_triangles(struct simplifier *s, uint32_t from, uint32_t to)
{
    struct hg_lod_patch *p = &s->patch;
    uint32_t old[RING_MAX], become[RING_MAX], n = 0;
    for (uint32_t v = p->vertex_first[from]; v != HG_LOD_NONE && n < RING_MAX;
         v = p->vertex_next[v]) {
        old[n] = v;
        become[n] = partner(p, v, to);
        merge_looks(s, v, become[n++]);
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
static void update(struct simplifier *s, uint32_t position, uint32_t from, uint32_t to)
{
    if (s->patch.fixed[position])
        return;
    if (position == to || s->target[position] == from || s->target[position] == HG_LOD_NONE ||
        s->rim[position] || s->permissive) {
        evaluate(s, position, false);
        return;
    }
    const float cost = collapse_cost(s, position, to, s->cost[position]);
    if (cost >= s->cost[position])
        return;
    s->target[position] = to;
    s->sure[position] = false;
    heap_set(s, position, cost);
}

static void collapse(struct simplifier *s, uint32_t from, uint32_t to)
{
    struct hg_lod_patch *p = &s->patch;
    struct ring r;
    gather(s, from, &r);
    heap_remove(s, from);
    move_triangles(s, from, to);
    hg_lod_quadric_add(&s->shape[to], &s->shape[from]);
    s->root[to] = sqrt(s->shape[to].weight + LEAST_AREA);
    p->into[from] = to;
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
    for (uint32_t i = 0; i < p->position_count; i++)
        evaluate(s, i, false);
    while (p->live > target && s->heap_count > 0) {
        const uint32_t from = s->heap[0];
        const uint32_t to = s->target[from];
        const bool deep = !s->sure[from] && depth_cost(s, from, to) > s->cost[from] * DEEP;
        if (!deep && is_valid(s, from, to))
            collapse(s, from, to);
        else
            evaluate(s, from, true);
    }
}

static enum hg_status prepare(struct simplifier *s)
{
    const struct hg_lod_patch *p = &s->patch;
    const size_t n = p->position_count, v = p->vertex_count;
    const size_t bytes = n * (sizeof *s->shape + sizeof *s->root + 23) + v * sizeof *s->looks +
                         v * p->attribute_count * sizeof *s->gradients;
    uint8_t *at = hg_calloc(1, bytes + 64);
    s->memory = at;
    if (at == NULL)
        return HG_E_NOMEM;
    s->shape = (struct hg_lod_quadric *)(void *)at;
    s->looks = (struct hg_lod_quadric *)(void *)(at += n * sizeof *s->shape);
    s->gradients = (struct hg_lod_gradient *)(void *)(at += v * sizeof *s->looks);
    s->root = (double *)(void *)(at += v * p->attribute_count * sizeof *s->gradients);
    s->cost = (float *)(void *)(at += n * sizeof *s->root);
    s->target = (uint32_t *)(void *)(at += n * 4);
    s->heap = (uint32_t *)(void *)(at += n * 4);
    s->place = (uint32_t *)(void *)(at += n * 4);
    s->stamp = (uint32_t *)(void *)(at += n * 4);
    s->slot = at += n * 4;
    s->rim = at + n;
    s->sure = at + n * 2;
    memset(s->place, 0xff, n * 4);
    for (uint32_t t = 0; t < p->triangle_count; t++)
        add_triangle(s, t);
    for (uint32_t i = 0; i < n; i++) {
        if (vertices_at(p, i) >= RING_MAX)
            s->patch.fixed[i] = 1;
        if (!p->fixed[i])
            add_edges(s, i);
        s->root[i] = sqrt(s->shape[i].weight + LEAST_AREA);
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
    s->permissive = permissive;
    run(s, job->target_count);
    if (!permissive && s->patch.live > job->target_count + job->triangle_count / 8) {
        s->permissive = true;
        run(s, job->target_count);
    }
    job->error = hg_lod_measure(&s->patch);
    return HG_OK;
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
    const enum hg_status status = attempt(&other, &loose, true);
    const bool better = status == HG_OK && loose.error < job->error;
    if (better) {
        memcpy(job->samples, samples, job->sample_count * sizeof *samples);
        job->error = loose.error;
        other.patch.job = job;
        close(s);
        *s = other;
    } else {
        close(&other);
    }
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
