#include "server/broker/client_dispatch.h"

#include <stdio.h>
#include <string.h>
#include <time.h>

#include "base/clock.h"
#include "base/sha256.h"
#include "server/broker/connection/conn_admission.h"
#include "server/broker/metrics/counters.h"
#include "server/broker/session/resume.h"
#include "server/broker/session/session.h"
#include "server/broker/session/session_allow.h"
#include "server/broker/session/session_audit.h"
#include "server/broker/session/session_park.h"
#include "server/broker/session/session_request.h"
#include "server/broker/session/session_ticket.h"
#include "server/broker/session/session_upload.h"
#include "server/broker/session/session_view.h"

enum { RETRY_SESSION_MS = 5000 };

// ---- handshake ----------------------------------------------------------------------------------

static void refuse(
    struct hg_conn *conn, enum hg_status status, const char *what, const char *reason)
{
    struct hg_error err = {0};
    hg_error_set(&err, status, what, NULL, "%s", reason);
    hg_conn_close(conn, &err, what);
}

// Sessions of the same token, whose name they have.
static uint32_t count_sessions(const struct hg_session_table *table, const struct hg_conn *conn)
{
    uint32_t count = 0;
    for (const struct hg_session *it = table->first; it; it = it->next)
        count += it->conn && it->conn->auth.has_token &&
                 memcmp(it->conn->auth.hash, conn->auth.hash, sizeof conn->auth.hash) == 0;
    return count;
}

// Why no session may be opened now; HG_OK: one may.
static enum hg_status check_session(
    const struct hg_conn *conn, const struct hg_token *token, struct hg_error *err)
{
    const struct hg_admission *a = conn->table->owner;
    const struct hg_options *o = a->options;
    bool admin = !token || token->role == HGP_role_ADMIN;
    uint32_t kept = admin ? 0 : hg_slots_kept(o->max_sessions, o->reserved_sessions);
    const bool own = token && token->scope.max_sessions; // its line says how many
    uint32_t most = own ? token->scope.max_sessions : o->max_sessions_per_token;
    if (a->sessions->draining)
        return hg_error_set(err, HG_E_STATE, "session", NULL, "the daemon is shutting down");
    if (hg_session_allow_begin(a->sessions, admin ? HGP_role_ADMIN : HGP_role_VIEW, "session", err))
        return err->status;
    if (a->sessions->count >= o->max_sessions - kept && // else there is no need to count
        a->sessions->count - hg_session_count_parked(a->sessions) >= o->max_sessions - kept) {
        hg_error_set(err, HG_E_LIMIT, "session", NULL,
            "the daemon has as many sessions as it takes (max-sessions%s); try again later",
            kept ? ", reserved-sessions" : "");
        return hg_error_limit(err, "max-sessions", RETRY_SESSION_MS);
    }
    if (token && a->sessions->count >= most && count_sessions(a->sessions, conn) >= most) {
        hg_error_set(err, HG_E_LIMIT, "session", NULL,
            "this token has %u session%s open, as many as %s", most, most == 1 ? "" : "s",
            own ? "its line allows (sessions=)" : "it may (max-sessions-per-token)");
        return hg_error_limit(err, own ? "sessions" : "max-sessions-per-token", RETRY_SESSION_MS);
    }
    return HG_OK;
}

// Logs the refusal of a client that has no session.
static void audit_refusal(
    const struct hg_conn *conn, const char *name, enum hg_status status, const char *reason)
{
    const struct hg_admission *a = conn->table->owner;
    hg_audit_write(a->audit, "login",
        &(struct hg_audit_actor){
            .session = conn->number, .name = name, .peer = conn->peer.name, .client = conn->client},
        status, reason);
}

static void audit_unproven(struct hg_conn *conn, const char *reason)
{
    audit_refusal(conn, NULL, HG_E_AUTH, reason);
}

// token NULL: the daemon's own user.
static bool open_session(struct hg_conn *conn, const struct hg_token *token)
{
    const struct hg_admission *a = conn->table->owner;
    struct hg_error err = {0};
    enum hgp_role role = token ? token->role : HGP_role_ADMIN;
    const char *name = token ? token->name : "local";
    snprintf(conn->auth.name, sizeof conn->auth.name, "%.32s", name);
    if (check_session(conn, token, &err)) {
        hg_count(HG_COUNT_REFUSED_SESSION);
        audit_refusal(conn, name, err.status, err.reason);
        hg_conn_close(conn, &err, "session");
        return false;
    }
    struct hg_session *s =
        hg_session_create(a->sessions, (uint32_t)conn->number, role, hgp_str_make(name));
    if (!s) {
        refuse(conn, HG_E_NOMEM, "session", "no memory for a session");
        return false;
    }
    conn->session = s;
    s->conn = conn;
    s->resume.has_token = token != NULL;
    if (token)
        memcpy(s->resume.token, conn->auth.hash, sizeof s->resume.token);
    snprintf(
        conn->session->tenant, sizeof conn->session->tenant, "%s", token ? token->tenant : "local");
    if (token)
        conn->session->scope = token->scope;
    hg_conn_set_open(
        conn, token && token->scope.max_rate ? token->scope.max_rate : a->options->max_rate);
    hg_count(HG_COUNT_SESSIONS);
    hg_session_audit(conn->session, "login", HG_OK, NULL);
    hg_info(SESSION, "session %llu open: %s, role %s, client %s, from %s",
        (unsigned long long)conn->number, name, hgp_enum_name("role", role), conn->client,
        conn->peer.name);
    return true;
}

// The line of tokens for a client that has shown a certificate; NULL: there is none.
static const struct hg_token *find_by_certificate(struct hg_conn *conn)
{
    const struct hg_admission *a = conn->table->owner;
    if (!conn->peer.subject[0] || hg_token_subject_hash(conn->peer.subject, conn->auth.hash))
        return NULL;
    return hg_tokens_find(a->tokens, conn->auth.hash, time(NULL));
}

static void handle_hello(struct hg_conn *conn, uint32_t request, const struct hgp_hello *m)
{
    const struct hg_admission *a = conn->table->owner;
    snprintf(conn->client, sizeof conn->client, "%.*s", (int)m->client.size, m->client.data);
    if (m->version_min > HGP_VERSION_MAX || m->version_max < HGP_VERSION_MIN ||
        m->version_min > m->version_max) {
        refuse(conn, HG_E_VERSION, "hello", "this daemon speaks version 1");
        return;
    }
    conn->version = m->version_max < HGP_VERSION_MAX ? m->version_max : HGP_VERSION_MAX;
    bool trusted = conn->slot.own && !a->options->require_token;
    if (!trusted && !a->tokens->count && !a->sessions->tickets->count) {
        refuse(conn, HG_E_AUTH, "hello",
            "only the daemon's own user may connect: it has no tokens for others");
        return;
    }
    const struct hg_token *known = trusted ? NULL : find_by_certificate(conn);
    conn->number = ++a->sessions->last_number;
    conn->auth.has_token = known != NULL;
    if ((trusted || known) && !open_session(conn, known))
        return;
    if (!trusted && !known)
        conn->state = HG_CONN_AUTH;
    hg_conn_send(conn, request, HGP_T_welcome,
        &(struct hgp_welcome){.version = conn->version,
            .server = hgp_str_make("heliod/" HELIO_VERSION),
            .session = conn->number,
            .auth_required = conn->state == HG_CONN_AUTH,
            .role = trusted ? HGP_role_ADMIN
                    : known ? known->role
                            : HGP_role_NONE,
            .max_message_bytes = (uint32_t)a->options->max_message_bytes});
}

// A network is many hosts, which may share an address' limit of failures by accident.
enum { NETWORK_TIMES = 8 };

static uint64_t doubled_ns(const struct hg_peer_entry *entry, uint64_t allowed, uint64_t now_ns)
{
    const uint64_t failures = entry ? hg_peer_entry_failures(entry, now_ns) : 0;
    if (failures < allowed)
        return 0;
    return UINT64_C(1000000000) << (failures - allowed < 4 ? failures - allowed : 4);
}

// How long a token from there waits until it is judged, right or wrong: after auth-failures wrong
// ones within a minute, or eight times as many from its network, 1 s, doubled with each further one
// up to 16 s; 1 s for all while wrong tokens from everywhere are more than auth-failures-total. So
// guessing is slow, however many connections and addresses a source may have, and whoever shares
// them and knows a token still gets in.
static uint64_t penalty_ns(const struct hg_conn *conn)
{
    const struct hg_admission *a = conn->table->owner;
    const uint64_t second_ns = 1000000000, allowed = a->options->auth_failures;
    uint64_t now_ns = conn->table->loop->now_ns;
    const uint64_t own_ns = doubled_ns(conn->slot.source, allowed, now_ns);
    const uint64_t all_ns = doubled_ns(conn->slot.network, NETWORK_TIMES * allowed, now_ns);
    if (own_ns || all_ns)
        return own_ns > all_ns ? own_ns : all_ns;
    bool flooded = hg_peer_table_all_failures(&conn->table->slots.peers, now_ns) >=
                   a->options->auth_failures_total;
    return flooded ? second_ns : 0;
}

static void refuse_token(struct hg_conn *conn)
{
    uint64_t now_ns = conn->table->loop->now_ns;
    hg_count(HG_COUNT_REFUSED_TOKEN);
    hg_peer_table_count_failure(
        &conn->table->slots.peers, conn->slot.source, conn->slot.network, now_ns);
    if (hg_peer_log_may(&conn->table->log, now_ns))
        hg_warn(AUTH, "wrong token from %s (client %s), %llu wrong ones in all", conn->peer.name,
            conn->client, (unsigned long long)conn->table->slots.peers.failures);
    audit_refusal(conn, NULL, HG_E_AUTH, "the token is not known, or has expired");
    refuse(conn, HG_E_AUTH, "auth", "the token is not known, or has expired");
}

// Whether a session that was made with the ticket has this secret for its resume.
static bool is_known_session(const struct hg_conn *conn, const struct hg_join_ticket *ticket)
{
    const struct hg_admission *a = conn->table->owner;
    const struct hg_session *s =
        conn->auth.resumes ? hg_session_find_ticket(a->sessions, conn->auth.secret_hash) : NULL;
    return s && s->resume.has_token && memcmp(s->resume.token, ticket->hash, 32) == 0;
}

static bool refuse_blocked(struct hg_conn *conn)
{
    const struct hg_admission *a = conn->table->owner;
    const uint64_t now_s = (uint64_t)time(NULL);
    const uint64_t until_s = hg_block_until(a->sessions->blocks, conn->auth.hash, now_s);
    struct hg_error err = {0};
    if (!until_s)
        return false;
    hg_error_set(&err, HG_E_PERM, "auth", NULL, "an administrator has blocked it for a while");
    const uint64_t left_s = until_s - now_s;
    hg_error_limit(&err, "kick", left_s < UINT32_MAX / 1000 ? (uint32_t)left_s * 1000 : UINT32_MAX);
    audit_refusal(conn, conn->auth.name, HG_E_PERM, err.reason);
    hg_conn_close(conn, &err, "auth");
    return true;
}

static bool refuse_used(struct hg_conn *conn)
{
    refuse_token(conn);
    return false;
}

// A use must be in the state log before its session is open: else it could be used again.
static bool refuse_unrecorded(struct hg_conn *conn)
{
    const struct hg_admission *a = conn->table->owner;
    const enum hg_status status = hg_state_log_refusal(a->sessions->scenes.log);
    struct hg_error err = {0};
    if (!status)
        return false;
    hg_error_set(&err, status, "auth", NULL,
        "join tickets cannot be used now: the daemon's state cannot be written (state-dir): %s; "
        "try again later",
        hg_status_text(status));
    audit_refusal(conn, NULL, status, err.reason);
    hg_conn_close(conn, &err, "auth");
    return true;
}

// Of a join ticket. False: it was refused.
static bool open_by_ticket(
    struct hg_conn *conn, struct hg_join_ticket *ticket, const struct hg_token *token)
{
    const struct hg_admission *a = conn->table->owner;
    const bool resumes = is_known_session(conn, ticket);
    if (!resumes && (conn->auth.resumes || !hg_join_ticket_is_good(ticket, (uint64_t)time(NULL))))
        return refuse_used(conn);
    if ((!resumes && refuse_unrecorded(conn)) || !open_session(conn, token))
        return false;
    conn->session->resume.only = resumes;
    if (!resumes)
        hg_outq_hold(&conn->out, hg_join_ticket_use(ticket, a->sessions->scenes.log));
    hg_conn_send(conn, 0, HGP_T_join_scene,
        &(struct hgp_join_scene){.scene = hgp_str_make(token->scope.scenes)});
    return true;
}

static void judge_token(struct hg_conn *conn)
{
    const struct hg_admission *a = conn->table->owner;
    const struct hg_token *token = hg_tokens_find(a->tokens, conn->auth.hash, time(NULL));
    struct hg_join_ticket *ticket =
        token ? NULL : hg_join_ticket_find(a->sessions->tickets, conn->auth.hash);
    struct hg_token as_token;
    if (!token && !ticket) {
        refuse_token(conn);
        return;
    }
    snprintf(conn->auth.name, sizeof conn->auth.name, "%.32s", token ? token->name : ticket->label);
    if (refuse_blocked(conn))
        return;
    conn->auth.has_token = true;
    if (ticket) {
        hg_join_ticket_as_token(ticket, &as_token);
        token = &as_token;
    }
    if (ticket ? open_by_ticket(conn, ticket, token) : open_session(conn, token))
        hg_conn_send(conn, conn->auth.request, HGP_T_auth_ok,
            &(struct hgp_auth_ok){.role = token->role, .name = hgp_str_make(conn->session->name)});
}

static void handle_auth(struct hg_conn *conn, uint32_t request, struct hgp_str token)
{
    uint64_t wait_ns = penalty_ns(conn), now_ns = conn->table->loop->now_ns;
    conn->auth.request = request;
    if (hg_token_hash(token, conn->auth.hash)) {
        refuse(conn, HG_E_NOMEM, "auth", "no memory to judge a token");
        return;
    }
    if (!wait_ns) {
        judge_token(conn);
        return;
    }
    conn->auth.due_ns = now_ns + wait_ns;
    conn->deadline_ns += wait_ns;
}

static void handle_auth_resume(
    struct hg_conn *conn, uint32_t request, const struct hgp_auth_resume *m)
{
    conn->auth.resumes = hg_sha256(m->secret.size ? m->secret.data : (const uint8_t *)"",
                             m->secret.size, conn->auth.secret_hash) == HG_OK;
    handle_auth(conn, request, m->token);
}

// What the session's token allows now; out is for that of a join ticket. NULL: it is no longer
// good.
static const struct hg_token *find_token(
    const struct hg_admission *a, const struct hg_conn *conn, int64_t now_s, struct hg_token *out)
{
    const struct hg_token *token = hg_tokens_find(a->tokens, conn->auth.hash, now_s);
    const struct hg_join_ticket *ticket =
        token ? NULL : hg_join_ticket_find(a->sessions->tickets, conn->auth.hash);
    if (ticket)
        hg_join_ticket_as_token(ticket, out);
    return ticket ? out : token;
}

// What a token allows now; its worker is told what of that is its business.
static void take_scope(struct hg_session *s, const struct hg_token_scope *scope)
{
    const bool told = strcmp(s->scope.roots, scope->roots) == 0 && s->scope.weight == scope->weight;
    s->scope = *scope;
    if (!told && s->scene && s->attached)
        hg_session_request_tell_tenant(s);
}

// token NULL: it is not good any more.
static const char *why_revoked(const struct hg_conn *conn, const struct hg_token *token)
{
    const struct hg_admission *a = conn->table->owner;
    if (token)
        return token->role == conn->session->role ? "its token has another tenant now"
                                                  : "its token has another role now";
    return hg_tokens_find(a->tokens, conn->auth.hash, 0) ? "its token has expired"
                                                         : "its token was revoked";
}

void hg_client_dispatch_check_tokens(struct hg_conn_table *conns)
{
    const struct hg_admission *a = conns->owner;
    int64_t now_s = time(NULL);
    struct hg_token of_ticket;
    hg_session_ticket_check(a->sessions, a->tokens, (uint64_t)now_s);
    for (struct hg_conn *it = conns->first, *next; it; it = next) {
        next = it->next;
        if (!it->session || !it->auth.has_token || it->state != HG_CONN_OPEN)
            continue;
        const struct hg_token *token = find_token(a, it, now_s, &of_ticket);
        if (token && token->role == it->session->role &&
            strcmp(token->tenant, it->session->tenant) == 0) {
            take_scope(it->session, &token->scope);
            continue;
        }
        struct hg_error err = {0};
        hg_error_set(&err, HG_E_AUTH, "session", NULL, "%s", why_revoked(it, token));
        hg_session_audit(it->session, "revoke", HG_E_AUTH, err.reason);
        hg_session_request_fail_all(it->session, &err);
        hg_conn_close(it, &err, "the token is no longer valid");
    }
}

// ---- the rules ----------------------------------------------------------------------------------

static const enum hgp_state table_state[] = {
    [HG_CONN_PREFACE] = HGP_HELLO,
    [HG_CONN_HELLO] = HGP_HELLO,
    [HG_CONN_AUTH] = HGP_AUTH,
    [HG_CONN_OPEN] = HGP_OPEN,
};

// State and direction, which end the connection when broken.
static bool obeys(const struct hg_conn *conn, const struct hgp_message_info *info)
{
    if (info->direction != HGP_C2S && info->direction != HGP_ANY)
        return false;
    if (info->type == HGP_T_hello)
        return conn->state == HG_CONN_HELLO;
    if (info->type == HGP_T_auth || info->type == HGP_T_auth_resume)
        return conn->state == HG_CONN_AUTH;
    return info->state <= table_state[conn->state];
}

static void refuse_payload(struct hg_conn *conn, const struct hgp_header *header,
    enum hg_status status, const struct hgp_fault *fault)
{
    const struct hgp_message_info *info = hgp_find(header->type);
    struct hg_error err = {0};
    char place[128];
    if (fault->field[0])
        snprintf(place, sizeof place, "%s", fault->field);
    else
        snprintf(place, sizeof place, "byte %llu", (unsigned long long)fault->offset);
    hg_error_set(&err, status, info ? info->name : "message", place, "%s (byte %llu)",
        fault->reason[0] ? fault->reason : hg_status_text(status),
        (unsigned long long)fault->offset);
    hg_count(HG_COUNT_REFUSED_MESSAGE);
    if (conn->state == HG_CONN_OPEN)
        hg_conn_fail(conn, header->request, &err);
    else
        hg_conn_close(conn, &err, "bad message");
}

static void refuse_unknown(struct hg_conn *conn, const struct hgp_header *header)
{
    if (header->flags & HGP_FLAG_OPTIONAL)
        return;
    struct hg_error err = {0};
    hg_error_set(&err, HG_E_UNSUPPORTED, "message", NULL, "type 0x%04x is not known in version %u",
        header->type, conn->version);
    if (conn->state == HG_CONN_OPEN)
        hg_conn_fail(conn, header->request, &err);
    else
        hg_conn_close(conn, &err, "unknown message");
}

static void dispatch(struct hg_conn *conn, struct hg_packet *packet, const union hgp_any *m)
{
    uint32_t request = packet->header.request;
    switch (packet->header.type) {
    case HGP_T_hello:
        handle_hello(conn, request, &m->hello);
        return;
    case HGP_T_auth:
        handle_auth(conn, request, m->auth.token);
        return;
    case HGP_T_auth_resume:
        handle_auth_resume(conn, request, &m->auth_resume);
        return;
    case HGP_T_ping:
        hg_conn_send_urgent(conn, request, HGP_T_pong, &(struct hgp_pong){.nonce = m->ping.nonce});
        return;
    case HGP_T_clock_query:
        hg_conn_send_urgent(
            conn, request, HGP_T_clock, &(struct hgp_clock){.time_ns = hg_clock_now_ns()});
        return;
    case HGP_T_pong:
        return;
    case HGP_T_error:
        hg_peer_warn(&conn->table->log, conn->table->loop->now_ns, NET, "%s reports an error: %.*s",
            conn->peer.name, (int)m->error.reason.size, m->error.reason.data);
        return;
    case HGP_T_bye:
        conn->peer_ended = true;
        hg_conn_close(conn, NULL, "goodbye");
        return;
    case HGP_T_keep:
        hg_resume_keep(conn->session, request);
        return;
    case HGP_T_resume:
        hg_resume(conn, request, &m->resume);
        return;
    default:
        hg_session_message(conn->session, packet, m);
    }
}

// Who asks for what the session may not is counted, and named in both logs as often as they take.
static void forbid(struct hg_conn *conn, uint32_t request, const struct hg_error *err)
{
    char detail[sizeof err->what + sizeof err->reason + 2];
    hg_count(HG_COUNT_REFUSED_PERMISSION);
    snprintf(detail, sizeof detail, "%s: %s", err->what, err->reason);
    hg_peer_warn(&conn->table->log, conn->table->loop->now_ns, SESSION,
        "session %llu of %s may not: %s", (unsigned long long)conn->number, conn->peer.name,
        detail);
    if (hg_session_allow_act(conn->session, err->what, NULL) == HG_OK)
        hg_session_audit(conn->session, "refuse", err->status, detail);
    hg_conn_fail(conn, request, err);
}

// A session of a used join ticket is there to be replaced.
static bool may_by_ticket(
    struct hg_conn *conn, const struct hgp_message_info *info, uint32_t request)
{
    struct hg_error err = {0};
    if (!conn->session || !conn->session->resume.only || info->type == HGP_T_resume ||
        info->state < HGP_OPEN)
        return true;
    hg_error_set(&err, HG_E_PERM, info->name, NULL,
        "the join ticket is used up: this session may resume the one it was for, and nothing else");
    forbid(conn, request, &err);
    return false;
}

static bool may_by_role(struct hg_conn *conn, const struct hgp_message_info *info, uint32_t request)
{
    if (!conn->session || info->role <= conn->session->role)
        return true;
    struct hg_error err = {0};
    hg_error_set(&err, HG_E_PERM, info->name, NULL, "needs the role %s; this session has %s",
        hgp_enum_name("role", info->role), hgp_enum_name("role", conn->session->role));
    forbid(conn, request, &err);
    return false;
}

static void take_message(struct hg_conn *conn, struct hg_packet *packet)
{
    const struct hgp_message_info *info = hgp_find(packet->header.type);
    if (!info || (conn->version && info->since > conn->version)) {
        refuse_unknown(conn, &packet->header);
        return;
    }
    if (!obeys(conn, info)) {
        struct hg_error err = {0};
        hg_error_set(&err, HG_E_STATE, info->name, NULL, "is not for a client to send now");
        hg_conn_close(conn, &err, "protocol error");
        return;
    }
    if (!may_by_role(conn, info, packet->header.request) ||
        !may_by_ticket(conn, info, packet->header.request))
        return;
    struct hg_arena arena = {0};
    union hgp_any any;
    struct hgp_fault fault = {0};
    enum hg_status status =
        hgp_decode(conn->version ? conn->version : HGP_VERSION_MAX, packet->header.type,
            hg_reader_make(packet->payload, packet->header.length), &arena, &any, &fault);
    if (status)
        refuse_payload(conn, &packet->header, status, &fault);
    else
        dispatch(conn, packet, &any);
    hg_arena_finish(&arena);
}

// ---- the connection's events --------------------------------------------------------------------

// Back-pressure of the session, of the worker that its scene is in where much of what waits for
// that is the session's, and of the disk for what needs it.
static bool must_wait(const struct hg_conn *conn)
{
    const struct hg_session *s = conn->session;
    return hg_session_request_is_full(s) || hg_session_request_is_crowded(s) ||
           hg_session_upload_must_wait(s, &conn->in) ||
           (s->scene && hg_state_log_is_behind(s->table->scenes.log));
}

static void grant_more(struct hg_conn *conn)
{
    if (!conn->session || !conn->session->scene)
        return;
    hg_session_request_pump(conn->session);
    hg_session_view_grant_all(conn->session);
}

static void end_session(struct hg_conn *conn)
{
    struct hg_session *session = conn->session;
    conn->session = NULL;
    if (!session)
        return;
    if (conn->state == HG_CONN_DEAD || session->resume.waits) {
        hg_session_lost(session);
        return;
    }
    hg_session_audit(session, "logout", HG_OK, NULL);
    hg_session_end(session);
}

const struct hg_conn_events hg_client_dispatch_events = {
    .admit = hg_conn_admit,
    .refused = hg_conn_answer_refusal,
    .unproven = audit_unproven,
    .message = take_message,
    .must_wait = must_wait,
    .due = judge_token,
    .drained = grant_more,
    .ended = end_session,
};
