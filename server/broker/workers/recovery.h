// recovery.h - brings scenes and sessions into a worker: a new one, or the successor of a dead one.
// Floor 6 (broker). Thread: the loop.
#ifndef HG_BROKER_RECOVERY_H
#define HG_BROKER_RECOVERY_H

#include "server/broker/session/session_state.h"

// For links whose owner is the struct hg_session_table.
extern const struct hg_link_events hg_recovery_events;

// Replays the next scene, sends waiting requests.
void hg_recovery_continue(struct hg_link *link);

#endif
