// reply.h - messages to the other end of the link: answers, errors, progress, notices, frames.
// Floor 6, private to server/worker. Any thread.
#ifndef HG_SERVER_WORKER_REPLY_H
#define HG_SERVER_WORKER_REPLY_H

#include "server/worker/worker.h"

// Where an answer goes. Request 0: no request is answered (frames of a subscription).
struct reply_to {
    struct worker *w;
    uint32_t channel, request;
};

// Encodes a message and passes it to the I/O thread; waits while the outbox is full.
void hg_reply_send(struct reply_to to, enum hgp_type type, const void *message);
// The same, but dropped when the outbox is full.
void hg_reply_send_lossy(struct reply_to to, enum hgp_type type, const void *message);
// Only where the message was a request.
void hg_reply_ok(struct reply_to to, uint64_t revision);
// Which limit it was goes ahead of the error.
// HG_E_DEVICE_LOST is not answered but ends the process: the broker asks the next one again, or
// says that the worker died.
void hg_reply_error(struct reply_to to, const struct hg_error *err);
void hg_reply_progress(struct reply_to to, const char *stage, uint64_t done, uint64_t total);
void hg_reply_notice(struct reply_to to, const struct hgp_notice *notice);
// A frame with its data. `parts`: all but the end may go ahead in messages of their own.
void hg_reply_frame(
    struct reply_to to, struct hgp_frame *frame, bool parts, const uint8_t *data, size_t size);

#endif
