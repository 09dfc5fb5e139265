// conn.h - inside of a libhelio connection. Floor 6 (client). One thread at a time.
#ifndef HG_CLIENT_LIB_CONN_H
#define HG_CLIENT_LIB_CONN_H

#include <netdb.h>
#include <sys/types.h>

#include "base/bytes.h"
#include "client/include/helio/helio.h"

enum {
    HG_CLIENT_CHUNK_BYTES = 64 * 1024,
    HG_CLIENT_SEND_HIGH_BYTES = 8 * 1024 * 1024,
    HG_CLIENT_QUEUE_MESSAGES = 256,
    HG_CLIENT_PRIVATE_CHANNEL = 1, // the session's channel on the link to a private worker
    HG_CLIENT_PRIVATE_IDS = 1 << 20,
};

#define HG_CLIENT_SECOND_NS   UINT64_C(1000000000)
#define HG_CLIENT_WORKER_STEP (600 * HG_CLIENT_SECOND_NS) // in one step of rendering: hung
#define HG_CLIENT_WORKER_LIFE (60 * HG_CLIENT_SECOND_NS)  // without a pulse it counts as hung

// A received message and what its body borrows.
struct hg_client_message {
    struct helio_message pub; // first member: the public pointer is this one
    union hgp_any body;
    struct hg_arena arena;
    uint8_t *payload;
    struct hg_client_message *next;
};

// Incoming bytes: a chunk read ahead, the header and payload being assembled.
struct hg_client_input {
    uint8_t chunk[HG_CLIENT_CHUNK_BYTES];
    size_t chunk_at, chunk_end;
    uint8_t header_bytes[HGP_HEADER_BYTES];
    size_t header_have;
    struct hgp_header header; // valid when header_have is complete
    uint8_t *payload;
    size_t payload_have, payload_capacity;
};

struct helio {
    enum helio_state state;
    bool embedded; // the peer is a private worker
    bool auth_sent;
    bool draining;
    int fd, wake_fd; // wake_fd: eventfd of helio_interrupt
    pid_t worker_pid;
    struct addrinfo *addresses, *address; // tcp: all, and the one being tried
    struct hg_error error;                // why it is closed; status HG_OK while it is not

    char url[256], *token, client[128], server[129], *device;
    enum hgp_role role;
    uint16_t version;
    uint64_t session;
    uint32_t send_limit, receive_limit, next_request;
    uint64_t timeout_ns, open_timeout_ns, heard_ns;

    struct hg_writer out; // out.data[out_sent..out.size) waits to be sent
    size_t out_sent;
    struct hg_client_input in;
    struct hg_client_message *first, *last; // received, not taken
    size_t queued, queued_bytes;
    struct helio_handlers handlers;
};

// Ends the connection for a reason (the first one is kept) and reports it.
enum hg_status hg_client_fail(struct helio *h, enum hg_status status, const char *where,
    const char *fmt, ...) HG_PRINTF(4, 5);
// The kept reason.
enum hg_status hg_client_failed(const struct helio *h, struct hg_error *err);

// transport.c: sets fd (non-blocking) from the url, or starts a worker. On success the state is
// CONNECTING or GREETING.
enum hg_status hg_client_dial(struct helio *h, const char *url, struct hg_error *err) HG_MUST_CHECK;
// A connect under way: HG_OK when made, HG_E_AGAIN, or the connection fails.
enum hg_status hg_client_dial_continue(struct helio *h) HG_MUST_CHECK;
enum hg_status hg_client_spawn(
    struct helio *h, const struct helio_options *options, struct hg_error *err) HG_MUST_CHECK;
// Text of how the worker ended ("killed by signal 9"), reaping it; waits up to `wait_ns`.
// Returns false when it still runs.
bool hg_client_reap(struct helio *h, uint64_t wait_ns, char *text, size_t size);

// receive.c: reads what is there. HG_OK, or the connection has failed.
enum hg_status hg_client_receive(struct helio *h) HG_MUST_CHECK;
// session.c: acts on one complete message; owns it from here on.
enum hg_status hg_client_dispatch(struct helio *h, struct hg_client_message *message) HG_MUST_CHECK;
// session.c: the first bytes of a connection that has just been made.
enum hg_status hg_client_greet(struct helio *h) HG_MUST_CHECK;
// conn.c: encodes into the output. HG_E_INVAL, HG_E_LIMIT, HG_E_NOMEM.
enum hg_status hg_client_queue(struct helio *h, enum hgp_type type, uint32_t request,
    const void *message, struct hg_error *err) HG_MUST_CHECK;
void hg_client_message_destroy(struct hg_client_message *message);

#endif
