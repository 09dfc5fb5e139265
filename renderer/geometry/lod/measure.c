// measure.c - how far the source surface is from a simplified group, at sampled points.
//
// Each sample walks from the position it was last nearest to over the triangles around it, as long
// as that brings it nearer. The distance found is never too small for the triangles of the group,
// so the error that is stated errs on the side of more detail.
// Source: Ericson 2004, "Real-Time Collision Detection", 5.1.5 (closest point on a triangle).
#include <math.h>
#include <string.h>

#include "renderer/geometry/lod/internal.h"
#include "renderer/geometry/lod/quadric.h"

#define LOOK_AGAIN 0.04f // squared distance in edge lengths
#define WALK_MAX   6
#define INSIDE     0.02f // weight of the position that a walk looks around: nearest is in between

struct nearest {
    float distance2;
    uint32_t triangle;
    float weight[3]; // barycentric
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

static void set_shape(struct hg_lod_shape *s, const float a[3], const float b[3], const float c[3])
{
    *s = (struct hg_lod_shape){.a = {a[0], a[1], a[2], 0.0f}};
    sub(b, a, s->ab);
    sub(c, a, s->ac);
    s->bb = dot(s->ab, s->ab);
    s->bc = dot(s->ab, s->ac);
    s->cc = dot(s->ac, s->ac);
}

// Barycentric weights of b and c of the point of a triangle that is nearest to a + ap;
// d1, d2: ap times ab and ac.
static inline void closest(const struct hg_lod_shape *s, float d1, float d2, float *wb, float *wc)
{
    const float d3 = d1 - s->bb, d4 = d2 - s->bc; // of b
    const float d5 = d1 - s->bc, d6 = d2 - s->cc; // of c
    *wb = *wc = 0.0f;
    if (d1 <= 0.0f && d2 <= 0.0f)
        return;
    if (d3 >= 0.0f && d4 <= d3) {
        *wb = 1.0f;
        return;
    }
    const float vc = d1 * d4 - d3 * d2;
    if (vc <= 0.0f && d1 >= 0.0f && d3 <= 0.0f) {
        *wb = d1 / (d1 - d3);
        return;
    }
    if (d6 >= 0.0f && d5 <= d6) {
        *wc = 1.0f;
        return;
    }
    const float vb = d5 * d2 - d1 * d6;
    if (vb <= 0.0f && d2 >= 0.0f && d6 <= 0.0f) {
        *wc = d2 / (d2 - d6);
        return;
    }
    const float va = d3 * d6 - d5 * d4;
    if (va <= 0.0f && d4 - d3 >= 0.0f && d5 - d6 >= 0.0f) {
        const float sum = (d4 - d3) + (d5 - d6);
        *wc = sum > 0.0f ? (d4 - d3) / sum : 0.0f;
        *wb = 1.0f - *wc;
        return;
    }
    const float sum = va + vb + vc, inverse = sum > 0.0f ? 1.0f / sum : 0.0f;
    *wb = vb * inverse;
    *wc = vc * inverse;
}

static inline float shape_distance2(
    const struct hg_lod_shape *s, const float at[4], float *wb, float *wc)
{
    const hg_lod_vec ap = hg_lod_vec_load(at) - hg_lod_vec_load(s->a);
    const hg_lod_vec ab = hg_lod_vec_load(s->ab), ac = hg_lod_vec_load(s->ac);
    closest(s, hg_lod_vec_sum(ap * ab), hg_lod_vec_sum(ap * ac), wb, wc);
    const hg_lod_vec gap = ap - ab * *wb - ac * *wc;
    return hg_lod_vec_sum(gap * gap);
}

float hg_lod_distance2(const float at[4], const float a[3], const float b[3], const float c[3])
{
    struct hg_lod_shape s;
    float wb, wc;
    set_shape(&s, a, b, c);
    return shape_distance2(&s, at, &wb, &wc);
}

static inline void visit(
    const struct hg_lod_patch *p, uint32_t triangle, const float at[4], struct nearest *best)
{
    float wb, wc;
    const float distance2 = shape_distance2(&p->shapes[triangle], at, &wb, &wc);
    if (distance2 < best->distance2)
        *best = (struct nearest){distance2, triangle, {1.0f - wb - wc, wb, wc}};
}

static void visit_around(
    const struct hg_lod_patch *p, uint32_t position, const float at[4], struct nearest *best)
{
    for (uint32_t c = p->head[position]; c != HG_LOD_NONE; c = p->next[c])
        if (p->triangles[c / 4][0] != HG_LOD_NONE)
            visit(p, c / 4, at, best);
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
    const struct hg_lod_patch *p, const float at[4], struct nearest *best, uint32_t *anchor)
{
    const float before = best->distance2;
    for (uint32_t t = 0; t < p->triangle_count; t++)
        if (p->triangles[t][0] != HG_LOD_NONE && !is_beyond(p, t, at, sqrtf(best->distance2)))
            visit(p, t, at, best);
    if (best->distance2 < before)
        *anchor = p->places[best->triangle][0];
}

// The walk. *anchor is the position to begin at and becomes the nearest corner.
static struct nearest walk(const struct hg_lod_patch *p, const float at[4], uint32_t *anchor)
{
    struct nearest best = {INFINITY, HG_LOD_NONE, {0}};
    for (int step = 0; step < WALK_MAX; step++) {
        const float before = best.distance2;
        visit_around(p, *anchor, at, &best);
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

float hg_lod_closest(
    const float at[4], const float a[3], const float b[3], const float c[3], float weights[3])
{
    struct hg_lod_shape s;
    set_shape(&s, a, b, c);
    const float distance2 = shape_distance2(&s, at, &weights[1], &weights[2]);
    weights[0] = 1.0f - weights[1] - weights[2];
    return distance2;
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
static bool still_there(const struct hg_lod_patch *p, const struct hg_lod_sample *s,
    uint32_t anchor, struct nearest *near)
{
    if (p->job->mesh->position_of[s->vertex] != p->global[anchor])
        return false;
    for (uint32_t c = p->head[anchor]; c != HG_LOD_NONE; c = p->next[c]) {
        if (p->triangles[c / 4][0] == HG_LOD_NONE)
            continue;
        *near = (struct nearest){.distance2 = 0.0f, .triangle = c / 4};
        near->weight[c % 4] = 1.0f;
        return true;
    }
    return false;
}

// Brings one sample up to date (worst: the largest distance yet); what it says about attributes
// goes to *looks.
static void measure(const struct hg_lod_patch *p, struct hg_lod_sample *s, float worst,
    float *looks, uint32_t *compared)
{
    const struct hg_lod_mesh *m = p->job->mesh;
    uint32_t anchor = hg_lod_patch_find(p, s->anchor);
    s->triangle = HG_LOD_NONE;
    if (anchor == HG_LOD_NONE)
        return;
    anchor = survivor(p, anchor);
    struct nearest near;
    if (!still_there(p, s, anchor, &near)) {
        const int32_t *lattice = m->lattice[m->position_of[s->vertex]];
        float at[4] = {0};
        for (int k = 0; k < 3; k++)
            at[k] = (float)(lattice[k] - p->origin[k]) * p->scale;
        near = walk(p, at, &anchor);
        // The farthest sample decides the error: was there nothing nearer than the walk found?
        if (near.distance2 > LOOK_AGAIN && sqrtf(near.distance2) * p->unit > worst)
            search(p, at, &near, &anchor);
        const float open = s->flags & HG_LOD_SAMPLE_OPEN ? open_distance2(p, anchor, at) : INFINITY;
        near.distance2 = open < INFINITY ? open : near.distance2;
    }
    const float distance = sqrtf(near.distance2) * p->unit;
    const float piece = hg_lod_piece_size(m, m->position_of[s->vertex]);
    // What is near to a piece that has gone altogether says nothing about its looks.
    if (near.triangle != HG_LOD_NONE && p->attribute_count > 0 && distance <= piece &&
        !(s->flags & HG_LOD_SAMPLE_SEAM)) {
        *looks += near.distance2 > 0.0f ? looks_distance2(p, s, &near) : 0.0f;
        ++*compared;
    }
    s->triangle = near.triangle;
    s->anchor = p->global[anchor] & 0x3fffffffu;
    s->distance = fminf(distance, piece);
}

float hg_lod_measure(const struct hg_lod_patch *p)
{
    float worst = 0.0f, looks = 0.0f;
    uint32_t compared = 0;
    for (uint32_t t = 0; t < p->triangle_count; t++)
        if (p->triangles[t][0] != HG_LOD_NONE)
            set_shape(&p->shapes[t], p->point[p->places[t][0]], p->point[p->places[t][1]],
                p->point[p->places[t][2]]);
    for (uint32_t i = 0; i < p->job->sample_count; i++) {
        struct hg_lod_sample *s = &p->job->samples[i];
        measure(p, s, worst, &looks, &compared);
        worst = fmaxf(worst, s->distance);
    }
    const float mean = compared > 0 ? sqrtf(looks / (float)compared) * p->unit : 0.0f;
    return fmaxf(worst, mean);
}
