// session_audit.h - lines of the audit log about what sessions do.
// Floor 6 (broker). Thread: the loop.
#ifndef HG_BROKER_SESSION_AUDIT_H
#define HG_BROKER_SESSION_AUDIT_H

#include "server/broker/session/session_state.h"

// `detail` may be NULL.
void hg_session_audit(
    const struct hg_session *session, const char *event, enum hg_status result, const char *detail);
// A request was answered: requests that load files are logged.
void hg_session_audit_answer(
    const struct hg_session *session, const struct hg_packet *request, enum hg_status result);

#endif
