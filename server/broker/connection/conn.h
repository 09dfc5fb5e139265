// conn.h - a client's connection: framing, send queue, time limits, close.
// Floor 6 (broker). Thread: the loop. What packets mean is for the layer above (hg_conn_events).
#ifndef HG_BROKER_CONN_H
#define HG_BROKER_CONN_H

#include "server/broker/connection/conn_turn.h"
#include "server/broker/connection/listener.h"
#include "server/broker/loop.h"
#include "server/broker/options.h"
#include "server/broker/connection/packet.h"
#include "server/broker/connection/peer_log.h"
#include "server/broker/transport/proxied.h"
#include "server/broker/connection/slots.h"

struct hg_session;

enum hg_conn_state {
    HG_CONN_PREFACE, // waiting for the 8 bytes
    HG_CONN_HELLO,
    HG_CONN_AUTH,
    HG_CONN_OPEN,
    HG_CONN_CLOSING, // flushing: only queued packets are still sent
    HG_CONN_DEAD,    // transport closed; freed at the end of the round
};

// Who the client says it is. Of the layer above.
struct hg_conn_auth {
    uint8_t hash[32]; // of its token
    char name[33];    // of the token's line, as far as it fits; "" = not known. For logs
    bool has_token;
    bool resumes;            // it says which session it goes on with (auth_resume)
    uint8_t secret_hash[32]; // of what it says
    uint32_t request;
    uint64_t due_ns; // when the token is judged (hg_conn_events.due); 0 = nothing waits
};

// How fast messages are taken.
struct hg_conn_rate {
    double per_second; // 0 = as many as `allowance` says in all (not yet open)
    double allowance;  // that may be accepted now
    uint64_t since_ns; // when that was counted
};

// Of memory that connections share (conn_share.h), and of a message that is arriving.
struct hg_conn_budget {
    uint64_t output_share;           // of output-total while that is short; 0 = it is not
    uint64_t input;                  // of all with its token, while input-total is used up
    uint64_t fill_ns, filled_before; // when a part of it was there first; received until then.
                                     // fill_ns 0 = none has been, or it is not read
};

struct hg_conn {
    struct hg_conn *prev, *next;
    struct hg_conn_table *table;
    struct hg_source source;
    struct hg_transport transport;
    struct hgp_framer in;
    struct hg_outq out;
    enum hg_conn_state state;
    struct hg_turn turn;
    bool peer_ended;
    bool starved; // something waits for room in its output
    bool warned;  // that its answers wait for the disk
    struct hg_peer peer;
    struct hg_slot slot;
    struct hg_conn_auth auth;
    char client[129]; // from hello
    uint16_t version;
    uint64_t number;                          // of the session
    uint64_t deadline_ns;                     // handshake, or the end of CLOSING
    uint64_t opened_ns, received_ns, ping_ns; // ping_ns: newest ping sent, 0 = none pending
    struct hg_conn_budget budget;
    struct hg_conn_rate rate;
    struct hg_session *session; // of the layer above
};

// What the layer above does.
struct hg_conn_events {
    // Its peer has become known: may it stay (conn_admission.h)?
    void (*admit)(struct hg_conn *conn);
    // Bytes came of one that may not, to which the refusal (slot.why) has not been sent yet.
    void (*refused)(struct hg_conn *conn, enum hg_status status);
    // It has not proved who it is: its certificate is refused, or missing.
    void (*unproven)(struct hg_conn *conn, const char *reason);
    // Does not take ownership of the packet.
    void (*message)(struct hg_conn *conn, struct hg_packet *packet);
    // Too many requests of the client are in flight: it is not read (back-pressure).
    bool (*must_wait)(const struct hg_conn *conn);
    // auth.due_ns has come.
    void (*due)(struct hg_conn *conn);
    // The output has fallen below its limit again, or has become less while something waited for
    // room in it (`starved`, which is false again).
    void (*drained)(struct hg_conn *conn);
    // It is CLOSING or DEAD; at the end of the round in which that happened.
    void (*ended)(struct hg_conn *conn);
};

// All connections. Zero-initialised but for the first seven members.
struct hg_conn_table {
    struct hg_loop *loop;
    const struct hg_options *options;
    const struct hg_conn_events *events;
    void *owner;                           // for `events`
    const struct hg_web *web;              // what those get that speak HTTP
    const struct hg_tls *tls;              // of the tls listeners
    const struct hg_outq_reached *reached; // by the state log; NULL without one
    struct hg_conn *first, *dead;
    struct hgp_chunk_pool chunks; // to read into
    uint32_t rested;          // connections that gave their buffers back since the heap was trimmed
    uint64_t trimmed_ns;      // when that was
    uint64_t accept_pause_ns; // nothing is accepted until then; 0 = no pause
    bool was_short;           // of memory for output, at the last check
    bool quiet;               // nothing is read from open sessions
    bool closing;             // one began to close: `ended` comes at the end of the round
    struct hg_turns turns;
    struct hg_slots slots;
    struct hg_peer_log log;
};

// Takes in the clients that wait at a listener.
void hg_conn_accept(struct hg_conn_table *table, struct hg_listener *listener);
// It has had answers of HTTP and waits for another request: its client comes again when it ends.
bool hg_conn_is_between(const struct hg_conn *conn);
// How bytes reach the client, for the next program.
enum { HG_CONN_TCP = 1, HG_CONN_WEBSOCKET = 2 };

// A connection with an open session that this process has had before; `streams`: what has come and
// was not taken, and what waits to be sent. NULL: no memory, or nonsense; the descriptor is closed.
struct hg_conn *hg_conn_adopt(
    struct hg_conn_table *table, int fd, unsigned kind, struct hg_reader *streams) HG_MUST_CHECK;
// The kind of its transport (enum hg_conn_kind); false: it holds what another process cannot have.
bool hg_conn_kind(const struct hg_conn *conn, unsigned *kind) HG_MUST_CHECK;
// All of both directions, for hg_conn_adopt.
void hg_conn_save(const struct hg_conn *conn, struct hg_writer *streams);
// Which limit an error or a notice is of, right before it; "": of none, nothing is sent.
void hg_conn_tell_limit(
    struct hg_conn *conn, uint32_t request, const char *limit, uint32_t retry_after_ms);
// The session is open: messages are limited by `rate` a second from here on.
void hg_conn_set_open(struct hg_conn *conn, double rate);
void hg_conn_send(struct hg_conn *conn, uint32_t request, enum hgp_type type, const void *message);
// Before all that waits: an answer that must not wait behind data.
void hg_conn_send_urgent(
    struct hg_conn *conn, uint32_t request, enum hgp_type type, const void *message);
// Takes over the reference.
void hg_conn_send_packet(struct hg_conn *conn, uint32_t request, struct hg_packet *packet);
// Answers `error`, or `notice` when no answer was wanted.
void hg_conn_fail(struct hg_conn *conn, uint32_t request, const struct hg_error *err);
// Error with request 0 (NULL: none), then bye, and the end once all is sent.
void hg_conn_close(struct hg_conn *conn, const struct hg_error *err, const char *reason);
void hg_conn_kill(struct hg_conn *conn, const char *reason); // at once
// Nothing of HGP is sent any more; what waits in the transport is, and then it is closed.
void hg_conn_close_transport(struct hg_conn *conn);
void hg_conn_update(struct hg_conn *conn); // which events are wanted
// Bytes that may wait for the client: output-limit, or less while the daemon's memory is short.
uint64_t hg_conn_output_limit(const struct hg_conn *conn);
bool hg_conn_is_slow(const struct hg_conn *conn); // more wait

// The state log has gone on: what was held may be sent.
void hg_conn_release(struct hg_conn_table *table);
// Gives those that wait their turn (conn_turn.h): reads again from those against which nothing
// stands any more.
void hg_conn_resume_paused(struct hg_conn_table *table);
// At the end of a round: `ended` for those that close or closed; frees the dead.
void hg_conn_bury(struct hg_conn_table *table);

#endif
