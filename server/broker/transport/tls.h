// tls.h - TLS (1.2 and later) over a socket, by OpenSSL; the daemon's side.
// Floor 6 (broker). Thread: the loop. OpenSSL reads from the transport below when it is asked for
// bytes, and what the socket does not take of its records waits here, so that nothing blocks and
// what was once said to be written never has to be said again.
#ifndef HG_BROKER_TLS_H
#define HG_BROKER_TLS_H

#include "base/sha256.h"
#include "server/broker/options.h"
#include "server/broker/transport/transport.h"

struct ssl_ctx_st;

// Certificate, key and rules. Connections keep those that they began with.
struct hg_tls {
    struct ssl_ctx_st *context;       // NULL: there is no certificate
    uint8_t clients[HG_SHA256_BYTES]; // hash of who may show a certificate, and must
    int64_t begins_s, ends_s; // Unix time in which the whole chain is valid; 0 = there is none
};

extern const struct hg_transport_class hg_transport_tls;

// Reads what tls-cert, tls-key, tls-client-ca and tls-client-auth say. Without tls-cert *out is
// empty. HG_E_INVAL: err names the file, and what is wrong with it.
enum hg_status hg_tls_open(
    const struct hg_options *options, struct hg_tls *out, struct hg_error *err) HG_MUST_CHECK;
// Puts a new one in place, with the keys of the tickets that clients have, unless other clients are
// let in than before: what a ticket says of its client was checked then. Finishes `from`.
void hg_tls_replace(struct hg_tls *into, struct hg_tls *from);
// Logs that clients will refuse the certificate, or will within a week.
void hg_tls_warn(const struct hg_tls *tls, const char *file);
void hg_tls_finish(struct hg_tls *tls); // accepts an empty one

// `t`, a transport of sockets, becomes one over it. HG_E_NOMEM: nothing has changed.
enum hg_status hg_tls_begin(struct hg_transport *t, const struct hg_tls *tls) HG_MUST_CHECK;

#endif
