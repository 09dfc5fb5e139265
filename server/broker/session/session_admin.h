// session_admin.h - messages of administrators: say something, kick, drain, statistics.
// Floor 6 (broker). Thread: the loop.
#ifndef HG_BROKER_SESSION_ADMIN_H
#define HG_BROKER_SESSION_ADMIN_H

#include "server/broker/session/session_state.h"

void hg_session_admin_message(
    struct hg_session *session, uint32_t request, const struct hgp_message_send *m);
void hg_session_admin_kick(struct hg_session *session, uint32_t request, const struct hgp_kick *m);
void hg_session_admin_drain(
    struct hg_session *session, uint32_t request, const struct hgp_drain_set *m);
void hg_session_admin_watch(
    struct hg_session *session, uint32_t request, const struct hgp_sessions_watch *m);
// Every 50 ms: statistics that are due.
void hg_session_admin_tick(struct hg_session_table *table);
// A drain is set, and the deadline has come or no session is left: its sessions end, once. True:
// the daemon is to end as well.
bool hg_session_admin_drained(struct hg_session_table *table);

#endif
