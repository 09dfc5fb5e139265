// transport.h - a byte stream to a peer, used by connections and worker links.
// Floor 6 (broker). Thread: the loop. Nothing here blocks, and nothing above it touches a
// descriptor.
//
// Sockets (unix, tcp) pass bytes on as they are. A transport that changes them (TLS, WebSocket)
// brings the same operations and keeps what it needs in `state`, with the transport below it;
// framing and queues above stay as they are. One may become another while it reads: what is found
// in the first bytes (detect.h) decides what the rest is.
#ifndef HG_BROKER_TRANSPORT_H
#define HG_BROKER_TRANSPORT_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <sys/uio.h>

#include "base/status.h"

struct hg_transport;

// Who is at the other end, as the transport knows it.
struct hg_peer {
    char name[64];     // address without port, or uid: for logs
    char source[64];   // what one host or user has: the address, the /64 of IPv6, the uid
    char network[64];  // of its neighbours: the /24 of IPv4, the /48 of IPv6; "" on this machine
    char subject[129]; // of its certificate, verified; "" = it has shown none
    bool unproven;     // its certificate was refused, or it has none and needs one
    bool is_encrypted; // TLS of this process
    bool is_local;     // on this machine: it cannot vanish without a trace
    bool same_user;    // it runs as the user of this process
};

struct hg_transport_class {
    // At most `size` bytes. HG_OK with *got > 0, HG_E_AGAIN (nothing there), HG_E_CLOSED (end of
    // the stream), HG_E_IO; HG_E_STATE (the transport has said its last words: what waits in it is
    // flushed, then it is closed), HG_E_FORMAT (the same, since the peer broke a rule: `fault`).
    enum hg_status (*read)(struct hg_transport *t, void *dst, size_t size, size_t *got);
    // As much of the parts as is taken now. HG_OK with *sent > 0, HG_E_AGAIN, HG_E_CLOSED, HG_E_IO.
    enum hg_status (*write)(
        struct hg_transport *t, const struct iovec *parts, int count, size_t *sent);
    // The events of `fd` to wait for (EPOLLIN | EPOLLOUT) before the owner can read or write.
    uint32_t (*wants)(const struct hg_transport *t, bool read, bool write);
    void (*end_writing)(struct hg_transport *t); // the peer sees the end of the stream
    // Called once after accept: sets socket options, and identifies the peer.
    // NULL in those that come later.
    void (*greet)(struct hg_transport *t, uint64_t peer_timeout_ns, struct hg_peer *peer);
    void (*close)(struct hg_transport *t); // closes fd, frees `state`
    // The following may be NULL: nothing waits in it, and it has nothing to say.
    // Sends what waits in the transport itself. HG_OK (all of it), HG_E_AGAIN, HG_E_CLOSED,
    // HG_E_IO.
    enum hg_status (*flush)(struct hg_transport *t);
    // There is something to read that no event will announce.
    bool (*has_input)(const struct hg_transport *t);
    // Tells the peer in the transport's own way that its time is over (reason NULL), or that it is
    // not taken in. False: it has no way to.
    bool (*refuse)(struct hg_transport *t, const char *reason);
};

struct hg_transport {
    const struct hg_transport_class *class; // NULL: closed
    int fd;
    void *state;          // of the class
    struct hg_peer *peer; // who it is, once that is known
    const char *fault;    // with HG_E_FORMAT: which rule was broken
    // Changes when a request or an answer of the transport itself begins: time limits restart.
    // Odd while an answer is sent.
    uint32_t stage, known_stage; // known_stage: of the owner
    bool farewell;               // of the owner: it has ended the writing
    bool renamed;                // *peer has become another: its counters restart
    bool served;                 // it has answered something itself: its end is nothing to warn of
};

extern const struct hg_transport_class hg_transport_unix, hg_transport_tcp;

struct sockaddr_storage;
// Names a peer by its address.
void hg_peer_name(struct hg_peer *peer, const struct sockaddr_storage *address);

// Takes over a connected descriptor, which becomes non-blocking.
void hg_transport_open(struct hg_transport *t, const struct hg_transport_class *class, int fd);
void hg_transport_close(struct hg_transport *t); // accepts a closed one
// The operations that a class may lack.
enum hg_status hg_transport_flush(struct hg_transport *t) HG_MUST_CHECK;
bool hg_transport_has_input(const struct hg_transport *t);
bool hg_transport_refuse(struct hg_transport *t, const char *reason);
// Reads what comes and forgets it. HG_E_CLOSED, HG_E_IO; else `otherwise`.
enum hg_status hg_transport_discard(struct hg_transport *t, enum hg_status otherwise) HG_MUST_CHECK;
// Becomes another transport of the same descriptor; what the owner knows stays.
void hg_transport_become(
    struct hg_transport *t, const struct hg_transport_class *class, void *state);

#endif
