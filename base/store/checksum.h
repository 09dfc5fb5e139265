// checksum.h - a fast 64-bit checksum against damage (not against forgery).
// Floor 1, private to base/store. Pure.
// Source: Collet, "xxHash fast digest algorithm", XXH64 format specification 0.1.1.
#ifndef HG_BASE_STORE_CHECKSUM_H
#define HG_BASE_STORE_CHECKSUM_H

#include <stddef.h>
#include <stdint.h>

// XXH64 of `size` bytes. Another seed gives another checksum; 0 is that of the specification.
uint64_t hg_store_checksum(const void *data, size_t size, uint64_t seed);

#endif
