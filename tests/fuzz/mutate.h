// mutate.h - deterministic damage to bytes. Test code. One thread per random state.
#ifndef HG_TESTS_FUZZ_MUTATE_H
#define HG_TESTS_FUZZ_MUTATE_H

#include <stddef.h>
#include <stdint.h>

// xorshift64* (Vigna 2016): small, and the same everywhere.
struct fuzz_random {
    uint64_t state; // not 0
};

// The same every time, unless $HELIO_FUZZ_SEED holds another number than 0.
struct fuzz_random fuzz_random_start(void);
uint64_t fuzz_u64(struct fuzz_random *random);
// 0 .. n - 1; 0 when n is 0.
size_t fuzz_below(struct fuzz_random *random, size_t n);

struct fuzz_piece {
    const uint8_t *data;
    size_t size;
};

// Makes 1 to 4 edits: flipped bits, other bytes, numbers at their limits, cuts, and insertions from
// `piece`. `data` has room for `capacity` bytes. Returns the new size.
size_t fuzz_mutate(struct fuzz_random *random, uint8_t *data, size_t size, size_t capacity,
    const struct fuzz_piece *piece);

#endif
