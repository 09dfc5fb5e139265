// vec.h - vectors of three floats, octahedral coordinates, half precision, luminance.
// Floor 1 (math). Pure, inline.
#ifndef HG_RENDERER_MATH_VEC_H
#define HG_RENDERER_MATH_VEC_H

#include <math.h>
#include <stdint.h>
#include <string.h>

#define HG_PI 3.14159265358979323846

// Four floats that the compiler keeps in one register.
typedef float hg_v4 __attribute__((vector_size(16)));

static inline float hg_dot3(const float a[3], const float b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static inline void hg_cross3(const float a[3], const float b[3], float out[3])
{
    float x = a[1] * b[2] - a[2] * b[1], y = a[2] * b[0] - a[0] * b[2];
    out[2] = a[0] * b[1] - a[1] * b[0];
    out[0] = x;
    out[1] = y;
}

static inline void hg_sub3(const float a[3], const float b[3], float out[3])
{
    for (int i = 0; i < 3; i++)
        out[i] = a[i] - b[i];
}

static inline void hg_copy3(const float a[3], float out[3])
{
    for (int i = 0; i < 3; i++)
        out[i] = a[i];
}

// a + b * s
static inline void hg_mad3(const float a[3], const float b[3], float s, float out[3])
{
    for (int i = 0; i < 3; i++)
        out[i] = a[i] + b[i] * s;
}

static inline float hg_length3(const float a[3])
{
    return sqrtf(hg_dot3(a, a));
}

// Leaves vectors of length 0 as they are.
static inline void hg_normalize3(float a[3])
{
    float l = hg_length3(a);
    if (l > 0)
        for (int i = 0; i < 3; i++)
            a[i] /= l;
}

static inline float hg_clampf(float x, float low, float high)
{
    return x < low ? low : x > high ? high : x;
}

// fmaxf where `low` is a number: one instruction.
static inline float hg_maxf(float x, float low)
{
    return x > low ? x : low;
}

// Octahedral coordinates in -1..1, as hg_oct_encode of shaders/lib/octahedral.glsl.
static inline void hg_octahedral2(const float v[3], float out[2])
{
    const float sum = hg_maxf(fabsf(v[0]) + fabsf(v[1]) + fabsf(v[2]), 1e-30f);
    const float x = v[0] / sum, y = v[1] / sum;
    out[0] = v[2] >= 0 ? x : (1 - fabsf(y)) * (x >= 0 ? 1.0f : -1.0f);
    out[1] = v[2] >= 0 ? y : (1 - fabsf(x)) * (y >= 0 ? 1.0f : -1.0f);
}

// Unit vector of octahedral coordinates in -1..1, as hg_oct_decode of shaders/lib/octahedral.glsl.
static inline void hg_octahedral3(float x, float y, float out[3])
{
    const float z = 1 - fabsf(x) - fabsf(y), fold = fmaxf(-z, 0);
    out[0] = x + (x >= 0 ? -fold : fold);
    out[1] = y + (y >= 0 ? -fold : fold);
    out[2] = z;
    hg_normalize3(out);
}

// Orthonormal tangents of a unit vector.
// Source: Duff et al. 2017, "Building an Orthonormal Basis, Revisited", listing 3.
static inline void hg_basis3(const float n[3], float t[3], float b[3])
{
    float s = n[2] >= 0 ? 1.0f : -1.0f, a = -1 / (s + n[2]), c = n[0] * n[1] * a;
    t[0] = 1 + s * n[0] * n[0] * a;
    t[1] = s * c;
    t[2] = -s * n[0];
    b[0] = c;
    b[1] = s + n[1] * n[1] * a;
    b[2] = -n[1];
}

// IEEE half precision, rounded to nearest even; values past the range become its ends, NaN 0.
static inline uint16_t hg_half(float value)
{
    if (!(value == value))
        return 0;
    float v = hg_clampf(value, -65504.0f, 65504.0f);
    uint32_t u, sign;
    memcpy(&u, &v, 4);
    sign = u >> 16 & 0x8000;
    u &= 0x7fffffff;
    if (u < 0x38800000) { // below 2^-14: subnormal, steps of 2^-24
        float a = fabsf(v) * 16777216.0f;
        return (uint16_t)(sign | (uint32_t)lrintf(a));
    }
    u += 0x0fff + (u >> 13 & 1);
    return (uint16_t)(sign | (u - 0x38000000) >> 13);
}

static inline float hg_half_to_float(uint16_t h)
{
    const uint32_t magnitude = h & 0x7fffu;
    uint32_t u = (magnitude << 13) + 0x38000000u;
    float v;
    if (magnitude < 0x0400) { // subnormal, steps of 2^-24
        v = (float)magnitude * 0x1p-24f;
    } else {
        memcpy(&v, &u, 4);
    }
    return h & 0x8000 ? -v : v;
}

// Luminance of a linear BT.709 colour, in the unit of its channels.
static inline float hg_luminance(const float rgb[3])
{
    return 0.2126f * rgb[0] + 0.7152f * rgb[1] + 0.0722f * rgb[2];
}

#endif
