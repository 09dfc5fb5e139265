// gen - writes what follows from messages.def.
//
//   gen js RUNTIME OUT      the JavaScript codec: tables and the hand-written RUNTIME
//   gen docs IN OUT         IN with the text between "<!-- generated: NAME -->" and
//                           "<!-- end of NAME -->" made again
#include "protocol/gen/gen.h"

#include <ctype.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/alloc.h"
#include "base/file.h"

const struct gen_row gen_rows[] = {
#define HGP_ENUM(name, since, doc)                                {GEN_ENUM, #name, since, doc},
#define HGP_VALUE(e, name, value, doc)                            {GEN_VALUE, #name, value, doc},
#define HGP_STRUCT(name, doc)                                     {GEN_STRUCT, #name, 0, doc},
#define HGP_MESSAGE(name, id, direction, state, role, since, doc) {GEN_MESSAGE, #name, 0, doc},
#define HGP_F(presence, kind, field, a, b, since, doc)            {GEN_FIELD, #field, 0, doc},
#define HGP_DEFAULT(field, text)                                  {GEN_DEFAULT, #field, 0, text},
#include "protocol/messages.def"
};
const size_t gen_row_count = sizeof gen_rows / sizeof *gen_rows;

const struct gen_row *gen_find(enum gen_row_kind kind, const char *name)
{
    for (size_t i = 0; i < gen_row_count; i++)
        if (gen_rows[i].kind == kind && strcmp(gen_rows[i].name, name) == 0)
            return &gen_rows[i];
    return NULL;
}

const struct gen_row *gen_find_field(const struct gen_row *owner, const char *name)
{
    for (const struct gen_row *row = owner + 1; row < gen_rows + gen_row_count; row++) {
        if (row->kind != GEN_FIELD && row->kind != GEN_DEFAULT)
            break;
        if (row->kind == GEN_FIELD && strcmp(row->name, name) == 0)
            return row;
    }
    return NULL;
}

const char *gen_default(const struct gen_row *owner, const char *field)
{
    const struct gen_row *next = gen_find_field(owner, field) + 1;
    const bool stated = next < gen_rows + gen_row_count && next->kind == GEN_DEFAULT;
    if (stated && strcmp(next->name, field) != 0) {
        fprintf(
            stderr, "gen: the default of %s stands behind %s.%s\n", next->name, owner->name, field);
        exit(1);
    }
    return stated ? next->doc : NULL;
}

void gen_print(struct hg_writer *out, const char *fmt, ...)
{
    char line[2048];
    va_list args;
    va_start(args, fmt);
    int n = vsnprintf(line, sizeof line, fmt, args);
    va_end(args);
    if (n < 0 || n >= (int)sizeof line) {
        fprintf(stderr, "gen: a line is too long\n");
        exit(1);
    }
    hg_write_bytes(out, line, (size_t)n);
}

void gen_number(char dst[32], double value, bool single)
{
    for (int digits = 1; digits <= 17; digits++) {
        snprintf(dst, 32, "%.*g", digits, value);
        double back = strtod(dst, NULL);
        if (single ? (float)back == (float)value : back == value)
            return;
    }
}

const char *gen_kind_name(enum hgp_kind kind)
{
    static const char *const names[] = {"U8", "U16", "U32", "U64", "I32", "F32", "F64", "BOOL",
        "ENUM", "STR", "BYTES", "VEC2", "VEC3", "VEC4", "MAT4", "HASH", "LIST"};
    return names[kind];
}

static uint8_t *load(const char *path, size_t *size)
{
    uint8_t *data;
    struct hg_error err = {0};
    if (hg_file_read(path, 16 << 20, &data, size, &err)) {
        fprintf(stderr, "gen: %s: %s\n", path, err.reason);
        exit(1);
    }
    return data;
}

static void store(const char *path, const struct hg_writer *out)
{
    struct hg_error err = {0};
    if (out->failed || hg_file_write_atomic(path, out->data, out->size, &err)) {
        fprintf(stderr, "gen: %s: %s\n", path, out->failed ? "no memory" : err.reason);
        exit(1);
    }
}

// Copies `text`, with every generated section made again.
static void fill_sections(struct hg_writer *out, const char *text)
{
    static const char begin[] = "<!-- generated: ";
    for (const char *mark; (mark = strstr(text, begin));) {
        const char *name = mark + sizeof begin - 1, *line_end = strchr(name, '\n');
        size_t length = strcspn(name, " \n");
        char end[96];
        snprintf(end, sizeof end, "<!-- end of %.*s -->", (int)length, name);
        const char *stop = line_end ? strstr(line_end, end) : NULL;
        if (!stop) {
            fprintf(stderr, "gen: '%s' is missing\n", end);
            exit(1);
        }
        hg_write_bytes(out, text, (size_t)(line_end + 1 - text));
        if (!gen_docs_section(out, name, length)) {
            fprintf(stderr, "gen: no section '%.*s'\n", (int)length, name);
            exit(1);
        }
        text = stop;
    }
    hg_write_bytes(out, text, strlen(text));
}

int main(int argc, char **argv)
{
    bool js = argc == 4 && strcmp(argv[1], "js") == 0;
    if (!js && !(argc == 4 && strcmp(argv[1], "docs") == 0)) {
        fprintf(stderr, "usage: gen js RUNTIME OUT | gen docs IN OUT\n");
        return 2;
    }
    size_t size;
    uint8_t *data = load(argv[2], &size);
    struct hg_writer out = {0};
    if (js)
        gen_js(&out, data, size);
    else
        fill_sections(&out, (const char *)data);
    store(argv[3], &out);
    hg_writer_finish(&out);
    hg_free(data);
    return 0;
}
