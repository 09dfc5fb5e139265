// huffman.h - bits and canonical Huffman codes of BasisLZ.
// Floor 1, private to renderer/image. A reader belongs to one thread; tables are read by any.
// Source: KTX File Format Specification 2.0, appendix "BasisLZ/ETC1S", "Compressed Huffman Tables";
// codes as in RFC 1951, section 3.2.2.
#ifndef HG_RENDERER_IMAGE_KTX2_HUFFMAN_H
#define HG_RENDERER_IMAGE_KTX2_HUFFMAN_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "base/status.h"

// Bits from the lowest of each byte. Past the end `failed` is set and bits are 0.
struct hg_bits {
    const uint8_t *data;
    size_t size, at; // bytes
    uint64_t held;
    unsigned count; // bits held
    bool failed;
};

struct hg_bits hg_bits_make(const uint8_t *data, size_t size);
unsigned hg_bits_take(struct hg_bits *bits, unsigned count); // 0..16

enum { HG_HUFFMAN_SYMBOLS = 1 << 14, HG_HUFFMAN_LENGTH = 16 };

// Zeroed: no symbols, every decode fails.
struct hg_huffman {
    uint16_t *symbols;                     // by length, then by value; owned
    uint16_t count[HG_HUFFMAN_LENGTH + 1]; // of each length
};

enum hg_status hg_huffman_read(struct hg_huffman *table, struct hg_bits *bits) HG_MUST_CHECK;
void hg_huffman_finish(struct hg_huffman *table);
// The next symbol; 0 and bits->failed when there is none of that code.
unsigned hg_huffman_decode(const struct hg_huffman *table, struct hg_bits *bits);

#endif
