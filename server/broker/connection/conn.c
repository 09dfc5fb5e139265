#include "server/broker/connection/conn.h"

#include <stdio.h>
#include <string.h>
#include <sys/epoll.h>

#include "base/alloc.h"
#include "base/clock.h"
#include "server/broker/transport/address_list.h"
#include "server/broker/metrics/counters.h"
#include "server/broker/list.h"
#include "server/broker/transport/ws_transport.h"

enum { WHO_BYTES = 160 }; // a name, an address and the number of a session
enum { CLOSING_NS = 2000000000, ACCEPT_PAUSE_NS = 200000000, ACCEPTS_PER_EVENT = 16 };
// hello, auth and some pings; what is answered to them is small.
enum { MESSAGES_BEFORE_OPEN = 32, OUTPUT_BEFORE_OPEN = 4096 };
// Of a connection in one round of the loop: the others wait for it.
enum { MESSAGES_PER_ROUND = 32, READS_PER_ROUND = 16, ROUND_NS = 250000 };

uint64_t hg_conn_output_limit(const struct hg_conn *conn)
{
    uint64_t limit = conn->table->options->output_limit_bytes;
    const uint64_t share = conn->budget.output_share;
    return share && share < limit ? share : limit;
}

bool hg_conn_is_slow(const struct hg_conn *conn)
{
    return conn->out.bytes > hg_conn_output_limit(conn);
}

// ---- sending ------------------------------------------------------------------------------------

static void send_packet(
    struct hg_conn *conn, uint32_t request, struct hg_packet *packet, bool urgent)
{
    if (conn->state >= HG_CONN_CLOSING) {
        hg_packet_unref(packet);
        return;
    }
    hg_count(HG_COUNT_MESSAGES_OUT);
    if (urgent ? hg_outq_push_urgent(&conn->out, packet, request)
               : hg_outq_push(&conn->out, packet, request, 0))
        hg_conn_kill(conn, "no memory for an answer");
    else
        hg_conn_update(conn);
}

void hg_conn_send_packet(struct hg_conn *conn, uint32_t request, struct hg_packet *packet)
{
    send_packet(conn, request, packet, false);
}

void hg_conn_send_urgent(
    struct hg_conn *conn, uint32_t request, enum hgp_type type, const void *message)
{
    send_packet(conn, request, hg_packet_encode(type, message), true);
}

void hg_conn_send(struct hg_conn *conn, uint32_t request, enum hgp_type type, const void *message)
{
    hg_conn_send_packet(conn, request, hg_packet_encode(type, message));
}

void hg_conn_tell_limit(
    struct hg_conn *conn, uint32_t request, const char *limit, uint32_t retry_after_ms)
{
    if (limit[0])
        hg_conn_send(conn, 0, HGP_T_limited,
            &(struct hgp_limited){.request = request,
                .limit = hgp_str_make(limit),
                .retry_after_ms = retry_after_ms});
}

void hg_conn_fail(struct hg_conn *conn, uint32_t request, const struct hg_error *err)
{
    const char *reason = err->reason[0] ? err->reason : hg_status_text(err->status);
    if (hg_log_is_enabled(HG_LOG_DEBUG, HG_LOG_SESSION))
        hg_debug(SESSION, "session %llu request %u: %s: %s (%s)", (unsigned long long)conn->number,
            request, err->what, reason, hg_status_name(err->status));
    if (conn->state == HG_CONN_OPEN)
        hg_count_error(err->status);
    hg_conn_tell_limit(conn, request, err->limit, err->retry_after_ms);
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

// ---- turns --------------------------------------------------------------------------------------

// By its token once it has one and its session is open, before it by its network. A token's key
// begins with a byte that no name of a network does.
static enum hg_status join_party(struct hg_conn *conn)
{
    const struct hg_peer *peer = &conn->peer;
    uint8_t key[HG_TURN_KEY_BYTES] = {1};
    if (conn->state == HG_CONN_OPEN && conn->auth.has_token)
        memcpy(key + 1, conn->auth.hash, sizeof conn->auth.hash);
    else
        snprintf((char *)key, sizeof key, "%s", peer->network[0] ? peer->network : peer->source);
    return hg_turn_join(&conn->turn, key);
}

// ---- ending -------------------------------------------------------------------------------------

void hg_conn_set_open(struct hg_conn *conn, double rate)
{
    hg_slots_set_opening(&conn->table->slots, &conn->slot, false);
    conn->state = HG_CONN_OPEN;
    if (join_party(conn)) // no memory: its turns are with those of its network
        hg_warn(NET, "session %llu has no turns of its own: no memory",
            (unsigned long long)conn->number);
    conn->opened_ns = conn->rate.since_ns = conn->table->loop->now_ns;
    conn->rate.per_second = conn->rate.allowance = rate;
}

// Whose it is, as far as that is known: for logs.
static const char *who(const struct hg_conn *conn, char *dst, size_t size)
{
    const char *name = conn->auth.name;
    if (conn->opened_ns)
        snprintf(dst, size, "session %llu (%s) of %s", (unsigned long long)conn->number, name,
            conn->peer.name);
    else if (name[0])
        snprintf(dst, size, "%s (%s)", conn->peer.name, name);
    else
        snprintf(dst, size, "%s", conn->peer.name);
    return dst;
}

// It was answered over HTTP, or came and went without a word: balancers look every second.
static bool is_probe(const struct hg_conn *conn)
{
    return conn->transport.served || (conn->peer_ended && !conn->in.total_bytes);
}

void hg_conn_kill(struct hg_conn *conn, const char *reason)
{
    struct hg_conn_table *table = conn->table;
    char text[WHO_BYTES];
    if (conn->state == HG_CONN_DEAD)
        return;
    if (conn->state == HG_CONN_CLOSING ? !conn->opened_ns
                                       : conn->state < HG_CONN_OPEN && is_probe(conn))
        hg_debug(NET, "closed %s: %s", conn->peer.name, reason);
    else if (conn->state < HG_CONN_OPEN)
        hg_peer_warn(&table->log, table->loop->now_ns, NET, "closed %s before it was open: %s",
            conn->peer.name, reason);
    else
        hg_info(NET, "%s closed: %s", who(conn, text, sizeof text), reason);
    conn->state = HG_CONN_DEAD;
    hg_loop_remove(table->loop, &conn->source);
    hg_transport_close(&conn->transport);
    hg_turn_leave(&conn->turn);
    hg_slots_leave(&table->slots, &conn->slot, table->loop->now_ns);
    HG_LIST_REMOVE(table->first, conn);
    conn->next = table->dead;
    table->dead = conn;
}

void hg_conn_close_transport(struct hg_conn *conn)
{
    hg_outq_finish(&conn->out);
    conn->state = HG_CONN_CLOSING;
    conn->deadline_ns = conn->table->loop->now_ns + CLOSING_NS;
    conn->table->closing = true;
    hg_turn_unpause(&conn->turn);
}

void hg_conn_close(struct hg_conn *conn, const struct hg_error *err, const char *reason)
{
    if (conn->state >= HG_CONN_CLOSING)
        return;
    char name[WHO_BYTES];
    if (err) {
        const char *text = err->reason[0] ? err->reason : hg_status_text(err->status);
        hg_conn_tell_limit(conn, 0, err->limit, err->retry_after_ms);
        hg_conn_send(conn, 0, HGP_T_error,
            &(struct hgp_error){.code = (uint16_t)err->status,
                .what = hgp_str_make(err->what),
                .where = hgp_str_make(err->where),
                .reason = hgp_str_make(text)});
        hg_peer_warn(&conn->table->log, conn->table->loop->now_ns, NET, "closing %s: %s: %s (%s)",
            who(conn, name, sizeof name), reason, text, hg_status_name(err->status));
    }
    hg_conn_send(conn, 0, HGP_T_bye, &(struct hgp_bye){.reason = hgp_str_make(reason)});
    if (conn->state == HG_CONN_DEAD)
        return;
    conn->state = HG_CONN_CLOSING;
    conn->deadline_ns = conn->table->loop->now_ns + CLOSING_NS;
    conn->table->closing = true;
    hg_conn_update(conn);
}

static void destroy(struct hg_conn *conn)
{
    hgp_framer_finish(&conn->in);
    hg_outq_finish(&conn->out);
    hg_free(conn);
}

bool hg_conn_is_between(const struct hg_conn *conn)
{
    return conn->state == HG_CONN_PREFACE && conn->transport.served && !(conn->transport.stage & 1);
}

// ---- reading ------------------------------------------------------------------------------------

static uint32_t payload_limit(const struct hg_conn *conn)
{
    return conn->state == HG_CONN_OPEN ? (uint32_t)conn->table->options->max_message_bytes
                                       : HGP_LIMIT_BEFORE_AUTH;
}

static void refuse_stream(struct hg_conn *conn, enum hg_status status)
{
    struct hg_error err = {0};
    hg_count(HG_COUNT_REFUSED_MESSAGE);
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
    uint64_t now_ns = conn->table->loop->now_ns;
    conn->rate.allowance += (double)(now_ns - conn->rate.since_ns) * 1e-9 * conn->rate.per_second;
    conn->rate.since_ns = now_ns;
    if (conn->rate.allowance > conn->rate.per_second)
        conn->rate.allowance = conn->rate.per_second;
    return conn->rate.allowance >= 1;
}

static bool must_pause(struct hg_conn *conn)
{
    const bool has_had_turn = conn->turn.deferred || conn->turn.missed;
    if (conn->state < HG_CONN_OPEN)
        return has_had_turn || conn->auth.due_ns || conn->out.bytes > OUTPUT_BEFORE_OPEN;
    if (conn->state != HG_CONN_OPEN)
        return false;
    return conn->table->quiet || has_had_turn || hg_conn_is_slow(conn) ||
           conn->table->events->must_wait(conn) || !may_take_message(conn);
}

static bool take_preface(struct hg_conn *conn)
{
    const uint8_t *bytes = hgp_framer_take(&conn->in, HGP_PREFACE_BYTES);
    if (!bytes)
        return false;
    if (memcmp(bytes, HGP_PREFACE, HGP_PREFACE_BYTES) != 0) {
        hg_count(HG_COUNT_REFUSED_PREFACE);
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
    conn->rate.allowance -= 1;
    hg_turn_spend(&conn->turn, 0, 1);
    conn->budget.fill_ns = 0;
    hg_count(HG_COUNT_MESSAGES_IN);
    if (conn->state < HG_CONN_OPEN && conn->rate.allowance < 0) {
        struct hg_error err = {0};
        hg_count(HG_COUNT_REFUSED_MESSAGE);
        hg_packet_unref(packet);
        hg_error_set(&err, HG_E_LIMIT, "message", NULL,
            "at most %d messages come before the session is open", MESSAGES_BEFORE_OPEN);
        hg_conn_close(conn, &err, "too many messages");
        return false;
    }
    conn->table->events->message(conn, packet);
    hg_packet_unref(packet);
    return true;
}

// What it has to do next comes in the next round.
static void defer(struct hg_conn *conn)
{
    conn->turn.deferred = conn->table->turns.more = true;
}

// Handles queued messages until the connection has to wait.
static void process(struct hg_conn *conn)
{
    const uint64_t begin_ns = hg_clock_now_ns();
    for (int i = 0; conn->state < HG_CONN_CLOSING && !must_pause(conn); i++) {
        const bool had_turn = i == MESSAGES_PER_ROUND || hg_turn_is_over(&conn->turn) ||
                              hg_clock_now_ns() - begin_ns > ROUND_NS;
        if (had_turn && i > 0 && conn->state == HG_CONN_OPEN) {
            defer(conn);
            return;
        }
        if (conn->state == HG_CONN_PREFACE ? !take_preface(conn) : !take_message(conn))
            break;
    }
    if (conn->peer_ended && conn->state < HG_CONN_CLOSING && !must_pause(conn))
        hg_conn_kill(conn, "the client closed the connection");
}

// A request of HTTP, or an answer, has its own time.
static void check_stage(struct hg_conn *conn)
{
    const struct hg_options *o = conn->table->options;
    if (conn->state < HG_CONN_OPEN)
        hg_slots_set_opening(&conn->table->slots, &conn->slot, !hg_conn_is_between(conn));
    if (conn->transport.known_stage == conn->transport.stage)
        return;
    conn->transport.known_stage = conn->transport.stage;
    if (conn->state < HG_CONN_OPEN)
        conn->deadline_ns =
            conn->table->loop->now_ns +
            (conn->transport.known_stage & 1 ? o->peer_timeout_ns : o->handshake_timeout_ns);
}

// The transport has ended the conversation in its own way.
static void end_transport(struct hg_conn *conn, enum hg_status status)
{
    const char *fault = conn->transport.fault ? conn->transport.fault : "protocol error";
    if (status == HG_E_FORMAT)
        hg_peer_warn(&conn->table->log, conn->table->loop->now_ns, NET, "closing %s: %s",
            conn->peer.name, fault);
    if (status == HG_E_FORMAT && conn->peer.unproven)
        conn->table->events->unproven(conn, fault);
    hg_conn_close_transport(conn);
}

// It comes from elsewhere than it seemed (PROXY protocol): that address counts.
static void rename_peer(struct hg_conn *conn)
{
    struct hg_conn_table *table = conn->table;
    conn->transport.renamed = false;
    hg_slots_leave(&table->slots, &conn->slot, table->loop->now_ns);
    if (hg_slots_take(&table->slots, &conn->peer, &conn->slot) || join_party(conn))
        hg_conn_kill(conn, "no memory for a connection");
    else
        conn->table->events->admit(conn);
}

static void receive(struct hg_conn *conn)
{
    const uint64_t before = conn->in.total_bytes;
    enum hg_status status = hg_packet_receive(&conn->in, &conn->transport);
    hg_count_add(HG_COUNT_BYTES_IN, conn->in.total_bytes - before);
    if (conn->in.total_bytes != before || conn->state < HG_CONN_OPEN) { // not half a TLS record
        conn->received_ns = conn->table->loop->now_ns;
        conn->ping_ns = 0;
    }
    check_stage(conn);
    if (conn->transport.renamed)
        rename_peer(conn);
    if (conn->slot.why && conn->state < HG_CONN_CLOSING) {
        conn->table->events->refused(conn, status);
        return;
    }
    if (conn->state == HG_CONN_CLOSING) { // further input is discarded
        hgp_framer_finish(&conn->in);
        if (status == HG_E_CLOSED || status == HG_E_IO)
            hg_conn_kill(conn, "the client closed the connection");
        return;
    }
    if (status == HG_E_STATE || status == HG_E_FORMAT) {
        end_transport(conn, status);
        return;
    }
    if (status == HG_E_CLOSED)
        conn->peer_ended = true;
    else if (status == HG_E_IO || status == HG_E_NOMEM)
        hg_conn_kill(conn, hg_status_text(status));
    process(conn);
}

// What a transport holds back (a part of a TLS record, a request behind another) announces itself
// by no event.
static void receive_all(struct hg_conn *conn)
{
    for (int i = 0; i < READS_PER_ROUND; i++) {
        receive(conn);
        if (conn->state >= HG_CONN_CLOSING || conn->peer_ended || must_pause(conn) ||
            !hg_transport_has_input(&conn->transport))
            return;
    }
    defer(conn);
}

// All that was for the client is on its way: it sees the end.
static void finish_closing(struct hg_conn *conn)
{
    enum hg_status status = hg_transport_flush(&conn->transport);
    if (!status)
        conn->transport.class->end_writing(&conn->transport);
    conn->transport.farewell = !status;
    if ((!status && conn->peer_ended) || status == HG_E_CLOSED || status == HG_E_IO)
        hg_conn_kill(conn, "done");
}

static void transmit(struct hg_conn *conn)
{
    bool was_slow = hg_conn_is_slow(conn);
    const size_t before = conn->out.bytes;
    enum hg_status status = hg_outq_flush(&conn->out, &conn->transport);
    hg_count_add(HG_COUNT_BYTES_OUT, before - conn->out.bytes);
    if (status) {
        hg_conn_kill(conn, "the client closed the connection");
        return;
    }
    if (conn->state == HG_CONN_CLOSING && !conn->out.head) {
        finish_closing(conn);
        return;
    }
    status = hg_transport_flush(&conn->transport);
    check_stage(conn);
    if (status == HG_E_CLOSED || status == HG_E_IO) {
        hg_conn_kill(conn, "the client closed the connection");
        return;
    }
    if (conn->starved || (was_slow && !hg_conn_is_slow(conn))) {
        conn->starved = false;
        conn->table->events->drained(conn);
    }
}

static void take_events(struct hg_conn *conn, uint32_t events)
{
    bool read = events & EPOLLIN;
    if (events & EPOLLOUT) {
        transmit(conn);
        read |= !conn->turn.paused && hg_transport_has_input(&conn->transport);
    }
    if (read && conn->state != HG_CONN_DEAD)
        receive_all(conn);
    if ((events & (EPOLLERR | EPOLLHUP)) && !(events & EPOLLIN) && conn->state != HG_CONN_DEAD)
        hg_conn_kill(conn, "the client closed the connection");
    if (conn->state != HG_CONN_DEAD)
        hg_conn_update(conn);
}

// Where others of its party have used up their turn, it comes behind those that wait already. What
// ends it is cheap, and is taken at once.
static void ready(struct hg_source *source, uint32_t events)
{
    struct hg_conn *conn = source->owner;
    const uint64_t begin_ns = hg_clock_now_ns();
    if (conn->state < HG_CONN_CLOSING && !(events & (EPOLLERR | EPOLLHUP)) &&
        hg_turn_is_over(&conn->turn)) {
        conn->turn.missed |= events;
        conn->table->turns.more = true;
        hg_conn_update(conn);
        return;
    }
    take_events(conn, events);
    hg_turn_spend(&conn->turn, hg_clock_now_ns() - begin_ns, 0);
}

// Only resume ends a pause: messages that were read before it come first.
void hg_conn_update(struct hg_conn *conn)
{
    if (conn->state == HG_CONN_DEAD)
        return;
    if (must_pause(conn))
        hg_turn_pause(&conn->turn);
    if (conn->turn.missed && conn->state < HG_CONN_CLOSING) {
        hg_loop_set_events(conn->table->loop, &conn->source, 0);
        return;
    }
    bool read = !conn->turn.paused && !conn->peer_ended;
    bool write = hg_outq_may_send(&conn->out) ||
                 (conn->state == HG_CONN_CLOSING && !conn->out.head && !conn->transport.farewell);
    hg_loop_set_events(conn->table->loop, &conn->source,
        conn->transport.class->wants(&conn->transport, read, write));
}

static void resume(void *owner)
{
    struct hg_conn *conn = owner;
    const uint32_t missed = conn->turn.missed;
    conn->turn.missed = 0;
    conn->turn.deferred = false;
    if (missed & EPOLLOUT)
        transmit(conn);
    if (conn->state == HG_CONN_DEAD)
        return;
    if (!must_pause(conn)) {
        hg_turn_unpause(&conn->turn);
        process(conn);
        if (conn->state < HG_CONN_CLOSING && !must_pause(conn) &&
            (missed & EPOLLIN || hg_transport_has_input(&conn->transport)))
            receive_all(conn);
    }
    hg_conn_update(conn);
}

// ---- accepting ----------------------------------------------------------------------------------

// NULL: no memory, and the transport is closed.
static struct hg_conn *add_conn(struct hg_conn_table *table, struct hg_transport *transport)
{
    struct hg_conn *conn = hg_calloc(1, sizeof *conn);
    if (!conn) {
        hg_transport_close(transport);
        return NULL;
    }
    *conn = (struct hg_conn){
        .table = table,
        .source = {.fd = transport->fd, .events = EPOLLIN, .ready = ready, .owner = conn},
        .transport = *transport,
        .in = {.frames = &hg_packet_frames, .pool = &table->chunks},
        .out = {.reached = table->reached},
        .turn = {.turns = &table->turns, .owner = conn},
        .deadline_ns = table->loop->now_ns + table->options->handshake_timeout_ns,
        .received_ns = table->loop->now_ns,
        .rate = {.allowance = MESSAGES_BEFORE_OPEN},
    };
    if (hg_loop_add(table->loop, &conn->source)) {
        hg_transport_close(transport);
        hg_free(conn);
        return NULL;
    }
    HG_LIST_ADD(table->first, conn);
    conn->transport.peer = &conn->peer;
    conn->transport.class->greet(&conn->transport, table->options->peer_timeout_ns, &conn->peer);
    if (hg_slots_take(&table->slots, &conn->peer, &conn->slot) == HG_OK &&
        join_party(conn) == HG_OK)
        return conn;
    hg_conn_kill(conn, "no memory for a connection");
    return NULL;
}

static void take_client(
    struct hg_conn_table *table, const struct hg_listener *listener, struct hg_transport *transport)
{
    hg_count(HG_COUNT_ACCEPTED);
    struct hg_conn *conn = add_conn(table, transport);
    if (!conn)
        return;
    hg_debug(NET, "connection from %s at %s", conn->peer.name, listener->name);
    const struct hg_entry entry = {table->web, listener->tls ? table->tls : NULL};
    const bool proxied = hg_address_list_has(&table->options->proxy_from, conn->peer.name);
    if (proxied ? hg_proxied_begin(&conn->transport, &entry)
                : hg_entry_begin(&conn->transport, &entry))
        hg_conn_kill(conn, "no memory for a connection");
    else
        conn->table->events->admit(conn);
}

bool hg_conn_kind(const struct hg_conn *conn, unsigned *kind)
{
    const bool websocket = conn->transport.class == &hg_transport_websocket;
    const struct hg_transport *socket =
        websocket ? hg_ws_transport_below(&conn->transport) : &conn->transport;
    *kind = (socket->class == &hg_transport_tcp ? HG_CONN_TCP : 0u) |
            (websocket ? HG_CONN_WEBSOCKET : 0u);
    return (socket->class == &hg_transport_tcp || socket->class == &hg_transport_unix) &&
           !(websocket && hg_ws_transport_has_ended(&conn->transport));
}

void hg_conn_save(const struct hg_conn *conn, struct hg_writer *streams)
{
    if (conn->transport.class == &hg_transport_websocket)
        hg_ws_transport_save(&conn->transport, streams);
    hg_packet_save_input(&conn->in, streams);
    hg_outq_save(&conn->out, streams);
}

struct hg_conn *hg_conn_adopt(
    struct hg_conn_table *table, int fd, unsigned kind, struct hg_reader *streams)
{
    struct hg_transport transport;
    hg_transport_open(&transport, kind & HG_CONN_TCP ? &hg_transport_tcp : &hg_transport_unix, fd);
    const struct hg_transport below = transport;
    if (kind & HG_CONN_WEBSOCKET &&
        hg_ws_transport_load(&transport, &below, table->options, streams)) {
        hg_transport_close(&transport);
        return NULL;
    }
    struct hg_conn *conn = add_conn(table, &transport);
    if (conn && (hg_packet_load_input(&conn->in, streams) || hg_outq_load(&conn->out, streams))) {
        hg_conn_kill(conn, "what its predecessor left makes no sense");
        return NULL;
    }
    if (conn) // what was read ahead is taken when reading goes on
        hg_turn_pause(&conn->turn);
    return conn;
}

void hg_conn_accept(struct hg_conn_table *table, struct hg_listener *listener)
{
    struct hg_transport transport;
    struct hg_error err = {0};
    for (int i = 0; i < ACCEPTS_PER_EVENT; i++) {
        enum hg_status status = hg_listener_accept(listener, &transport, &err);
        if (!status) {
            take_client(table, listener, &transport);
            continue;
        }
        if (status == HG_E_LIMIT) { // retry when other connections may have closed
            hg_peer_warn(&table->log, table->loop->now_ns, NET, "%s", err.reason);
            table->accept_pause_ns = table->loop->now_ns + ACCEPT_PAUSE_NS;
        }
        return;
    }
}

// ---- all of them --------------------------------------------------------------------------------

void hg_conn_release(struct hg_conn_table *table)
{
    for (struct hg_conn *it = table->first; it; it = it->next)
        hg_conn_update(it);
}

void hg_conn_resume_paused(struct hg_conn_table *table)
{
    hg_turns_give(&table->turns, resume);
}

void hg_conn_bury(struct hg_conn_table *table)
{
    bool closing = table->closing;
    table->closing = false;
    for (struct hg_conn *it = closing ? table->first : NULL; it; it = it->next)
        if (it->state == HG_CONN_CLOSING)
            table->events->ended(it);
    while (table->dead) {
        struct hg_conn *conn = table->dead;
        table->dead = conn->next;
        table->events->ended(conn);
        destroy(conn);
    }
}
