// lookup.h - the addresses of a host's name, asked for in a thread: a resolver may take many
// seconds to answer. Floor 6 (client). One thread at a time, beside the own one.
#ifndef HG_CLIENT_LIB_LOOKUP_H
#define HG_CLIENT_LIB_LOOKUP_H

#include "client/lib/transport.h"

// Begins to look up `host` and `port` for streams, and makes `t`, a closed transport, wait for it:
// t->fd hangs up (POLLHUP) when it is done. Closing `t` meanwhile waits for nothing.
// HG_E_NOMEM; HG_E_LIMIT: no descriptors or threads. Then `t` stays closed.
enum hg_status hg_client_lookup_begin(
    struct hg_client_transport *t, const char *host, const char *port) HG_MUST_CHECK;
bool hg_client_lookup_goes_on(const struct hg_client_transport *t);
// HG_E_AGAIN: it is not done. HG_OK: `t` is closed but for t->addresses and t->address, or *failed
// is a code of getaddrinfo.
enum hg_status hg_client_lookup_take(struct hg_client_transport *t, int *failed) HG_MUST_CHECK;
// The look-up itself, which may block. A code of getaddrinfo; 0: *out is freed with freeaddrinfo.
int hg_client_lookup_now(const char *host, const char *port, int flags, struct addrinfo **out);

#endif
