// memory.c - attacks of one tenant on the daemon's memory: readers that do not read, or hardly, and
// senders that do not send. Another tenant beside them is served.
#include <setjmp.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cmocka.h>

#include "base/clock.h"
#include "tests/attack/tenant_rig.h"

enum { MIB = 1 << 20, SIDE = 1024, FRAME = SIDE * SIDE * 4 };

// The daemon takes no more than `bytes` while the neighbour is served 50 times.
static void stays_within(
    struct daemon *d, struct neighbour *honest, uint64_t before, uint64_t bytes)
{
    uint64_t most = 0;
    for (int i = 0; i < 50; i++) {
        neighbour_is_served(honest);
        uint64_t rss = daemon_rss_bytes(d);
        most = rss > most ? rss : most;
        usleep(20000);
    }
    print_message(
        "memory +%.1f MiB of %.0f\n", ((double)most - (double)before) / MIB, (double)bytes / MIB);
    assert_true(most < before + daemon_allowed(bytes));
}

static void begin(struct daemon *d, struct neighbour *honest)
{
    daemon_start(d);
    neighbour_open(honest, d, "bert-token-1");
}

static void begin_with_limit(struct daemon *d, struct neighbour *honest, const char *output_limit)
{
    tenant_rig_init(d);
    daemon_option(d, "output-limit", output_limit);
    begin(d, honest);
}

static void attacker_open(struct peer *p, struct daemon *d, uint32_t side)
{
    tenant_enter(p, d, "anna-token-1", "");
    peer_view(p, 1, side, side);
}

static void end(struct daemon *d, struct neighbour *honest, struct peer *slow)
{
    peer_close(slow);
    neighbour_close(honest);
    daemon_finish(d);
}

static void frames_are_charged_when_granted(void **state)
{
    (void)state;
    struct daemon d;
    struct neighbour honest;
    struct peer slow;
    begin_with_limit(&d, &honest, "8");
    attacker_open(&slow, &d, SIDE);
    uint64_t before = daemon_rss_bytes(&d);
    for (int i = 0; i < 64; i++) // 256 MiB in all
        peer_send(&slow, HGP_T_frame_request, &(struct hgp_frame_request){.view = 1});
    stays_within(&d, &honest, before, 8 * MIB + 3 * FRAME);
    for (int i = 0; i < 64; i++) { // all come when it reads
        assert_true(peer_next(&slow));
        assert_int_equal(slow.header.type, HGP_T_frame);
    }
    end(&d, &honest, &slow);
}

static void queries_are_charged_when_granted(void **state)
{
    (void)state;
    struct daemon d;
    struct neighbour honest;
    struct peer slow;
    begin_with_limit(&d, &honest, "8");
    tenant_enter(&slow, &d, "anna-token-1", "");
    uint64_t before = daemon_rss_bytes(&d);
    for (int i = 0; i < 2000; i++) // 2 GiB in all
        peer_send(&slow, HGP_T_info_query, &(struct hgp_info_query){0});
    stays_within(&d, &honest, before, (8 + 4) * MIB);
    for (int i = 0; i < 100; i++) {
        assert_true(peer_next(&slow));
        assert_int_equal(slow.header.type, HGP_T_json);
    }
    end(&d, &honest, &slow);
}

// Subscriptions of many views take turns within the same limit.
static void views_take_turns(void **state)
{
    (void)state;
    enum { VIEWS = 8 };
    struct daemon d;
    struct neighbour honest;
    struct peer p;
    uint32_t frames[VIEWS] = {0};
    begin_with_limit(&d, &honest, "1");
    tenant_enter(&p, &d, "anna-token-1", "");
    for (uint32_t i = 0; i < VIEWS; i++) {
        peer_view(&p, i + 1, 512, 512); // a MiB each
        peer_call(&p, HGP_T_subscribe,
            &(struct hgp_subscribe){.view = i + 1, .credit_frames = 1024}, HGP_T_ok);
    }
    for (int i = 0; i < 20 * VIEWS; i++) {
        assert_true(peer_next(&p));
        if (p.header.type == HGP_T_frame)
            frames[p.m.frame.view - 1]++;
        // What it sees changes, so that every view has something to show.
        peer_tell(&p, HGP_T_node_set, &(struct hgp_node_set){.node = p.first_id + (uint32_t)i});
    }
    for (uint32_t i = 0; i < VIEWS; i++)
        assert_true(frames[i] >= 5);
    end(&d, &honest, &p);
}

static void drips_are_closed(void **state)
{
    (void)state;
    struct daemon d;
    struct neighbour honest;
    struct peer drip;
    tenant_rig_init(&d);
    daemon_option(&d, "peer-timeout", "1");
    daemon_option(&d, "min-drain", "1024");
    begin(&d, &honest);
    peer_open_view(&drip, &d, SIDE, SIDE); // of the own user: over tcp little progress may be none
    for (int i = 0; i < 60; i++)
        peer_send(&drip, HGP_T_frame_request, &(struct hgp_frame_request){.view = 1});
    uint64_t deadline_ns = hg_clock_now_ns() + 60000000000u;
    // A little of what waits, again and again: some progress, but not enough.
    static char some[65536];
    bool open = true;
    while (open) {
        assert_true(hg_clock_now_ns() < deadline_ns);
        open = read(drip.fd, some, sizeof some) > 0;
        char *log = daemon_read(&d, "log");
        open = open && !strstr(log, "min-drain");
        free(log);
        usleep(200000);
    }
    daemon_wait_log(&d, "min-drain");
    end(&d, &honest, &drip);
}

// A message of so many bytes, of which so many come.
static void send_part(struct peer *p, uint32_t length, size_t come)
{
    static uint8_t bytes[12 << 20];
    const struct hgp_header header = {.type = HGP_T_mesh_set, .length = length, .request = 1};
    hgp_header_encode(&header, bytes);
    assert_true(come <= sizeof bytes);
    peer_raw(p, bytes, come);
}

// Of the token of whose messages most has come the largest is closed, wherever the others are.
static void parts_of_messages_share_what_there_is(void **state)
{
    (void)state;
    enum { HOSTILE = 4 };
    struct daemon d;
    struct peer honest, hostile[HOSTILE];
    tenant_rig_init(&d);
    daemon_option(&d, "input-total", "16");
    daemon_start(&d);
    tenant_enter(&honest, &d, "bert-token-1", "");
    struct hg_writer w = {0};
    static uint8_t points[7 << 20];
    struct hgp_mesh_part part = {
        .mode = HGP_primitive_mode_POINTS, .positions = {points, sizeof points / 12 * 12}};
    const uint32_t request = honest.next_request++;
    assert_int_equal(
        hgp_encode(&w, 1, (struct hgp_envelope){HGP_T_mesh_set, request, 0},
            &(struct hgp_mesh_set){.mesh = honest.first_id, .parts = {&part, 1}}, NULL),
        HG_OK);
    peer_raw(&honest, w.data, w.size - 1); // more than any of the others
    for (int i = 0; i < HOSTILE; i++) {
        tenant_enter(&hostile[i], &d, "anna-token-1", NULL);
        send_part(&hostile[i], 300 << 20, 4 << 20);
    }
    daemon_wait_log(&d, "input-total");
    peer_raw(&honest, w.data + w.size - 1, 1);
    peer_answer(&honest, request, HGP_T_ok);
    hg_writer_finish(&w);
    for (int i = 0; i < HOSTILE; i++)
        peer_close(&hostile[i]);
    peer_close(&honest);
    daemon_finish(&d);
}

static void drips_of_messages_are_closed(void **state)
{
    (void)state;
    struct daemon d;
    struct neighbour honest;
    struct peer drip, still;
    tenant_rig_init(&d);
    daemon_option(&d, "peer-timeout", "0.5");
    daemon_option(&d, "min-fill", "4");
    begin(&d, &honest);
    tenant_enter(&still, &d, "anna-token-1", NULL);
    tenant_enter(&drip, &d, "anna-token-1", NULL);
    send_part(&still, 100, 3); // not even a header
    send_part(&drip, 1000, 16);
    for (int i = 0; i < 1000; i++) { // a byte again and again
        char *log = daemon_read(&d, "log");
        const char *first = strstr(log, "min-fill");
        const bool both = first && strstr(first + 1, "min-fill");
        free(log);
        if (both)
            break;
        assert_true(i < 999);
        (void)!send(drip.fd, "", 1, MSG_NOSIGNAL); // it may be closed
        usleep(20000);
    }
    peer_close(&still);
    end(&d, &honest, &drip);
}

static void slow_readers_share_what_there_is(void **state)
{
    (void)state;
    enum { READERS = 6 };
    struct daemon d;
    struct neighbour honest;
    struct peer slow[READERS];
    tenant_rig_init(&d);
    daemon_option(&d, "output-limit", "64");
    daemon_option(&d, "output-total", "32");
    begin(&d, &honest);
    uint64_t before = daemon_rss_bytes(&d);
    for (int i = 0; i < READERS; i++) { // 6 times 64 MiB, if it were not for output-total
        attacker_open(&slow[i], &d, SIDE);
        for (int n = 0; n < 30; n++)
            peer_send(&slow[i], HGP_T_frame_request, &(struct hgp_frame_request){.view = 1});
    }
    stays_within(&d, &honest, before, 32 * MIB + 64 * MIB);
    for (int i = 1; i < READERS; i++)
        peer_close(&slow[i]);
    end(&d, &honest, &slow[0]);
}

// Memory of the daemon, once it is at most `enough`, or has not changed for eight seconds (in which
// buffers are given back, and the heap is trimmed: within five seconds of its last time), or after
// a minute.
static uint64_t settled(struct daemon *d, uint64_t enough)
{
    uint64_t now = daemon_rss_bytes(d);
    for (int quiet = 0, tries = 0; now > enough && quiet < 80 && tries < 600; tries++) {
        usleep(100000);
        const uint64_t then = now;
        now = daemon_rss_bytes(d);
        quiet = now == then ? quiet + 1 : 0;
    }
    return now;
}

// ---- idle sessions ------------------------------------------------------------------------------

enum { FIRST = 100, A_ROOM = 1000 };

static void open_only(struct peer *p, struct daemon *d, int number)
{
    (void)number;
    peer_open(p, d);
}

// Over tcp, with a token; a thousand of them share a scene and edit a node of it.
static void open_and_use(struct peer *p, struct daemon *d, int number)
{
    static uint32_t node;
    char scene[32];
    snprintf(scene, sizeof scene, "room%d", number / A_ROOM);
    tenant_enter(p, d, "anna-token-1", scene);
    node = number % A_ROOM ? node : p->first_id;
    peer_tell(p, HGP_T_node_set, &(struct hgp_node_set){.node = node});
    peer_tell(p, HGP_T_view_set,
        &(struct hgp_view_set){
            .view = 1, .has_width = true, .width = 64, .has_height = true, .height = 64});
    peer_tell(p, HGP_T_view_camera, &(struct hgp_view_camera){.view = 1});
    for (int i = 0; i < 16; i++)
        peer_tell(p, HGP_T_ping, &(struct hgp_ping){0});
    peer_call(p, HGP_T_frame_request, &(struct hgp_frame_request){.view = 1}, HGP_T_frame);
}

static void init_many(struct daemon *d)
{
    static const char *const limits[] = {"max-connections", "max-sessions", "max-per-address",
        "max-per-network", "max-sessions-per-token"};
    tenant_rig_init(d);
    for (size_t i = 0; i < sizeof limits / sizeof *limits; i++)
        daemon_option(d, limits[i], "20000");
}

// Sessions that have become idle keep at most `each` bytes of the daemon, what the first of them
// take once apart. $HELIO_IDLE_SESSIONS: so many instead of 600.
static void idle_sessions_keep(
    void (*open)(struct peer *p, struct daemon *d, int number), const char *what, uint64_t each)
{
    const char *text = getenv("HELIO_IDLE_SESSIONS");
    const int sessions = text ? atoi(text) : 600, count = FIRST + sessions;
    struct peer *idle = calloc((size_t)count, sizeof *idle);
    struct daemon d;
    struct neighbour honest;
    uint64_t before = 0;
    assert_non_null(idle);
    init_many(&d);
    begin(&d, &honest);
    for (int i = 0; i < count; i++) {
        before = i == FIRST ? settled(&d, 0) : before;
        open(&idle[i], &d, i);
    }
    const uint64_t most = before + daemon_allowed((uint64_t)sessions * each),
                   after = settled(&d, most);
    print_message("%d idle sessions, %s: %.2f KiB each\n", sessions, what,
        ((double)after - (double)before) / 1024 / sessions);
    assert_true(after <= most);
    for (int i = 1; i < count; i++)
        peer_close(&idle[i]);
    end(&d, &honest, &idle[0]);
    free(idle);
}

// Buffers are given back.
static void idle_sessions_are_small(void **state)
{
    (void)state;
    idle_sessions_keep(open_only, "opened", 4 * 1024);
}

static void sessions_that_were_used_are_small(void **state)
{
    (void)state;
    idle_sessions_keep(open_and_use, "with a view", 4 * 1024);
}

// Journals of all scenes have a limit, and a tenant its share: another one can still edit.
static void journals_share_what_there_is(void **state)
{
    (void)state;
    enum { SIZE = 600000 };
    struct daemon d;
    struct peer hostile, honest;
    uint8_t *points = calloc(SIZE, 1);
    struct hgp_mesh_part part = {.positions = {points, SIZE}};
    tenant_rig_init(&d);
    daemon_option(&d, "journal-total", "8");
    daemon_start(&d);
    tenant_enter(&hostile, &d, "anna-token-1", "one");
    struct hgp_mesh_set mesh = {.mesh = hostile.first_id, .parts = {&part, 1}};
    for (int i = 0; i < 6; i++, mesh.mesh++) // 3.4 MiB: more than a quarter, less than half
        peer_call(&hostile, HGP_T_mesh_set, &mesh, HGP_T_ok);
    peer_refused(&hostile, HGP_T_mesh_set, &mesh, HG_E_LIMIT);
    assert_true(peer_says(&hostile, "journal-total"));
    tenant_enter(&honest, &d, "bert-token-1", "two");
    mesh.mesh = honest.first_id;
    peer_call(&honest, HGP_T_mesh_set, &mesh, HGP_T_ok);
    free(points);
    peer_close(&hostile);
    peer_close(&honest);
    daemon_finish(&d);
}

int main(int argc, char **argv)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(frames_are_charged_when_granted),
        cmocka_unit_test(queries_are_charged_when_granted),
        cmocka_unit_test(views_take_turns),
        cmocka_unit_test(drips_are_closed),
        cmocka_unit_test(parts_of_messages_share_what_there_is),
        cmocka_unit_test(drips_of_messages_are_closed),
        cmocka_unit_test(slow_readers_share_what_there_is),
        cmocka_unit_test(idle_sessions_are_small),
        cmocka_unit_test(sessions_that_were_used_are_small),
        cmocka_unit_test(journals_share_what_there_is),
    };
    if (argc > 1)
        cmocka_set_test_filter(argv[1]);
    return cmocka_run_group_tests(tests, NULL, NULL);
}
