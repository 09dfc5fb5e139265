// encode_queue.h - encoder threads, and the stream of frames that each view gives them.
// Floor 6, private to server/worker.
//
// Frames of one stream are encoded and sent in order, those of different streams side by side: a
// stream whose encoder is slow fills up, and its view's schedule leaves it alone, while others go
// on. Nothing here makes the render thread wait.
#ifndef HG_SERVER_WORKER_ENCODE_ENCODE_QUEUE_H
#define HG_SERVER_WORKER_ENCODE_ENCODE_QUEUE_H

#include "server/worker/encode/encoder.h"
#include "server/worker/view/view_control.h"

struct encode_queue;
struct encode_stream;

// Starts threads that answer through the worker's outbox, 0 = one per core, at least two, and one
// for small frames. HG_E_NOMEM, HG_E_LIMIT.
enum hg_status hg_encode_queue_create(struct worker *w, uint32_t threads, encoder_find_fn *find,
    struct encode_queue **out) HG_MUST_CHECK;
// After all streams were closed. What is being encoded is waited for, the rest is dropped.
void hg_encode_queue_destroy(struct encode_queue *queue); // accepts NULL

// The encoder of an encoding; NULL: not in this build.
const struct encoder_ops *hg_encode_queue_encoder(
    const struct encode_queue *queue, enum hgp_encoding encoding);

// Streams: opened, filled and closed by the render thread. NULL: no memory.
struct encode_stream *hg_encode_stream_open(struct encode_queue *queue);
// What is in the stream is still sent; then the states of its encoders are closed. Accepts NULL.
void hg_encode_stream_close(struct encode_stream *stream);
// Is there room for one more frame? After no, hg_worker_wake is called as soon as there is.
bool hg_encode_stream_has_room(const struct encode_stream *stream);
// What became of the subscribed frames of the stream, oldest first. False: no more is known.
bool hg_encode_stream_next_sent(struct encode_stream *stream, struct hg_control_sent *out);
// Queues the request; there must be room.
void hg_encode_stream_push(struct encode_stream *stream, struct encode_request *request);

// Encodings (1 << enum hgp_encoding) that have failed for this stream: JPEG was sent instead.
uint32_t hg_encode_stream_failed(const struct encode_stream *stream);

#endif
