#include "renderer/image/ktx2/huffman.h"

#include <string.h>

#include "base/alloc.h"

struct hg_bits hg_bits_make(const uint8_t *data, size_t size)
{
    return (struct hg_bits){.data = data, .size = size};
}

unsigned hg_bits_take(struct hg_bits *b, unsigned count)
{
    while (b->count < count && b->at < b->size) {
        b->held |= (uint64_t)b->data[b->at++] << b->count;
        b->count += 8;
    }
    if (b->count < count) {
        b->failed = true;
        b->held = 0;
        b->count = 0;
        return 0;
    }
    const unsigned value = (unsigned)(b->held & ((UINT64_C(1) << count) - 1));
    b->held >>= count;
    b->count -= count;
    return value;
}

// A table from its lengths (0: no such symbol; 1..HG_HUFFMAN_LENGTH), or as BasisLZ stores it.
// HG_E_FORMAT (no code, damaged), HG_E_NOMEM: it is zeroed.
static enum hg_status init_table(
    struct hg_huffman *t, const uint8_t *lengths, unsigned symbol_count)
{
    uint16_t next[HG_HUFFMAN_LENGTH + 1] = {0};
    enum hg_status status = HG_E_FORMAT;
    *t = (struct hg_huffman){0};
    for (unsigned i = 0; i < symbol_count; i++)
        t->count[lengths[i]]++;
    t->count[0] = 0;
    unsigned total = 0, left = 1; // codes of this length that are still free
    for (unsigned n = 1; n <= HG_HUFFMAN_LENGTH; n++) {
        next[n] = (uint16_t)total;
        total += t->count[n];
        left <<= 1;
        if (t->count[n] > left)
            goto fail;
        left -= t->count[n];
    }
    if (total == 0)
        goto fail;
    t->symbols = hg_calloc(total, sizeof *t->symbols);
    if (t->symbols == NULL) {
        status = HG_E_NOMEM;
        goto fail;
    }
    for (unsigned i = 0; i < symbol_count; i++)
        if (lengths[i] > 0)
            t->symbols[next[lengths[i]]++] = (uint16_t)i;
    return HG_OK;
fail:
    *t = (struct hg_huffman){0};
    return status;
}

void hg_huffman_finish(struct hg_huffman *t)
{
    hg_free(t->symbols);
    *t = (struct hg_huffman){0};
}

unsigned hg_huffman_decode(const struct hg_huffman *t, struct hg_bits *b)
{
    unsigned code = 0, first = 0, index = 0;
    for (unsigned n = 1; n <= HG_HUFFMAN_LENGTH && t->symbols != NULL; n++) {
        code |= hg_bits_take(b, 1);
        const unsigned count = t->count[n];
        if (code < first + count)
            return b->failed ? 0 : t->symbols[index + code - first];
        index += count;
        first = (first + count) << 1;
        code <<= 1;
    }
    b->failed = true;
    return 0;
}

// Lengths of symbols, themselves coded. False: damaged.
static bool read_lengths(
    const struct hg_huffman *codes, struct hg_bits *b, uint8_t *lengths, unsigned count)
{
    enum { few_zeros = 17, many_zeros, few_repeats, many_repeats };
    static const uint8_t bits[4] = {3, 7, 2, 7}, least[4] = {3, 11, 3, 7};
    for (unsigned i = 0; i < count;) {
        const unsigned symbol = hg_huffman_decode(codes, b);
        if (b->failed)
            return false;
        if (symbol < few_zeros) {
            lengths[i++] = (uint8_t)symbol;
            continue;
        }
        const unsigned kind = symbol - few_zeros;
        const unsigned run = least[kind] + hg_bits_take(b, bits[kind]);
        const uint8_t value = symbol >= few_repeats && i > 0 ? lengths[i - 1] : 0;
        if (b->failed || run > count - i || (symbol >= few_repeats && value == 0))
            return false;
        memset(lengths + i, value, run);
        i += run;
    }
    return true;
}

enum hg_status hg_huffman_read(struct hg_huffman *t, struct hg_bits *b)
{
    static const uint8_t order[21] = {
        17, 18, 19, 20, 0, 8, 7, 9, 6, 10, 5, 11, 4, 12, 3, 13, 2, 14, 1, 15, 16};
    uint8_t code_lengths[21] = {0};
    *t = (struct hg_huffman){0};
    const unsigned symbol_count = hg_bits_take(b, 14), code_count = hg_bits_take(b, 5);
    if (b->failed || symbol_count == 0 || code_count < 1 || code_count > sizeof order)
        return HG_E_FORMAT;
    for (unsigned i = 0; i < code_count; i++)
        code_lengths[order[i]] = (uint8_t)hg_bits_take(b, 3);
    struct hg_huffman codes;
    enum hg_status status = init_table(&codes, code_lengths, sizeof order);
    uint8_t *lengths = hg_calloc(symbol_count, 1);
    if (lengths == NULL)
        status = HG_E_NOMEM;
    if (status == HG_OK && !read_lengths(&codes, b, lengths, symbol_count))
        status = HG_E_FORMAT;
    if (status == HG_OK)
        status = init_table(t, lengths, symbol_count);
    hg_huffman_finish(&codes);
    hg_free(lengths);
    return status;
}
