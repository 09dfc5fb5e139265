// optimise.h - SPIR-V with its calls expanded and its local variables as values.
//
// Drivers do the same, for each pipeline of each process, whatever is in their caches: in Mesa
// 22.3.6 it takes most of the time that a pipeline takes, and grows with the size of the module
// once its calls are expanded (docs/internals/gpu.md). No arithmetic is changed. Floor 1. Any
// thread.
#ifndef HG_RENDERER_GPU_OPTIMISE_H
#define HG_RENDERER_GPU_OPTIMISE_H

#include "renderer/gpu/spirv.h"

// words: a valid module without specialisation constants. Functions are expanded where they are
// called, but those that return from within a loop; their variables become values, but arrays that
// are indexed by values; what is known is computed, what is computed twice is computed once, what
// nothing asks for is left out. False: the module uses something that is not known here, or there
// is no memory; *out is empty.
bool hg_spirv_optimise(const uint32_t *words, size_t size_bytes, struct hg_spirv *out);

#endif
