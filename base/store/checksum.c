// checksum.c - see checksum.h.
#include "base/store/checksum.h"

#include <string.h>

static const uint64_t p1 = 0x9e3779b185ebca87u, p2 = 0xc2b2ae3d27d4eb4fu, p3 = 0x165667b19e3779f9u,
                      p4 = 0x85ebca77c2b2ae63u, p5 = 0x27d4eb2f165667c5u;

static inline uint64_t rotate(uint64_t v, int bits)
{
    return v << bits | v >> (64 - bits);
}

static inline uint64_t load64(const uint8_t *p)
{
    uint64_t v;
    memcpy(&v, p, sizeof v);
#if __BYTE_ORDER__ == __ORDER_BIG_ENDIAN__
    v = __builtin_bswap64(v);
#endif
    return v;
}

static inline uint32_t load32(const uint8_t *p)
{
    return (uint32_t)p[0] | (uint32_t)p[1] << 8 | (uint32_t)p[2] << 16 | (uint32_t)p[3] << 24;
}

static inline uint64_t step(uint64_t lane, uint64_t input)
{
    return rotate(lane + input * p2, 31) * p1;
}

static inline uint64_t merge(uint64_t h, uint64_t lane)
{
    return (h ^ step(0, lane)) * p1 + p4;
}

// Whole stripes of 32 bytes in four lanes; advances *p.
static uint64_t digest_stripes(const uint8_t **p, const uint8_t *end, uint64_t seed)
{
    uint64_t a = seed + p1 + p2, b = seed + p2, c = seed, d = seed - p1;
    const uint8_t *at = *p;
    for (; end - at >= 32; at += 32) {
        a = step(a, load64(at));
        b = step(b, load64(at + 8));
        c = step(c, load64(at + 16));
        d = step(d, load64(at + 24));
    }
    *p = at;
    uint64_t h = rotate(a, 1) + rotate(b, 7) + rotate(c, 12) + rotate(d, 18);
    return merge(merge(merge(merge(h, a), b), c), d);
}

uint64_t hg_store_checksum(const void *data, size_t size, uint64_t seed)
{
    const uint8_t *p = data, *end = p + size;
    uint64_t h = size >= 32 ? digest_stripes(&p, end, seed) : seed + p5;
    h += size;
    for (; end - p >= 8; p += 8)
        h = rotate(h ^ step(0, load64(p)), 27) * p1 + p4;
    if (end - p >= 4) {
        h = rotate(h ^ load32(p) * p1, 23) * p2 + p3;
        p += 4;
    }
    for (; p < end; p++)
        h = rotate(h ^ *p * p5, 11) * p1;
    h = (h ^ h >> 33) * p2;
    h = (h ^ h >> 29) * p3;
    return h ^ h >> 32;
}
