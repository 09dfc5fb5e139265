// tls.h - TLS over a connected socket, the client's side.
// Floor 6 (client). One thread at a time. Nothing blocks.
#ifndef HG_CLIENT_LIB_TLS_H
#define HG_CLIENT_LIB_TLS_H

#include "client/lib/transport.h"

// `t`, a connected socket, becomes one over it that is still `connecting`: its class's `handshake`
// goes on. `host` is the name that the certificate must have. HG_E_INVAL (files of `tls`),
// HG_E_NOMEM: the socket stays as it was.
enum hg_status hg_client_tls_begin(struct hg_client_transport *t,
    const struct hg_client_tls_options *tls, const char *host, const char *url,
    struct hg_error *err) HG_MUST_CHECK;

#endif
