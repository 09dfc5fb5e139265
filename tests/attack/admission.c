// admission.c - attacks on the way in: silent and talkative connections, guessed, stolen and
// revoked tokens, slots, ids of scenes.
#include <setjmp.h>
#include <signal.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <arpa/inet.h>
#include <sys/socket.h>
#include <time.h>
#include <unistd.h>

#include <cmocka.h>

#include "base/clock.h"
#include "tests/attack/tenant_rig.h"

enum { MIB = 1 << 20 };

// The next message is an error of this status that says so; then the connection ends.
static void refused_for(struct peer *p, enum hg_status status, const char *text)
{
    assert_true(peer_next(p));
    assert_int_equal(p->header.type, HGP_T_error);
    assert_int_equal(p->m.error.code, status);
    assert_true(peer_says(p, text));
    assert_true(!p->limit[0] || (peer_says(p, p->limit) && p->retry_after_ms > 0));
    peer_end(p);
    peer_close(p);
}

// Logs in with a token that is refused.
static void turned_away(
    struct peer *p, struct daemon *d, const char *token, enum hg_status status, const char *text)
{
    peer_connect(p, d, true);
    peer_hello(p);
    peer_auth(p, token);
    refused_for(p, status, text);
}

// Says hello without waiting for what comes.
static void say_hello(struct peer *p, struct daemon *d)
{
    peer_connect(p, d, true);
    peer_raw(p, HGP_PREFACE, HGP_PREFACE_BYTES);
    peer_tell(p, HGP_T_hello, &(struct hgp_hello){.version_min = 1, .version_max = 1});
}

static void is_served(struct peer *p)
{
    peer_call(p, HGP_T_frame_request, &(struct hgp_frame_request){.view = 1}, HGP_T_frame);
}

enum { PINGS = 1000 };

// Sends pings for as long as the daemon takes them, and reads nothing. False: it took all of them.
static bool is_stopped(struct peer *p)
{
    enum { PING = HGP_HEADER_BYTES + 8 };
    static uint8_t pings[PINGS * PING];
    for (int i = 0; i < PINGS; i++)
        hgp_header_encode(
            &(struct hgp_header){.type = HGP_T_ping, .request = 1, .length = 8}, pings + i * PING);
    return write(p->fd, pings, sizeof pings) != (ssize_t)sizeof pings;
}

static void pings_before_login_are_few(void **state)
{
    (void)state;
    struct daemon d;
    struct neighbour honest;
    struct peer flood;
    signal(SIGPIPE, SIG_IGN);
    daemon_init_tokens(&d);
    daemon_start(&d);
    neighbour_open(&honest, &d, "edit-token-1");
    uint64_t before = daemon_rss_bytes(&d), deadline_ns = hg_clock_now_ns() + 60000000000u;
    for (int i = 0; i < 8; i++) {
        peer_connect(&flood, &d, true);
        peer_hello(&flood);
        // The daemon closes after a few; what it answered is all that it kept.
        while (!is_stopped(&flood))
            assert_true(hg_clock_now_ns() < deadline_ns);
        peer_close(&flood);
        neighbour_is_served(&honest);
    }
    uint64_t rss = daemon_rss_bytes(&d);
    print_message("memory +%.1f MiB\n", ((double)rss - (double)before) / MIB);
    assert_true(rss < before + daemon_allowed(4 * MIB));
    neighbour_close(&honest);
    daemon_finish(&d);
}

static void the_own_user_always_gets_in(void **state)
{
    (void)state;
    enum { SLOTS = 16, OTHERS = SLOTS - SLOTS / 4 };
    struct daemon d;
    struct peer silent[OTHERS], extra, own;
    daemon_init_tokens(&d);
    daemon_option(&d, "max-connections", "16");
    daemon_option(&d, "max-handshakes", "1000");
    daemon_start(&d);
    for (int i = 0; i < OTHERS; i++) {
        peer_connect(&silent[i], &d, true);
        peer_hello(&silent[i]);
    }
    say_hello(&extra, &d);
    refused_for(&extra, HG_E_LIMIT, "reserved-connections");
    peer_open_view(&own, &d, 32, 32);
    is_served(&own);
    peer_close(&own);
    for (int i = 0; i < OTHERS; i++)
        peer_close(&silent[i]);
    daemon_finish(&d);
}

static void addresses_have_a_share(void **state)
{
    (void)state;
    struct daemon d;
    struct neighbour own; // whose slots are apart
    struct peer p[3], extra;
    daemon_init_tokens(&d);
    daemon_option(&d, "max-per-address", "3");
    daemon_start(&d);
    neighbour_open(&own, &d, NULL);
    for (int i = 0; i < 3; i++)
        peer_enter(&p[i], &d, "view-token-1");
    say_hello(&extra, &d);
    refused_for(&extra, HG_E_LIMIT, "max-per-address");
    assert_string_equal(extra.limit, "max-per-address");
    peer_close(&p[0]); // its slot is free again
    uint64_t deadline_ns = hg_clock_now_ns() + 60000000000u;
    for (bool opened = false; !opened;) {
        assert_true(hg_clock_now_ns() < deadline_ns);
        say_hello(&extra, &d);
        assert_true(peer_next(&extra));
        opened = extra.header.type == HGP_T_welcome;
        peer_close(&extra);
    }
    peer_close(&p[1]);
    peer_close(&p[2]);
    neighbour_close(&own);
    daemon_finish(&d);
}

// Who floods with connections that never finish cannot keep all others out.
static void handshakes_are_dropped_at_random(void **state)
{
    (void)state;
    enum { MOST = 40, TRIES = 200 };
    static struct peer p[TRIES];
    struct daemon d;
    struct neighbour honest;
    int stayed = 0;
    daemon_init_tokens(&d);
    daemon_option(&d, "max-handshakes", "40");
    daemon_option(&d, "max-per-address", "1000");
    daemon_option(&d, "max-per-network", "1000");
    daemon_option(&d, "max-connections", "1000");
    daemon_option(&d, "handshake-timeout", "600");
    daemon_start(&d);
    neighbour_open(&honest, &d, "edit-token-1");
    for (int i = 0; i < TRIES; i++) {
        say_hello(&p[i], &d);
        assert_true(peer_next(&p[i]));
        bool welcome = p[i].header.type == HGP_T_welcome;
        assert_true(welcome || peer_says(&p[i], "max-handshakes"));
        assert_true(welcome || i >= MOST / 2); // up to half of it everybody gets in
        stayed += welcome;
        if (!welcome)
            peer_end(&p[i]);
    }
    assert_in_range(stayed, MOST / 2 + 1, MOST);
    neighbour_is_served(&honest);
    for (int i = 0; i < TRIES; i++)
        peer_close(&p[i]);
    neighbour_close(&honest);
    daemon_finish(&d);
}

static void tokens_have_a_share_of_sessions(void **state)
{
    (void)state;
    struct daemon d;
    struct peer a, b, extra, other, admin;
    daemon_init_tokens(&d);
    daemon_option(&d, "max-sessions", "4");
    daemon_option(&d, "max-sessions-per-token", "2");
    daemon_start(&d);
    peer_enter(&a, &d, "view-token-1");
    peer_enter(&b, &d, "view-token-1");
    turned_away(&extra, &d, "view-token-1", HG_E_LIMIT, "max-sessions-per-token");
    peer_enter(&other, &d, "edit-token-1");
    turned_away(&extra, &d, "edit-token-1", HG_E_LIMIT, "reserved-sessions");
    peer_enter(&admin, &d, "admin-token-1");
    peer_close(&a);
    peer_close(&b);
    peer_close(&other);
    peer_close(&admin);
    daemon_finish(&d);
}

static void guessing_is_slow_and_knowing_is_not_refused(void **state)
{
    (void)state;
    const uint64_t second_ns = 1000000000;
    struct daemon d;
    struct neighbour honest;
    struct peer p;
    daemon_init_tokens(&d);
    daemon_option(&d, "auth-failures", "2");
    daemon_start(&d);
    neighbour_open(&honest, &d, "edit-token-1");
    for (int i = 0; i < 3; i++) {
        uint64_t sent_ns = hg_clock_now_ns();
        turned_away(&p, &d, "view-token-2", HG_E_AUTH, "not known");
        assert_true(i < 2 || hg_clock_now_ns() - sent_ns >= second_ns);
    }
    // Whoever shares the address and knows a token waits as long, and gets in.
    uint64_t sent_ns = hg_clock_now_ns();
    peer_enter(&p, &d, "view-token-1");
    assert_true(hg_clock_now_ns() - sent_ns >= 2 * second_ns);
    daemon_wait_log(&d, "3 wrong ones in all");
    peer_close(&p);
    neighbour_close(&honest);
    daemon_finish(&d);
}

// A connection from an address of this machine, of the network 127.0.9.0/24.
static void connect_from(struct peer *p, struct daemon *d, int host)
{
    struct sockaddr_in from = {
        .sin_family = AF_INET, .sin_addr.s_addr = htonl((uint32_t)(0x7f000900 + host))};
    struct sockaddr_in to = {.sin_family = AF_INET,
        .sin_port = htons((uint16_t)d->port),
        .sin_addr.s_addr = htonl(INADDR_LOOPBACK)};
    *p = (struct peer){.next_request = 1};
    p->fd = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
    assert_int_equal(bind(p->fd, (const struct sockaddr *)&from, sizeof from), 0);
    assert_int_equal(connect(p->fd, (const struct sockaddr *)&to, sizeof to), 0);
    peer_hello(p);
}

// Other addresses of the network do not help for long.
static void networks_that_guess_wait(void **state)
{
    (void)state;
    enum { WRONG = 16 }; // eight times auth-failures
    const uint64_t second_ns = 1000000000;
    struct daemon d;
    struct peer p;
    daemon_init_tokens(&d);
    daemon_option(&d, "auth-failures", "2");
    daemon_start(&d);
    for (int i = 0; i < WRONG; i++) {
        connect_from(&p, &d, 1 + i);
        peer_auth(&p, "view-token-2");
        refused_for(&p, HG_E_AUTH, "not known");
    }
    const uint64_t sent_ns = hg_clock_now_ns();
    connect_from(&p, &d, 1 + WRONG);
    peer_auth(&p, "view-token-1");
    assert_true(peer_next(&p));
    assert_int_equal(p.header.type, HGP_T_auth_ok);
    assert_true(hg_clock_now_ns() - sent_ns >= second_ns);
    peer_close(&p);
    peer_enter(&p, &d, "edit-token-1"); // of another network, and at once
    peer_close(&p);
    daemon_finish(&d);
}

static void revoked_tokens_end_their_sessions(void **state)
{
    (void)state;
    struct daemon d;
    struct peer revoked, kept;
    daemon_init_tokens(&d);
    daemon_start(&d);
    peer_enter(&revoked, &d, "view-token-1");
    peer_enter(&kept, &d, "edit-token-1");
    daemon_write(&d, "tokens", "edit-token-1 edit bert\nadmin-token-1 admin\n");
    daemon_signal(&d, SIGHUP);
    refused_for(&revoked, HG_E_AUTH, "its token was revoked");
    peer_call(&kept, HGP_T_ping, &(struct hgp_ping){.nonce = 1}, HGP_T_pong);
    daemon_write(&d, "tokens", "edit-token-1 view bert\nadmin-token-1 admin\n");
    daemon_signal(&d, SIGHUP);
    refused_for(&kept, HG_E_AUTH, "its token has another role now");
    daemon_finish(&d);
}

static void tokens_expire(void **state)
{
    (void)state;
    struct daemon d;
    struct peer p, late;
    char text[128], date[32];
    daemon_init_tokens(&d);
    daemon_start(&d);
    time_t end = time(NULL) + 3;
    strftime(date, sizeof date, "%Y-%m-%dT%H:%M:%SZ", gmtime(&end));
    snprintf(text, sizeof text, "short-lived view anna expires=%s\n", date);
    daemon_write(&d, "tokens", text);
    daemon_signal(&d, SIGHUP);
    daemon_wait_log(&d, "reloaded: 1 tokens");
    peer_enter(&p, &d, "short-lived");
    refused_for(&p, HG_E_AUTH, "its token has expired"); // when its time has come
    turned_away(&late, &d, "short-lived", HG_E_AUTH, "expired");
    daemon_finish(&d);
}

static void scopes_name_scenes(void **state)
{
    (void)state;
    struct daemon d;
    struct peer p;
    daemon_init_tokens(&d);
    daemon_write(&d, "tokens", "scoped-token edit anna scenes=hall-*\n");
    daemon_start(&d);
    peer_enter(&p, &d, "scoped-token");
    peer_refused(
        &p, HGP_T_scene_open, &(struct hgp_scene_open){.name = hgp_str_make("office")}, HG_E_PERM);
    peer_scene(&p, "hall-2");
    peer_call(&p, HGP_T_scene_close, &(struct hgp_scene_close){0}, HGP_T_ok);
    peer_scene(&p, ""); // its own
    peer_close(&p);
    daemon_finish(&d);
}

static void load_within(struct peer *p, const char *roots, bool accepted)
{
    static uint32_t asset;
    char path[80];
    snprintf(path, sizeof path, "within=%s", roots);
    const struct hgp_asset_load m = {.asset = p->first_id + ++asset, .path = hgp_str_make(path)};
    if (accepted)
        peer_call(p, HGP_T_asset_load, &m, HGP_T_asset_loaded);
    else
        peer_refused(p, HGP_T_asset_load, &m, HG_E_PERM);
}

// The worker is told where a token's files lie: at once, after SIGHUP, and for its tickets as well.
static void scopes_name_roots(void **state)
{
    (void)state;
    struct daemon d;
    struct peer p, guest, other;
    char secret[64];
    daemon_init_tokens(&d);
    daemon_write(
        &d, "tokens", "scoped-token edit anna roots=/srv/a:/srv/b\nother-token edit anna\n");
    daemon_start(&d);
    peer_enter(&p, &d, "scoped-token");
    peer_scene(&p, "hall");
    load_within(&p, "/srv/a:/srv/b", true);
    load_within(&p, "", false);
    peer_call(&p, HGP_T_join_make, &(struct hgp_join_make){.has_role = true, .role = HGP_role_EDIT},
        HGP_T_join_ticket);
    snprintf(secret, sizeof secret, "%.*s", (int)p.m.join_ticket.secret.size,
        (const char *)p.m.join_ticket.secret.data);
    peer_connect(&guest, &d, true);
    peer_hello(&guest);
    peer_auth(&guest, secret);
    assert_true(peer_next(&guest));
    assert_int_equal(guest.header.type, HGP_T_join_scene);
    assert_true(peer_next(&guest));
    assert_int_equal(guest.header.type, HGP_T_auth_ok);
    peer_scene(&guest, "hall");
    load_within(&guest, "/srv/a:/srv/b", true);
    peer_enter(&other, &d, "other-token");
    peer_scene(&other, "hall");
    load_within(&other, "", true);
    daemon_write(&d, "tokens", "scoped-token edit anna roots=/srv/c\nother-token edit anna\n");
    assert_int_equal(kill(d.pid, SIGHUP), 0);
    daemon_wait_log(&d, "reloaded: 2 tokens");
    load_within(&p, "/srv/c", true);
    peer_close(&guest);
    peer_close(&other);
    peer_close(&p);
    daemon_finish(&d);
}

// Counts lines of the audit log that have both texts.
static int count_lines(struct daemon *d, const char *name, const char *one, const char *other)
{
    char *log = daemon_read(d, name), *rest = log;
    int count = 0;
    for (char *line; (line = strsep(&rest, "\n"));)
        count += strstr(line, one) && strstr(line, other);
    free(log);
    return count;
}

static void everything_is_audited(void **state)
{
    (void)state;
    struct daemon d;
    struct peer p;
    char path[TEST_FOLDER_MAX + 8];
    daemon_init_tokens(&d);
    snprintf(path, sizeof path, "%s/audit", d.folder);
    daemon_option(&d, "audit", path);
    daemon_start(&d);
    for (int i = 0; i < 5; i++)
        turned_away(&p, &d, "wrong-token", HG_E_AUTH, "not known");
    peer_enter(&p, &d, "edit-token-1");
    peer_scene(&p, "hall \"1\"");
    peer_call(&p, HGP_T_asset_load,
        &(struct hgp_asset_load){.asset = p.first_id, .path = hgp_str_make("demo:")},
        HGP_T_asset_loaded);
    peer_refused(&p, HGP_T_asset_load,
        &(struct hgp_asset_load){.asset = p.first_id + 1, .path = hgp_str_make("fail")},
        HG_E_FORMAT);
    peer_close(&p);
    daemon_wait_log(&d, "(bert) of 127.0.0.1 closed");
    peer_open(&p, &d);
    peer_call(&p, HGP_T_sessions_query, &(struct hgp_sessions_query){0}, HGP_T_json);
    assert_int_equal(count_lines(&d, "audit", "\"login\"", "\"result\":\"auth\""), 5);
    assert_int_equal(count_lines(&d, "audit", "\"name\":\"bert\"", "\"login\""), 1);
    assert_int_equal(count_lines(&d, "audit", "\"scene_open\"", "hall \\\"1\\\""), 1);
    assert_int_equal(count_lines(&d, "audit", "\"asset_load\"", "\"result\":\"ok\""), 1);
    assert_int_equal(count_lines(&d, "audit", "\"asset_load\"", "\"result\":\"format\""), 1);
    assert_int_equal(count_lines(&d, "audit", "\"sessions_query\"", "\"ADMIN\""), 1);
    // Who went by closing the connection has ended a session, too, and is named with the address.
    assert_int_equal(
        count_lines(&d, "audit", "\"logout\",\"session\"", "\"peer\":\"127.0.0.1\""), 1);
    assert_int_equal(count_lines(&d, "audit", "\"logout\"", "\"name\":\"bert\""), 1);
    peer_close(&p);
    daemon_finish(&d);
}

// Ranges of ids come back: a scene cannot be made unjoinable by opening it.
static void ids_come_back(void **state)
{
    (void)state;
    struct daemon d;
    struct neighbour honest;
    struct peer owner, p;
    daemon_init_tokens(&d);
    daemon_start(&d);
    neighbour_open(&honest, &d, "edit-token-1");
    peer_open_scene(&owner, &d, "shared");
    peer_call(&owner, HGP_T_node_set, &(struct hgp_node_set){.node = owner.first_id}, HGP_T_ok);
    peer_open_scene(&p, &d, "shared");
    uint32_t first_id = p.first_id;
    for (int i = 0; i < 4100; i++) {
        peer_call(&p, HGP_T_scene_close, &(struct hgp_scene_close){0}, HGP_T_ok);
        peer_scene(&p, "shared");
    }
    assert_int_equal(p.first_id, first_id);
    // A range with objects in it stays its own until they are removed.
    const struct hgp_node_set node = {.node = first_id};
    const struct hgp_object_remove removal = {.kind = HGP_object_kind_NODE, .object = first_id};
    peer_call(&p, HGP_T_node_set, &node, HGP_T_ok);
    peer_call(&p, HGP_T_scene_close, &(struct hgp_scene_close){0}, HGP_T_ok);
    peer_scene(&p, "shared");
    assert_true(p.first_id != first_id);
    peer_call(&p, HGP_T_object_remove, &removal, HGP_T_ok);
    peer_close(&p);
    peer_close(&owner);
    neighbour_close(&honest);
    daemon_finish(&d);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(pings_before_login_are_few),
        cmocka_unit_test(the_own_user_always_gets_in),
        cmocka_unit_test(addresses_have_a_share),
        cmocka_unit_test(handshakes_are_dropped_at_random),
        cmocka_unit_test(tokens_have_a_share_of_sessions),
        cmocka_unit_test(guessing_is_slow_and_knowing_is_not_refused),
        cmocka_unit_test(networks_that_guess_wait),
        cmocka_unit_test(revoked_tokens_end_their_sessions),
        cmocka_unit_test(tokens_expire),
        cmocka_unit_test(scopes_name_scenes),
        cmocka_unit_test(scopes_name_roots),
        cmocka_unit_test(everything_is_audited),
        cmocka_unit_test(ids_come_back),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
