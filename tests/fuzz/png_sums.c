#include "tests/fuzz/png_sums.h"

#include <string.h>
#include <zlib.h>

#include "tests/fuzz/fuzz.h"

enum { SIGNATURE = 8, HEAD = 8, SUM = 4 }; // bytes of a file, and of a chunk

static uint32_t get_u32(const uint8_t *at)
{
    return (uint32_t)at[0] << 24 | (uint32_t)at[1] << 16 | (uint32_t)at[2] << 8 | at[3];
}

static void put_u32(uint8_t *at, uint32_t value)
{
    for (int i = 0; i < 4; i++)
        at[i] = (uint8_t)(value >> (24 - 8 * i));
}

uint8_t *fuzz_png_sums(const uint8_t *data, size_t size)
{
    uint8_t *copy = malloc(size ? size : 1);
    FUZZ_CHECK(copy);
    if (size)
        memcpy(copy, data, size);
    for (size_t at = SIGNATURE; at < size && size - at >= HEAD + SUM;) {
        const uint32_t length = get_u32(copy + at);
        if (length > size - at - HEAD - SUM)
            break;
        const uLong sum = crc32(crc32(0, NULL, 0), copy + at + 4, length + 4); // with its type
        put_u32(copy + at + HEAD + length, (uint32_t)sum);
        at += HEAD + (size_t)length + SUM;
    }
    return copy;
}
