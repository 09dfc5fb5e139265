#include "server/broker/upload_store.h"

#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "base/alloc.h"
#include "base/checked.h"
#include "base/file.h"
#include "base/log.h"
#include "base/sha256.h"

struct content {
    uint8_t hash[32];
    uint64_t size;
    uint64_t used; // clock of the store when last used
    uint32_t pins;
    bool present;
};

struct hg_upload_store {
    char *folder;
    uint64_t limit_bytes, bytes, clock; // bytes include what uploads under way announced
    struct content *contents;
    size_t count, capacity;
    uint32_t next_name;
};

struct hg_upload {
    struct hg_upload_store *store;
    struct hg_sha256 *hasher;
    uint8_t hash[32];
    uint64_t total, offset;
    int fd;
    char *path;
};

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

static struct content *find(const struct hg_upload_store *store, const uint8_t hash[32])
{
    for (size_t i = 0; i < store->count; i++)
        if (memcmp(store->contents[i].hash, hash, 32) == 0)
            return &store->contents[i];
    return NULL;
}

static struct content *find_or_add(struct hg_upload_store *store, const uint8_t hash[32])
{
    struct content *content = find(store, hash);
    if (content)
        return content;
    if (hg_grow(&store->contents, &store->capacity, store->count + 1, sizeof *store->contents))
        return NULL;
    content = &store->contents[store->count++];
    *content = (struct content){.used = ++store->clock};
    memcpy(content->hash, hash, 32);
    return content;
}

// Removes the file; the row stays while it is pinned.
static void drop(struct hg_upload_store *store, struct content *content)
{
    char *path = content->present ? content_path(store, content->hash) : NULL;
    if (path)
        unlink(path);
    hg_free(path);
    if (content->present)
        store->bytes -= content->size;
    content->present = false;
    if (!content->pins)
        *content = store->contents[--store->count];
}

static struct content *least_used(const struct hg_upload_store *store)
{
    struct content *oldest = NULL;
    for (size_t i = 0; i < store->count; i++) {
        struct content *it = &store->contents[i];
        if (it->present && !it->pins && (!oldest || it->used < oldest->used))
            oldest = it;
    }
    return oldest;
}

static bool make_room(struct hg_upload_store *store, uint64_t need)
{
    if (need > store->limit_bytes)
        return false;
    while (store->bytes > store->limit_bytes - need) {
        struct content *oldest = least_used(store);
        if (!oldest)
            return false;
        drop(store, oldest);
    }
    return true;
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

static int hex_digit(char c)
{
    return c >= '0' && c <= '9' ? c - '0' : c >= 'a' && c <= 'f' ? c - 'a' + 10 : -1;
}

static bool parse_hash(const char *name, uint8_t hash[32])
{
    for (int i = 0; i < 64; i++) {
        int digit = hex_digit(name[i]);
        if (digit < 0)
            return false;
        hash[i / 2] = (uint8_t)(i % 2 ? hash[i / 2] | digit : digit << 4);
    }
    return !name[64];
}

static enum hg_status index_entry(struct hg_upload_store *store, DIR *dir, const char *name)
{
    struct stat st;
    uint8_t hash[32];
    if (strncmp(name, ".incoming.", 10) == 0)
        return unlinkat(dirfd(dir), name, 0) == 0 ? HG_OK : HG_E_IO;
    if (!parse_hash(name, hash) || fstatat(dirfd(dir), name, &st, AT_SYMLINK_NOFOLLOW) != 0 ||
        !S_ISREG(st.st_mode))
        return HG_OK;
    struct content *content = find_or_add(store, hash);
    if (!content)
        return HG_E_NOMEM;
    content->present = true;
    content->size = (uint64_t)st.st_size;
    store->bytes += content->size;
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
    hg_free(store->contents);
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

bool hg_upload_store_has(struct hg_upload_store *store, const uint8_t hash[32])
{
    struct content *content = find(store, hash);
    if (!content || !content->present)
        return false;
    content->used = ++store->clock;
    return true;
}

enum hg_status hg_upload_store_pin(struct hg_upload_store *store, const uint8_t hash[32])
{
    struct content *content = find_or_add(store, hash);
    if (!content)
        return HG_E_NOMEM;
    content->pins++;
    content->used = ++store->clock;
    return HG_OK;
}

void hg_upload_store_unpin(struct hg_upload_store *store, const uint8_t hash[32])
{
    struct content *content = find(store, hash);
    if (!content || !content->pins || --content->pins || content->present)
        return;
    *content = store->contents[--store->count];
}

void hg_upload_store_forget(struct hg_upload_store *store, const uint8_t hash[32])
{
    struct content *content = find(store, hash);
    if (content && content->present)
        drop(store, content);
}

// ---- uploads ------------------------------------------------------------------------------------

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

enum hg_status hg_upload_begin(struct hg_upload_store *store, const uint8_t hash[32],
    uint64_t total_bytes, struct hg_upload **out, struct hg_error *err)
{
    *out = NULL;
    if (!make_room(store, total_bytes))
        return hg_error_set(err, HG_E_LIMIT, "upload", "total",
            "%llu bytes do not fit into the upload store of %llu, most of which is in use",
            (unsigned long long)total_bytes, (unsigned long long)store->limit_bytes);
    struct hg_upload *upload = hg_calloc(1, sizeof *upload);
    if (!upload)
        return hg_error_set(err, HG_E_NOMEM, "upload", NULL, "no memory");
    upload->store = store;
    upload->total = total_bytes;
    upload->fd = -1;
    memcpy(upload->hash, hash, 32);
    store->bytes += total_bytes;
    enum hg_status status = open_temporary(upload, err);
    if (status) {
        hg_upload_abort(upload);
        return status;
    }
    *out = upload;
    return HG_OK;
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
    else if (content->present) // another session was faster
        content->used = ++upload->store->clock;
    else if (rename(upload->path, path) != 0)
        status = fail_errno(err, "upload", "name the content");
    else {
        upload->path[0] = 0;
        content->present = true;
        content->size = upload->total;
        content->used = ++upload->store->clock;
        upload->store->bytes += upload->total; // abort gives back what begin reserved
    }
    hg_free(path);
    return status;
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
    upload->store->bytes -= upload->total;
    hg_free(upload->path);
    hg_free(upload);
}
