// bytes.h, sha256.h and utf8.h.
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "base/alloc.h"
#include "base/bytes.h"
#include "base/json.h"
#include "base/sha256.h"
#include "base/utf8.h"

static const uint8_t written[] = {0x01, 0x02, 0x01, 0x04, 0x03, 0x02, 0x01, 0x08, 0x07, 0x06, 0x05,
    0x04, 0x03, 0x02, 0x01, 0x00, 0x00, 0xc0, 0x3f, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x04, 0xc0,
    'h', 'i'};

static void write_all(struct hg_writer *w)
{
    hg_write_u8(w, 0x01);
    hg_write_u16(w, 0x0102);
    hg_write_u32(w, 0x01020304);
    hg_write_u64(w, 0x0102030405060708);
    hg_write_f32(w, 1.5f);
    hg_write_f64(w, -2.5);
    hg_write_bytes(w, "hi", 2);
}

static void test_written_bytes(void **state)
{
    (void)state;
    struct hg_writer w = {0};
    write_all(&w);
    assert_false(w.failed);
    assert_int_equal(w.size, sizeof written);
    assert_memory_equal(w.data, written, sizeof written);
    hg_write_patch_u32(&w, 3, 0xaabbccdd);
    assert_int_equal(w.data[3], 0xdd);
    assert_int_equal(w.data[6], 0xaa);
    assert_int_equal(w.data[7], 0x08);
    hg_writer_finish(&w);
    assert_null(w.data);
    hg_writer_finish(&w);
}

static void test_read_back(void **state)
{
    (void)state;
    struct hg_reader r = hg_reader_make(written, sizeof written);
    assert_int_equal(hg_read_u8(&r), 0x01);
    assert_int_equal(hg_read_u16(&r), 0x0102);
    assert_int_equal(hg_read_u32(&r), 0x01020304);
    assert_true(hg_read_u64(&r) == UINT64_C(0x0102030405060708));
    assert_true(hg_read_f32(&r) == 1.5f);
    assert_true(hg_read_f64(&r) == -2.5);
    assert_memory_equal(hg_read_bytes(&r, 2), "hi", 2);
    assert_int_equal(r.pos, r.size);
    assert_non_null(hg_read_bytes(&r, 0));
    assert_false(r.failed);
    assert_int_equal(hg_read_u8(&r), 0);
    assert_true(r.failed);
    assert_int_equal(r.pos, sizeof written);
}

// Each read on a block that is one byte too short: fails, stays, and fails for ever.
static void test_short_reads(void **state)
{
    (void)state;
    for (int kind = 0; kind < 5; kind++) {
        static const size_t sizes[] = {1, 2, 4, 8, 3};
        size_t have = sizes[kind] - 1;
        uint8_t *block = malloc(have ? have : 1);
        assert_non_null(block);
        memset(block, 0xff, have);
        struct hg_reader r = hg_reader_make(block, have);
        switch (kind) {
        case 0:
            assert_int_equal(hg_read_u8(&r), 0);
            break;
        case 1:
            assert_int_equal(hg_read_u16(&r), 0);
            break;
        case 2:
            assert_true(hg_read_f32(&r) == 0);
            break;
        case 3:
            assert_true(hg_read_f64(&r) == 0);
            break;
        default:
            assert_null(hg_read_bytes(&r, 3));
        }
        assert_true(r.failed);
        assert_int_equal(r.pos, 0);
        assert_null(hg_read_bytes(&r, 0));
        assert_int_equal(hg_read_u8(&r), 0);
        free(block);
    }
    struct hg_reader r = hg_reader_make(written, sizeof written);
    hg_read_u8(&r);
    assert_null(hg_read_bytes(&r, SIZE_MAX)); // pos + size would wrap
    assert_int_equal(r.pos, 1);
}

static void test_reading_nothing(void **state)
{
    (void)state;
    struct hg_reader r = hg_reader_make(NULL, 0);
    assert_non_null(hg_read_bytes(&r, 0));
    assert_false(r.failed);
    assert_int_equal(hg_read_u32(&r), 0);
    assert_true(r.failed);
}

static void test_writer_limit(void **state)
{
    (void)state;
    struct hg_writer w = {.limit_bytes = 6};
    hg_write_u32(&w, 1);
    hg_write_u16(&w, 2);
    assert_false(w.failed);
    hg_write_u8(&w, 3);
    assert_true(w.failed);
    assert_int_equal(w.size, 6);
    hg_write_bytes(&w, NULL, 0);
    hg_write_patch_u32(&w, 0, 0xffffffff); // a failed writer changes nothing
    assert_int_equal(w.data[0], 1);
    hg_writer_finish(&w);
}

// The n-th allocation fails until the writing succeeds; what was written before stays right.
static void test_writer_torture(void **state)
{
    (void)state;
    for (uint64_t n = 1;; n++) {
        struct hg_writer w = {0};
        hg_alloc_fail_at(n);
        for (int i = 0; i < 20; i++)
            write_all(&w);
        bool struck = hg_alloc_count() >= n;
        hg_alloc_fail_at(0);
        assert_int_equal(w.failed, struck);
        for (size_t i = 0; i < w.size; i++)
            assert_int_equal(w.data[i], written[i % sizeof written]);
        size_t size = w.size;
        hg_writer_finish(&w);
        if (!struck) {
            assert_int_equal(size, 20 * sizeof written);
            assert_true(n > 3);
            break;
        }
    }
}

// ---- sha256.h ----------------------------------------------------------------------------------

static void assert_digest(const void *data, size_t size, const char *want)
{
    uint8_t digest[HG_SHA256_BYTES];
    char hex[HG_SHA256_HEX];
    assert_int_equal(hg_sha256(data, size, digest), HG_OK);
    hg_sha256_hex(digest, hex);
    assert_string_equal(hex, want);
    // In pieces of growing size.
    struct hg_sha256 *h = hg_sha256_create();
    assert_non_null(h);
    for (size_t at = 0, step = 1; at < size; at += step, step += 7)
        hg_sha256_update(h, (const char *)data + at, step < size - at ? step : size - at);
    hg_sha256_end(h, digest);
    hg_sha256_hex(digest, hex);
    assert_string_equal(hex, want);
}

// The examples of FIPS 180-2, appendix B, and the empty message.
static void test_sha256_vectors(void **state)
{
    (void)state;
    static const char two_blocks[] = "abcdbcdecdefdefgefghfghighijhijkijkljklmklmnlmnomnopnopq";
    assert_digest("", 0, "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855");
    assert_digest("abc", 3, "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
    assert_digest(two_blocks, sizeof two_blocks - 1,
        "248d6a61d20638b8e5c026930c3e6039a33ce45964ff2167f6ecedd419db06c1");
    char *million = malloc(1000000);
    assert_non_null(million);
    memset(million, 'a', 1000000);
    assert_digest(
        million, 1000000, "cdc76e5c9914fb9281a1c7e284d73e67f1809a48a497200e046d39ccc7112cd0");
    free(million);
}

// ---- utf8.h ------------------------------------------------------------------------------------

static void test_utf8(void **state)
{
    (void)state;
    assert_true(hg_utf8_is_valid("", 0));
    assert_true(hg_utf8_is_valid("a\x7f", 2));
    assert_true(hg_utf8_is_valid("\xc2\x80\xdf\xbf", 4));
    assert_true(hg_utf8_is_valid("\xe0\xa0\x80\xed\x9f\xbf\xee\x80\x80\xef\xbf\xbf", 12));
    assert_true(hg_utf8_is_valid("\xf0\x90\x80\x80\xf4\x8f\xbf\xbf", 8));
    static const char *const bad[] = {"\xc1\xbf", "\xe0\x9f\xbf", "\xed\xa0\x80",
        "\xf0\x8f\xbf\xbf", "\xf4\x90\x80\x80", "\xf5\x80\x80\x80", "\xff", "\x80", "\xe2\x82",
        "\xf0\x90\x80", "\xc2\xc0", "\xe2\x82\xc0", "\xf0\x90\x80\xc0"};
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
        size_t size = strlen(bad[i]);
        char *exact = malloc(size); // without its terminator
        assert_non_null(exact);
        memcpy(exact, bad[i], size);
        assert_false(hg_utf8_is_valid(exact, size));
        assert_int_equal(hg_utf8_sequence(exact, size), 0);
        free(exact);
    }
    assert_false(hg_utf8_is_valid("a\0b", 3));
    assert_int_equal(hg_utf8_sequence("a", 0), 0);
}

static void test_utf8_clean(void **state)
{
    (void)state;
    static const char *const pairs[][2] = {{"", ""}, {"plain", "plain"}, {"\xc3\xa9", "\xc3\xa9"},
        {"a\xff", "a?"}, {"\x80z", "?z"}, {"a\xc3", "a"}, {"a\xe2\x82", "a"},
        {"a\xf0\x9f\x99", "a"}, {"\xe2\x82z", "??z"}, {"\xc0\x80", "??"}, {"\xed\xa0\x80", "???"},
        {"\xe0\x80", "??"}};
    for (size_t i = 0; i < sizeof pairs / sizeof *pairs; i++) {
        char text[16];
        strcpy(text, pairs[i][0]);
        hg_utf8_clean(text);
        assert_string_equal(text, pairs[i][1]);
        assert_true(hg_utf8_is_valid(text, strlen(text)));
    }
}

static void test_json(void **state)
{
    (void)state;
    struct hg_writer w = {0};
    char *text;
    hg_json_put(&w, "{\"share\":%.2f", 0.5);
    hg_json_put_text(&w, ",\"name\":", "a\"b\\c\n\x1f%s\xc3\xa9");
    hg_json_put_number(&w, ",\"most\":", UINT64_MAX);
    hg_json_put(&w, "}");
    assert_int_equal(hg_json_take(&w, &text), HG_OK);
    assert_string_equal(text, "{\"share\":0.50,\"name\":\"a\\\"b\\\\c\\u000a\\u001f%s\xc3\xa9\","
                              "\"most\":18446744073709551615}");
    hg_free(text);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_written_bytes),
        cmocka_unit_test(test_read_back),
        cmocka_unit_test(test_short_reads),
        cmocka_unit_test(test_reading_nothing),
        cmocka_unit_test(test_writer_limit),
        cmocka_unit_test(test_writer_torture),
        cmocka_unit_test(test_sha256_vectors),
        cmocka_unit_test(test_utf8),
        cmocka_unit_test(test_utf8_clean),
        cmocka_unit_test(test_json),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
