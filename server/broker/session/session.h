// session.h - a client's session: begin and end, its scene, the messages that clients send.
// Floor 6 (broker). Thread: the loop.
#ifndef HG_BROKER_SESSION_H
#define HG_BROKER_SESSION_H

#include "server/broker/session/session_state.h"

// Without a client and a scene. NULL: no memory.
struct hg_session *hg_session_create(
    struct hg_session_table *table, uint32_t number, enum hgp_role role, struct hgp_str name);
// A decoded message in its right state, direction and role. Does not take the packet.
void hg_session_message(
    struct hg_session *session, struct hg_packet *packet, const union hgp_any *message);
// The connection was lost: the session is parked, if its client asked for that, or ends.
void hg_session_lost(struct hg_session *session);
// The client left: ends the session, at once or when its edits are answered.
void hg_session_end(struct hg_session *session);
// Destroys a session without a client when none of its edits is on the way to a shared scene.
void hg_session_end_if_idle(struct hg_session *session);
// Destroys those without a client that have nothing under way any more.
void hg_session_bury(struct hg_session_table *table);
void hg_session_destroy(struct hg_session *session);

#endif
