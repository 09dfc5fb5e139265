#include "server/broker/storage/upload_store.h"

#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "base/alloc.h"
#include "base/clock.h"
#include "base/file.h"
#include "base/log.h"
#include "server/broker/storage/folder_lock.h"

enum {
    BUCKETS = 65536,
    BLOCK_BYTES = 4096,
    RETRY_MS = 10000 // until others may have ended
};

struct content {
    struct content *chain;           // of its bucket
    struct content *older, *newer;   // those that may be evicted, by their last use
    struct hg_upload_owner **owners; // [owner_count] who has sent all of it
    size_t owner_count, owner_capacity;
    uint8_t hash[32];
    uint64_t size, used_ns; // used_ns 0: by an earlier run
    uint32_t pins;
    uint32_t drops; // how often it was dropped while it was pinned
    bool present;
};

struct hg_upload_owner {
    struct hg_upload_owner *next;
    struct hg_upload_place place;
    struct hg_upload_usage usage, quota;
    uint64_t pinned; // of usage.bytes, contents in use
    bool tried;      // to make room from it
};

struct hg_upload_store {
    struct hg_upload_folder folder;
    struct hg_disk_queue *queue; // does all that is done in the folder once the store is there
    struct hg_upload_news news;
    uint64_t limit_bytes, bytes; // with what came of uploads under way
    struct content *buckets[BUCKETS];
    struct content *oldest, *newest;
    struct hg_upload_owner *owners;
    uint32_t next_name;
};

// A file that goes.
struct removal {
    struct hg_disk_job job;
    struct hg_upload_store *store;
    const struct hg_upload_owner *owner; // whose link to it; NULL: the content
    uint8_t hash[32];
};

// What a tenant has used within this time is not given up for another one that has as much.
static const uint64_t recent_ns = 3600000000000;

// On the disk: whole blocks, and one for the file itself.
static uint64_t disk_bytes(uint64_t size)
{
    return (size + 2 * BLOCK_BYTES - 1) / BLOCK_BYTES * BLOCK_BYTES;
}

static enum hg_status fail_errno(struct hg_error *err, const char *path, const char *action)
{
    int e = errno;
    return hg_error_set(
        err, hg_status_from_errno(e), path, NULL, "cannot %s: %s", action, strerror(e));
}

// ---- files that go ------------------------------------------------------------------------------

static void run_removal(struct hg_disk_job *job)
{
    struct removal *r = (struct removal *)job;
    hg_upload_folder_unlink(&r->store->folder, r->owner ? &r->owner->place : NULL, r->hash);
}

static void end_removal(struct hg_disk_job *job)
{
    hg_free(job);
}

// Behind all that was begun before: what is sent again comes after it.
static void remove_file(
    struct hg_upload_store *store, const struct hg_upload_owner *owner, const uint8_t hash[32])
{
    struct removal *r = hg_calloc(1, sizeof *r);
    if (!r) { // the loop waits this once
        hg_disk_queue_wait(store->queue);
        hg_upload_folder_unlink(&store->folder, owner ? &owner->place : NULL, hash);
        return;
    }
    *r = (struct removal){{.run = run_removal, .done = end_removal}, store, owner, {0}};
    memcpy(r->hash, hash, sizeof r->hash);
    hg_disk_queue_push(store->queue, &r->job);
}

// ---- index --------------------------------------------------------------------------------------

// Of a SHA-256 any bits will do; clients choose contents, not hashes.
static struct content **bucket_of(struct hg_upload_store *store, const uint8_t hash[32])
{
    return &store->buckets[hash[0] << 8 | hash[1]];
}

static struct content *find(struct hg_upload_store *store, const uint8_t hash[32])
{
    struct content *it = *bucket_of(store, hash);
    while (it && memcmp(it->hash, hash, 32) != 0)
        it = it->chain;
    return it;
}

static struct content *find_or_add(struct hg_upload_store *store, const uint8_t hash[32])
{
    struct content *content = find(store, hash);
    if (content)
        return content;
    content = hg_calloc(1, sizeof *content);
    if (!content)
        return NULL;
    memcpy(content->hash, hash, 32);
    content->chain = *bucket_of(store, hash);
    *bucket_of(store, hash) = content;
    return content;
}

// ---- eviction -----------------------------------------------------------------------------------

static bool is_listed(const struct hg_upload_store *store, const struct content *content)
{
    return content->older || content->newer || store->oldest == content;
}

static void unlist(struct hg_upload_store *store, struct content *content)
{
    if (!is_listed(store, content))
        return;
    *(content->older ? &content->older->newer : &store->oldest) = content->newer;
    *(content->newer ? &content->newer->older : &store->newest) = content->older;
    content->older = content->newer = NULL;
}

// It was used now. What is pinned or not there is not listed.
static void touch(struct hg_upload_store *store, struct content *content)
{
    unlist(store, content);
    content->used_ns = hg_clock_now_ns();
    if (content->pins || !content->present)
        return;
    content->older = store->newest;
    *(store->newest ? &store->newest->newer : &store->oldest) = content;
    store->newest = content;
}

static void remove_if_unused(struct hg_upload_store *store, struct content *content)
{
    if (content->pins || content->present)
        return;
    struct content **link = bucket_of(store, content->hash);
    while (*link != content)
        link = &(*link)->chain;
    *link = content->chain;
    hg_free(content->owners);
    hg_free(content);
}

static bool is_owned_by(const struct content *content, const struct hg_upload_owner *owner)
{
    for (size_t i = 0; i < content->owner_count; i++)
        if (content->owners[i] == owner)
            return true;
    return false;
}

static enum hg_status add_owner(struct content *content, struct hg_upload_owner *owner)
{
    if (hg_grow(&content->owners, &content->owner_capacity, content->owner_count + 1,
            sizeof(struct hg_upload_owner *)))
        return HG_E_NOMEM;
    content->owners[content->owner_count++] = owner;
    owner->usage.bytes += disk_bytes(content->size);
    owner->usage.files++;
    owner->pinned += content->pins ? disk_bytes(content->size) : 0;
    return HG_OK;
}

static void disown(struct hg_upload_store *store, struct content *content, size_t i)
{
    struct hg_upload_owner *owner = content->owners[i];
    remove_file(store, owner, content->hash);
    owner->usage.bytes -= disk_bytes(content->size);
    owner->usage.files--;
    owner->pinned -= content->pins ? disk_bytes(content->size) : 0;
    content->owners[i] = content->owners[--content->owner_count];
}

// Removes the file; the record stays while it is pinned.
static void drop(struct hg_upload_store *store, struct content *content)
{
    if (content->present)
        remove_file(store, NULL, content->hash);
    content->drops += content->pins > 0;
    unlist(store, content);
    if (content->present)
        store->bytes -= disk_bytes(content->size);
    while (content->owner_count)
        disown(store, content, content->owner_count - 1);
    content->present = false;
    remove_if_unused(store, content);
}

// ---- owners -------------------------------------------------------------------------------------

struct hg_upload_owner *hg_upload_store_owner(struct hg_upload_store *store, const uint8_t key[32])
{
    struct hg_upload_owner *owner = store->owners;
    while (owner && memcmp(owner->place.key, key, HG_UPLOAD_KEY_DIGITS / 2) != 0)
        owner = owner->next;
    if (owner)
        return owner;
    owner = hg_calloc(1, sizeof *owner);
    if (!owner)
        return NULL;
    memcpy(owner->place.key, key, 32);
    owner->next = store->owners;
    store->owners = owner;
    return owner;
}

enum hg_status hg_upload_owner_move(struct hg_upload_store *store, struct hg_upload_owner *owner,
    const char *folder, struct hg_error *err)
{
    return hg_upload_folder_move(&store->folder, &owner->place, folder, err);
}

const struct hg_upload_place *hg_upload_owner_place(const struct hg_upload_owner *owner)
{
    return &owner->place;
}

struct hg_upload_usage hg_upload_owner_usage(const struct hg_upload_owner *owner)
{
    return owner->usage;
}

void hg_upload_owner_set_quota(struct hg_upload_owner *owner, const struct hg_upload_usage *quota)
{
    owner->quota = *quota;
}

static bool is_above_quota(const struct hg_upload_owner *owner, uint64_t bytes, uint64_t files)
{
    return owner->usage.bytes + bytes > owner->quota.bytes ||
           owner->usage.files + files > owner->quota.files;
}

// It is not this owner's any more, and goes when it is nobody's.
static void give_up(
    struct hg_upload_store *store, struct content *content, const struct hg_upload_owner *owner)
{
    for (size_t i = 0; i < content->owner_count; i++)
        if (content->owners[i] == owner) {
            disown(store, content, i);
            if (!content->owner_count)
                drop(store, content);
            return;
        }
}

// What an owner that gets `need` bytes more will have; `for_owner` NULL: none does.
static uint64_t wanted(
    const struct hg_upload_owner *owner, const struct hg_upload_owner *for_owner, uint64_t need)
{
    return owner->usage.bytes + (owner == for_owner ? need : 0);
}

// Of those that have more than `share` and were not tried the one that has most.
static struct hg_upload_owner *largest_owner(const struct hg_upload_store *store,
    const struct hg_upload_owner *for_owner, uint64_t need, uint64_t share)
{
    struct hg_upload_owner *largest = NULL;
    uint64_t most = share;
    for (struct hg_upload_owner *it = store->owners; it; it = it->next) {
        const uint64_t bytes = wanted(it, for_owner, need);
        if (bytes > most && !it->tried) {
            largest = it;
            most = bytes;
        }
    }
    return largest;
}

static uint64_t share_of(
    const struct hg_upload_store *store, const struct hg_upload_owner *for_owner)
{
    uint64_t count = 0;
    for (const struct hg_upload_owner *it = store->owners; it; it = it->next)
        count += it->usage.files > 0 || it == for_owner;
    return store->limit_bytes / (count ? count : 1);
}

// Those that have more than an equal share lose what they used longest ago, the largest first; then
// goes what is nobody's, or was not used for long.
static bool make_room(
    struct hg_upload_store *store, const struct hg_upload_owner *for_owner, uint64_t need)
{
    if (need > store->limit_bytes)
        return false;
    const uint64_t most = store->limit_bytes - need, share = share_of(store, for_owner);
    struct hg_upload_owner *owner;
    for (struct hg_upload_owner *it = store->owners; it; it = it->next)
        it->tried = false;
    while (store->bytes > most && (owner = largest_owner(store, for_owner, need, share)) != NULL) {
        owner->tried = true;
        for (struct content *it = store->oldest, *newer;
             it && store->bytes > most && wanted(owner, for_owner, need) > share; it = newer) {
            newer = it->newer;
            give_up(store, it, owner);
        }
    }
    const uint64_t now_ns = hg_clock_now_ns();
    for (struct content *it = store->oldest, *newer; it && store->bytes > most; it = newer) {
        newer = it->newer;
        if (!it->owner_count || !it->used_ns || now_ns - it->used_ns > recent_ns)
            drop(store, it);
    }
    return store->bytes <= most;
}

// Room for so much more of an owner, in its quota and in the store.
static enum hg_status reserve(struct hg_upload_store *store, struct hg_upload_owner *owner,
    uint64_t bytes, uint64_t files, struct hg_error *err)
{
    for (struct content *it = store->oldest, *newer; it && is_above_quota(owner, bytes, files);
         it = newer) {
        newer = it->newer;
        give_up(store, it, owner);
    }
    if (is_above_quota(owner, bytes, files)) {
        hg_error_set(err, HG_E_LIMIT, "upload", "total",
            "uploads that are in use or under way take %llu of the %llu MiB (max-upload) and %llu "
            "of the %llu files (max-upload-files) of this tenant's quota",
            (unsigned long long)(owner->usage.bytes >> 20),
            (unsigned long long)(owner->quota.bytes >> 20), (unsigned long long)owner->usage.files,
            (unsigned long long)owner->quota.files);
        return hg_error_limit(
            err, is_above_quota(owner, bytes, 0) ? "max-upload" : "max-upload-files", RETRY_MS);
    }
    if (!make_room(store, owner, bytes)) {
        hg_error_set(err, HG_E_LIMIT, "upload", "total",
            "the upload store of %llu MiB (upload-store) is full of what is in use, or of other "
            "tenants' parts; this one has %llu MiB of it",
            (unsigned long long)(store->limit_bytes >> 20),
            (unsigned long long)(owner->usage.bytes >> 20));
        return hg_error_limit(err, "upload-store", RETRY_MS);
    }
    store->bytes += bytes;
    owner->usage.bytes += bytes;
    owner->usage.files += files;
    return HG_OK;
}

// ---- folder -------------------------------------------------------------------------------------

// A link in the folder of an owner, below that of all contents. One without its content is removed.
static enum hg_status index_link(struct hg_upload_store *store, struct hg_upload_owner *owner,
    int above, int folder, const char *name)
{
    uint8_t hash[32];
    struct stat st;
    if (!hg_sha256_parse(name, 32, hash))
        return HG_OK;
    if (fstatat(above, name, &st, AT_SYMLINK_NOFOLLOW) != 0)
        return unlinkat(folder, name, 0) == 0 ? HG_OK : HG_E_IO;
    struct content *content = find_or_add(store, hash);
    if (!content)
        return HG_E_NOMEM;
    content->size = (uint64_t)st.st_size;
    return is_owned_by(content, owner) ? HG_OK : add_owner(content, owner);
}

static enum hg_status index_owner(
    struct hg_upload_store *store, int above, struct hg_upload_owner *owner)
{
    char path[HG_UPLOAD_PATH];
    DIR *dir = opendir(hg_upload_folder_place(&store->folder, &owner->place, path));
    enum hg_status status = dir ? HG_OK : HG_E_NOMEM;
    for (struct dirent *it; !status && (it = readdir(dir));)
        status = index_link(store, owner, above, dirfd(dir), it->d_name);
    if (dir)
        closedir(dir);
    return status;
}

static enum hg_status index_entry(struct hg_upload_store *store, DIR *dir, const char *name)
{
    struct stat st;
    uint8_t hash[32];
    if (strncmp(name, ".incoming.", 10) == 0)
        return unlinkat(dirfd(dir), name, 0) == 0 ? HG_OK : HG_E_IO;
    if (hg_sha256_parse(name, HG_UPLOAD_KEY_DIGITS / 2, hash)) {
        struct hg_upload_owner *owner = hg_upload_store_owner(store, hash);
        return owner ? index_owner(store, dirfd(dir), owner) : HG_E_NOMEM;
    }
    if (!hg_sha256_parse(name, 32, hash) ||
        fstatat(dirfd(dir), name, &st, AT_SYMLINK_NOFOLLOW) != 0 || !S_ISREG(st.st_mode))
        return HG_OK;
    struct content *content = find_or_add(store, hash);
    if (!content)
        return HG_E_NOMEM;
    content->present = true;
    content->size = (uint64_t)st.st_size;
    store->bytes += disk_bytes(content->size);
    touch(store, content);
    content->used_ns = 0;
    return HG_OK;
}

static enum hg_status index_folder(struct hg_upload_store *store, struct hg_error *err)
{
    DIR *dir = opendir(store->folder.path);
    if (!dir)
        return fail_errno(err, store->folder.path, "open the folder");
    enum hg_status status = HG_OK;
    for (struct dirent *entry; !status && (entry = readdir(dir));)
        status = index_entry(store, dir, entry->d_name);
    closedir(dir);
    if (status)
        hg_error_set(err, status, store->folder.path, NULL, "cannot index the uploads");
    return status;
}

enum hg_status hg_upload_owner_find(struct hg_upload_store *store, struct hg_upload_owner *owner,
    const char *folder, struct hg_error *err)
{
    DIR *above = opendir(store->folder.path);
    char *moved = hg_strdup(folder);
    enum hg_status status = above && moved ? HG_OK : HG_E_NOMEM;
    if (!status) {
        hg_upload_folder_moved(&store->folder, &owner->place, moved);
        moved = NULL;
        status = index_owner(store, dirfd(above), owner);
    }
    hg_free(moved);
    if (above)
        closedir(above);
    return status ? hg_error_set(err, status, folder, NULL, "cannot index the uploads") : HG_OK;
}

enum hg_status hg_upload_store_create(
    const char *folder, uint64_t limit_bytes, struct hg_upload_store **out, struct hg_error *err)
{
    *out = NULL;
    struct hg_upload_store *store = hg_calloc(1, sizeof *store);
    if (store) {
        store->folder.path = hg_strdup(folder);
        pthread_mutex_init(&store->folder.lock, NULL);
    }
    enum hg_status status = store && store->folder.path ? hg_folder_make(folder, err) : HG_E_NOMEM;
    if (!status && access(folder, W_OK | X_OK) != 0)
        status = fail_errno(err, folder, "write to the folder");
    if (!status)
        status = index_folder(store, err);
    if (!status && (status = hg_disk_queue_create(&store->queue)) != HG_OK)
        hg_error_set(err, status, folder, NULL, "cannot start a thread for uploads");
    if (status) {
        hg_upload_store_destroy(store);
        return status;
    }
    store->limit_bytes = limit_bytes;
    *out = store;
    return HG_OK;
}

void hg_upload_store_destroy(struct hg_upload_store *store)
{
    if (!store)
        return;
    hg_disk_queue_destroy(store->queue);
    for (size_t i = 0; i < BUCKETS; i++)
        while (store->buckets[i]) {
            struct content *content = store->buckets[i];
            store->buckets[i] = content->chain;
            hg_free(content->owners);
            hg_free(content);
        }
    while (store->owners) {
        struct hg_upload_owner *owner = store->owners;
        store->owners = owner->next;
        hg_free(owner->place.moved);
        hg_free(owner);
    }
    hg_free(store->folder.path);
    pthread_mutex_destroy(&store->folder.lock);
    hg_free(store);
}

void hg_upload_store_set_limit(struct hg_upload_store *store, uint64_t limit_bytes)
{
    store->limit_bytes = limit_bytes;
    if (!make_room(store, NULL, 0))
        hg_warn(SESSION, "scenes in use hold more uploads than upload-store allows");
}

uint64_t hg_upload_store_bytes(const struct hg_upload_store *store)
{
    return store->bytes;
}

bool hg_upload_store_has(
    struct hg_upload_store *store, const struct hg_upload_owner *owner, const uint8_t hash[32])
{
    struct content *content = find(store, hash);
    if (!content || !content->present || (owner && !is_owned_by(content, owner)))
        return false;
    touch(store, content);
    return true;
}

enum hg_status hg_upload_store_pin(struct hg_upload_store *store, const uint8_t hash[32])
{
    struct content *content = find_or_add(store, hash);
    if (!content)
        return HG_E_NOMEM;
    if (!content->pins++)
        for (size_t i = 0; i < content->owner_count; i++)
            content->owners[i]->pinned += disk_bytes(content->size);
    unlist(store, content);
    return HG_OK;
}

void hg_upload_store_unpin(struct hg_upload_store *store, const uint8_t hash[32])
{
    struct content *content = find(store, hash);
    if (!content || !content->pins || --content->pins)
        return;
    for (size_t i = 0; i < content->owner_count; i++)
        content->owners[i]->pinned -= disk_bytes(content->size);
    touch(store, content);
    remove_if_unused(store, content);
}

uint64_t hg_upload_store_pin_bytes(struct hg_upload_store *store, const uint8_t hash[32])
{
    const struct content *content = find(store, hash);
    return content && content->present && !content->pins ? disk_bytes(content->size) : 0;
}

uint64_t hg_upload_owner_pin_room(
    const struct hg_upload_store *store, const struct hg_upload_owner *owner)
{
    uint64_t count = 2; // itself, and one that is still to come
    for (const struct hg_upload_owner *it = store->owners; it; it = it->next)
        count += it->pinned && it != owner;
    const uint64_t share = store->limit_bytes / count;
    return share > owner->pinned ? share - owner->pinned : 0;
}

void hg_upload_store_forget(struct hg_upload_store *store, const uint8_t hash[32])
{
    struct content *content = find(store, hash);
    if (content && content->present)
        drop(store, content);
}

// ---- files that arrive --------------------------------------------------------------------------

static void give_back(struct hg_upload_store *store, const struct hg_upload_file *file)
{
    store->bytes -= disk_bytes(file->size);
    file->owner->usage.bytes -= disk_bytes(file->size);
    file->owner->usage.files--;
}

enum hg_status hg_upload_store_open(struct hg_upload_store *store, struct hg_upload_owner *owner,
    uint64_t total_bytes, struct hg_upload_file *file, struct hg_error *err)
{
    *file = (struct hg_upload_file){.owner = owner};
    if (total_bytes > store->limit_bytes) {
        hg_error_set(err, HG_E_LIMIT, "upload", "total",
            "%llu bytes do not fit into the upload store of %llu MiB (upload-store)",
            (unsigned long long)total_bytes, (unsigned long long)(store->limit_bytes >> 20));
        return hg_error_limit(err, "upload-store", 0);
    }
    enum hg_status status = reserve(store, owner, disk_bytes(0), 1, err);
    file->number = status ? 0 : ++store->next_name;
    return status;
}

enum hg_status hg_upload_store_grow(struct hg_upload_store *store, struct hg_upload_file *file,
    uint64_t bytes, struct hg_error *err)
{
    uint64_t more = disk_bytes(file->size + bytes) - disk_bytes(file->size);
    enum hg_status status = reserve(store, file->owner, more, 0, err);
    if (!status)
        file->size += bytes;
    return status;
}

enum hg_status hg_upload_store_expect(
    struct hg_upload_store *store, struct hg_upload_file *file, const uint8_t hash[32])
{
    enum hg_status status = hg_upload_store_pin(store, hash);
    file->drops = status ? 0 : find(store, hash)->drops;
    return status;
}

static void adopt(struct hg_upload_store *store, struct content *content,
    const struct hg_upload_file *file, struct hg_error *err)
{
    if (content->drops != file->drops) {
        remove_file(store, file->owner, content->hash);
        hg_error_set(err, HG_E_IO, "upload", NULL,
            "the content was removed as damaged while it was stored; send it again");
        return;
    }
    if (!content->present) {
        content->present = true;
        content->size = file->size;
        store->bytes += disk_bytes(content->size); // closing gives back the file's
    }
    if (is_owned_by(content, file->owner) || add_owner(content, file->owner) == HG_OK)
        return;
    remove_file(store, file->owner, content->hash);
    if (!content->owner_count)
        drop(store, content);
    hg_error_set(err, HG_E_NOMEM, "upload", NULL, "no memory");
}

void hg_upload_store_adopt(struct hg_upload_store *store, struct hg_upload_file *file,
    const uint8_t hash[32], struct hg_error *err)
{
    if (!err->status)
        adopt(store, find(store, hash), file, err); // which is pinned
    hg_upload_store_unpin(store, hash);
}

void hg_upload_store_close(struct hg_upload_store *store, struct hg_upload_file *file)
{
    give_back(store, file);
    *file = (struct hg_upload_file){0};
}

// ---- the disk -----------------------------------------------------------------------------------

void hg_upload_store_listen(struct hg_upload_store *store, const struct hg_upload_news *news)
{
    store->news = *news;
}

const struct hg_upload_news *hg_upload_store_news(const struct hg_upload_store *store)
{
    return &store->news;
}

struct hg_disk_queue *hg_upload_store_queue(const struct hg_upload_store *store)
{
    return store->queue;
}

struct hg_upload_folder *hg_upload_store_folder(struct hg_upload_store *store)
{
    return &store->folder;
}
