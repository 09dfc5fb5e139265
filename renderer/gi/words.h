// words.h - numbers as the words that shaders read.
// Floor 2, for renderer/gi and renderer/reflect. Pure; any thread.
#ifndef HG_RENDERER_GI_WORDS_H
#define HG_RENDERER_GI_WORDS_H

#include <stdint.h>

// Three values >= 0 of up to 65408 with a common exponent, 9 bits each; hg_rgb9e5 of
// shaders/lib/probes.glsl is the inverse. Smaller ones than 1e-8 are 0.
uint32_t hg_gi_rgb9e5(float r, float g, float b);
void hg_gi_rgb9e5_read(uint32_t word, float out[3]);

#endif
