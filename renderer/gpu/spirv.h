// spirv.h - words of SPIR-V modules, for what reads and writes them. Floor 1. Any thread.
#ifndef HG_RENDERER_GPU_SPIRV_H
#define HG_RENDERER_GPU_SPIRV_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define HG_SPIRV_HEADER_WORDS 5
#define HG_SPIRV_MOST_IDS     (1u << 22)

// A module; freed with hg_spirv_free.
struct hg_spirv {
    uint32_t *words;
    size_t size_bytes;
};
void hg_spirv_free(struct hg_spirv *spirv);

static inline uint32_t hg_spirv_op(const uint32_t *instruction)
{
    return *instruction & 0xffffu;
}

static inline uint32_t hg_spirv_length(const uint32_t *instruction)
{
    return *instruction >> 16;
}

// Of integers of 32 bits and of truth values (0, 1). False: another operation, or a result that is
// undefined.
bool hg_spirv_fold(uint32_t op, uint32_t a, uint32_t b, uint32_t *out);
// Names, lines and sources: nothing that a driver asks for.
bool hg_spirv_is_note(uint32_t op);
bool hg_spirv_is_decoration(uint32_t op);

#endif
