// sample.h - messages made from the codec's tables, for vectors, tests and fuzz corpora.
// Test code. Floor 1. One thread.
#ifndef HG_TESTS_WIRE_SAMPLE_H
#define HG_TESTS_WIRE_SAMPLE_H

#include "protocol/layout.h"

enum sample_variant {
    SAMPLE_FULL, // every field there, values derived from the names, two items per list
    SAMPLE_BARE, // no OPT field, least values, empty strings and lists
    SAMPLE_MOST, // every field there, greatest values, one item per list
    SAMPLE_VARIANTS
};

extern const char *const sample_variant_names[SAMPLE_VARIANTS];

// Fills *out (layout->struct_size bytes); views live in `arena`.
void sample_fill(const struct hgp_layout *layout, enum sample_variant variant,
    struct hg_arena *arena, void *out);

// One JSON object of the fields that are there: u64 as decimal strings, enums by name, BYTES and
// HASH in hexadecimal.
void sample_dump(const struct hgp_layout *layout, const void *message, struct hg_writer *text);

void sample_hex(const uint8_t *data, size_t size, struct hg_writer *text);
void sample_text(struct hg_writer *text, const char *fmt, ...) HG_PRINTF(2, 3);

// Where a field lies in an encoded payload.
struct sample_spot {
    char path[64];                 // as hgp_fault.field; "has" for a bitmap
    const struct hgp_field *field; // NULL for a bitmap
    uint32_t known_bits;           // of a bitmap
    unsigned bitmap;               // its number
    size_t offset, size;           // of the value; STR, BYTES, LIST: of the u32 in front
};

// Lists the spots of a payload that decodes. Returns their number; 0 when it does not fit `max`.
size_t sample_spots(const struct hgp_layout *layout, const uint8_t *payload, size_t size,
    struct sample_spot *spots, size_t max);

#endif
