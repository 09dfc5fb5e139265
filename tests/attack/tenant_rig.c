#include "tests/attack/tenant_rig.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <cmocka.h>

#include "base/clock.h"

void tenant_rig_init(struct daemon *d)
{
    daemon_init_tokens(d);
    daemon_write(d, "tokens",
        "anna-token-1 edit anna\nanna-token-2 edit anna\nbert-token-1 edit bert\n"
        "guest-token-1 view guest tenant=anna scenes=show*\nnameless-token view\n"
        "admin-token-1 admin\n");
    daemon_option(d, "isolation", "tenant");
    daemon_option(d, "restart-delay", "0.01");
}

void tenant_enter(struct peer *p, struct daemon *d, const char *token, const char *scene)
{
    peer_enter(p, d, token);
    if (scene)
        peer_scene(p, scene);
}

pid_t tenant_worker(struct daemon *d, const char *tenant)
{
    struct peer admin;
    char wanted[160], state[16];
    int pid = 0;
    tenant_enter(&admin, d, "admin-token-1", NULL);
    peer_call(&admin, HGP_T_sessions_query, &(struct hgp_sessions_query){0}, HGP_T_json);
    char *text = strndup(admin.m.json.text.data, admin.m.json.text.size);
    snprintf(wanted, sizeof wanted, "\"tenant\":\"%s\"", tenant);
    for (const char *at = text; !pid && (at = strstr(at, "{\"state\":")); at++) {
        const char *end = strchr(at, '}'), *whose = strstr(at, wanted);
        if (whose && whose < end &&
            sscanf(at, "{\"state\":\"%15[a-z]\",\"pid\":%d", state, &pid) == 2)
            pid = strcmp(state, "up") == 0 ? pid : 0;
    }
    free(text);
    peer_close(&admin);
    return pid;
}

pid_t tenant_await_worker(struct daemon *d, const char *tenant, pid_t other_than)
{
    uint64_t deadline_ns = hg_clock_now_ns() + 60000000000u;
    for (;;) {
        pid_t pid = tenant_worker(d, tenant);
        if (pid && pid != other_than)
            return pid;
        assert_true(hg_clock_now_ns() < deadline_ns);
        usleep(20000);
    }
}

// ---- neighbours ---------------------------------------------------------------------------------

// The next message but pings, which the daemon sends to sessions that are silent for long.
static bool next_but_pings(struct peer *p)
{
    bool is_there;
    while ((is_there = peer_next(p)) && p->header.type == HGP_T_ping)
        peer_tell(p, HGP_T_pong, &(struct hgp_pong){.nonce = p->m.ping.nonce});
    return is_there;
}

// The next message is this answer.
static void answers(struct peer *p, enum hgp_type type, const void *message, enum hgp_type answer)
{
    const uint32_t request = peer_send(p, type, message);
    assert_true(next_but_pings(p));
    assert_int_equal(p->header.type, answer);
    assert_int_equal(p->header.request, request);
}

static const uint8_t *picture_of(struct peer *p)
{
    answers(p, HGP_T_frame_request, &(struct hgp_frame_request){.view = 1}, HGP_T_frame);
    assert_true(p->m.frame.data.size >= 32);
    return p->m.frame.data.data;
}

static void edit(struct peer *p, uint32_t number)
{
    answers(p, HGP_T_node_set, &(struct hgp_node_set){.node = p->first_id + number}, HGP_T_ok);
}

void neighbour_open(struct neighbour *n, struct daemon *d, const char *token)
{
    if (token)
        peer_enter(&n->peer, d, token);
    else
        peer_open(&n->peer, d);
    peer_scene(&n->peer, "home");
    for (uint32_t i = 0; i < 3; i++)
        edit(&n->peer, i);
    peer_view(&n->peer, 1, 64, 64);
    memcpy(n->picture, picture_of(&n->peer), sizeof n->picture);
}

void neighbour_is_served(struct neighbour *n)
{
    answers(&n->peer, HGP_T_ping, &(struct hgp_ping){.nonce = 1}, HGP_T_pong);
    assert_memory_equal(picture_of(&n->peer), n->picture, sizeof n->picture);
}

void neighbour_close(struct neighbour *n)
{
    neighbour_is_served(n);
    edit(&n->peer, 3);
    assert_memory_not_equal(picture_of(&n->peer), n->picture, sizeof n->picture);
    peer_close(&n->peer);
}
