#include "renderer/light/ltc/ltc_embed.h"

// The assembler reads what ltc_make wrote. HG_LTC_FILE comes from the build.
__asm__(".section .rodata\n.balign 16\n.global hg_ltc_words\n.hidden hg_ltc_words\n"
        "hg_ltc_words:\n.incbin \"" HG_LTC_FILE "\"\n.previous\n");
