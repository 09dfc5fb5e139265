// half.h - 16-bit floats (IEEE 754 binary16). Floor 2 (texture). Pure.
#ifndef HG_RENDERER_TEXTURE_SOURCE_HALF_H
#define HG_RENDERER_TEXTURE_SOURCE_HALF_H

#include <stdint.h>
#include <string.h>

// Rounds to nearest even; values beyond 65504 become infinity, NaN stays NaN.
static inline uint16_t hg_half_from_float(float value)
{
    uint32_t bits;
    memcpy(&bits, &value, sizeof bits);
    const uint32_t sign = bits >> 16 & 0x8000u;
    bits &= 0x7fffffffu;
    if (bits >= 0x47800000u) // 65536 and up, infinity, NaN
        return (uint16_t)(sign | (bits > 0x7f800000u ? 0x7e00u : 0x7c00u));
    if (bits < 0x38800000u) { // below 2^-14: denormal; the sum rounds in steps of 2^-24
        float magic = 0.5f, sum;
        memcpy(&sum, &bits, sizeof sum);
        sum += magic;
        memcpy(&bits, &sum, sizeof bits);
        return (uint16_t)(sign | (bits - 0x3f000000u));
    }
    bits += 0xfffu + (bits >> 13 & 1u);
    return (uint16_t)(sign | ((bits - 0x38000000u) >> 13));
}

static inline float hg_half_to_float(uint16_t half)
{
    const uint32_t exponent = half >> 10 & 31u, mantissa = half & 1023u;
    float value = exponent == 0 ? (float)mantissa * 0x1p-24f : 0.0f;
    uint32_t bits;
    if (exponent != 0) {
        bits =
            exponent == 31 ? 0x7f800000u | mantissa << 13 : (exponent + 112) << 23 | mantissa << 13;
        memcpy(&value, &bits, sizeof value);
    }
    return half & 0x8000u ? -value : value;
}

#endif
