// turns.c - attacks of one tenant on the time of another: pings and small messages do not wait
// behind data, whether the other one is in the same worker or has its own; nor behind the
// connections of another token, however many these are.
#include <setjmp.h>
#include <signal.h>
#include <stdarg.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cmocka.h>

#include "base/alloc.h"
#include "server/broker/connection/conn_turn.h"
#include "tests/attack/tenant_rig.h"

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

struct siege {
    struct peer hostile[HOSTILE];
    pid_t child[HOSTILE], worker; // the worker does not read
};

static void begin_siege(struct siege *s, struct daemon *d, const char *isolation)
{
    const bool shared = strcmp(isolation, "shared") == 0;
    for (int i = 0; i < HOSTILE; i++)
        tenant_enter(&s->hostile[i], d, "anna-token-1", "");
    s->worker = shared ? daemon_worker(d, 0) : tenant_await_worker(d, "anna", 0);
    assert_int_equal(kill(s->worker, SIGSTOP), 0);
    for (int i = 0; i < HOSTILE; i++)
        s->child[i] = flood(&s->hostile[i]);
}

// Most of what is sent to it is not taken.
static void is_under_siege(const struct siege *s)
{
    int how;
    for (int i = 0; i < HOSTILE; i++)
        assert_int_equal(waitpid(s->child[i], &how, WNOHANG), 0);
}

static void end_siege(struct siege *s)
{
    int how;
    assert_int_equal(kill(s->worker, SIGCONT), 0);
    for (int i = 0; i < HOSTILE; i++) {
        assert_int_equal(waitpid(s->child[i], &how, 0), s->child[i]);
        assert_int_equal(how, 0);
        ping(&s->hostile[i]);
        peer_close(&s->hostile[i]);
    }
}

static void begin(struct daemon *d, struct neighbour *honest, const char *isolation)
{
    tenant_rig_init(d);
    daemon_option(d, "isolation", isolation);
    daemon_option(d, "input-limit", "2");
    daemon_option(d, "worker-timeout", "600");
    daemon_start(d);
    neighbour_open(honest, d, "bert-token-1");
}

// A worker does not read, and more than input-limit waits for it: those who sent that are not read,
// another tenant whose scene is in the same worker is.
static void pings_pass_a_full_worker(void **state)
{
    (void)state;
    struct daemon d;
    struct neighbour honest;
    struct siege siege;
    const struct hgp_frame_request frame = frame_of_1();
    begin(&d, &honest, "shared");
    begin_siege(&siege, &d, "shared");
    for (int i = 0; i < 100; i++) {
        ping(&honest.peer);
        usleep(5000);
    }
    const uint32_t asked = peer_send(&honest.peer, HGP_T_frame_request, &frame);
    ping(&honest.peer);
    is_under_siege(&siege);
    end_siege(&siege);
    peer_answer(&honest.peer, asked, HGP_T_frame);
    neighbour_close(&honest);
    daemon_finish(&d);
}

// Frames, too, where each tenant has a worker.
static void frames_pass_another_tenant_s_worker(void **state)
{
    (void)state;
    struct daemon d;
    struct neighbour honest;
    struct siege siege;
    begin(&d, &honest, "tenant");
    begin_siege(&siege, &d, "tenant");
    for (int i = 0; i < 100; i++) {
        neighbour_is_served(&honest);
        usleep(5000);
    }
    is_under_siege(&siege);
    end_siege(&siege);
    neighbour_close(&honest);
    daemon_finish(&d);
}

// The answer to a ping comes before the frames that wait for the same client.
static void pongs_pass_frames(void **state)
{
    (void)state;
    struct daemon d;
    struct neighbour honest;
    struct peer p;
    const struct hgp_frame_request frame = frame_of_1();
    int before = 0;
    begin(&d, &honest, "tenant");
    tenant_enter(&p, &d, "anna-token-1", "");
    peer_view(&p, 1, SIDE, SIDE); // a MiB
    for (int i = 0; i < FRAMES; i++)
        peer_send(&p, HGP_T_frame_request, &frame);
    while (daemon_rss_bytes(&d) < (uint64_t)FRAMES / 2 * MIB) // they wait
        usleep(1000);
    neighbour_is_served(&honest);
    peer_send(&p, HGP_T_ping, &(struct hgp_ping){.nonce = 1});
    while (peer_next(&p) && p.header.type != HGP_T_pong)
        before += p.header.type == HGP_T_frame;
    assert_int_equal(p.header.type, HGP_T_pong);
    print_message("%d of %d frames before it\n", before, FRAMES);
    assert_true(before <= FRAMES / 3);
    for (; before < FRAMES; before += p.header.type == HGP_T_frame)
        assert_true(peer_next(&p));
    peer_close(&p);
    neighbour_close(&honest);
    daemon_finish(&d);
}

// ---- connections of a token
// -----------------------------------------------------------------------

enum { CROWD = 96, CROWD_ASKS = 64, HONEST_ASKS = 4 };

// When the daemon took the message that this answers, by its own clock.
static uint64_t next_time(struct peer *p)
{
    do
        assert_true(peer_next(p));
    while (p->header.type != HGP_T_clock);
    return p->m.clock.time_ns;
}

// In one piece, so that all of it is there when the daemon reads.
static void ask(struct peer *p, int count)
{
    struct hg_writer w = {0};
    for (int i = 1; i <= count; i++)
        assert_int_equal(hgp_encode(&w, HGP_VERSION_MAX,
                             (struct hgp_envelope){HGP_T_clock_query, (uint32_t)i, 0},
                             &(struct hgp_clock_query){0}, NULL),
            HG_OK);
    peer_raw(p, w.data, w.size);
    hg_writer_finish(&w);
}

// Over a unix socket: what is sent is there at once.
static void enter(struct peer *p, struct daemon *d, const char *token)
{
    peer_connect(p, d, false);
    peer_hello(p);
    peer_auth(p, token);
    assert_true(peer_next(p));
    assert_int_equal(p->header.type, HGP_T_auth_ok);
}

static void stop(const struct daemon *d)
{
    int how;
    assert_int_equal(kill(d->pid, SIGSTOP), 0);
    assert_int_equal(waitpid(d->pid, &how, WUNTRACED), d->pid);
    assert_true(WIFSTOPPED(how));
}

// How many of the crowd's messages were taken before one that was sent behind all of them, while
// the daemon did not run.
static int taken_before(struct daemon *d, struct peer *crowd, struct peer *last, int asks)
{
    uint64_t last_ns = 0;
    int before = 0;
    ping(&crowd[0]); // who spoke last may be seen first
    stop(d);
    for (int i = 0; i < CROWD; i++)
        ask(&crowd[i], CROWD_ASKS);
    ask(last, asks);
    assert_int_equal(kill(d->pid, SIGCONT), 0);
    for (int i = 0; i < asks; i++)
        last_ns = next_time(last);
    for (int i = 0; i < CROWD * CROWD_ASKS; i++)
        before += next_time(&crowd[i / CROWD_ASKS]) < last_ns;
    return before;
}

// At most the turn of the token in the round in which the events are seen, and one before it of
// what was seen earlier. Those of one token have their turns in their order.
static void a_crowd_of_one_token_has_one_turn(void **state)
{
    (void)state;
    static struct peer crowd[CROWD], of_crowd;
    struct daemon d;
    struct peer honest;
    tenant_rig_init(&d);
    daemon_option(&d, "max-per-address", "200");
    daemon_option(&d, "max-per-network", "200");
    daemon_option(&d, "max-sessions-per-token", "200");
    daemon_option(&d, "max-handshakes", "1000");
    daemon_option(&d, "max-rate", "100000");
    daemon_option(&d, "require-token", NULL);
    daemon_start(&d);
    for (int i = 0; i < CROWD; i++)
        enter(&crowd[i], &d, "anna-token-1");
    enter(&of_crowd, &d, "anna-token-1");
    enter(&honest, &d, "bert-token-1");
    const int of_other = taken_before(&d, crowd, &honest, HONEST_ASKS);
    const int of_own = taken_before(&d, crowd, &of_crowd, HONEST_ASKS);
    print_message("%d of %d messages of another token came before, and %d of its own\n", of_other,
        CROWD * CROWD_ASKS, of_own);
    assert_in_range(of_other, 0, 2 * HG_TURN_MESSAGES);
    assert_in_range(of_own, CROWD, CROWD * CROWD_ASKS); // each has a turn before it
    for (int i = 0; i < CROWD; i++)
        peer_close(&crowd[i]);
    peer_close(&of_crowd);
    peer_close(&honest);
    daemon_finish(&d);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(pings_pass_a_full_worker),
        cmocka_unit_test(frames_pass_another_tenant_s_worker),
        cmocka_unit_test(pongs_pass_frames),
        cmocka_unit_test(a_crowd_of_one_token_has_one_turn),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
