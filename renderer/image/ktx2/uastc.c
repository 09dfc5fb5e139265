#include "renderer/image/ktx2/uastc.h"

#include <string.h>

enum { SOLID = 8, MODES = 19, MAX_VALUES = 18 };

// Bits of a block, from the lowest of its first byte.
struct bits {
    uint64_t low, high;
};

static unsigned take(struct bits *b, unsigned count)
{
    if (count == 0)
        return 0;
    const unsigned value = (unsigned)(b->low & ((UINT64_C(1) << count) - 1));
    b->low = b->low >> count | b->high << (64 - count);
    b->high >>= count;
    return value;
}

struct mode {
    uint8_t code, code_bits; // of the mode itself
    uint8_t hint_bits;       // for other formats' encoders: passed over
    uint8_t pattern_bits;
    uint8_t radix; // of what end points hold beside their bits: 1 (nothing), 3 or 5
    uint8_t bits;  // of an end point, beside that
    uint8_t weight_bits;
    uint8_t subsets;       // 1..3
    uint8_t planes;        // of weights
    uint8_t channels;      // 2: luminance and alpha
    uint8_t selector_bits; // which channel has the second plane
};

// Tables "mode index encoding", "configuration bits", "endpoint bits" and "weight bits".
static const struct mode modes[MODES] = {
    {0x01, 4, 15, 0, 3, 6, 4, 1, 1, 3, 0},
    {0x35, 6, 15, 0, 1, 8, 2, 1, 1, 3, 0},
    {0x1d, 5, 15, 5, 1, 4, 3, 2, 1, 3, 0},
    {0x03, 5, 15, 4, 3, 2, 2, 3, 1, 3, 0},
    {0x13, 5, 15, 5, 5, 3, 2, 2, 1, 3, 0},
    {0x0b, 5, 15, 0, 1, 8, 3, 1, 1, 3, 0},
    {0x1b, 5, 15, 0, 5, 5, 2, 1, 2, 3, 2},
    {0x07, 5, 15, 5, 5, 3, 2, 2, 1, 3, 0},
    {0x17, 5, 0, 0, 1, 8, 0, 1, 0, 4, 0},
    {0x0f, 5, 23, 5, 1, 4, 2, 2, 1, 4, 0},
    {0x02, 3, 17, 0, 3, 4, 4, 1, 1, 4, 0},
    {0x00, 2, 17, 0, 3, 4, 2, 1, 2, 4, 2},
    {0x06, 3, 17, 0, 3, 6, 3, 1, 1, 4, 0},
    {0x1f, 5, 23, 0, 1, 8, 1, 1, 2, 4, 2},
    {0x0d, 5, 23, 0, 1, 8, 2, 1, 1, 4, 0},
    {0x05, 7, 23, 0, 1, 8, 4, 1, 1, 2, 0},
    {0x15, 6, 23, 5, 1, 8, 2, 2, 1, 2, 0},
    {0x25, 6, 23, 0, 1, 8, 2, 1, 2, 2, 0},
    {0x09, 4, 15, 0, 1, 5, 5, 1, 1, 3, 0},
};

// Which subset a texel belongs to: one bit each, texel 0 lowest; two bits each for three subsets.
static const uint16_t patterns_of_two[30] = {0xcccc, 0x8888, 0x1111, 0xecc8, 0x377f, 0xfeec, 0x0137,
    0x137f, 0xc800, 0x0013, 0xfe80, 0x17ff, 0x0017, 0x00ff, 0xfff0, 0x0fff, 0xff71, 0x8eff, 0x08ce,
    0x008c, 0x7310, 0xceff, 0x7331, 0x088c, 0xceef, 0x6666, 0xf00f, 0x5555, 0x0f0f, 0x36c9};
static const uint16_t patterns_of_mode_7[19] = {0x00f0, 0x4444, 0x0133, 0xcc80, 0xf0ff, 0x2222,
    0xffc8, 0xccce, 0x3c03, 0x00ee, 0x7700, 0x3003, 0x00ce, 0xff80, 0x6fff, 0x1333, 0x11ff, 0x136c,
    0x00ef};
static const uint32_t patterns_of_three[11] = {0xa5a50000, 0xaa005555, 0xaa000055, 0x0000aa55,
    0x25252525, 0x94949494, 0x58585858, 0x56560202, 0x92929292, 0x55aa0055, 0xa05050a0};

static const struct mode *read_mode(struct bits *b, unsigned *index)
{
    for (unsigned i = 0; i < MODES; i++) {
        const struct mode *m = &modes[i];
        if ((b->low & ((1u << m->code_bits) - 1)) == m->code) {
            take(b, m->code_bits);
            *index = i;
            return m;
        }
    }
    return NULL;
}

// The subset of each texel. False: there is no such pattern.
static bool read_subsets(struct bits *b, const struct mode *m, unsigned index, uint8_t subset[16])
{
    const unsigned pattern = take(b, m->pattern_bits);
    const unsigned count = m->subsets == 1 ? 1 : m->subsets == 3 ? 11 : index == 7 ? 19 : 30;
    if (pattern >= count)
        return false;
    for (unsigned i = 0; i < 16; i++)
        subset[i] = (uint8_t)(m->subsets == 1   ? 0
                              : m->subsets == 3 ? patterns_of_three[pattern] >> 2 * i & 3
                              : index == 7      ? patterns_of_mode_7[pattern] >> i & 1
                                                : patterns_of_two[pattern] >> i & 1);
    return true;
}

// Bits of a pack of `count` trits or quints.
static unsigned pack_bits(unsigned radix, unsigned count)
{
    static const uint8_t trits[6] = {0, 2, 4, 5, 7, 8}, quints[4] = {0, 3, 5, 7};
    return radix == 3 ? trits[count] : quints[count];
}

static void read_digits(struct bits *b, unsigned radix, unsigned count, uint8_t digits[MAX_VALUES])
{
    const unsigned per_pack = radix == 3 ? 5 : 3;
    for (unsigned i = 0; i < count; i += per_pack) {
        const unsigned n = count - i < per_pack ? count - i : per_pack;
        unsigned pack = take(b, pack_bits(radix, n));
        for (unsigned k = 0; k < n; k++, pack /= radix)
            digits[i + k] = (uint8_t)(pack % radix);
    }
}

// Bits alone: repeated from their top.
static uint8_t widen(unsigned value, unsigned bits)
{
    unsigned v = value << (8 - bits);
    for (unsigned n = bits; n < 8; n *= 2)
        v |= v >> n;
    return (uint8_t)v;
}

// "ASTC endpoint unquantization": how the bits above the lowest stand in nine bits, and what a trit
// or quint counts. The lowest bit turns all around.
static uint8_t unquantise(unsigned radix, unsigned digit, unsigned bits, unsigned value)
{
    const unsigned a = value & 1 ? 0x1ff : 0;
    const unsigned x = value >> 1; // of bits - 1 bits
    unsigned b = 0, c = 0;
    switch (radix * 8 + bits) {
    case 3 * 8 + 2:
        b = x * 0x116, c = 93;
        break;
    case 5 * 8 + 3:
        b = x << 7 | x << 1 | x >> 1, c = 26;
        break;
    case 3 * 8 + 4:
        b = x << 6 | x, c = 22;
        break;
    case 5 * 8 + 5:
        b = x << 5 | x >> 3, c = 6;
        break;
    case 3 * 8 + 6:
        b = x << 4 | x >> 4, c = 5;
        break;
    }
    const unsigned t = (digit * c + b) ^ a;
    return (uint8_t)((a & 0x80) | t >> 2);
}

// ends[subset][low or high][channel], RGBA.
static void read_ends(struct bits *b, const struct mode *m, uint8_t ends[3][2][4])
{
    uint8_t digits[MAX_VALUES] = {0}, values[MAX_VALUES];
    const unsigned count = 2u * m->channels * m->subsets;
    if (m->radix > 1)
        read_digits(b, m->radix, count, digits);
    for (unsigned i = 0; i < count; i++) {
        const unsigned value = take(b, m->bits);
        values[i] =
            m->radix == 1 ? widen(value, m->bits) : unquantise(m->radix, digits[i], m->bits, value);
    }
    const uint8_t *v = values;
    for (unsigned s = 0; s < m->subsets; s++, v += 2 * m->channels)
        for (unsigned end = 0; end < 2; end++)
            for (unsigned c = 0; c < 4; c++)
                ends[s][end][c] = m->channels == 2  ? v[2 * (c / 3) + end]
                                  : c < m->channels ? v[2 * c + end]
                                                    : 255;
}

// The first texel of each subset lacks the top bit of its weights.
static void read_weights(
    struct bits *b, const struct mode *m, const uint8_t subset[16], uint8_t weights[16][2])
{
    unsigned seen = 0;
    for (unsigned i = 0; i < 16; i++) {
        const bool first = !(seen >> subset[i] & 1);
        seen |= 1u << subset[i];
        for (unsigned p = 0; p < m->planes; p++) {
            const unsigned value = take(b, m->weight_bits - first);
            unsigned w = value << (6 - m->weight_bits);
            for (unsigned n = m->weight_bits; n < 6; n *= 2)
                w |= w >> n;
            weights[i][p] = (uint8_t)(w > 32 ? w + 1 : w);
        }
    }
}

// As ASTC's "weight application": end points of sRGB colours are widened to the middle of their
// step, all others, alpha always, by themselves.
static uint8_t mix(uint8_t low, uint8_t high, unsigned weight, bool srgb)
{
    const unsigned l = (unsigned)low << 8 | (srgb ? 0x80u : low);
    const unsigned h = (unsigned)high << 8 | (srgb ? 0x80u : high);
    return (uint8_t)((l * (64 - weight) + h * weight + 32) >> 14);
}

static void fill(uint8_t texels[16][4], const uint8_t colour[4])
{
    for (unsigned i = 0; i < 16; i++)
        memcpy(texels[i], colour, 4);
}

void hg_uastc_decode(const uint8_t block[HG_UASTC_BLOCK_BYTES], bool srgb, uint8_t texels[16][4])
{
    static const uint8_t error_colour[4] = {255, 0, 255, 255};
    struct bits b = {0, 0};
    for (unsigned i = 0; i < 8; i++) {
        b.low |= (uint64_t)block[i] << 8 * i;
        b.high |= (uint64_t)block[8 + i] << 8 * i;
    }
    unsigned index;
    const struct mode *m = read_mode(&b, &index);
    if (m == NULL) {
        fill(texels, error_colour);
        return;
    }
    if (index == SOLID) {
        uint8_t colour[4];
        for (unsigned c = 0; c < 4; c++)
            colour[c] = (uint8_t)take(&b, 8);
        fill(texels, colour);
        return;
    }
    uint8_t subset[16], ends[3][2][4], weights[16][2];
    take(&b, m->hint_bits);
    if (!read_subsets(&b, m, index, subset)) {
        fill(texels, error_colour);
        return;
    }
    const unsigned second = m->selector_bits ? take(&b, m->selector_bits) : m->planes == 2 ? 3 : 4;
    read_ends(&b, m, ends);
    read_weights(&b, m, subset, weights);
    for (unsigned i = 0; i < 16; i++)
        for (unsigned c = 0; c < 4; c++)
            texels[i][c] = mix(ends[subset[i]][0][c], ends[subset[i]][1][c],
                weights[i][c == second], srgb && c < 3);
}
