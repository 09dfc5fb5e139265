// writer.c - making entries: a temporary file that only its living writer can lock.
#include <errno.h>
#include <fcntl.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>
#include <sys/file.h>
#include <unistd.h>

#include "base/alloc.h"
#include "base/bytes.h"
#include "base/file.h"
#include "base/store/checksum.h"
#include "base/store/internal.h"

#define LIMIT_STEP_BYTES (32u << 20) // written between two looks at the limit
#define ROOM_BYTES       (64u << 20) // made when the disk is full

struct hg_store_writer {
    struct hg_store *store;
    struct hg_store_key key;
    char *path, *temp_path;
    int fd;
    uint64_t offset, checked; // bytes written, and when the limit was last looked at
    struct hg_store_block *blocks;
    size_t capacity;
    uint32_t count;
    char label[HG_STORE_LABEL_BYTES];
};

void hg_store_make_head(const struct hg_store_key *key, uint8_t head[HG_STORE_HEAD])
{
    memset(head, 0, HG_STORE_HEAD);
    const uint32_t words[2] = {HG_STORE_MAGIC, HG_STORE_VERSION};
    for (int i = 0; i < 8; i++)
        head[i] = (uint8_t)(words[i / 4] >> i % 4 * 8);
    memcpy(head + 8, key->hash, sizeof key->hash);
}

static enum hg_status fail_errno(
    struct hg_store_writer *w, const char *action, struct hg_error *err)
{
    const int e = errno;
    const enum hg_status status = hg_status_from_errno(e);
    return hg_error_set(err, status == HG_E_NOTFOUND ? HG_E_IO : status, w->temp_path, NULL,
        "%s: %s", action, strerror(e));
}

// --- the temporary file --------------------------------------------------------------------------

// One try: HG_E_AGAIN when the name was taken by a dead writer's file, which is gone now.
static enum hg_status take_temp(struct hg_store_writer *w, struct hg_error *err)
{
    w->fd = open(w->temp_path, O_RDWR | O_CREAT | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK, 0666);
    if (w->fd < 0)
        return fail_errno(w, "cannot create", err);
    struct stat st;
    enum hg_status status = HG_OK;
    if (flock(w->fd, LOCK_EX | LOCK_NB) != 0)
        status = errno == EWOULDBLOCK
                     ? hg_error_set(err, HG_E_BUSY, w->temp_path, NULL, "is being written")
                     : fail_errno(w, "cannot lock", err);
    else if (!hg_store_is_same_file(w->temp_path, w->fd) || fstat(w->fd, &st) != 0)
        status = HG_E_AGAIN;
    else if (st.st_size > 0) {
        unlink(w->temp_path);
        status = HG_E_AGAIN;
    }
    if (status != HG_OK) {
        close(w->fd);
        w->fd = -1;
    }
    return status;
}

static enum hg_status open_temp(struct hg_store_writer *w, struct hg_error *err)
{
    enum hg_status status = HG_E_AGAIN;
    for (int tries = 0; tries < 100 && status == HG_E_AGAIN; tries++)
        status = take_temp(w, err);
    return status == HG_E_AGAIN
               ? hg_error_set(err, HG_E_BUSY, w->temp_path, NULL, "is taken again and again")
               : status;
}

static bool write_all(int fd, uint64_t offset, const void *data, size_t size)
{
    for (size_t done = 0; done < size;) {
        const ssize_t n =
            pwrite(fd, (const uint8_t *)data + done, size - done, (off_t)(offset + done));
        if (n < 0 && errno == EINTR)
            continue;
        if (n < 0)
            return false;
        done += (size_t)n;
    }
    return true;
}

// A full disk is answered by evicting once.
static enum hg_status append(
    struct hg_store_writer *w, const void *data, size_t size, struct hg_error *err)
{
    bool written = write_all(w->fd, w->offset, data, size);
    if (!written && (errno == ENOSPC || errno == EDQUOT)) {
        hg_store_evict(w->store, 0, ROOM_BYTES);
        written = write_all(w->fd, w->offset, data, size);
    }
    if (!written)
        return fail_errno(w, "cannot write", err);
    w->offset += size;
    return HG_OK;
}

enum hg_status hg_store_begin(struct hg_store *store, const struct hg_store_key *key,
    struct hg_store_writer **out, struct hg_error *err)
{
    *out = NULL;
    struct hg_store_writer *w = hg_calloc(1, sizeof *w);
    if (w != NULL) {
        *w = (struct hg_store_writer){.store = store, .key = *key, .fd = -1};
        w->path = hg_store_entry_path(store, key);
        w->temp_path = hg_store_temp_path(store, key);
    }
    if (w == NULL || w->path == NULL || w->temp_path == NULL) {
        hg_store_abort(w);
        return hg_error_set(err, HG_E_NOMEM, "cache", NULL, "no memory");
    }
    hg_store_make_folder(store->dir);
    uint8_t head[HG_STORE_HEAD];
    hg_store_make_head(key, head);
    enum hg_status status = open_temp(w, err);
    if (status == HG_OK)
        status = append(w, head, sizeof head, err);
    if (status != HG_OK) {
        hg_store_abort(w);
        return status;
    }
    *out = w;
    return HG_OK;
}

// --- blocks --------------------------------------------------------------------------------------

static enum hg_status reserve_row(struct hg_store_writer *w, uint32_t block, struct hg_error *err)
{
    if (block < w->count && w->blocks[block].size > 0)
        return hg_error_set(err, HG_E_INVAL, w->temp_path, NULL, "block %u is there", block);
    if (block >= w->count) {
        if (hg_grow(&w->blocks, &w->capacity, (size_t)block + 1, sizeof *w->blocks) != HG_OK)
            return hg_error_set(err, HG_E_NOMEM, w->temp_path, NULL, "no memory");
        memset(w->blocks + w->count, 0, (block + 1 - w->count) * sizeof *w->blocks);
        w->count = block + 1;
    }
    return HG_OK;
}

enum hg_status hg_store_write(
    struct hg_store_writer *w, uint32_t block, const void *data, size_t size, struct hg_error *err)
{
    if (size == 0 || size > HG_STORE_BLOCK_BYTES_MAX || block >= HG_STORE_BLOCKS_MAX)
        return hg_error_set(
            err, HG_E_INVAL, w->temp_path, NULL, "block %u of %zu bytes", block, size);
    const uint64_t limit = w->store->limit_bytes;
    if (limit > 0 && w->offset + size > limit)
        return hg_error_set(err, HG_E_LIMIT, w->temp_path, NULL,
            "more than the cache may hold (%llu bytes)", (unsigned long long)limit);
    if (limit > 0 && w->offset + size - w->checked > LIMIT_STEP_BYTES) {
        w->checked = w->offset;
        hg_store_evict(w->store, size, 0);
    }
    enum hg_status status = reserve_row(w, block, err);
    if (status != HG_OK)
        return status;
    const uint64_t offset = w->offset;
    status = append(w, data, size, err);
    if (status == HG_OK)
        w->blocks[block] = (struct hg_store_block){.offset = offset,
            .checksum = hg_store_checksum(data, size, block),
            .size = (uint32_t)size};
    return status;
}

void hg_store_label(struct hg_store_writer *w, const char *format, ...)
{
    va_list list;
    va_start(list, format);
    vsnprintf(w->label, sizeof w->label, format, list);
    va_end(list);
}

// --- the end -------------------------------------------------------------------------------------

static enum hg_status write_end(struct hg_store_writer *w, struct hg_error *err)
{
    struct hg_writer out = {0};
    for (uint32_t i = 0; i < w->count; i++) {
        hg_write_u64(&out, w->blocks[i].offset);
        hg_write_u64(&out, w->blocks[i].checksum);
        hg_write_u32(&out, w->blocks[i].size);
    }
    hg_write_bytes(&out, w->label, strlen(w->label));
    const size_t rows = out.size;
    hg_write_u64(&out, w->offset);
    hg_write_u32(&out, w->count);
    hg_write_u32(&out, (uint32_t)strlen(w->label));
    hg_write_u32(&out, HG_STORE_MAGIC);
    hg_write_u32(&out, 0);
    hg_write_u64(&out, w->offset + rows + HG_STORE_TAIL);
    enum hg_status status = HG_E_NOMEM;
    if (!out.failed) {
        uint8_t head[HG_STORE_HEAD];
        hg_store_make_head(&w->key, head);
        uint64_t sum = hg_store_checksum(head, sizeof head, 0);
        sum = hg_store_checksum(out.data, rows, sum);
        hg_write_u64(&out, hg_store_checksum(out.data + rows, HG_STORE_TAIL - 8, sum));
    }
    if (!out.failed)
        status = append(w, out.data, out.size, err);
    else
        hg_error_set(err, status, w->temp_path, NULL, "no memory");
    hg_writer_finish(&out);
    return status;
}

static void sync_folder(const char *dir)
{
    const int fd = open(dir, O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    if (fd < 0)
        return;
    fsync(fd);
    close(fd);
}

static enum hg_status publish(struct hg_store_writer *w, struct hg_error *err)
{
    if (fsync(w->fd) != 0)
        return fail_errno(w, "cannot sync", err);
    if (!hg_store_is_same_file(w->temp_path, w->fd))
        return hg_error_set(err, HG_E_IO, w->temp_path, NULL, "was removed while it was written");
    if (rename(w->temp_path, w->path) != 0)
        return fail_errno(w, "cannot rename into place", err);
    sync_folder(w->store->dir);
    w->temp_path[0] = 0;
    return HG_OK;
}

enum hg_status hg_store_commit(struct hg_store_writer *w, struct hg_error *err)
{
    struct hg_store *store = w->store;
    enum hg_status status = write_end(w, err);
    if (status == HG_OK)
        status = publish(w, err);
    if (status == HG_OK) {
        pthread_mutex_lock(&store->lock);
        store->stats.written++;
        store->stats.bytes_written += w->offset;
        store->stats.bytes += w->offset;
        pthread_mutex_unlock(&store->lock);
        if (store->limit_bytes > 0) // our lock on the new file keeps it
            hg_store_evict(store, 0, 0);
    }
    hg_store_abort(w);
    return status;
}

void hg_store_abort(struct hg_store_writer *w)
{
    if (w == NULL)
        return;
    if (w->fd >= 0 && w->temp_path[0] != 0 && hg_store_is_same_file(w->temp_path, w->fd))
        unlink(w->temp_path);
    if (w->fd >= 0)
        close(w->fd);
    hg_free(w->blocks);
    hg_free(w->path);
    hg_free(w->temp_path);
    hg_free(w);
}
