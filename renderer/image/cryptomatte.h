// cryptomatte.h - Cryptomatte: ids, ranks and manifest.
// Floor 1. Pure but for the manifest's memory; any thread.
//
// Of each pixel the heaviest names are kept with their coverage, two in the four channels of a
// layer: CryptoObject00 holds ranks 0 and 1, CryptoObject01 ranks 2 and 3, ...
// Source: Friedman and Jones, "Cryptomatte Specification", version 1.2.0.
#ifndef HG_RENDERER_IMAGE_CRYPTOMATTE_H
#define HG_RENDERER_IMAGE_CRYPTOMATTE_H

#include "base/bytes.h"
#include "base/status.h"

enum {
    HG_CRYPTOMATTE_RANKS = 6, // kept; three layers
    HG_CRYPTOMATTE_MAX_RANKS = 16,
    HG_CRYPTOMATTE_MANIFEST_BYTES = 16 << 20, // a longer one is left out
};

// MurmurHash3_x86_32 with seed 0. Source: Appleby, MurmurHash3 (public domain).
uint32_t hg_cryptomatte_hash(const void *name, size_t size);
// The bits of the id of a hash: one bit of the exponent is turned where it would make a float that
// is not finite or not normalised.
uint32_t hg_cryptomatte_bits(uint32_t hash);
uint32_t hg_cryptomatte_id(const char *name); // bits of the id of a name

// "cryptomatte/1234567/" for a layer such as "CryptoObject": where its metadata stand.
void hg_cryptomatte_prefix(const char *layer, char out[24]);

struct hg_cryptomatte_sample {
    uint32_t id;  // bits of the float; 0 = nothing
    float weight; // >= 0
};

// Sums what is of the same id, sorts by weight (equal ones by id) and writes `ranks` pairs (id,
// coverage) of floats; what is not taken by a name is 0. Nothing (id 0) is left out, weights are
// divided by `total`. `samples` is overwritten.
void hg_cryptomatte_rank(
    struct hg_cryptomatte_sample *samples, uint32_t count, float total, uint32_t ranks, float *out);

// The manifest, {"name":"01234567",...}, sorted by name; a name that comes twice stands once.
// HG_E_LIMIT when it is longer than HG_CRYPTOMATTE_MANIFEST_BYTES; HG_E_NOMEM. Freed with hg_free.
enum hg_status hg_cryptomatte_manifest(
    const char *const *names, uint32_t count, char **out) HG_MUST_CHECK;

#endif
