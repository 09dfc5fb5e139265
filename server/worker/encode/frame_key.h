// frame_key.h - the hash of all that a settled frame is made from.
// Floor 6, private to server/worker. Thread: the render thread.
//
// Equal keys mean equal bytes: a private worker, a daemon and an upload make the same key of the
// same scene. The protocol calls it a job (job_query, frame.job).
#ifndef HG_SERVER_WORKER_ENCODE_FRAME_KEY_H
#define HG_SERVER_WORKER_ENCODE_FRAME_KEY_H

#include "server/worker/view/view_slot.h"

// How a frame is encoded.
struct frame_format {
    enum hgp_encoding encoding;
    uint8_t quality; // of JPEG
};

// Key of the frame that the view would give when settled; the scene's part of it is left in the
// scene's slot. HG_E_NOMEM; then the key is 0.
enum hg_status hg_frame_key_make(struct render_state *s, struct session *session,
    const struct view_slot *view, struct frame_format format, uint8_t key[32],
    struct hg_error *err) HG_MUST_CHECK;
// The format that was asked about last, else that of still frames.
struct frame_format hg_frame_key_format(const struct view_slot *view);

#endif
