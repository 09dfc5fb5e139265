// test_broker_alloc.c - every allocation of the daemon fails once, in turn: it may drop a client or
// a worker, refuse to start, but it must not crash, hang or leak, and serves the next client.
#include <setjmp.h>
#include <signal.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cmocka.h>

#include "base/clock.h"
#include "tests/system/forked_daemon.h"

enum { PATIENCE_MS = 30000 }; // of what is no fault, on a machine that is busy

static bool call(struct peer *p, enum hgp_type type, const void *message)
{
    uint32_t request = peer_send(p, type, message);
    do
        if (!peer_next_within(p, PATIENCE_MS))
            return false;
    while (p->header.request != request);
    return p->header.type != HGP_T_error;
}

// As much of a session as the daemon lets happen. False: it ended early.
static bool use(struct peer *p)
{
    static const uint8_t content[100];
    struct hgp_upload upload = {.total = 100, .data = {content, 100}};
    struct hgp_content query = {{1}};
    uint8_t empty_hash[32] = {0};
    memcpy(upload.hash, empty_hash, 32); // refused by its hash, after the work
    peer_raw(p, HGP_PREFACE, HGP_PREFACE_BYTES);
    peer_tell(p, HGP_T_hello, &(struct hgp_hello){.version_min = 1, .version_max = 1});
    if (!peer_next_within(p, PATIENCE_MS) || p->header.type != HGP_T_welcome)
        return false;
    if (!call(p, HGP_T_scene_open, &(struct hgp_scene_open){.name = hgp_str_make("s")}))
        return false;
    uint32_t n = p->m.scene_opened.first_id;
    call(p, HGP_T_upload, &upload);
    return call(p, HGP_T_upload_query, &(struct hgp_upload_query){.contents = {&query, 1}}) &&
           call(p, HGP_T_node_set, &(struct hgp_node_set){.node = n, .has_translation = true}) &&
           call(p, HGP_T_node_set,
               &(struct hgp_node_set){.node = n, .has_translation = true, .has_scale = true}) &&
           call(p, HGP_T_view_set,
               &(struct hgp_view_set){
                   .view = 1, .has_width = true, .width = 8, .has_height = true, .height = 8}) &&
           call(p, HGP_T_view_set, &(struct hgp_view_set){.view = 1, .has_seed = true}) &&
           call(p, HGP_T_frame_request, &(struct hgp_frame_request){.view = 1}) &&
           call(p, HGP_T_sessions_query, &(struct hgp_sessions_query){0});
}

static int wait_for(pid_t pid)
{
    int status;
    for (int tries = 0; waitpid(pid, &status, WNOHANG) != pid; tries++) {
        if (tries > PATIENCE_MS)
            fail_msg("the daemon does not end");
        hg_clock_sleep_ns(1000000);
    }
    return status;
}

// One run with the n-th allocation failing; returns how many there were.
static uint64_t run(uint64_t n)
{
    struct daemon d;
    struct peer p;
    int pipe_fds[2];
    uint64_t count = 0;
    assert_int_equal(pipe(pipe_fds), 0);
    daemon_init(&d);
    daemon_option(&d, "restart-delay", "0.01");
    daemon_option(&d, "drain-timeout", "2");
    forked_daemon_begin(&d, &(struct forked_daemon_options){.fail_at = n, .count_fd = pipe_fds[1]});
    pid_t pid = d.pid;
    close(pipe_fds[1]);
    if (forked_daemon_listens(&d)) {
        peer_connect(&p, &d, false);
        // One allocation fails once: at most one client notices.
        int failed = !use(&p);
        for (int i = 0; i < 2; i++) {
            peer_close(&p);
            peer_connect(&p, &d, false);
            failed += !use(&p);
        }
        peer_close(&p);
        if (failed > 1)
            fail_msg("allocation %llu: %d clients were not served:\n%s", (unsigned long long)n,
                failed, daemon_read(&d, "log"));
        kill(pid, SIGTERM);
    }
    int status = wait_for(pid);
    d.pid = 0;
    if (!WIFEXITED(status) || WEXITSTATUS(status) >= 90 + (n ? 9 : 0))
        fail_msg("allocation %llu: the daemon crashed (status %d):\n%s", (unsigned long long)n,
            status, daemon_read(&d, "log"));
    if (read(pipe_fds[0], &count, sizeof count) != (ssize_t)sizeof count)
        count = 0;
    close(pipe_fds[0]);
    daemon_finish(&d);
    return count;
}

static void every_allocation_fails_once(void **state)
{
    (void)state;
    uint64_t count = run(0);
    assert_true(count > 100);
    // The count differs a little between runs (pulses); past it nothing fails any more.
    uint64_t step = count > 400 ? count / 400 : 1, runs = 0;
    for (uint64_t n = 1; n <= count; n += step, runs++)
        run(n);
    print_message(
        "%llu allocations, %llu runs\n", (unsigned long long)count, (unsigned long long)runs);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(every_allocation_fails_once)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
