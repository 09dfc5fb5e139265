// lobes.h - the parts of hg_dfg_fill beyond hg_dfg itself and sheen.
// Floor 2 (light), private to this folder. Pure; same result on every run.
#ifndef HG_RENDERER_LIGHT_ALBEDO_LOBES_H
#define HG_RENDERER_LIGHT_ALBEDO_LOBES_H

#include "renderer/light/albedo/dfg.h"

// out: [HG_DFG_WORDS]. Each fills its tables and reads those of hg_dfg and sheen.
void hg_dfg_fill_layers(struct hg_vec2 *out);
void hg_dfg_fill_glass(struct hg_vec2 *out); // with its films
void hg_dfg_fill_aniso(struct hg_vec2 *out); // after hg_dfg_fill_glass, which it reads

static inline void hg_dfg_each(
    struct hg_vec2 *out, uint32_t count, void (*job)(struct hg_vec2 *out, uint32_t job))
{
    for (uint32_t i = 0; i < count; i++)
        job(out, i);
}

#endif
