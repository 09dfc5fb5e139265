// session_sync.h - answers to uploads that wait until the content is on the disk.
// Floor 6 (broker). Thread: the loop. With a state log only.
#ifndef HG_BROKER_SESSION_SYNC_H
#define HG_BROKER_SESSION_SYNC_H

#include "server/broker/session/session_state.h"

// A content that was committed, and whose answer waits.
struct hg_session_synced {
    uint32_t session, request; // session 0: its connection is gone; request 0: it wants no answer
    const uint8_t *hash;
    int content_fd, folder_fd; // taken over
};

// The content and its folder are synced, and then the request is answered; where that fails, with
// the reason, and the content is not kept. HG_E_NOMEM: nothing waits.
enum hg_status hg_session_sync_begin(struct hg_session_table *table,
    const struct hg_session_synced *content, struct hg_error *err) HG_MUST_CHECK;
// The state log has news: answers those that are done.
void hg_session_sync_end(struct hg_session_table *table);
// The session's connection is gone: its requests are answered no more.
void hg_session_sync_unask(const struct hg_session *session);
// Of a session; NULL: of any.
bool hg_session_sync_waits(const struct hg_session_table *table, const struct hg_session *session);
void hg_session_sync_finish(struct hg_session_table *table); // after the log was closed

#endif
