// crc32c.h - CRC-32C, a checksum against damage (not against forgery).
// Floor 0. Pure. Source: Castagnoli et al. 1993; the reflected polynomial 0x82f63b78 of RFC 3720.
#ifndef HG_BASE_CRC32C_H
#define HG_BASE_CRC32C_H

#include <stddef.h>
#include <stdint.h>

// Of what came before, with checksum `crc` (0: nothing), and `size` bytes more.
uint32_t hg_crc32c(uint32_t crc, const void *data, size_t size);

#endif
