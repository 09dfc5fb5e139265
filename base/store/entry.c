// entry.c - reading entries: checksums are verified before data is used.
#include <errno.h>
#include <fcntl.h>
#include <stdatomic.h>
#include <string.h>
#include <sys/file.h>
#include <unistd.h>

#include "base/alloc.h"
#include "base/bytes.h"
#include "base/checked.h"
#include "base/log.h"
#include "base/store/checksum.h"
#include "base/store/internal.h"

struct hg_store_entry {
    struct hg_store *store;
    char *path;
    struct hg_store_entry *newer, *older; // of those whose files are open; the store's lock
    uint32_t users;                       // who must not lose the file; the store's lock
    int fd;                               // -1: closed until it is read
    dev_t device;
    ino_t inode;
    uint64_t bytes;
    uint32_t count;
    enum hg_store_purpose purpose;
    atomic_bool damaged;
    struct hg_store_block *blocks; // [count]
    char label[HG_STORE_LABEL_BYTES];
};

static bool read_at(int fd, uint64_t offset, void *dst, size_t size)
{
    for (size_t done = 0; done < size;) {
        const ssize_t n = pread(fd, (uint8_t *)dst + done, size - done, (off_t)(offset + done));
        if (n < 0 && errno == EINTR)
            continue;
        if (n <= 0)
            return false;
        done += (size_t)n;
    }
    return true;
}

// --- open files ----------------------------------------------------------------------------------

static void unlink_open(struct hg_store_entry *e)
{
    struct hg_store *s = e->store;
    *(e->newer != NULL ? &e->newer->older : &s->newest) = e->older;
    *(e->older != NULL ? &e->older->newer : &s->oldest) = e->newer;
    e->newer = e->older = NULL;
    s->open--;
}

static void link_open(struct hg_store_entry *e)
{
    struct hg_store *s = e->store;
    e->older = s->newest;
    *(s->newest != NULL ? &s->newest->newer : &s->oldest) = e;
    s->newest = e;
    s->open++;
}

// Closes files that are not being read, least recently used first, until at most `most` are open.
static void close_oldest(struct hg_store *s, uint32_t most)
{
    struct hg_store_entry *next;
    for (struct hg_store_entry *e = s->oldest; e != NULL && s->open > most; e = next) {
        next = e->newer;
        if (e->users > 0)
            continue;
        unlink_open(e);
        close(e->fd);
        e->fd = -1;
    }
}

// The lock is held. Where no descriptor is left, idle ones are given up. HG_E_NOTFOUND, HG_E_NOMEM.
static enum hg_status open_file(struct hg_store_entry *e)
{
    for (int again = 0; again < 2; again++) {
        e->fd = open(e->path, O_RDONLY | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK);
        if (e->fd >= 0)
            break;
        if (errno != EMFILE && errno != ENFILE)
            return HG_E_NOTFOUND;
        close_oldest(e->store, e->store->open / 2);
    }
    if (e->fd < 0)
        return HG_E_NOMEM;
    if (e->purpose != HG_STORE_LOOK)
        flock(e->fd, LOCK_SH | LOCK_NB); // keeps evictors away; else eviction frees only the name
    link_open(e);
    return HG_OK;
}

// Until the matching release the file stays open. HG_E_HASH: it is no longer that file.
static enum hg_status acquire(struct hg_store_entry *e)
{
    struct hg_store *s = e->store;
    enum hg_status status = HG_OK;
    struct stat st;
    pthread_mutex_lock(&s->lock);
    if (e->fd >= 0) {
        unlink_open(e);
        link_open(e);
    } else {
        status = open_file(e);
        s->stats.files_reopened += status == HG_OK;
        if (status == HG_E_NOTFOUND)
            status = HG_E_HASH;
        if (status == HG_OK && (fstat(e->fd, &st) != 0 || st.st_dev != e->device ||
                                   st.st_ino != e->inode || (uint64_t)st.st_size != e->bytes)) {
            unlink_open(e);
            close(e->fd);
            e->fd = -1;
            status = HG_E_HASH;
        }
    }
    e->users += status == HG_OK;
    close_oldest(s, s->open_most);
    pthread_mutex_unlock(&s->lock);
    return status;
}

static void release(struct hg_store_entry *e)
{
    pthread_mutex_lock(&e->store->lock);
    e->users--;
    close_oldest(e->store, e->store->open_most);
    pthread_mutex_unlock(&e->store->lock);
}

// --- tables --------------------------------------------------------------------------------------

// Rows of the table that lie where blocks lie.
static bool parse_rows(struct hg_store_entry *e, const uint8_t *table, uint64_t table_offset)
{
    struct hg_reader r = hg_reader_make(table, (size_t)e->count * HG_STORE_ROW);
    for (uint32_t i = 0; i < e->count; i++) {
        struct hg_store_block *b = &e->blocks[i];
        b->offset = hg_read_u64(&r);
        b->checksum = hg_read_u64(&r);
        b->size = hg_read_u32(&r);
        if (b->size > 0 && (b->size > HG_STORE_BLOCK_BYTES_MAX || b->offset < HG_STORE_HEAD ||
                               !hg_range_ok(b->offset, b->size, table_offset)))
            return false;
    }
    return !r.failed;
}

// HG_E_HASH: not a whole entry of this key.
static enum hg_status load_table(struct hg_store_entry *e, const struct hg_store_key *key)
{
    uint8_t head[HG_STORE_HEAD], expected[HG_STORE_HEAD], tail[HG_STORE_TAIL];
    struct stat st;
    if (fstat(e->fd, &st) != 0 || st.st_size < HG_STORE_HEAD + HG_STORE_TAIL)
        return HG_E_HASH;
    e->bytes = (uint64_t)st.st_size;
    e->device = st.st_dev;
    e->inode = st.st_ino;
    hg_store_make_head(key, expected);
    if (!read_at(e->fd, 0, head, sizeof head) || memcmp(head, expected, sizeof head) != 0 ||
        !read_at(e->fd, e->bytes - HG_STORE_TAIL, tail, sizeof tail))
        return HG_E_HASH;
    struct hg_reader r = hg_reader_make(tail, sizeof tail);
    const uint64_t offset = hg_read_u64(&r);
    e->count = hg_read_u32(&r);
    const uint32_t label = hg_read_u32(&r);
    const bool good = hg_read_u32(&r) == HG_STORE_MAGIC && hg_read_u32(&r) == 0 &&
                      hg_read_u64(&r) == e->bytes && label < sizeof e->label;
    const uint64_t checksum = hg_read_u64(&r), rows = (uint64_t)e->count * HG_STORE_ROW + label;
    if (!good || e->count > HG_STORE_BLOCKS_MAX || offset < HG_STORE_HEAD || offset > e->bytes ||
        e->bytes - offset != rows + HG_STORE_TAIL)
        return HG_E_HASH;
    uint8_t *table = hg_calloc((size_t)rows + 1, 1);
    e->blocks = hg_calloc(e->count, sizeof *e->blocks);
    enum hg_status status = table != NULL && e->blocks != NULL ? HG_OK : HG_E_NOMEM;
    if (status == HG_OK && !read_at(e->fd, offset, table, (size_t)rows))
        status = HG_E_HASH;
    if (status == HG_OK) {
        uint64_t sum = hg_store_checksum(head, sizeof head, 0);
        sum = hg_store_checksum(table, (size_t)rows, sum);
        sum = hg_store_checksum(tail, sizeof tail - 8, sum);
        status = sum == checksum && parse_rows(e, table, offset) ? HG_OK : HG_E_HASH;
        memcpy(e->label, table + rows - label, label);
    }
    hg_free(table);
    return status;
}

// Deletes the file, unless another has taken its name already.
static void drop_damaged(struct hg_store_entry *e)
{
    if (atomic_exchange(&e->damaged, true) || e->purpose == HG_STORE_LOOK)
        return;
    hg_store_count(e->store, &e->store->stats.damaged, 1);
    if (hg_store_is_same_file(e->path, e->fd)) {
        unlink(e->path);
        hg_warn(MAIN, "%s is damaged and is made again", e->path);
    }
}

void hg_store_entry_close(struct hg_store_entry *entry)
{
    if (entry == NULL)
        return;
    pthread_mutex_lock(&entry->store->lock);
    if (entry->fd >= 0) {
        unlink_open(entry);
        close(entry->fd);
    }
    pthread_mutex_unlock(&entry->store->lock);
    hg_free(entry->blocks);
    hg_free(entry->path);
    hg_free(entry);
}

static enum hg_status open_entry(struct hg_store_entry *e, const struct hg_store_key *key)
{
    pthread_mutex_lock(&e->store->lock);
    enum hg_status status = open_file(e);
    e->users += status == HG_OK;
    pthread_mutex_unlock(&e->store->lock);
    if (status != HG_OK)
        return status;
    status = load_table(e, key);
    if (status == HG_E_HASH)
        drop_damaged(e);
    if (status == HG_OK && e->purpose == HG_STORE_USE)
        futimens(e->fd, NULL); // last use; not possible in a read-only folder, which has no limit
    release(e);
    return status;
}

enum hg_status hg_store_entry_open(struct hg_store *store, const struct hg_store_key *key,
    enum hg_store_purpose purpose, struct hg_store_entry **out)
{
    *out = NULL;
    struct hg_store_entry *e = hg_calloc(1, sizeof *e);
    if (e != NULL) {
        e->store = store;
        e->fd = -1;
        e->purpose = purpose;
        e->path = hg_store_entry_path(store, key);
    }
    enum hg_status status = e != NULL && e->path != NULL ? HG_OK : HG_E_NOMEM;
    if (status == HG_OK)
        status = open_entry(e, key);
    if (status == HG_OK)
        *out = e;
    else
        hg_store_entry_close(e);
    return status;
}

enum hg_status hg_store_find(struct hg_store *store, const struct hg_store_key *key,
    struct hg_store_entry **out, struct hg_error *err)
{
    enum hg_status status = hg_store_entry_open(store, key, HG_STORE_USE, out);
    if (status == HG_E_HASH)
        status = HG_E_NOTFOUND;
    if (status == HG_OK)
        hg_store_count(store, &store->stats.found, 1);
    if (status == HG_E_NOTFOUND)
        hg_store_count(store, &store->stats.absent, 1);
    return status == HG_OK ? HG_OK
                           : hg_error_set(err, status, "cache", NULL,
                                 status == HG_E_NOMEM ? "no memory" : "not in the cache");
}

const char *hg_store_entry_label(const struct hg_store_entry *entry)
{
    return entry->label;
}

uint32_t hg_store_entry_blocks(const struct hg_store_entry *entry)
{
    return entry->count;
}

uint32_t hg_store_entry_size(const struct hg_store_entry *entry, uint32_t block)
{
    return block < entry->count ? entry->blocks[block].size : 0;
}

uint64_t hg_store_entry_bytes(const struct hg_store_entry *entry)
{
    return entry->bytes;
}

enum hg_status hg_store_entry_read(
    struct hg_store_entry *entry, uint32_t block, void *dst, size_t size, struct hg_error *err)
{
    if (size == 0 || size != hg_store_entry_size(entry, block)) {
        memset(dst, 0, size);
        return hg_error_set(err, HG_E_INVAL, entry->path, NULL, "block %u has %u bytes", block,
            hg_store_entry_size(entry, block));
    }
    const struct hg_store_block *b = &entry->blocks[block];
    const enum hg_status opened = acquire(entry);
    const bool good = opened == HG_OK && read_at(entry->fd, b->offset, dst, size) &&
                      hg_store_checksum(dst, size, block) == b->checksum;
    if (!good)
        memset(dst, 0, size);
    if (!good && opened == HG_OK)
        drop_damaged(entry);
    if (opened == HG_OK)
        release(entry);
    if (good)
        hg_store_count(entry->store, &entry->store->stats.bytes_read, size);
    if (opened == HG_E_NOMEM)
        return hg_error_set(err, HG_E_NOMEM, entry->path, NULL, "no file descriptor is left");
    return good ? HG_OK
                : hg_error_set(err, HG_E_HASH, entry->path, NULL,
                      opened == HG_OK ? "block %u is damaged" : "block %u is gone", block);
}
