// words.c - see words.h.
#include "renderer/gi/words.h"

#include <math.h>

#include "renderer/math/vec.h"

// Source: Khronos Data Format Specification 1.3, section 10.5 (shared exponent).
uint32_t hg_gi_rgb9e5(float r, float g, float b)
{
    const float most = fmaxf(r, fmaxf(g, b));
    int exponent = 0;
    if (!(most > 1e-8f))
        return 0;
    frexpf(fminf(most, 65408.0f), &exponent);
    const int shared = exponent + 15 < 0 ? 0 : exponent + 15 > 31 ? 31 : exponent + 15;
    const float scale = ldexpf(1, 24 - shared);
    const float values[3] = {r, g, b};
    uint32_t word = (uint32_t)shared << 27;
    for (int c = 0; c < 3; c++)
        word |= (uint32_t)hg_clampf(rintf(values[c] * scale), 0, 511) << (9 * c);
    return word;
}
