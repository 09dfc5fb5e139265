// vec3d.h - vectors of three doubles: cameras and places in the scene. Those of floats are in
// renderer/math/vec.h. Floor 0. Pure, inline.
#ifndef HG_BASE_VEC3D_H
#define HG_BASE_VEC3D_H

#include <math.h>
#include <stdbool.h>

static inline double hg_dot3d(const double a[3], const double b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

// out is neither a nor b.
static inline void hg_cross3d(const double a[3], const double b[3], double out[3])
{
    out[0] = a[1] * b[2] - a[2] * b[1];
    out[1] = a[2] * b[0] - a[0] * b[2];
    out[2] = a[0] * b[1] - a[1] * b[0];
}

// False: too short or not finite, and v stays as it is.
static inline bool hg_normalize3d(double v[3])
{
    const double length = sqrt(hg_dot3d(v, v));
    if (!(length > 1e-12) || !isfinite(length))
        return false;
    for (int i = 0; i < 3; i++)
        v[i] /= length;
    return true;
}

#endif
