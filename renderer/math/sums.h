// sums.h - choosing one of many by running sums of their weights (inversion of a discrete
// distribution). Floor 1. Pure; any thread.
#ifndef HG_RENDERER_MATH_SUMS_H
#define HG_RENDERER_MATH_SUMS_H

#include <stdint.h>

// The first of [count] non-decreasing sums that is greater than a value; the last one where none
// is.
static inline uint32_t hg_sums_find(const float *sums, uint32_t count, float value)
{
    uint32_t low = 0, high = count - 1;
    while (low < high) {
        const uint32_t middle = low + (high - low) / 2;
        if (sums[middle] > value)
            high = middle;
        else
            low = middle + 1;
    }
    return low;
}

#endif
