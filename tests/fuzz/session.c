// Whole sessions against a real daemon: valid openings, then messages in any order, some of them
// damaged. The daemon must stay, serve the next client, and keep nothing of the bad ones; the
// worker (a fake one, or $HELIO_TEST_WORKER) must not fall over.
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <errno.h>
#include <poll.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cmocka.h>

#include "base/clock.h"
#include "tests/fuzz/session_stream.h"
#include "tests/system/daemon.h"

enum { CHECK_EVERY = 40 };

// Freed memory is kept for a while by the sanitizers.
#if defined(__SANITIZE_ADDRESS__)
#define GROWTH_BYTES (UINT64_C(512) << 20)
#elif defined(__has_feature)
#if __has_feature(address_sanitizer)
#define GROWTH_BYTES (UINT64_C(512) << 20)
#endif
#endif
#ifndef GROWTH_BYTES
#define GROWTH_BYTES (UINT64_C(64) << 20)
#endif

static struct fuzz_random random_state;

static void put(struct hg_writer *w, enum hgp_type type, const void *message)
{
    uint32_t request = (uint32_t)fuzz_below(&random_state, 100);
    assert_int_equal(
        hgp_encode(w, 1, (struct hgp_envelope){type, request, 0}, message, NULL), HG_OK);
}

// What makes the messages behind it reach further than the first check.
static void put_opening(struct hg_writer *w)
{
    hg_write_bytes(w, HGP_PREFACE, HGP_PREFACE_BYTES);
    put(w, HGP_T_hello, &(struct hgp_hello){.version_min = 1, .version_max = 1});
    if (fuzz_below(&random_state, 8) == 0)
        return;
    put(w, HGP_T_scene_open, &(struct hgp_scene_open){0});
    put(w, HGP_T_view_set,
        &(struct hgp_view_set){
            .view = 1, .has_width = true, .width = 8, .has_height = true, .height = 8});
}

// Takes what comes until the daemon closes or has nothing to say for a moment.
static void drain(int fd)
{
    static uint8_t waste[65536];
    struct pollfd p = {.fd = fd, .events = POLLIN};
    while (poll(&p, 1, 5) == 1)
        if (recv(fd, waste, sizeof waste, MSG_DONTWAIT) <= 0)
            break;
}

static void run_session(struct daemon *d)
{
    struct peer p;
    struct hg_writer w = {0};
    put_opening(&w);
    for (size_t n = 1 + fuzz_below(&random_state, 24); n; n--)
        session_stream_put(&w, &random_state);
    peer_connect(&p, d, false);
    // The daemon may close in the middle; a short write is fine, too.
    ssize_t sent = send(p.fd, w.data, w.size, MSG_NOSIGNAL | MSG_DONTWAIT);
    assert_true(sent > 0 || errno == EPIPE || errno == ECONNRESET);
    if (fuzz_below(&random_state, 2))
        drain(p.fd);
    peer_close(&p);
    hg_writer_finish(&w);
}

// As peer_open. A busy daemon may not have seen yet how many clients are gone: it asks to come
// again.
static void open_patiently(struct peer *p, struct daemon *d)
{
    for (int tries = 0; tries < 3000; tries++) {
        peer_connect(p, d, false);
        peer_raw(p, HGP_PREFACE, HGP_PREFACE_BYTES);
        peer_tell(p, HGP_T_hello, &(struct hgp_hello){.version_min = 1, .version_max = 1});
        assert_true(peer_next(p));
        if (p->header.type == HGP_T_welcome)
            return;
        assert_int_equal(p->header.type, HGP_T_error);
        assert_int_equal(p->m.error.code, HG_E_LIMIT);
        peer_close(p);
        hg_clock_sleep_ns(10000000);
    }
    fail_msg("the daemon never has room again");
}

// A good client is served while and after bad ones come.
static void check_daemon(struct daemon *d)
{
    struct peer p;
    assert_int_equal(kill(d->pid, 0), 0);
    open_patiently(&p, d);
    // One of the bad ones may have set a drain: none is begun beside it.
    peer_call(
        &p, HGP_T_drain_set, &(struct hgp_drain_set){.has_cancel = true, .cancel = true}, HGP_T_ok);
    peer_scene(&p, "");
    peer_call(&p, HGP_T_view_set, &(struct hgp_view_set){.view = 1}, HGP_T_ok);
    peer_call(&p, HGP_T_ping, &(struct hgp_ping){.nonce = 7}, HGP_T_pong);
    assert_true(p.m.pong.nonce == 7);
    peer_close(&p);
}

// With the log at level error: the worker was neither replaced nor at fault.
static void check_worker(struct daemon *d)
{
    char *log = daemon_read(d, "log");
    if (strstr(log, "scope=worker"))
        fail_msg("the worker fell over:\n%s", log);
    free(log);
}

static void test_sessions(void **state)
{
    (void)state;
    struct daemon d;
    const char *seconds = getenv("HELIO_FUZZ_SECONDS");
    daemon_init(&d);
    daemon_option(&d, "log", "error");
    daemon_start(&d);
    uint64_t count = 0;
    while (count < 200) { // caches fill before memory is compared
        run_session(&d);
        if (++count % CHECK_EVERY == 0)
            check_daemon(&d);
    }
    uint64_t before = daemon_rss_bytes(&d);
    uint64_t end = hg_clock_now_ns() + (uint64_t)((seconds ? atof(seconds) : 4) * 1e9);
    while (hg_clock_now_ns() < end) {
        run_session(&d);
        if (++count % CHECK_EVERY == 0)
            check_daemon(&d);
    }
    check_daemon(&d);
    check_worker(&d);
    print_message("%llu sessions, %llu KiB before, %llu KiB after\n", (unsigned long long)count,
        (unsigned long long)before / 1024, (unsigned long long)daemon_rss_bytes(&d) / 1024);
    assert_true(daemon_rss_bytes(&d) < before + GROWTH_BYTES);
    daemon_signal(&d, SIGTERM);
    assert_int_equal(daemon_wait(&d), 0);
    daemon_finish(&d);
}

static int load(void **state)
{
    (void)state;
    random_state = fuzz_random_start();
    session_stream_load();
    return 0;
}

static int unload(void **state)
{
    (void)state;
    session_stream_free();
    return 0;
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_sessions)};
    return cmocka_run_group_tests(tests, load, unload);
}
