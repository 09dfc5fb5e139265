// session_rules.h - checks before a message is relayed to the worker: quotas, ranges, existence.
// Floor 6 (broker). Thread: the loop.
#ifndef HG_BROKER_SESSION_RULES_H
#define HG_BROKER_SESSION_RULES_H

#include "server/broker/session/session_state.h"

// `m` is the packet, decoded. HG_E_STATE, HG_E_LIMIT, HG_E_NOTFOUND, HG_E_INVAL, HG_E_BUSY,
// HG_E_UNSUPPORTED, HG_E_NOMEM.
enum hg_status hg_session_rules_check(struct hg_session *session, const struct hg_packet *packet,
    const union hgp_any *m, struct hg_error *err) HG_MUST_CHECK;
// Scenes may be changed: what is accepted now survives the daemon, as configured. Else
// HG_E_NOSPACE, HG_E_IO, HG_E_NOMEM: why the state log is broken.
enum hg_status hg_session_rules_may_change(
    const struct hg_session_table *table, const char *what, struct hg_error *err) HG_MUST_CHECK;

#endif
