// session_ticket.h - messages about join tickets: make, list, revoke.
// Floor 6 (broker). Thread: the loop.
#ifndef HG_BROKER_SESSION_TICKET_H
#define HG_BROKER_SESSION_TICKET_H

#include "server/broker/session/session_state.h"

void hg_session_ticket_make(
    struct hg_session *session, uint32_t request, const struct hgp_join_make *m);
void hg_session_ticket_list(struct hg_session *session, uint32_t request);
void hg_session_ticket_revoke(
    struct hg_session *session, uint32_t request, const struct hgp_join_revoke *m);
// Once a second: tickets whose issuer is not what it was, and those that are used up or expired and
// have no session, go.
void hg_session_ticket_check(
    struct hg_session_table *table, const struct hg_tokens *tokens, uint64_t now_s);

#endif
