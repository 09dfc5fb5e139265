// The rules a value must obey, whether it is read or written.
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

static enum hg_status out_of_range(bool below, const char **reason)
{
    *reason = below ? "less than its least value" : "greater than its greatest value";
    return HG_E_INVAL;
}

static enum hg_status check_float(const struct hgp_field *field, double value, const char **reason)
{
    if (!isfinite(value)) {
        *reason = "not a finite number";
        return HG_E_INVAL;
    }
    if (value < field->limit.f.least || value > field->limit.f.most)
        return out_of_range(value < field->limit.f.least, reason);
    return HG_OK;
}

static enum hg_status check_enum(
    const struct hgp_field *field, const void *member, const char **reason)
{
    uint32_t value;
    memcpy(&value, member, sizeof value);
    const struct hgp_enum_table *table = field->limit.values;
    for (size_t i = 0; i < table->count; i++)
        if (table->values[i].value == value)
            return HG_OK;
    *reason = "not a value of its enum";
    return HG_E_INVAL;
}

static enum hg_status check_vector(const float *values, size_t count, const char **reason)
{
    for (size_t i = 0; i < count; i++)
        if (!isfinite(values[i])) {
            *reason = "not a finite number";
            return HG_E_INVAL;
        }
    return HG_OK;
}

enum hg_status hgp_check_value(
    const struct hgp_field *field, const void *member, const char **reason)
{
    switch (field->kind) {
    case HGP_K_U8:
    case HGP_K_U16:
    case HGP_K_U32:
    case HGP_K_U64: {
        uint64_t v = load_unsigned(field, member);
        if (v < field->limit.u.least || v > field->limit.u.most)
            return out_of_range(v < field->limit.u.least, reason);
        return HG_OK;
    }
    case HGP_K_I32: {
        int32_t v = *(const int32_t *)member;
        if (v < field->limit.i.least || v > field->limit.i.most)
            return out_of_range(v < field->limit.i.least, reason);
        return HG_OK;
    }
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

enum hg_status hgp_check_size(const struct hgp_field *field, uint32_t size, const char **reason)
{
    bool list = field->kind == HGP_K_LIST;
    if (size <= (list ? field->limit.list.max_count : field->limit.max_bytes))
        return HG_OK;
    *reason = list ? "more items than allowed" : "longer than allowed";
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
    *fault = (struct hgp_fault){.offset = offset, .reason = reason};
    if (field) {
        size_t used = append_place(fault->field, sizeof fault->field, place);
        append(fault->field, sizeof fault->field, used, field);
    }
    return status;
}
