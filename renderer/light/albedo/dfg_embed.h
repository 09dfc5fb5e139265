// dfg_embed.h - the tables of dfg.h as shaders read them.
// Floor 2 (light). Read-only data; any thread.
#ifndef HG_RENDERER_LIGHT_ALBEDO_DFG_EMBED_H
#define HG_RENDERER_LIGHT_ALBEDO_DFG_EMBED_H

#include <stdint.h>

#include "shaders/shared/light.h"

// [HG_DFG_WORDS] x in the lower 16 bits, y in the upper ones, fractions of 65535.
extern const uint32_t hg_dfg_words[HG_DFG_WORDS];

#endif
