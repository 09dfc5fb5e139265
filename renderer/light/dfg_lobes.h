// dfg_lobes.h - the tables of hg_dfg_fill for glass, films and anisotropy.
// Floor 2 (light), private to dfg.c. Pure; same result on every run.
#ifndef HG_RENDERER_LIGHT_DFG_LOBES_H
#define HG_RENDERER_LIGHT_DFG_LOBES_H

#include "renderer/light/dfg.h"

// Everything from HG_GLASS_FIRST on; reads hg_dfg's own part of `out`.
void hg_dfg_fill_lobes(struct hg_vec2 out[HG_DFG_WORDS]);

#endif
