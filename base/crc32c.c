#include "base/crc32c.h"

#include <pthread.h>
#include <stdbool.h>
#include <string.h>

enum { POLYNOMIAL = (int)0x82f63b78u, SLICES = 8 };

static uint32_t table[SLICES][256];
static bool has_instruction;
static pthread_once_t once = PTHREAD_ONCE_INIT;

// Slicing by 8 (Kounavis and Berry 2005): table[k][b] is the checksum of b and k zero bytes.
static void fill_table(void)
{
    for (uint32_t i = 0; i < 256; i++) {
        uint32_t crc = i;
        for (int bit = 0; bit < 8; bit++)
            crc = crc >> 1 ^ (crc & 1 ? (uint32_t)POLYNOMIAL : 0);
        table[0][i] = crc;
    }
    for (uint32_t i = 0; i < 256; i++)
        for (int k = 1; k < SLICES; k++)
            table[k][i] = table[k - 1][i] >> 8 ^ table[0][table[k - 1][i] & 0xff];
#ifdef __x86_64__
    has_instruction = __builtin_cpu_supports("sse4.2");
#endif
}

static uint32_t by_table(uint32_t crc, const uint8_t *data, size_t size)
{
    for (; size >= SLICES; data += SLICES, size -= SLICES) {
        uint8_t b[SLICES];
        memcpy(b, data, SLICES);
        for (int i = 0; i < 4; i++)
            b[i] ^= (uint8_t)(crc >> 8 * i);
        crc = 0;
        for (int i = 0; i < SLICES; i++)
            crc ^= table[SLICES - 1 - i][b[i]];
    }
    for (size_t i = 0; i < size; i++)
        crc = crc >> 8 ^ table[0][(crc ^ data[i]) & 0xff];
    return crc;
}

#ifdef __x86_64__
__attribute__((target("sse4.2"))) static uint32_t by_instruction(
    uint32_t crc, const uint8_t *data, size_t size)
{
    uint64_t sum = crc;
    for (; size >= 8; data += 8, size -= 8) {
        uint64_t word;
        memcpy(&word, data, 8);
        sum = __builtin_ia32_crc32di(sum, word);
    }
    crc = (uint32_t)sum;
    for (size_t i = 0; i < size; i++)
        crc = __builtin_ia32_crc32qi(crc, data[i]);
    return crc;
}
#endif

uint32_t hg_crc32c(uint32_t crc, const void *data, size_t size)
{
    pthread_once(&once, fill_table);
#ifdef __x86_64__
    if (has_instruction)
        return ~by_instruction(~crc, data, size);
#endif
    return ~by_table(~crc, data, size);
}
