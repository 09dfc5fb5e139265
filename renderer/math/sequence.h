// sequence.h - numbers that are spread evenly: over an interval, over a picture.
// Floor 1 (math). Pure, inline.
#ifndef HG_RENDERER_MATH_SEQUENCE_H
#define HG_RENDERER_MATH_SEQUENCE_H

#include <stdint.h>

// In [0, 1): digits of i behind the point (van der Corput; one axis of Halton's points). base >= 2.
static inline float hg_radical_inverse(uint32_t i, uint32_t base)
{
    float f = 1, sum = 0;
    for (; i > 0; i /= base) {
        f /= (float)base;
        sum += f * (float)(i % base);
    }
    return sum;
}

// Of 2^bits x 2^bits places (ordered dither): 0 .. 4^bits - 1. Places with the same rank modulo a
// power of two are as far apart as so many can be.
static inline uint32_t hg_dither_rank(uint32_t x, uint32_t y, int bits)
{
    static const uint8_t order[4] = {0, 3, 1, 2};
    uint32_t rank = 0;
    for (int b = 0; b < bits; b++)
        rank |= (uint32_t)order[(x >> b & 1) | (y >> b & 1) << 1] << (2 * b);
    return rank;
}

#endif
