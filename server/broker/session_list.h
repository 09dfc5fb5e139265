// session_list.h - the answer to sessions_query. Floor 6 (broker). Thread: the loop.
#ifndef HG_BROKER_SESSION_LIST_H
#define HG_BROKER_SESSION_LIST_H

#include "server/broker/session_state.h"

void hg_session_list(struct hg_session *asker, uint32_t request);

#endif
