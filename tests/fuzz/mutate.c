#include "tests/fuzz/mutate.h"

#include <stdlib.h>
#include <string.h>

struct fuzz_random fuzz_random_start(void)
{
    const char *seed = getenv("HELIO_FUZZ_SEED");
    struct fuzz_random random = {0x9e3779b97f4a7c15u};
    random.state ^= seed ? strtoull(seed, NULL, 10) * 0xbf58476d1ce4e5b9u : 0;
    random.state += random.state == 0;
    return random;
}

uint64_t fuzz_u64(struct fuzz_random *random)
{
    random->state ^= random->state >> 12;
    random->state ^= random->state << 25;
    random->state ^= random->state >> 27;
    return random->state * 0x2545f4914f6cdd1du;
}

size_t fuzz_below(struct fuzz_random *random, size_t n)
{
    return n ? (size_t)(fuzz_u64(random) % n) : 0;
}

static void put_number(struct fuzz_random *random, uint8_t *data, size_t size)
{
    static const uint64_t numbers[] = {0, 1, 2, 0x7f, 0x80, 0xff, 0x100, 0x7fff, 0x8000, 0xffff,
        0x10000, 0x7fffffff, 0x80000000, 0xffffffff, 0x7fc00000, 0x7f800000, UINT64_MAX};
    static const size_t widths[] = {1, 2, 4, 8};
    uint64_t value = numbers[fuzz_below(random, sizeof numbers / sizeof *numbers)];
    size_t width = widths[fuzz_below(random, 4)];
    size_t at = fuzz_below(random, size);
    for (size_t i = 0; i < width && at + i < size; i++)
        data[at + i] = (uint8_t)(value >> (8 * i));
}

static size_t insert(struct fuzz_random *random, uint8_t *data, size_t size, size_t capacity,
    const struct fuzz_piece *piece)
{
    if (!piece->size)
        return size;
    size_t from = fuzz_below(random, piece->size);
    size_t count = 1 + fuzz_below(random, piece->size - from);
    size_t at = fuzz_below(random, size + 1);
    if (count > capacity - size)
        return size;
    memmove(data + at + count, data + at, size - at);
    memcpy(data + at, piece->data + from, count);
    return size + count;
}

static size_t cut(struct fuzz_random *random, uint8_t *data, size_t size)
{
    size_t at = fuzz_below(random, size), left = size - at;
    size_t count = 1 + fuzz_below(random, left < 64 ? left : 64);
    memmove(data + at, data + at + count, left - count);
    return size - count;
}

size_t fuzz_mutate(struct fuzz_random *random, uint8_t *data, size_t size, size_t capacity,
    const struct fuzz_piece *piece)
{
    for (size_t steps = 1 + fuzz_below(random, 4); steps && size; steps--) {
        switch (fuzz_below(random, 6)) {
        case 0:
            data[fuzz_below(random, size)] ^= (uint8_t)(1u << fuzz_below(random, 8));
            break;
        case 1:
            data[fuzz_below(random, size)] = (uint8_t)fuzz_u64(random);
            break;
        case 2:
        case 3:
            put_number(random, data, size);
            break;
        case 4:
            size = insert(random, data, size, capacity, piece);
            break;
        default:
            size = cut(random, data, size);
        }
    }
    return size;
}
