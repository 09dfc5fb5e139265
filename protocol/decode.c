// Payload bytes to struct, driven by the layouts.
#include <assert.h>
#include <stdio.h>
#include <string.h>

#include "base/checked.h"
#include "base/utf8.h"
#include "protocol/layout.h"

struct decoder {
    struct hg_reader *r;
    uint16_t version;
    struct hg_arena *arena;
    struct hgp_fault *fault;
    const char *wanted; // a field of the message itself; NULL: none
    size_t wanted_at;   // where it begins; SIZE_MAX: it has not been met
};

static enum hg_status decode_layout(
    struct decoder *d, const struct hgp_layout *layout, const struct hgp_place *place, void *out);

static enum hg_status truncated(struct decoder *d, uint64_t offset)
{
    return hgp_fault_set(
        d->fault, HG_E_TRUNCATED, NULL, NULL, offset, "the payload ends inside the message");
}

// Reads a number, vector or hash; rules are checked by the caller.
static void read_fixed(struct hg_reader *r, enum hgp_kind kind, void *member)
{
    uint32_t value;
    const uint8_t *bytes;
    switch (kind) {
    case HGP_K_U8:
        *(uint8_t *)member = hg_read_u8(r);
        break;
    case HGP_K_U16:
        *(uint16_t *)member = hg_read_u16(r);
        break;
    case HGP_K_U32:
        *(uint32_t *)member = hg_read_u32(r);
        break;
    case HGP_K_U64:
        *(uint64_t *)member = hg_read_u64(r);
        break;
    case HGP_K_I32:
        *(int32_t *)member = (int32_t)hg_read_u32(r);
        break;
    case HGP_K_F32:
        *(float *)member = hg_read_f32(r);
        break;
    case HGP_K_F64:
        *(double *)member = hg_read_f64(r);
        break;
    case HGP_K_ENUM:
        value = hg_read_u16(r);
        memcpy(member, &value, sizeof value);
        break;
    case HGP_K_HASH:
        bytes = hg_read_bytes(r, 32);
        if (bytes)
            memcpy(member, bytes, 32);
        break;
    default:
        for (size_t i = 0, n = hgp_kind_floats(kind); i < n; i++)
            ((float *)member)[i] = hg_read_f32(r);
    }
}

static enum hg_status decode_bool(struct decoder *d, char reason[HGP_REASON_BYTES], void *member)
{
    uint8_t byte = hg_read_u8(d->r);
    *(bool *)member = byte == 1;
    if (byte <= 1)
        return HG_OK;
    snprintf(reason, HGP_REASON_BYTES, "%u is no bool, which is 0 or 1", byte);
    return HG_E_FORMAT;
}

static enum hg_status decode_view(
    struct decoder *d, const struct hgp_field *field, char reason[HGP_REASON_BYTES], void *member)
{
    uint32_t size = hg_read_u32(d->r);
    enum hg_status status = hgp_check_size(field, size, reason);
    if (status)
        return status;
    const uint8_t *data = hg_read_bytes(d->r, size);
    if (!data)
        return HG_OK; // the reader's failure is reported as a truncation
    if (field->kind == HGP_K_BYTES) {
        *(struct hgp_bytes *)member = (struct hgp_bytes){data, size};
        return HG_OK;
    }
    *(struct hgp_str *)member = (struct hgp_str){(const char *)data, size};
    if (hg_utf8_is_valid((const char *)data, size))
        return HG_OK;
    snprintf(reason, HGP_REASON_BYTES, "not UTF-8 without NUL");
    return HG_E_FORMAT;
}

static enum hg_status decode_items(struct decoder *d, const struct hgp_field *field,
    const struct hgp_place *place, uint32_t count, void *member)
{
    const struct hgp_layout *layout = field->limit.list.items();
    assert(d->arena);
    unsigned char *items = hg_arena_alloc(d->arena, count, layout->struct_size);
    if (!items)
        return hgp_fault_set(d->fault, HG_E_NOMEM, place, field->name, d->r->pos, "no memory");
    for (uint32_t i = 0; i < count; i++) {
        struct hgp_place item = {place, field->name, i};
        enum hg_status status = decode_layout(d, layout, &item, items + i * layout->struct_size);
        if (status)
            return status;
    }
    struct hgp_any_list list = {items, count};
    memcpy(member, &list, sizeof list);
    return HG_OK;
}

static enum hg_status decode_list(
    struct decoder *d, const struct hgp_field *field, const struct hgp_place *place, void *member)
{
    size_t at = d->r->pos;
    uint32_t count = hg_read_u32(d->r);
    char reason[HGP_REASON_BYTES];
    enum hg_status status = hgp_check_size(field, count, reason);
    if (status)
        return hgp_fault_set(d->fault, status, place, field->name, at, reason);
    // Memory is only taken for items whose bytes are really there.
    size_t need, least = hgp_layout_least_bytes(field->limit.list.items(), d->version);
    if (d->r->failed || !hg_mul_size(count, least, &need) || need > d->r->size - d->r->pos)
        return truncated(d, d->r->pos);
    return count ? decode_items(d, field, place, count, member) : HG_OK;
}

static enum hg_status decode_field(
    struct decoder *d, const struct hgp_field *field, const struct hgp_place *place, void *member)
{
    size_t at = d->r->pos;
    char reason[HGP_REASON_BYTES];
    enum hg_status status = HG_OK;
    switch (field->kind) {
    case HGP_K_LIST:
        return decode_list(d, field, place, member);
    case HGP_K_STR:
    case HGP_K_BYTES:
        status = decode_view(d, field, reason, member);
        break;
    case HGP_K_BOOL:
        status = decode_bool(d, reason, member);
        break;
    default:
        read_fixed(d->r, field->kind, member);
        if (!d->r->failed)
            status = hgp_check_value(field, member, reason);
    }
    if (d->r->failed)
        return truncated(d, d->r->pos);
    return status ? hgp_fault_set(d->fault, status, place, field->name, at, reason) : HG_OK;
}

// The second bitmap is left out where the payload ends, and never written as 0.
static enum hg_status decode_bitmap(struct decoder *d, const struct hgp_layout *layout,
    const struct hgp_place *place, unsigned bitmap, uint32_t *bits)
{
    const uint32_t known = hgp_layout_known_bits(layout, bitmap, d->version);
    const size_t at = d->r->pos;
    const bool left_out = bitmap > 0 && d->r->size - at < 4;
    *bits = known && !left_out ? hg_read_u32(d->r) : 0;
    if (d->r->failed)
        return truncated(d, d->r->pos);
    if (bitmap > 0 && known && !left_out && *bits == 0)
        return hgp_fault_set(
            d->fault, HG_E_FORMAT, place, "has", at, "a second bitmap without a field");
    if (*bits & ~known)
        return hgp_fault_set(
            d->fault, HG_E_FORMAT, place, "has", at, "a bit of an unknown optional field is set");
    return HG_OK;
}

static enum hg_status decode_layout(
    struct decoder *d, const struct hgp_layout *layout, const struct hgp_place *place, void *out)
{
    uint32_t bits;
    unsigned optional = 0;
    enum hg_status status = decode_bitmap(d, layout, place, 0, &bits);
    for (size_t i = 0; i < layout->field_count && !status; i++) {
        const struct hgp_field *field = &layout->fields[i];
        bool there = field->since <= d->version;
        if (field->presence == HGP_P_OPT) {
            if (optional == HGP_BITMAP_FIELDS)
                status = decode_bitmap(d, layout, place, 1, &bits);
            there = there && !status && (bits >> optional++ % HGP_BITMAP_FIELDS & 1);
            *((bool *)((char *)out + field->has_offset)) = there;
        }
        if (there && !status && d->wanted && !place && strcmp(d->wanted, field->name) == 0)
            d->wanted_at = d->r->pos;
        if (there && !status)
            status = decode_field(d, field, place, (char *)out + field->offset);
    }
    return status;
}

enum hg_status hgp_layout_decode(const struct hgp_layout *layout, uint16_t version,
    struct hg_reader *payload, struct hg_arena *arena, void *out, struct hgp_fault *fault)
{
    memset(out, 0, layout->struct_size);
    struct decoder d = {.r = payload, .version = version, .arena = arena, .fault = fault};
    enum hg_status status = decode_layout(&d, layout, NULL, out);
    if (!status && payload->pos != payload->size)
        status = hgp_fault_set(
            fault, HG_E_FORMAT, NULL, NULL, payload->pos, "bytes behind the end of the message");
    if (status)
        memset(out, 0, layout->struct_size);
    return status;
}

enum hg_status hgp_decode(uint16_t version, uint16_t type, struct hg_reader payload,
    struct hg_arena *arena, void *out, struct hgp_fault *fault)
{
    const struct hgp_message_info *info = hgp_find(type);
    if (info && info->since > version)
        memset(out, 0, info->struct_size);
    if (!info || info->since > version)
        return hgp_fault_set(fault, HG_E_UNSUPPORTED, NULL, NULL, 0, "unknown message type");
    return hgp_layout_decode(hgp_layout_find(type), version, &payload, arena, out, fault);
}

bool hgp_field_find(
    uint16_t version, uint16_t type, struct hg_reader payload, const char *field, size_t *at)
{
    union hgp_any message;
    struct hg_arena arena = {0};
    const struct hgp_layout *layout = hgp_layout_find(type);
    *at = 0;
    if (!layout)
        return false;
    struct decoder d = {
        .r = &payload, .version = version, .arena = &arena, .wanted = field, .wanted_at = SIZE_MAX};
    const enum hg_status status = decode_layout(&d, layout, NULL, &message);
    hg_arena_finish(&arena);
    if (status || d.wanted_at == SIZE_MAX)
        return false;
    *at = d.wanted_at;
    return true;
}
