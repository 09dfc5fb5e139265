// dial.h - urls to connected transports: sockets, TLS, WebSocket.
// Floor 6 (client). One thread at a time. Nothing blocks.
#ifndef HG_CLIENT_LIB_DIAL_H
#define HG_CLIENT_LIB_DIAL_H

#include "client/lib/transport.h"

// {.fd = -1} = closed. Begins to connect to `url` (unix:PATH, tcp:HOST:PORT, tls:HOST:PORT,
// ws://HOST[:PORT][/PATH][?QUERY], wss://...). HG_OK: it may still be connecting. HG_E_INVAL,
// HG_E_CLOSED, HG_E_PERM, HG_E_NOMEM; then it stays closed.
enum hg_status hg_client_dial(
    struct hg_client_transport *t, const char *url, struct hg_error *err) HG_MUST_CHECK;
// HG_OK when connected, HG_E_AGAIN while it takes longer, or why no address could be reached.
// `scene` ("" = none, at most HG_CLIENT_SCENE_BYTES): what a WebSocket's request says in ?scene=,
// unless the url does.
enum hg_status hg_client_dial_continue(struct hg_client_transport *t, const char *url,
    const struct hg_client_tls_options *tls, const char *scene, struct hg_error *err) HG_MUST_CHECK;

#endif
