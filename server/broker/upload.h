// upload.h - a content that is still arriving, of one session: counted, hashed and written to the
// store's folder as its pieces come.
// Floor 6 (broker). Thread: the loop.
#ifndef HG_BROKER_UPLOAD_H
#define HG_BROKER_UPLOAD_H

#include "server/broker/upload_store.h"

struct hg_upload;

// Begins a content of total_bytes. Room is made as they arrive: an announcement costs nothing and
// evicts nothing. HG_E_LIMIT, HG_E_NOSPACE, HG_E_IO, HG_E_NOMEM.
enum hg_status hg_upload_begin(struct hg_upload_store *store, struct hg_upload_owner *owner,
    const uint8_t hash[32], uint64_t total_bytes, struct hg_upload **out,
    struct hg_error *err) HG_MUST_CHECK;
const uint8_t *hg_upload_hash(const struct hg_upload *upload);
uint64_t hg_upload_offset(const struct hg_upload *upload); // bytes that came so far
uint64_t hg_upload_total(const struct hg_upload *upload);
uint64_t hg_upload_progress_ns(
    const struct hg_upload *upload); // when it began, or the last piece came
// Appends the next piece. HG_E_LIMIT (more than announced, or than there is room for),
// HG_E_NOSPACE, HG_E_IO.
enum hg_status hg_upload_append(
    struct hg_upload *upload, const void *data, size_t size, struct hg_error *err) HG_MUST_CHECK;
// A descriptor of the caller's of what has come, to be synced. -1: none could be made.
int hg_upload_dup(const struct hg_upload *upload);
// All bytes came: verifies the hash and takes the content into the store. Destroys the upload
// either way. HG_E_HASH, HG_E_IO, HG_E_NOMEM.
enum hg_status hg_upload_commit(struct hg_upload *upload, struct hg_error *err) HG_MUST_CHECK;
void hg_upload_abort(struct hg_upload *upload); // accepts NULL

#endif
