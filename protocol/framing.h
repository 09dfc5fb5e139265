// framing.h - the receiving end of a stream: bytes in, whole messages out. Used by the broker, the
// worker and the client library; the sending end is hgp_encode and hgp_header_encode (hgp.h).
// Floor 1. Thread: one at a time. Pure: no descriptors. The owner of the stream reads into the
// space that the framer shows and says how much came; so every transport has the same framing.
//
//   for (;;) {
//       uint8_t *dst = hgp_framer_space(&f, &size);   // NULL: no memory
//       ... read at most `size` bytes to dst ...
//       hgp_framer_fill(&f, got);
//       while ((status = hgp_framer_next(&f, limit, &message)) == HG_OK)
//           ... take the message ...                  // else HG_E_AGAIN, or the stream is unusable
//   }
#ifndef HG_PROTOCOL_FRAMING_H
#define HG_PROTOCOL_FRAMING_H

#include "protocol/hgp.h"

enum {
    HGP_FRAMER_CHUNK_BYTES = 64 * 1024, // read ahead
    HGP_FRAMER_DIRECT_BYTES =
        32 * 1024,                   // payloads that lack more are read in place, without a copy
    HGP_FRAMER_READ_BYTES = 1 << 20, // most that one read may bring
    HGP_FRAMER_POOL_CHUNKS = 16,     // that a pool keeps at most
};

// Chunks for reuse by the streams of one owner: a stream that ends gives its chunk back here, so
// that a flood of short connections maps and unmaps no memory. Zero-initialised; same thread as its
// framers. Chunks are not cleared: they hold bytes of earlier streams (framing.c says why no stream
// is shown them).
struct hgp_chunk_pool {
    uint8_t *chunks[HGP_FRAMER_POOL_CHUNKS];
    uint32_t count;
    uint32_t unused; // the fewest there were since the last trim
};

// Gives one back to the system if there was one all the time since the last call. Called now and
// then, an idle pool is empty after HGP_FRAMER_POOL_CHUNKS + 1 calls, and one that is used in
// bursts keeps what they need.
void hgp_chunk_pool_trim(struct hgp_chunk_pool *pool);
void hgp_chunk_pool_finish(struct hgp_chunk_pool *pool);

// What a message is made of on the side that receives it.
struct hgp_frame_class {
    // Room for a message whose header has come; NULL: no memory. The payload should be reserved,
    // not touched: a header that announces much then costs only what arrives.
    void *(*create)(const struct hgp_header *header);
    uint8_t *(*payload)(void *message); // header.length bytes
    void (*destroy)(void *message);     // one that never became whole
};

// {.frames = ...}, the rest zero = the start of a stream.
struct hgp_framer {
    const struct hgp_frame_class *frames;
    struct hgp_chunk_pool *pool; // where its chunk comes from; NULL: from the system
    uint8_t *chunk; // [HGP_FRAMER_CHUNK_BYTES], taken with the first read
    size_t start, end;
    void *partial; // a message whose payload is still arriving; NULL = none
    uint16_t type; // of `partial`
    size_t length, filled;
    uint64_t total_bytes; // received so far
};

// Where the next bytes of the stream go, and how many at most (0: messages must be taken first).
// NULL: no memory.
uint8_t *hgp_framer_space(struct hgp_framer *f, size_t *size);
// `size` bytes were put there.
void hgp_framer_fill(struct hgp_framer *f, size_t size);
// Takes `size` bytes as they are, before the first message (the preface). NULL while fewer are
// there.
const uint8_t *hgp_framer_take(struct hgp_framer *f, size_t size);
// The next whole message, owned by the caller from here on. HG_E_AGAIN: it is not whole yet.
// HG_E_LIMIT (a payload of more than `limit` bytes), HG_E_FORMAT (flags), HG_E_NOMEM: the stream is
// unusable. *message is NULL unless HG_OK.
enum hg_status hgp_framer_next(struct hgp_framer *f, uint32_t limit, void **message) HG_MUST_CHECK;
// Of the message that hgp_framer_next gives next, once its header has come; else false.
bool hgp_framer_peek(const struct hgp_framer *f, uint16_t *type);
// The stream stands between two messages: an end here cuts none.
bool hgp_framer_is_empty(const struct hgp_framer *f);
// Gives the memory of a stream back that stands between two messages; it is taken again when more
// comes.
bool hgp_framer_rest(struct hgp_framer *f); // true: there was some
void hgp_framer_finish(struct hgp_framer *f);

#endif
