// session_messages.h - messages about the link, or a session as a whole.
// Floor 6, private to server/worker. Thread: the render thread. A handler answers its request.
#ifndef HG_SERVER_WORKER_SESSION_MESSAGES_H
#define HG_SERVER_WORKER_SESSION_MESSAGES_H

#include "server/worker/request.h"

// These need no session, but for scene_open: where r->session is NULL that is not handled, and
// false.
bool hg_worker_session_message_handle(const struct request *r, uint16_t type);
// Destroys the session with its views.
void hg_worker_session_message_detach(struct render_state *s, struct session *session);

#endif
