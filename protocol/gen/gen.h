// gen.h - the build-time program that writes the JavaScript codec and the tables of the manual.
// Floor 1, private to protocol/gen. One thread; errors end the program.
#ifndef HG_PROTOCOL_GEN_GEN_H
#define HG_PROTOCOL_GEN_GEN_H

#include "protocol/layout.h"

// The words of messages.def that the codec's tables leave out.
enum gen_row_kind { GEN_ENUM, GEN_VALUE, GEN_STRUCT, GEN_MESSAGE, GEN_FIELD, GEN_DEFAULT };

struct gen_row {
    enum gen_row_kind kind;
    const char *name;
    uint32_t number; // VALUE: the value; ENUM: since
    const char *doc;
};

extern const struct gen_row gen_rows[];
extern const size_t gen_row_count;

// The row of a field; `owner` is the row of its message or struct.
const struct gen_row *gen_find(enum gen_row_kind kind, const char *name);
const struct gen_row *gen_find_field(const struct gen_row *owner, const char *name);
// The default of a field of view_set or of another message, in words; NULL: none is stated.
const char *gen_default(const struct gen_row *owner, const char *field);

void gen_print(struct hg_writer *out, const char *fmt, ...) HG_PRINTF(2, 3);
// Shortest decimal that reads back as the same float or double.
void gen_number(char dst[32], double value, bool single);
// "U32", "LIST", ...
const char *gen_kind_name(enum hgp_kind kind);

// The whole of client/web/hgp.js; `runtime` is the hand-written part.
void gen_js(struct hg_writer *out, const uint8_t *runtime, size_t runtime_size);
// One generated section of docs/protocol.md or docs/client.md; false for an unknown name.
bool gen_docs_section(struct hg_writer *out, const char *name, size_t name_length);
// The worked example of docs/protocol.md.
void gen_transcript(struct hg_writer *out);

#endif
