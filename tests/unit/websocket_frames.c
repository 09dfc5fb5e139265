// websocket_frames.c - frames of RFC 6455 from bytes: its own examples, each rule that can be
// broken, every border of pieces.
#include <setjmp.h>
#include <stdarg.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "base/bytes.h"
#include "protocol/websocket.h"

static const uint8_t mask[4] = {0x37, 0xfa, 0x21, 0x3d};

static void put_frame(struct hg_writer *w, unsigned first, const void *payload, size_t size)
{
    uint8_t header[HG_WS_HEADER_BYTES], *masked = malloc(size + 1);
    size_t n = hg_ws_header(header, (enum hg_ws_opcode)(first & 0x0f), size, mask);
    header[0] = (uint8_t)first;
    hg_write_bytes(w, header, n);
    hg_ws_mask(masked, payload, size, mask, 0);
    hg_write_bytes(w, masked, size);
    free(masked);
}

// Reads a stream in pieces of `step` bytes, each in a block of exactly its size and in place. Data
// goes to `data`; returns the event that ended it, HG_WS_MORE if none did; counts pings.
static enum hg_ws_event run(struct hg_ws_reader *r, const struct hg_writer *in, size_t step,
    struct hg_writer *data, int *pings)
{
    for (size_t at = 0; at < in->size; at += step) {
        size_t size = in->size - at < step ? in->size - at : step;
        uint8_t *piece = malloc(size);
        memcpy(piece, in->data + at, size);
        enum hg_ws_event event = HG_WS_MORE;
        for (size_t src = 0, dst = 0, used, got; src < size && event < HG_WS_CLOSED; src += used) {
            event = hg_ws_read(r, piece + src, size - src, piece + dst, &used, &got);
            assert_true(used <= size - src && got <= used);
            hg_write_bytes(data, piece + dst, got);
            dst += got;
            if (event == HG_WS_PINGED && pings)
                ++*pings;
        }
        free(piece);
        if (event >= HG_WS_CLOSED)
            return event;
    }
    return HG_WS_MORE;
}

static void the_examples_of_the_rfc(void **state) // 5.7
{
    (void)state;
    static const uint8_t hello[] = {
        0x82, 0x85, 0x37, 0xfa, 0x21, 0x3d, 0x7f, 0x9f, 0x4d, 0x51, 0x58};
    struct hg_writer in = {0}, data = {0};
    struct hg_ws_reader r = {.masked = true};
    hg_write_bytes(&in, hello, sizeof hello);
    assert_int_equal(run(&r, &in, sizeof hello, &data, NULL), HG_WS_MORE);
    assert_int_equal(data.size, 5);
    assert_memory_equal(data.data, "Hello", 5);
    // Of a server: not masked, in two fragments.
    static const uint8_t parts[] = {0x02, 0x03, 0x48, 0x65, 0x6c, 0x80, 0x02, 0x6c, 0x6f};
    struct hg_ws_reader client = {0};
    in.size = data.size = 0;
    hg_write_bytes(&in, parts, sizeof parts);
    assert_int_equal(run(&client, &in, 1, &data, NULL), HG_WS_MORE);
    assert_memory_equal(data.data, "Hello", 5);
    char accept[HG_WS_ACCEPT_CHARS + 1]; // 1.3
    assert_int_equal(hg_ws_accept("dGhlIHNhbXBsZSBub25jZQ==", accept), HG_OK);
    assert_string_equal(accept, "s3pPLMBiTxaQ9kYGzzhZRbK+xOo=");
    hg_writer_finish(&in);
    hg_writer_finish(&data);
}

// Fragments, pings between them, all three forms of a length; in pieces of every size.
static void borders_mean_nothing(void **state)
{
    (void)state;
    static uint8_t bytes[70000];
    struct hg_writer in = {0};
    for (size_t i = 0; i < sizeof bytes; i++)
        bytes[i] = (uint8_t)(i * 31 + i / 256);
    put_frame(&in, 0x02, bytes, 125);
    put_frame(&in, 0x89, "ping", 4);
    put_frame(&in, 0x00, bytes + 125, 0);
    put_frame(&in, 0x00, bytes + 125, 126);
    put_frame(&in, 0x89, bytes, 125);
    put_frame(&in, 0x80, bytes + 251, 65536);
    put_frame(&in, 0x8a, "", 0);
    put_frame(&in, 0x82, bytes + 65787, 4213);
    static const size_t steps[] = {1, 2, 3, 5, 7, 13, 64, 126, 1000, 65535, 1 << 20};
    for (size_t i = 0; i < sizeof steps / sizeof *steps; i++) {
        struct hg_ws_reader r = {.masked = true, .limit = 65787};
        struct hg_writer data = {0};
        int pings = 0;
        assert_int_equal(run(&r, &in, steps[i], &data, &pings), HG_WS_MORE);
        assert_int_equal(data.size, sizeof bytes);
        assert_memory_equal(data.data, bytes, sizeof bytes);
        assert_int_equal(pings, 2);
        hg_writer_finish(&data);
    }
    // One byte less is allowed of a message.
    struct hg_ws_reader r = {.masked = true, .limit = 65786};
    struct hg_writer data = {0};
    assert_int_equal(run(&r, &in, 1 << 20, &data, NULL), HG_WS_REJECTED);
    assert_int_equal(r.code, HG_WS_TOO_LARGE);
    hg_writer_finish(&data);
    hg_writer_finish(&in);
}

struct broken {
    const char *what;
    uint8_t bytes[24];
    size_t size;
    unsigned code;
};

static void each_rule_is_kept(void **state)
{
    (void)state;
    static const struct broken rows[] = {
        {"rsv1", {0xc2, 0x80, 0, 0, 0, 0}, 6, 1002},
        {"rsv2", {0xa2, 0x80, 0, 0, 0, 0}, 6, 1002},
        {"rsv3", {0x92, 0x80, 0, 0, 0, 0}, 6, 1002},
        {"opcode 3", {0x83, 0x80, 0, 0, 0, 0}, 6, 1002},
        {"opcode 7", {0x87, 0x80, 0, 0, 0, 0}, 6, 1002},
        {"opcode 11", {0x8b, 0x80, 0, 0, 0, 0}, 6, 1002},
        {"opcode 15", {0x8f, 0x80, 0, 0, 0, 0}, 6, 1002},
        {"not masked", {0x82, 0x01, 'a'}, 3, 1002},
        {"ping in fragments", {0x09, 0x80, 0, 0, 0, 0}, 6, 1002},
        {"ping of 126 bytes", {0x89, 0xfe, 0, 126, 0, 0, 0, 0}, 8, 1002},
        {"continuation of nothing", {0x80, 0x80, 0, 0, 0, 0}, 6, 1002},
        {"binary within binary", {0x02, 0x80, 0, 0, 0, 0, 0x82, 0x80, 0, 0, 0, 0}, 12, 1002},
        {"text within binary", {0x02, 0x80, 0, 0, 0, 0, 0x81, 0x80, 0, 0, 0, 0}, 12, 1002},
        {"length 125 in 2 bytes", {0x82, 0xfe, 0, 125, 0, 0, 0, 0}, 8, 1002},
        {"length 65535 in 8 bytes", {0x82, 0xff, 0, 0, 0, 0, 0, 0, 0xff, 0xff, 0, 0, 0, 0}, 14,
            1002},
        {"highest bit of a length", {0x82, 0xff, 0x80, 0, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0}, 14, 1002},
        {"a text", {0x81, 0x82, 0, 0, 0, 0, 'h', 'i'}, 8, 1003},
        {"an empty text", {0x81, 0x80, 0, 0, 0, 0}, 6, 1003},
        {"a text in UTF-8", {0x81, 0x84, 0, 0, 0, 0, 0xf0, 0x9f, 0x8c, 0x9e}, 10, 1003},
        {"a sequence over two fragments",
            {0x01, 0x82, 0, 0, 0, 0, 0xe2, 0x82, 0x80, 0x81, 0, 0, 0, 0, 0xac}, 15, 1003},
        {"a text of NUL", {0x81, 0x81, 0, 0, 0, 0, 0}, 7, 1003},
        {"no UTF-8", {0x81, 0x81, 0, 0, 0, 0, 0xff}, 7, 1007},
        {"overlong", {0x81, 0x82, 0, 0, 0, 0, 0xc0, 0xaf}, 8, 1007},
        {"surrogate", {0x81, 0x83, 0, 0, 0, 0, 0xed, 0xa0, 0x80}, 9, 1007},
        {"above U+10FFFF", {0x81, 0x84, 0, 0, 0, 0, 0xf4, 0x90, 0x80, 0x80}, 10, 1007},
        {"a cut sequence", {0x81, 0x82, 0, 0, 0, 0, 0xe2, 0x82}, 8, 1007},
        {"bad at once", {0x01, 0x82, 0, 0, 0, 0, 0xe2, 0x28}, 8, 1007},
        {"close of one byte", {0x88, 0x81, 0, 0, 0, 0, 3}, 7, 1002},
        {"close 999", {0x88, 0x82, 0, 0, 0, 0, 0x03, 0xe7}, 8, 1002},
        {"close 1004", {0x88, 0x82, 0, 0, 0, 0, 0x03, 0xec}, 8, 1002},
        {"close 1005", {0x88, 0x82, 0, 0, 0, 0, 0x03, 0xed}, 8, 1002},
        {"close 1006", {0x88, 0x82, 0, 0, 0, 0, 0x03, 0xee}, 8, 1002},
        {"close 1015", {0x88, 0x82, 0, 0, 0, 0, 0x03, 0xf7}, 8, 1002},
        {"close 2999", {0x88, 0x82, 0, 0, 0, 0, 0x0b, 0xb7}, 8, 1002},
        {"close 5000", {0x88, 0x82, 0, 0, 0, 0, 0x13, 0x88}, 8, 1002},
        {"reason without UTF-8", {0x88, 0x83, 0, 0, 0, 0, 0x03, 0xe8, 0xff}, 9, 1007},
    };
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++)
        for (size_t step = 1; step <= rows[i].size; step++) {
            struct hg_ws_reader r = {.masked = true, .limit = 1 << 20};
            struct hg_writer in = {.data = (uint8_t *)rows[i].bytes, .size = rows[i].size};
            struct hg_writer data = {0};
            enum hg_ws_event event = run(&r, &in, step, &data, NULL);
            if (event != HG_WS_REJECTED || r.code != rows[i].code || !r.reason || data.size)
                fail_msg("%s: event %d, code %u", rows[i].what, event, r.code);
            hg_writer_finish(&data);
        }
}

static void a_server_does_not_mask(void **state)
{
    (void)state;
    struct hg_writer in = {0}, data = {0};
    struct hg_ws_reader r = {0};
    put_frame(&in, 0x82, "x", 1);
    assert_int_equal(run(&r, &in, 9, &data, NULL), HG_WS_REJECTED);
    assert_int_equal(r.code, 1002);
    hg_writer_finish(&in);
    hg_writer_finish(&data);
}

static void closes(void **state)
{
    (void)state;
    static const unsigned codes[] = {1000, 1001, 1002, 1003, 1007, 1011, 1014, 3000, 4999};
    for (size_t i = 0; i <= sizeof codes / sizeof *codes; i++) {
        const bool plain = i == sizeof codes / sizeof *codes;
        const uint8_t payload[] = {
            (uint8_t)((plain ? 0 : codes[i]) >> 8), (uint8_t)(plain ? 0 : codes[i]), 0xc3, 0xa4};
        struct hg_ws_reader r = {.masked = true};
        struct hg_writer in = {0}, data = {0};
        put_frame(&in, 0x88, payload, plain ? 0 : sizeof payload);
        put_frame(&in, 0x82, "behind", 6); // means nothing
        assert_int_equal(run(&r, &in, 100, &data, NULL), HG_WS_CLOSED);
        assert_int_equal(r.code, plain ? HG_WS_NO_CODE : codes[i]);
        assert_int_equal(data.size, 0);
        hg_writer_finish(&in);
        hg_writer_finish(&data);
    }
}

static void keys(void **state)
{
    (void)state;
    assert_true(hg_ws_key_is_valid("dGhlIHNhbXBsZSBub25jZQ==", 24));
    assert_false(hg_ws_key_is_valid("dGhlIHNhbXBsZSBub25jZQ=", 23));
    assert_false(hg_ws_key_is_valid("dGhlIHNhbXBsZSBub25jZR==", 24)); // bits that mean nothing
    assert_false(hg_ws_key_is_valid("dGhlIHNhbXBsZSBub25jZ===", 24));
    assert_false(hg_ws_key_is_valid("dGhlIHNhb!BsZSBub25jZQ==", 24));
}

// Words or bytes, from any offset: masking is the same, and undoes itself.
static void masks(void **state)
{
    (void)state;
    uint8_t in[67], out[67], back[67];
    for (size_t i = 0; i < sizeof in; i++)
        in[i] = (uint8_t)(i * 7);
    for (unsigned at = 0; at < 4; at++)
        for (size_t size = 0; size <= sizeof in; size++) {
            hg_ws_mask(out, in, size, mask, at);
            for (size_t i = 0; i < size; i++)
                assert_int_equal(out[i], in[i] ^ mask[(at + i) % 4]);
            hg_ws_mask(back, out, size, mask, at);
            assert_memory_equal(back, in, size);
        }
}

// A reader that stands within a ping goes on from its bytes; no size in them is believed.
static void stored_readers(void **state)
{
    (void)state;
    struct hg_writer in = {0}, data = {0};
    struct hg_ws_reader r = {.masked = true}, bad;
    put_frame(&in, 0x89, "ping", 4);
    in.size--;
    assert_int_equal(run(&r, &in, 1, &data, NULL), HG_WS_MORE);
    assert_true(hg_ws_reader_is_sound(&r));
    assert_true(r.frame.begun && r.control_size == 3);
    bad = r;
    bad.frame.left = sizeof r.control;
    assert_false(hg_ws_reader_is_sound(&bad));
    bad = r;
    bad.control_size = sizeof r.control + 1;
    assert_false(hg_ws_reader_is_sound(&bad));
    bad = r;
    bad.utf8_size = sizeof r.utf8;
    assert_false(hg_ws_reader_is_sound(&bad));
    bad = r;
    bad.frame.mask_at = sizeof r.frame.mask;
    assert_false(hg_ws_reader_is_sound(&bad));
    bad = (struct hg_ws_reader){.masked = true, .frame.header_size = 3};
    assert_false(hg_ws_reader_is_sound(&bad));
    hg_writer_finish(&in);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_examples_of_the_rfc),
        cmocka_unit_test(borders_mean_nothing),
        cmocka_unit_test(each_rule_is_kept),
        cmocka_unit_test(a_server_does_not_mask),
        cmocka_unit_test(closes),
        cmocka_unit_test(stored_readers),
        cmocka_unit_test(keys),
        cmocka_unit_test(masks),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
