// dfg.h - the directional albedo of the specular BRDF as a table.
// Floor 2 (light). Pure; same result on every run and for every number of threads.
#ifndef HG_RENDERER_LIGHT_DFG_H
#define HG_RENDERER_LIGHT_DFG_H

#include "base/jobs.h"
#include "shaders/shared/light.h"

#define HG_DFG_ENTRIES HG_DFG_WORDS

// Scale a and bias b with E(v) = f0 a + b for GGX, height-correlated Smith and Schlick, by
// numerical integration over the visible normals with n x n points.
// n_dot_v in (0, 1], alpha in [0, 1].
// Source: Karis 2013, "Real Shading in Unreal Engine 4", eq. 8; Heitz 2018 (visible normals).
void hg_dfg_integrate(float n_dot_v, float alpha, uint32_t n, float ab[2]);

// Directional albedo of the sheen of lib/lobes.glsl, likewise over n x n directions.
// Source: Estevez and Kulla 2017, "Production Friendly Microfacet Sheen BRDF".
float hg_sheen_integrate(float n_dot_v, float roughness, uint32_t n);

// Table of lib/brdf.glsl, hg_dfg(): column i is cos = (i / (size - 1))^2, row j perceptual
// roughness j / (size - 1); behind it one row of cosine-weighted averages by roughness;
// behind that, from HG_SHEEN_FIRST, the sheen's albedo / HG_SHEEN_MOST in x, by the same
// coordinates. About 20 ms on two cores.
void hg_dfg_fill(struct hg_jobs *jobs, struct hg_vec2 out[HG_DFG_ENTRIES]);

#endif
