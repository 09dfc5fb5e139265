// transport.h - the stream of bytes to a daemon or worker: read and write. Floor 6 (client). One
// thread at a time. Nothing blocks.
//
// A transport that changes bytes on their way (TLS, WebSocket) brings another class; framing and
// the conversation above stay as they are.
#ifndef HG_CLIENT_LIB_TRANSPORT_H
#define HG_CLIENT_LIB_TRANSPORT_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "base/status.h"

enum { HG_CLIENT_URL_BYTES = 256, HG_CLIENT_SCENE_BYTES = 128 }; // of a URL with its end

struct addrinfo;
struct hg_client_transport;

struct hg_client_transport_class {
    // At most `size` bytes. HG_OK with *got > 0, HG_E_AGAIN, HG_E_CLOSED (end of the stream),
    // HG_E_IO (error_number says why), HG_E_AUTH (the server takes no client with this certificate,
    // or none without one; `refusal` says it).
    enum hg_status (*read)(struct hg_client_transport *t, void *dst, size_t size, size_t *got);
    // HG_OK with *sent > 0, HG_E_AGAIN, HG_E_CLOSED (the peer takes nothing more), HG_E_IO.
    enum hg_status (*write)(
        struct hg_client_transport *t, const void *data, size_t size, size_t *sent);
    // The events of `fd` to poll for (POLLIN | POLLOUT) before the owner can read or write.
    short (*wants)(const struct hg_client_transport *t, bool read, bool write);
    void (*close)(struct hg_client_transport *t);
    // NULL in sockets. Goes on with the transport's own handshake: HG_OK when it is done,
    // HG_E_AGAIN, or why it fails.
    enum hg_status (*handshake)(
        struct hg_client_transport *t, const char *url, struct hg_error *err);
    // NULL in sockets. There is something to read that poll does not know of.
    bool (*has_input)(const struct hg_client_transport *t);
};

// With TLS: which certificates are trusted, and which one is shown. Strings may be NULL.
struct hg_client_tls_options {
    char *ca;         // file (PEM) of authorities; NULL = the system's
    char *pin;        // SHA-256 of the server's certificate, in digits: it alone is trusted
    char *cert, *key; // of the client (PEM); key NULL = in cert
    bool insecure;    // any certificate is taken
};

struct hg_client_transport {
    const struct hg_client_transport_class *class; // NULL: closed
    int fd;                                        // -1 while closed
    int error_number;                              // of the newest HG_E_IO
    const char *refusal;                           // of HG_E_AUTH
    void *state;                                   // of the class
    bool secure, websocket;                        // what the url asks for
    bool handshaking;                              // the newest layer's is not done
    bool connecting;                               // hg_client_dial_continue goes on
    struct addrinfo *addresses, *address;          // tcp: all, and the one being tried
};

extern const struct hg_client_transport_class hg_client_sockets;

// Takes over a connected socket. HG_E_INVAL: it is none, and is closed.
enum hg_status hg_client_transport_adopt(struct hg_client_transport *t, int fd) HG_MUST_CHECK;
void hg_client_transport_close(struct hg_client_transport *t); // accepts a closed one

#endif
