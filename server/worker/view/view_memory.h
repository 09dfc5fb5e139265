// view_memory.h - memory for views, shared out among the sessions of a worker.
// Floor 6, private to server/worker. Thread: the render thread.
//
// Where the device's memory is that of the worker (a software rasteriser), large views of one
// session could take what the scenes and the other sessions need. Three quarters of what the worker
// may have are for views. A session may have up to a sixteenth of them; of those that have more all
// together may have half, so that the other half is there for eight that have as much as any may.
// Whatever was allowed is allowed again in another order: views come back in a new worker.
#ifndef HG_SERVER_WORKER_VIEW_VIEW_MEMORY_H
#define HG_SERVER_WORKER_VIEW_VIEW_MEMORY_H

#include "server/worker/session.h"

// What the worker may have at this moment; 0 = no limit.
uint64_t hg_worker_memory_bytes(const struct render_state *s);
// Whether a view of the session may have that size; `view`: the one that has another one now, NULL
// for a new one. HG_E_LIMIT.
enum hg_status hg_view_memory_check(const struct render_state *s, const struct session *session,
    const struct view_slot *view, const struct hg_view_params *params,
    struct hg_error *err) HG_MUST_CHECK;

#endif
