// internal.h - what the files of this room share. Floor 1, private to base/store.
//
// A file: head | blocks | table | tail, all numbers little-endian.
//   head   64 bytes   magic, version, key, zeroes
//   table  20 bytes per block: u64 offset, u64 checksum, u32 size
//   label  up to 200 bytes of text
//   tail   40 bytes   u64 offset of the table, u32 blocks, u32 bytes of the label, u32 magic, u32
//   0,
//                     u64 size of the file, u64 checksum of head, table, label and the tail up to
//                     here
#ifndef HG_BASE_STORE_INTERNAL_H
#define HG_BASE_STORE_INTERNAL_H

#include <pthread.h>
#include <sys/stat.h>

#include "base/store/store.h"

#define HG_STORE_ENTRY_SUFFIX ".hgs"
#define HG_STORE_TEMP_SUFFIX  ".tmp"

enum {
    HG_STORE_MAGIC = 0x54534748, // "HGST"
    HG_STORE_VERSION = 2,
    HG_STORE_HEAD = 64,
    HG_STORE_ROW = 20,
    HG_STORE_TAIL = 40,
};

struct hg_store {
    char *dir;
    uint64_t limit_bytes;
    pthread_mutex_t lock; // of what follows
    struct hg_store_stats stats;
    struct hg_store_entry *newest, *oldest; // whose files are open, by their last use
    uint32_t open, open_most;               // files; more only while more are read at once
};

struct hg_store_block {
    uint64_t offset, checksum;
    uint32_t size;
};

// What an entry is opened for: using it notes the time and, like checking it, deletes what is
// damaged; looking does neither.
enum hg_store_purpose { HG_STORE_USE, HG_STORE_CHECK, HG_STORE_LOOK };
// HG_E_NOTFOUND (absent), HG_E_HASH (damaged), HG_E_NOMEM. Counts nothing but damage.
enum hg_status hg_store_entry_open(struct hg_store *store, const struct hg_store_key *key,
    enum hg_store_purpose purpose, struct hg_store_entry **out) HG_MUST_CHECK;
const char *hg_store_entry_label(const struct hg_store_entry *entry);

void hg_store_make_head(const struct hg_store_key *key, uint8_t head[HG_STORE_HEAD]);
// Paths, freed with hg_free; NULL without memory.
char *hg_store_entry_path(const struct hg_store *store, const struct hg_store_key *key);
char *hg_store_temp_path(const struct hg_store *store, const struct hg_store_key *key);
// Creates the folder and the one above it. False when there is none afterwards.
bool hg_store_make_folder(const char *dir);
// Whether `path` still names the open file.
bool hg_store_is_same_file(const char *path, int fd);
// Removes stale temporary files, and the entries used longest ago until `more` bytes beyond those
// that are there fit into the limit; at least `at_least` bytes where there are as many.
void hg_store_evict(struct hg_store *store, uint64_t more, uint64_t at_least);
void hg_store_count(struct hg_store *store, uint64_t *counter, uint64_t amount);

#endif
