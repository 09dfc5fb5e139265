#include "renderer/light/albedo/dfg_embed.h"

// The assembler reads what dfg_make wrote. HG_DFG_FILE comes from the build.
__asm__(".section .rodata\n.balign 16\n.global hg_dfg_words\n.hidden hg_dfg_words\n"
        "hg_dfg_words:\n.incbin \"" HG_DFG_FILE "\"\n.previous\n");
