// session_annotation.h - messages about annotations: who may make, change and remove them.
// Floor 6 (broker). Thread: the loop. Answers wait until they are durable; other clients get
// changes with the next tick, and a slow client gets all annotations once it has caught up.
#ifndef HG_BROKER_SESSION_ANNOTATION_H
#define HG_BROKER_SESSION_ANNOTATION_H

#include "server/broker/session/session_state.h"

void hg_session_annotation_set(
    struct hg_session *session, uint32_t request, const struct hgp_annotation_set *m);
void hg_session_annotation_remove(
    struct hg_session *session, uint32_t request, const struct hgp_annotation_remove *m);
// Sends all of the scene's: the answer to a query, or what a watcher is to know.
void hg_session_annotation_tell(struct hg_session *session, uint32_t request);
void hg_session_annotation_tick(struct hg_shared_scene *scene);

#endif
