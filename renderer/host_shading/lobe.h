// lobe.h - the specular lobe of a rough surface, sampled for reflections.
// Floor 2. Pure, inline; any thread.
//
// GGX with height-correlated Smith shadowing, alpha = roughness^2, one reflectance at normal
// incidence for all colours: reflections are ratios, so that only what differs within the lobe
// counts.
#ifndef HG_RENDERER_HOST_SHADING_LOBE_H
#define HG_RENDERER_HOST_SHADING_LOBE_H

#include "renderer/math/vec.h"

#define HG_LOBE_ROUGH       0.45f // roughness from which what is mirrored is gathered in cells
#define HG_LOBE_LEAST_ALPHA 0.02f // of densities: mirrors would never find a texel fine enough

// Smith's Lambda from the cosine to the normal.
static inline float hg_lobe_lambda(float alpha, float cosine)
{
    const float c2 = fmaxf(cosine * cosine, 1e-8f);
    return 0.5f * (sqrtf(1 + alpha * alpha * (1 - c2) / c2) - 1);
}

// GGX, from the cosine of the half vector to the normal.
static inline float hg_lobe_density(float alpha, float cosine)
{
    const float a2 = alpha * alpha, d = cosine * cosine * (a2 - 1) + 1;
    return a2 / fmaxf((float)HG_PI * d * d, 1e-12f);
}

// Schlick 1994, from the cosine of the half vector to the view.
static inline float hg_lobe_fresnel(float f0, float cosine)
{
    const float m = 1 - hg_clampf(cosine, 0, 1), m2 = m * m;
    return f0 + (1 - f0) * m2 * m2 * m;
}

// A visible normal by two numbers in [0, 1); view and out: the normal is +z.
// Source: Heitz 2018, "Sampling the GGX Distribution of Visible Normals", listing 1.
static inline void hg_lobe_visible_normal(
    float alpha, const float view[3], const float xi[2], float out[3])
{
    float v[3] = {alpha * view[0], alpha * view[1], view[2]};
    hg_normalize3(v);
    const float flat = v[0] * v[0] + v[1] * v[1];
    float a[3] = {1, 0, 0}, b[3];
    if (flat > 0) {
        a[0] = -v[1] / sqrtf(flat);
        a[1] = v[0] / sqrtf(flat);
    }
    hg_cross3(v, a, b);
    const float r = sqrtf(xi[0]), phi = 2 * (float)HG_PI * xi[1];
    const float x = r * cosf(phi), s = 0.5f * (1 + v[2]);
    const float y = (1 - s) * sqrtf(fmaxf(0, 1 - x * x)) + s * r * sinf(phi);
    const float z = sqrtf(fmaxf(0, 1 - x * x - y * y));
    for (int i = 0; i < 3; i++)
        out[i] = x * a[i] + y * b[i] + z * v[i];
    out[0] *= alpha;
    out[1] *= alpha;
    out[2] = fmaxf(out[2], 0);
    hg_normalize3(out);
}

// One sample of the lobe.
struct hg_lobe_sample {
    float direction[3]; // world, unit
    float weight;       // BRDF times cosine over the density; 0: below the horizon
    float half_cosine;  // of the half vector to the normal,
    float half_view;    // and to the view
};

// f0: reflectance at normal incidence; normal and view: world, unit, less than 90 degrees apart.
static inline struct hg_lobe_sample hg_lobe_take(
    float roughness, float f0, const float normal[3], const float view[3], const float xi[2])
{
    const float alpha = roughness * roughness;
    const float up[3] = {fabsf(normal[2]) > 0.9f, 0, fabsf(normal[2]) <= 0.9f};
    float t[3], b[3], h[3], world[3];
    hg_cross3(up, normal, t);
    hg_normalize3(t);
    hg_cross3(normal, t, b);
    const float local[3] = {hg_dot3(view, t), hg_dot3(view, b), hg_dot3(view, normal)};
    hg_lobe_visible_normal(alpha, local, xi, h);
    for (int i = 0; i < 3; i++)
        world[i] = t[i] * h[0] + b[i] * h[1] + normal[i] * h[2];
    struct hg_lobe_sample s = {.half_cosine = h[2], .half_view = hg_dot3(world, view)};
    for (int i = 0; i < 3; i++)
        s.direction[i] = 2 * s.half_view * world[i] - view[i];
    const float out = hg_dot3(s.direction, normal);
    if (!(out > 0))
        return s;
    const float lv = hg_lobe_lambda(alpha, local[2]), ll = hg_lobe_lambda(alpha, out);
    s.weight = hg_lobe_fresnel(f0, s.half_view) * (1 + lv) / (1 + lv + ll);
    return s;
}

// BRDF times cosine of a direction that was chosen otherwise, and in *density that with which
// hg_lobe_take chooses it. 0: below the horizon.
static inline float hg_lobe_value(float roughness, float f0, const float normal[3],
    const float view[3], const float direction[3], float *density)
{
    const float alpha = roughness * roughness;
    const float in = hg_dot3(normal, view), out = hg_dot3(normal, direction);
    float h[3];
    for (int i = 0; i < 3; i++)
        h[i] = direction[i] + view[i];
    hg_normalize3(h);
    const float lv = hg_lobe_lambda(alpha, in), ll = hg_lobe_lambda(alpha, out);
    const float d = hg_lobe_density(alpha, hg_dot3(h, normal)) / (4 * fmaxf(in, 1e-4f));
    *density = d / (1 + lv);
    return out > 0 ? hg_lobe_fresnel(f0, hg_dot3(h, view)) * d / (1 + lv + ll) : 0;
}

// How likely another sample of the same lobe would fall on the same texel of a cube map: side
// texels wide, whose face it met `deep` metres away along its axis; length: of the reflected ray.
// Source: Hirvonen et al. 2019, "Accurate Real-Time Specular Reflections with Radiance Caching",
// equations 6 to 9: the solid angle of a texel's bounding sphere, seen from the surface, times the
// density of reflected directions.
static inline float hg_lobe_same_texel(
    float roughness, const struct hg_lobe_sample *s, float deep, float side, float length)
{
    const float alpha = fmaxf(roughness * roughness, HG_LOBE_LEAST_ALPHA);
    const float density =
        hg_lobe_density(alpha, s->half_cosine) * s->half_cosine / (4 * fmaxf(s->half_view, 1e-4f));
    const float radius = sqrtf(2) * deep / (side * fmaxf(length, 1e-6f));
    return hg_clampf(density * (float)HG_PI * radius * radius, 0, 1);
}

#endif
