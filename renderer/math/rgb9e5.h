// rgb9e5.h - colours of 32 bits with a shared exponent, as shaders read them.
// Floor 1 (math). Pure; any thread.
#ifndef HG_RENDERER_MATH_RGB9E5_H
#define HG_RENDERER_MATH_RGB9E5_H

#include <stdint.h>

// Three values >= 0 of up to 65408 with a common exponent, 9 bits each; hg_rgb9e5 of
// shaders/lib/probes.glsl is the inverse. Smaller ones than 1e-8 are 0.
// Source: Khronos Data Format Specification 1.3, section 10.5 (shared exponent).
uint32_t hg_rgb9e5_pack(float r, float g, float b);
void hg_rgb9e5_unpack(uint32_t word, float out[3]);

#endif
