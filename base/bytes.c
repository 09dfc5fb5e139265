#include "base/bytes.h"

#include <assert.h>
#include <string.h>

#include "base/alloc.h"
#include "base/checked.h"
#include "base/spill.h"

const uint8_t *hg_read_bytes(struct hg_reader *r, size_t size)
{
    if (r->failed || !hg_range_ok(r->pos, size, r->size)) {
        r->failed = true;
        return NULL;
    }
    static const uint8_t empty;
    const uint8_t *view = r->data ? r->data + r->pos : &empty;
    r->pos += size;
    return view;
}

static uint64_t read_le(struct hg_reader *r, size_t size)
{
    const uint8_t *p = hg_read_bytes(r, size);
    uint64_t v = 0;
    for (size_t i = 0; p && i < size; i++)
        v |= (uint64_t)p[i] << (8 * i);
    return v;
}

uint8_t hg_read_u8(struct hg_reader *r)
{
    return (uint8_t)read_le(r, 1);
}

uint16_t hg_read_u16(struct hg_reader *r)
{
    return (uint16_t)read_le(r, 2);
}

uint32_t hg_read_u32(struct hg_reader *r)
{
    return (uint32_t)read_le(r, 4);
}

uint64_t hg_read_u64(struct hg_reader *r)
{
    return read_le(r, 8);
}

float hg_read_f32(struct hg_reader *r)
{
    uint32_t bits = hg_read_u32(r);
    float v;
    memcpy(&v, &bits, sizeof v);
    return v;
}

double hg_read_f64(struct hg_reader *r)
{
    uint64_t bits = hg_read_u64(r);
    double v;
    memcpy(&v, &bits, sizeof v);
    return v;
}

void hg_write_bytes(struct hg_writer *w, const void *data, size_t size)
{
    size_t need;
    if (w->failed || size == 0)
        return;
    if (!hg_add_size(w->size, size, &need) || (w->limit_bytes && need > w->limit_bytes) ||
        hg_grow(&w->data, &w->capacity, need, 1) != HG_OK) {
        w->failed = true;
        return;
    }
    memcpy(w->data + w->size, data, size);
    w->size = need;
}

static void write_le(struct hg_writer *w, uint64_t v, size_t size)
{
    uint8_t bytes[8];
    for (size_t i = 0; i < size; i++)
        bytes[i] = (uint8_t)(v >> (8 * i));
    hg_write_bytes(w, bytes, size);
}

void hg_write_u8(struct hg_writer *w, uint8_t v)
{
    write_le(w, v, 1);
}

void hg_write_u16(struct hg_writer *w, uint16_t v)
{
    write_le(w, v, 2);
}

void hg_write_u32(struct hg_writer *w, uint32_t v)
{
    write_le(w, v, 4);
}

void hg_write_u64(struct hg_writer *w, uint64_t v)
{
    write_le(w, v, 8);
}

void hg_write_f32(struct hg_writer *w, float v)
{
    uint32_t bits;
    memcpy(&bits, &v, sizeof bits);
    write_le(w, bits, 4);
}

void hg_write_f64(struct hg_writer *w, double v)
{
    uint64_t bits;
    memcpy(&bits, &v, sizeof bits);
    write_le(w, bits, 8);
}

void hg_write_patch_u32(struct hg_writer *w, size_t pos, uint32_t v)
{
    if (w->failed)
        return;
    assert(hg_range_ok(pos, 4, w->size));
    for (size_t i = 0; i < 4; i++)
        w->data[pos + i] = (uint8_t)(v >> (8 * i));
}

void hg_writer_spill(struct hg_writer *w, size_t bytes)
{
    if (bytes < HG_SPILL_SCRATCH_BYTES || w->data || (w->limit_bytes && bytes > w->limit_bytes))
        return;
    w->data = hg_spill_calloc(bytes, 1);
    w->capacity = w->data ? bytes : 0;
}

void hg_writer_finish(struct hg_writer *w)
{
    hg_free(w->data);
    *w = (struct hg_writer){0};
}
