// measure.c - how far the source surface is from a simplified group, at sampled points.
//
// Each sample walks from the position it was last nearest to over the triangles around it, as long
// as that brings it nearer. The distance found is never too small for the triangles of the group,
// so the error that is stated errs on the side of more detail.
// Source: Ericson 2004, "Real-Time Collision Detection", 5.1.5 (closest point on a triangle).
#include <math.h>
#include <string.h>

#include "base/alloc.h"
#include "renderer/lod/internal.h"
#include "renderer/lod/quadric.h"

#define LOOK_AGAIN 0.04f // squared distance in edge lengths
#define WALK_MAX   6
#define AHEAD      8u    // samples from one that is asked for to when it is looked at
#define INSIDE     0.02f // weight of the position that a walk looks around: nearest is in between

struct nearest {
    float distance2;
    uint32_t triangle;
    float weight[3]; // barycentric
};

typedef int32_t mask __attribute__((vector_size(16)));

// Four triangles abc around a position; the last ones of a ring are its last one again.
struct block {
    hg_lod_vec a[3], ab[3], ac[3];
    hg_lod_vec bb, bc, cc; // ab.ab, ab.ac, ac.ac
    mask triangle;
};

struct rings {
    uint32_t *first; // [position_count + 1] block of each position's ring
    struct block *blocks;
    void *memory;
};

static float dot(const float a[3], const float b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static void sub(const float a[3], const float b[3], float out[3])
{
    for (int k = 0; k < 3; k++)
        out[k] = a[k] - b[k];
}

// ---- the point of a triangle that is nearest ----------------------------------------------------

static inline hg_lod_vec choose(mask m, hg_lod_vec yes, hg_lod_vec no)
{
    return (hg_lod_vec)((m & (mask)yes) | (~m & (mask)no));
}

static inline hg_lod_vec splat(float v)
{
    return (hg_lod_vec){v, v, v, v};
}

static inline hg_lod_vec dot4(const hg_lod_vec a[3], const hg_lod_vec b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

// Barycentric weights of b and c of the points of four triangles that are nearest to a + ap;
// d1, d2: ap times ab and ac. All cases are computed; those that come later win.
static inline void closest(
    const struct block *s, hg_lod_vec d1, hg_lod_vec d2, hg_lod_vec *wb, hg_lod_vec *wc)
{
    const hg_lod_vec none = splat(0.0f), one = splat(1.0f);
    const hg_lod_vec d3 = d1 - s->bb, d4 = d2 - s->bc; // of b
    const hg_lod_vec d5 = d1 - s->bc, d6 = d2 - s->cc; // of c
    const hg_lod_vec va = d3 * d6 - d5 * d4, vb = d5 * d2 - d1 * d6, vc = d1 * d4 - d3 * d2;
    const hg_lod_vec to_c = d4 - d3, to_b = d5 - d6;
    const mask edge_bc = (va <= none) & (to_c >= none) & (to_b >= none);
    const mask edge_ac = (vb <= none) & (d2 >= none) & (d6 <= none);
    const mask corner_c = (d6 >= none) & (d5 <= d6);
    const mask edge_ab = (vc <= none) & (d1 >= none) & (d3 <= none);
    const mask corner_b = (d3 >= none) & (d4 <= d3);
    const mask corner_a = (d1 <= none) & (d2 <= none);
    hg_lod_vec b = choose(edge_bc, to_b, vb), c = choose(edge_bc, to_c, vc);
    hg_lod_vec all = choose(edge_bc, to_b + to_c, va + vb + vc);
    b = choose(edge_ac, none, b);
    c = choose(edge_ac, d2, c);
    all = choose(edge_ac, s->cc, all);
    b = choose(corner_c, none, b);
    c = choose(corner_c, one, c);
    all = choose(corner_c, one, all);
    b = choose(edge_ab, d1, b);
    c = choose(edge_ab, none, c);
    all = choose(edge_ab, s->bb, all);
    b = choose(corner_b, one, b);
    c = choose(corner_b | corner_a, none, c);
    all = choose(corner_b | corner_a, one, all);
    b = choose(corner_a, none, b);
    const mask some = all > none;
    const hg_lod_vec inverse = one / choose(some, all, one);
    *wb = choose(some, b * inverse, none);
    *wc = choose(some, c * inverse, none);
}

static inline hg_lod_vec distances2(
    const struct block *s, const hg_lod_vec at[3], hg_lod_vec *wb, hg_lod_vec *wc)
{
    const hg_lod_vec ap[3] = {at[0] - s->a[0], at[1] - s->a[1], at[2] - s->a[2]};
    closest(s, dot4(ap, s->ab), dot4(ap, s->ac), wb, wc);
    hg_lod_vec gap[3];
    for (int k = 0; k < 3; k++)
        gap[k] = ap[k] - s->ab[k] * *wb - s->ac[k] * *wc;
    return dot4(gap, gap);
}

static inline void set_lane(
    struct block *s, int lane, const float a[3], const float b[3], const float c[3])
{
    for (int k = 0; k < 3; k++) {
        s->a[k][lane] = a[k];
        s->ab[k][lane] = b[k] - a[k];
        s->ac[k][lane] = c[k] - a[k];
    }
}

static inline void set_products(struct block *s)
{
    s->bb = dot4(s->ab, s->ab);
    s->bc = dot4(s->ab, s->ac);
    s->cc = dot4(s->ac, s->ac);
}

static struct nearest nearest_of(const float at[3], const float *const corners[3])
{
    struct block s = {0};
    hg_lod_vec wb, wc;
    set_lane(&s, 0, corners[0], corners[1], corners[2]);
    set_products(&s);
    const hg_lod_vec p[3] = {splat(at[0]), splat(at[1]), splat(at[2])};
    const hg_lod_vec d2 = distances2(&s, p, &wb, &wc);
    return (struct nearest){d2[0], 0, {1.0f - wb[0] - wc[0], wb[0], wc[0]}};
}

float hg_lod_distance2(const float at[3], const float a[3], const float b[3], const float c[3])
{
    return nearest_of(at, (const float *const[3]){a, b, c}).distance2;
}

float hg_lod_closest(
    const float at[3], const float a[3], const float b[3], const float c[3], float weights[3])
{
    const struct nearest n = nearest_of(at, (const float *const[3]){a, b, c});
    memcpy(weights, n.weight, sizeof n.weight);
    return n.distance2;
}

// ---- rings --------------------------------------------------------------------------------------

static void fill_rings(const struct hg_lod_patch *p, const struct rings *r, uint32_t *used)
{
    for (uint32_t t = 0; t < p->triangle_count; t++) {
        if (p->triangles[t][0] == HG_LOD_NONE)
            continue;
        const uint32_t *at = p->places[t];
        for (int k = 0; k < 3; k++) {
            const uint32_t n = used[at[k]]++;
            struct block *s = &r->blocks[r->first[at[k]] + n / 4];
            set_lane(s, (int)(n % 4), p->point[at[0]], p->point[at[1]], p->point[at[2]]);
            s->triangle[n % 4] = (int32_t)t;
        }
    }
    for (uint32_t i = 0; i < p->position_count; i++) {
        for (uint32_t b = r->first[i]; b < r->first[i + 1]; b++) {
            struct block *s = &r->blocks[b];
            const uint32_t n = used[i] - (b - r->first[i]) * 4;
            for (int lane = (int)n; lane < 4; lane++) {
                for (int k = 0; k < 3; k++) {
                    s->a[k][lane] = s->a[k][n - 1];
                    s->ab[k][lane] = s->ab[k][n - 1];
                    s->ac[k][lane] = s->ac[k][n - 1];
                }
                s->triangle[lane] = s->triangle[n - 1];
            }
            set_products(s);
        }
    }
}

// The live triangles around every position.
static enum hg_status make_rings(const struct hg_lod_patch *p, struct rings *r)
{
    uint32_t *counts = hg_calloc((size_t)p->position_count * 2 + 1, sizeof *counts), n = 0;
    *r = (struct rings){.memory = counts};
    if (counts == NULL)
        return HG_E_NOMEM;
    r->first = counts + p->position_count;
    for (uint32_t t = 0; t < p->triangle_count; t++)
        for (int k = 0; p->triangles[t][0] != HG_LOD_NONE && k < 3; k++)
            counts[p->places[t][k]]++;
    for (uint32_t i = 0; i < p->position_count; i++) {
        r->first[i] = n;
        n += (counts[i] + 3) / 4;
        counts[i] = 0;
    }
    r->first[p->position_count] = n;
    r->blocks = hg_realloc(NULL, n, sizeof *r->blocks);
    if (r->blocks == NULL && n > 0)
        return HG_E_NOMEM;
    fill_rings(p, r, counts);
    return HG_OK;
}

static void drop_rings(struct rings *r)
{
    hg_free(r->blocks);
    hg_free(r->memory);
}

// The nearest point of the triangles around a position, if it is nearer than *best.
static inline void visit_ring(
    const struct rings *r, uint32_t position, const hg_lod_vec at[3], struct nearest *best)
{
    hg_lod_vec least = splat(best->distance2), b = {0}, c = {0};
    mask triangle = {-1, -1, -1, -1};
    for (uint32_t i = r->first[position]; i < r->first[position + 1]; i++) {
        hg_lod_vec wb, wc;
        const hg_lod_vec d2 = distances2(&r->blocks[i], at, &wb, &wc);
        const mask nearer = d2 < least;
        least = choose(nearer, d2, least);
        b = choose(nearer, wb, b);
        c = choose(nearer, wc, c);
        triangle = (nearer & r->blocks[i].triangle) | (~nearer & triangle);
    }
    int lane = 0;
    for (int k = 1; k < 4; k++)
        lane = least[k] < least[lane] ? k : lane;
    if (least[lane] < best->distance2)
        *best = (struct nearest){
            least[lane], (uint32_t)triangle[lane], {1.0f - b[lane] - c[lane], b[lane], c[lane]}};
}

// Whether all of a triangle lies beyond one side of the cube of half size `reach` around `at`.
static bool is_beyond(
    const struct hg_lod_patch *p, uint32_t triangle, const float at[3], float reach)
{
    const uint32_t *t = p->places[triangle];
    const float *a = p->point[t[0]], *b = p->point[t[1]], *c = p->point[t[2]];
    for (int k = 0; k < 3; k++) {
        const float low = at[k] - reach, high = at[k] + reach;
        if ((a[k] > high && b[k] > high && c[k] > high) || (a[k] < low && b[k] < low && c[k] < low))
            return true;
    }
    return false;
}

// Looks at all triangles.
static void search(
    const struct hg_lod_patch *p, const float at[3], struct nearest *best, uint32_t *anchor)
{
    const float before = best->distance2;
    for (uint32_t t = 0; t < p->triangle_count; t++) {
        if (p->triangles[t][0] == HG_LOD_NONE || is_beyond(p, t, at, sqrtf(best->distance2)))
            continue;
        const uint32_t *places = p->places[t];
        struct nearest n = nearest_of(at,
            (const float *const[3]){p->point[places[0]], p->point[places[1]], p->point[places[2]]});
        n.triangle = t;
        *best = n.distance2 < best->distance2 ? n : *best;
    }
    if (best->distance2 < before)
        *anchor = p->places[best->triangle][0];
}

// The walk. *anchor is the position to begin at and becomes the nearest corner.
static struct nearest walk(
    const struct hg_lod_patch *p, const struct rings *r, const float at[3], uint32_t *anchor)
{
    const hg_lod_vec point[3] = {splat(at[0]), splat(at[1]), splat(at[2])};
    struct nearest best = {INFINITY, HG_LOD_NONE, {0}};
    for (int step = 0; step < WALK_MAX; step++) {
        const float before = best.distance2;
        visit_ring(r, *anchor, point, &best);
        if (best.triangle == HG_LOD_NONE || !(best.distance2 < before))
            break;
        const uint32_t *places = p->places[best.triangle];
        int corner = 0;
        bool between = false; // what meets there has been looked at
        for (int k = 0; k < 3; k++) {
            corner = best.weight[k] > best.weight[corner] ? k : corner;
            between = between || (places[k] == *anchor && best.weight[k] > INSIDE);
        }
        *anchor = places[corner];
        if (between)
            break;
    }
    if (best.triangle == HG_LOD_NONE) // what it lay on has gone altogether
        search(p, at, &best, anchor);
    return best;
}

// ---- open edges ---------------------------------------------------------------------------------

static bool may_be_open(const struct hg_lod_patch *p, uint32_t a, uint32_t b)
{
    const uint8_t *open = p->job->open;
    if (open == NULL)
        return true;
    // The border of the group looks open from inside; its ends are locked and seldom both open.
    return !p->fixed[a] || !p->fixed[b] || (open[p->global[a]] && open[p->global[b]]);
}

static uint32_t edge_uses(const struct hg_lod_patch *p, uint32_t a, uint32_t b)
{
    uint32_t n = 0;
    for (uint32_t c = p->head[a]; c != HG_LOD_NONE; c = p->next[c]) {
        const uint32_t *t = p->triangles[c / 4];
        if (t[0] == HG_LOD_NONE)
            continue;
        for (int k = 0; k < 3; k++)
            n += p->places[c / 4][k] == b;
    }
    return n;
}

static float segment_distance2(const float at[3], const float a[3], const float b[3])
{
    float ab[3], ap[3];
    sub(b, a, ab);
    sub(at, a, ap);
    const float length2 = dot(ab, ab);
    float t = length2 > 0.0f ? dot(ap, ab) / length2 : 0.0f;
    t = t < 0.0f ? 0.0f : t > 1.0f ? 1.0f : t;
    for (int k = 0; k < 3; k++)
        ap[k] -= t * ab[k];
    return dot(ap, ap);
}

// Squared distance to the open edges at a position and its neighbours; INFINITY: there are none.
static float open_distance2(const struct hg_lod_patch *p, uint32_t anchor, const float at[3])
{
    float best = INFINITY;
    for (uint32_t c = p->head[anchor]; c != HG_LOD_NONE; c = p->next[c]) {
        const uint32_t *t = p->triangles[c / 4];
        for (int k = 0; t[0] != HG_LOD_NONE && k < 3; k++) {
            const uint32_t a = p->places[c / 4][k], b = p->places[c / 4][(k + 1) % 3];
            const float d = segment_distance2(at, p->point[a], p->point[b]);
            if (d < best && may_be_open(p, a, b) && edge_uses(p, a, b) == 1)
                best = d;
        }
    }
    return best;
}

// ---- attributes ---------------------------------------------------------------------------------

static float looks_distance2(
    const struct hg_lod_patch *p, const struct hg_lod_sample *sample, const struct nearest *at)
{
    const struct hg_lod_mesh *m = p->job->mesh;
    const uint32_t n = p->attribute_count;
    float values[HG_LOD_ATTRIBUTES], sum = 0.0f;
    (void)hg_lod_attributes(
        &m->format, m->words + (size_t)sample->vertex * m->format.words, values);
    const uint32_t *t = p->triangles[at->triangle];
    for (uint32_t k = 0; k < n; k++) {
        float v = 0.0f;
        for (int i = 0; i < 3; i++)
            v += at->weight[i] * p->attributes[(size_t)t[i] * n + k];
        v -= values[k] * p->weight[k];
        sum += v * v;
    }
    return sum;
}

static uint32_t survivor(const struct hg_lod_patch *p, uint32_t position)
{
    while (p->into[position] != position)
        position = p->into[position];
    return position;
}

// A sample whose own position is still there lies on the surface.
static bool still_there(const struct hg_lod_patch *p, const struct rings *r,
    const struct hg_lod_sample *s, uint32_t anchor, struct nearest *near)
{
    if (r->first[anchor] == r->first[anchor + 1] ||
        p->job->mesh->position_of[s->vertex] != p->global[anchor])
        return false;
    *near = (struct nearest){.triangle = (uint32_t)r->blocks[r->first[anchor]].triangle[0]};
    return true;
}

static struct nearest look(const struct hg_lod_patch *p, const struct rings *r,
    const struct hg_lod_sample *s, float worst, uint32_t *anchor)
{
    const struct hg_lod_mesh *m = p->job->mesh;
    const int32_t *lattice = m->lattice[m->position_of[s->vertex]];
    float at[3];
    for (int k = 0; k < 3; k++)
        at[k] = (float)(lattice[k] - p->frame.origin[k]) * p->frame.scale;
    struct nearest near = walk(p, r, at, anchor);
    // The farthest sample decides the error: was there nothing nearer than the walk found?
    if (near.distance2 > LOOK_AGAIN && sqrtf(near.distance2) * p->frame.unit > worst)
        search(p, at, &near, anchor);
    const float open = s->flags & HG_LOD_SAMPLE_OPEN ? open_distance2(p, *anchor, at) : INFINITY;
    near.distance2 = open < INFINITY ? open : near.distance2;
    return near;
}

// Brings one sample up to date (worst: the largest distance yet); what it says about attributes
// goes to *looks.
static void measure(const struct hg_lod_patch *p, const struct rings *r, struct hg_lod_sample *s,
    float worst, float *looks, uint32_t *compared)
{
    const struct hg_lod_mesh *m = p->job->mesh;
    uint32_t anchor = hg_lod_patch_find(p, s->anchor);
    s->triangle = HG_LOD_NONE;
    if (anchor == HG_LOD_NONE)
        return;
    anchor = survivor(p, anchor);
    struct nearest near;
    if (!still_there(p, r, s, anchor, &near))
        near = look(p, r, s, worst, &anchor);
    const float distance = sqrtf(near.distance2) * p->frame.unit;
    const float piece =
        near.distance2 > 0.0f ? hg_lod_piece_size(m, m->position_of[s->vertex]) : INFINITY;
    // What is near to a piece that has gone altogether says nothing about its looks.
    if (near.triangle != HG_LOD_NONE && p->attribute_count > 0 && distance <= piece &&
        !(s->flags & HG_LOD_SAMPLE_SEAM)) {
        *looks += near.distance2 > 0.0f ? looks_distance2(p, s, &near) : 0.0f;
        ++*compared;
    }
    s->triangle = near.triangle;
    s->anchor = p->global[anchor] & 0x3fffffffu;
    s->distance = distance < piece ? distance : piece;
}

// Vertices of samples lie anywhere in the mesh.
HG_LOD_INLINE void expect(const struct hg_lod_patch *p, uint32_t first)
{
    const struct hg_lod_mesh *m = p->job->mesh;
    const uint32_t count = p->job->sample_count;
    if (first + 2 * AHEAD < count)
        hg_lod_expect(&m->position_of[p->job->samples[first + 2 * AHEAD].vertex]);
    if (first + AHEAD >= count)
        return;
    const uint32_t v = p->job->samples[first + AHEAD].vertex, at = m->position_of[v];
    hg_lod_expect(&m->lattice[at]);
    if (m->pieces != NULL)
        hg_lod_expect(&m->piece_of[at]);
    hg_lod_expect(m->words + (size_t)v * m->format.words);
}

enum hg_status hg_lod_measure(const struct hg_lod_patch *p, float *error)
{
    float worst = 0.0f, looks = 0.0f;
    uint32_t compared = 0;
    struct rings rings;
    const enum hg_status status = make_rings(p, &rings);
    for (uint32_t i = 0; status == HG_OK && i < p->job->sample_count; i++) {
        struct hg_lod_sample *s = &p->job->samples[i];
        expect(p, i);
        measure(p, &rings, s, worst, &looks, &compared);
        worst = s->distance > worst ? s->distance : worst;
    }
    drop_rings(&rings);
    const float mean = compared > 0 ? sqrtf(looks / (float)compared) * p->frame.unit : 0.0f;
    *error = worst > mean ? worst : mean;
    return status;
}
