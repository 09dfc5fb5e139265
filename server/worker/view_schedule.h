// view_schedule.h - whose turn it is to render.
// Floor 6, private to server/worker. Thread: the render thread.
#ifndef HG_SERVER_WORKER_VIEW_SCHEDULE_H
#define HG_SERVER_WORKER_VIEW_SCHEDULE_H

#include "server/worker/view_slot.h"

// Steps one view that has work, in turn, and delivers what became due. False: nothing to do; then
// *wait_ns is how long until a view may have work (UINT64_MAX: only after a message or a wake-up).
//
// A view whose encode stream is full is stepped only for requests of its settled frame: the
// next frame that it delivers is of its newest state.
bool hg_schedule_step_next(struct render_state *s, uint64_t *wait_ns);
// Pose, lens and parameters of a view are up to date with its scene; steps once if it never did.
enum hg_status hg_schedule_refresh(
    struct session *session, struct view_slot *view, struct hg_error *err) HG_MUST_CHECK;

#endif
