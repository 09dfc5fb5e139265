// store.h - things that are costly to make, kept on disk under the hash of what they are made from.
// Floor 1. Thread-safe; one folder may be used by any number of processes at once.
//
// An entry is a file of numbered blocks: a texture's pages, a mesh's chunks. It appears complete or
// not at all (temporary name, fsync, rename) and never changes. Its table is checked when it is
// found, every block whenever it is read. Damage is never an answer: a damaged entry is deleted and
// reported as absent, so its owner rebuilds it.
//
// The folder is a cache: it may vanish, fill up or be read-only at any time. Then entries are
// absent or cannot be written, nothing else. Entries that are open are never evicted, and what was
// opened stays readable when the folder is deleted.
#ifndef HG_BASE_STORE_STORE_H
#define HG_BASE_STORE_STORE_H

#include "base/sha256.h"
#include "base/status.h"

#define HG_STORE_BLOCK_BYTES_MAX (256u << 20) // of one block
#define HG_STORE_BLOCKS_MAX      (1u << 24)   // of one entry
#define HG_STORE_LABEL_BYTES     201u         // with its end

struct hg_store;
struct hg_store_entry;  // open for reading
struct hg_store_writer; // belongs to one thread

// What an entry is made from. Equal keys mean equal content.
struct hg_store_key {
    uint8_t hash[HG_SHA256_BYTES];
};

struct hg_store_params {
    const char *dir;      // created with its parent when it is missing
    uint64_t limit_bytes; // of all entries, 0 = unlimited; the least recently used are evicted
};

struct hg_store_stats {
    uint64_t limit_bytes, bytes; // bytes: of all entries when the folder was last counted
    uint64_t found, absent, written, damaged, evicted; // entries, since hg_store_open
    uint64_t bytes_read, bytes_written;
    uint64_t files_open, files_reopened; // of entries: now; since hg_store_open
};

// A folder that cannot be made or written is no error: entries are absent then and writers fail.
// HG_E_INVAL (no folder named), HG_E_NOMEM.
enum hg_status hg_store_open(const struct hg_store_params *params, struct hg_store **out,
    struct hg_error *err) HG_MUST_CHECK;
// All entries and writers must be closed. Accepts NULL.
void hg_store_close(struct hg_store *store);
void hg_store_stats(struct hg_store *store, struct hg_store_stats *out);

// Key of `kind` ("pages", "clusters") in the format `version` made from `size` bytes of parameters
// (content hashes, settings). HG_E_NOMEM.
enum hg_status hg_store_key(const char *kind, uint32_t version, const void *params, size_t size,
    struct hg_store_key *out) HG_MUST_CHECK;

// Opens an entry and notes its use. HG_E_NOTFOUND (absent, unreadable or damaged), HG_E_NOMEM.
enum hg_status hg_store_find(struct hg_store *store, const struct hg_store_key *key,
    struct hg_store_entry **out, struct hg_error *err) HG_MUST_CHECK;
// Whether there is a file for the key, without looking into it.
bool hg_store_has(struct hg_store *store, const struct hg_store_key *key);

// An entry may be read by many threads at once. Its file is open while it was used lately: a
// quarter of the descriptors that the process may have (8 to 1024) are kept, the others are opened
// again when they are read. What was evicted or exchanged meanwhile is damaged.
void hg_store_entry_close(struct hg_store_entry *entry); // accepts NULL
uint32_t hg_store_entry_blocks(const struct hg_store_entry *entry);
// Bytes of a block, 0 for one that was never written or lies beyond the last.
uint32_t hg_store_entry_size(const struct hg_store_entry *entry, uint32_t block);
uint64_t hg_store_entry_bytes(const struct hg_store_entry *entry); // of the file
// Reads a block whole and checks it; `size` must be its size. Nothing is mapped: files may shrink
// under a mapping, and mapped pages would count against no budget.
// HG_E_HASH (damaged: the entry is deleted, close and rebuild it), HG_E_INVAL (size),
// HG_E_NOMEM (for want of descriptors: try again).
enum hg_status hg_store_entry_read(struct hg_store_entry *entry, uint32_t block, void *dst,
    size_t size, struct hg_error *err) HG_MUST_CHECK;

// Begins an entry. HG_E_BUSY: another writer, maybe of another process, is at it; look again later.
// HG_E_PERM, HG_E_NOSPACE, HG_E_IO (the folder cannot be written), HG_E_NOMEM.
enum hg_status hg_store_begin(struct hg_store *store, const struct hg_store_key *key,
    struct hg_store_writer **out, struct hg_error *err) HG_MUST_CHECK;
// Adds block number `block`, once each, in any order. HG_E_INVAL (twice, too large), HG_E_LIMIT
// (the entry alone is larger than the store may be), HG_E_NOSPACE, HG_E_IO, HG_E_NOMEM.
enum hg_status hg_store_write(struct hg_store_writer *writer, uint32_t block, const void *data,
    size_t size, struct hg_error *err) HG_MUST_CHECK;
// What the entry is made from, for people who look into the cache; cut to fit.
void hg_store_label(struct hg_store_writer *writer, const char *format, ...)
    __attribute__((format(printf, 2, 3)));
// Publishes the entry, and evicts others beyond the limit. Ends the writer either way.
enum hg_status hg_store_commit(struct hg_store_writer *writer, struct hg_error *err) HG_MUST_CHECK;
void hg_store_abort(struct hg_store_writer *writer); // accepts NULL

// --- looking after a cache folder, beside the programs that use it
// ---------------------------------

struct hg_store_info {
    struct hg_store_key key;
    uint64_t bytes;
    int64_t used_s;  // last use, seconds since 1970
    uint32_t blocks; // 0 when it is damaged
    bool is_open;    // a process has it open
    bool is_damaged; // its table is; blocks are not looked at
    char label[HG_STORE_LABEL_BYTES];
};

// All entries, the one used longest ago first; *out is freed with hg_free. Changes nothing.
// HG_E_NOTFOUND (no such folder), HG_E_NOMEM.
enum hg_status hg_store_list(
    const char *dir, struct hg_store_info **out, size_t *count, struct hg_error *err) HG_MUST_CHECK;
// Reads all blocks of an entry. HG_E_HASH: it was damaged and is deleted. HG_E_NOTFOUND,
// HG_E_NOMEM.
enum hg_status hg_store_verify(
    const char *dir, const struct hg_store_key *key, struct hg_error *err) HG_MUST_CHECK;
// Deletes all entries that are not open, and leftovers of dead writers. HG_E_NOTFOUND, HG_E_NOMEM.
enum hg_status hg_store_clear(
    const char *dir, uint32_t *entries, uint64_t *bytes, struct hg_error *err) HG_MUST_CHECK;

#endif
