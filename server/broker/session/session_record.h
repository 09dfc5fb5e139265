// session_record.h - records of the state log about sessions with a ticket, and their views.
// Floor 6 (broker). Thread: the loop. Answers that are sent from here on wait for the record
// (hg_outq_hold_kept), but for cameras and snapshots, which nothing answers. Sessions without a
// ticket are not recorded.
#ifndef HG_BROKER_SESSION_RECORD_H
#define HG_BROKER_SESSION_RECORD_H

#include "server/broker/session/session_state.h"

uint32_t hg_session_record_color(const struct hg_session *session); // 0xRRGGBB
void hg_session_record(struct hg_session *session);                 // as it is now
// Takes the label, colour and subscriptions to events of the scene (scene_watch) from a record.
void hg_session_record_take_share(
    struct hg_session *session, const struct hg_state_session *record);
void hg_session_record_end(struct hg_session *session);
void hg_session_record_view(struct hg_session *session, struct hg_session_view *view);
// A message of its look that was accepted.
void hg_session_record_look(
    struct hg_session *session, const struct hg_session_view *view, struct hg_packet *packet);
void hg_session_record_view_end(struct hg_session *session, const struct hg_session_view *view);
// Once in a while: cameras that have moved.
void hg_session_record_cameras(struct hg_session_table *table);
// The session and all its views; nothing waits for it.
void hg_session_record_all(struct hg_session *session);

#endif
