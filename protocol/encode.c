// Struct to header and payload bytes, driven by the layouts.
#include <string.h>

#include "base/utf8.h"
#include "protocol/layout.h"

struct encoder {
    struct hg_writer *w;
    uint16_t version;
    size_t start; // of the payload in the writer
    struct hgp_fault *fault;
};

static enum hg_status encode_layout(struct encoder *e, const struct hgp_layout *layout,
    const struct hgp_place *place, const void *in);

// The message breaks one of its own rules. Sizes past their limit are invalid here, too.
static enum hg_status refuse(
    struct encoder *e, const struct hgp_place *place, const char *field, const char *reason)
{
    return hgp_fault_set(e->fault, HG_E_INVAL, place, field, e->w->size - e->start, reason);
}

static void write_fixed(struct hg_writer *w, enum hgp_kind kind, const void *member)
{
    uint32_t value;
    switch (kind) {
    case HGP_K_U8:
        hg_write_u8(w, *(const uint8_t *)member);
        break;
    case HGP_K_BOOL:
        hg_write_u8(w, *(const bool *)member);
        break;
    case HGP_K_U16:
        hg_write_u16(w, *(const uint16_t *)member);
        break;
    case HGP_K_U32:
        hg_write_u32(w, *(const uint32_t *)member);
        break;
    case HGP_K_U64:
        hg_write_u64(w, *(const uint64_t *)member);
        break;
    case HGP_K_I32:
        memcpy(&value, member, sizeof value); // two's complement
        hg_write_u32(w, value);
        break;
    case HGP_K_F32:
        hg_write_f32(w, *(const float *)member);
        break;
    case HGP_K_F64:
        hg_write_f64(w, *(const double *)member);
        break;
    case HGP_K_ENUM:
        memcpy(&value, member, sizeof value);
        hg_write_u16(w, (uint16_t)value);
        break;
    case HGP_K_HASH:
        hg_write_bytes(w, member, 32);
        break;
    default:
        for (size_t i = 0, n = hgp_kind_floats(kind); i < n; i++)
            hg_write_f32(w, ((const float *)member)[i]);
    }
}

static enum hg_status encode_view(struct encoder *e, const struct hgp_field *field,
    const struct hgp_place *place, const void *member)
{
    struct hgp_bytes view;
    if (field->kind == HGP_K_BYTES) {
        view = *(const struct hgp_bytes *)member;
    } else {
        const struct hgp_str *text = member;
        view = (struct hgp_bytes){(const uint8_t *)text->data, text->size};
    }
    char reason[HGP_REASON_BYTES];
    if (hgp_check_size(field, view.size, reason))
        return refuse(e, place, field->name, reason);
    if (field->kind == HGP_K_STR && !hg_utf8_is_valid((const char *)view.data, view.size))
        return refuse(e, place, field->name, "not UTF-8 without NUL");
    hg_write_u32(e->w, view.size);
    hg_write_bytes(e->w, view.data, view.size);
    return HG_OK;
}

static enum hg_status encode_list(struct encoder *e, const struct hgp_field *field,
    const struct hgp_place *place, const void *member)
{
    struct hgp_any_list list;
    memcpy(&list, member, sizeof list);
    char reason[HGP_REASON_BYTES];
    if (hgp_check_size(field, list.count, reason))
        return refuse(e, place, field->name, reason);
    hg_write_u32(e->w, list.count);
    const struct hgp_layout *layout = field->limit.list.items();
    for (uint32_t i = 0; i < list.count; i++) {
        struct hgp_place item = {place, field->name, i};
        enum hg_status status =
            encode_layout(e, layout, &item, (const char *)list.items + i * layout->struct_size);
        if (status)
            return status;
    }
    return HG_OK;
}

static enum hg_status encode_field(struct encoder *e, const struct hgp_field *field,
    const struct hgp_place *place, const void *member)
{
    char reason[HGP_REASON_BYTES];
    switch (field->kind) {
    case HGP_K_LIST:
        return encode_list(e, field, place, member);
    case HGP_K_STR:
    case HGP_K_BYTES:
        return encode_view(e, field, place, member);
    case HGP_K_BOOL:
    case HGP_K_HASH:
        break;
    default:
        if (hgp_check_value(field, member, reason))
            return refuse(e, place, field->name, reason);
    }
    write_fixed(e->w, field->kind, member);
    return HG_OK;
}

static bool is_there(const struct hgp_field *field, uint16_t version, const void *in)
{
    if (field->since > version)
        return false;
    return field->presence == HGP_P_REQ || *(const bool *)((const char *)in + field->has_offset);
}

// The second bitmap only when a field of it is there.
static void write_bitmap(
    struct encoder *e, const struct hgp_layout *layout, unsigned bitmap, const void *in)
{
    uint32_t bits = 0;
    unsigned optional = 0;
    for (size_t i = 0; i < layout->field_count; i++) {
        const struct hgp_field *field = &layout->fields[i];
        if (field->presence != HGP_P_OPT)
            continue;
        if (optional / HGP_BITMAP_FIELDS == bitmap && is_there(field, e->version, in))
            bits |= 1u << optional % HGP_BITMAP_FIELDS;
        optional++;
    }
    if (bitmap == 0 ? hgp_layout_known_bits(layout, 0, e->version) != 0 : bits != 0)
        hg_write_u32(e->w, bits);
}

static enum hg_status encode_layout(struct encoder *e, const struct hgp_layout *layout,
    const struct hgp_place *place, const void *in)
{
    unsigned optional = 0;
    write_bitmap(e, layout, 0, in);
    for (size_t i = 0; i < layout->field_count; i++) {
        const struct hgp_field *field = &layout->fields[i];
        if (field->presence == HGP_P_OPT && optional++ == HGP_BITMAP_FIELDS)
            write_bitmap(e, layout, 1, in);
        if (!is_there(field, e->version, in))
            continue;
        enum hg_status status = encode_field(e, field, place, (const char *)in + field->offset);
        if (status)
            return status;
    }
    return HG_OK;
}

enum hg_status hgp_layout_encode(const struct hgp_layout *layout, uint16_t version,
    struct hg_writer *w, const void *message, struct hgp_fault *fault)
{
    struct encoder e = {w, version, w->size, fault};
    enum hg_status status = encode_layout(&e, layout, NULL, message);
    if (!status && w->failed)
        status = hgp_fault_set(fault, HG_E_NOMEM, NULL, NULL, 0, "the writer cannot grow");
    if (!status && w->size - e.start > UINT32_MAX)
        status = hgp_fault_set(fault, HG_E_INVAL, NULL, NULL, 0, "the payload is too long");
    return status;
}

enum hg_status hgp_encode(struct hg_writer *w, uint16_t version, struct hgp_envelope envelope,
    const void *message, struct hgp_fault *fault)
{
    const uint16_t type = (uint16_t)envelope.type;
    const struct hgp_message_info *info = hgp_find(type);
    if (!info || info->since > version)
        return hgp_fault_set(fault, HG_E_UNSUPPORTED, NULL, NULL, 0, "unknown message type");
    if (w->failed)
        return hgp_fault_set(fault, HG_E_NOMEM, NULL, NULL, 0, "the writer cannot grow");
    size_t start = w->size;
    uint8_t header[HGP_HEADER_BYTES];
    hgp_header_encode(
        &(struct hgp_header){
            .type = type, .request = envelope.request, .channel = envelope.channel},
        header);
    hg_write_bytes(w, header, sizeof header);
    enum hg_status status = hgp_layout_encode(hgp_layout_find(type), version, w, message, fault);
    if (status) {
        w->size = start;
        w->failed = false;
        return status;
    }
    hg_write_patch_u32(w, start, (uint32_t)(w->size - start - HGP_HEADER_BYTES));
    return HG_OK;
}
