// test_admin.c - what administrators do with a running daemon, and what limits say.
#include <setjmp.h>
#include <signal.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <cmocka.h>

#include "base/clock.h"
#include "tests/system/daemon.h"

static void await(struct peer *p, enum hgp_type type)
{
    do
        if (!peer_next(p))
            fail_msg("the daemon closed the connection");
    while (p->header.type != type);
}

static void begin(struct daemon *d, struct peer *admin, struct peer *user)
{
    daemon_start(d);
    peer_enter(admin, d, "admin-token-1");
    peer_enter(user, d, "edit-token-1");
    peer_scene(user, "hall");
}

// Logs in; the next message is an error of this status.
static void is_refused(struct peer *p, struct daemon *d, const char *token, enum hg_status status)
{
    peer_connect(p, d, true);
    peer_hello(p);
    peer_auth(p, token);
    assert_true(peer_next(p));
    assert_int_equal(p->header.type, HGP_T_error);
    assert_int_equal(p->m.error.code, status);
    peer_end(p);
    peer_close(p);
}

static void messages_reach_who_is_meant(void **state)
{
    (void)state;
    struct daemon d;
    struct peer admin, bert, anna;
    daemon_init_tokens(&d);
    begin(&d, &admin, &bert);
    peer_enter(&anna, &d, "view-token-1");
    const struct hgp_str text = hgp_str_make("maintenance at noon");
    peer_call(&admin, HGP_T_message_send, &(struct hgp_message_send){.text = text}, HGP_T_ok);
    await(&bert, HGP_T_message);
    assert_memory_equal(bert.m.message.text.data, text.data, text.size);
    await(&anna, HGP_T_message);
    peer_call(&admin, HGP_T_message_send,
        &(struct hgp_message_send){.text = text, .has_scene = true, .scene = hgp_str_make("hall")},
        HGP_T_ok);
    await(&bert, HGP_T_message);
    assert_false(peer_next_within(&anna, 150));
    peer_call(&admin, HGP_T_message_send,
        &(struct hgp_message_send){.text = text, .has_session = true, .session = anna.session},
        HGP_T_ok);
    await(&anna, HGP_T_message);
    peer_refused(&admin, HGP_T_message_send,
        &(struct hgp_message_send){.text = text, .has_session = true, .session = 4711},
        HG_E_NOTFOUND);
    peer_refused(&bert, HGP_T_message_send, &(struct hgp_message_send){.text = text}, HG_E_PERM);
    peer_close(&anna);
    peer_close(&bert);
    peer_close(&admin);
    daemon_finish(&d);
}

static void kicked_stay_out(void **state)
{
    (void)state;
    struct daemon d;
    struct peer admin, bert, late;
    uint8_t secret[32];
    char folder[160];
    daemon_init_tokens(&d);
    snprintf(folder, sizeof folder, "%s/state", d.folder);
    daemon_option(&d, "state-dir", folder);
    begin(&d, &admin, &bert);
    peer_call(&bert, HGP_T_keep, &(struct hgp_keep){0}, HGP_T_ticket);
    memcpy(secret, bert.m.ticket.secret.data, sizeof secret);
    struct hgp_kick kick = {.session = bert.session, .reason = hgp_str_make("too loud")};
    peer_refused(&bert, HGP_T_kick, &kick, HG_E_PERM);
    peer_call(&admin, HGP_T_kick, &kick, HGP_T_ok);
    assert_true(peer_next(&bert));
    assert_int_equal(bert.header.type, HGP_T_error);
    assert_true(peer_says(&bert, "an administrator has ended it: too loud"));
    peer_end(&bert);
    peer_close(&bert);
    peer_refused(&admin, HGP_T_kick, &kick, HG_E_NOTFOUND);
    // It may come again, but its session is gone.
    peer_enter(&bert, &d, "edit-token-1");
    const struct hgp_resume resume = {.secret = {secret, sizeof secret}};
    peer_refused(&bert, HGP_T_resume, &resume, HG_E_AUTH);
    kick = (struct hgp_kick){.session = bert.session, .has_block_s = true, .block_s = 3600};
    peer_call(&admin, HGP_T_kick, &kick, HGP_T_ok);
    peer_end(&bert);
    peer_close(&bert);
    is_refused(&late, &d, "edit-token-1", HG_E_PERM);
    assert_string_equal(late.limit, "kick");
    assert_in_range(late.retry_after_ms, 3500000, 3600000);
    peer_close(&admin);
    daemon_signal(&d, SIGKILL);
    daemon_reap(&d);
    daemon_start(&d);
    is_refused(&late, &d, "edit-token-1", HG_E_PERM); // also by the next daemon
    peer_enter(&admin, &d, "admin-token-1");
    kick = (struct hgp_kick){.session = admin.session, .has_block_s = true, .block_s = 1};
    peer_refused(&admin, HGP_T_kick, &kick, HG_E_INVAL);
    peer_close(&admin);
    char *audit = daemon_read(&d, "state/audit.log");
    assert_non_null(strstr(audit, "\"event\":\"kick\""));
    assert_non_null(strstr(audit, " of bert: too loud\"")); // and not blocked
    const char *blocked = strstr(audit, "\"result\":\"not-allowed\",\"detail\":\"an administrator");
    assert_non_null(blocked);
    assert_non_null(strstr(blocked - 120, "\"name\":\"bert\"")); // who was not let in
    free(audit);
    daemon_finish(&d);
}

// One answer of /readyz to `text`.
static void ask_ready(struct daemon *d, char *text, size_t capacity)
{
    static const char request[] =
        "GET /readyz HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n";
    size_t size = 0;
    struct peer p;
    peer_connect(&p, d, false);
    peer_raw(&p, request, sizeof request - 1);
    for (ssize_t n; size + 1 < capacity; size += (size_t)n)
        if ((n = read(p.fd, text + size, capacity - 1 - size)) <= 0)
            break;
    text[size] = 0;
    peer_close(&p);
}

// What /readyz answers begins and ends with, as soon as workers have started.
static void ready_is(struct daemon *d, const char *begin, const char *end)
{
    char text[2048] = "";
    for (int tries = 0; tries < 300; tries++) {
        ask_ready(d, text, sizeof text);
        if (strncmp(text, begin, strlen(begin)) == 0 && strstr(text, end))
            return;
        usleep(100000);
    }
    fail_msg("not '%s', '%s': %s", begin, end, text);
}

static void drain_says(struct peer *p, const char *reason)
{
    await(p, HGP_T_drain);
    assert_int_equal(p->m.drain.reason.size, strlen(reason));
    assert_memory_equal(p->m.drain.reason.data, reason, strlen(reason));
}

// In the audit log and in the log, which says whose session asked for it.
static void drain_is_recorded(struct daemon *d, const char *what)
{
    char detail[100], line[160];
    char *audit = daemon_read(d, "audit");
    assert_non_null(strstr(audit, "\"event\":\"drain\""));
    snprintf(detail, sizeof detail, "\"detail\":\"%s\"}", what);
    assert_non_null(strstr(audit, detail));
    free(audit);
    snprintf(line, sizeof line, "drain by session 1 (admin) of 127.0.0.1: %s\"", what);
    daemon_wait_log(d, line);
}

static void drains_when_told(void **state)
{
    (void)state;
    struct daemon d;
    struct peer admin, bert, late;
    daemon_init_tokens(&d);
    char path[160];
    snprintf(path, sizeof path, "%s/audit", d.folder);
    daemon_option(&d, "audit", path);
    begin(&d, &admin, &bert);
    struct hgp_drain_set m = {.deadline_ms = 3600000, .reason = hgp_str_make("new disks")};
    peer_refused(&bert, HGP_T_drain_set, &m, HG_E_PERM);
    ready_is(&d, "HTTP/1.1 200", "");
    peer_call(&admin, HGP_T_drain_set, &m, HGP_T_ok);
    ready_is(&d, "HTTP/1.1 503", "draining");
    drain_says(&bert, "new disks (the daemon stops)");
    peer_refused(&bert, HGP_T_view_set, &(struct hgp_view_set){.view = 1}, HG_E_STATE);
    is_refused(&late, &d, "view-token-1", HG_E_STATE);
    assert_string_equal(late.limit, "drain");
    assert_true(late.retry_after_ms > 3000000);
    m = (struct hgp_drain_set){.has_cancel = true, .cancel = true};
    peer_call(&admin, HGP_T_drain_set, &m, HGP_T_ok);
    await(&bert, HGP_T_drain_cancelled);
    ready_is(&d, "HTTP/1.1 200", "");
    drain_is_recorded(&d, "at most 3600.0 s: new disks");
    drain_is_recorded(&d, "cancelled");
    peer_view(&bert, 1, 16, 16);
    // Stays: others end, administrators go on.
    m = (struct hgp_drain_set){.deadline_ms = 3600000, .has_stay = true, .stay = true};
    peer_call(&admin, HGP_T_drain_set, &m, HGP_T_ok);
    drain_says(&bert, "the daemon stays, for administrators alone");
    char words[257];
    memset(words, 'x', sizeof words);
    memcpy(words + 210, "\xc3\xa4", 2); // over the end of the room there is
    m.reason = (struct hgp_str){words, 256};
    peer_call(&admin, HGP_T_drain_set, &m, HGP_T_ok);
    words[210] = 0;
    strcat(words, " (the daemon stays, for administrators alone)");
    drain_says(&bert, words);
    m = (struct hgp_drain_set){.deadline_ms = 50, .has_stay = true, .stay = true};
    peer_call(&admin, HGP_T_drain_set, &m, HGP_T_ok);
    peer_end(&bert);
    peer_close(&bert);
    ready_is(&d, "HTTP/1.1 503", "closed to all but administrators");
    is_refused(&late, &d, "view-token-1", HG_E_STATE);
    m = (struct hgp_drain_set){.has_cancel = true, .cancel = true};
    peer_call(&admin, HGP_T_drain_set, &m, HGP_T_ok);
    peer_enter(&bert, &d, "edit-token-1");
    // And for good.
    m = (struct hgp_drain_set){.deadline_ms = 50};
    peer_call(&admin, HGP_T_drain_set, &m, HGP_T_ok);
    peer_end(&bert);
    peer_end(&admin);
    peer_close(&bert);
    peer_close(&admin);
    assert_int_equal(daemon_wait(&d), 0);
    daemon_finish(&d);
}

// A session that its client keeps, and its scene, are there again once the drain is taken back.
static void kept_sessions_wait_for_the_end_of_a_drain(void **state)
{
    (void)state;
    struct daemon d;
    struct peer admin, bert, late;
    uint8_t secret[32];
    daemon_init_tokens(&d);
    begin(&d, &admin, &bert);
    peer_call(&bert, HGP_T_keep, &(struct hgp_keep){0}, HGP_T_ticket);
    memcpy(secret, bert.m.ticket.secret.data, sizeof secret);
    assert_int_equal((int)daemon_metric(&d, "heliod_drain_set"), 0);
    struct hgp_drain_set m = {.deadline_ms = 60000, .has_stay = true, .stay = true};
    peer_call(&admin, HGP_T_drain_set, &m, HGP_T_ok);
    assert_int_equal((int)daemon_metric(&d, "heliod_drain_set"), 1);
    assert_in_range((int)daemon_metric(&d, "heliod_drain_remaining_seconds"), 1, 60);
    m.deadline_ms = 50;
    peer_call(&admin, HGP_T_drain_set, &m, HGP_T_ok);
    peer_end(&bert);
    peer_close(&bert);
    is_refused(&late, &d, "edit-token-1", HG_E_STATE);
    assert_int_equal((int)daemon_metric(&d, "heliod_drain_remaining_seconds"), 0);
    m = (struct hgp_drain_set){.has_cancel = true, .cancel = true};
    peer_call(&admin, HGP_T_drain_set, &m, HGP_T_ok);
    assert_int_equal((int)daemon_metric(&d, "heliod_drain_set"), 0);
    peer_enter(&bert, &d, "edit-token-1");
    peer_call(&bert, HGP_T_resume, &(struct hgp_resume){.secret = {secret, sizeof secret}},
        HGP_T_resumed);
    assert_true(bert.m.resumed.id_count > 0);
    peer_close(&bert);
    peer_close(&admin);
    daemon_finish(&d);
}

static void statistics_come_by_themselves(void **state)
{
    (void)state;
    struct daemon d;
    struct peer admin, bert;
    daemon_init_tokens(&d);
    begin(&d, &admin, &bert);
    peer_view(&bert, 1, 16, 16);
    peer_call(&bert, HGP_T_frame_request, &(struct hgp_frame_request){.view = 1}, HGP_T_frame);
    peer_refused(
        &admin, HGP_T_sessions_watch, &(struct hgp_sessions_watch){.interval_ms = 1}, HG_E_INVAL);
    peer_call(
        &admin, HGP_T_sessions_watch, &(struct hgp_sessions_watch){.interval_ms = 100}, HGP_T_ok);
    for (int i = 0; i < 3; i++) {
        await(&admin, HGP_T_statistics);
        char *text = strndup(admin.m.statistics.text.data, admin.m.statistics.text.size);
        assert_non_null(strstr(text, "\"frame_pixels\":256"));
        free(text);
    }
    peer_call(
        &admin, HGP_T_sessions_watch, &(struct hgp_sessions_watch){.interval_ms = 0}, HGP_T_ok);
    assert_false(peer_next_within(&admin, 300));
    peer_close(&bert);
    peer_close(&admin);
    daemon_finish(&d);
}

static void idle_sessions_are_warned_and_end(void **state)
{
    (void)state;
    struct daemon d;
    struct peer p;
    daemon_init(&d);
    daemon_option(&d, "session-idle-timeout", "1.2");
    daemon_option(&d, "session-idle-warning", "0.9");
    daemon_start(&d);
    peer_open_scene(&p, &d, "hall");
    await(&p, HGP_T_idle_warning);
    assert_in_range(p.m.idle_warning.remaining_ms, 1, 900);
    peer_call(&p, HGP_T_sessions_query, &(struct hgp_sessions_query){0}, HGP_T_json);
    await(&p, HGP_T_idle_warning); // what it did counted
    for (int i = 0; i < 30; i++)   // pings do not
        peer_tell(&p, HGP_T_ping, &(struct hgp_ping){.nonce = 1});
    await(&p, HGP_T_error);
    assert_int_equal(p.m.error.code, HG_E_TIMEOUT);
    peer_end(&p);
    peer_close(&p);
    daemon_finish(&d);
}

static void set_pixel_rate(struct daemon *d, const char *line)
{
    daemon_write(d, "config", line);
    daemon_signal(d, SIGHUP);
    daemon_wait_log(d, "reloaded: ");
}

static void pixels_per_second_are_limited(void **state)
{
    (void)state;
    const struct hgp_frame_request request = {.view = 1};
    struct daemon d;
    struct peer p, other;
    char path[160];
    daemon_init(&d);
    snprintf(path, sizeof path, "%s/config", d.folder);
    daemon_option(&d, "config", path);
    daemon_write(&d, "config", "max-pixel-rate = 64\n"); // a frame of 64x64 in 64 seconds
    daemon_start(&d);
    peer_open_view(&p, &d, 64, 64);
    peer_open_view(&other, &d, 64, 64);
    peer_call(&p, HGP_T_frame_request, &request, HGP_T_frame);
    peer_refused(&p, HGP_T_frame_request, &request, HG_E_LIMIT);
    assert_string_equal(p.limit, "max-pixel-rate");
    assert_in_range(p.retry_after_ms, 1, 64001);
    // The other session is of the same user.
    peer_refused(&other, HGP_T_frame_request, &request, HG_E_LIMIT);
    set_pixel_rate(&d, "max-pixel-rate = 8192\n"); // two frames a second
    p.retry_after_ms = 0;
    const uint32_t asked = peer_send(&p, HGP_T_frame_request, &request);
    do
        assert_true(peer_next(&p));
    while (p.header.request != asked);
    if (p.header.type == HGP_T_error) { // it has not taken half a second to here
        assert_in_range(p.retry_after_ms, 1, 501);
        usleep((p.retry_after_ms + 20) * 1000);
        peer_call(&p, HGP_T_frame_request, &request, HGP_T_frame);
    }
    // Subscribed frames wait, and come.
    peer_call(
        &p, HGP_T_subscribe, &(struct hgp_subscribe){.view = 1, .credit_frames = 100}, HGP_T_ok);
    const uint64_t begin_ns = hg_clock_now_ns();
    for (int i = 0; i < 5; i++)
        await(&p, HGP_T_frame);
    assert_true(hg_clock_now_ns() - begin_ns > 400000000u); // not before the pixels are there
    // The client is notified of a wait that users notice.
    set_pixel_rate(&d, "max-pixel-rate = 64\n");
    peer_send(&other, HGP_T_subscribe, &(struct hgp_subscribe){.view = 1, .credit_frames = 100});
    await(&other, HGP_T_notice);
    assert_int_equal(other.m.notice.code, HG_E_LIMIT);
    assert_true(peer_says(&other, "more pixels than max-pixel-rate allows"));
    assert_string_equal(other.limit, "max-pixel-rate");
    peer_close(&other);
    peer_close(&p);
    daemon_finish(&d);
}

static void limits_have_names(void **state)
{
    (void)state;
    struct daemon d;
    struct peer p, more, own;
    const struct hgp_frame_request request = {.view = 1};
    daemon_init_tokens(&d);
    daemon_option(&d, "max-views", "1");
    daemon_option(&d, "max-pixels", "1000");
    daemon_option(&d, "max-sessions-per-token", "1");
    daemon_write(
        &d, "tokens", "edit-token-1 edit bert\nedit-token-2 edit carl sessions=1 pixels=64\n");
    daemon_start(&d);
    peer_enter(&p, &d, "edit-token-1");
    peer_scene(&p, "hall");
    peer_view(&p, 1, 16, 16);
    peer_refused(&p, HGP_T_view_set, &(struct hgp_view_set){.view = 2}, HG_E_LIMIT);
    assert_string_equal(p.limit, "max-views");
    assert_int_equal(p.retry_after_ms, 0);
    peer_refused(&p, HGP_T_view_set,
        &(struct hgp_view_set){.view = 1, .has_width = true, .width = 1000}, HG_E_LIMIT);
    assert_string_equal(p.limit, "max-pixels");
    is_refused(&more, &d, "edit-token-1", HG_E_LIMIT);
    assert_string_equal(more.limit, "max-sessions-per-token");
    assert_true(more.retry_after_ms > 0);
    // Those of a token's line.
    peer_enter(&own, &d, "edit-token-2");
    is_refused(&more, &d, "edit-token-2", HG_E_LIMIT);
    assert_string_equal(more.limit, "sessions");
    assert_true(more.retry_after_ms > 0);
    peer_scene(&own, "");
    peer_view(&own, 1, 16, 16);
    peer_call(&own, HGP_T_frame_request, &request, HGP_T_frame);
    peer_refused(&own, HGP_T_frame_request, &request, HG_E_LIMIT);
    assert_string_equal(own.limit, "pixels");
    peer_close(&own);
    peer_close(&p);
    daemon_finish(&d);
}

// Of a worker, for requests with an answer and without one.
static void limits_of_workers_have_names(void **state)
{
    (void)state;
    enum { MOST = 16 };
    struct daemon d;
    struct peer p;
    daemon_init(&d);
    daemon_option(&d, "max-views", "64");
    daemon_start(&d);
    peer_open_scene(&p, &d, "hall");
    for (uint32_t i = 1; i <= MOST; i++)
        peer_view(&p, i, 4, 4);
    peer_refused(&p, HGP_T_view_set,
        &(struct hgp_view_set){
            .view = MOST + 1, .has_width = true, .width = 4, .has_height = true, .height = 4},
        HG_E_LIMIT);
    assert_string_equal(p.limit, "fake-views");
    assert_int_equal(p.retry_after_ms, 250);
    p.limit[0] = 0;
    peer_tell(&p, HGP_T_view_set,
        &(struct hgp_view_set){
            .view = MOST + 1, .has_width = true, .width = 4, .has_height = true, .height = 4});
    await(&p, HGP_T_notice);
    assert_string_equal(p.limit, "fake-views");
    peer_close(&p);
    daemon_finish(&d);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(messages_reach_who_is_meant),
        cmocka_unit_test(kicked_stay_out),
        cmocka_unit_test(drains_when_told),
        cmocka_unit_test(kept_sessions_wait_for_the_end_of_a_drain),
        cmocka_unit_test(statistics_come_by_themselves),
        cmocka_unit_test(idle_sessions_are_warned_and_end),
        cmocka_unit_test(pixels_per_second_are_limited),
        cmocka_unit_test(limits_have_names),
        cmocka_unit_test(limits_of_workers_have_names),
    };
    return cmocka_run_group_tests_name("admin", tests, NULL, NULL);
}
