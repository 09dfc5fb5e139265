// listener.h - where clients come in: unix and tcp addresses, sockets from the service manager.
// Floor 6 (broker). Thread: the loop (names are looked up at start only).
#ifndef HG_BROKER_LISTENER_H
#define HG_BROKER_LISTENER_H

#include "server/broker/loop.h"
#include "server/broker/transport/transport.h"

struct hg_listener {
    struct hg_listener *next;
    struct hg_source source;
    const struct hg_transport_class *transport; // of the connections that come in here
    bool tls;
    uint16_t port;   // of a tcp listener, as bound; 0 for unix
    char *unix_path; // removed at the end; NULL for tcp and passed ones
    char name[160];  // for logs
};

// Checks the form of an address without touching the network. HG_E_INVAL.
enum hg_status hg_listener_check(
    const char *address, bool *is_tcp, bool *is_tls, struct hg_error *err) HG_MUST_CHECK;
// Opens `address` (unix:PATH, tcp:HOST:PORT, tls:HOST:PORT); a name may give several sockets (both
// families). They are put in front of *list. A unix socket file that no process serves is replaced;
// one that is served, or any other file, is HG_E_EXISTS. HG_E_INVAL, HG_E_NOTFOUND (host),
// HG_E_PERM, HG_E_EXISTS (port in use), HG_E_IO, HG_E_NOMEM. On failure *list is as before.
enum hg_status hg_listener_open(
    const char *address, struct hg_listener **list, struct hg_error *err) HG_MUST_CHECK;
// Takes over a listening socket.
enum hg_status hg_listener_adopt(
    int fd, struct hg_listener **list, struct hg_error *err) HG_MUST_CHECK;
// The same of one that a service manager passed; tls: it speaks TLS. HG_E_INVAL: not over unix.
enum hg_status hg_listener_adopt_passed(
    int fd, bool tls, struct hg_listener **list, struct hg_error *err) HG_MUST_CHECK;
void hg_listener_set_tls(struct hg_listener *listener); // a tcp one
// The listener removes the socket file `path` at its end. HG_E_NOMEM.
enum hg_status hg_listener_own(struct hg_listener *listener, const char *path) HG_MUST_CHECK;
// Accepts the next pending client as *out. HG_E_AGAIN: there is none, or it has disconnected;
// HG_E_LIMIT: out of descriptors or memory, and the client stays in the backlog.
enum hg_status hg_listener_accept(
    struct hg_listener *listener, struct hg_transport *out, struct hg_error *err) HG_MUST_CHECK;
// Closes all and removes socket files. The objects are freed: not inside a round of events.
void hg_listeners_destroy(struct hg_loop *loop, struct hg_listener **list);

#endif
