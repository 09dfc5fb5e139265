// upload.h - a content that is still arriving, of one session: counted as its pieces come, and
// hashed, written and named in the thread of the store's queue.
// Floor 6 (broker). Thread: the loop, which waits for none of it: hg_upload_news says what became
// of it (upload_store.h).
#ifndef HG_BROKER_UPLOAD_H
#define HG_BROKER_UPLOAD_H

#include "server/broker/connection/packet.h"
#include "server/broker/storage/upload_store.h"

struct hg_upload;

struct hg_upload_piece {
    struct hg_packet *packet; // has the data, and is kept until they are written; NULL: they stay
    const void *data;
    size_t size;
    uint32_t request; // of the client, for hg_upload_news
};

// Begins a content of total_bytes. Room is made as they arrive: an announcement costs nothing and
// evicts nothing. HG_E_LIMIT, HG_E_NOMEM.
enum hg_status hg_upload_begin(struct hg_upload_store *store, struct hg_upload_owner *owner,
    const uint8_t hash[32], uint64_t total_bytes, struct hg_upload **out,
    struct hg_error *err) HG_MUST_CHECK;
const uint8_t *hg_upload_hash(const struct hg_upload *upload);
uint64_t hg_upload_offset(const struct hg_upload *upload); // bytes that came so far
uint64_t hg_upload_total(const struct hg_upload *upload);
uint64_t hg_upload_unwritten(const struct hg_upload *upload); // bytes that wait for the disk
// When it began, or the last piece was stored.
uint64_t hg_upload_progress_ns(const struct hg_upload *upload);
// Appends the next piece. HG_E_LIMIT (more than announced, or than there is room for), HG_E_NOMEM.
// What the disk says comes later (hg_upload_news.failed).
enum hg_status hg_upload_append(struct hg_upload *upload, const struct hg_upload_piece *piece,
    struct hg_error *err) HG_MUST_CHECK;
// All bytes came: once they are written the hash is verified and the content taken into the store,
// which `ended` reports (HG_E_HASH, HG_E_NOSPACE, HG_E_IO, HG_E_NOMEM). `synced`: the files for
// hg_upload_take_files are kept open. HG_E_NOMEM: it was aborted; `ended` is not called.
enum hg_status hg_upload_commit(
    struct hg_upload *upload, uint32_t request, bool synced, struct hg_error *err) HG_MUST_CHECK;
bool hg_upload_is_committed(const struct hg_upload *upload); // and has not ended
// The number of its session, for hg_upload_news; 0: that has ended.
void hg_upload_set_session(struct hg_upload *upload, uint32_t session);
uint32_t hg_upload_session(const struct hg_upload *upload);
uint32_t hg_upload_request(const struct hg_upload *upload); // that it was committed with
// During `ended`: the caller's descriptors of the content and its folder, to be synced.
void hg_upload_take_files(struct hg_upload *upload, int *content_fd, int *folder_fd);
void hg_upload_abort(struct hg_upload *upload); // accepts NULL; not once it is committed

#endif
