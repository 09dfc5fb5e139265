// packet.h - whole messages in memory, and what moves them over transports.
// Floor 6 (broker). Thread: the loop. A payload is received once into its packet and sent from it;
// relaying changes only the header, which belongs to the queue entry.
#ifndef HG_BROKER_PACKET_H
#define HG_BROKER_PACKET_H

#include "protocol/framing.h"
#include "server/broker/transport/transport.h"

struct hg_packet {
    uint32_t refs;
    struct hgp_header header; // as received or encoded
    uint8_t payload[];        // header.length bytes
};

// Memory is reserved, not touched: a header that announces much costs only what then arrives.
struct hg_packet *hg_packet_create(const struct hgp_header *header) HG_MUST_CHECK;
// Encodes a message (request and channel 0). NULL when memory is short or the message is too long.
struct hg_packet *hg_packet_encode(enum hgp_type type, const void *message) HG_MUST_CHECK;
struct hg_packet *hg_packet_ref(struct hg_packet *packet);
void hg_packet_unref(struct hg_packet *packet); // accepts NULL

// ---- output -------------------------------------------------------------------------------------

struct hg_outq_item;

// How far the state log has come.
struct hg_outq_reached {
    uint64_t durable; // everything up to this position is
    uint64_t kept;    // the same for what is kept of sessions; while the log is broken, everything
    enum hg_status status; // HG_OK, or why the log is broken
};

// Zero-initialised = empty.
struct hg_outq {
    struct hg_outq_item *head, **tail;
    struct hg_outq_item *urgent; // newest of those that overtook others; NULL: none is left
    size_t bytes;                // not yet taken by the transport
    uint64_t progress_ns; // when the transport last took something, or the queue became non-empty
    // When the queue became non-empty, or was last judged; what was taken since then.
    uint64_t window_ns, window_bytes;
    const struct hg_outq_reached *reached; // see hg_outq_hold; NULL: nothing is held
    uint64_t hold, hold_kept;
};

// Takes over the caller's reference, also on failure. HG_E_NOMEM.
enum hg_status hg_outq_push(
    struct hg_outq *q, struct hg_packet *packet, uint32_t request, uint32_t channel) HG_MUST_CHECK;
// Likewise, before all that nothing of was written yet and that is not urgent; nothing holds it.
enum hg_status hg_outq_push_urgent(
    struct hg_outq *q, struct hg_packet *packet, uint32_t request) HG_MUST_CHECK;
// What is queued from now on is not sent before reached->durable, of the state log, has come to
// `position`: answers to edits.
void hg_outq_hold(struct hg_outq *q, uint64_t position);
// The same with reached->kept: what a session that comes back is to find. A disk that is full holds
// nothing for its sake.
void hg_outq_hold_kept(struct hg_outq *q, uint64_t position);
bool hg_outq_may_send(const struct hg_outq *q); // there is something that is not held
// Something is held by a log that is broken: for as long as that lasts nothing can be sent.
bool hg_outq_is_stopped(const struct hg_outq *q);
void hg_outq_excuse(struct hg_outq *q, uint64_t now_ns); // what is held is not the peer's fault
// Writes what the transport takes now, at most about a MiB. HG_OK (also when some is left),
// HG_E_CLOSED, HG_E_IO.
enum hg_status hg_outq_flush(struct hg_outq *q, struct hg_transport *t) HG_MUST_CHECK;
// False when a queue that was never empty for `window_ns` was drained at less than `rate` bytes a
// second.
bool hg_outq_is_drained(struct hg_outq *q, uint64_t now_ns, uint64_t window_ns, double rate);
void hg_outq_finish(struct hg_outq *q);

// ---- input --------------------------------------------------------------------------------------

// Messages of a framer that are packets: hgp_framer_next gives a `struct hg_packet *`.
extern const struct hgp_frame_class hg_packet_frames;

// One read of the transport. HG_OK, HG_E_AGAIN (nothing there), HG_E_CLOSED (end of stream),
// HG_E_IO, HG_E_NOMEM.
enum hg_status hg_packet_receive(struct hgp_framer *f, struct hg_transport *t) HG_MUST_CHECK;
// hgp_framer_next, with *out NULL and HG_OK when more bytes are needed.
enum hg_status hg_packet_next(
    struct hgp_framer *f, uint32_t limit, struct hg_packet **out) HG_MUST_CHECK;

// ---- over an exec -------------------------------------------------------------------------------

// What has come of a stream and was not taken, and what waits to be sent, as bytes.
void hg_packet_save_input(const struct hgp_framer *f, struct hg_writer *w);
void hg_outq_save(const struct hg_outq *q, struct hg_writer *w);
// Into an empty framer or queue. HG_E_FORMAT, HG_E_NOMEM.
enum hg_status hg_packet_load_input(struct hgp_framer *f, struct hg_reader *r) HG_MUST_CHECK;
enum hg_status hg_outq_load(struct hg_outq *q, struct hg_reader *r) HG_MUST_CHECK;

#endif
