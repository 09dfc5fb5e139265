// bytes.h - bounds-checked little-endian reading and growing writing.
// Floor 0. One thread at a time. Readers borrow the block; writers own theirs.
#ifndef HG_BASE_BYTES_H
#define HG_BASE_BYTES_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "base/status.h"

// A failed read sets `failed`, returns zero and leaves `pos` at the offending offset;
// all later reads fail too, so a decoder may check once at the end.
struct hg_reader {
    const uint8_t *data;
    size_t size, pos;
    bool failed;
};

static inline struct hg_reader hg_reader_make(const void *data, size_t size)
{
    struct hg_reader r = {(const uint8_t *)data, size, 0, false}; // also valid C++
    return r;
}
// The next value, little-endian; 0 on failure.
uint8_t hg_read_u8(struct hg_reader *r);
uint16_t hg_read_u16(struct hg_reader *r);
uint32_t hg_read_u32(struct hg_reader *r);
uint64_t hg_read_u64(struct hg_reader *r);
float hg_read_f32(struct hg_reader *r);
double hg_read_f64(struct hg_reader *r);
// Borrowed view of `size` bytes, NULL on failure (a view of 0 bytes is non-NULL).
const uint8_t *hg_read_bytes(struct hg_reader *r, size_t size);

// A failed write (no memory, past limit) sets `failed`; later writes do nothing.
struct hg_writer {
    uint8_t *data;
    size_t size, capacity;
    size_t limit_bytes; // 0 = unlimited
    bool failed;
};
// Appends a value, little-endian.
void hg_write_u8(struct hg_writer *w, uint8_t v);
void hg_write_u16(struct hg_writer *w, uint16_t v);
void hg_write_u32(struct hg_writer *w, uint32_t v);
void hg_write_u64(struct hg_writer *w, uint64_t v);
void hg_write_f32(struct hg_writer *w, float v);
void hg_write_f64(struct hg_writer *w, double v);
void hg_write_bytes(struct hg_writer *w, const void *data, size_t size);
// Overwrites 4 bytes at `pos`, which must have been written.
void hg_write_patch_u32(struct hg_writer *w, size_t pos, uint32_t v);
// Before the first write: reserves about `bytes` bytes, spilled to disk when large (spill.h).
void hg_writer_spill(struct hg_writer *w, size_t bytes);
void hg_writer_finish(struct hg_writer *w); // accepts a zeroed one

#endif
