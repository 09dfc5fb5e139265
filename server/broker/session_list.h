// session_list.h - the answer to sessions_query. Floor 6 (broker). Thread: the loop.
#ifndef HG_BROKER_SESSION_LIST_H
#define HG_BROKER_SESSION_LIST_H

#include "server/broker/session_state.h"

// Answers quarantine_query with one JSON object.
void hg_session_list_quarantine(struct hg_session *asker, uint32_t request);
void hg_session_list(struct hg_session *asker, uint32_t request);

#endif
