// session_allow.h - what a session may do now: how often, and whether anything new may begin.
// Floor 6 (broker). Thread: the loop.
#ifndef HG_BROKER_SESSION_ALLOW_H
#define HG_BROKER_SESSION_ALLOW_H

#include "server/broker/session/session_state.h"

// Changes that go to many, or into logs: 20 a second, 100 at once. HG_E_BUSY.
enum hg_status hg_session_allow_act(
    struct hg_session *session, const char *what, struct hg_error *err) HG_MUST_CHECK;
// While a drain is set nothing new begins, but for administrators. HG_E_STATE.
enum hg_status hg_session_allow_begin(const struct hg_session_table *table, enum hgp_role role,
    const char *what, struct hg_error *err) HG_MUST_CHECK;

#endif
