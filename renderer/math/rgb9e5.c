// rgb9e5.c - see rgb9e5.h.
#include "renderer/math/rgb9e5.h"

#include <math.h>

#include "renderer/math/vec.h"

// Source: Khronos Data Format Specification 1.3, section 10.5 (shared exponent).
uint32_t hg_rgb9e5_pack(float r, float g, float b)
{
    const float most = fmaxf(r, fmaxf(g, b));
    const float bounded = most < 65408.0f ? most : 65408.0f;
    uint32_t bits;
    if (!(most > 1e-8f))
        return 0;
    memcpy(&bits, &bounded, sizeof bits); // frexpf and ldexpf are calls
    const int exponent = (int)(bits >> 23) - 126 + 15;
    const int shared = exponent < 0 ? 0 : exponent > 31 ? 31 : exponent;
    const uint32_t power = (uint32_t)(24 - shared + 127) << 23;
    float scale;
    memcpy(&scale, &power, sizeof scale);
    const float values[3] = {r, g, b};
    uint32_t word = (uint32_t)shared << 27;
    for (int c = 0; c < 3; c++)
        word |= (uint32_t)lrintf(hg_clampf(values[c] * scale, 0, 511)) << (9 * c);
    return word;
}

void hg_rgb9e5_unpack(uint32_t word, float out[3])
{
    const float scale = ldexpf(1, (int)(word >> 27) - 24);
    for (int c = 0; c < 3; c++)
        out[c] = (float)(word >> (9 * c) & 511) * scale;
}
