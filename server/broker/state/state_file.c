#include "server/broker/state/state_file.h"

#include <string.h>

#include "base/crc32c.h"

static const char magic[8] = {'H', 'E', 'L', 'I', 'O', 'L', 'O', 'G'};

static void put_u32(uint8_t *out, uint32_t value)
{
    for (int i = 0; i < 4; i++)
        out[i] = (uint8_t)(value >> 8 * i);
}

static void make_header(uint8_t out[HG_STATE_HEADER_BYTES], uint32_t version)
{
    memcpy(out, magic, sizeof magic);
    put_u32(out + 8, version);
    put_u32(out + 12, hg_crc32c(0, out, 12));
}

void hg_state_header_encode(uint8_t out[HG_STATE_HEADER_BYTES])
{
    make_header(out, HG_STATE_VERSION);
}

enum hg_status hg_state_header_decode(struct hg_reader *r)
{
    uint8_t expected[HG_STATE_HEADER_BYTES];
    size_t size = r->size - r->pos;
    hg_state_header_encode(expected);
    if (size < sizeof expected)
        return memcmp(r->data + r->pos, expected, size) == 0 ? HG_E_TRUNCATED : HG_E_FORMAT;
    struct hg_reader version = hg_reader_make(r->data + r->pos + 8, 4);
    make_header(expected, hg_read_u32(&version));
    if (memcmp(r->data + r->pos, expected, sizeof expected) != 0)
        return HG_E_FORMAT;
    make_header(expected, HG_STATE_VERSION);
    if (memcmp(r->data + r->pos, expected, sizeof expected) != 0)
        return HG_E_VERSION;
    r->pos += sizeof expected;
    return HG_OK;
}

void hg_state_prefix_encode(uint8_t out[HG_STATE_PREFIX_BYTES], const void *head, size_t head_size,
    const void *rest, size_t rest_size)
{
    put_u32(out, (uint32_t)(head_size + rest_size));
    uint32_t crc = hg_crc32c(hg_crc32c(0, out, 4), head, head_size);
    put_u32(out + 4, rest_size ? hg_crc32c(crc, rest, rest_size) : crc);
}

enum hg_status hg_state_record_next(struct hg_reader *r, const uint8_t **body, size_t *size)
{
    const size_t left = r->size - r->pos;
    *body = NULL;
    *size = 0;
    if (!left)
        return HG_E_AGAIN;
    if (left < HG_STATE_PREFIX_BYTES)
        return HG_E_TRUNCATED;
    struct hg_reader prefix = hg_reader_make(r->data + r->pos, HG_STATE_PREFIX_BYTES);
    uint32_t length = hg_read_u32(&prefix), crc = hg_read_u32(&prefix);
    if (length > HG_STATE_BODY_LIMIT)
        return HG_E_HASH;
    if (length > left - HG_STATE_PREFIX_BYTES)
        return HG_E_TRUNCATED;
    const uint8_t *begin = r->data + r->pos;
    if (hg_crc32c(hg_crc32c(0, begin, 4), begin + HG_STATE_PREFIX_BYTES, length) != crc)
        return HG_E_HASH;
    *body = begin + HG_STATE_PREFIX_BYTES;
    *size = length;
    r->pos += HG_STATE_PREFIX_BYTES + length;
    return HG_OK;
}

bool hg_state_record_is_followed(struct hg_reader r)
{
    const uint8_t *body;
    size_t size;
    if (r.size - r.pos < HG_STATE_PREFIX_BYTES)
        return false;
    struct hg_reader prefix = hg_reader_make(r.data + r.pos, HG_STATE_PREFIX_BYTES);
    const uint32_t length = hg_read_u32(&prefix);
    if (length > r.size - r.pos - HG_STATE_PREFIX_BYTES)
        return false;
    r.pos += HG_STATE_PREFIX_BYTES + length;
    return hg_state_record_next(&r, &body, &size) == HG_OK;
}
