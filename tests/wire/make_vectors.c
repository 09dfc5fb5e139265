// make_vectors - prints the wire vectors of the present protocol version.
//
//   make_vectors good   one JSON object per line: message, variant, payload, value
//   make_vectors bad    one per line: message, the edit of its "full" payload (the bytes from
//                       `at` on are overwritten by `put`), and the status and field with which
//                       it must be refused, at byte `at`
//   make_vectors corpus FOLDER   streams for the fuzz harnesses in FOLDER/hgp_c2s and hgp_s2c
//
// The stored files under vectors/ are compared with this output; a stored line never changes, and
// goes only with a message that is retired (HGP_RETIRED).
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/file.h"
#include "tests/wire/sample.h"

enum { MAX_SPOTS = 256 };

static union hgp_any message;
static struct hg_arena arena;

// Encodes a sample with its header; the caller finishes the writer.
static struct hg_writer encode_sample(
    const struct hgp_message_info *info, enum sample_variant variant)
{
    struct hg_writer w = {0};
    struct hgp_fault fault = {0};
    sample_fill(hgp_layout_find((uint16_t)info->type), variant, &arena, &message);
    enum hg_status status =
        hgp_encode(&w, HGP_VERSION_MAX, (struct hgp_envelope){info->type, 1, 0}, &message, &fault);
    if (status) {
        fprintf(stderr, "make_vectors: %s %s: %s %s\n", info->name, sample_variant_names[variant],
            fault.field, hg_status_name(status));
        exit(1);
    }
    return w;
}

static void flush_line(struct hg_writer *text)
{
    printf("%.*s\n", (int)text->size, (const char *)text->data);
    hg_writer_finish(text);
}

static void print_good(const struct hgp_message_info *info)
{
    for (int v = 0; v < SAMPLE_VARIANTS; v++) {
        struct hg_writer w = encode_sample(info, (enum sample_variant)v), text = {0};
        sample_text(&text, "{\"message\":\"%s\",\"variant\":\"%s\",\"payload\":\"", info->name,
            sample_variant_names[v]);
        sample_hex(w.data + HGP_HEADER_BYTES, w.size - HGP_HEADER_BYTES, &text);
        sample_text(&text, "\",\"value\":");
        sample_dump(hgp_layout_find((uint16_t)info->type), &message, &text);
        sample_text(&text, "}");
        flush_line(&text);
        hg_writer_finish(&w);
    }
}

// ---- refused payloads --------------------------------------------------------------------------

struct edit {
    const char *message;
    const uint8_t *payload;
    const struct sample_spot *spot;
};

static void print_edit(const struct edit *e, const uint8_t *put, size_t size, enum hg_status status)
{
    struct hg_writer text = {0};
    sample_text(&text, "{\"message\":\"%s\",\"at\":%zu,\"put\":\"", e->message, e->spot->offset);
    sample_hex(put, size, &text);
    sample_text(
        &text, "\",\"status\":\"%s\",\"field\":\"%s\"}", hg_status_name(status), e->spot->path);
    flush_line(&text);
}

static void print_number(const struct edit *e, uint64_t bits, size_t size, enum hg_status status)
{
    uint8_t bytes[8];
    for (size_t i = 0; i < 8; i++)
        bytes[i] = (uint8_t)(bits >> (8 * i));
    print_edit(e, bytes, size, status);
}

static void print_bad_unsigned(const struct edit *e)
{
    const struct hgp_field *field = e->spot->field;
    uint64_t top = field->size == 8 ? UINT64_MAX : (UINT64_C(1) << (8 * field->size)) - 1;
    if (field->limit.u.least > 0)
        print_number(e, field->limit.u.least - 1, field->size, HG_E_INVAL);
    if (field->limit.u.most < top)
        print_number(e, field->limit.u.most + 1, field->size, HG_E_INVAL);
}

static void print_bad_signed(const struct edit *e)
{
    const struct hgp_field *field = e->spot->field;
    if (field->limit.i.least > INT32_MIN)
        print_number(e, (uint64_t)(field->limit.i.least - 1), 4, HG_E_INVAL);
    if (field->limit.i.most < INT32_MAX)
        print_number(e, (uint64_t)(field->limit.i.most + 1), 4, HG_E_INVAL);
}

// The neighbours outside the limits, then NaN and both infinities.
static void print_bad_f32(const struct edit *e)
{
    float least = (float)e->spot->field->limit.f.least, most = (float)e->spot->field->limit.f.most;
    float values[] = {__builtin_nextafterf(least, -__builtin_inff()),
        __builtin_nextafterf(most, __builtin_inff()), __builtin_nanf(""), __builtin_inff(),
        -__builtin_inff()};
    for (size_t i = 0; i < sizeof values / sizeof *values; i++) {
        uint32_t bits;
        memcpy(&bits, &values[i], sizeof bits);
        print_number(e, bits, 4, HG_E_INVAL);
    }
}

static void print_bad_f64(const struct edit *e)
{
    const struct hgp_field *field = e->spot->field;
    double values[] = {__builtin_nextafter(field->limit.f.least, -__builtin_inf()),
        __builtin_nextafter(field->limit.f.most, __builtin_inf()), __builtin_nan(""),
        __builtin_inf(), -__builtin_inf()};
    for (size_t i = 0; i < sizeof values / sizeof *values; i++) {
        uint64_t bits;
        memcpy(&bits, &values[i], sizeof bits);
        print_number(e, bits, 8, HG_E_INVAL);
    }
}

// Spoils the first bytes of a string; its size stays. Sample strings are longer than these.
static void print_bad_text(const struct edit *e)
{
    static const struct {
        uint8_t bytes[4];
        size_t size;
    } texts[] = {
        {{0}, 1},                      // NUL
        {{0x80}, 1},                   // lone continuation
        {{0xc0, 0x80}, 2},             // overlong NUL
        {{0xed, 0xa0, 0x80}, 3},       // surrogate
        {{0xf4, 0x90, 0x80, 0x80}, 4}, // above U+10FFFF
        {{0xe2, 0x82, 'x'}, 3},        // cut sequence
    };
    for (size_t i = 0; i < sizeof texts / sizeof *texts; i++) {
        uint8_t put[8];
        memcpy(put, e->payload + e->spot->offset, 4);
        memcpy(put + 4, texts[i].bytes, texts[i].size);
        print_edit(e, put, 4 + texts[i].size, HG_E_FORMAT);
    }
}

static void print_bad_spot(const struct edit *e)
{
    const struct hgp_field *field = e->spot->field;
    if (!field) {
        if (e->spot->known_bits == UINT32_MAX) // 32 optional fields: every bitmap is allowed
            return;
        if (e->spot->bitmap > 0) // left out when it is empty
            print_number(e, 0, 4, HG_E_FORMAT);
        print_number(e, (uint64_t)e->spot->known_bits + 1, 4, HG_E_FORMAT);
        print_number(e, UINT32_MAX, 4, HG_E_FORMAT);
        return;
    }
    switch (field->kind) {
    case HGP_K_U8:
    case HGP_K_U16:
    case HGP_K_U32:
    case HGP_K_U64:
        print_bad_unsigned(e);
        break;
    case HGP_K_I32:
        print_bad_signed(e);
        break;
    case HGP_K_F32:
        print_bad_f32(e);
        break;
    case HGP_K_F64:
        print_bad_f64(e);
        break;
    case HGP_K_BOOL:
        print_number(e, 2, 1, HG_E_FORMAT);
        print_number(e, 255, 1, HG_E_FORMAT);
        break;
    case HGP_K_ENUM:
        print_number(e, field->limit.values->values[field->limit.values->count - 1].value + 1, 2,
            HG_E_INVAL);
        print_number(e, 65535, 2, HG_E_INVAL);
        break;
    case HGP_K_STR:
        print_bad_text(e);
        print_number(e, (uint64_t)field->limit.max_bytes + 1, 4, HG_E_LIMIT);
        break;
    case HGP_K_BYTES:
        print_number(e, (uint64_t)field->limit.max_bytes + 1, 4, HG_E_LIMIT);
        break;
    case HGP_K_LIST:
        print_number(e, (uint64_t)field->limit.list.max_count + 1, 4, HG_E_LIMIT);
        break;
    case HGP_K_HASH:
        break; // every value is allowed
    default:
        print_number(e, 0x7fc00000, 4, HG_E_INVAL);
    }
}

static void print_bad(const struct hgp_message_info *info)
{
    static struct sample_spot spots[MAX_SPOTS];
    struct hg_writer w = encode_sample(info, SAMPLE_FULL);
    size_t count = sample_spots(hgp_layout_find((uint16_t)info->type), w.data + HGP_HEADER_BYTES,
        w.size - HGP_HEADER_BYTES, spots, MAX_SPOTS);
    for (size_t i = 0; i < count; i++)
        print_bad_spot(&(struct edit){info->name, w.data + HGP_HEADER_BYTES, &spots[i]});
    hg_writer_finish(&w);
}

// ---- fuzz corpora ------------------------------------------------------------------------------

static void write_stream(const char *folder, const char *name, const struct hg_writer *w)
{
    char path[512];
    struct hg_error err = {0};
    snprintf(path, sizeof path, "%s/%s", folder, name);
    if (hg_file_write_atomic(path, w->data, w->size, &err)) {
        char text[512];
        hg_error_format(&err, text, sizeof text);
        fprintf(stderr, "make_vectors: %s\n", text);
        exit(1);
    }
}

static void append_sample(
    struct hg_writer *stream, const struct hgp_message_info *info, enum sample_variant variant)
{
    struct hg_writer w = encode_sample(info, variant);
    hg_write_bytes(stream, w.data, w.size);
    hg_writer_finish(&w);
}

// Before the message come those that open the connection, so that it is reached.
static void append_opening(struct hg_writer *stream, enum hgp_direction direction)
{
    switch (direction) {
    case HGP_C2S:
    case HGP_ANY:
        hg_write_bytes(stream, HGP_PREFACE, HGP_PREFACE_BYTES);
        append_sample(stream, hgp_find(HGP_T_hello), SAMPLE_FULL);
        append_sample(stream, hgp_find(HGP_T_auth), SAMPLE_FULL);
        break;
    case HGP_S2C:
        append_sample(stream, hgp_find(HGP_T_welcome), SAMPLE_FULL);
        append_sample(stream, hgp_find(HGP_T_auth_ok), SAMPLE_FULL);
        break;
    case HGP_B2W:
        append_sample(stream, hgp_find(HGP_T_session_attach), SAMPLE_BARE);
        break;
    case HGP_W2B:
        append_sample(stream, hgp_find(HGP_T_worker_ready), SAMPLE_FULL);
    }
}

// One stream per message, in the folder of the harness that reads its direction.
static void write_corpus(const char *folder)
{
    const struct hgp_message_info *info;
    for (size_t n = 0; (info = hgp_message_at(n)); n++) {
        bool from_server = info->direction == HGP_S2C || info->direction == HGP_W2B;
        struct hg_writer stream = {0};
        char name[96];
        append_opening(&stream, info->direction);
        append_sample(&stream, info, SAMPLE_FULL);
        append_sample(&stream, info, SAMPLE_BARE);
        snprintf(name, sizeof name, "%s/%s", from_server ? "hgp_s2c" : "hgp_c2s", info->name);
        write_stream(folder, name, &stream);
        hg_writer_finish(&stream);
    }
}

int main(int argc, char **argv)
{
    const struct hgp_message_info *info;
    bool good = argc == 2 && strcmp(argv[1], "good") == 0;
    bool bad = argc == 2 && strcmp(argv[1], "bad") == 0;
    bool corpus = argc == 3 && strcmp(argv[1], "corpus") == 0;
    if (!good && !bad && !corpus) {
        fprintf(stderr, "usage: make_vectors good|bad|corpus FOLDER\n");
        return 2;
    }
    for (size_t n = 0; !corpus && (info = hgp_message_at(n)); n++)
        (good ? print_good : print_bad)(info);
    if (corpus)
        write_corpus(argv[2]);
    hg_arena_finish(&arena);
    return fflush(stdout) != 0;
}
