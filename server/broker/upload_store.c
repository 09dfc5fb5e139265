#include "server/broker/upload_store.h"

#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "base/alloc.h"
#include "base/checked.h"
#include "base/clock.h"
#include "base/file.h"
#include "base/log.h"
#include "base/sha256.h"

enum { BUCKETS = 65536, BLOCK_BYTES = 4096, KEY_DIGITS = 32 };

struct content {
    struct content *chain;           // of its bucket
    struct content *older, *newer;   // those that may be evicted, by their last use
    struct hg_upload_owner **owners; // [owner_count] who has sent all of it
    size_t owner_count, owner_capacity;
    uint8_t hash[32];
    uint64_t size;
    uint32_t pins;
    bool present;
};

struct hg_upload_owner {
    struct hg_upload_owner *next;
    uint8_t key[32];
    char *moved; // where its folder is; NULL = in that of the store
    struct hg_upload_usage usage, quota;
};

struct hg_upload_store {
    char *folder;
    uint64_t limit_bytes, bytes; // with what came of uploads under way
    struct content *buckets[BUCKETS];
    struct content *oldest, *newest;
    struct hg_upload_owner *owners;
    uint32_t next_name;
};

struct hg_upload {
    struct hg_upload_store *store;
    struct hg_upload_owner *owner;
    struct hg_sha256 *hasher;
    uint8_t hash[32];
    uint64_t total, offset;
    uint64_t charged;     // bytes that there is room for
    uint64_t progress_ns; // when it began, or the last piece came
    int fd;
    char *path;
};

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

// Caller frees. NULL: no memory.
static char *content_path(const struct hg_upload_store *store, const uint8_t hash[32])
{
    char hex[HG_SHA256_HEX];
    hg_sha256_hex(hash, hex);
    size_t size = strlen(store->folder) + sizeof hex + 1;
    char *path = hg_calloc(size, 1);
    if (path)
        snprintf(path, size, "%s/%s", store->folder, hex);
    return path;
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

// An owner has a folder with a link to each of its contents, so that later runs know whose they are
// and a worker may be shown those of its tenant and no others.
static const char *owner_folder(const struct hg_upload_store *store,
    const struct hg_upload_owner *owner, char *path, size_t size)
{
    char hex[HG_SHA256_HEX];
    if (owner->moved)
        return owner->moved;
    hg_sha256_hex(owner->key, hex);
    snprintf(path, size, "%s/%.*s", store->folder, KEY_DIGITS, hex);
    return path;
}

// Caller frees. NULL: no memory.
static char *link_path(const struct hg_upload_store *store, const struct content *content,
    const struct hg_upload_owner *owner)
{
    char hex[HG_SHA256_HEX], folder[PATH_MAX];
    const char *above = owner_folder(store, owner, folder, sizeof folder);
    hg_sha256_hex(content->hash, hex);
    size_t size = strlen(above) + sizeof hex + 1;
    char *path = hg_calloc(size, 1);
    if (path)
        snprintf(path, size, "%s/%s", above, hex);
    return path;
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
    return HG_OK;
}

static enum hg_status link_content(const struct hg_upload_store *store,
    const struct content *content, struct hg_upload_owner *owner)
{
    char folder[PATH_MAX];
    char *from = content_path(store, content->hash), *to = link_path(store, content, owner);
    enum hg_status status = from && to ? HG_OK : HG_E_NOMEM;
    if (!status && mkdir(owner_folder(store, owner, folder, sizeof folder), 0700) != 0 &&
        errno != EEXIST)
        status = hg_status_from_errno(errno);
    if (!status && link(from, to) != 0 && errno != EEXIST)
        status = hg_status_from_errno(errno);
    hg_free(from);
    hg_free(to);
    return status;
}

static enum hg_status take_owner(
    struct hg_upload_store *store, struct content *content, struct hg_upload_owner *owner)
{
    if (is_owned_by(content, owner))
        return HG_OK;
    enum hg_status status = link_content(store, content, owner);
    return status ? status : add_owner(content, owner);
}

static void disown(struct hg_upload_store *store, struct content *content, size_t i)
{
    struct hg_upload_owner *owner = content->owners[i];
    char *path = link_path(store, content, owner);
    if (path)
        unlink(path);
    hg_free(path);
    owner->usage.bytes -= disk_bytes(content->size);
    owner->usage.files--;
    content->owners[i] = content->owners[--content->owner_count];
}

// Removes the file; the record stays while it is pinned.
static void drop(struct hg_upload_store *store, struct content *content)
{
    char *path = content->present ? content_path(store, content->hash) : NULL;
    if (path)
        unlink(path);
    hg_free(path);
    unlist(store, content);
    if (content->present)
        store->bytes -= disk_bytes(content->size);
    while (content->owner_count)
        disown(store, content, content->owner_count - 1);
    content->present = false;
    remove_if_unused(store, content);
}

static bool make_room(struct hg_upload_store *store, uint64_t need)
{
    if (need > store->limit_bytes)
        return false;
    while (store->bytes > store->limit_bytes - need) {
        if (!store->oldest)
            return false;
        drop(store, store->oldest);
    }
    return true;
}

// ---- owners -------------------------------------------------------------------------------------

struct hg_upload_owner *hg_upload_store_owner(struct hg_upload_store *store, const uint8_t key[32])
{
    struct hg_upload_owner *owner = store->owners;
    while (owner && memcmp(owner->key, key, KEY_DIGITS / 2) != 0)
        owner = owner->next;
    if (owner)
        return owner;
    owner = hg_calloc(1, sizeof *owner);
    if (!owner)
        return NULL;
    memcpy(owner->key, key, 32);
    owner->next = store->owners;
    store->owners = owner;
    return owner;
}

enum hg_status hg_upload_owner_move(struct hg_upload_store *store, struct hg_upload_owner *owner,
    const char *folder, struct hg_error *err)
{
    char here[PATH_MAX], there[PATH_MAX];
    char *moved = folder ? hg_strdup(folder) : NULL;
    if (folder && !moved)
        return hg_error_set(err, HG_E_NOMEM, folder, NULL, "no memory");
    struct hg_upload_owner next = {.moved = moved};
    memcpy(next.key, owner->key, sizeof next.key);
    const char *from = owner_folder(store, owner, here, sizeof here);
    const char *to = owner_folder(store, &next, there, sizeof there);
    // What it has not sent anything to has no folder.
    if (rename(from, to) != 0 && errno != ENOENT) {
        hg_free(moved);
        return fail_errno(err, from, "move the folder");
    }
    hg_free(owner->moved);
    owner->moved = moved;
    return HG_OK;
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

// Room for so much more of an owner, in its quota and in the store.
static enum hg_status reserve(struct hg_upload_store *store, struct hg_upload_owner *owner,
    uint64_t bytes, uint64_t files, struct hg_error *err)
{
    for (struct content *it = store->oldest, *newer; it && is_above_quota(owner, bytes, files);
         it = newer) {
        newer = it->newer;
        give_up(store, it, owner);
    }
    if (is_above_quota(owner, bytes, files))
        return hg_error_set(err, HG_E_LIMIT, "upload", "total",
            "uploads that are in use or under way take %llu of the %llu MiB (max-upload) and %llu "
            "of the %llu files (max-upload-files) of this tenant's quota",
            (unsigned long long)(owner->usage.bytes >> 20),
            (unsigned long long)(owner->quota.bytes >> 20), (unsigned long long)owner->usage.files,
            (unsigned long long)owner->quota.files);
    if (!make_room(store, bytes))
        return hg_error_set(err, HG_E_LIMIT, "upload", "total",
            "the upload store of %llu MiB (upload-store) is full of what is in use",
            (unsigned long long)(store->limit_bytes >> 20));
    store->bytes += bytes;
    owner->usage.bytes += bytes;
    owner->usage.files += files;
    return HG_OK;
}

// ---- folder -------------------------------------------------------------------------------------

static enum hg_status make_folders(const char *folder, struct hg_error *err)
{
    char *path = hg_strdup(folder);
    if (!path)
        return hg_error_set(err, HG_E_NOMEM, folder, NULL, "no memory");
    enum hg_status status = HG_OK;
    for (char *slash = path; slash && !status;) {
        slash = strchr(slash + 1, '/');
        if (slash)
            *slash = 0;
        if (mkdir(path, 0700) != 0 && errno != EEXIST)
            status = fail_errno(err, path, "make the folder");
        if (slash)
            *slash = '/';
    }
    hg_free(path);
    return status;
}

// A link in the folder of an owner. One without its content is removed.
static enum hg_status index_link(
    struct hg_upload_store *store, struct hg_upload_owner *owner, int folder, const char *name)
{
    uint8_t hash[32];
    struct stat st;
    if (!hg_sha256_parse(name, 32, hash))
        return HG_OK;
    char *path = content_path(store, hash);
    bool is_there = path && lstat(path, &st) == 0;
    struct content *content = is_there ? find_or_add(store, hash) : NULL;
    hg_free(path);
    if (path && !is_there)
        return unlinkat(folder, name, 0) == 0 ? HG_OK : HG_E_IO;
    if (!content)
        return HG_E_NOMEM;
    content->size = (uint64_t)st.st_size;
    return is_owned_by(content, owner) ? HG_OK : add_owner(content, owner);
}

static enum hg_status index_owner(struct hg_upload_store *store, const uint8_t key[32])
{
    char folder[PATH_MAX];
    struct hg_upload_owner *owner = hg_upload_store_owner(store, key);
    DIR *dir = owner ? opendir(owner_folder(store, owner, folder, sizeof folder)) : NULL;
    enum hg_status status = dir ? HG_OK : HG_E_NOMEM;
    for (struct dirent *it; !status && (it = readdir(dir));)
        status = index_link(store, owner, dirfd(dir), it->d_name);
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
    if (hg_sha256_parse(name, KEY_DIGITS / 2, hash))
        return index_owner(store, hash);
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
    return HG_OK;
}

static enum hg_status index_folder(struct hg_upload_store *store, struct hg_error *err)
{
    DIR *dir = opendir(store->folder);
    if (!dir)
        return fail_errno(err, store->folder, "open the folder");
    enum hg_status status = HG_OK;
    for (struct dirent *entry; !status && (entry = readdir(dir));)
        status = index_entry(store, dir, entry->d_name);
    closedir(dir);
    if (status)
        hg_error_set(err, status, store->folder, NULL, "cannot index the uploads");
    return status;
}

enum hg_status hg_upload_store_create(
    const char *folder, uint64_t limit_bytes, struct hg_upload_store **out, struct hg_error *err)
{
    *out = NULL;
    struct hg_upload_store *store = hg_calloc(1, sizeof *store);
    if (store)
        store->folder = hg_strdup(folder);
    enum hg_status status = store && store->folder ? make_folders(folder, err) : HG_E_NOMEM;
    if (!status && access(folder, W_OK | X_OK) != 0)
        status = fail_errno(err, folder, "write to the folder");
    if (!status)
        status = index_folder(store, err);
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
        hg_free(owner->moved);
        hg_free(owner);
    }
    hg_free(store->folder);
    hg_free(store);
}

void hg_upload_store_set_limit(struct hg_upload_store *store, uint64_t limit_bytes)
{
    store->limit_bytes = limit_bytes;
    if (!make_room(store, 0))
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
    content->pins++;
    unlist(store, content);
    return HG_OK;
}

void hg_upload_store_unpin(struct hg_upload_store *store, const uint8_t hash[32])
{
    struct content *content = find(store, hash);
    if (!content || !content->pins || --content->pins)
        return;
    touch(store, content);
    remove_if_unused(store, content);
}

void hg_upload_store_forget(struct hg_upload_store *store, const uint8_t hash[32])
{
    struct content *content = find(store, hash);
    if (content && content->present)
        drop(store, content);
}

// ---- uploads ------------------------------------------------------------------------------------

static void give_back(
    struct hg_upload_store *store, struct hg_upload_owner *owner, uint64_t charged)
{
    store->bytes -= disk_bytes(charged);
    owner->usage.bytes -= disk_bytes(charged);
    owner->usage.files--;
}

static enum hg_status open_temporary(struct hg_upload *upload, struct hg_error *err)
{
    struct hg_upload_store *store = upload->store;
    size_t size = strlen(store->folder) + 32;
    upload->path = hg_calloc(size, 1);
    upload->hasher = hg_sha256_create();
    if (!upload->path || !upload->hasher)
        return hg_error_set(err, HG_E_NOMEM, "upload", NULL, "no memory");
    snprintf(upload->path, size, "%s/.incoming.%u", store->folder, ++store->next_name);
    upload->fd = open(upload->path, O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC | O_NOFOLLOW, 0600);
    if (upload->fd < 0) {
        upload->path[0] = 0;
        return fail_errno(err, "upload", "create the file");
    }
    return HG_OK;
}

enum hg_status hg_upload_begin(struct hg_upload_store *store, struct hg_upload_owner *owner,
    const uint8_t hash[32], uint64_t total_bytes, struct hg_upload **out, struct hg_error *err)
{
    *out = NULL;
    if (total_bytes > store->limit_bytes)
        return hg_error_set(err, HG_E_LIMIT, "upload", "total",
            "%llu bytes do not fit into the upload store of %llu MiB (upload-store)",
            (unsigned long long)total_bytes, (unsigned long long)(store->limit_bytes >> 20));
    enum hg_status status = reserve(store, owner, disk_bytes(0), 1, err);
    if (status)
        return status;
    struct hg_upload *upload = hg_calloc(1, sizeof *upload);
    if (!upload) {
        give_back(store, owner, 0);
        return hg_error_set(err, HG_E_NOMEM, "upload", NULL, "no memory");
    }
    upload->store = store;
    upload->owner = owner;
    upload->total = total_bytes;
    upload->fd = -1;
    upload->progress_ns = hg_clock_now_ns();
    memcpy(upload->hash, hash, 32);
    status = open_temporary(upload, err);
    if (status) {
        hg_upload_abort(upload);
        return status;
    }
    *out = upload;
    return HG_OK;
}

uint64_t hg_upload_progress_ns(const struct hg_upload *upload)
{
    return upload->progress_ns;
}

const uint8_t *hg_upload_hash(const struct hg_upload *upload)
{
    return upload->hash;
}

uint64_t hg_upload_offset(const struct hg_upload *upload)
{
    return upload->offset;
}

uint64_t hg_upload_total(const struct hg_upload *upload)
{
    return upload->total;
}

enum hg_status hg_upload_append(
    struct hg_upload *upload, const void *data, size_t size, struct hg_error *err)
{
    if (!hg_range_ok(upload->offset, size, upload->total))
        return hg_error_set(
            err, HG_E_LIMIT, "upload", "data", "more bytes than the announced total");
    uint64_t more = disk_bytes(upload->offset + size) - disk_bytes(upload->offset);
    enum hg_status status = reserve(upload->store, upload->owner, more, 0, err);
    if (status)
        return status;
    upload->charged += size;
    upload->progress_ns = hg_clock_now_ns();
    for (size_t done = 0; done < size;) {
        ssize_t n = write(upload->fd, (const uint8_t *)data + done, size - done);
        if (n < 0 && errno == EINTR)
            continue;
        if (n < 0)
            return fail_errno(err, "upload", "store the content");
        done += (size_t)n;
    }
    hg_sha256_update(upload->hasher, data, size);
    upload->offset += size;
    return HG_OK;
}

static enum hg_status take_in(struct hg_upload *upload, struct hg_error *err)
{
    uint8_t digest[32];
    hg_sha256_end(upload->hasher, digest);
    upload->hasher = NULL;
    if (memcmp(digest, upload->hash, 32) != 0) {
        char hex[HG_SHA256_HEX];
        hg_sha256_hex(digest, hex);
        return hg_error_set(
            err, HG_E_HASH, "upload", "hash", "the bytes that came have the hash %s", hex);
    }
    struct content *content = find_or_add(upload->store, upload->hash);
    char *path = content_path(upload->store, upload->hash);
    enum hg_status status = HG_OK;
    if (!content || !path)
        status = hg_error_set(err, HG_E_NOMEM, "upload", NULL, "no memory");
    else if (content->present) { // another owner's, or another session was faster
        status = take_owner(upload->store, content, upload->owner);
        touch(upload->store, content);
    } else if (fchmod(upload->fd, 0400) != 0 || rename(upload->path, path) != 0)
        status = fail_errno(err, "upload", "name the content");
    else {
        upload->path[0] = 0;
        content->present = true;
        content->size = upload->total;
        status = take_owner(upload->store, content, upload->owner); // abort gives back the upload's
        upload->store->bytes += disk_bytes(content->size);
        touch(upload->store, content);
    }
    if (status && content)
        remove_if_unused(upload->store, content);
    if (status && err && !err->status)
        hg_error_set(err, status, "upload", NULL, "the content cannot be kept for its tenant");
    hg_free(path);
    return status;
}

int hg_upload_dup(const struct hg_upload *upload)
{
    return fcntl(upload->fd, F_DUPFD_CLOEXEC, 0);
}

int hg_upload_store_open_folder(const struct hg_upload_store *store)
{
    return open(store->folder, O_RDONLY | O_DIRECTORY | O_CLOEXEC);
}

enum hg_status hg_upload_commit(struct hg_upload *upload, struct hg_error *err)
{
    enum hg_status status = take_in(upload, err);
    hg_upload_abort(upload);
    return status;
}

void hg_upload_abort(struct hg_upload *upload)
{
    if (!upload)
        return;
    uint8_t digest[32];
    if (upload->hasher)
        hg_sha256_end(upload->hasher, digest);
    if (upload->fd >= 0)
        close(upload->fd);
    if (upload->path && upload->path[0])
        unlink(upload->path);
    give_back(upload->store, upload->owner, upload->charged);
    hg_free(upload->path);
    hg_free(upload);
}
