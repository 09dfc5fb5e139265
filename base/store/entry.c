// entry.c - reading entries: nothing is believed before its checksum fits.
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
    int fd;
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
        hg_warn(MAIN, "%s is damaged and is made anew", e->path);
    }
}

void hg_store_entry_close(struct hg_store_entry *entry)
{
    if (entry == NULL)
        return;
    if (entry->fd >= 0)
        close(entry->fd);
    hg_free(entry->blocks);
    hg_free(entry->path);
    hg_free(entry);
}

static enum hg_status open_entry(struct hg_store_entry *e, const struct hg_store_key *key)
{
    e->fd = open(e->path, O_RDONLY | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK);
    if (e->fd < 0)
        return HG_E_NOTFOUND;
    if (e->purpose != HG_STORE_LOOK)
        flock(e->fd, LOCK_SH | LOCK_NB); // keeps evictors away; else eviction frees only the name
    const enum hg_status status = load_table(e, key);
    if (status == HG_E_HASH)
        drop_damaged(e);
    if (status == HG_OK && e->purpose == HG_STORE_USE)
        futimens(e->fd, NULL); // last use; not possible in a read-only folder, which has no limit
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
    if (read_at(entry->fd, b->offset, dst, size) &&
        hg_store_checksum(dst, size, block) == b->checksum) {
        hg_store_count(entry->store, &entry->store->stats.bytes_read, size);
        return HG_OK;
    }
    memset(dst, 0, size);
    drop_damaged(entry);
    return hg_error_set(err, HG_E_HASH, entry->path, NULL, "block %u is damaged", block);
}
