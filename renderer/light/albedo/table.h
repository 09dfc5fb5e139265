// table.h - places of entries in the tables of dfg.h, and values between them.
// Floor 2 (light), private to this folder. Pure, inline. Twins of lib/lobes.glsl.
#ifndef HG_RENDERER_LIGHT_ALBEDO_TABLE_H
#define HG_RENDERER_LIGHT_ALBEDO_TABLE_H

#include "renderer/math/vec.h"
#include "shaders/shared/light.h"

// Of entry i of `size`, 0..1.
static inline float hg_table_place(uint32_t i, uint32_t size)
{
    return (float)i / (float)(size - 1);
}

// Cosine at an entry, but for the one at 0, where there is nothing to integrate.
static inline float hg_table_cosine(uint32_t i, uint32_t size)
{
    const float s = hg_table_place(i, size);
    return fmaxf(s * s, 1e-3f);
}

static inline struct hg_vec2 hg_table_between(struct hg_vec2 a, struct hg_vec2 b, float f)
{
    return (struct hg_vec2){a.x * (1 - f) + b.x * f, a.y * (1 - f) + b.y * f};
}

// Between four entries, of a single row between two; x and y in columns and rows.
static inline struct hg_vec2 hg_table_bilinear(
    const struct hg_vec2 *table, uint32_t columns, uint32_t rows, float x, float y)
{
    const uint32_t i = (uint32_t)fminf(x, (float)(columns - 2));
    const uint32_t j = rows > 1 ? (uint32_t)fminf(y, (float)(rows - 2)) : 0;
    const struct hg_vec2 *p = table + j * columns + i;
    const struct hg_vec2 low = hg_table_between(p[0], p[1], x - (float)i);
    if (rows == 1)
        return low;
    const struct hg_vec2 high = hg_table_between(p[columns], p[columns + 1], x - (float)i);
    return hg_table_between(low, high, y - (float)j);
}

// Of a table of n x n by cosine and roughness.
static inline struct hg_vec2 hg_table_look_up(
    const struct hg_vec2 *table, uint32_t n, float cosine, float roughness)
{
    const float last = (float)(n - 1), s = hg_clampf(sqrtf(fmaxf(cosine, 0)), 0, 1);
    return hg_table_bilinear(table, n, n, s * last, hg_clampf(roughness, 0, 1) * last);
}

// Share that a coat of index 1.5 (`coat`) or sheen takes at a cosine.
static inline float hg_table_layer_albedo(
    const struct hg_vec2 *table, bool coat, float roughness, float cosine)
{
    if (!coat)
        return hg_table_look_up(table + HG_SHEEN_FIRST, HG_SHEEN_SIZE, cosine, roughness).y;
    const struct hg_vec2 dfg = hg_table_look_up(table, HG_DFG_SIZE, cosine, roughness);
    return 0.04f * dfg.x + dfg.y;
}

// Index of refraction at entry i of `size`, and its place.
static inline float hg_table_ior(uint32_t i, uint32_t size)
{
    const float s = hg_table_place(i, size), x = HG_GLASS_FAR * s * s;
    return (1 + x) / (1 - x);
}

// Cosine where total reflection ends, seen from inside of glass; 0 from outside.
static inline float hg_glass_edge(float eta)
{
    return sqrtf(fmaxf(1 - eta * eta, 0));
}

// Place 0..1 of a cosine in tables of glass, and back: from inside both sides of total reflection
// lie dense, and it begins at HG_GLASS_EDGE for all indices.
static inline float hg_glass_place(float cosine, float eta)
{
    const float c = hg_clampf(cosine, 0, 1), edge = hg_glass_edge(eta);
    if (eta >= 1)
        return sqrtf(c);
    if (c >= edge)
        return HG_GLASS_EDGE + (1 - HG_GLASS_EDGE) * sqrtf((c - edge) / fmaxf(1 - edge, 1e-6f));
    return asinf(sqrtf(c / edge)) * HG_GLASS_EDGE / (float)(HG_PI / 2);
}

static inline float hg_glass_cosine(float place, float eta)
{
    const float edge = hg_glass_edge(eta), q = (place - HG_GLASS_EDGE) / (1 - HG_GLASS_EDGE);
    const float s = sinf((float)(HG_PI / 2) * place / HG_GLASS_EDGE);
    if (eta >= 1)
        return fmaxf(place * place, 1e-3f);
    return fmaxf(q >= 0 ? edge + (1 - edge) * q * q : edge * s * s, 1e-3f);
}

// hg_glass_shares of lib/lobes.glsl, at a place of a cosine.
static inline struct hg_vec2 hg_table_glass(
    const struct hg_vec2 *table, float place, float roughness, float eta)
{
    enum { N = HG_GLASS_COSINES, R = HG_GLASS_ROUGHS };
    const float ior = eta < 1 ? 1 / eta : eta;
    const float s = sqrtf(fminf((ior - 1) / ((ior + 1) * HG_GLASS_FAR), 1));
    const float layer = s * (HG_GLASS_IORS - 1);
    const uint32_t k = (uint32_t)fminf(layer, HG_GLASS_IORS - 2);
    const struct hg_vec2 *p = table + HG_GLASS_FIRST + (eta < 1 ? HG_GLASS_WORDS : 0) + k * N * R;
    const float x = place * (N - 1), y = roughness * (R - 1);
    return hg_table_between(hg_table_bilinear(p, N, R, x, y),
        hg_table_bilinear(p + N * R, N, R, x, y), layer - (float)k);
}

// hg_aniso_alpha, hg_aniso_roughness and hg_aniso_cosine of lib/lobes.glsl.
static inline void hg_aniso_alpha(float roughness, float strength, float alpha[2])
{
    alpha[1] = fmaxf(roughness * roughness, HG_MIN_ALPHA);
    alpha[0] = alpha[1] + (1 - alpha[1]) * strength * strength;
}

static inline float hg_aniso_roughness(const float alpha[2])
{
    const float rms = sqrtf(0.5f * (alpha[0] * alpha[0] + alpha[1] * alpha[1]));
    return sqrtf(rms + (0.5f * (alpha[0] + alpha[1]) - rms) * 0.15f);
}

static inline float hg_aniso_cosine(const float v[3], const float alpha[2], float roughness)
{
    const float width = roughness * roughness, x = v[0] * alpha[0], y = v[1] * alpha[1];
    const float k = v[2] * v[2] + (x * x + y * y) / fmaxf(width * width, 1e-12f);
    return v[2] / sqrtf(fmaxf(k, 1e-12f));
}

// Entries that are differences, and back.
static inline float hg_table_correction(float difference)
{
    return hg_clampf(0.5f + difference / (2 * HG_ANISO_RANGE), 0, 1);
}

static inline struct hg_vec2 hg_table_middle_off(struct hg_vec2 entry)
{
    return (struct hg_vec2){
        (entry.x - 0.5f) * 2 * HG_ANISO_RANGE, (entry.y - 0.5f) * 2 * HG_ANISO_RANGE};
}

// How far a direction leans along x: asinh(x / z), which is as fine as the directions are near y
// that graze, where the most happens, and as azimuths elsewhere.
static inline float hg_lean(float x, float z)
{
    return asinhf(x / fmaxf(z, 1e-4f));
}

// Facets that tilt along x only reflect all where the part of the direction across x says so, which
// is below this lean; 0: nowhere.
static inline float hg_brushed_edge(float cosine, float eta)
{
    return hg_lean(sqrtf(fmaxf(1 - cosine * cosine - eta * eta, 0)), cosine);
}

// Place 0..1 of a lean in tables of anisotropic glass, and back. From inside that edge is at 0.5.
static inline float hg_brushed_place(float lean, float cosine, float eta)
{
    const float edge = hg_brushed_edge(cosine, eta);
    const float most = hg_lean(sqrtf(fmaxf(1 - cosine * cosine, 0)), cosine);
    if (eta >= 1)
        return 1 - lean / fmaxf(most, 1e-6f);
    if (lean < edge)
        return 0.5f + 0.5f * sqrtf(1 - lean / edge);
    return 0.5f - 0.5f * sqrtf(fminf((lean - edge) / fmaxf(most - edge, 1e-6f), 1));
}

static inline float hg_brushed_lean(float place, float cosine, float eta)
{
    const float edge = hg_brushed_edge(cosine, eta), q = 2 * place - 1;
    const float most = hg_lean(sqrtf(fmaxf(1 - cosine * cosine, 0)), cosine);
    if (eta >= 1)
        return most * (1 - place);
    return q > 0 ? edge * (1 - q * q) : edge + (most - edge) * q * q;
}

#endif
