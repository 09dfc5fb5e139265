// session_list.h - the answer to sessions_query. Floor 6 (broker). Thread: the loop.
#ifndef HG_BROKER_SESSION_LIST_H
#define HG_BROKER_SESSION_LIST_H

#include "server/broker/session/session_state.h"

// Answers quarantine_query with one JSON object.
void hg_session_list_quarantine(struct hg_session *asker, uint32_t request);
// What it answers to sessions_query.
void hg_session_list_write(struct hg_writer *w, const struct hg_session_table *table);
// Answers with the JSON that was written, or HG_E_NOMEM; finishes the writer.
void hg_session_list_answer(
    struct hg_session *asker, uint32_t request, struct hg_writer *w, const char *what);
void hg_session_list(struct hg_session *asker, uint32_t request);

#endif
