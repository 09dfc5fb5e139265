// The tables of the JavaScript codec.
#include <ctype.h>
#include <inttypes.h>
#include <string.h>

#include "protocol/gen/gen.h"

static const char *const direction_names[] = {"C2S", "S2C", "ANY", "B2W", "W2B"};
static const char *const state_names[] = {"HELLO", "AUTH", "OPEN"};

static void print_head(struct hg_writer *out)
{
    gen_print(out,
        "// hgp.js - the Heliograph protocol: framing and message codec. Bytes in, objects out.\n"
        "// Made by protocol/gen from protocol/messages.def and protocol/gen/runtime.js; change "
        "those,\n"
        "// then build the target protocol_update. No dependencies; browsers and Node.\n\n"
        "export const VERSION_MIN = %d;\nexport const VERSION_MAX = %d;\n"
        "export const LIMIT_BEFORE_AUTH = %d;\n\n",
        HGP_VERSION_MIN, HGP_VERSION_MAX, HGP_LIMIT_BEFORE_AUTH);
}

static void print_status(struct hg_writer *out)
{
    gen_print(out, "// Codes of error and notice messages, by name.\nexport const status = {\n");
#define HG_STATUS(sym, value, name, text) gen_print(out, "    \"%s\": %d,\n", name, value);
#include "base/status.def"
#undef HG_STATUS
    gen_print(out, "};\n\n");
}

static void print_enums(struct hg_writer *out)
{
    gen_print(out, "export const enums = {\n");
    for (size_t i = 0; i < gen_row_count; i++) {
        if (gen_rows[i].kind != GEN_ENUM)
            continue;
        gen_print(out, "    %s: {", gen_rows[i].name);
        for (size_t n = i + 1; n < gen_row_count && gen_rows[n].kind == GEN_VALUE; n++)
            gen_print(out, "%s %s: %u", n > i + 1 ? "," : "", gen_rows[n].name, gen_rows[n].number);
        gen_print(out, " },\n");
    }
    gen_print(out, "};\n\n");
}

static void print_limits(struct hg_writer *out, const struct hgp_field *field)
{
    char least[32], most[32];
    switch (field->kind) {
    case HGP_K_U8:
    case HGP_K_U16:
    case HGP_K_U32:
    case HGP_K_U64: {
        const char *n = field->kind == HGP_K_U64 ? "n" : "";
        gen_print(out, ", least: %" PRIu64 "%s, most: %" PRIu64 "%s", field->limit.u.least, n,
            field->limit.u.most, n);
        break;
    }
    case HGP_K_I32:
        gen_print(
            out, ", least: %" PRId64 ", most: %" PRId64, field->limit.i.least, field->limit.i.most);
        break;
    case HGP_K_F32:
    case HGP_K_F64:
        gen_number(least, field->limit.f.least, field->kind == HGP_K_F32);
        gen_number(most, field->limit.f.most, field->kind == HGP_K_F32);
        gen_print(out, ", least: %s, most: %s", least, most);
        break;
    case HGP_K_ENUM:
        gen_print(out, ", values: \"%s\"", field->limit.values->name);
        break;
    case HGP_K_STR:
    case HGP_K_BYTES:
        gen_print(out, ", max: %u", field->limit.max_bytes);
        break;
    case HGP_K_LIST:
        gen_print(out, ", items: \"%s\", max: %u", field->limit.list.items()->name,
            field->limit.list.max_count);
        break;
    default:
        break;
    }
}

static void print_fields(struct hg_writer *out, const struct hgp_layout *layout, const char *indent)
{
    for (size_t i = 0; i < layout->field_count; i++) {
        const struct hgp_field *field = &layout->fields[i];
        char kind[8] = "";
        for (size_t k = 0; gen_kind_name(field->kind)[k]; k++)
            kind[k] = (char)tolower((unsigned char)gen_kind_name(field->kind)[k]);
        gen_print(out, "%s{ name: \"%s\", kind: \"%s\"", indent, field->name, kind);
        print_limits(out, field);
        gen_print(out, ", since: %u%s },\n", field->since,
            field->presence == HGP_P_OPT ? ", optional: true" : "");
    }
}

static void print_structs(struct hg_writer *out)
{
    const struct hgp_layout *layout;
    gen_print(out, "// Parts of lists.\nexport const structs = {\n");
    for (size_t n = 0; (layout = hgp_struct_at(n)); n++) {
        gen_print(
            out, "    // %s\n    %s: [\n", gen_find(GEN_STRUCT, layout->name)->doc, layout->name);
        print_fields(out, layout, "        ");
        gen_print(out, "    ],\n");
    }
    gen_print(out, "};\n\n");
}

static void print_messages(struct hg_writer *out)
{
    const struct hgp_message_info *info;
    gen_print(out, "export const messages = {\n");
    for (size_t n = 0; (info = hgp_message_at(n)); n++) {
        const struct hgp_layout *layout = hgp_layout_find((uint16_t)info->type);
        gen_print(out,
            "    // %s\n    %s: {\n        type: 0x%04x, direction: \"%s\", state: \"%s\", role: "
            "\"%s\", "
            "since: %u,\n        fields: [",
            gen_find(GEN_MESSAGE, info->name)->doc, info->name, (unsigned)info->type,
            direction_names[info->direction], state_names[info->state],
            hgp_enum_name("role", (uint32_t)info->role), info->since);
        if (layout->field_count) {
            gen_print(out, "\n");
            print_fields(out, layout, "            ");
            gen_print(out, "        ");
        }
        gen_print(out, "],\n    },\n");
    }
    gen_print(out, "};\n\n");
}

void gen_js(struct hg_writer *out, const uint8_t *runtime, size_t runtime_size)
{
    print_head(out);
    print_status(out);
    print_enums(out);
    print_structs(out);
    print_messages(out);
    hg_write_bytes(out, runtime, runtime_size);
}
