// test_tickets.c - join tickets: made, used, listed, revoked, over restarts of the daemon.
#include <setjmp.h>
#include <signal.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <unistd.h>

#include <cmocka.h>

#include "tests/system/daemon.h"

struct ticket {
    uint64_t number;
    char secret[129];
};

static void take(struct peer *p, struct ticket *out)
{
    const struct hgp_join_ticket *m = &p->m.join_ticket;
    out->number = m->ticket;
    snprintf(out->secret, sizeof out->secret, "%.*s", (int)m->secret.size, m->secret.data);
}

// The text of the JSON answer, which has no terminator, contains `part`.
static bool says(const struct peer *p, const char *part)
{
    return memmem(p->m.json.text.data, p->m.json.text.size, part, strlen(part)) != NULL;
}

static void make(struct peer *p, const struct hgp_join_make *m, struct ticket *out)
{
    peer_call(p, HGP_T_join_make, m, HGP_T_join_ticket);
    take(p, out);
}

static void start(struct daemon *d, struct peer *issuer)
{
    daemon_start(d);
    peer_enter(issuer, d, "edit-token-1");
    peer_scene(issuer, "hall");
}

static void begin(struct daemon *d, struct peer *issuer)
{
    daemon_init_tokens(d);
    start(d, issuer);
}

static void begin_audited(struct daemon *d, struct peer *issuer)
{
    char path[TEST_FOLDER_MAX + 16];
    daemon_init_tokens(d);
    snprintf(path, sizeof path, "%s/audit", d->folder);
    daemon_option(d, "audit", path);
    start(d, issuer);
}

// The next message is an error of this status; then the connection ends.
static void is_refused(struct peer *p, struct daemon *d, const char *secret, enum hg_status status)
{
    peer_connect(p, d, true);
    peer_hello(p);
    peer_auth(p, secret);
    assert_true(peer_next(p));
    assert_int_equal(p->header.type, HGP_T_error);
    assert_int_equal(p->m.error.code, status);
    peer_end(p);
    peer_close(p);
}

static void enter(struct peer *p, struct daemon *d, const struct ticket *ticket)
{
    peer_connect(p, d, true);
    peer_hello(p);
    peer_auth(p, ticket->secret);
    assert_true(peer_next(p));
    assert_int_equal(p->header.type, HGP_T_join_scene);
    assert_memory_equal(p->m.join_scene.scene.data, "hall", 4);
    assert_true(peer_next(p));
    assert_int_equal(p->header.type, HGP_T_auth_ok);
}

static void lets_into_one_scene_with_one_role(void **state)
{
    (void)state;
    struct daemon d;
    struct peer issuer, guest, other;
    struct ticket ticket;
    begin_audited(&d, &issuer);
    make(&issuer, &(struct hgp_join_make){.has_label = true, .label = hgp_str_make("Carla")},
        &ticket);
    assert_int_equal(strncmp(ticket.secret, "hj-", 3), 0);
    enter(&guest, &d, &ticket);
    assert_int_equal(guest.m.auth_ok.role, HGP_role_VIEW);
    assert_memory_equal(guest.m.auth_ok.name.data, "Carla", 5);
    const struct hgp_scene_open elsewhere = {.name = hgp_str_make("hall2")};
    peer_refused(&guest, HGP_T_scene_open, &elsewhere, HG_E_PERM);
    peer_refused(&guest, HGP_T_scene_open, &(struct hgp_scene_open){.name = {0}}, HG_E_PERM);
    peer_scene(&guest, "hall");
    peer_view(&guest, 1, 16, 16);
    peer_call(&guest, HGP_T_frame_request, &(struct hgp_frame_request){.view = 1}, HGP_T_frame);
    peer_refused(&guest, HGP_T_node_set, &(struct hgp_node_set){.node = guest.first_id}, HG_E_PERM);
    peer_refused(&guest, HGP_T_join_make, &(struct hgp_join_make){0}, HG_E_PERM);
    peer_refused(&guest, HGP_T_sessions_query, &(struct hgp_sessions_query){0}, HG_E_PERM);
    assert_int_equal((int)daemon_metric(&d, "heliod_refused_total{reason=\"permission\"}"), 2);
    daemon_wait_log(&d, "may not: node_set: needs the role EDIT");
    char *audit = daemon_read(&d, "audit");
    const char *line = strstr(audit, "\"event\":\"refuse\"");
    assert_non_null(line);
    assert_non_null(strstr(line, "Carla"));
    assert_non_null(strstr(line, "not-allowed"));
    assert_non_null(strstr(line, "node_set: needs the role EDIT"));
    free(audit);
    is_refused(&other, &d, ticket.secret, HG_E_AUTH); // it was good once
    peer_close(&guest);
    peer_close(&issuer);
    daemon_finish(&d);
}

static void roles_and_scenes_are_the_issuers_at_most(void **state)
{
    (void)state;
    struct daemon d;
    struct peer issuer, guest, viewer;
    struct ticket ticket;
    begin(&d, &issuer);
    peer_refused(&issuer, HGP_T_join_make,
        &(struct hgp_join_make){.has_role = true, .role = HGP_role_ADMIN}, HG_E_INVAL);
    make(&issuer,
        &(struct hgp_join_make){
            .has_role = true, .role = HGP_role_EDIT, .has_uses = true, .uses = 2},
        &ticket);
    for (int i = 0; i < 2; i++) {
        enter(&guest, &d, &ticket);
        peer_scene(&guest, "hall");
        peer_call(&guest, HGP_T_node_set, &(struct hgp_node_set){.node = guest.first_id}, HGP_T_ok);
        peer_refused(&guest, HGP_T_join_make, &(struct hgp_join_make){0}, HG_E_PERM);
        peer_close(&guest);
    }
    is_refused(&guest, &d, ticket.secret, HG_E_AUTH);
    peer_enter(&viewer, &d, "view-token-1");
    peer_scene(&viewer, "hall");
    peer_refused(&viewer, HGP_T_join_make, &(struct hgp_join_make){0}, HG_E_PERM);
    peer_close(&viewer);
    peer_close(&issuer);
    daemon_finish(&d);
}

// A pattern in the name of a scene is a name.
static void scene_is_no_pattern(void **state)
{
    (void)state;
    struct daemon d;
    struct peer issuer, guest;
    struct ticket ticket;
    begin(&d, &issuer);
    make(&issuer, &(struct hgp_join_make){.has_scene = true, .scene = hgp_str_make("h*")}, &ticket);
    peer_connect(&guest, &d, true);
    peer_hello(&guest);
    peer_auth(&guest, ticket.secret);
    do
        assert_true(peer_next(&guest));
    while (guest.header.type != HGP_T_auth_ok);
    const struct hgp_scene_open hall = {.name = hgp_str_make("hall")};
    peer_refused(&guest, HGP_T_scene_open, &hall, HG_E_PERM);
    const struct hgp_scene_open star = {.name = hgp_str_make("h*")};
    peer_refused(&guest, HGP_T_scene_open, &star, HG_E_NOTFOUND); // to look at what is not there
    peer_close(&guest);
    peer_close(&issuer);
    daemon_finish(&d);
}

static void revoked_ends_its_sessions(void **state)
{
    (void)state;
    struct daemon d;
    struct peer issuer, other, guest, late;
    struct ticket ticket;
    begin(&d, &issuer);
    make(&issuer, &(struct hgp_join_make){.has_uses = true, .uses = 5}, &ticket);
    enter(&guest, &d, &ticket);
    peer_scene(&guest, "hall");
    peer_enter(&other, &d, "view-token-1");
    peer_refused(&other, HGP_T_join_revoke, &(struct hgp_join_revoke){.ticket = ticket.number},
        HG_E_NOTFOUND); // not its own
    peer_call(&other, HGP_T_join_query, &(struct hgp_join_query){0}, HGP_T_json);
    assert_true(says(&other, "{\"tickets\":[]}"));
    peer_call(&issuer, HGP_T_join_query, &(struct hgp_join_query){0}, HGP_T_json);
    assert_true(says(&issuer, "\"used\":1"));
    assert_true(says(&issuer, "\"sessions\":1"));
    assert_false(says(&issuer, ticket.secret));
    peer_call(
        &issuer, HGP_T_join_revoke, &(struct hgp_join_revoke){.ticket = ticket.number}, HGP_T_ok);
    peer_end(&guest);
    peer_close(&guest);
    is_refused(&late, &d, ticket.secret, HG_E_AUTH);
    peer_close(&other);
    peer_close(&issuer);
    daemon_finish(&d);
}

static void restart(struct daemon *d)
{
    daemon_signal(d, SIGKILL);
    daemon_reap(d);
    daemon_start(d);
}

// A used ticket lets its session in again, and nothing else; also after a kill of the daemon.
static void survives_a_kill(void **state)
{
    (void)state;
    struct daemon d;
    struct peer issuer, guest, other;
    struct ticket used, fresh, revoked;
    uint8_t secret[32];
    char folder[160];
    daemon_init_tokens(&d);
    snprintf(folder, sizeof folder, "%s/state", d.folder);
    daemon_option(&d, "state-dir", folder);
    daemon_start(&d);
    peer_enter(&issuer, &d, "edit-token-1");
    peer_scene(&issuer, "hall");
    make(&issuer, &(struct hgp_join_make){0}, &used);
    make(&issuer, &(struct hgp_join_make){0}, &fresh);
    make(&issuer, &(struct hgp_join_make){0}, &revoked);
    peer_call(
        &issuer, HGP_T_join_revoke, &(struct hgp_join_revoke){.ticket = revoked.number}, HGP_T_ok);
    enter(&guest, &d, &used);
    peer_scene(&guest, "hall");
    peer_view(&guest, 1, 16, 16);
    peer_call(&guest, HGP_T_keep, &(struct hgp_keep){0}, HGP_T_ticket);
    memcpy(secret, guest.m.ticket.secret.data, sizeof secret);
    restart(&d);
    peer_close(&issuer);
    peer_close(&guest);
    is_refused(&other, &d, used.secret, HG_E_AUTH);
    is_refused(&other, &d, revoked.secret, HG_E_AUTH);
    peer_connect(&guest, &d, true);
    peer_hello(&guest);
    struct hgp_auth_resume again = {
        .token = hgp_str_make(used.secret), .secret = {secret, sizeof secret}};
    peer_tell(&guest, HGP_T_auth_resume, &again);
    do
        assert_true(peer_next(&guest));
    while (guest.header.type != HGP_T_auth_ok);
    const struct hgp_scene_open hall = {.name = hgp_str_make("hall")};
    peer_refused(&guest, HGP_T_scene_open, &hall, HG_E_PERM); // resume, and nothing else
    peer_refused(&guest, HGP_T_keep, &(struct hgp_keep){0}, HG_E_PERM);
    peer_call(&guest, HGP_T_resume, &(struct hgp_resume){.secret = {secret, sizeof secret}},
        HGP_T_resumed);
    peer_call(&guest, HGP_T_frame_request, &(struct hgp_frame_request){.view = 1}, HGP_T_frame);
    enter(&other, &d, &fresh);
    peer_scene(&other, "hall");
    peer_close(&other);
    peer_close(&guest);
    daemon_finish(&d);
}

// A ticket is never worth more than the token that it was made with is now.
static void limit_files(struct daemon *d, rlim_t bytes)
{
    struct rlimit limit;
    assert_int_equal(prlimit(d->pid, RLIMIT_FSIZE, NULL, &limit), 0);
    limit.rlim_cur = bytes;
    assert_int_equal(prlimit(d->pid, RLIMIT_FSIZE, &limit, NULL), 0);
}

// A use that cannot be recorded is refused at once, and is none.
static void is_not_used_where_the_disk_is_full(void **state)
{
    (void)state;
    struct daemon d;
    struct peer issuer, guest;
    struct ticket ticket;
    char folder[TEST_FOLDER_MAX + 16];
    daemon_init_tokens(&d);
    snprintf(folder, sizeof folder, "%s/state", d.folder);
    daemon_option(&d, "state-dir", folder);
    daemon_start(&d);
    peer_enter(&issuer, &d, "edit-token-1");
    peer_scene(&issuer, "hall");
    make(&issuer, &(struct hgp_join_make){0}, &ticket);
    static const uint8_t points[300000];
    struct hgp_mesh_part part = {
        .mode = HGP_primitive_mode_POINTS, .positions = {points, sizeof points}};
    limit_files(&d, sizeof points);
    peer_send(&issuer, HGP_T_mesh_set,
        &(struct hgp_mesh_set){.mesh = issuer.first_id, .parts = {&part, 1}});
    daemon_wait_log(&d, "cannot be rewritten");
    is_refused(&guest, &d, ticket.secret, HG_E_NOSPACE);
    assert_int_equal((int)daemon_metric(&d, "heliod_state_broken"), 1);
    limit_files(&d, RLIM_INFINITY);
    daemon_wait_log(&d, "is complete again");
    while (daemon_metric(&d, "heliod_state_broken") > 0)
        usleep(10000); // the loop hears of it a little later
    enter(&guest, &d, &ticket);
    peer_close(&guest);
    peer_close(&issuer);
    daemon_finish(&d);
}

static void ends_with_its_token(void **state)
{
    (void)state;
    struct daemon d;
    struct peer issuer, guest, late;
    struct ticket ticket;
    begin(&d, &issuer);
    make(&issuer, &(struct hgp_join_make){.has_uses = true, .uses = 3}, &ticket);
    enter(&guest, &d, &ticket);
    daemon_write(&d, "tokens", "other-token-1 edit carl\n");
    daemon_signal(&d, SIGHUP);
    peer_end(&guest);
    peer_end(&issuer);
    peer_close(&guest);
    peer_close(&issuer);
    is_refused(&late, &d, ticket.secret, HG_E_AUTH);
    daemon_finish(&d);
}

static void tickets_are_limited(void **state)
{
    (void)state;
    struct daemon d;
    struct peer issuer, viewer, other;
    struct ticket ticket;
    daemon_init_tokens(&d);
    daemon_write(&d, "tokens",
        "edit-token-1 edit bert\nview-token-2 view vera tickets=2\n"
        "edit-token-3 edit wim tenant=vera\n");
    daemon_option(&d, "max-tickets", "20");
    daemon_start(&d);
    peer_enter(&issuer, &d, "edit-token-1");
    peer_scene(&issuer, "hall");
    for (int i = 0; i < 20; i++)
        make(&issuer, &(struct hgp_join_make){.has_valid_s = true, .valid_s = 100}, &ticket);
    peer_refused(&issuer, HGP_T_join_make, &(struct hgp_join_make){0}, HG_E_LIMIT);
    assert_string_equal(issuer.limit, "max-tickets");
    assert_in_range(issuer.retry_after_ms, 1000, 100000);
    // A token that may only look, with an allowance of its own; with the role VIEW only.
    peer_enter(&viewer, &d, "view-token-2");
    const struct hgp_join_make look = {.has_scene = true, .scene = hgp_str_make("den")};
    peer_enter(&other, &d, "edit-token-3");
    make(&other,
        &(struct hgp_join_make){
            .has_scene = true, .scene = hgp_str_make("den"), .has_valid_s = true, .valid_s = 100},
        &ticket);
    peer_close(&other);
    make(&viewer, &look, &ticket);
    make(&viewer, &look, &ticket);
    peer_refused(&viewer, HGP_T_join_make, &look, HG_E_LIMIT);
    assert_string_equal(viewer.limit, "tickets"); // of its line; its own end in an hour
    assert_in_range(viewer.retry_after_ms, 3500000, 3600000);
    struct hgp_join_make edit = look;
    edit.has_role = true;
    edit.role = HGP_role_EDIT;
    peer_refused(&viewer, HGP_T_join_make, &edit, HG_E_PERM);
    peer_call(&viewer, HGP_T_join_revoke, &(struct hgp_join_revoke){0}, HGP_T_ok); // all its own
    make(&viewer, &look, &ticket);
    peer_close(&viewer);
    peer_close(&issuer);
    daemon_finish(&d);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(lets_into_one_scene_with_one_role),
        cmocka_unit_test(roles_and_scenes_are_the_issuers_at_most),
        cmocka_unit_test(scene_is_no_pattern),
        cmocka_unit_test(revoked_ends_its_sessions),
        cmocka_unit_test(survives_a_kill),
        cmocka_unit_test(is_not_used_where_the_disk_is_full),
        cmocka_unit_test(ends_with_its_token),
        cmocka_unit_test(tickets_are_limited),
    };
    return cmocka_run_group_tests_name("tickets", tests, NULL, NULL);
}
