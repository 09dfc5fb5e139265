#include "server/worker/view/view_params.h"

#include <math.h>
#include <string.h>

// ---- decoding ----------------------------------------------------------------------------------

// The renderer's enums have the values of the protocol's (renderer/view_params.c).
#define APPLY_U32(field, a)  params->field = message->field
#define APPLY_F32(field, a)  params->field = message->field
#define APPLY_ENUM(field, a) params->field = (HG_VIEW_ENUM_##a)message->field
#define APPLY_VEC3(field, a) memcpy(params->field, message->field, sizeof params->field)
#define APPLY_VEC4(field, a) memcpy(params->field, message->field, sizeof params->field)

void hg_view_params_apply(struct hg_view_params *params, const struct hgp_view_set *message)
{
#define HGP_VIEW_PARAM(kind, field, a, ...)                                                        \
    if (message->has_##field)                                                                      \
        APPLY_##kind(field, a);
#include "protocol/view_params.def"
}

// ---- key ---------------------------------------------------------------------------------------

// The parameters by their place in the key.
static const struct key_part {
    size_t offset;
    enum hgp_kind kind;
    enum hgp_view_key rule;
    uint32_t words;        // of 32 bits
    uint32_t standard_u32; // FILLED
    float standard_f32;
} parts[] = {
#define WORDS_U32            1
#define WORDS_F32            1
#define WORDS_ENUM           1
#define WORDS_VEC3           3
#define WORDS_VEC4           4
#define FILLED_U32(standard) .standard_u32 = standard
#define FILLED_F32(standard) .standard_f32 = standard
#define PART(a_kind, field, a_rule, place, ...)                                                    \
    [place] = {.offset = offsetof(struct hg_view_params, field),                                   \
        .kind = HGP_K_##a_kind,                                                                    \
        .rule = HGP_VIEW_KEY_##a_rule,                                                             \
        .words = WORDS_##a_kind,                                                                   \
        __VA_ARGS__},
#define PART_NONE(kind, field, standard, place)
#define PART_FILLED(kind, field, standard, place)                                                  \
    PART(kind, field, FILLED, place, FILLED_##kind(standard))
#define PART_RAW(kind, field, standard, place)     PART(kind, field, RAW, place)
#define PART_NONZERO(kind, field, standard, place) PART(kind, field, NONZERO, place)
#define PART_SERIES(kind, field, standard, place)  PART(kind, field, SERIES, place)
#define HGP_VIEW_PARAM(kind, field, a, b, standard, unit, mode, key, place, doc)                   \
    PART_##key(kind, field, standard, place)
#include "protocol/view_params.def"
};

static bool is_zero(const struct key_part *part, const void *value)
{
    static const uint32_t zero[4];
    return memcmp(value, zero, 4 * (size_t)part->words) == 0;
}

// Of the parameters that are left out when they are 0, all but the first say which one follows.
static void write_nonzero(struct hg_writer *w, const struct key_part *part, const void *value)
{
    const uint32_t place = (uint32_t)(part - parts);
    if (is_zero(part, value))
        return;
    if (place >= 24)
        hg_write_u32(w, place);
    for (uint32_t i = 0; i < part->words; i++) {
        uint32_t bits;
        memcpy(&bits, (const char *)value + 4 * (size_t)i, sizeof bits);
        hg_write_u32(w, bits);
    }
}

static void write_part(struct hg_writer *w, const struct key_part *part, const void *value)
{
    if (part->rule == HGP_VIEW_KEY_NONZERO) {
        write_nonzero(w, part, value);
        return;
    }
    for (uint32_t i = 0; i < part->words; i++) {
        uint32_t bits;
        memcpy(&bits, (const char *)value + 4 * (size_t)i, sizeof bits);
        if (part->rule == HGP_VIEW_KEY_FILLED && bits == 0 && part->kind == HGP_K_F32)
            memcpy(&bits, &part->standard_f32, sizeof bits);
        else if (part->rule == HGP_VIEW_KEY_FILLED && bits == 0)
            bits = part->standard_u32;
        hg_write_u32(w, bits);
    }
}

void hg_view_params_write_key(
    struct hg_writer *w, const struct hg_view_params *params, const uint8_t after[32])
{
    const bool series = params->denoise == HG_DENOISE_ANIMATION;
    for (size_t i = 0; i < sizeof parts / sizeof *parts; i++) {
        if (parts[i].rule == HGP_VIEW_KEY_SERIES && !series)
            continue;
        write_part(w, &parts[i], (const char *)params + parts[i].offset);
        if (parts[i].rule == HGP_VIEW_KEY_SERIES)
            hg_write_bytes(w, after, 32);
    }
}

// ---- attributes --------------------------------------------------------------------------------

enum when { ALWAYS, PATH, PATH_SET, SHUTTER, FACTOR };

static const struct attribute_row {
    enum hgp_view_param_index param;
    enum when when;
    const char *name;
    size_t offset;
} attribute_rows[] = {
#define HGP_VIEW_ATTRIBUTE(field, when, name)                                                      \
    {HGP_VIEW_##field, when, name, offsetof(struct hg_view_params, field)},
#include "protocol/view_params.def"
};

static bool is_told(const struct hg_view_params *p, enum when when, const void *value)
{
    uint32_t bits;
    memcpy(&bits, value, sizeof bits);
    switch (when) {
    case PATH:
        return p->mode == HG_MODE_PATH;
    case PATH_SET:
        return p->mode == HG_MODE_PATH && bits != 0;
    case SHUTTER:
        return p->shutter_close > p->shutter_open;
    default:
        return true;
    }
}

static void add_attribute(struct hg_view_attributes *out, const struct attribute_row *row)
{
    const struct hgp_view_param *param = &hgp_view_params[row->param];
    const void *value = (const char *)&out->params + row->offset;
    struct hg_image_attribute *a = &out->items[out->count];
    uint32_t whole;
    memcpy(&whole, value, sizeof whole);
    if (!is_told(&out->params, row->when, value))
        return;
    *a = (struct hg_image_attribute){.name = row->name};
    if (row->when == FACTOR) {
        a->type = HG_ATTR_FLOAT;
        a->floats = &out->exposure;
    } else if (param->kind == HGP_K_F32) {
        a->type = HG_ATTR_FLOAT;
        a->floats = value;
    } else if (param->kind == HGP_K_ENUM) {
        hgp_enum_word(param->values, whole, out->words[out->count]);
        a->type = HG_ATTR_STRING;
        a->string = out->words[out->count];
    } else if (param->most > INT32_MAX) {
        a->type = HG_ATTR_COUNT;
        a->count = whole;
    } else {
        a->type = HG_ATTR_INT;
        a->integer = (int)whole;
    }
    out->count++;
}

void hg_view_params_attributes(const struct hg_view_params *params, struct hg_view_attributes *out)
{
    *out = (struct hg_view_attributes){
        .params = hg_view_params_filled(params), .exposure = exp2f(params->exposure_ev)};
    for (size_t i = 0; i < sizeof attribute_rows / sizeof *attribute_rows; i++)
        add_attribute(out, &attribute_rows[i]);
}
