// quadric.h - error quadrics of a surface and of its attributes. Floor 2, private to geometry/.
//
// A quadric is the sum over triangles, weighted by area, of squared distances to their planes
// (Garland and Heckbert 1997). For an attribute that is linear on each triangle, a(r) = g.r + d, it
// is the sum of (g.r + d - a)^2 for a vertex at r with value a (Hoppe 1999, section 3).
//
// All is relative to the vertex that has the quadric: r = p - its position, a = value - its
// own value. The planes of its triangles pass through it, so numbers stay small and single
// precision is enough; when a vertex is merged into another, its quadric is moved there.
#ifndef HG_RENDERER_LOD_QUADRIC_H
#define HG_RENDERER_LOD_QUADRIC_H

#include <math.h>
#include <stdint.h>
#include <string.h>

typedef float hg_lod_vec __attribute__((vector_size(16)));

struct hg_lod_quadric { // (r, 1) times this symmetric matrix times (r, 1); rows
    hg_lod_vec x, y, z, w;
};

static inline hg_lod_vec hg_lod_vec_load(const float v[4])
{
    hg_lod_vec out;
    memcpy(&out, v, sizeof out);
    return out;
}

static inline float hg_lod_vec_sum(hg_lod_vec v)
{
    return (v[0] + v[1]) + (v[2] + v[3]);
}

// A plane through the vertex with normal (n, 0) and weight w.
static inline void hg_lod_quadric_add_plane(struct hg_lod_quadric *q, hg_lod_vec n, float w)
{
    const hg_lod_vec wn = n * w;
    q->x += wn * n[0];
    q->y += wn * n[1];
    q->z += wn * n[2];
}

static inline void hg_lod_quadric_add(struct hg_lod_quadric *q, const struct hg_lod_quadric *r)
{
    q->x += r->x;
    q->y += r->y;
    q->z += r->z;
    q->w += r->w;
}

// The same quadric, relative to a vertex that lies by (t, 0) farther.
static inline void hg_lod_quadric_move(struct hg_lod_quadric *q, hg_lod_vec t)
{
    hg_lod_vec w = q->w + (q->x * t[0] + q->y * t[1] + q->z * t[2]);
    w[3] += w[0] * t[0] + w[1] * t[1] + w[2] * t[2];
    q->x[3] = w[0];
    q->y[3] = w[1];
    q->z[3] = w[2];
    q->w = w;
}

// at: (r, 1)
static inline hg_lod_vec hg_lod_quadric_times(const struct hg_lod_quadric *q, hg_lod_vec at)
{
    return q->x * at[0] + q->y * at[1] + (q->z * at[2] + q->w);
}

static inline float hg_lod_quadric_at(const struct hg_lod_quadric *q, hg_lod_vec at)
{
    return hg_lod_vec_sum(hg_lod_quadric_times(q, at) * at);
}

// The same for the attributes of a vertex.
struct hg_lod_looks {
    struct hg_lod_quadric *quadric;
    hg_lod_vec *gradients; // [count] sums of weight times (g, d)
    uint32_t count;        // of attributes
    float weight;          // sum of the weights
};

// Their error at (r, 1) with the values `to` instead of `from`.
static inline float hg_lod_looks_at(
    const struct hg_lod_looks *l, hg_lod_vec at, const float *from, const float *to)
{
    hg_lod_vec row = hg_lod_quadric_times(l->quadric, at);
    float apart2 = 0.0f;
    for (uint32_t k = 0; k < l->count; k++) {
        const float a = to[k] - from[k];
        apart2 += a * a;
        row -= l->gradients[k] * (2.0f * a);
    }
    return hg_lod_vec_sum(row * at) + l->weight * apart2;
}

// Tells quadric and gradients from a vertex that lies by (t, 0) farther and has the values `to`
// instead of `from`.
static inline void hg_lod_looks_move(
    const struct hg_lod_looks *l, hg_lod_vec t, const float *from, const float *to)
{
    struct hg_lod_quadric *q = l->quadric;
    hg_lod_vec sum = {0};
    float apart2 = 0.0f;
    hg_lod_quadric_move(q, t);
    for (uint32_t k = 0; k < l->count; k++) {
        const float a = to[k] - from[k];
        hg_lod_vec g = l->gradients[k];
        g[3] += g[0] * t[0] + g[1] * t[1] + g[2] * t[2];
        sum += g * a;
        apart2 += a * a;
        g[3] -= l->weight * a;
        l->gradients[k] = g;
    }
    q->w -= sum;
    q->x[3] = q->w[0];
    q->y[3] = q->w[1];
    q->z[3] = q->w[2];
    q->w[3] += l->weight * apart2 - sum[3];
}

#endif
