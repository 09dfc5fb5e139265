// view_params.h - view_params.def as a table of the running program, and its constants.
// Floor 1. Pure; safe from any thread.
#ifndef HG_PROTOCOL_VIEW_PARAMS_H
#define HG_PROTOCOL_VIEW_PARAMS_H

#include "protocol/layout.h"

// Place of each row in hgp_view_params.
enum hgp_view_param_index {
#define HGP_VIEW_PARAM(kind, field, a, b, standard, unit, mode, key, place, doc) HGP_VIEW_##field,
#define HGP_VIEW_DELIVERY(kind, field, a, b, standard, doc)                      HGP_VIEW_##field,
#include "protocol/view_params.def"
    HGP_VIEW_PARAM_COUNT
};

// HGP_COUNT_<enum>: how many values it has; they are 0 .. count - 1.
enum hgp_enum_count {
#define HGP_ENUM(name, since, doc)     HGP_COUNT_##name = 0
#define HGP_VALUE(e, name, value, doc) +1
#define HGP_ENUM_END(name)             ,
#include "protocol/messages.def"
};

// HGP_STANDARD_<field>: the default of whole numbers and of enums.
#define HGP_STANDARD_OF_U8(field, a, standard)   HGP_STANDARD_##field = standard,
#define HGP_STANDARD_OF_U32(field, a, standard)  HGP_STANDARD_##field = standard,
#define HGP_STANDARD_OF_ENUM(field, a, standard) HGP_STANDARD_##field = HGP_##a##_##standard,
#define HGP_STANDARD_OF_F32(field, a, standard)
#define HGP_STANDARD_OF_VEC3(field, a, standard)
#define HGP_STANDARD_OF_VEC4(field, a, standard)
#define HGP_STANDARD_OF_BYTES(field, a, standard)
enum hgp_view_standard {
#define HGP_VIEW_PARAM(kind, field, a, b, standard, unit, mode, key, place, doc)                   \
    HGP_STANDARD_OF_##kind(field, a, standard)
#define HGP_VIEW_DELIVERY(kind, field, a, b, standard, doc)                                        \
    HGP_STANDARD_OF_##kind(field, a, standard)
#include "protocol/view_params.def"
};

enum hgp_view_key {
    HGP_VIEW_KEY_NONE,
    HGP_VIEW_KEY_FILLED,
    HGP_VIEW_KEY_RAW,
    HGP_VIEW_KEY_NONZERO,
    HGP_VIEW_KEY_SERIES
};

struct hgp_view_param {
    const char *name; // of the field of view_set
    enum hgp_kind kind;
    const char *values;         // ENUM: its name
    double least, most;         // of numbers
    const char *standard, *doc; // as they stand in the table
    const char *unit;           // may be ""
    bool path_only;
    bool delivery; // how frames are sent: no parameter of the renderer
    enum hgp_view_key key;
};

extern const struct hgp_view_param hgp_view_params[HGP_VIEW_PARAM_COUNT];

// What the other rows say of a parameter; NULL: nothing.
const char *hgp_view_param_unset(const struct hgp_view_param *param);
const char *hgp_view_param_option(const struct hgp_view_param *param); // without --
const char *hgp_view_param_word(const struct hgp_view_param *param);
const char *hgp_view_param_attribute(const struct hgp_view_param *param);

// The parameter that a script's word sets alone, or that a field of view_set is; NULL: none.
const struct hgp_view_param *hgp_view_param_find_word(const char *word);
const struct hgp_view_param *hgp_view_param_find(const char *name);

enum { HGP_WORD_BYTES = 32, HGP_VIEW_TEXT_BYTES = 320 };
// Name of an enum's value as options, scripts and files write it: "pbr-neutral". "" when unknown.
void hgp_enum_word(const char *enum_name, uint32_t value, char dst[HGP_WORD_BYTES]);
// "greatest projected error of the geometry (px); default 1". `lower`: enums as words.
void hgp_view_param_text(
    const struct hgp_view_param *param, bool lower, char dst[HGP_VIEW_TEXT_BYTES]);

#endif
