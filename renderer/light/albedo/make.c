// make.c - writes the tables of dfg.h to the file that words.c embeds.
#include <stdbool.h>
#include <stdio.h>

#include "renderer/light/albedo/dfg.h"
#include "renderer/math/vec.h"

static uint32_t unorm16(float v)
{
    return (uint32_t)(hg_clampf(v, 0, 1) * 65535 + 0.5f);
}

int main(int argc, char **argv)
{
    static struct hg_vec2 table[HG_DFG_WORDS];
    static uint32_t words[HG_DFG_WORDS];
    FILE *file = argc == 2 ? fopen(argv[1], "wb") : NULL;
    if (!file) {
        fprintf(stderr, "usage: %s FILE\n", argv[0]);
        return 2;
    }
    hg_dfg_fill(table);
    for (uint32_t i = 0; i < HG_DFG_WORDS; i++)
        words[i] = unorm16(table[i].x) | unorm16(table[i].y) << 16;
    const bool written = fwrite(words, sizeof words, 1, file) == 1;
    return fclose(file) == 0 && written ? 0 : 1;
}
