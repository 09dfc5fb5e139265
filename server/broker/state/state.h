// state.h - what survives the daemon: reads it at start, and writes snapshots of it.
// Floor 6 (broker). Thread: the loop.
#ifndef HG_BROKER_STATE_H
#define HG_BROKER_STATE_H

#include "server/broker/session/session_state.h"

// Opens the log in state-dir and makes what it tells of (is_known: that is there already). Without
// the option nothing happens. As hg_state_log_open.
enum hg_status hg_state_open(struct hg_session_table *table, bool is_known,
    struct hg_state_log **out, struct hg_error *err) HG_MUST_CHECK;
// Takes in a record (of the struct hg_session_table *); a hg_state_take.
enum hg_status hg_state_take_record(void *table, const uint8_t *body, size_t size);
// Appends records of all scenes, sessions and views, and of the quarantine.
void hg_state_put_all(struct hg_session_table *table);
// The workers are there: restored scenes that a session can open get theirs, the others end.
void hg_state_place(struct hg_session_table *table);
// Writes a snapshot when it is time for one.
void hg_state_tend(struct hg_session_table *table);

#endif
