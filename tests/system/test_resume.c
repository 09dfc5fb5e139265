// test_resume.c - sessions that go on, on another connection or in another daemon, by their ticket.
#include <setjmp.h>
#include <signal.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <cmocka.h>

#include "base/clock.h"
#include "tests/fault/built_scene.h"

struct ticket {
    uint8_t secret[64];
    uint32_t size;
};

static void take(struct ticket *ticket, struct hgp_bytes secret)
{
    assert_int_equal(secret.size, 32);
    memcpy(ticket->secret, secret.data, secret.size);
    ticket->size = secret.size;
}

static void keep(struct peer *p, struct ticket *ticket)
{
    peer_call(p, HGP_T_keep, &(struct hgp_keep){0}, HGP_T_ticket);
    take(ticket, p->m.ticket.secret);
}

static struct hgp_resume with(const struct ticket *ticket)
{
    return (struct hgp_resume){.secret = {ticket->secret, ticket->size}};
}

// The peer has a fresh session already.
static void resume(struct peer *p, struct ticket *ticket)
{
    struct hgp_resume m = with(ticket);
    peer_call(p, HGP_T_resume, &m, HGP_T_resumed);
    p->session = p->m.resumed.session;
    p->first_id = p->m.resumed.first_id;
    take(ticket, p->m.resumed.secret);
}

static void refused(struct peer *p, const struct ticket *ticket)
{
    struct hgp_resume m = with(ticket);
    peer_refused(p, HGP_T_resume, &m, HG_E_AUTH);
}

// A frame of the subscription, and the credit for the next one.
static void take_shown(struct peer *p, uint64_t *number, uint8_t digest[32])
{
    assert_true(peer_next(p));
    assert_int_equal(p->header.type, HGP_T_frame);
    assert_int_equal(p->header.request, 0);
    *number = p->m.frame.number;
    memcpy(digest, p->m.frame.data.data, 32);
}

static void override_node(struct peer *p, uint64_t node, bool clear)
{
    struct hgp_node_override it = {.node = node, .set = 1, .hidden = true};
    peer_call(p, HGP_T_view_overrides,
        &(struct hgp_view_overrides){
            .view = 1, .overrides = {&it, 1}, .has_clear = clear, .clear = clear},
        HGP_T_ok);
}

// Also messages that newer ones replace.
static void set_look(struct peer *p)
{
    struct hgp_clip_plane planes[] = {{.normal = {1, 0, 0}}, {.normal = {0, 1, 0}, .distance = 2}};
    peer_call(
        p, HGP_T_view_clip, &(struct hgp_view_clip){.view = 1, .planes = {planes, 1}}, HGP_T_ok);
    override_node(p, p->first_id + 1, false);
    override_node(p, p->first_id + 2, true);
    override_node(p, p->first_id + 3, false);
    peer_call(
        p, HGP_T_view_clip, &(struct hgp_view_clip){.view = 1, .planes = {planes, 2}}, HGP_T_ok);
    peer_call(p, HGP_T_view_variant,
        &(struct hgp_view_variant){.view = 1,
            .asset = (uint32_t)p->first_id + 4,
            .has_variant = true,
            .variant = hgp_str_make("red")},
        HGP_T_ok);
}

static void begin(struct daemon *d, struct peer *p, struct ticket *ticket)
{
    peer_open_scene(p, d, "");
    built_scene_make(p);
    set_look(p);
    keep(p, ticket);
    peer_call(p, HGP_T_subscribe, &(struct hgp_subscribe){.view = 1, .credit_frames = 1}, HGP_T_ok);
}

static void wait_parked(struct daemon *d, int count)
{
    struct peer p;
    for (int i = 0;; i++) {
        int found = 0;
        peer_open(&p, d);
        peer_call(&p, HGP_T_sessions_query, &(struct hgp_sessions_query){0}, HGP_T_json);
        char *text = strndup(p.m.json.text.data, p.m.json.text.size);
        for (const char *at = text; (at = strstr(at, "\"peer\":\"\"")); at++)
            found++;
        free(text);
        peer_close(&p);
        if (found == count)
            return;
        if (i > 2000)
            fail_msg("%d sessions are parked, not %d", found, count);
        usleep(5000);
    }
}

// Everything is as it was, and shown anew; while nobody is there, the worker has no view.
static void check_resumed(struct daemon *d, struct peer *p, struct ticket *ticket,
    const uint8_t digest[32], uint64_t number)
{
    uint64_t again;
    uint8_t shown[32];
    uint32_t first_id = p->first_id;
    uint64_t session = p->session;
    peer_open(p, d);
    assert_int_not_equal(p->session, session);
    resume(p, ticket);
    assert_int_equal(p->session, session);
    assert_int_equal(p->first_id, first_id);
    assert_int_equal(p->m.resumed.revision, 56);
    take_shown(p, &again, shown);
    assert_memory_equal(shown, digest, 32);
    assert_true(again > number);
    assert_int_equal(p->m.frame.input_seq, 2); // of the camera
}

static void goes_on_after_a_lost_connection(void **state)
{
    (void)state;
    struct daemon d;
    struct peer p;
    struct ticket ticket;
    uint64_t number;
    uint8_t digest[32], changed[32];
    daemon_begin(&d);
    begin(&d, &p, &ticket);
    take_shown(&p, &number, digest);
    for (int i = 0; i < 3; i++) {
        close(p.fd); // no goodbye
        wait_parked(&d, 1);
        while (daemon_file_size(&d, "count.view_close") < (size_t)i + 1) // nothing is rendered
            usleep(1000);
        check_resumed(&d, &p, &ticket, digest, number);
        number = p.m.frame.number;
    }
    peer_tell(&p, HGP_T_credit, &(struct hgp_credit){.view = 1, .frames = 1});
    take_shown(&p, &number, changed);
    peer_call(&p, HGP_T_node_set, &(struct hgp_node_set){.node = p.first_id + 77}, HGP_T_ok);
    peer_close(&p);
    daemon_finish(&d);
}

// Of its daemon: the same, with a state folder.
static void goes_on_in_another_daemon(void **state)
{
    (void)state;
    struct daemon d;
    struct peer p;
    struct ticket ticket;
    uint64_t number;
    uint8_t digest[32];
    char path[TEST_FOLDER_MAX + 16];
    daemon_init(&d);
    snprintf(path, sizeof path, "%s/state", d.folder);
    daemon_option(&d, "state-dir", path);
    daemon_start(&d);
    begin(&d, &p, &ticket);
    take_shown(&p, &number, digest);
    hg_clock_sleep_ns(1500000000u); // cameras are recorded once a second
    for (int i = 0; i < 3; i++) {
        if (i == 1) { // an orderly end
            daemon_signal(&d, SIGTERM);
            assert_int_equal(daemon_wait(&d), 0);
            snprintf(path, sizeof path, "%s/port", d.folder);
            unlink(path);
        } else {
            daemon_signal(&d, SIGKILL);
            daemon_reap(&d);
        }
        free(d.args[--d.arg_count]); // port-file, which is added again
        daemon_start(&d);
        close(p.fd);
        check_resumed(&d, &p, &ticket, digest, number);
        number = p.m.frame.number;
    }
    peer_call(&p, HGP_T_scene_close, &(struct hgp_scene_close){0}, HGP_T_ok);
    peer_tell(&p, HGP_T_bye, &(struct hgp_bye){0});
    peer_end(&p);
    peer_close(&p);
    peer_open_scene(&p, &d, "later"); // its answer says that all before is durable
    daemon_signal(&d, SIGKILL);
    daemon_reap(&d);
    free(d.args[--d.arg_count]);
    daemon_start(&d);
    peer_close(&p);
    peer_open(&p, &d);
    refused(&p, &ticket); // it has left
    peer_close(&p);
    daemon_finish(&d);
}

// Who has the ticket but not the token, who comes too late or twice.
static void tickets_are_good_once_and_for_their_token(void **state)
{
    (void)state;
    struct daemon d;
    struct peer owner, thief, own_user;
    struct ticket ticket, used;
    daemon_init_tokens(&d);
    daemon_option(&d, "resume-timeout", "1");
    daemon_start(&d);
    peer_enter(&owner, &d, "edit-token-1");
    peer_scene(&owner, "kept");
    keep(&owner, &used);
    keep(&owner, &ticket); // voids the one before
    peer_enter(&thief, &d, "view-token-1");
    refused(&thief, &ticket);
    peer_open(&own_user, &d); // not even an administrator
    refused(&own_user, &ticket);
    peer_close(&owner);
    peer_enter(&owner, &d, "edit-token-1");
    refused(&owner, &used);
    peer_scene(&owner, "busy");
    struct hgp_resume m = with(&ticket);
    peer_refused(&owner, HGP_T_resume, &m, HG_E_STATE);
    peer_call(&owner, HGP_T_scene_close, &(struct hgp_scene_close){0}, HGP_T_ok);
    used = ticket;
    resume(&owner, &ticket);
    refused(&thief, &used);
    peer_refused(
        &owner, HGP_T_resume, &(struct hgp_resume){.secret = {used.secret, 32}}, HG_E_STATE);
    peer_close(&owner);
    daemon_wait_log(&d, "scene '1:kept' dropped"); // resume-timeout
    peer_enter(&owner, &d, "edit-token-1");
    refused(&owner, &ticket);
    peer_close(&owner);
    peer_close(&thief);
    peer_close(&own_user);
    daemon_finish(&d);
}

// The client knows that its connection is dead before the daemon does.
static void takes_the_place_of_a_connection_that_lives(void **state)
{
    (void)state;
    struct daemon d;
    struct peer before, after;
    struct ticket ticket;
    uint64_t number;
    uint8_t digest[32], shown[32];
    daemon_begin(&d);
    begin(&d, &before, &ticket);
    take_shown(&before, &number, digest);
    peer_open(&after, &d);
    const uint64_t asked = after.session;
    resume(&after, &ticket);
    assert_int_equal(after.session, before.session);
    char line[100];
    snprintf(line, sizeof line,
        "session %llu (local) goes on from uid:%u, in place of session %llu",
        (unsigned long long)before.session, (unsigned)geteuid(), (unsigned long long)asked);
    daemon_wait_log(&d, line);
    daemon_wait_log(&d, "is process ");
    take_shown(&after, &number, shown);
    assert_memory_equal(digest, shown, 32);
    assert_false(peer_next(&before));
    peer_close(&before);
    peer_call(&after, HGP_T_frame_request, &(struct hgp_frame_request){.view = 1}, HGP_T_frame);
    peer_close(&after);
    daemon_finish(&d);
}

// What was sent before the connection was lost takes effect, also where the worker dies meanwhile.
static void edits_under_way_are_done(void **state)
{
    (void)state;
    struct daemon d;
    struct peer p;
    struct ticket ticket;
    uint64_t number;
    uint8_t digest[32];
    daemon_init(&d);
    daemon_option(&d, "restart-delay", "0.01");
    daemon_start(&d);
    begin(&d, &p, &ticket);
    take_shown(&p, &number, digest);
    peer_send(&p, HGP_T_asset_load,
        &(struct hgp_asset_load){.asset = p.first_id + 5, .path = hgp_str_make("slow=300")});
    peer_send(&p, HGP_T_node_set, &(struct hgp_node_set){.node = p.first_id + 6});
    peer_call(&p, HGP_T_ping, &(struct hgp_ping){.nonce = 1}, HGP_T_pong);
    close(p.fd);
    pid_t worker = daemon_worker(&d, 0);
    hg_clock_sleep_ns(50000000);
    kill(worker, SIGKILL);
    daemon_worker(&d, worker);
    peer_open(&p, &d);
    resume(&p, &ticket);
    do { // until the slow one is done, too
        peer_call(&p, HGP_T_frame_request, &(struct hgp_frame_request){.view = 1}, HGP_T_frame);
        assert_in_range(p.m.frame.scene_revision, 56, 58);
    } while (p.m.frame.scene_revision < 58);
    peer_close(&p);
    daemon_finish(&d);
}

// All connections of a token break at once: all may come back.
static void all_that_break_at_once_come_back(void **state)
{
    (void)state;
    enum { MANY = 5 };
    struct daemon d;
    struct peer p[MANY];
    struct ticket tickets[MANY];
    daemon_init(&d);
    daemon_option(&d, "max-parked", "1");
    daemon_option(&d, "max-sessions-per-token", "5");
    daemon_start(&d);
    for (int i = 0; i < MANY; i++) {
        peer_open_view(&p[i], &d, 16, 16);
        keep(&p[i], &tickets[i]);
    }
    for (int i = 0; i < MANY; i++) {
        peer_close(&p[i]);
        wait_parked(&d, i + 1);
    }
    for (int i = 0; i < MANY; i++) {
        peer_open(&p[i], &d);
        resume(&p[i], &tickets[i]);
    }
    for (int i = 0; i < MANY; i++)
        peer_close(&p[i]);
    daemon_finish(&d);
}

static void only_so_many_are_kept(void **state)
{
    (void)state;
    struct daemon d;
    struct peer p[3], q;
    struct ticket tickets[3];
    char path[TEST_FOLDER_MAX + 8];
    daemon_init(&d);
    daemon_option(&d, "max-parked", "2");
    snprintf(path, sizeof path, "%s/audit", d.folder);
    daemon_option(&d, "audit", path);
    daemon_option(&d, "max-sessions-per-token", "2"); // does not hold for the daemon's own user
    daemon_option(&d, "max-sessions", "4");
    daemon_start(&d);
    for (int i = 0; i < 3; i++) {
        peer_open_view(&p[i], &d, 16, 16);
        keep(&p[i], &tickets[i]);
    }
    for (int i = 0; i < 3; i++) {
        peer_close(&p[i]);
        wait_parked(&d, i < 2 ? i + 1 : 2);
    }
    peer_open(&q, &d);
    char *audit = daemon_read(&d, "audit"), *end = strstr(audit, "\"logout\",\"session\":1,");
    assert_non_null(end); // who waited, and is not waited for any more
    assert_memory_equal(strstr(end, "\"result\":") + 9, "\"limit\"", 7);
    free(audit);
    refused(&q, &tickets[0]); // the one that was left longest ago
    resume(&q, &tickets[1]);
    peer_close(&q);
    wait_parked(&d, 2);
    for (int i = 0; i < 3; i++) // parked ones keep nobody out
        peer_open(&p[i], &d);
    resume(&p[2], &tickets[2]);
    for (int i = 0; i < 3; i++)
        peer_close(&p[i]);
    daemon_finish(&d);
}

int main(int argc, char **argv)
{
    if (argc > 1)
        cmocka_set_test_filter(argv[1]);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(goes_on_after_a_lost_connection),
        cmocka_unit_test(goes_on_in_another_daemon),
        cmocka_unit_test(tickets_are_good_once_and_for_their_token),
        cmocka_unit_test(takes_the_place_of_a_connection_that_lives),
        cmocka_unit_test(edits_under_way_are_done),
        cmocka_unit_test(all_that_break_at_once_come_back),
        cmocka_unit_test(only_so_many_are_kept),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
