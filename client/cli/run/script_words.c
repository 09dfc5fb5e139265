#include "client/cli/run/script_words.h"

#include <stdio.h>
#include <string.h>

#include "client/cli/suggest.h"
#include "protocol/layout.h"
#include "protocol/view_params.h"

enum hg_status hg_words_error(struct hg_error *err, const char *fmt, ...)
{
    char reason[256];
    va_list args;
    va_start(args, fmt);
    vsnprintf(reason, sizeof reason, fmt, args);
    va_end(args);
    return hg_error_set(err, HG_E_INVAL, NULL, NULL, "%s", reason);
}

struct buffer {
    char text[HG_SCRIPT_LINE_BYTES];
    size_t size;
};

static bool put(struct buffer *b, const char *text, size_t n)
{
    if (n >= sizeof b->text - b->size)
        return false;
    memcpy(b->text + b->size, text, n);
    b->size += n;
    return true;
}

// Expands the ${NAME} at *at, leaving *at behind it.
static enum hg_status expand(
    const struct hg_words *w, const char **at, struct buffer *b, struct hg_error *err)
{
    const char *name = *at + 2, *end = strchr(name, '}');
    if (!end || end == name)
        return hg_words_error(err, "'${' without a name and '}'");
    const char *value = w->source->variable ? w->source->variable(w->source->user, w->file, name,
                                                  (size_t)(end - name))
                                            : NULL;
    if (!value)
        return hg_words_error(err, "the variable '%.*s' is not defined", (int)(end - name), name);
    if (!put(b, value, strlen(value)))
        return hg_words_error(err, "the line is too long");
    *at = end + 1;
    return HG_OK;
}

// Reads one word that starts at *at into *b.
static enum hg_status read_word(
    const struct hg_words *w, const char **at, struct buffer *b, struct hg_error *err)
{
    char quote = 0;
    const char *p = *at;
    for (; *p && (quote || (*p != ' ' && *p != '\t')); p++) {
        if (quote ? *p == quote : *p == '"' || *p == '\'') {
            quote = quote ? 0 : *p;
            continue;
        }
        if (quote != '\'' && p[0] == '$' && p[1] == '{') {
            enum hg_status status = expand(w, &p, b, err);
            if (status)
                return status;
            p--;
            continue;
        }
        if (quote != '\'' && *p == '\\' && p[1])
            p++;
        if (!put(b, p, 1))
            return hg_words_error(err, "the line is too long");
    }
    if (quote)
        return hg_words_error(err, "a quotation mark %c is not closed", quote);
    *at = p;
    return HG_OK;
}

enum hg_status hg_words_split(struct hg_words *w, const char *line, struct hg_error *err)
{
    struct buffer b;
    for (const char *at = line;;) {
        at += strspn(at, " \t");
        if (!*at || *at == '#')
            return HG_OK;
        b.size = 0;
        enum hg_status status = read_word(w, &at, &b, err);
        if (status)
            return status;
        if (w->count == HG_WORDS_MAX)
            return hg_words_error(err, "more than %d words", HG_WORDS_MAX);
        w->at[w->count] = hg_arena_strndup(w->arena, b.text, b.size);
        if (!w->at[w->count++])
            return hg_error_set(err, HG_E_NOMEM, NULL, NULL, "no memory for the script");
    }
}

static bool is_next(const struct hg_words *w, const char *text)
{
    return w->next < w->count && strcmp(w->at[w->next], text) == 0;
}

bool hg_words_accept(struct hg_words *w, const char *text)
{
    bool yes = is_next(w, text);
    w->next += yes;
    return yes;
}

enum hg_status hg_words_take(
    struct hg_words *w, const char *what, const char **out, struct hg_error *err)
{
    *out = NULL;
    if (w->next >= w->count)
        return hg_words_error(err, "%s is missing", what);
    *out = w->at[w->next++];
    return HG_OK;
}

enum hg_status hg_words_rename_error(
    const struct hg_error *inner, const char *what, struct hg_error *err)
{
    return hg_words_error(err, "%s: %s", what, inner->reason);
}

enum hg_status hg_words_take_number(struct hg_words *w, const char *what, double low, double high,
    double *out, struct hg_error *err)
{
    const char *text;
    struct hg_error inner = {0};
    *out = 0;
    enum hg_status status = hg_words_take(w, what, &text, err);
    if (status)
        return status;
    status = hg_cli_parse_number(what, text, low, high, out, &inner);
    return status ? hg_words_rename_error(&inner, what, err) : HG_OK;
}

enum hg_status hg_words_take_u32(struct hg_words *w, const char *what, uint32_t low, uint32_t high,
    uint32_t *out, struct hg_error *err)
{
    const char *text;
    struct hg_error inner = {0};
    *out = 0;
    enum hg_status status = hg_words_take(w, what, &text, err);
    if (status)
        return status;
    status = hg_cli_parse_u32(what, text, low, high, out, &inner);
    return status ? hg_words_rename_error(&inner, what, err) : HG_OK;
}

// `count` numbers as "a,b,c" or as separate words.
enum hg_status hg_words_take_numbers(
    struct hg_words *w, const char *what, uint32_t count, double *out, struct hg_error *err)
{
    if (w->next < w->count && strchr(w->at[w->next], ',')) {
        struct hg_error inner = {0};
        return hg_cli_parse_numbers(what, w->at[w->next++], count, out, &inner)
                   ? hg_words_rename_error(&inner, what, err)
                   : HG_OK;
    }
    for (uint32_t i = 0; i < count; i++) {
        if (w->next >= w->count && i)
            return hg_words_error(err, "%s: number %u of %u is missing", what, i + 1, count);
        enum hg_status status = hg_words_take_number(w, what, -1e30, 1e30, &out[i], err);
        if (status)
            return status;
    }
    return HG_OK;
}

// ---- fields ------------------------------------------------------------------------------------

static const struct hgp_field *find_field(enum hgp_type type, const char *name)
{
    const struct hgp_layout *layout = hgp_layout_find((uint16_t)type);
    for (size_t i = 0; i < layout->field_count; i++) {
        const char *a = layout->fields[i].name, *b = name;
        while (*a && *a == (*b == '-' ? '_' : *b)) {
            a++;
            b++;
        }
        if (!*a && !*b)
            return &layout->fields[i];
    }
    return NULL;
}

static enum hg_status take_floats(
    struct hg_words *w, const char *word, uint32_t count, float *out, struct hg_error *err)
{
    double v[4];
    enum hg_status status = hg_words_take_numbers(w, word, count, v, err);
    if (status)
        return status;
    for (uint32_t i = 0; i < count; i++)
        out[i] = (float)v[i];
    return HG_OK;
}

static enum hg_status take_f32(struct hg_words *w, const char *word, const struct hgp_field *field,
    float *out, struct hg_error *err)
{
    double v;
    enum hg_status status =
        hg_words_take_number(w, word, field->limit.f.least, field->limit.f.most, &v, err);
    *out = (float)v;
    return status;
}

static enum hg_status take_bool(
    struct hg_words *w, const char *word, bool *out, struct hg_error *err)
{
    *out = hg_words_accept(w, "yes") || hg_words_accept(w, "on") || hg_words_accept(w, "true");
    if (*out || hg_words_accept(w, "no") || hg_words_accept(w, "off") ||
        hg_words_accept(w, "false"))
        return HG_OK;
    return hg_words_error(err, "%s: yes or no is missing", word);
}

static enum hg_status refuse_enum(
    const char *word, const struct hgp_enum_table *values, const char *text, struct hg_error *err)
{
    struct hg_suggestion near = hg_suggest_begin(text, strlen(text));
    char choices[192] = "";
    for (size_t i = 0, used = 0; i < values->count && used < sizeof choices; i++) {
        char name[HGP_WORD_BYTES];
        hgp_enum_word(values->name, values->values[i].value, name);
        hg_suggest_offer(&near, name, strlen(name));
        used += (size_t)snprintf(choices + used, sizeof choices - used, "%s%s", i ? "|" : "", name);
    }
    return hg_words_error(
        err, "%s: '%s' is none of %s%s", word, text, choices, hg_suggest_text(&near).text);
}

static enum hg_status take_enum(struct hg_words *w, const char *word,
    const struct hgp_enum_table *values, uint32_t *out, struct hg_error *err)
{
    const char *text;
    enum hg_status status = hg_words_take(w, word, &text, err);
    if (status)
        return status;
    return hgp_enum_value(values->name, text, out) ? HG_OK : refuse_enum(word, values, text, err);
}

static enum hg_status take_value(struct hg_words *w, const char *word,
    const struct hgp_field *field, void *value, struct hg_error *err)
{
    switch (field->kind) {
    case HGP_K_F32:
        return take_f32(w, word, field, value, err);
    case HGP_K_U32:
        return hg_words_take_u32(
            w, word, (uint32_t)field->limit.u.least, (uint32_t)field->limit.u.most, value, err);
    case HGP_K_BOOL:
        return take_bool(w, word, value, err);
    case HGP_K_ENUM:
        return take_enum(w, word, field->limit.values, value, err);
    case HGP_K_VEC3:
    case HGP_K_VEC4:
        return take_floats(w, word, (uint32_t)hgp_kind_floats(field->kind), value, err);
    default:
        return HG_E_INTERNAL;
    }
}

enum hg_status hg_words_take_field(struct hg_words *w, const char *word, const char *name,
    const struct hg_words_fields *fields, struct hg_error *err)
{
    const struct hgp_field *field = find_field(fields->type, name);
    char *message = fields->message;
    if (!field)
        return HG_E_INTERNAL;
    enum hg_status status = take_value(w, word, field, message + field->offset, err);
    *(bool *)(message + field->has_offset) = !status;
    return status;
}

enum hg_status hg_words_take_asset(struct hg_words *w, struct hg_cli_step *s, struct hg_error *err)
{
    return hg_words_accept(w, "as") ? hg_words_take_u32(w, "asset", 1, UINT32_MAX, &s->asset, err)
                                    : HG_OK;
}
