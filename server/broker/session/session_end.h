// session_end.h - sessions that an administrator or a rule of the daemon ends.
// Floor 6 (broker). Thread: the loop.
#ifndef HG_BROKER_SESSION_END_H
#define HG_BROKER_SESSION_END_H

#include "server/broker/session/session_state.h"

// Ends a session: it cannot be resumed, now or after a restart; its edits under way are done. Its
// client gets the error and the reason. Returns the position in the state log after which that is
// durable.
uint64_t hg_session_end_now(
    struct hg_session *session, const struct hg_error *err, const char *reason);
// Likewise, but a session that its client keeps waits for it, as after a broken connection, and its
// scene with it.
void hg_session_leave_now(
    struct hg_session *session, const struct hg_error *err, const char *reason);
// Every 50 ms: warns and ends sessions whose clients have done nothing for long.
void hg_session_end_idle(struct hg_session_table *table);

#endif
