// The stored vectors: they decode to their values, encode to their bytes, and nothing near them
// is accepted. Every payload lies in a block of exactly its size, so that asan sees overreads.
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "base/alloc.h"
#include "base/file.h"
#include "tests/wire/sample.h"

enum { VERSION = 1, MAX_PAYLOAD = 4096 };

struct vector {
    char message[64], variant[16];
    uint8_t *payload; // a block of exactly `size` bytes
    size_t size;
    const char *line; // not terminated
    size_t line_length;
};

static struct hg_arena arena;
static union hgp_any decoded;
static char *good_text, *bad_text;

static char *load(const char *name)
{
    const char *root = getenv("HELIO_SOURCE_DIR");
    char path[1024];
    uint8_t *data;
    size_t size;
    struct hg_error err = {0};
    snprintf(path, sizeof path, "%s/tests/wire/vectors/%s", root ? root : ".", name);
    if (hg_file_read(path, 16 << 20, &data, &size, &err))
        fail_msg("%s: %s", path, err.reason);
    return (char *)data;
}

static int load_all(void **state)
{
    (void)state;
    good_text = load("v1.jsonl");
    bad_text = load("v1-bad.jsonl");
    return 0;
}

static int unload_all(void **state)
{
    (void)state;
    hg_free(good_text);
    hg_free(bad_text);
    hg_arena_finish(&arena);
    return 0;
}

static size_t unhex(const char *hex, size_t digits, uint8_t *out)
{
    assert_true(digits % 2 == 0 && digits / 2 <= MAX_PAYLOAD);
    for (size_t i = 0; i < digits / 2; i++) {
        unsigned byte;
        assert_int_equal(sscanf(hex + 2 * i, "%2x", &byte), 1);
        out[i] = (uint8_t)byte;
    }
    return digits / 2;
}

static uint8_t *exact_copy(const uint8_t *data, size_t size)
{
    uint8_t *copy = malloc(size ? size : 1);
    assert_non_null(copy);
    memcpy(copy, data, size);
    return copy;
}

// Parses the line at *cursor and moves it; false at the end of the file.
static bool next_vector(const char **cursor, struct vector *v)
{
    static uint8_t bytes[MAX_PAYLOAD];
    if (!**cursor)
        return false;
    *v = (struct vector){.line = *cursor, .line_length = strcspn(*cursor, "\n")};
    int at = 0;
    sscanf(v->line, "{\"message\":\"%63[^\"]\",\"variant\":\"%15[^\"]\",\"payload\":\"%n",
        v->message, v->variant, &at);
    assert_true(at > 0);
    v->size = unhex(v->line + at, strcspn(v->line + at, "\""), bytes);
    v->payload = exact_copy(bytes, v->size);
    *cursor += v->line_length + ((*cursor)[v->line_length] == '\n');
    return true;
}

static const struct hgp_message_info *find_name(const char *name)
{
    const struct hgp_message_info *info;
    for (size_t n = 0; (info = hgp_message_at(n)); n++)
        if (strcmp(info->name, name) == 0)
            return info;
    fail_msg("the stored message '%s' is not in messages.def any more", name);
    return NULL;
}

static void assert_zeroed(const struct hgp_message_info *info)
{
    for (size_t i = 0; i < info->struct_size; i++)
        assert_int_equal(((const uint8_t *)&decoded)[i], 0);
}

static enum hg_status decode(
    const struct hgp_message_info *info, const uint8_t *data, size_t size, struct hgp_fault *fault)
{
    *fault = (struct hgp_fault){0};
    memset(&decoded, 0xaa, sizeof decoded);
    hg_arena_finish(&arena);
    return hgp_decode(
        VERSION, (uint16_t)info->type, hg_reader_make(data, size), &arena, &decoded, fault);
}

static void test_values(void **state)
{
    (void)state;
    struct vector v;
    size_t count = 0;
    for (const char *cursor = good_text; next_vector(&cursor, &v); count++) {
        const struct hgp_message_info *info = find_name(v.message);
        struct hgp_fault fault;
        enum hg_status status = decode(info, v.payload, v.size, &fault);
        if (status)
            fail_msg("%s %s: %s %s", v.message, v.variant, fault.field, fault.reason);
        struct hg_writer text = {0};
        sample_text(
            &text, "{\"message\":\"%s\",\"variant\":\"%s\",\"payload\":\"", v.message, v.variant);
        sample_hex(v.payload, v.size, &text);
        sample_text(&text, "\",\"value\":");
        sample_dump(hgp_layout_find((uint16_t)info->type), &decoded, &text);
        sample_text(&text, "}");
        assert_int_equal(text.size, v.line_length);
        assert_memory_equal(text.data, v.line, text.size);
        hg_writer_finish(&text);
        free(v.payload);
    }
    assert_true(count >= 100);
}

static void test_encodes_to_stored_bytes(void **state)
{
    (void)state;
    struct vector v;
    for (const char *cursor = good_text; next_vector(&cursor, &v);) {
        const struct hgp_message_info *info = find_name(v.message);
        struct hgp_fault fault;
        struct hg_writer w = {0};
        struct hgp_header header;
        assert_int_equal(decode(info, v.payload, v.size, &fault), HG_OK);
        assert_int_equal(
            hgp_encode(&w, VERSION, (struct hgp_envelope){info->type, 0x01020304, 0x0a0b0c0d},
                &decoded, &fault),
            HG_OK);
        assert_int_equal(hgp_header_decode(w.data, w.size, UINT32_MAX, &header), HG_OK);
        assert_int_equal(header.length, v.size);
        assert_int_equal(header.type, info->type);
        assert_int_equal(header.flags, 0);
        assert_int_equal(header.request, 0x01020304);
        assert_int_equal(header.channel, 0x0a0b0c0d);
        assert_int_equal(w.size, v.size + HGP_HEADER_BYTES);
        assert_memory_equal(w.data + HGP_HEADER_BYTES, v.payload, v.size);
        hg_writer_finish(&w);
        free(v.payload);
    }
}

static bool is_stored(const char *name, const char *variant, const struct hg_writer *w)
{
    struct vector v;
    bool found = false;
    for (const char *cursor = good_text; !found && next_vector(&cursor, &v); free(v.payload))
        found = strcmp(v.message, name) == 0 && strcmp(v.variant, variant) == 0 &&
                v.size == w->size - HGP_HEADER_BYTES &&
                memcmp(v.payload, w->data + HGP_HEADER_BYTES, v.size) == 0;
    return found;
}

// No message may be without its vectors.
static void test_every_message_is_stored(void **state)
{
    (void)state;
    const struct hgp_message_info *info;
    static union hgp_any message;
    for (size_t n = 0; (info = hgp_message_at(n)); n++) {
        for (int i = 0; info->since <= VERSION && i < SAMPLE_VARIANTS; i++) {
            struct hg_writer w = {0};
            struct hgp_fault fault;
            sample_fill(
                hgp_layout_find((uint16_t)info->type), (enum sample_variant)i, &arena, &message);
            assert_int_equal(
                hgp_encode(&w, VERSION, (struct hgp_envelope){info->type, 0, 0}, &message, &fault),
                HG_OK);
            if (!is_stored(info->name, sample_variant_names[i], &w))
                fail_msg("%s %s has no stored vector of these bytes; see make_vectors.c",
                    info->name, sample_variant_names[i]);
            hg_writer_finish(&w);
        }
    }
}

// Where the second bitmap of a payload begins, its size without one.
static size_t find_second_bitmap(const struct vector *v, const struct hgp_message_info *info)
{
    static struct sample_spot spots[512];
    const size_t count =
        sample_spots(hgp_layout_find((uint16_t)info->type), v->payload, v->size, spots, 512);
    for (size_t i = 0; i < count; i++)
        if (!spots[i].field && spots[i].bitmap > 0)
            return spots[i].offset;
    return v->size;
}

// What ends in front of a second bitmap is the message without its fields; what ends inside of the
// bitmap has bytes too many.
static void assert_ends_before(
    const struct hgp_message_info *info, const uint8_t *payload, size_t end)
{
    struct hgp_fault fault;
    for (size_t size = end; size < end + 4; size++) {
        uint8_t *prefix = exact_copy(payload, size);
        assert_int_equal(decode(info, prefix, size, &fault), size == end ? HG_OK : HG_E_FORMAT);
        free(prefix);
    }
}

static void test_every_prefix_is_refused(void **state)
{
    (void)state;
    struct vector v;
    for (const char *cursor = good_text; next_vector(&cursor, &v); free(v.payload)) {
        const struct hgp_message_info *info = find_name(v.message);
        const size_t second = find_second_bitmap(&v, info);
        if (second < v.size)
            assert_ends_before(info, v.payload, second);
        for (size_t size = 0; size < v.size; size++) {
            if (size >= second && size < second + 4)
                continue;
            uint8_t *prefix = exact_copy(v.payload, size);
            struct hgp_fault fault;
            assert_int_equal(decode(info, prefix, size, &fault), HG_E_TRUNCATED);
            assert_true(fault.offset <= size);
            assert_string_equal(fault.field, "");
            assert_true(fault.reason[0]);
            assert_zeroed(info);
            free(prefix);
        }
    }
}

static void test_one_byte_more_is_refused(void **state)
{
    (void)state;
    struct vector v;
    for (const char *cursor = good_text; next_vector(&cursor, &v); free(v.payload)) {
        const struct hgp_message_info *info = find_name(v.message);
        uint8_t *longer = malloc(v.size + 1);
        assert_non_null(longer);
        memcpy(longer, v.payload, v.size);
        longer[v.size] = 0;
        struct hgp_fault fault;
        assert_int_equal(decode(info, longer, v.size + 1, &fault), HG_E_FORMAT);
        assert_int_equal(fault.offset, v.size);
        assert_string_equal(fault.field, "");
        assert_zeroed(info);
        free(longer);
    }
}

// ---- edits that must be refused ----------------------------------------------------------------

struct bad {
    char message[64], put[64], status[32], field[64];
    size_t at;
};

static bool next_bad(const char **cursor, struct bad *b)
{
    if (!**cursor)
        return false;
    assert_int_equal(sscanf(*cursor,
                         "{\"message\":\"%63[^\"]\",\"at\":%zu,\"put\":\"%63[^\"]\","
                         "\"status\":\"%31[^\"]\",\"field\":\"%63[^\"]\"}",
                         b->message, &b->at, b->put, b->status, b->field),
        5);
    *cursor += strcspn(*cursor, "\n");
    *cursor += **cursor == '\n';
    return true;
}

static struct vector find_full(const char *message)
{
    struct vector v;
    for (const char *cursor = good_text; next_vector(&cursor, &v); free(v.payload))
        if (strcmp(v.message, message) == 0 && strcmp(v.variant, "full") == 0)
            return v;
    fail_msg("no full vector of %s", message);
    return (struct vector){0};
}

// The full payload with the edit made, in a block of its size.
static uint8_t *apply_edit(const struct bad *b, size_t *size)
{
    static uint8_t bytes[MAX_PAYLOAD];
    struct vector v = find_full(b->message);
    assert_true(b->at <= v.size);
    memcpy(bytes, v.payload, v.size);
    size_t put = unhex(b->put, strlen(b->put), bytes + b->at);
    *size = v.size;
    assert_true(b->at + put <= *size);
    free(v.payload);
    return exact_copy(bytes, *size);
}

static void test_bad_values_are_refused(void **state)
{
    (void)state;
    struct bad b;
    size_t count = 0;
    for (const char *cursor = bad_text; next_bad(&cursor, &b); count++) {
        const struct hgp_message_info *info = find_name(b.message);
        struct hgp_fault fault;
        size_t size;
        uint8_t *payload = apply_edit(&b, &size);
        enum hg_status status = decode(info, payload, size, &fault);
        if (strcmp(hg_status_name(status), b.status) != 0 || strcmp(fault.field, b.field) != 0)
            fail_msg("%s at %zu put %s: want %s of %s, got %s of %s", b.message, b.at, b.put,
                b.status, b.field, hg_status_name(status), fault.field);
        assert_int_equal(fault.offset, b.at);
        assert_true(fault.reason[0]);
        assert_zeroed(info);
        free(payload);
    }
    assert_true(count >= 500);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_values),
        cmocka_unit_test(test_encodes_to_stored_bytes),
        cmocka_unit_test(test_every_message_is_stored),
        cmocka_unit_test(test_every_prefix_is_refused),
        cmocka_unit_test(test_one_byte_more_is_refused),
        cmocka_unit_test(test_bad_values_are_refused),
    };
    return cmocka_run_group_tests(tests, load_all, unload_all);
}
