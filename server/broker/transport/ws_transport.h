// ws_transport.h - HGP within the binary messages of a WebSocket (RFC 6455), the daemon's side.
// Floor 6 (broker). Thread: the loop. Bytes are unmasked where they were read to and sent from
// where they are: a WebSocket has no buffers but for control frames.
#ifndef HG_BROKER_WS_TRANSPORT_H
#define HG_BROKER_WS_TRANSPORT_H

#include "base/bytes.h"
#include "server/broker/options.h"
#include "server/broker/transport/transport.h"

enum { HG_WS_MESSAGE_BYTES = 1 << 16 }; // most that a message to the client holds

extern const struct hg_transport_class hg_transport_websocket;

// `t` becomes one over `below`, of which `early` is read. HG_E_NOMEM: nothing has changed.
enum hg_status hg_ws_transport_begin(struct hg_transport *t, const struct hg_transport *below,
    const struct hg_options *options, const uint8_t *early, size_t size) HG_MUST_CHECK;
// Where both directions stand, for the program that goes on with the descriptor; and going on.
// HG_E_FORMAT, HG_E_NOMEM: nothing has changed.
void hg_ws_transport_save(const struct hg_transport *t, struct hg_writer *w);
enum hg_status hg_ws_transport_load(struct hg_transport *t, const struct hg_transport *below,
    const struct hg_options *options, struct hg_reader *r) HG_MUST_CHECK;
bool hg_ws_transport_has_ended(const struct hg_transport *t); // one side has said so
// The transport below.
const struct hg_transport *hg_ws_transport_below(const struct hg_transport *t);

#endif
