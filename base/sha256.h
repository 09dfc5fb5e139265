// sha256.h - content hashes (FIPS 180-4, computed by OpenSSL's libcrypto).
// Floor 0. Each hasher belongs to one thread.
#ifndef HG_BASE_SHA256_H
#define HG_BASE_SHA256_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "base/status.h"

enum { HG_SHA256_BYTES = 32, HG_SHA256_HEX = 65 };

struct hg_sha256;

struct hg_sha256 *hg_sha256_create(void) HG_MUST_CHECK; // NULL: no memory
void hg_sha256_update(struct hg_sha256 *h, const void *data, size_t size); // appends the bytes
// Writes the digest and destroys the hasher.
void hg_sha256_end(struct hg_sha256 *h, uint8_t digest[HG_SHA256_BYTES]);

// Digest of `size` bytes. HG_E_NOMEM.
enum hg_status hg_sha256(const void *data, size_t size, uint8_t digest[HG_SHA256_BYTES])
    HG_MUST_CHECK;
// 64 lower-case hexadecimal digits, terminated.
void hg_sha256_hex(const uint8_t digest[HG_SHA256_BYTES], char hex[HG_SHA256_HEX]);
// Of lower-case digits: the first `bytes` bytes of a digest; those behind them are 0. False: `text`
// is anything else.
bool hg_sha256_parse(const char *text, size_t bytes, uint8_t digest[HG_SHA256_BYTES]);

#endif
