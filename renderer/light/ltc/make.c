// make.c - writes the table of ltc.h to the file that lighting embeds.
#include <stdbool.h>
#include <stdio.h>

#include "renderer/light/ltc/ltc.h"

int main(int argc, char **argv)
{
    static uint32_t words[HG_LTC_WORDS];
    FILE *file = argc == 2 ? fopen(argv[1], "wb") : NULL;
    if (!file) {
        fprintf(stderr, "usage: %s FILE\n", argv[0]);
        return 2;
    }
    hg_ltc_fill(words);
    const bool written = fwrite(words, sizeof words, 1, file) == 1;
    return fclose(file) == 0 && written ? 0 : 1;
}
