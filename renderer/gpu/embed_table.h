// embed_table.h - the SPIR-V of <embedded_shaders.def> as a static table, `table` [TABLE_COUNT].
// To be included by one source file of each such list (CMake: hg_embed_shaders).
#ifndef HG_RENDERER_GPU_EMBED_TABLE_H
#define HG_RENDERER_GPU_EMBED_TABLE_H

#include "renderer/gpu/embed.h"

// The assembler reads the files: no megabytes of array literals for the compiler.
#define HG_SHADER(symbol, name, path)                                                              \
    __asm__(".section .rodata\n.balign 16\n.global hg_spirv_" #symbol "\n"                         \
            ".hidden hg_spirv_" #symbol "\nhg_spirv_" #symbol ":\n.incbin \"" path "\"\n"          \
            ".global hg_spirv_end_" #symbol "\n.hidden hg_spirv_end_" #symbol "\n"                 \
            "hg_spirv_end_" #symbol ":\n.byte 0\n.previous\n");                                    \
    extern const uint32_t hg_spirv_##symbol[];                                                     \
    extern const char hg_spirv_end_##symbol[];
#include <embedded_shaders.def>
#undef HG_SHADER

static struct hg_shader_binary table[] = {
#define HG_SHADER(symbol, name, path) {name, hg_spirv_##symbol, 0},
#include <embedded_shaders.def>
#undef HG_SHADER
    {NULL, NULL, 0},
};

#define TABLE_COUNT (sizeof table / sizeof table[0] - 1)

// Sizes are differences of link-time addresses, which C does not accept as constants.
__attribute__((constructor)) static void measure_table(void)
{
    size_t i = 0;
#define HG_SHADER(symbol, name, path)                                                              \
    table[i++].size_bytes = (size_t)(hg_spirv_end_##symbol - (const char *)hg_spirv_##symbol);
#include <embedded_shaders.def>
#undef HG_SHADER
    (void)i;
}

#endif
