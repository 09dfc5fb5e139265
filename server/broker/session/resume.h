// resume.h - the messages keep and resume.
// Floor 6 (broker). Thread: the loop.
#ifndef HG_BROKER_RESUME_H
#define HG_BROKER_RESUME_H

#include "server/broker/session/session_state.h"

// Answered by ticket.
void hg_resume_keep(struct hg_session *session, uint32_t request);
// Gives the connection the session of the ticket in place of its own; answered by resumed.
void hg_resume(struct hg_conn *conn, uint32_t request, const struct hgp_resume *m);

#endif
