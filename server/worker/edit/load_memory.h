// load_memory.h - memory for what files bring, shared out among the sessions of a worker.
// Floor 6, private to server/worker. Thread: the render thread.
//
// Large arrays lie in files (base/spill.h). What assets take besides counts: a session may have a
// quarter of what the worker may have at that moment, and all together half: a software rasteriser
// has its copies of meshes there, too. What was loaded stays when the worker gets less, and comes
// back in a new worker whatever it has.
#ifndef HG_SERVER_WORKER_EDIT_LOAD_MEMORY_H
#define HG_SERVER_WORKER_EDIT_LOAD_MEMORY_H

#include "server/worker/session.h"

// What the next asset of the session may take; 0 = no limit. HG_E_LIMIT: nothing is left.
enum hg_status hg_load_memory_left(const struct render_state *s, const struct session *session,
    uint64_t *left_bytes, struct hg_error *err) HG_MUST_CHECK;

#endif
