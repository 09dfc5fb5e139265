// ltc_embed.h - the table of ltc.h as shaders read it.
// Floor 2 (light). Read-only data; any thread.
#ifndef HG_RENDERER_LIGHT_LTC_LTC_EMBED_H
#define HG_RENDERER_LIGHT_LTC_LTC_EMBED_H

#include <stdint.h>

#include "shaders/shared/light.h"

extern const uint32_t hg_ltc_words[HG_LTC_WORDS];

#endif
