// test_transport_parts.c - lists of addresses, PROXY headers, lines of tokens for certificates,
// histograms of latencies.
#include <setjmp.h>
#include <stdarg.h>
#include <stdlib.h>
#include <string.h>

#include <arpa/inet.h>
#include <cmocka.h>

#include "server/broker/transport/address_list.h"
#include "server/broker/connection/auth.h"
#include "server/broker/metrics/latency.h"
#include "server/broker/transport/proxy_header.h"

static bool has(const char *network, const char *address)
{
    char *items[] = {(char *)network};
    const struct hg_text_list list = {items, 1, 1};
    return hg_address_list_has(&list, address);
}

static void networks_hold_addresses(void **state)
{
    (void)state;
    assert_true(has("10.1.2.3", "10.1.2.3"));
    assert_false(has("10.1.2.3", "10.1.2.4"));
    assert_true(has("10.0.0.0/8", "10.255.0.1"));
    assert_false(has("10.0.0.0/8", "11.0.0.1"));
    assert_true(has("10.1.2.0/23", "10.1.3.9"));
    assert_false(has("10.1.2.0/23", "10.1.4.9"));
    assert_true(has("0.0.0.0/0", "1.2.3.4"));
    assert_false(has("0.0.0.0/0", "fd00::1"));
    assert_true(has("::/0", "fd00::1"));
    assert_true(has("10.0.0.0/8", "::ffff:10.1.1.1"));
    assert_true(has("fd00::/9", "fd7f::1"));
    assert_false(has("fd00::/9", "fd80::1"));
    assert_true(has("fe80::/10", "fe80::1%eth0"));
    assert_true(has("loopback", "127.8.8.8") && has("loopback", "::1"));
    assert_false(has("loopback", "10.0.0.1"));
    assert_false(has("none", "127.0.0.1"));
    assert_false(has("10.0.0.0/8", "unix"));
}

static void what_is_no_network_is_named(void **state)
{
    (void)state;
    static const char *const bad[] = {"", "10.0.0", "10.0.0.0/33", "10.0.0.0/", "10.0.0.0/-1",
        "fd00::/129", "here", "10.0.0.0/8x"};
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
        char *items[] = {(char *)bad[i]};
        struct hg_error err = {0};
        assert_int_equal(
            hg_address_list_check(&(struct hg_text_list){items, 1, 1}, "--x", &err), HG_E_INVAL);
        assert_non_null(strstr(err.reason, bad[i]));
    }
}

static void proxy_headers(void **state)
{
    (void)state;
    static const uint8_t v4[] =
        "\r\n\r\n\0\r\nQUIT\n\x21\x11\0\x0f\x0a\1\2\3\x0a\0\0\1\x04\xd2\0\x50\4\0\0GET";
    struct hg_proxy_header h;
    for (size_t n = 0; n < 31; n++) { // in blocks of exactly that size
        uint8_t *block = malloc(n + !n);
        memcpy(block, v4, n);
        assert_int_equal(hg_proxy_header_parse(block, n, &h), HG_E_AGAIN);
        assert_int_equal(h.bytes, n < 16 ? 16 : 31);
        free(block);
    }
    assert_int_equal(hg_proxy_header_parse(v4, sizeof v4 - 1, &h), HG_OK);
    const struct sockaddr_in *in = (const struct sockaddr_in *)&h.source;
    assert_int_equal(h.bytes, 31);
    assert_int_equal(in->sin_family, AF_INET);
    assert_int_equal(ntohl(in->sin_addr.s_addr), 0x0a010203);
    assert_int_equal(ntohs(in->sin_port), 1234);
    assert_int_equal(hg_proxy_header_parse("PROXY TCP4 ", 11, &h), HG_E_VERSION);
    assert_int_equal(hg_proxy_header_parse("PROX", 4, &h), HG_E_AGAIN);
    assert_int_equal(hg_proxy_header_parse("GET /", 5, &h), HG_E_FORMAT);
    uint8_t other[sizeof v4];
    static const struct {
        size_t at;
        uint8_t value;
        enum hg_status status;
    } rows[] = {{12, 0x11, HG_E_FORMAT}, {12, 0x22, HG_E_FORMAT}, {14, 0x08, HG_E_LIMIT},
        {15, 11, HG_E_FORMAT}, {13, 0x21, HG_E_FORMAT}, {13, 0, HG_OK}, {12, 0x20, HG_OK}};
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        memcpy(other, v4, sizeof v4);
        other[rows[i].at] = rows[i].value;
        assert_int_equal(hg_proxy_header_parse(other, sizeof v4, &h), rows[i].status);
        assert_int_equal(h.source.ss_family, AF_UNSPEC);
    }
}

// No text that a client can send as its token has the hash of a certificate's name.
static void subjects_are_no_tokens(void **state)
{
    (void)state;
    uint8_t subject[32], token[32];
    assert_int_equal(hg_token_subject_hash("anna", subject), HG_OK);
    assert_int_equal(hg_token_hash(hgp_str_make("anna"), token), HG_OK);
    assert_memory_not_equal(subject, token, 32);
    assert_int_equal(hg_token_hash(hgp_str_make("subject:anna"), token), HG_OK);
    assert_memory_not_equal(subject, token, 32);
}

static uint32_t bucket_of(const struct hg_latency *before, const struct hg_latency *after)
{
    uint32_t bucket = HG_LATENCY_BUCKETS;
    for (uint32_t i = 0; i < HG_LATENCY_BUCKETS; i++)
        if (after->counts[i] != before->counts[i])
            bucket = i;
    return bucket;
}

static void latencies_are_counted_by_stage(void **state)
{
    (void)state;
    enum { MS = 1000000, ALL = HG_LATENCY_STAGES - 1 };
    // 0.5 ms, 1 ms as it is, a little more, 20, 100 and 900 ms: 1022.500001 in all.
    struct hgp_frame frame = {.has_input_ns = true,
        .has_taken_ns = true,
        .has_render_begin_ns = true,
        .has_render_end_ns = true,
        .has_encode_begin_ns = true,
        .has_encode_end_ns = true};
    frame.input_ns = 7;
    frame.taken_ns = frame.input_ns + MS / 2;
    frame.render_begin_ns = frame.taken_ns + MS;
    frame.render_end_ns = frame.render_begin_ns + MS + 1;
    frame.encode_begin_ns = frame.render_end_ns + 20 * MS;
    frame.encode_end_ns = frame.encode_begin_ns + 100 * MS;
    static const uint32_t buckets[HG_LATENCY_STAGES] = {0, 0, 1, 4, 7, 10, 11};
    const uint64_t sent_ns = frame.encode_end_ns + 900 * MS;
    struct hg_latency before[HG_LATENCY_STAGES];
    memcpy(before, hg_latencies, sizeof before);
    hg_latency_note(&frame, sent_ns);
    for (uint32_t i = 0; i < HG_LATENCY_STAGES; i++) {
        assert_int_equal(bucket_of(&before[i], &hg_latencies[i]), buckets[i]);
        assert_int_equal(hg_latencies[i].count, before[i].count + 1);
    }
    assert_int_equal(hg_latencies[0].sum_ns, before[0].sum_ns + MS / 2);
    assert_int_equal(hg_latencies[ALL].sum_ns, before[ALL].sum_ns + 1022 * MS + MS / 2 + 1);
    // Times that run backwards, at each stage, and one that is missing.
    memcpy(before, hg_latencies, sizeof before);
    struct hgp_frame bad[] = {frame, frame, frame, frame};
    bad[0].input_ns = bad[0].taken_ns + 1;
    bad[1].render_end_ns = bad[1].render_begin_ns - 1;
    bad[2].encode_end_ns = sent_ns + 1;
    bad[3].has_encode_begin_ns = false;
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++)
        hg_latency_note(&bad[i], sent_ns);
    assert_memory_equal(before, hg_latencies, sizeof before);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(latencies_are_counted_by_stage),
        cmocka_unit_test(networks_hold_addresses),
        cmocka_unit_test(what_is_no_network_is_named),
        cmocka_unit_test(proxy_headers),
        cmocka_unit_test(subjects_are_no_tokens),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
