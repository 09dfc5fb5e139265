// transport.h - the stream of bytes to a daemon or worker: urls to connected sockets, read and
// write. Floor 6 (client). One thread at a time. Nothing blocks, except the look-up of a host's
// name.
//
// A transport that changes bytes on their way (TLS, WebSocket) brings another class; framing and
// the conversation above stay as they are.
#ifndef HG_CLIENT_LIB_TRANSPORT_H
#define HG_CLIENT_LIB_TRANSPORT_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "base/status.h"

struct addrinfo;
struct hg_client_transport;

struct hg_client_transport_class {
    // At most `size` bytes. HG_OK with *got > 0, HG_E_AGAIN, HG_E_CLOSED (end of the stream),
    // HG_E_IO (error_number says why).
    enum hg_status (*read)(struct hg_client_transport *t, void *dst, size_t size, size_t *got);
    // HG_OK with *sent > 0, HG_E_AGAIN, HG_E_CLOSED (the peer takes nothing more), HG_E_IO.
    enum hg_status (*write)(
        struct hg_client_transport *t, const void *data, size_t size, size_t *sent);
    // The events of `fd` to poll for (POLLIN | POLLOUT) before the owner can read or write.
    short (*wants)(const struct hg_client_transport *t, bool read, bool write);
    void (*close)(struct hg_client_transport *t);
};

struct hg_client_transport {
    const struct hg_client_transport_class *class; // NULL: closed
    int fd;                                        // -1 while closed
    int error_number;                              // of the newest HG_E_IO
    bool connecting;                               // hg_client_transport_continue goes on
    struct addrinfo *addresses, *address;          // tcp: all, and the one being tried
};

// {.fd = -1} = closed. Begins to connect to `url` (unix:PATH, tcp:HOST:PORT). HG_OK: it may still
// be connecting. HG_E_INVAL, HG_E_CLOSED, HG_E_PERM, HG_E_NOMEM; then it stays closed.
enum hg_status hg_client_transport_dial(
    struct hg_client_transport *t, const char *url, struct hg_error *err) HG_MUST_CHECK;
// HG_OK when connected, HG_E_AGAIN while it takes longer, or why no address could be reached.
enum hg_status hg_client_transport_continue(
    struct hg_client_transport *t, const char *url, struct hg_error *err) HG_MUST_CHECK;
// Takes over a connected socket. HG_E_INVAL: it is none, and is closed.
enum hg_status hg_client_transport_adopt(struct hg_client_transport *t, int fd) HG_MUST_CHECK;
void hg_client_transport_close(struct hg_client_transport *t); // accepts a closed one

#endif
