// hash.h - numbers that tell whether something is what it was: keys and signatures.
// Floor 0. Detects changes; not collision-resistant against an attacker (sha256.h is).
#ifndef HG_BASE_HASH_H
#define HG_BASE_HASH_H

#include <stddef.h>
#include <stdint.h>
#include <string.h>

// Adds 8 bytes to h; the order counts. Sources: Knuth, "The Art of Computer Programming" 3, 6.4
// (multiplying by the golden ratio); Stafford 2011, "Better Bit Mixing" (finaliser 13).
static inline uint64_t hg_hash_mix(uint64_t h, uint64_t v)
{
    h = (h ^ v) * UINT64_C(0x9e3779b97f4a7c15);
    h ^= h >> 32;
    h *= UINT64_C(0xbf58476d1ce4e5b9);
    return h ^ h >> 29;
}

// Adds `size` bytes, 8 at a time; the last ones are filled up with 0.
static inline uint64_t hg_hash_mix_bytes(uint64_t h, const void *bytes, size_t size)
{
    const uint8_t *at = bytes;
    uint64_t word;
    for (; size >= sizeof word; at += sizeof word, size -= sizeof word) {
        memcpy(&word, at, sizeof word);
        h = hg_hash_mix(h, word);
    }
    if (size == 0)
        return h;
    word = 0;
    memcpy(&word, at, size);
    return hg_hash_mix(h, word);
}

#endif
