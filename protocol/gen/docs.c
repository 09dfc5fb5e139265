// The generated sections of docs/protocol.md and docs/client.md.
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "protocol/gen/gen.h"
#include "protocol/view_params.h"

static const char *const direction_texts[] = {
    "client to server", "server to client", "both ways", "broker to worker", "worker to broker"};
static const char *const state_texts[] = {"hello", "auth", "open"};

static void section_status(struct hg_writer *out)
{
    gen_print(out, "| code | name | meaning |\n|---|---|---|\n");
#define HG_STATUS(sym, value, name, text) gen_print(out, "| %d | `%s` | %s |\n", value, name, text);
#include "base/status.def"
#undef HG_STATUS
}

static void section_enums(struct hg_writer *out)
{
    for (size_t i = 0; i < gen_row_count; i++) {
        if (gen_rows[i].kind != GEN_ENUM)
            continue;
        gen_print(out, "%s**%s** (since %u): %s\n\n| value | name | meaning |\n|---|---|---|\n",
            i ? "\n" : "", gen_rows[i].name, gen_rows[i].number, gen_rows[i].doc);
        for (size_t n = i + 1; n < gen_row_count && gen_rows[n].kind == GEN_VALUE; n++)
            gen_print(
                out, "| %u | `%s` | %s |\n", gen_rows[n].number, gen_rows[n].name, gen_rows[n].doc);
    }
}

static void print_range(struct hg_writer *out, const struct hgp_field *field)
{
    uint64_t top = field->size < 8 ? (UINT64_C(1) << (8 * field->size)) - 1 : UINT64_MAX;
    char least[32], most[32];
    switch (field->kind) {
    case HGP_K_U8:
    case HGP_K_U16:
    case HGP_K_U32:
    case HGP_K_U64:
        if (field->limit.u.most == top && field->limit.u.least == 0)
            break;
        gen_print(out, "%" PRIu64 " .. ", field->limit.u.least);
        if (field->limit.u.most < top)
            gen_print(out, "%" PRIu64, field->limit.u.most);
        break;
    case HGP_K_I32:
        gen_print(out, "%" PRId64 " .. %" PRId64, field->limit.i.least, field->limit.i.most);
        break;
    case HGP_K_F32:
    case HGP_K_F64:
        gen_number(least, field->limit.f.least, field->kind == HGP_K_F32);
        gen_number(most, field->limit.f.most, field->kind == HGP_K_F32);
        gen_print(out, "%s .. %s", least, most);
        break;
    case HGP_K_STR:
    case HGP_K_BYTES:
        gen_print(out, "%u bytes", field->limit.max_bytes);
        break;
    case HGP_K_LIST:
        gen_print(out, "%u items", field->limit.list.max_count);
        break;
    default:
        break;
    }
}

static void print_type(struct hg_writer *out, const struct hgp_field *field)
{
    const char *kind = gen_kind_name(field->kind);
    if (field->kind == HGP_K_ENUM)
        gen_print(out, "ENUM %s", field->limit.values->name);
    else if (field->kind == HGP_K_LIST)
        gen_print(out, "LIST of %s", field->limit.list.items()->name);
    else
        gen_print(out, "%s", kind);
}

// Fields of view_set have their meanings and defaults from the table of view parameters.
static const struct hgp_view_param *find_param(const struct gen_row *owner, const char *field)
{
    return strcmp(owner->name, "view_set") == 0 ? hgp_view_param_find(field) : NULL;
}

static void print_meaning(
    struct hg_writer *out, const struct gen_row *owner, const struct hgp_field *field)
{
    const struct hgp_view_param *param = find_param(owner, field->name);
    if (!param) {
        gen_print(out, "%s", gen_find_field(owner, field->name)->doc);
        return;
    }
    gen_print(out, "%s%s", param->path_only ? "PATH: " : "", param->doc);
    if (*param->unit)
        gen_print(out, " (%s)", param->unit);
    if (hgp_view_param_unset(param) && param->least <= 0)
        gen_print(out, "; 0 = default");
}

// What a field of a client's message that is not there stands for.
static void print_default(
    struct hg_writer *out, const struct gen_row *owner, const struct hgp_field *field)
{
    const struct hgp_message_info *info = NULL;
    const struct hgp_view_param *param = find_param(owner, field->name);
    const char *text = gen_default(owner, field->name);
    const char *unset = param ? hgp_view_param_unset(param) : NULL;
    for (size_t n = 0; owner->kind == GEN_MESSAGE && (info = hgp_message_at(n)); n++)
        if (strcmp(info->name, owner->name) == 0)
            break;
    if (param)
        text = unset ? unset : param->standard;
    if (!text && info && info->direction == HGP_C2S && field->presence == HGP_P_OPT) {
        fprintf(stderr, "gen: %s.%s has no default\n", owner->name, field->name);
        exit(1);
    }
    gen_print(out, " | %s", text ? text : "");
}

static void print_fields(
    struct hg_writer *out, const struct hgp_layout *layout, const struct gen_row *owner)
{
    if (!layout->field_count) {
        gen_print(out, "No fields.\n");
        return;
    }
    gen_print(out, "| field | type | limits | there | default | since | meaning "
                   "|\n|---|---|---|---|---|---|---|\n");
    unsigned bit = 0;
    for (size_t i = 0; i < layout->field_count; i++) {
        const struct hgp_field *field = &layout->fields[i];
        gen_print(out, "| `%s` | ", field->name);
        print_type(out, field);
        gen_print(out, " | ");
        print_range(out, field);
        if (field->presence == HGP_P_OPT)
            gen_print(out, bit < HGP_BITMAP_FIELDS ? " | bit %u" : " | second bitmap, bit %u",
                bit % HGP_BITMAP_FIELDS);
        else
            gen_print(out, " | always");
        bit += field->presence == HGP_P_OPT;
        print_default(out, owner, field);
        gen_print(out, " | %u | ", field->since);
        print_meaning(out, owner, field);
        gen_print(out, " |\n");
    }
}

static void section_parts(struct hg_writer *out)
{
    const struct hgp_layout *layout;
    for (size_t n = 0; (layout = hgp_struct_at(n)); n++) {
        const struct gen_row *row = gen_find(GEN_STRUCT, layout->name);
        gen_print(out, "%s**%s**: %s\n\n", n ? "\n" : "", layout->name, row->doc);
        print_fields(out, layout, row);
    }
}

static void section_summary(struct hg_writer *out)
{
    const struct hgp_message_info *info;
    gen_print(out, "| type | message | direction | state | least role | since | meaning |\n"
                   "|---|---|---|---|---|---|---|\n");
    for (size_t n = 0; (info = hgp_message_at(n)); n++)
        gen_print(out, "| 0x%04x | [`%s`](#%s) | %s | %s | %s | %u | %s |\n", (unsigned)info->type,
            info->name, info->name, direction_texts[info->direction], state_texts[info->state],
            hgp_enum_name("role", (uint32_t)info->role), info->since,
            gen_find(GEN_MESSAGE, info->name)->doc);
#define HGP_RETIRED(name, id, doc)                                                                 \
    gen_print(out, "| 0x%04x | `%s` | retired | | | | %s |\n", (unsigned)id, #name, doc);
#include "protocol/messages.def"
}

static void section_messages(struct hg_writer *out)
{
    const struct hgp_message_info *info;
    for (size_t n = 0; (info = hgp_message_at(n)); n++) {
        const struct gen_row *row = gen_find(GEN_MESSAGE, info->name);
        gen_print(out, "%s### %s\n\n0x%04x, %s, state %s, role %s, since %u: %s\n\n", n ? "\n" : "",
            info->name, (unsigned)info->type, direction_texts[info->direction],
            state_texts[info->state], hgp_enum_name("role", (uint32_t)info->role), info->since,
            row->doc);
        print_fields(out, hgp_layout_find((uint16_t)info->type), row);
    }
}

static void section_limits(struct hg_writer *out)
{
    gen_print(out, "| limit | bytes |\n|---|---|\n");
    gen_print(out, "| preface | %d |\n| header | %d |\n", HGP_PREFACE_BYTES, HGP_HEADER_BYTES);
    gen_print(out, "| payload before the session is open | %d |\n", HGP_LIMIT_BEFORE_AUTH);
    gen_print(out, "| payload after it, default | %d |\n", HGP_LIMIT_OPEN_DEFAULT);
}

// A cell in code letters behind `prefix`, or an empty one.
static void print_code(struct hg_writer *out, const char *prefix, const char *text)
{
    if (text)
        gen_print(out, " | `%s%s`", prefix, text);
    else
        gen_print(out, " |");
}

static void print_standard(struct hg_writer *out, const struct hgp_view_param *param)
{
    const char *unset = hgp_view_param_unset(param);
    char word[HGP_WORD_BYTES] = "";
    uint32_t value;
    if (param->kind == HGP_K_ENUM && hgp_enum_value(param->values, param->standard, &value))
        hgp_enum_word(param->values, value, word);
    gen_print(out, "%s", unset ? unset : *word ? word : param->standard);
}

static void section_view_params(struct hg_writer *out)
{
    gen_print(out, "| parameter | default | option | in scripts: `set` | job hash | EXR "
                   "attribute |\n|---|---|---|---|---|---|\n");
    for (size_t i = 0; i < HGP_VIEW_PARAM_COUNT; i++) {
        const struct hgp_view_param *param = &hgp_view_params[i];
        if (param->delivery)
            continue;
        gen_print(out, "| `%s` | ", param->name);
        print_standard(out, param);
        print_code(out, "--", hgp_view_param_option(param));
        print_code(out, "", hgp_view_param_word(param));
        gen_print(out, " | %s", param->key ? "yes" : "no");
        print_code(out, "", hgp_view_param_attribute(param));
        gen_print(out, " |\n");
    }
}

bool gen_docs_section(struct hg_writer *out, const char *name, size_t name_length)
{
    static const struct {
        const char *name;
        void (*make)(struct hg_writer *out);
    } sections[] = {
        {"limits", section_limits},
        {"status", section_status},
        {"enums", section_enums},
        {"parts", section_parts},
        {"summary", section_summary},
        {"messages", section_messages},
        {"view_params", section_view_params},
        {"transcript", gen_transcript},
    };
    for (size_t i = 0; i < sizeof sections / sizeof *sections; i++)
        if (strlen(sections[i].name) == name_length &&
            memcmp(sections[i].name, name, name_length) == 0) {
            sections[i].make(out);
            return true;
        }
    return false;
}
