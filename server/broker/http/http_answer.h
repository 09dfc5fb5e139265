// http_answer.h - what the daemon answers to a request of HTTP: the viewer's files, /healthz,
// /readyz, /metrics, the way to a WebSocket (/hgp), and nothing else.
// Floor 6 (broker). Thread: the loop. Makes bytes; http_transport sends them.
#ifndef HG_BROKER_HTTP_ANSWER_H
#define HG_BROKER_HTTP_ANSWER_H

#include "base/bytes.h"
#include "protocol/http.h"
#include "server/broker/options.h"
#include "server/broker/transport/transport.h"
#include "server/broker/http/web_files.h"

#define HG_WEB_SUBPROTOCOL "hgp.1"

// What HTTP serves.
struct hg_web {
    const struct hg_options *options;
    struct hg_web_files files;
    // Why the daemon would take no session now; NULL: it would.
    const char *(*unready)(void *user);
    // Writes the text of /metrics.
    void (*metrics)(void *user, struct hg_writer *w);
    void *user;
};

struct hg_http_answer {
    unsigned status;
    char head[2048];
    size_t head_size;
    const uint8_t *body; // not sent to HEAD; `owned`, or of a file
    size_t body_size;
    uint8_t *owned;
    bool close;   // the connection ends behind it
    bool upgrade; // it is a WebSocket behind it
};

// `parsed` is what hg_http_request_parse returned, not HG_E_AGAIN. `last`: no further request of
// the connection is taken.
void hg_http_answer(const struct hg_web *web, const struct hg_peer *peer,
    const struct hg_http_head *request, enum hg_status parsed, bool last,
    struct hg_http_answer *out);
// 408 (reason NULL) or 503 to a client that is not served; the connection ends behind it.
void hg_http_answer_refusal(const char *reason, struct hg_http_answer *out);
void hg_http_answer_finish(struct hg_http_answer *answer); // accepts a zeroed one

#endif
