// state.h - what survives the daemon: reads it at start, and writes snapshots of it.
// Floor 6 (broker). Thread: the loop.
#ifndef HG_BROKER_STATE_H
#define HG_BROKER_STATE_H

#include "server/broker/session_state.h"

// Opens the log in state-dir and makes the scenes and the quarantine that it tells of. Without the
// option nothing happens. As hg_state_log_open.
enum hg_status hg_state_open(
    struct hg_session_table *table, struct hg_state_log **out, struct hg_error *err) HG_MUST_CHECK;
// The workers are there: restored scenes that somebody can open get theirs, the others end.
void hg_state_place(struct hg_session_table *table);
// Writes a snapshot when it is time for one.
void hg_state_tend(struct hg_session_table *table);

#endif
