// The codec against literal bytes and its own rules.
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "base/alloc.h"
#include "tests/wire/sample.h"

static struct hg_arena arena;
static union hgp_any message, other;

static int finish_arena(void **state)
{
    (void)state;
    hg_alloc_fail_at(0);
    hg_arena_finish(&arena);
    return 0;
}

// ---- headers -----------------------------------------------------------------------------------

static void test_header_bytes(void **state)
{
    (void)state;
    static const uint8_t want[] = {4, 3, 2, 1, 0x07, 0x03, 1, 0, 8, 7, 6, 5, 0x0c, 0x0b, 0x0a, 9};
    struct hgp_header header = {0x01020304, HGP_T_frame, HGP_FLAG_OPTIONAL, 0x05060708, 0x090a0b0c};
    uint8_t bytes[HGP_HEADER_BYTES];
    hgp_header_encode(&header, bytes);
    assert_memory_equal(bytes, want, sizeof want);
    struct hgp_header back;
    assert_int_equal(hgp_header_decode(bytes, sizeof bytes, 0x01020304, &back), HG_OK);
    assert_memory_equal(&back, &header, sizeof header);
    assert_int_equal(hgp_header_decode(bytes, sizeof bytes, 0x01020303, &back), HG_E_LIMIT);
    assert_int_equal(back.length, 0);
}

static void test_header_refusals(void **state)
{
    (void)state;
    struct hgp_header header = {.length = 0, .type = HGP_T_ping}, back;
    uint8_t bytes[HGP_HEADER_BYTES];
    for (unsigned bit = 0; bit < 16; bit++) {
        header.flags = (uint16_t)(1u << bit);
        hgp_header_encode(&header, bytes);
        assert_int_equal(
            hgp_header_decode(bytes, sizeof bytes, 0, &back), bit == 0 ? HG_OK : HG_E_FORMAT);
    }
    for (size_t size = 0; size < HGP_HEADER_BYTES; size++) {
        uint8_t *prefix = malloc(size ? size : 1);
        assert_non_null(prefix);
        memcpy(prefix, bytes, size);
        assert_int_equal(hgp_header_decode(prefix, size, UINT32_MAX, &back), HG_E_TRUNCATED);
        free(prefix);
    }
}

static void test_preface_bytes(void **state)
{
    (void)state;
    static const uint8_t want[] = {'H', 'G', 'P', 0x0d, 0x0a, 0x1a, 0x0a, 0x01};
    assert_int_equal(sizeof HGP_PREFACE - 1, HGP_PREFACE_BYTES);
    assert_memory_equal(HGP_PREFACE, want, sizeof want);
}

// ---- literal messages --------------------------------------------------------------------------

static void assert_encodes(enum hgp_type type, const void *in, const uint8_t *want, size_t size)
{
    struct hg_writer w = {0};
    struct hgp_fault fault = {0};
    assert_int_equal(hgp_encode(&w, 1, (struct hgp_envelope){type, 0, 0}, in, &fault), HG_OK);
    assert_int_equal(w.size, HGP_HEADER_BYTES + size);
    assert_memory_equal(w.data + HGP_HEADER_BYTES, want, size);
    hg_writer_finish(&w);
}

static void test_hello_bytes(void **state)
{
    (void)state;
    static const uint8_t want[] = {
        1, 0, 2, 0, 3, 0, 0, 0, 'a', 'b', 'c', 1, 0, 0, 0, 1, 0, 0, 0, 'x'};
    struct hgp_text capability = {hgp_str_make("x")};
    struct hgp_hello hello = {.version_min = 1,
        .version_max = 2,
        .client = hgp_str_make("abc"),
        .capabilities = {&capability, 1}};
    assert_encodes(HGP_T_hello, &hello, want, sizeof want);
    struct hgp_hello back;
    assert_int_equal(
        hgp_decode(1, HGP_T_hello, hg_reader_make(want, sizeof want), &arena, &back, NULL), HG_OK);
    assert_int_equal(back.version_max, 2);
    assert_ptr_equal(back.client.data, want + 8); // borrowed, not copied
    assert_int_equal(back.capabilities.count, 1);
    assert_memory_equal(back.capabilities.items[0].value.data, "x", 1);
}

static void test_optional_fields_bytes(void **state)
{
    (void)state;
    // translation is the second OPT field of node_set, visible the fifth.
    static const uint8_t want[] = {
        0x12, 0, 0, 0, 7, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0x80, 0x3f, 0, 0, 0, 0xc0, 0, 0, 0, 0x3f, 1};
    struct hgp_node_set set = {.node = UINT64_C(1) << 32 | 7,
        .has_translation = true,
        .translation = {1, -2, 0.5f},
        .has_visible = true,
        .visible = true,
        .mesh = 99}; // not there: has_mesh is false
    assert_encodes(HGP_T_node_set, &set, want, sizeof want);
    struct hgp_node_set back;
    assert_int_equal(
        hgp_decode(1, HGP_T_node_set, hg_reader_make(want, sizeof want), NULL, &back, NULL), HG_OK);
    assert_true(back.has_translation && back.has_visible && back.visible);
    assert_false(back.has_mesh || back.has_parent || back.has_name);
    assert_int_equal(back.mesh, 0);
    assert_true(back.translation[1] == -2.0f);
}

static void test_number_bytes(void **state)
{
    (void)state;
    // animation_set: u32, i32 -1, f64 1.5
    static const uint8_t want[] = {
        2, 0, 0, 0, 0xff, 0xff, 0xff, 0xff, 0, 0, 0, 0, 0, 0, 0xf8, 0x3f};
    struct hgp_animation_set set = {.asset = 2, .animation = -1, .time_s = 1.5};
    assert_encodes(HGP_T_animation_set, &set, want, sizeof want);
    struct hgp_animation_set back;
    assert_int_equal(
        hgp_decode(1, HGP_T_animation_set, hg_reader_make(want, sizeof want), NULL, &back, NULL),
        HG_OK);
    assert_int_equal(back.animation, -1);
    assert_true(back.time_s == 1.5);
}

static void test_empty_message(void **state)
{
    (void)state;
    struct hgp_scene_close close = {0};
    assert_encodes(HGP_T_scene_close, &close, NULL, 0);
    assert_int_equal(
        hgp_decode(1, HGP_T_scene_close, hg_reader_make(NULL, 0), NULL, &close, NULL), HG_OK);
}

// ---- unknown types, versions -------------------------------------------------------------------

// Peers of before may still send them: they are unknown, whatever comes later.
static void test_retired_types(void **state)
{
    (void)state;
    static const uint16_t types[] = {
#define HGP_RETIRED(name, id, doc) id,
#include "protocol/messages.def"
    };
    for (size_t i = 0; i < sizeof types / sizeof *types; i++) {
        memset(&message, 0xa5, sizeof message);
        assert_null(hgp_find(types[i]));
        assert_int_equal(
            hgp_decode(HGP_VERSION_MAX, types[i], hg_reader_make(NULL, 0), &arena, &message, NULL),
            HG_E_UNSUPPORTED);
    }
}

static void test_unknown_type(void **state)
{
    (void)state;
    struct hgp_fault fault = {0};
    assert_null(hgp_find(0));
    assert_null(hgp_find(0xffff));
    assert_int_equal(
        hgp_decode(1, 0xffff, hg_reader_make(NULL, 0), NULL, &message, &fault), HG_E_UNSUPPORTED);
    assert_true(fault.reason[0]);
    struct hg_writer w = {0};
    assert_int_equal(
        hgp_encode(&w, 1, (struct hgp_envelope){(enum hgp_type)0x7fff, 0, 0}, &message, NULL),
        HG_E_UNSUPPORTED);
    assert_int_equal(hgp_encode(&w, 0, (struct hgp_envelope){HGP_T_ping, 0, 0}, &message, NULL),
        HG_E_UNSUPPORTED);
    assert_int_equal(w.size, 0);
    struct hgp_ping ping = {.nonce = 5};
    uint8_t payload[8] = {5};
    assert_int_equal(
        hgp_decode(0, HGP_T_ping, hg_reader_make(payload, 8), NULL, &ping, NULL), HG_E_UNSUPPORTED);
    assert_int_equal(ping.nonce, 0);
}

// A message as it looks after two extensions: version 2 added `b` and the OPT `c`.
struct grown {
    uint32_t a;
    bool has_o;
    uint8_t o;
    uint16_t b;
    bool has_c;
    uint8_t c;
};

static const struct hgp_field grown_fields[] = {
    {"a", HGP_K_U32, HGP_P_REQ, 1, offsetof(struct grown, a), 4, 0, .limit.u = {0, UINT32_MAX}},
    {"o", HGP_K_U8, HGP_P_OPT, 1, offsetof(struct grown, o), 1, offsetof(struct grown, has_o),
        .limit.u = {0, 255}},
    {"b", HGP_K_U16, HGP_P_REQ, 2, offsetof(struct grown, b), 2, 0, .limit.u = {0, 65535}},
    {"c", HGP_K_U8, HGP_P_OPT, 2, offsetof(struct grown, c), 1, offsetof(struct grown, has_c),
        .limit.u = {0, 255}},
};
static const struct hgp_layout grown_layout = {"grown", grown_fields, 4, sizeof(struct grown)};

static void assert_grown(uint16_t version, const uint8_t *want, size_t size)
{
    struct grown in = {1, true, 2, 3, true, 4}, back;
    struct hg_writer w = {0};
    assert_int_equal(hgp_layout_encode(&grown_layout, version, &w, &in, NULL), HG_OK);
    assert_int_equal(w.size, size);
    assert_memory_equal(w.data, want, size);
    struct hg_reader r = hg_reader_make(w.data, w.size);
    assert_int_equal(hgp_layout_decode(&grown_layout, version, &r, NULL, &back, NULL), HG_OK);
    assert_int_equal(back.a, 1);
    assert_true(back.has_o && back.o == 2);
    assert_int_equal(back.b, version >= 2 ? 3 : 0);
    assert_int_equal(back.has_c, version >= 2);
    assert_int_equal(back.c, version >= 2 ? 4 : 0);
    hg_writer_finish(&w);
}

static void test_fields_of_later_versions(void **state)
{
    (void)state;
    static const uint8_t v1[] = {1, 0, 0, 0, 1, 0, 0, 0, 2};
    static const uint8_t v2[] = {3, 0, 0, 0, 1, 0, 0, 0, 2, 3, 0, 4};
    assert_grown(1, v1, sizeof v1);
    assert_grown(2, v2, sizeof v2);
    // The bit of a later field is unknown to the older version, its bytes are extra bytes.
    struct grown back;
    struct hgp_fault fault;
    struct hg_reader r = hg_reader_make(v2, sizeof v2);
    assert_int_equal(hgp_layout_decode(&grown_layout, 1, &r, NULL, &back, &fault), HG_E_FORMAT);
    assert_string_equal(fault.field, "has");
}

// ---- refusals of the encoder -------------------------------------------------------------------

// Makes the member break its rule; false when it has none.
static bool break_member(const struct hgp_field *field, void *member)
{
    static char bad_text[2] = {'\xc0', '\x80'};
    static uint32_t unknown = 60000;
    struct hgp_any_list list = {NULL, 0};
    switch (field->kind) {
    case HGP_K_U8:
        *(uint8_t *)member = (uint8_t)(field->limit.u.most + 1);
        return field->limit.u.most < UINT8_MAX;
    case HGP_K_U16:
        *(uint16_t *)member = (uint16_t)(field->limit.u.least - 1);
        return field->limit.u.least > 0;
    case HGP_K_U32:
        *(uint32_t *)member = (uint32_t)(field->limit.u.least - 1);
        return field->limit.u.least > 0;
    case HGP_K_U64:
        *(uint64_t *)member = field->limit.u.most + 1;
        return field->limit.u.most < UINT64_MAX;
    case HGP_K_I32:
        *(int32_t *)member = (int32_t)field->limit.i.least - 1;
        return true;
    case HGP_K_F32:
        *(float *)member = __builtin_nanf("");
        return true;
    case HGP_K_F64:
        *(double *)member = __builtin_inf();
        return true;
    case HGP_K_ENUM:
        memcpy(member, &unknown, sizeof unknown);
        return true;
    case HGP_K_STR:
        *(struct hgp_str *)member = (struct hgp_str){bad_text, 2};
        return true;
    case HGP_K_BYTES: // never read: the size is refused first
        *(struct hgp_bytes *)member = (struct hgp_bytes){NULL, field->limit.max_bytes + 1};
        return true;
    case HGP_K_LIST:
        list.count = field->limit.list.max_count + 1;
        memcpy(member, &list, sizeof list);
        return true;
    case HGP_K_BOOL:
    case HGP_K_HASH:
        return false;
    default:
        ((float *)member)[hgp_kind_floats(field->kind) - 1] = -__builtin_inff();
        return true;
    }
}

static void expect_reason(
    enum hgp_type type, const void *bad, const char *field, const char *reason)
{
    struct hg_writer w = {0};
    struct hgp_fault fault = {0};
    assert_int_equal(
        hgp_encode(&w, HGP_VERSION_MAX, (struct hgp_envelope){type, 0, 0}, bad, &fault),
        HG_E_INVAL);
    assert_string_equal(fault.field, field);
    assert_string_equal(fault.reason, reason);
    hg_writer_finish(&w);
}

static void test_reasons_name_value_and_range(void **state)
{
    (void)state;
    expect_reason(HGP_T_view_set,
        &(struct hgp_view_set){.view = 1, .has_quality = true, .quality = 101}, "quality",
        "101 is outside of 1 to 100");
    expect_reason(HGP_T_view_set,
        &(struct hgp_view_set){.view = 1, .has_exposure_ev = true, .exposure_ev = 32.5f},
        "exposure_ev", "32.5 is outside of -32 to 32");
    expect_reason(HGP_T_view_camera,
        &(struct hgp_view_camera){.view = 1, .has_eye = true, .eye = {0, __builtin_nanf(""), 0}},
        "eye", "nan is not a finite number");
}

static void test_encoder_refuses_bad_values(void **state)
{
    (void)state;
    const struct hgp_message_info *info;
    struct hg_writer w = {0};
    hg_write_u8(&w, 77);
    size_t broken = 0;
    for (size_t n = 0; (info = hgp_message_at(n)); n++) {
        const struct hgp_layout *layout = hgp_layout_find((uint16_t)info->type);
        for (size_t i = 0; i < layout->field_count; i++) {
            struct hgp_fault fault = {0};
            sample_fill(layout, SAMPLE_FULL, &arena, &message);
            if (!break_member(&layout->fields[i], (char *)&message + layout->fields[i].offset))
                continue;
            assert_int_equal(
                hgp_encode(&w, 1, (struct hgp_envelope){info->type, 0, 0}, &message, &fault),
                HG_E_INVAL);
            assert_string_equal(fault.field, layout->fields[i].name);
            assert_true(fault.reason[0]);
            assert_int_equal(w.size, 1);
            assert_int_equal(w.data[0], 77);
            assert_false(w.failed);
            broken++;
        }
    }
    assert_true(broken > 100);
    hg_writer_finish(&w);
}

// ---- lengths at their greatest -----------------------------------------------------------------

enum { MAX_TRIED_BYTES = 16 << 20 }; // longer fields differ in nothing but the number

// Gives the member its greatest length plus `more`; false when that is not tried.
static bool fill_to_limit(
    const struct hgp_field *field, void *member, uint32_t more, struct hg_arena *memory)
{
    if (field->kind == HGP_K_LIST) {
        const struct hgp_layout *layout = field->limit.list.items();
        struct hgp_any_list list = {NULL, field->limit.list.max_count + more};
        char *items = hg_arena_alloc(memory, list.count, layout->struct_size);
        assert_non_null(items);
        for (uint32_t i = 0; i < list.count; i++)
            sample_fill(layout, SAMPLE_BARE, memory, items + i * layout->struct_size);
        list.items = items;
        memcpy(member, &list, sizeof list);
        return true;
    }
    if ((field->kind != HGP_K_STR && field->kind != HGP_K_BYTES) ||
        field->limit.max_bytes > MAX_TRIED_BYTES)
        return false;
    struct hgp_bytes view = {NULL, field->limit.max_bytes + more};
    uint8_t *bytes = hg_arena_alloc(memory, view.size, 1);
    assert_non_null(bytes);
    memset(bytes, 'x', view.size);
    if (field->kind == HGP_K_STR)
        *(struct hgp_str *)member = (struct hgp_str){(const char *)bytes, view.size};
    else
        *(struct hgp_bytes *)member = (struct hgp_bytes){bytes, view.size};
    return true;
}

static void try_limit(const struct hgp_message_info *info, const struct hgp_field *field)
{
    const struct hgp_layout *layout = hgp_layout_find((uint16_t)info->type);
    struct hg_arena memory = {0};
    struct hgp_fault fault = {0};
    struct hg_writer w = {0};
    sample_fill(layout, SAMPLE_FULL, &memory, &message);
    void *member = (char *)&message + field->offset;
    if (fill_to_limit(field, member, 0, &memory)) {
        assert_int_equal(
            hgp_encode(&w, 1, (struct hgp_envelope){info->type, 0, 0}, &message, &fault), HG_OK);
        assert_int_equal(hgp_decode(1, (uint16_t)info->type,
                             hg_reader_make(w.data + HGP_HEADER_BYTES, w.size - HGP_HEADER_BYTES),
                             &memory, &other, &fault),
            HG_OK);
        assert_true(fill_to_limit(field, member, 1, &memory));
        assert_int_equal(
            hgp_encode(&w, 1, (struct hgp_envelope){info->type, 0, 0}, &message, &fault),
            HG_E_INVAL);
        assert_string_equal(fault.field, field->name);
    }
    hg_writer_finish(&w);
    hg_arena_finish(&memory);
}

static void test_lengths_at_their_limit(void **state)
{
    (void)state;
    const struct hgp_message_info *info;
    for (size_t n = 0; (info = hgp_message_at(n)); n++) {
        const struct hgp_layout *layout = hgp_layout_find((uint16_t)info->type);
        for (size_t i = 0; i < layout->field_count; i++)
            try_limit(info, &layout->fields[i]);
    }
}

static void test_writer_limits(void **state)
{
    (void)state;
    struct hgp_ping ping = {.nonce = 1};
    struct hgp_fault fault = {0};
    struct hg_writer w = {.limit_bytes = 2 * 24 + 23};
    assert_int_equal(
        hgp_encode(&w, 1, (struct hgp_envelope){HGP_T_ping, 0, 0}, &ping, &fault), HG_OK);
    assert_int_equal(
        hgp_encode(&w, 1, (struct hgp_envelope){HGP_T_ping, 0, 0}, &ping, &fault), HG_OK);
    assert_int_equal(
        hgp_encode(&w, 1, (struct hgp_envelope){HGP_T_ping, 0, 0}, &ping, &fault), HG_E_NOMEM);
    assert_int_equal(w.size, 48); // nothing appended, still usable
    struct hgp_scene_close small = {0};
    assert_int_equal(
        hgp_encode(&w, 1, (struct hgp_envelope){HGP_T_scene_close, 0, 0}, &small, &fault), HG_OK);
    assert_int_equal(w.size, 64);
    w.failed = true;
    assert_int_equal(
        hgp_encode(&w, 1, (struct hgp_envelope){HGP_T_scene_close, 0, 0}, &small, &fault),
        HG_E_NOMEM);
    hg_writer_finish(&w);
}

// ---- memory ------------------------------------------------------------------------------------

static void test_no_memory_for_absent_items(void **state)
{
    (void)state;
    // upload_query with 1024 hashes announced and one there.
    uint8_t payload[4 + 32] = {0, 4};
    struct hgp_upload_query query;
    struct hgp_fault fault;
    struct hg_arena small = {0};
    assert_int_equal(hgp_decode(1, HGP_T_upload_query, hg_reader_make(payload, sizeof payload),
                         &small, &query, &fault),
        HG_E_TRUNCATED);
    assert_int_equal(small.used_bytes, 0);
    assert_null(small.head);
    // With all of them there, the arena's limit still holds.
    uint8_t *whole = calloc(1, 4 + 1024 * 32);
    assert_non_null(whole);
    whole[1] = 4;
    small.limit_bytes = 1024 * 32 - 1;
    assert_int_equal(hgp_decode(1, HGP_T_upload_query, hg_reader_make(whole, 4 + 1024 * 32), &small,
                         &query, &fault),
        HG_E_NOMEM);
    assert_string_equal(fault.field, "contents");
    small.limit_bytes = 1024 * 32;
    assert_int_equal(hgp_decode(1, HGP_T_upload_query, hg_reader_make(whole, 4 + 1024 * 32), &small,
                         &query, &fault),
        HG_OK);
    assert_int_equal(query.contents.count, 1024);
    hg_arena_finish(&small);
    free(whole);
}

// One decode and one encode of every message; HG_E_NOMEM only when an allocation failed.
static enum hg_status round_trip(const struct hgp_message_info *info, const struct hg_writer *in)
{
    struct hg_arena own = {0};
    struct hg_writer w = {0};
    enum hg_status status = hgp_decode(1, (uint16_t)info->type,
        hg_reader_make(in->data + HGP_HEADER_BYTES, in->size - HGP_HEADER_BYTES), &own, &other,
        NULL);
    if (!status)
        status = hgp_encode(&w, 1, (struct hgp_envelope){info->type, 1, 0}, &other, NULL);
    if (!status) {
        assert_int_equal(w.size, in->size);
        assert_memory_equal(w.data, in->data, w.size);
    } else {
        assert_int_equal(w.size, 0);
    }
    hg_writer_finish(&w);
    hg_arena_finish(&own);
    return status;
}

// Fails the n-th allocation until the run succeeds.
static void test_allocation_torture(void **state)
{
    (void)state;
    const struct hgp_message_info *info;
    for (size_t n = 0; (info = hgp_message_at(n)); n++) {
        struct hg_writer in = {0};
        sample_fill(hgp_layout_find((uint16_t)info->type), SAMPLE_FULL, &arena, &message);
        assert_int_equal(
            hgp_encode(&in, 1, (struct hgp_envelope){info->type, 1, 0}, &message, NULL), HG_OK);
        uint64_t fail_at = 1;
        for (;; fail_at++) {
            hg_alloc_fail_at(fail_at);
            enum hg_status status = round_trip(info, &in);
            bool struck = hg_alloc_count() >= fail_at;
            hg_alloc_fail_at(0);
            assert_int_equal(status, struck ? HG_E_NOMEM : HG_OK);
            if (!struck)
                break;
        }
        assert_true(fail_at > 1 && fail_at < 100); // at least the writer's own allocation
        hg_writer_finish(&in);
    }
}

// ---- merge -------------------------------------------------------------------------------------

static void dump_text(const struct hgp_layout *layout, const void *m, struct hg_writer *text)
{
    *text = (struct hg_writer){0};
    sample_dump(layout, m, text);
}

// Replaces REQ fields by those of `from` in the C struct, without the codec.
static void expect_merge(const struct hgp_layout *layout, void *into, const void *from)
{
    for (size_t i = 0; i < layout->field_count; i++)
        if (layout->fields[i].presence == HGP_P_REQ)
            memcpy((char *)into + layout->fields[i].offset,
                (const char *)from + layout->fields[i].offset, layout->fields[i].size);
}

static void assert_merge(const struct hgp_message_info *info, enum sample_variant into_variant,
    enum sample_variant from_variant)
{
    static union hgp_any want;
    const struct hgp_layout *layout = hgp_layout_find((uint16_t)info->type);
    struct hg_writer got_text, want_text;
    sample_fill(layout, into_variant, &arena, &message);
    sample_fill(layout, from_variant, &arena, &other);
    // FULL over anything gives FULL; BARE over anything changes the REQ fields only.
    want = from_variant == SAMPLE_FULL ? other : message;
    expect_merge(layout, &want, &other);
    hgp_merge(info->type, &message, &other);
    dump_text(layout, &message, &got_text);
    dump_text(layout, &want, &want_text);
    assert_int_equal(got_text.size, want_text.size);
    assert_memory_equal(got_text.data, want_text.data, want_text.size);
    hg_writer_finish(&got_text);
    hg_writer_finish(&want_text);
}

static void test_merge(void **state)
{
    (void)state;
    const struct hgp_message_info *info;
    for (size_t n = 0; (info = hgp_message_at(n)); n++) {
        assert_merge(info, SAMPLE_BARE, SAMPLE_FULL);
        assert_merge(info, SAMPLE_MOST, SAMPLE_FULL);
        assert_merge(info, SAMPLE_FULL, SAMPLE_BARE);
    }
    struct hgp_view_set into = {
        .view = 1, .has_width = true, .width = 10, .has_seed = true, .seed = 3};
    struct hgp_view_set from = {.view = 1, .has_width = true, .width = 20, .height = 7};
    hgp_merge(HGP_T_view_set, &into, &from);
    assert_int_equal(into.width, 20);
    assert_false(into.has_height); // absent in `from`, whatever its member says
    assert_true(into.has_seed && into.seed == 3);
}

// ---- names, tables -----------------------------------------------------------------------------

static void test_enum_names(void **state)
{
    (void)state;
    uint32_t value = 99;
    assert_string_equal(hgp_enum_name("encoding", 5), "JPEG");
    assert_null(hgp_enum_name("encoding", 999));
    assert_null(hgp_enum_name("nothing", 0));
    assert_true(hgp_enum_value("tonemap", "pbr-neutral", &value));
    assert_int_equal(value, HGP_tonemap_PBR_NEUTRAL);
    assert_true(hgp_enum_value("tonemap", "Pbr_Neutral", &value));
    assert_true(hgp_enum_value("encoding", "jpeg", &value));
    assert_int_equal(value, 5);
    assert_false(hgp_enum_value("encoding", "jpe", &value));
    assert_int_equal(value, 0);
    assert_false(hgp_enum_value("encoding", "jpegs", &value));
    assert_false(hgp_enum_value("encoding", "", &value));
    assert_false(hgp_enum_value("nothing", "jpeg", &value));
}

// Only where all fields behind a second bitmap are optional does the end of a payload say that it
// is left out.
static void check_fields(const struct hgp_layout *layout, unsigned bitmaps)
{
    unsigned optional = 0;
    for (size_t i = 0; i < layout->field_count; i++) {
        const struct hgp_field *field = &layout->fields[i];
        optional += field->presence == HGP_P_OPT;
        assert_in_range(field->since, 1, HGP_VERSION_MAX);
        if (i > 0) // fields are only added at the end
            assert_true(field->since >= layout->fields[i - 1].since);
        assert_true(field->offset + field->size <= layout->struct_size);
        if (field->kind == HGP_K_LIST) {
            assert_int_equal(field->size, sizeof(struct hgp_any_list));
            assert_true(hgp_layout_least_bytes(field->limit.list.items(), 1) > 0);
            check_fields(field->limit.list.items(), 1);
        }
        assert_true(optional <= HGP_BITMAP_FIELDS || field->presence == HGP_P_OPT);
    }
    assert_true(optional <= HGP_BITMAP_FIELDS * bitmaps);
}

static void test_tables(void **state)
{
    (void)state;
    const struct hgp_message_info *info;
    int last = 0;
    for (size_t n = 0; (info = hgp_message_at(n)); n++) {
        assert_true((int)info->type > last); // ids rise through the file, so they are unique
        last = (int)info->type;
        assert_ptr_equal(hgp_find((uint16_t)info->type), info);
        assert_in_range(info->since, 1, HGP_VERSION_MAX);
        const struct hgp_layout *layout = hgp_layout_find((uint16_t)info->type);
        assert_string_equal(layout->name, info->name);
        assert_int_equal(layout->struct_size, info->struct_size);
        check_fields(layout, HGP_BITMAPS);
    }
    const struct hgp_message_info *frame = hgp_find(HGP_T_frame);
    assert_int_equal(frame->direction, HGP_S2C);
    assert_int_equal(frame->state, HGP_OPEN);
    assert_int_equal(hgp_find(HGP_T_sessions_query)->role, HGP_role_ADMIN);
}

static void test_str_fit(void **state)
{
    (void)state;
    assert_int_equal(hgp_str_fit(NULL, 10).size, 0);
    assert_int_equal(hgp_str_fit("", 10).size, 0);
    assert_int_equal(hgp_str_fit("abc", 10).size, 3);
    assert_int_equal(hgp_str_fit("abc", 2).size, 2);
    assert_int_equal(hgp_str_fit("a\xc3\xa9z", 2).size, 1); // not half of the e acute
    assert_int_equal(hgp_str_fit("a\xc3\xa9z", 3).size, 3);
    assert_int_equal(hgp_str_fit("ab\xffz", 10).size, 2);
    char *exact = malloc(3); // not terminated within the limit
    assert_non_null(exact);
    memcpy(exact, "abc", 3);
    assert_int_equal(hgp_str_fit(exact, 3).size, 3);
    free(exact);
}

static void test_fault_paths(void **state)
{
    (void)state;
    struct hgp_fault fault;
    struct hgp_place outer = {NULL, "parts", 3}, inner = {&outer, "items", 12};
    hgp_fault_set(&fault, HG_E_INVAL, &inner, "mode", 5, "why");
    assert_string_equal(fault.field, "parts[3].items[12].mode");
    assert_int_equal(fault.offset, 5);
    struct hgp_place deep = {&inner, "a_very_long_name_of_a_list_that_does_not_end_for_a_while", 1};
    hgp_fault_set(&fault, HG_E_INVAL, &deep, "mode", 5, "why");
    assert_int_equal(strlen(fault.field), sizeof fault.field - 1);
    assert_int_equal(hgp_fault_set(NULL, HG_E_INVAL, NULL, "x", 0, "why"), HG_E_INVAL);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_header_bytes),
        cmocka_unit_test(test_header_refusals),
        cmocka_unit_test(test_preface_bytes),
        cmocka_unit_test(test_hello_bytes),
        cmocka_unit_test(test_optional_fields_bytes),
        cmocka_unit_test(test_number_bytes),
        cmocka_unit_test(test_empty_message),
        cmocka_unit_test(test_unknown_type),
        cmocka_unit_test(test_retired_types),
        cmocka_unit_test(test_fields_of_later_versions),
        cmocka_unit_test(test_encoder_refuses_bad_values),
        cmocka_unit_test(test_reasons_name_value_and_range),
        cmocka_unit_test(test_lengths_at_their_limit),
        cmocka_unit_test(test_writer_limits),
        cmocka_unit_test(test_no_memory_for_absent_items),
        cmocka_unit_test(test_allocation_torture),
        cmocka_unit_test(test_merge),
        cmocka_unit_test(test_enum_names),
        cmocka_unit_test(test_tables),
        cmocka_unit_test(test_str_fit),
        cmocka_unit_test(test_fault_paths),
    };
    return cmocka_run_group_tests(tests, NULL, finish_arena);
}
