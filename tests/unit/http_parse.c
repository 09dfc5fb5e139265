// http_parse.c - heads of HTTP: what is taken, what is refused with which status, every prefix.
#include <setjmp.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "protocol/http.h"

#define HOST "Host: a\r\n"

static enum hg_status parse(const char *text, struct hg_http_head *out)
{
    return hg_http_request_parse(text, strlen(text), out);
}

static void takes_a_request(void **state)
{
    (void)state;
    struct hg_http_head h;
    struct hg_http_text value;
    const char *text =
        "GET /a/b.js?x=1 HTTP/1.1\r\nHost: here:8080\r\nAccept-Encoding:  br, GZip \t\r\n"
        "X-Empty:\r\naccept-encoding: zstd\r\n\r\nmore";
    assert_int_equal(parse(text, &h), HG_OK);
    assert_true(hg_http_is(h.method, "GET"));
    assert_true(hg_http_is(h.path, "/a/b.js"));
    assert_true(hg_http_is(h.query, "x=1"));
    assert_int_equal(h.minor, 1);
    assert_int_equal(h.field_count, 4);
    assert_int_equal(h.bytes, strlen(text) - 4);
    assert_int_equal(hg_http_find(&h, "HOST", &value), 1);
    assert_true(hg_http_is(value, "here:8080"));
    assert_int_equal(hg_http_find(&h, "Accept-Encoding", &value), 2);
    assert_true(hg_http_is(value, "br, GZip"));
    assert_int_equal(hg_http_find(&h, "x-empty", &value), 1);
    assert_int_equal(value.size, 0);
    assert_true(hg_http_lists(&h, "Accept-Encoding", "gzip"));
    assert_true(hg_http_lists(&h, "Accept-Encoding", "zstd"));
    assert_false(hg_http_lists(&h, "Accept-Encoding", "gz"));
    assert_int_equal(hg_http_find(&h, "Origin", &value), 0);
}

static void every_prefix_waits(void **state)
{
    (void)state;
    struct hg_http_head h;
    const char *text = "\r\nHEAD / HTTP/1.1\r\n" HOST "Upgrade: websocket\r\n\r\n";
    for (size_t n = 0; n < strlen(text); n++) {
        char *block = malloc(n + !n); // of exactly that size
        memcpy(block, text, n);
        if (hg_http_request_parse(block, n, &h) != HG_E_AGAIN)
            fail_msg("a prefix of %zu bytes: %s", n, h.reason ? h.reason : "taken");
        free(block);
    }
    assert_int_equal(parse(text, &h), HG_OK);
}

static void targets(void **state)
{
    (void)state;
    struct hg_http_head h;
    static const struct {
        const char *target, *path, *query;
    } good[] = {{"/", "/", ""}, {"http://h/x?y", "/x", "y"}, {"HTTPS://h", "/", ""}, {"*", "*", ""},
        {"/?", "/", ""}, {"/a%20b", "/a%20b", ""}};
    for (size_t i = 0; i < sizeof good / sizeof *good; i++) {
        char text[200];
        snprintf(text, sizeof text, "GET %s HTTP/1.1\r\n" HOST "\r\n", good[i].target);
        assert_int_equal(parse(text, &h), HG_OK);
        assert_true(hg_http_is(h.path, good[i].path));
        assert_true(h.query.size == strlen(good[i].query));
    }
}

static void refusals(void **state)
{
    (void)state;
    static const struct {
        const char *text;
        unsigned status;
    } bad[] = {
        {"GET / HTTP/1.1\nHost: a\r\n\r\n", 400},
        {"GET / HTTP/1.1\r\nHost: a\n\r\n", 400},
        {"GET / HTTP/1.1\r\r\nHost: a\r\n\r\n", 400},
        {"GET / HTTP/1.1\r\n\r\n", 400},
        {"GET / HTTP/1.1\r\n" HOST HOST "\r\n", 400},
        {"GET / HTTP/1.1\r\nHost: a b\r\n\r\n", 400},
        {"GET / HTTP/1.1\r\nHost: a/b\r\n\r\n", 400},
        {"GET / HTTP/1.1\r\n" HOST " folded: x\r\n\r\n", 400},
        {"GET / HTTP/1.1\r\n" HOST "A : b\r\n\r\n", 400},
        {"GET / HTTP/1.1\r\n" HOST ": b\r\n\r\n", 400},
        {"GET / HTTP/1.1\r\n" HOST "nothing\r\n\r\n", 400},
        {"GET / HTTP/1.1\r\n" HOST "A: b\x01\r\n\r\n", 400},
        {"GET / HTTP/1.1\r\n" HOST "Content-Length: -1\r\n\r\n", 400},
        {"GET / HTTP/1.1\r\n" HOST "Content-Length: 1\r\nContent-Length: 1\r\n\r\n", 400},
        {"GET / HTTP/1.1\r\n" HOST "Content-Length: 1\r\nTransfer-Encoding: chunked\r\n\r\n", 400},
        {"GET / HTTP/2.0\r\n" HOST "\r\n", 505},
        {"GET / HTTP/0.9\r\n" HOST "\r\n", 505},
        {"GET / HTTX/1.1\r\n" HOST "\r\n", 400},
        {"GET /\r\n" HOST "\r\n", 400},
        {"GET  / HTTP/1.1\r\n" HOST "\r\n", 400},
        {"GET / a HTTP/1.1\r\n" HOST "\r\n", 400},
        {"G@T / HTTP/1.1\r\n" HOST "\r\n", 400},
        {"GETTTTTTTTTTTTTTTT / HTTP/1.1\r\n" HOST "\r\n", 400},
        {"GET a HTTP/1.1\r\n" HOST "\r\n", 400},
        {"GET /#f HTTP/1.1\r\n" HOST "\r\n", 400},
        {"GET /\x80 HTTP/1.1\r\n" HOST "\r\n", 400},
        {"GET httpx:/a HTTP/1.1\r\n" HOST "\r\n", 400},
        {"(bad)", 400}, // before its line is whole
        {"\r\n\r\nGET / HTTP/1.1\r\n" HOST "\r\n", 400},
    };
    struct hg_http_head h;
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
        enum hg_status status = parse(bad[i].text, &h);
        if (!status || status == HG_E_AGAIN || h.status != bad[i].status || !h.reason)
            fail_msg("%s: status %d, answer %u", bad[i].text, status, h.status);
    }
    assert_int_equal(hg_http_request_parse("GET /\0 HTTP/1.1\r\n\r\n", 19, &h), HG_E_FORMAT);
}

static void limits(void **state)
{
    (void)state;
    static char text[HG_HTTP_HEAD_BYTES + 4096];
    struct hg_http_head h;
    // A target of exactly the limit, and one byte more.
    for (int extra = 0; extra < 2; extra++) {
        size_t n = HG_HTTP_TARGET_BYTES + (size_t)extra;
        int at = snprintf(text, sizeof text, "GET ");
        memset(text + at, '/', n);
        snprintf(text + at + n, sizeof text - (size_t)at - n, " HTTP/1.1\r\n" HOST "\r\n");
        assert_int_equal(parse(text, &h), extra ? HG_E_LIMIT : HG_OK);
        assert_int_equal(h.status, extra ? 414 : 0);
    }
    // A target that never ends.
    memset(text, 'a', sizeof text);
    memcpy(text, "GET /", 5);
    assert_int_equal(hg_http_request_parse(text, 3000, &h), HG_E_LIMIT);
    assert_int_equal(h.status, 414);
    // Fields: the most, and one more.
    for (int extra = 0; extra < 2; extra++) {
        int at = snprintf(text, sizeof text, "GET / HTTP/1.1\r\n" HOST);
        for (int i = 1; i < HG_HTTP_FIELDS + extra; i++)
            at += snprintf(text + at, sizeof text - (size_t)at, "A: %d\r\n", i);
        snprintf(text + at, sizeof text - (size_t)at, "\r\n");
        assert_int_equal(parse(text, &h), extra ? HG_E_LIMIT : HG_OK);
        assert_int_equal(h.status, extra ? 431 : 0);
    }
    // A head of exactly the limit, one byte more, and one that never ends.
    for (int extra = 0; extra < 2; extra++) {
        int at = snprintf(text, sizeof text, "GET / HTTP/1.1\r\n" HOST "A: ");
        size_t n = HG_HTTP_HEAD_BYTES + (size_t)extra - (size_t)at - 4;
        memset(text + at, 'b', n);
        memcpy(text + at + n, "\r\n\r\n", 5);
        assert_int_equal(parse(text, &h), extra ? HG_E_LIMIT : HG_OK);
        assert_int_equal(h.status, extra ? 431 : 0);
        assert_int_equal(hg_http_request_parse(text, HG_HTTP_HEAD_BYTES - 1, &h), HG_E_AGAIN);
    }
    memset(text + 40, 'b', sizeof text - 40);
    assert_int_equal(hg_http_request_parse(text, HG_HTTP_HEAD_BYTES, &h), HG_E_LIMIT);
}

static void responses(void **state)
{
    (void)state;
    struct hg_http_head h;
    const char *good = "HTTP/1.1 101 Switching Protocols\r\nUpgrade: websocket\r\n\r\n\x82";
    for (size_t n = 0; n + 1 < strlen(good); n++)
        assert_int_equal(hg_http_response_parse(good, n, &h), HG_E_AGAIN);
    assert_int_equal(hg_http_response_parse(good, strlen(good), &h), HG_OK);
    assert_int_equal(h.status, 101);
    assert_int_equal(h.bytes, strlen(good) - 1);
    static const char *const bad[] = {"HTTP/1.1 10 x\r\n\r\n", "HTTP/2.0 200 x\r\n\r\n",
        "ICY 200 OK\r\n\r\n", "HTTP/1.1 2000 x\r\n\r\n", "HTTP/1.1 200 OK\n\n"};
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++)
        assert_true(hg_http_response_parse(bad[i], strlen(bad[i]), &h) > HG_OK && h.reason);
}

static void numbers(void **state)
{
    (void)state;
    uint64_t v;
    assert_true(hg_http_number((struct hg_http_text){"18446744073709551615", 20}, UINT64_MAX, &v));
    assert_true(v == UINT64_MAX);
    assert_false(hg_http_number((struct hg_http_text){"18446744073709551616", 20}, UINT64_MAX, &v));
    assert_true(hg_http_number((struct hg_http_text){"0007", 4}, 7, &v));
    assert_false(hg_http_number((struct hg_http_text){"8", 1}, 7, &v));
    assert_false(hg_http_number((struct hg_http_text){"", 0}, 7, &v));
    assert_false(hg_http_number((struct hg_http_text){"1 ", 2}, 7, &v));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(takes_a_request),
        cmocka_unit_test(every_prefix_waits),
        cmocka_unit_test(targets),
        cmocka_unit_test(refusals),
        cmocka_unit_test(limits),
        cmocka_unit_test(responses),
        cmocka_unit_test(numbers),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
