// request.h - a decoded message on the render thread, and the recipient of its answer.
// Floor 6, private to server/worker. Thread: the render thread.
#ifndef HG_SERVER_WORKER_REQUEST_H
#define HG_SERVER_WORKER_REQUEST_H

#include "server/worker/task.h"
#include "server/worker/view/view_slot.h"

struct request {
    struct render_state *s;
    struct session *session; // NULL only for messages about the link
    struct reply_to to;
    struct hg_refbuf *payload; // keeps the views of *message alive
    uint64_t received_ns;      // when it came
    const union hgp_any *message;
};

// Answers ok with the scene's revision.
void hg_request_ok(const struct request *r);
// Makes a revision of an edit (unless a batch is open) and answers ok.
void hg_request_edited(const struct request *r);
// The session's view of this number. NULL: the request was answered with the error.
struct view_slot *hg_request_view(const struct request *r, uint32_t number);
// Starts a task for the request; the message is decoded again so that it outlives the request.
void hg_request_start_task(const struct request *r, enum task_kind kind, enum hgp_type type);

#endif
