// xform.h - small matrix, vector and quaternion maths of the scene room.
// Floor 2. Pure functions. Matrices are column-major float[16]; quaternions are x y z w.
#ifndef HG_RENDERER_SCENE_XFORM_H
#define HG_RENDERER_SCENE_XFORM_H

#include <math.h>
#include <stdbool.h>
#include <string.h>

static inline float hg_dot3(const float a[3], const float b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static inline void hg_cross3(const float a[3], const float b[3], float out[3])
{
    float x = a[1] * b[2] - a[2] * b[1];
    float y = a[2] * b[0] - a[0] * b[2];
    float z = a[0] * b[1] - a[1] * b[0];
    out[0] = x;
    out[1] = y;
    out[2] = z;
}

// Scales v to length 1; false (v untouched) when it has no usable length.
static inline bool hg_normalize3(float v[3])
{
    float length = sqrtf(hg_dot3(v, v));
    if (!(length > 1e-30f) || !isfinite(length))
        return false;
    for (int i = 0; i < 3; i++)
        v[i] /= length;
    return true;
}

static inline void hg_mat4_identity(float m[16])
{
    memset(m, 0, 16 * sizeof *m);
    m[0] = m[5] = m[10] = m[15] = 1.0f;
}

// out = a b; out may be a or b.
static inline void hg_mat4_mul(const float a[16], const float b[16], float out[16])
{
    float r[16];
    for (int c = 0; c < 4; c++)
        for (int i = 0; i < 4; i++)
            r[c * 4 + i] = a[i] * b[c * 4] + a[4 + i] * b[c * 4 + 1] + a[8 + i] * b[c * 4 + 2] +
                           a[12 + i] * b[c * 4 + 3];
    memcpy(out, r, sizeof r);
}

static inline void hg_mat4_from_trs(
    const float t[3], const float q[4], const float s[3], float m[16])
{
    float x = q[0], y = q[1], z = q[2], w = q[3];
    m[0] = (1 - 2 * (y * y + z * z)) * s[0];
    m[1] = 2 * (x * y + z * w) * s[0];
    m[2] = 2 * (x * z - y * w) * s[0];
    m[4] = 2 * (x * y - z * w) * s[1];
    m[5] = (1 - 2 * (x * x + z * z)) * s[1];
    m[6] = 2 * (y * z + x * w) * s[1];
    m[8] = 2 * (x * z + y * w) * s[2];
    m[9] = 2 * (y * z - x * w) * s[2];
    m[10] = (1 - 2 * (x * x + y * y)) * s[2];
    m[3] = m[7] = m[11] = 0;
    m[12] = t[0];
    m[13] = t[1];
    m[14] = t[2];
    m[15] = 1;
}

static inline void hg_mat4_point(const float m[16], const float p[3], float out[3])
{
    float x = p[0], y = p[1], z = p[2];
    for (int i = 0; i < 3; i++)
        out[i] = m[i] * x + m[4 + i] * y + m[8 + i] * z + m[12 + i];
}

static inline void hg_quat_normalize(float q[4])
{
    float n = sqrtf(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
    if (!(n > 1e-20f) || !isfinite(n)) {
        q[0] = q[1] = q[2] = 0;
        q[3] = 1;
        return;
    }
    for (int i = 0; i < 4; i++)
        q[i] /= n;
}

// Shortest-arc spherical interpolation of unit quaternions (Shoemake 1985); falls back to
// normalised linear interpolation where the arc is so short that sin loses its digits.
static inline void hg_quat_slerp(const float a[4], const float b[4], float t, float out[4])
{
    float d = a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3];
    float sign = d < 0 ? -1.0f : 1.0f;
    d *= sign;
    float wa = 1 - t, wb = t;
    if (d < 0.9995f) {
        float angle = acosf(d), s = sinf(angle);
        wa = sinf((1 - t) * angle) / s;
        wb = sinf(t * angle) / s;
    }
    for (int i = 0; i < 4; i++)
        out[i] = wa * a[i] + wb * sign * b[i];
    hg_quat_normalize(out);
}

// Grows [min, max] by a point.
static inline void hg_bounds_add(float min[3], float max[3], const float p[3])
{
    for (int i = 0; i < 3; i++) {
        min[i] = p[i] < min[i] ? p[i] : min[i];
        max[i] = p[i] > max[i] ? p[i] : max[i];
    }
}

static inline void hg_bounds_clear(float min[3], float max[3])
{
    for (int i = 0; i < 3; i++) {
        min[i] = INFINITY;
        max[i] = -INFINITY;
    }
}

// Grows [min, max] by a box under an affine transform.
static inline void hg_bounds_add_box(
    float min[3], float max[3], const float m[16], const float box_min[3], const float box_max[3])
{
    for (int corner = 0; corner < 8; corner++) {
        float p[3];
        for (int i = 0; i < 3; i++)
            p[i] = corner >> i & 1 ? box_max[i] : box_min[i];
        hg_mat4_point(m, p, p);
        hg_bounds_add(min, max, p);
    }
}

#endif
