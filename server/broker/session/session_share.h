// session_share.h - events that the sessions of a scene get of each other: participants, cursors,
// edits.
// Floor 6 (broker). Thread: the loop. Frequent events are sent once in a tick, the newest only: a
// fast client costs the others at most 20 messages a second. Clients that are slow miss them.
#ifndef HG_BROKER_SESSION_SHARE_H
#define HG_BROKER_SESSION_SHARE_H

#include "server/broker/session/session_state.h"

void hg_session_share_watch(
    struct hg_session *session, uint32_t request, const struct hgp_scene_watch *m);
void hg_session_share_participant(
    struct hg_session *session, uint32_t request, const struct hgp_participant_set *m);
void hg_session_share_cursor(
    struct hg_session *session, uint32_t request, const struct hgp_cursor_set *m);
// The session is one of the scene's, or no longer (where it is one).
void hg_session_share_link(struct hg_session *session, struct hg_shared_scene *scene);
void hg_session_share_unlink(struct hg_session *session);
// The session joins a scene: hg_session_share_link, and the other participants are notified.
void hg_session_share_enter(struct hg_session *session, struct hg_shared_scene *scene);
// It leaves its scene (away: is kept without a client): cursor and shared camera are given up.
void hg_session_share_leave(struct hg_session *session, bool away);
// The client of a resumed session: all that it watches, as it is now.
void hg_session_share_resume(struct hg_session *session);
// An edit of it was accepted.
void hg_session_share_edited(struct hg_session *session, const struct hg_packet *packet);
// Every 50 ms: tells what is due.
void hg_session_share_tick(struct hg_session_table *table);

#endif
