// session_camera.h - the shared camera of a scene: who has it, and the views that follow it.
// Floor 6 (broker). Thread: the loop.
//
// The holder's view_camera for a view that follows goes to the worker as ever, and is kept as the
// scene's pose. Views of others that follow get it from here, not by way of their sessions' queues:
// at once where nothing waits in front of the worker, else with the next tick. There is one pose,
// so the newest wins and a slow worker costs no memory. A new worker gets it with the views.
#ifndef HG_BROKER_SESSION_CAMERA_H
#define HG_BROKER_SESSION_CAMERA_H

#include "server/broker/session/session_state.h"

void hg_session_camera_request(struct hg_session *session, uint32_t request);
void hg_session_camera_take(struct hg_session *session, uint32_t request);
void hg_session_camera_give(
    struct hg_session *session, uint32_t request, const struct hgp_camera_give *m);
void hg_session_camera_lock(
    struct hg_session *session, uint32_t request, const struct hgp_camera_lock *m);
void hg_session_camera_follow(
    struct hg_session *session, uint32_t request, const struct hgp_camera_follow *m);
// Whether a view_camera for the view may go to the worker. HG_E_PERM.
enum hg_status hg_session_camera_may_move(const struct hg_session *session,
    const struct hg_session_view *view, struct hg_error *err) HG_MUST_CHECK;
// The holder has moved a view that follows.
void hg_session_camera_moved(
    struct hg_session *session, struct hg_session_view *view, struct hg_packet *packet);
// The worker has accepted a view: it gets the pose, if it follows.
void hg_session_camera_accepted(struct hg_session *session, struct hg_session_view *view);
void hg_session_camera_leave(struct hg_session *session); // its scene, or its client
void hg_session_camera_tell(struct hg_session *session);  // state and pose, as they are now
// Every 50 ms: ends turns that are over, and sends the state and pose to followers.
void hg_session_camera_tick(struct hg_session_table *table, struct hg_shared_scene *scene);

#endif
