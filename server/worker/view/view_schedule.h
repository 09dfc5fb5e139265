// view_schedule.h - whose turn it is to render.
// Floor 6, private to server/worker. Thread: the render thread.
#ifndef HG_SERVER_WORKER_VIEW_VIEW_SCHEDULE_H
#define HG_SERVER_WORKER_VIEW_VIEW_SCHEDULE_H

#include "server/worker/view/view_slot.h"

struct hg_schedule_choice {
    struct session *session;
    struct view_slot *view; // NULL: a message of the session that waits
    bool contended;         // other sessions have work, too
};

// Whose turn it is: equal shares of time for tenants, then for their sessions, then for the views
// of a session, of which one that moves has four times the share of one that settles, and that four
// times the share of a path-traced film; beside other sessions a film has a quarter. False: nothing
// to do; then *wait_ns is how long until a view may have work (UINT64_MAX: only after a message or
// a wake-up).
//
// A view whose encode stream is full is stepped only for requests of its settled frame: the
// next frame that it delivers is of its newest state.
bool hg_schedule_choose(
    struct render_state *s, struct hg_schedule_choice *choice, uint64_t *wait_ns);
// Steps the view and delivers what became due.
void hg_schedule_work(struct render_state *s, const struct hg_schedule_choice *choice);
// Messages of the session took so long.
void hg_schedule_charge_messages(struct render_state *s, struct session *session, uint64_t ns);
// Pose, lens and parameters of a view are up to date with its scene; steps once if it never did.
enum hg_status hg_schedule_refresh(
    struct session *session, struct view_slot *view, struct hg_error *err) HG_MUST_CHECK;

#endif
