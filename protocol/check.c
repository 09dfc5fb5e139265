// The rules a value must obey, whether it is read or written.
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "protocol/layout.h"

static uint64_t load_unsigned(const struct hgp_field *field, const void *member)
{
    switch (field->kind) {
    case HGP_K_U8:
        return *(const uint8_t *)member;
    case HGP_K_U16:
        return *(const uint16_t *)member;
    case HGP_K_U32:
        return *(const uint32_t *)member;
    default:
        return *(const uint64_t *)member;
    }
}

static enum hg_status check_unsigned(
    const struct hgp_field *field, uint64_t value, char reason[HGP_REASON_BYTES])
{
    const uint64_t least = field->limit.u.least, most = field->limit.u.most;
    if (value >= least && value <= most)
        return HG_OK;
    snprintf(reason, HGP_REASON_BYTES, "%" PRIu64 " is outside of %" PRIu64 " to %" PRIu64, value,
        least, most);
    return HG_E_INVAL;
}

static enum hg_status check_signed(
    const struct hgp_field *field, int32_t value, char reason[HGP_REASON_BYTES])
{
    const int64_t least = field->limit.i.least, most = field->limit.i.most;
    if (value >= least && value <= most)
        return HG_OK;
    snprintf(reason, HGP_REASON_BYTES, "%" PRId32 " is outside of %" PRId64 " to %" PRId64, value,
        least, most);
    return HG_E_INVAL;
}

static enum hg_status check_finite(double value, char reason[HGP_REASON_BYTES])
{
    if (isfinite(value))
        return HG_OK;
    snprintf(reason, HGP_REASON_BYTES, "%g is not a finite number", value);
    return HG_E_INVAL;
}

static enum hg_status check_float(
    const struct hgp_field *field, double value, char reason[HGP_REASON_BYTES])
{
    const double least = field->limit.f.least, most = field->limit.f.most;
    if (check_finite(value, reason))
        return HG_E_INVAL;
    if (value >= least && value <= most)
        return HG_OK;
    snprintf(reason, HGP_REASON_BYTES, "%.9g is outside of %g to %g", value, least, most);
    return HG_E_INVAL;
}

static enum hg_status check_enum(
    const struct hgp_field *field, const void *member, char reason[HGP_REASON_BYTES])
{
    uint32_t value;
    memcpy(&value, member, sizeof value);
    const struct hgp_enum_table *table = field->limit.values;
    for (size_t i = 0; i < table->count; i++)
        if (table->values[i].value == value)
            return HG_OK;
    snprintf(reason, HGP_REASON_BYTES, "%" PRIu32 " is not a value of %s", value, table->name);
    return HG_E_INVAL;
}

static enum hg_status check_vector(const float *values, size_t count, char reason[HGP_REASON_BYTES])
{
    for (size_t i = 0; i < count; i++)
        if (check_finite((double)values[i], reason))
            return HG_E_INVAL;
    return HG_OK;
}

enum hg_status hgp_check_value(
    const struct hgp_field *field, const void *member, char reason[HGP_REASON_BYTES])
{
    switch (field->kind) {
    case HGP_K_U8:
    case HGP_K_U16:
    case HGP_K_U32:
    case HGP_K_U64:
        return check_unsigned(field, load_unsigned(field, member), reason);
    case HGP_K_I32:
        return check_signed(field, *(const int32_t *)member, reason);
    case HGP_K_F32:
        return check_float(field, (double)*(const float *)member, reason);
    case HGP_K_F64:
        return check_float(field, *(const double *)member, reason);
    case HGP_K_ENUM:
        return check_enum(field, member, reason);
    default:
        return check_vector(member, hgp_kind_floats(field->kind), reason);
    }
}

enum hg_status hgp_check_size(
    const struct hgp_field *field, uint32_t size, char reason[HGP_REASON_BYTES])
{
    const bool list = field->kind == HGP_K_LIST;
    const uint32_t most = list ? field->limit.list.max_count : field->limit.max_bytes;
    if (size <= most)
        return HG_OK;
    snprintf(reason, HGP_REASON_BYTES, "%" PRIu32 " %s are more than %" PRIu32, size,
        list ? "items" : "bytes", most);
    return HG_E_LIMIT;
}

size_t hgp_kind_floats(enum hgp_kind kind)
{
    switch (kind) {
    case HGP_K_VEC2:
        return 2;
    case HGP_K_VEC3:
        return 3;
    case HGP_K_VEC4:
        return 4;
    case HGP_K_MAT4:
        return 16;
    default:
        return 0;
    }
}

// Appends to `dst`, cutting what does not fit.
static size_t append(char *dst, size_t size, size_t used, const char *text)
{
    int n = snprintf(dst + used, size - used, "%s", text);
    used += (size_t)n;
    return used < size ? used : size - 1;
}

static size_t append_place(char *dst, size_t size, const struct hgp_place *place)
{
    if (!place)
        return 0;
    char index[16];
    snprintf(index, sizeof index, "[%u].", place->index);
    size_t used = append_place(dst, size, place->outer);
    used = append(dst, size, used, place->list);
    return append(dst, size, used, index);
}

enum hg_status hgp_fault_set(struct hgp_fault *fault, enum hg_status status,
    const struct hgp_place *place, const char *field, uint64_t offset, const char *reason)
{
    if (!fault)
        return status;
    *fault = (struct hgp_fault){.offset = offset};
    append(fault->reason, sizeof fault->reason, 0, reason ? reason : "");
    if (field) {
        size_t used = append_place(fault->field, sizeof fault->field, place);
        append(fault->field, sizeof fault->field, used, field);
    }
    return status;
}
