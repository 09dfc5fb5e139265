// session_upload.h - contents that come in pieces, and files that are verified.
// Floor 6 (broker). Thread: the loop, which never waits for the disk: pieces are handed to the
// thread of the store, and a content is answered when that has it. Until then the session's
// messages that need contents are not taken (hg_session_upload_must_wait); all others are.
#ifndef HG_BROKER_SESSION_UPLOAD_H
#define HG_BROKER_SESSION_UPLOAD_H

#include "server/broker/session/session_state.h"

// Looks after what the store's thread has done, from here on. HG_E_LIMIT.
enum hg_status hg_session_upload_watch(
    struct hg_session_table *table, struct hg_loop *loop, struct hg_error *err) HG_MUST_CHECK;
// Waits until the disk has all; nothing is looked after any more.
void hg_session_upload_unwatch(struct hg_session_table *table, struct hg_loop *loop);

void hg_session_upload(
    struct hg_session *session, struct hg_packet *packet, const struct hgp_upload *m);
// The message that comes next in the stream needs a content of the session that is committed but
// not in the store yet; or it brings more, and too much waits for the disk already.
bool hg_session_upload_must_wait(const struct hg_session *session, const struct hgp_framer *in);
// An answer to an upload is to come.
bool hg_session_upload_is_due(const struct hg_session *session);
// Of no session anything is with the disk.
bool hg_session_upload_is_quiet(const struct hg_session_table *table);
void hg_session_upload_query(
    struct hg_session *session, uint32_t request, const struct hgp_upload_query *m);
// Whether there is a content that the session's tenant has sent (any, where tenants share).
bool hg_session_upload_has(struct hg_session *session, const uint8_t hash[32]);
// Whether a scene may keep these contents, which the session has: of those that scenes use a tenant
// has its share. HG_E_LIMIT.
enum hg_status hg_session_upload_may_keep(struct hg_session *session, const char *what,
    const struct hgp_asset_file *files, uint32_t count, struct hg_error *err) HG_MUST_CHECK;
// Gives those up that have stopped.
void hg_session_upload_check_times(struct hg_session *session, uint64_t now_ns);
// Those that are committed are stored all the same; no answer is sent.
void hg_session_upload_abort_all(struct hg_session *session);
// Those that are still arriving fail.
void hg_session_upload_fail_all(struct hg_session *session, const struct hg_error *err);
// A file that comes in parts begins: it counts as an upload, and with those of all sessions as much
// as the store may hold, before any of it goes to the worker. HG_E_LIMIT; HG_E_INVAL: another size
// than it began with, or a part that reaches beyond it.
enum hg_status hg_session_upload_verify(struct hg_session *session, const struct hgp_image_query *m,
    struct hg_error *err) HG_MUST_CHECK;
// The worker has answered for it, or refused a part, or has died (`request` NULL), and keeps
// nothing.
void hg_session_upload_verified(struct hg_session *session, const struct hg_request *request);

#endif
