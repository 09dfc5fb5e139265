// slow_disk.c - a disk that stands still, or fails, while contents are stored: only what needs the
// contents waits. Nothing here looks at a clock: what may not wait is answered while the disk is
// held, and the disk is let go afterwards.
#include <errno.h>
#include <setjmp.h>
#include <signal.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <cmocka.h>

#include "base/sha256.h"
#include "tests/system/daemon.h"

static struct hgp_upload content_of(const void *data, uint32_t size)
{
    struct hgp_upload m = {.total = size, .data = {data, size}};
    assert_int_equal(hg_sha256(data, size, m.hash), HG_OK);
    return m;
}

static void begin(struct daemon *d)
{
    char library[512], options[600], usual[512];
    const char *build = getenv("HELIO_BUILD_DIR"), *asan = getenv("ASAN_OPTIONS");
    daemon_init_tokens(d);
    snprintf(library, sizeof library, "%s/tests/libslow_disk.so", build);
    setenv("HELIO_SLOW_DISK", d->folder, 1);
    snprintf(usual, sizeof usual, "%s", asan ? asan : "");
    snprintf(options, sizeof options, "%s:verify_asan_link_order=0", usual);
    setenv("ASAN_OPTIONS", options, 1);
    setenv("LD_PRELOAD", library, 1);
    daemon_start(d);
    unsetenv("LD_PRELOAD");
    setenv("ASAN_OPTIONS", usual, 1);
}

static void remove_file(struct daemon *d, const char *name)
{
    char path[200];
    snprintf(path, sizeof path, "%s/%s", d->folder, name);
    assert_int_equal(unlink(path), 0);
}

// The time limit of the test ends what does not come.
static void wait_file(struct daemon *d, const char *name, bool there)
{
    while (daemon_has_file(d, name) != there)
        usleep(1000);
}

static void ping(struct peer *p)
{
    peer_call(p, HGP_T_ping, &(struct hgp_ping){.nonce = 1}, HGP_T_pong);
}

// Sends a content whose naming the disk holds up from then on.
static uint32_t send_held(struct daemon *d, struct peer *p, const struct hgp_upload *content)
{
    daemon_write(d, "hold", "");
    const uint32_t request = peer_send(p, HGP_T_upload, content);
    wait_file(d, "held", true);
    remove_file(d, "held");
    return request;
}

static uint32_t begin_held(struct daemon *d, struct peer *p, const struct hgp_upload *content)
{
    begin(d);
    peer_enter(p, d, "edit-token-1");
    return send_held(d, p, content);
}

static void release(struct daemon *d)
{
    remove_file(d, "hold");
}

static bool is_kept(struct daemon *d, const struct hgp_upload *content)
{
    char hex[HG_SHA256_HEX], name[120];
    hg_sha256_hex(content->hash, hex);
    snprintf(name, sizeof name, "cache/uploads/%s", hex);
    return daemon_file_size(d, name) == content->total;
}

static void nothing_is_left(struct daemon *d, uint32_t files)
{
    char name[64];
    for (uint32_t i = 1; i <= files; i++) {
        snprintf(name, sizeof name, "cache/uploads/.incoming.%u", i);
        wait_file(d, name, false);
    }
}

static uint32_t ask(struct peer *p, const struct hgp_upload *content)
{
    struct hgp_content hash = {0};
    memcpy(hash.hash, content->hash, 32);
    return peer_send(p, HGP_T_upload_query, &(struct hgp_upload_query){.contents = {&hash, 1}});
}

// The next answer in the stream; nothing else comes before it.
static void comes_next(struct peer *p, uint32_t request, enum hgp_type type)
{
    assert_true(peer_next(p));
    assert_int_equal(p->header.type, type);
    assert_int_equal(p->header.request, request);
}

// ---- tests --------------------------------------------------------------------------------------

static void only_what_needs_the_content_waits(void **state)
{
    (void)state;
    struct daemon d;
    struct peer sender, other, admin;
    const struct hgp_upload content = content_of("content", 7);
    begin(&d);
    peer_enter(&sender, &d, "edit-token-1");
    peer_enter(&other, &d, "edit-token-1");
    peer_enter(&admin, &d, "admin-token-1");
    const uint32_t upload = send_held(&d, &sender, &content);
    // Others, the sender itself, administrators and metrics are answered meanwhile.
    ping(&other);
    ping(&sender);
    peer_scene(&sender, "");
    peer_view(&sender, 1, 16, 16);
    peer_call(&admin, HGP_T_sessions_query, &(struct hgp_sessions_query){0}, HGP_T_json);
    assert_true(daemon_metric(&d, "heliod_sessions") > 0);
    assert_false(peer_has_upload(&other, content.hash)); // it is not there yet
    // What asks for it waits, and so does what is behind that in the stream.
    const uint32_t query = ask(&sender, &content);
    const uint32_t behind = peer_send(&sender, HGP_T_ping, &(struct hgp_ping){.nonce = 2});
    ping(&other);
    ping(&other);
    assert_false(peer_next_within(&sender, 0));
    release(&d);
    do // the pong may go before all that waits
        assert_true(peer_next(&sender));
    while (sender.header.request == behind);
    assert_int_equal(sender.header.request, upload);
    assert_int_equal(sender.header.type, HGP_T_ok);
    do
        assert_true(peer_next(&sender));
    while (sender.header.request == behind);
    assert_int_equal(sender.header.request, query);
    assert_true(sender.m.upload_have.have.items[0].value);
    assert_true(is_kept(&d, &content));
    nothing_is_left(&d, 1);
    peer_close(&admin);
    peer_close(&other);
    peer_close(&sender);
    daemon_finish(&d);
}

// More contents than may be under way, one message behind another: those that have no place wait.
static void many_are_taken_in_their_order(void **state)
{
    (void)state;
    enum { COUNT = 40 };
    struct daemon d;
    struct peer p, other;
    int data[COUNT];
    uint32_t requests[COUNT];
    begin(&d);
    peer_enter(&p, &d, "edit-token-1");
    peer_enter(&other, &d, "edit-token-1");
    for (int i = 0; i < COUNT; i++) {
        data[i] = i;
        const struct hgp_upload content = content_of(&data[i], sizeof data[i]);
        requests[i] = i ? peer_send(&p, HGP_T_upload, &content) : send_held(&d, &p, &content);
    }
    ping(&other);
    release(&d);
    for (int i = 0; i < COUNT; i++)
        comes_next(&p, requests[i], HGP_T_ok);
    for (int i = 0; i < COUNT; i++)
        assert_true(peer_has_upload(&p, content_of(&data[i], sizeof data[i]).hash));
    peer_close(&other);
    peer_close(&p);
    daemon_finish(&d);
}

// A content that came whole is kept, and one that did not leaves nothing.
static void a_disconnect_leaves_nothing_half(void **state)
{
    (void)state;
    struct daemon d;
    struct peer whole, half, other;
    const struct hgp_upload content = content_of("whole", 5);
    struct hgp_upload part = content_of("part", 4);
    part.data.size = 2;
    begin(&d);
    peer_enter(&whole, &d, "edit-token-1");
    peer_enter(&half, &d, "edit-token-1");
    peer_enter(&other, &d, "edit-token-1");
    send_held(&d, &whole, &content);
    peer_tell(&half, HGP_T_upload, &part);
    ping(&half);
    peer_close(&whole);
    peer_close(&half);
    ping(&other);
    release(&d);
    nothing_is_left(&d, 2);
    while (!peer_has_upload(&other, content.hash))
        usleep(1000);
    assert_true(is_kept(&d, &content));
    assert_false(is_kept(&d, &part));
    peer_close(&other);
    daemon_finish(&d);
}

static void failures_say_why(void **state)
{
    (void)state;
    struct daemon d;
    struct peer p;
    const struct hgp_upload content = content_of("content", 7);
    struct hgp_upload wrong = content_of("content", 7), first = content, second = content;
    wrong.hash[0] ^= 1;
    first.data.size = 3;
    second.offset = 3;
    second.data = (struct hgp_bytes){content.data.data + 3, 4};
    begin(&d);
    peer_enter(&p, &d, "edit-token-1");
    daemon_write(&d, "fail-link", "28"); // ENOSPC
    peer_refused(&p, HGP_T_upload, &content, HG_E_NOSPACE);
    assert_false(peer_has_upload(&p, content.hash));
    remove_file(&d, "fail-link");
    daemon_write(&d, "fail-write", "5"); // EIO
    peer_refused(&p, HGP_T_upload, &content, HG_E_IO);
    peer_tell(&p, HGP_T_upload, &first); // nothing is asked: the reason comes as a notice
    assert_true(peer_next(&p));
    assert_int_equal(p.header.type, HGP_T_notice);
    assert_int_equal(p.m.notice.code, HG_E_IO);
    peer_refused(&p, HGP_T_upload, &second, HG_E_IO); // and the rest learns it
    remove_file(&d, "fail-write");
    peer_refused(&p, HGP_T_upload, &wrong, HG_E_HASH);
    nothing_is_left(&d, 4);
    assert_false(is_kept(&d, &content));
    peer_call(&p, HGP_T_upload, &content, HGP_T_ok);
    assert_true(peer_has_upload(&p, content.hash));
    assert_true(is_kept(&d, &content));
    peer_close(&p);
    daemon_finish(&d);
}

// The end of the daemon waits for what was committed: its sender is answered first.
static void a_shutdown_waits_for_it(void **state)
{
    (void)state;
    struct daemon d;
    struct peer p;
    const struct hgp_upload content = content_of("content", 7);
    const uint32_t request = begin_held(&d, &p, &content);
    daemon_signal(&d, SIGTERM);
    daemon_wait_log(&d, "draining");
    ping(&p);
    release(&d);
    peer_answer(&p, request, HGP_T_ok);
    peer_end(&p);
    assert_int_equal(daemon_wait(&d), 0);
    assert_true(is_kept(&d, &content));
    nothing_is_left(&d, 1);
    peer_close(&p);
    daemon_finish(&d);
}

// So does a new program, which then has the content.
static void a_takeover_waits_for_it(void **state)
{
    (void)state;
    struct daemon d;
    struct peer p;
    const struct hgp_upload content = content_of("content", 7);
    const uint32_t request = begin_held(&d, &p, &content);
    daemon_signal(&d, SIGUSR2);
    daemon_wait_log(&d, "as soon as nothing is under way");
    release(&d);
    peer_answer(&p, request, HGP_T_ok);
    daemon_wait_log(&d, "took over 1 sessions");
    assert_true(peer_has_upload(&p, content.hash));
    assert_true(is_kept(&d, &content));
    peer_close(&p);
    daemon_finish(&d);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(only_what_needs_the_content_waits),
        cmocka_unit_test(many_are_taken_in_their_order),
        cmocka_unit_test(a_disconnect_leaves_nothing_half),
        cmocka_unit_test(failures_say_why),
        cmocka_unit_test(a_shutdown_waits_for_it),
        cmocka_unit_test(a_takeover_waits_for_it),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
