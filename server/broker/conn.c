// conn.c - client connections: accepting, handshake, framing, rules of the protocol, time limits.
#include <stdio.h>
#include <string.h>
#include <sys/epoll.h>

#include "base/alloc.h"
#include "base/clock.h"
#include "server/broker/broker.h"

enum { CLOSING_NS = 2000000000, ACCEPT_PAUSE_NS = 200000000, ACCEPTS_PER_EVENT = 16 };

// ---- sending ------------------------------------------------------------------------------------

void hg_conn_send_packet(struct hg_conn *conn, uint32_t request, struct hg_packet *packet)
{
    if (conn->state >= HG_CONN_CLOSING) {
        hg_packet_unref(packet);
        return;
    }
    if (hg_outq_push(&conn->out, packet, request, 0))
        hg_conn_kill(conn, "no memory for an answer");
    else
        hg_conn_update(conn);
}

void hg_conn_send(struct hg_conn *conn, uint32_t request, enum hgp_type type, const void *message)
{
    hg_conn_send_packet(conn, request, hg_packet_encode(type, message));
}

void hg_conn_fail(struct hg_conn *conn, uint32_t request, const struct hg_error *err)
{
    const char *reason = err->reason[0] ? err->reason : hg_status_text(err->status);
    if (hg_log_is_enabled(HG_LOG_DEBUG, HG_LOG_SESSION))
        hg_debug(SESSION, "session %llu request %u: %s: %s (%s)", (unsigned long long)conn->number,
            request, err->what, reason, hg_status_name(err->status));
    if (request || conn->state != HG_CONN_OPEN)
        hg_conn_send(conn, request, HGP_T_error,
            &(struct hgp_error){.code = (uint16_t)err->status,
                .what = hgp_str_make(err->what),
                .where = hgp_str_make(err->where),
                .reason = hgp_str_make(reason)});
    else
        hg_conn_send(conn, 0, HGP_T_notice,
            &(struct hgp_notice){.code = (uint16_t)err->status,
                .what = hgp_str_make(err->what),
                .where = hgp_str_make(err->where),
                .reason = hgp_str_make(reason)});
}

// ---- ending -------------------------------------------------------------------------------------

void hg_conn_end_session(struct hg_conn *conn)
{
    struct hg_session *session = conn->session;
    conn->session = NULL;
    if (session)
        hg_session_end(session);
}

void hg_conn_kill(struct hg_conn *conn, const char *reason)
{
    struct hg_broker *b = conn->broker;
    if (conn->state == HG_CONN_DEAD)
        return;
    if (conn->state < HG_CONN_OPEN)
        hg_peer_log(b, NET, "closed %s before it was open: %s", conn->peer.name, reason);
    else
        hg_info(NET, "session %llu of %s closed: %s", (unsigned long long)conn->number,
            conn->peer.name, reason);
    conn->state = HG_CONN_DEAD;
    hg_loop_remove(&b->loop, &conn->source);
    hg_transport_close(&conn->transport);
    if (conn->paused)
        b->paused_count--;
    conn->paused = false;
    HG_LIST_REMOVE(b->conns, conn);
    b->conn_count--;
    conn->next = b->dead;
    b->dead = conn;
}

void hg_conn_close(struct hg_conn *conn, const struct hg_error *err, const char *reason)
{
    if (conn->state >= HG_CONN_CLOSING)
        return;
    if (err) {
        const char *text = err->reason[0] ? err->reason : hg_status_text(err->status);
        hg_conn_send(conn, 0, HGP_T_error,
            &(struct hgp_error){.code = (uint16_t)err->status,
                .what = hgp_str_make(err->what),
                .where = hgp_str_make(err->where),
                .reason = hgp_str_make(text)});
        hg_peer_log(conn->broker, NET, "closing %s: %s: %s (%s)", conn->peer.name, reason, text,
            hg_status_name(err->status));
    }
    hg_conn_send(conn, 0, HGP_T_bye, &(struct hgp_bye){.reason = hgp_str_make(reason)});
    if (conn->state == HG_CONN_DEAD)
        return;
    conn->state = HG_CONN_CLOSING;
    conn->deadline_ns = conn->broker->loop.now_ns + CLOSING_NS;
    conn->broker->closing = true;
    hg_conn_update(conn);
}

void hg_conn_destroy(struct hg_conn *conn)
{
    hgp_framer_finish(&conn->in);
    hg_outq_finish(&conn->out);
    hg_free(conn);
}

// ---- handshake ----------------------------------------------------------------------------------

static void refuse(
    struct hg_conn *conn, enum hg_status status, const char *what, const char *reason)
{
    struct hg_error err = {0};
    hg_error_set(&err, status, what, NULL, "%s", reason);
    hg_conn_close(conn, &err, what);
}

static bool open_session(struct hg_conn *conn, enum hgp_role role, const char *name)
{
    struct hg_broker *b = conn->broker;
    if (b->draining) {
        refuse(conn, HG_E_STATE, "session", "the daemon is shutting down");
        return false;
    }
    if (b->session_count >= b->options.max_sessions) {
        refuse(conn, HG_E_LIMIT, "session",
            "the daemon has as many sessions as it takes (max-sessions); try again later");
        return false;
    }
    conn->session = hg_session_create(conn, role, name);
    if (!conn->session) {
        refuse(conn, HG_E_NOMEM, "session", "no memory for a session");
        return false;
    }
    conn->state = HG_CONN_OPEN;
    conn->opened_ns = b->loop.now_ns;
    hg_info(SESSION, "session %llu open: %s, role %s, client %s, from %s",
        (unsigned long long)conn->number, name, hgp_enum_name("role", role), conn->client,
        conn->peer.name);
    return true;
}

static void handle_hello(struct hg_conn *conn, uint32_t request, const struct hgp_hello *m)
{
    struct hg_broker *b = conn->broker;
    snprintf(conn->client, sizeof conn->client, "%.*s", (int)m->client.size, m->client.data);
    if (m->version_min > HGP_VERSION_MAX || m->version_max < HGP_VERSION_MIN ||
        m->version_min > m->version_max) {
        refuse(conn, HG_E_VERSION, "hello", "this daemon speaks version 1");
        return;
    }
    conn->version = m->version_max < HGP_VERSION_MAX ? m->version_max : HGP_VERSION_MAX;
    bool trusted = conn->peer.is_local && conn->peer.same_user && !b->options.require_token;
    if (!trusted && !b->tokens.count) {
        refuse(conn, HG_E_AUTH, "hello",
            "only the daemon's own user may connect: it has no tokens for others");
        return;
    }
    if (!trusted &&
        hg_guard_is_blocked(&b->guard, conn->peer.name, b->options.auth_failures, b->loop.now_ns)) {
        refuse(conn, HG_E_AUTH, "hello", "too many wrong tokens from this address; wait a minute");
        return;
    }
    conn->number = ++b->last_session;
    if (trusted && !open_session(conn, HGP_role_ADMIN, "local"))
        return;
    if (!trusted)
        conn->state = HG_CONN_AUTH;
    hg_conn_send(conn, request, HGP_T_welcome,
        &(struct hgp_welcome){.version = conn->version,
            .server = hgp_str_make("heliod/" HELIO_VERSION),
            .session = conn->number,
            .auth_required = !trusted,
            .role = trusted ? HGP_role_ADMIN : HGP_role_NONE,
            .max_message_bytes = (uint32_t)b->options.max_message_bytes});
}

static void handle_auth(struct hg_conn *conn, uint32_t request, const struct hgp_auth *m)
{
    struct hg_broker *b = conn->broker;
    bool blocked =
        hg_guard_is_blocked(&b->guard, conn->peer.name, b->options.auth_failures, b->loop.now_ns);
    const struct hg_token *token = hg_tokens_find(&b->tokens, m->token);
    if (!token || blocked) {
        hg_guard_count_failure(&b->guard, conn->peer.name, b->loop.now_ns);
        if (hg_broker_may_log(b))
            hg_warn(AUTH, "wrong token from %s (client %s)%s", conn->peer.name, conn->client,
                blocked ? ", blocked" : "");
        refuse(conn, HG_E_AUTH, "auth",
            blocked ? "too many wrong tokens from this address; wait a minute"
                    : "the token is not known");
        return;
    }
    enum hgp_role role = token->role;
    if (open_session(conn, role, token->name))
        hg_conn_send(conn, request, HGP_T_auth_ok,
            &(struct hgp_auth_ok){.role = role, .name = hgp_str_make(conn->session->name)});
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
    if (info->type == HGP_T_auth)
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
        fault->reason ? fault->reason : hg_status_text(status), (unsigned long long)fault->offset);
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
        handle_auth(conn, request, &m->auth);
        return;
    case HGP_T_ping:
        hg_conn_send(conn, request, HGP_T_pong, &(struct hgp_pong){.nonce = m->ping.nonce});
        return;
    case HGP_T_pong:
        return;
    case HGP_T_error:
        hg_peer_log(conn->broker, NET, "%s reports an error: %.*s", conn->peer.name,
            (int)m->error.reason.size, m->error.reason.data);
        return;
    case HGP_T_bye:
        conn->peer_ended = true;
        hg_conn_close(conn, NULL, "goodbye");
        return;
    default:
        hg_session_message(conn->session, packet, m);
    }
}

static bool may_by_role(struct hg_conn *conn, const struct hgp_message_info *info, uint32_t request)
{
    if (!conn->session || info->role <= conn->session->role)
        return true;
    struct hg_error err = {0};
    hg_error_set(&err, HG_E_PERM, info->name, NULL, "needs the role %s; this session has %s",
        hgp_enum_name("role", info->role), hgp_enum_name("role", conn->session->role));
    hg_conn_fail(conn, request, &err);
    return false;
}

static void handle(struct hg_conn *conn, struct hg_packet *packet)
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
    if (!may_by_role(conn, info, packet->header.request))
        return;
    struct hg_arena arena = {0};
    union hgp_any any;
    struct hgp_fault fault = {0};
    enum hg_status status = hgp_decode(conn->version ? conn->version : HGP_VERSION_MAX,
        packet->header.type, packet->payload, packet->header.length, &arena, &any, &fault);
    if (status)
        refuse_payload(conn, &packet->header, status, &fault);
    else
        dispatch(conn, packet, &any);
    hg_arena_finish(&arena);
}

// ---- reading ------------------------------------------------------------------------------------

static uint32_t payload_limit(const struct hg_conn *conn)
{
    return conn->state == HG_CONN_OPEN ? (uint32_t)conn->broker->options.max_message_bytes
                                       : HGP_LIMIT_BEFORE_AUTH;
}

static void refuse_stream(struct hg_conn *conn, enum hg_status status)
{
    struct hg_error err = {0};
    if (status == HG_E_LIMIT)
        hg_error_set(&err, status, "message", "length", "payloads may have %u bytes here",
            payload_limit(conn));
    else
        hg_error_set(&err, status, "message", "flags", "the header cannot be believed");
    hg_conn_close(conn, &err, "protocol error");
}

// A fast client is read more slowly, not refused.
static bool may_take_message(struct hg_conn *conn)
{
    uint64_t now_ns = conn->broker->loop.now_ns;
    double rate = conn->broker->options.max_rate;
    conn->allowance += (double)(now_ns - conn->allowance_ns) * 1e-9 * rate;
    conn->allowance_ns = now_ns;
    if (conn->allowance > rate)
        conn->allowance = rate;
    return conn->allowance >= 1;
}

static bool must_pause(struct hg_conn *conn)
{
    struct hg_broker *b = conn->broker;
    if (conn->state != HG_CONN_OPEN)
        return false;
    return conn->out.bytes > b->options.output_limit_bytes ||
           b->link.out.bytes > b->options.input_limit_bytes || hg_session_is_full(conn->session) ||
           !may_take_message(conn);
}

static bool take_preface(struct hg_conn *conn)
{
    const uint8_t *bytes = hgp_framer_take(&conn->in, HGP_PREFACE_BYTES);
    if (!bytes)
        return false;
    if (memcmp(bytes, HGP_PREFACE, HGP_PREFACE_BYTES) != 0) {
        hg_conn_kill(conn, "not an HGP client");
        return false;
    }
    conn->state = HG_CONN_HELLO;
    return true;
}

static bool take_message(struct hg_conn *conn)
{
    struct hg_packet *packet;
    enum hg_status status = hg_packet_next(&conn->in, payload_limit(conn), &packet);
    if (status == HG_E_NOMEM)
        hg_conn_kill(conn, "no memory for a message");
    else if (status)
        refuse_stream(conn, status);
    if (!packet)
        return false;
    conn->allowance -= 1;
    handle(conn, packet);
    hg_packet_unref(packet);
    return true;
}

// Handles the messages that are there, until something makes the connection wait.
static void process(struct hg_conn *conn)
{
    while (conn->state < HG_CONN_CLOSING && !must_pause(conn)) {
        if (conn->state == HG_CONN_PREFACE ? !take_preface(conn) : !take_message(conn))
            break;
    }
    if (conn->peer_ended && conn->state < HG_CONN_CLOSING && !must_pause(conn))
        hg_conn_kill(conn, "the client closed the connection");
}

static void receive(struct hg_conn *conn)
{
    enum hg_status status = hg_packet_receive(&conn->in, &conn->transport);
    conn->received_ns = conn->broker->loop.now_ns;
    conn->ping_ns = 0;
    if (conn->state == HG_CONN_CLOSING) { // what still comes is of no interest
        hgp_framer_finish(&conn->in);
        if (status == HG_E_CLOSED || status == HG_E_IO)
            hg_conn_kill(conn, "the client closed the connection");
        return;
    }
    if (status == HG_E_CLOSED)
        conn->peer_ended = true;
    else if (status == HG_E_IO || status == HG_E_NOMEM)
        hg_conn_kill(conn, hg_status_text(status));
    process(conn);
}

static void transmit(struct hg_conn *conn)
{
    bool was_over = conn->out.bytes > conn->broker->options.output_limit_bytes;
    if (hg_outq_flush(&conn->out, &conn->transport)) {
        hg_conn_kill(conn, "the client closed the connection");
        return;
    }
    if (conn->state == HG_CONN_CLOSING && !conn->out.head) {
        conn->transport.class->end_writing(&conn->transport);
        if (conn->peer_ended)
            hg_conn_kill(conn, "done");
        return;
    }
    if (was_over && conn->session && conn->out.bytes <= conn->broker->options.output_limit_bytes)
        hg_session_grant(conn->session);
}

static void ready(struct hg_source *source, uint32_t events)
{
    struct hg_conn *conn = source->owner;
    if (events & EPOLLOUT)
        transmit(conn);
    if ((events & EPOLLIN) && conn->state != HG_CONN_DEAD)
        receive(conn);
    if ((events & (EPOLLERR | EPOLLHUP)) && !(events & EPOLLIN) && conn->state != HG_CONN_DEAD)
        hg_conn_kill(conn, "the client closed the connection");
    if (conn->state != HG_CONN_DEAD)
        hg_conn_update(conn);
}

// Only hg_conn_resume ends a pause: messages that were read before it come first.
void hg_conn_update(struct hg_conn *conn)
{
    if (conn->state == HG_CONN_DEAD)
        return;
    if (!conn->paused && must_pause(conn)) {
        conn->paused = true;
        conn->broker->paused_count++;
    }
    bool read = !conn->paused && !conn->peer_ended;
    hg_loop_set_events(&conn->broker->loop, &conn->source,
        conn->transport.class->wants(&conn->transport, read, conn->out.head != NULL));
}

void hg_conn_resume(struct hg_conn *conn)
{
    if (conn->state == HG_CONN_DEAD || must_pause(conn))
        return;
    conn->paused = false;
    conn->broker->paused_count--;
    process(conn);
    hg_conn_update(conn);
}

// ---- time ---------------------------------------------------------------------------------------

static void check_idle(struct hg_conn *conn, uint64_t now_ns)
{
    const struct hg_options *o = &conn->broker->options;
    uint64_t silent_ns = now_ns - conn->received_ns;
    if (conn->peer.is_local || conn->paused)
        return;
    if (o->idle_timeout_ns && silent_ns > o->idle_timeout_ns)
        hg_conn_kill(conn, "silent for too long (idle-timeout)");
    else if (silent_ns > o->idle_ping_ns && !conn->ping_ns) {
        conn->ping_ns = now_ns;
        hg_conn_send(conn, 0, HGP_T_ping, &(struct hgp_ping){.nonce = now_ns});
    }
}

void hg_conn_check_time(struct hg_conn *conn, uint64_t now_ns)
{
    const struct hg_options *o = &conn->broker->options;
    if (conn->state == HG_CONN_CLOSING) {
        if (now_ns > conn->deadline_ns)
            hg_conn_kill(conn, "did not take its last messages");
        return;
    }
    if (conn->state < HG_CONN_OPEN && now_ns > conn->deadline_ns) {
        struct hg_error err = {0};
        hg_error_set(&err, HG_E_TIMEOUT, "handshake", NULL, "was not finished in time");
        if (conn->state == HG_CONN_PREFACE)
            hg_conn_kill(conn, "sent no preface in time");
        else
            hg_conn_close(conn, &err, "handshake");
        return;
    }
    if (conn->out.head && now_ns > conn->out.progress_ns + o->peer_timeout_ns) {
        hg_conn_kill(conn, "takes nothing of what waits for it (peer-timeout)");
        return;
    }
    if (conn->state == HG_CONN_OPEN)
        check_idle(conn, now_ns);
}

// ---- accepting ----------------------------------------------------------------------------------

static void turn_away(struct hg_conn *conn)
{
    struct hg_error err = {0};
    hg_error_set(&err, HG_E_LIMIT, "connection", NULL,
        "the daemon has as many connections as it takes (max-connections); try again later");
    hg_conn_close(conn, &err, "too many connections");
    if (conn->state != HG_CONN_DEAD && hg_outq_flush(&conn->out, &conn->transport) == HG_OK)
        hg_conn_kill(conn, "too many connections");
}

static void add_conn(
    struct hg_broker *b, const struct hg_listener *listener, struct hg_transport *transport)
{
    struct hg_conn *conn = hg_calloc(1, sizeof *conn);
    if (!conn) {
        hg_transport_close(transport);
        return;
    }
    *conn = (struct hg_conn){
        .broker = b,
        .source = {.fd = transport->fd, .events = EPOLLIN, .ready = ready, .owner = conn},
        .transport = *transport,
        .in = {.frames = &hg_packet_frames},
        .deadline_ns = b->loop.now_ns + b->options.handshake_timeout_ns,
        .received_ns = b->loop.now_ns,
        .allowance = b->options.max_rate,
        .allowance_ns = b->loop.now_ns,
    };
    if (hg_loop_add(&b->loop, &conn->source)) {
        hg_transport_close(transport);
        hg_free(conn);
        return;
    }
    HG_LIST_ADD(b->conns, conn);
    b->conn_count++;
    conn->transport.class->greet(&conn->transport, b->options.peer_timeout_ns, &conn->peer);
    hg_debug(NET, "connection from %s at %s", conn->peer.name, listener->name);
    if (b->conn_count > b->options.max_connections)
        turn_away(conn);
}

void hg_conn_accept(struct hg_broker *b, struct hg_listener *listener)
{
    struct hg_transport transport;
    struct hg_error err = {0};
    for (int i = 0; i < ACCEPTS_PER_EVENT; i++) {
        enum hg_status status = hg_listener_accept(listener, &transport, &err);
        if (!status) {
            add_conn(b, listener, &transport);
            continue;
        }
        if (status == HG_E_LIMIT) { // look again when others may have gone
            hg_peer_log(b, NET, "%s", err.reason);
            b->accept_pause_ns = b->loop.now_ns + ACCEPT_PAUSE_NS;
        }
        return;
    }
}
