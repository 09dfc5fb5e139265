// session_upload.h - contents that come in pieces, and files that are verified.
// Floor 6 (broker). Thread: the loop.
#ifndef HG_BROKER_SESSION_UPLOAD_H
#define HG_BROKER_SESSION_UPLOAD_H

#include "server/broker/session_state.h"

void hg_session_upload(struct hg_session *session, uint32_t request, const struct hgp_upload *m);
void hg_session_upload_query(
    struct hg_session *session, uint32_t request, const struct hgp_upload_query *m);
// Whether there is a content that the session's tenant has sent (any, where tenants share).
bool hg_session_upload_has(struct hg_session *session, const uint8_t hash[32]);
// Whether a scene may keep these contents, which the session has: of those that scenes use a tenant
// has its share. HG_E_LIMIT.
enum hg_status hg_session_upload_may_keep(struct hg_session *session, const char *what,
    const struct hgp_asset_file *files, uint32_t count, struct hg_error *err) HG_MUST_CHECK;
// Keeps why one failed, for its other pieces.
void hg_session_upload_failed(
    struct hg_session *session, const uint8_t hash[32], const struct hg_error *err);
// Gives those up that have stopped.
void hg_session_upload_check_times(struct hg_session *session, uint64_t now_ns);
void hg_session_upload_abort_all(struct hg_session *session);
// A file that comes in parts begins: it counts as an upload, and with those of all sessions as much
// as the store may hold, before any of it goes to the worker. HG_E_LIMIT; HG_E_INVAL: another size
// than it began with, or a part that reaches beyond it.
enum hg_status hg_session_upload_verify(struct hg_session *session, const struct hgp_image_query *m,
    struct hg_error *err) HG_MUST_CHECK;
// The worker has answered for it, or refused a part, or has died (`request` NULL), and keeps
// nothing.
void hg_session_upload_verified(struct hg_session *session, const struct hg_request *request);

#endif
