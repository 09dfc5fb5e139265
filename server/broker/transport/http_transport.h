// http_transport.h - a stream on which HTTP/1.1 is spoken, until a request makes it a WebSocket.
// Floor 6 (broker). Thread: the loop. Reading answers requests; bytes of HGP come out only behind
// the upgrade. One request at a time: the next one is read when the answer is sent.
#ifndef HG_BROKER_HTTP_TRANSPORT_H
#define HG_BROKER_HTTP_TRANSPORT_H

#include "server/broker/http/http_answer.h"

enum { HG_HTTP_REQUESTS = 1000 }; // most of one connection

extern const struct hg_transport_class hg_transport_http;

// `t` becomes one over `below`, of which `size` bytes (at most 16) are read. HG_E_NOMEM: nothing
// has changed.
enum hg_status hg_http_transport_begin(struct hg_transport *t, const struct hg_transport *below,
    const struct hg_web *web, const uint8_t *first, size_t size) HG_MUST_CHECK;

#endif
