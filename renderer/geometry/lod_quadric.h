// lod_quadric.h - error quadrics of a surface and of its attributes. Floor 2, private to geometry/.
//
// A quadric is the sum over triangles, weighted by area, of squared distances to their planes
// (Garland and Heckbert 1997). For an attribute that is linear on each triangle, a(p) = g.p + d, it
// is the sum of (g.p + d - a)^2 for a vertex at p with value a (Hoppe 1999, section 3).
#ifndef HG_RENDERER_GEOMETRY_LOD_QUADRIC_H
#define HG_RENDERER_GEOMETRY_LOD_QUADRIC_H

#include <math.h>
#include <stdint.h>

struct hg_lod_quadric { // p'Ap + 2 b.p + c
    double a00, a11, a22, a01, a02, a12, b0, b1, b2, c, weight;
};

struct hg_lod_gradient { // of one attribute
    double x, y, z, d;
};

static inline void hg_lod_quadric_add_plane(
    struct hg_lod_quadric *q, const double n[3], double d, double w)
{
    q->a00 += w * n[0] * n[0];
    q->a11 += w * n[1] * n[1];
    q->a22 += w * n[2] * n[2];
    q->a01 += w * n[0] * n[1];
    q->a02 += w * n[0] * n[2];
    q->a12 += w * n[1] * n[2];
    q->b0 += w * n[0] * d;
    q->b1 += w * n[1] * d;
    q->b2 += w * n[2] * d;
    q->c += w * d * d;
}

static inline void hg_lod_quadric_add(struct hg_lod_quadric *q, const struct hg_lod_quadric *r)
{
    double *to = &q->a00;
    const double *from = &r->a00;
    for (int i = 0; i < 11; i++)
        to[i] += from[i];
}

static inline double hg_lod_quadric_at(const struct hg_lod_quadric *q, const float p[3])
{
    const double x = p[0], y = p[1], z = p[2];
    const double rx = q->a00 * x + 2.0 * (q->a01 * y + q->a02 * z + q->b0);
    const double ry = q->a11 * y + 2.0 * (q->a12 * z + q->b1);
    const double rz = q->a22 * z + 2.0 * q->b2;
    return rx * x + ry * y + rz * z + q->c;
}

// Adds the part that the values of `count` attributes give.
static inline double hg_lod_gradients_at(const struct hg_lod_gradient *g, uint32_t count,
    double weight, const float p[3], const float *values)
{
    double sum = 0.0;
    for (uint32_t k = 0; k < count; k++) {
        const double v = values[k];
        const double along = g[k].x * p[0] + g[k].y * p[1] + g[k].z * p[2] + g[k].d;
        sum += v * (weight * v - 2.0 * along);
    }
    return sum;
}

#endif
