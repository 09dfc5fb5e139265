// upload_store.h - contents that clients sent, as files named by their SHA-256.
// Floor 6 (broker). Thread: the loop. The broker looks into none of them; the worker reads
// <folder>/<hex> and verifies the hash again, so the files are not synced to the disk: what a
// power failure tears is refused and sent again.
//
// The index, in memory, is the loop's. What it decides is done in the folder by a thread
// (disk_queue.h), one thing after another: a content is in the index only once its file is there,
// and a file goes after its content has left the index.
#ifndef HG_BROKER_UPLOAD_STORE_H
#define HG_BROKER_UPLOAD_STORE_H

#include <stdbool.h>

#include "base/status.h"
#include "server/broker/storage/disk_queue.h"
#include "server/broker/storage/upload_folder.h"

struct hg_upload_store;
struct hg_upload_owner; // whom contents are counted for; lives as long as the store

// On the disk, in whole blocks: what an owner has sent and is still there, and what arrives of it.
// What several have sent is stored once and counted for each.
struct hg_upload_usage {
    uint64_t bytes, files;
};

// Creates the folder (and its parents), removes leftovers of an earlier run and indexes existing
// files. HG_E_PERM, HG_E_IO, HG_E_NOSPACE, HG_E_NOMEM.
enum hg_status hg_upload_store_create(const char *folder, uint64_t limit_bytes,
    struct hg_upload_store **out, struct hg_error *err) HG_MUST_CHECK;
// Accepts NULL. Waits for the disk; all uploads must have been committed or aborted.
void hg_upload_store_destroy(struct hg_upload_store *store);
void hg_upload_store_set_limit(struct hg_upload_store *store, uint64_t limit_bytes);
uint64_t hg_upload_store_bytes(const struct hg_upload_store *store);

// Found by the first 16 bytes of its key, or made; later runs know whose contents are. NULL: no
// memory.
struct hg_upload_owner *hg_upload_store_owner(
    struct hg_upload_store *store, const uint8_t key[32]) HG_MUST_CHECK;
// Moves the folder with links to all that the owner has sent (and will send) to where its tenant's
// worker may read it; NULL: back. HG_E_NOMEM, HG_E_PERM, HG_E_IO.
enum hg_status hg_upload_owner_move(struct hg_upload_store *store, struct hg_upload_owner *owner,
    const char *folder, struct hg_error *err) HG_MUST_CHECK;
// What the owner has sent is in that folder already. HG_E_NOMEM, HG_E_IO.
enum hg_status hg_upload_owner_find(struct hg_upload_store *store, struct hg_upload_owner *owner,
    const char *folder, struct hg_error *err) HG_MUST_CHECK;
struct hg_upload_usage hg_upload_owner_usage(const struct hg_upload_owner *owner);
// Above it what the owner sent and used longest ago goes, and what is in use is refused.
void hg_upload_owner_set_quota(struct hg_upload_owner *owner, const struct hg_upload_usage *quota);

// Whether the content is stored and the owner has sent it (NULL: whoever has); updates its last
// use.
bool hg_upload_store_has(
    struct hg_upload_store *store, const struct hg_upload_owner *owner, const uint8_t hash[32]);
// A pinned content is not evicted. Unknown hashes are remembered as pinned too. HG_E_NOMEM.
enum hg_status hg_upload_store_pin(
    struct hg_upload_store *store, const uint8_t hash[32]) HG_MUST_CHECK;
// How much on the disk would be pinned that is not; 0: it is, or is not there.
uint64_t hg_upload_store_pin_bytes(struct hg_upload_store *store, const uint8_t hash[32]);
// How much more an owner may have pinned: all that have something share the store equally, with one
// that is still to come.
uint64_t hg_upload_owner_pin_room(
    const struct hg_upload_store *store, const struct hg_upload_owner *owner);
void hg_upload_store_unpin(struct hg_upload_store *store, const uint8_t hash[32]);
// Drops a content that turned out to be damaged.
void hg_upload_store_forget(struct hg_upload_store *store, const uint8_t hash[32]);

// A file for a content that is still arriving (upload.h).
struct hg_upload_file {
    struct hg_upload_owner *owner;
    uint64_t size;   // bytes that there is room for
    uint32_t number; // of its name
    uint32_t drops;  // of the content, when it was expected
};

// Room for a new file of a content of total_bytes; it takes more as it grows. HG_E_LIMIT.
enum hg_status hg_upload_store_open(struct hg_upload_store *store, struct hg_upload_owner *owner,
    uint64_t total_bytes, struct hg_upload_file *file, struct hg_error *err) HG_MUST_CHECK;
// Makes room for so many bytes more: owners that have more than an equal part of the store lose
// what they used longest ago; then goes what was not used for an hour. HG_E_LIMIT.
enum hg_status hg_upload_store_grow(struct hg_upload_store *store, struct hg_upload_file *file,
    uint64_t bytes, struct hg_error *err) HG_MUST_CHECK;
// The file is about to become this content: until hg_upload_store_adopt the content is pinned.
// HG_E_NOMEM: it is not.
enum hg_status hg_upload_store_expect(struct hg_upload_store *store, struct hg_upload_file *file,
    const uint8_t hash[32]) HG_MUST_CHECK;
// It has become it, and the owner has a link to it; or that has failed, if err->status is set
// already. Sets it to HG_E_IO where the content was forgotten meanwhile; HG_E_NOMEM.
void hg_upload_store_adopt(struct hg_upload_store *store, struct hg_upload_file *file,
    const uint8_t hash[32], struct hg_error *err);
// Gives back its room. It is gone, or has become the content.
void hg_upload_store_close(struct hg_upload_store *store, struct hg_upload_file *file);

// ---- the disk -----------------------------------------------------------------------------------

struct hg_upload;

// Callbacks about uploads, called in the loop.
struct hg_upload_news {
    void *user;
    // Nothing waits for the disk of a piece of so many bytes any more.
    void (*written)(void *user, size_t bytes);
    // A piece (of this request) could not be stored; the upload is still to be aborted.
    void (*failed)(
        void *user, struct hg_upload *upload, uint32_t request, const struct hg_error *err);
    // A commit has ended: err->status says how. The upload is destroyed afterwards.
    void (*ended)(void *user, struct hg_upload *upload, const struct hg_error *err);
};

void hg_upload_store_listen(struct hg_upload_store *store, const struct hg_upload_news *news);
const struct hg_upload_news *hg_upload_store_news(const struct hg_upload_store *store);
// To be polled by the loop, and waited for where nothing may be left.
struct hg_disk_queue *hg_upload_store_queue(const struct hg_upload_store *store);
struct hg_upload_folder *hg_upload_store_folder(struct hg_upload_store *store);
const struct hg_upload_place *hg_upload_owner_place(const struct hg_upload_owner *owner);

#endif
