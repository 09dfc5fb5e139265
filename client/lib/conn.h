// conn.h - inside of a libhelio connection. Floor 6 (client). One thread at a time.
//
// Layers, lowest first:
//   transport private_worker camera    sockets; a worker process; conventions of cameras
//   tls websocket lookup               streams over sockets; addresses of hosts
//   dial                               urls to streams
//   conn                               state, why it ended, what waits to be sent
//   session                            hello, authentication, what the library answers itself
//   receive                            bytes to messages
//   helio                              the public calls that do not wait
//   call upload                        the public calls that wait
#ifndef HG_CLIENT_LIB_CONN_H
#define HG_CLIENT_LIB_CONN_H

#include "base/bytes.h"
#include "client/include/helio/helio.h"
#include "client/lib/private_worker.h"
#include "client/lib/transport.h"
#include "protocol/framing.h"

enum {
    HG_CLIENT_SEND_HIGH_BYTES = 8 * 1024 * 1024,
    HG_CLIENT_QUEUE_MESSAGES = 256,
    HG_CLIENT_GIVEN_UP = 64, // requests; more of them at a time, and the oldest is forgotten
    HG_CLIENT_PRIVATE_IDS = 1 << 20,
};

#define HG_CLIENT_OWN_REQUEST UINT32_MAX // of the library itself, never given to a caller

#define HG_CLIENT_SECOND_NS   UINT64_C(1000000000)
#define HG_CLIENT_WORKER_STEP (600 * HG_CLIENT_SECOND_NS) // in one step of rendering: hung
#define HG_CLIENT_WORKER_LIFE (60 * HG_CLIENT_SECOND_NS)  // without a pulse it counts as hung

// A received message and what its body borrows.
struct hg_client_message {
    struct helio_message pub; // first member: the public pointer is this one
    union hgp_any body;
    struct hg_arena arena;
    struct hgp_header header;
    uint8_t *payload;
    uint64_t begun_ns; // when its header came
    struct hg_client_message *next;
};

// Received, not taken.
struct hg_client_queue {
    struct hg_client_message *first, *last;
    size_t count, bytes;
    uint32_t given_up[HG_CLIENT_GIVEN_UP]; // requests whose answers are dropped when they come
    uint32_t given_up_next;
};

// What the server said last about a limit.
struct hg_client_limited {
    bool is_set;
    uint32_t request, retry_after_ms;
    char limit[33];
};

// What the other end said of itself.
struct hg_client_server {
    char name[129];
    char *device; // JSON; empty when it did not say
    enum hgp_role role;
    uint16_t version;
    uint64_t session;
    uint32_t send_limit; // payload bytes that it takes
    char scene[129];     // of a join ticket; "" = none
    uint32_t channel;    // of a private worker's link: one for each scene that is opened, from 1
    bool has_scene;      // a private worker's scene is open
    struct hg_client_limited limited;
};

// Going on with the session on another connection.
struct hg_client_resume {
    struct hg_client_tls_options tls; // for every connection
    char scene[HG_CLIENT_SCENE_BYTES + 1]; // for load balancers; "" = none
    uint64_t patience_ns;  // 0 = it is not wanted
    uint64_t deadline_ns;  // until then it is tried; 0 = the connection is not lost
    uint64_t retry_ns;     // the next try
    uint8_t secret[64];    // the ticket
    uint32_t secret_bytes; // 0 = there is none
    uint32_t losses, done; // connections that were lost; sessions that went on
};

struct helio {
    enum helio_state state;
    bool embedded; // the peer is a private worker
    bool auth_sent;
    bool draining;
    struct hg_client_transport transport;
    int wake_fd; // eventfd of helio_interrupt
    pid_t worker_pid;
    struct hg_error error; // why it is closed; status HG_OK while it is not

    char url[HG_CLIENT_URL_BYTES], *token, client[128];
    struct hg_client_server server;
    uint32_t receive_limit, next_request;
    uint64_t timeout_ns, open_timeout_ns, heard_ns;
    uint64_t rtt_ns; // of the newest helio_ping; 0 = none yet

    struct hg_writer out; // out.data[out_sent..out.size) waits to be sent
    size_t out_sent;
    struct hgp_framer in;
    struct hg_client_queue queue;
    struct helio_handlers handlers;
    struct hg_client_resume resume;
    struct helio_tap tap;
};

// Ends the connection for a reason (the first one is kept) and reports it.
enum hg_status hg_client_fail(struct helio *h, enum hg_status status, const char *where,
    const char *fmt, ...) HG_PRINTF(4, 5);
// The stream ended or broke. HG_E_AGAIN: the session goes on on another connection, which
// hg_client_redial makes; else the connection is ended: whose fault that was depends on who is at
// the other end.
enum hg_status hg_client_fail_lost(struct helio *h, const char *fmt, ...) HG_PRINTF(2, 3);
// Tries to connect again, if it is time. HG_OK: connected, or being connected; HG_E_AGAIN: later;
// or the connection has ended, since it took too long.
enum hg_status hg_client_redial(struct helio *h) HG_MUST_CHECK;
// The kept reason.
enum hg_status hg_client_failed(const struct helio *h, struct hg_error *err);
// Encodes into the output. HG_E_INVAL, HG_E_LIMIT, HG_E_NOMEM.
enum hg_status hg_client_enqueue(struct helio *h, enum hgp_type type, uint32_t request,
    const void *message, struct hg_error *err) HG_MUST_CHECK;

extern const struct hgp_frame_class hg_client_frames; // struct hg_client_message
void hg_client_message_destroy(struct hg_client_message *message);
void hg_client_queue_push(struct hg_client_queue *q, struct hg_client_message *message);
// Takes a message out of the queue; `before` is the one in front of it, NULL = it is the first.
void hg_client_queue_take(
    struct hg_client_queue *q, struct hg_client_message *before, struct hg_client_message *message);
// The answer of a request is not waited for any longer: drops what came for it, and what will.
void hg_client_queue_give_up(struct hg_client_queue *q, uint32_t request);
// True for a message of a request that was given up.
bool hg_client_queue_drops(struct hg_client_queue *q, const struct hg_client_message *message);

#endif
