// websocket.h - HGP within the messages of a WebSocket, the client's side.
// Floor 6 (client). One thread at a time. Nothing blocks.
#ifndef HG_CLIENT_LIB_WEBSOCKET_H
#define HG_CLIENT_LIB_WEBSOCKET_H

#include "client/lib/transport.h"

// `t`, a stream that is connected, becomes one over it whose `handshake` asks for a WebSocket at
// `path` of `host` (with its port). HG_E_NOMEM, HG_E_IO (no random numbers): it stays as it was.
enum hg_status hg_client_websocket_begin(struct hg_client_transport *t, const char *host,
    const char *path, const char *url, struct hg_error *err) HG_MUST_CHECK;

#endif
