// What surrounds the codec: headers, merging, names of enum values, facts about layouts.
#include "protocol/hgp.h"

#include <ctype.h>
#include <string.h>

#include "base/utf8.h"
#include "protocol/layout.h"

enum hg_status hgp_header_decode(
    const uint8_t *data, size_t size, uint32_t limit, struct hgp_header *out)
{
    *out = (struct hgp_header){0};
    struct hg_reader r = hg_reader_make(data, size);
    struct hgp_header header = {0};
    header.length = hg_read_u32(&r);
    header.type = hg_read_u16(&r);
    header.flags = hg_read_u16(&r);
    header.request = hg_read_u32(&r);
    header.channel = hg_read_u32(&r);
    if (r.failed)
        return HG_E_TRUNCATED;
    if (header.length > limit)
        return HG_E_LIMIT;
    if (header.flags & ~HGP_FLAG_OPTIONAL)
        return HG_E_FORMAT;
    *out = header;
    return HG_OK;
}

static void put_le(uint8_t *dst, uint32_t value, int bytes)
{
    for (int i = 0; i < bytes; i++)
        dst[i] = (uint8_t)(value >> (8 * i));
}

void hgp_header_encode(const struct hgp_header *header, uint8_t out[HGP_HEADER_BYTES])
{
    put_le(out, header->length, 4);
    put_le(out + 4, header->type, 2);
    put_le(out + 6, header->flags, 2);
    put_le(out + 8, header->request, 4);
    put_le(out + 12, header->channel, 4);
}

void hgp_merge(enum hgp_type type, void *into, const void *from)
{
    const struct hgp_layout *layout = hgp_layout_find((uint16_t)type);
    for (size_t i = 0; layout && i < layout->field_count; i++) {
        const struct hgp_field *field = &layout->fields[i];
        if (field->presence == HGP_P_OPT) {
            if (!*(const bool *)((const char *)from + field->has_offset))
                continue;
            *(bool *)((char *)into + field->has_offset) = true;
        }
        memcpy((char *)into + field->offset, (const char *)from + field->offset, field->size);
    }
}

const char *hgp_enum_name(const char *enum_name, uint32_t value)
{
    const struct hgp_enum_table *table = hgp_enum_find(enum_name);
    for (size_t i = 0; table && i < table->count; i++)
        if (table->values[i].value == value)
            return table->values[i].name;
    return NULL;
}

static int fold(char c)
{
    return c == '-' ? '_' : toupper((unsigned char)c);
}

static bool same_name(const char *a, const char *b)
{
    while (*a && fold(*a) == fold(*b)) {
        a++;
        b++;
    }
    return *a == *b;
}

bool hgp_enum_value(const char *enum_name, const char *value_name, uint32_t *value)
{
    *value = 0;
    const struct hgp_enum_table *table = hgp_enum_find(enum_name);
    for (size_t i = 0; table && i < table->count; i++)
        if (same_name(table->values[i].name, value_name)) {
            *value = table->values[i].value;
            return true;
        }
    return false;
}

struct hgp_str hgp_str_fit(const char *text, uint32_t max_bytes)
{
    if (!text)
        return (struct hgp_str){0};
    size_t left = strnlen(text, max_bytes), size = 0;
    for (size_t n; (n = hg_utf8_sequence(text + size, left - size)); size += n)
        ;
    return (struct hgp_str){text, (uint32_t)size};
}

uint32_t hgp_layout_known_bits(const struct hgp_layout *layout, unsigned bitmap, uint16_t version)
{
    uint32_t known = 0;
    unsigned optional = 0;
    for (size_t i = 0; i < layout->field_count; i++) {
        if (layout->fields[i].presence != HGP_P_OPT)
            continue;
        if (optional / HGP_BITMAP_FIELDS == bitmap && layout->fields[i].since <= version)
            known |= 1u << optional % HGP_BITMAP_FIELDS;
        optional++;
    }
    return known;
}

static size_t least_field_bytes(enum hgp_kind kind)
{
    switch (kind) {
    case HGP_K_U8:
    case HGP_K_BOOL:
        return 1;
    case HGP_K_U16:
    case HGP_K_ENUM:
        return 2;
    case HGP_K_U64:
    case HGP_K_F64:
        return 8;
    case HGP_K_HASH:
        return 32;
    case HGP_K_VEC2:
    case HGP_K_VEC3:
    case HGP_K_VEC4:
    case HGP_K_MAT4:
        return 4 * hgp_kind_floats(kind);
    default: // U32 I32 F32, and the size in front of STR BYTES LIST
        return 4;
    }
}

size_t hgp_layout_least_bytes(const struct hgp_layout *layout, uint16_t version)
{
    size_t bytes = hgp_layout_known_bits(layout, 0, version) ? 4 : 0;
    for (size_t i = 0; i < layout->field_count; i++) {
        const struct hgp_field *field = &layout->fields[i];
        if (field->presence == HGP_P_REQ && field->since <= version)
            bytes += least_field_bytes(field->kind);
    }
    return bytes;
}
