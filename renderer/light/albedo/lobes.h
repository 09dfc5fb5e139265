// lobes.h - the parts of hg_dfg_fill beyond hg_dfg itself and sheen.
// Floor 2 (light), private to this folder. Pure; same result on every run.
#ifndef HG_RENDERER_LIGHT_ALBEDO_LOBES_H
#define HG_RENDERER_LIGHT_ALBEDO_LOBES_H

#include <stdbool.h>

#include "renderer/light/albedo/dfg.h"
#include "renderer/math/vec.h"

// out: [HG_DFG_WORDS]. Each fills its tables and reads those of hg_dfg and sheen.
void hg_dfg_fill_layers(struct hg_vec2 *out);
void hg_dfg_fill_glass(struct hg_vec2 *out);         // with its films
void hg_dfg_fill_aniso(struct hg_vec2 *out);         // after hg_dfg_fill_glass, which it reads
void hg_dfg_fill_layered_aniso(struct hg_vec2 *out); // after hg_dfg_fill_layers, likewise

// A coat or sheen, and the share that it takes at the cosine of v.
struct hg_layer {
    const struct hg_vec2 *table;
    bool coat;
    float roughness, here;
};

// That share at a cosine.
float hg_layer_albedo(const struct hg_layer *layer, float cosine);
// user: struct hg_layer; what it holds back of light to this cosine beyond what it held back of
// that of v.
float hg_layer_more(const void *user, float cosine);

// Directions of a quadrant by root of the cosine and by azimuth, and what each weighs in
// cosine-weighted means.
enum { HG_DFG_FINE = 48, HG_DFG_TURNS = 12, HG_DFG_QUADRANT = HG_DFG_FINE * HG_DFG_TURNS };

static inline float hg_dfg_quadrant(uint32_t k, float *root_cosine, float *azimuth_cosine)
{
    const float s = ((float)(k / HG_DFG_TURNS) + 0.5f) / HG_DFG_FINE;
    const float turn = ((float)(k % HG_DFG_TURNS) + 0.5f) / HG_DFG_TURNS;
    *root_cosine = s;
    *azimuth_cosine = cosf((float)HG_PI * 0.5f * turn);
    return 4 * s * s * s / HG_DFG_QUADRANT;
}

static inline void hg_dfg_each(
    struct hg_vec2 *out, uint32_t count, void (*job)(struct hg_vec2 *out, uint32_t job))
{
    for (uint32_t i = 0; i < count; i++)
        job(out, i);
}

#endif
