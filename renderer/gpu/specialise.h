// specialise.h - SPIR-V with the values of its specialisation constants put in, and without what
// they rule out. Drivers do the same, but only after all functions of the shader were expanded
// where they are called: Mesa 22.3.6 takes 1.6 s for a kernel of the path tracer as it is, 0.1 s
// for what is left. Floor 1. Any thread.
#ifndef HG_RENDERER_GPU_SPECIALISE_H
#define HG_RENDERER_GPU_SPECIALISE_H

#include "renderer/gpu/spirv.h"

// values: of the constants with ids 0..value_count - 1; others keep their defaults. Branches, not
// switches, whose condition then is known lose the side that is not taken, and functions that
// are no longer called go with it, as do names and line numbers. False: the module uses something
// that is not known here (arithmetic with constants of 64 bits or of floats, groups of
// decorations), is malformed, or there is no memory; *out is empty.
bool hg_spirv_specialise(const uint32_t *words, size_t size_bytes, const uint32_t *values,
    uint32_t value_count, struct hg_spirv *out);

#endif
