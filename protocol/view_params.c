#include "protocol/view_params.h"

#include <assert.h>
#include <stdio.h>
#include <string.h>

#define PARAM_U8(a, b)   .kind = HGP_K_U8, .least = a, .most = b
#define PARAM_U32(a, b)  .kind = HGP_K_U32, .least = a, .most = b
#define PARAM_F32(a, b)  .kind = HGP_K_F32, .least = a, .most = b
#define PARAM_VEC3(a, b) .kind = HGP_K_VEC3, .least = a, .most = b
#define PARAM_VEC4(a, b) .kind = HGP_K_VEC4, .least = a, .most = b
#define PARAM_ENUM(a, b) .kind = HGP_K_ENUM, .values = #a, .most = HGP_COUNT_##a - 1
#define PARAM_BYTES(a, b) .kind = HGP_K_BYTES, .most = a
#define IS_PATH_ANY      false
#define IS_PATH_PATH     true

static_assert(HGP_COUNT_plane == 23, "the greatest value of `planes` has a bit for each plane");

const struct hgp_view_param hgp_view_params[] = {
#define HGP_VIEW_PARAM(a_kind, field, a, b, a_standard, a_unit, mode, a_key, place, a_doc)         \
    {.name = #field,                                                                               \
        PARAM_##a_kind(a, b),                                                                      \
        .standard = #a_standard,                                                                   \
        .doc = a_doc,                                                                              \
        .unit = a_unit,                                                                            \
        .path_only = IS_PATH_##mode,                                                               \
        .key = HGP_VIEW_KEY_##a_key},
#define HGP_VIEW_DELIVERY(a_kind, field, a, b, a_standard, a_doc)                                  \
    {.name = #field,                                                                               \
        PARAM_##a_kind(a, b),                                                                      \
        .standard = #a_standard,                                                                   \
        .doc = a_doc,                                                                              \
        .unit = "",                                                                                \
        .delivery = true},
#include "protocol/view_params.def"
};

// ---- the other rows ----------------------------------------------------------------------------

struct note {
    enum hgp_view_param_index param;
    const char *text;
};

static const struct note unsets[] = {
#define HGP_VIEW_UNSET(field, text) {HGP_VIEW_##field, text},
#include "protocol/view_params.def"
};

static const struct note options[] = {
#define HGP_VIEW_OPTION(field, kind, name, argument, least) {HGP_VIEW_##field, name},
#define HGP_VIEW_SHARED(field, option, word)                {HGP_VIEW_##field, option},
#include "protocol/view_params.def"
};

static const struct note words[] = {
// that set one parameter
#define HGP_VIEW_WORD(field, word) {HGP_VIEW_##field, word},
#include "protocol/view_params.def"
};

static const struct note shared_words[] = {
#define HGP_VIEW_SHARED(field, option, word) {HGP_VIEW_##field, word},
#include "protocol/view_params.def"
};

static const struct note attributes[] = {
#define HGP_VIEW_ATTRIBUTE(field, when, name) {HGP_VIEW_##field, name},
#include "protocol/view_params.def"
};

#define COUNT(array) (sizeof(array) / sizeof *(array))

static const char *find_note(
    const struct note *notes, size_t count, const struct hgp_view_param *param)
{
    for (size_t i = 0; i < count; i++)
        if (&hgp_view_params[notes[i].param] == param && *notes[i].text)
            return notes[i].text;
    return NULL;
}

const char *hgp_view_param_unset(const struct hgp_view_param *param)
{
    return find_note(unsets, COUNT(unsets), param);
}

const char *hgp_view_param_option(const struct hgp_view_param *param)
{
    return find_note(options, COUNT(options), param);
}

const char *hgp_view_param_word(const struct hgp_view_param *param)
{
    const char *word = find_note(words, COUNT(words), param);
    return word ? word : find_note(shared_words, COUNT(shared_words), param);
}

const char *hgp_view_param_attribute(const struct hgp_view_param *param)
{
    return find_note(attributes, COUNT(attributes), param);
}

const struct hgp_view_param *hgp_view_param_find_word(const char *word)
{
    for (size_t i = 0; i < COUNT(words); i++)
        if (strcmp(words[i].text, word) == 0)
            return &hgp_view_params[words[i].param];
    return NULL;
}

const struct hgp_view_param *hgp_view_param_find(const char *name)
{
    for (size_t i = 0; i < HGP_VIEW_PARAM_COUNT; i++)
        if (strcmp(hgp_view_params[i].name, name) == 0)
            return &hgp_view_params[i];
    return NULL;
}

// ---- texts -------------------------------------------------------------------------------------

static void make_word(char *text)
{
    for (; *text; text++)
        *text = (char)(*text == '_' ? '-' : *text >= 'A' && *text <= 'Z' ? *text + 32 : *text);
}

void hgp_enum_word(const char *enum_name, uint32_t value, char dst[HGP_WORD_BYTES])
{
    const char *name = hgp_enum_name(enum_name, value);
    snprintf(dst, HGP_WORD_BYTES, "%s", name ? name : "");
    make_word(dst);
}

void hgp_view_param_text(
    const struct hgp_view_param *param, bool lower, char dst[HGP_VIEW_TEXT_BYTES])
{
    const char *unset = hgp_view_param_unset(param);
    char standard[64];
    snprintf(standard, sizeof standard, "%s", unset ? unset : param->standard);
    if (lower && param->kind == HGP_K_ENUM)
        make_word(standard);
    const char *mode = !param->path_only ? "" : lower ? "path: " : "PATH: ";
    const bool zero = !lower && unset && param->least <= 0;
    snprintf(dst, HGP_VIEW_TEXT_BYTES, "%s%s%s%s%s; %s%s%s", mode, param->doc,
        *param->unit ? " (" : "", param->unit, *param->unit ? ")" : "", zero ? "0 = " : "default ",
        standard, zero ? " (default)" : "");
}
