// session_answer.h - messages of the worker on a session's channel.
// Floor 6 (broker). Thread: the loop.
#ifndef HG_BROKER_SESSION_ANSWER_H
#define HG_BROKER_SESSION_ANSWER_H

#include "server/broker/session/session_state.h"

// `m` is the packet, decoded. Does not take the packet, but may renumber a frame in it. The session
// may be destroyed.
void hg_session_answer(struct hg_session *session, struct hg_packet *packet, union hgp_any *m);

#endif
