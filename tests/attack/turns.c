// turns.c - attacks on others' time: pings and small messages do not wait behind data.
#include <setjmp.h>
#include <signal.h>
#include <stdarg.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cmocka.h>

#include "base/alloc.h"
#include "tests/system/daemon.h"

enum { MIB = 1 << 20, MESSAGES = 16, HOSTILE = 3, SIDE = 512, FRAMES = 30 };

static void ping(struct peer *p)
{
    peer_call(p, HGP_T_ping, &(struct hgp_ping){.nonce = 1}, HGP_T_pong);
}

static struct hgp_frame_request frame_of_1(void)
{
    return (struct hgp_frame_request){.view = 1};
}

// A process that sends meshes of a mebibyte each, as fast as they are taken.
static pid_t flood(struct peer *p)
{
    struct hg_writer w = {0};
    void *corners = hg_calloc(MIB / 12, 12);
    assert_non_null(corners);
    struct hgp_mesh_part part = {
        .mode = HGP_primitive_mode_POINTS, .positions = {corners, (uint32_t)(MIB / 12 * 12)}};
    const struct hgp_mesh_set mesh = {.mesh = p->first_id, .parts = {&part, 1}};
    assert_int_equal(
        hgp_encode(&w, HGP_VERSION_MAX, (struct hgp_envelope){HGP_T_mesh_set, 0, 0}, &mesh, NULL),
        HG_OK);
    hg_free(corners);
    pid_t child = fork();
    assert_true(child >= 0);
    for (int i = 0; !child && i < MESSAGES; i++)
        peer_raw(p, w.data, w.size);
    if (!child)
        _exit(0);
    hg_writer_finish(&w);
    return child;
}

// A worker does not read, and more than input-limit waits for it: those who sent that are not read,
// another client whose scene is in the same worker is.
static void pings_pass_a_full_worker(void **state)
{
    (void)state;
    struct daemon d;
    struct peer honest, hostile[HOSTILE];
    const struct hgp_frame_request frame = frame_of_1();
    pid_t child[HOSTILE];
    int how;
    daemon_init(&d);
    daemon_option(&d, "input-limit", "2");
    daemon_option(&d, "worker-timeout", "600");
    daemon_start(&d);
    peer_open_view(&honest, &d, 8, 8);
    for (int i = 0; i < HOSTILE; i++)
        peer_open_scene(&hostile[i], &d, "");
    const pid_t worker = daemon_worker(&d, 0);
    assert_int_equal(kill(worker, SIGSTOP), 0);
    for (int i = 0; i < HOSTILE; i++)
        child[i] = flood(&hostile[i]);
    for (int i = 0; i < 100; i++) {
        ping(&honest);
        usleep(5000);
    }
    const uint32_t asked = peer_send(&honest, HGP_T_frame_request, &frame);
    ping(&honest);
    for (int i = 0; i < HOSTILE; i++) // most of it was not taken
        assert_int_equal(waitpid(child[i], &how, WNOHANG), 0);
    assert_int_equal(kill(worker, SIGCONT), 0);
    peer_answer(&honest, asked, HGP_T_frame);
    for (int i = 0; i < HOSTILE; i++) {
        assert_int_equal(waitpid(child[i], &how, 0), child[i]);
        assert_int_equal(how, 0);
        ping(&hostile[i]);
        peer_close(&hostile[i]);
    }
    peer_close(&honest);
    daemon_finish(&d);
}

// The answer to a ping comes before the frames that wait for the same client.
static void pongs_pass_frames(void **state)
{
    (void)state;
    struct daemon d;
    struct peer p;
    const struct hgp_frame_request frame = frame_of_1();
    int before = 0;
    daemon_begin(&d);
    peer_open_view(&p, &d, SIDE, SIDE); // a MiB
    for (int i = 0; i < FRAMES; i++)
        peer_send(&p, HGP_T_frame_request, &frame);
    while (daemon_rss_bytes(&d) < (uint64_t)FRAMES / 2 * MIB) // they wait
        usleep(1000);
    peer_send(&p, HGP_T_ping, &(struct hgp_ping){.nonce = 1});
    while (peer_next(&p) && p.header.type != HGP_T_pong)
        before += p.header.type == HGP_T_frame;
    assert_int_equal(p.header.type, HGP_T_pong);
    print_message("%d of %d frames before it\n", before, FRAMES);
    assert_true(before <= FRAMES / 3);
    for (; before < FRAMES; before += p.header.type == HGP_T_frame)
        assert_true(peer_next(&p));
    peer_close(&p);
    daemon_finish(&d);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(pings_pass_a_full_worker),
        cmocka_unit_test(pongs_pass_frames),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
