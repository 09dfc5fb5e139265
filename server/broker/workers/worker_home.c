#include "server/broker/workers/worker_home.h"

#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "base/alloc.h"
#include "base/file.h"
#include "base/log.h"
#include "base/sha256.h"
#include "server/broker/storage/folder_lock.h"

enum { DEPTH_MAX = 16, NAME_BYTES = 300 };

static enum hg_status fail(struct hg_error *err, const char *path, const char *action)
{
    const int e = errno;
    return hg_error_set(
        err, hg_status_from_errno(e), path, NULL, "cannot %s: %s", action, strerror(e));
}

static bool join(char *out, size_t size, const char *folder, const char *name)
{
    return (size_t)snprintf(out, size, "%s/%s", folder, name) < size;
}

// ---- folders -----------------------------------------------------------------------------------

static enum hg_status make_folder(const char *path, struct hg_error *err)
{
    return mkdir(path, 0700) == 0 || errno == EEXIST ? HG_OK : fail(err, path, "make the folder");
}

// ---- homes --------------------------------------------------------------------------------------

static enum hg_status home_folder(const struct hg_home *home, char *out, struct hg_error *err)
{
    const int length =
        snprintf(out, HG_HOME_PATH, "%s/workers/%u", home->homes->cache_dir, home->number);
    return length < HG_HOME_PATH - NAME_BYTES
               ? HG_OK
               : hg_error_set(err, HG_E_LIMIT, "--cache-dir", NULL, "the name is too long");
}

bool hg_home_path(const struct hg_home *home, const char *name, char *out, size_t size)
{
    char folder[HG_HOME_PATH];
    return !home_folder(home, folder, NULL) && join(out, size, folder, name);
}

// Folders below `folder`, those above first.
static enum hg_status make_below(
    const char *folder, const char *const names[], size_t count, struct hg_error *err)
{
    char path[HG_HOME_PATH];
    enum hg_status status = HG_OK;
    for (size_t i = 0; i < count && !status; i++) {
        if (!join(path, sizeof path, folder, names[i]))
            return hg_error_set(err, HG_E_LIMIT, folder, NULL, "the name is too long");
        status = make_folder(path, err);
    }
    return status;
}

enum hg_status hg_home_make(struct hg_home *home, struct hg_error *err)
{
    static const char *const above[] = {"workers", "tenants", "seed", "seed/shaders"};
    static const char *const inside[] = {
        ".", "cache", "cache/store", "cache/shaders", "given", "given/uploads"};
    char folder[HG_HOME_PATH];
    enum hg_status status = home_folder(home, folder, err);
    if (!status) // it may have been removed since the start
        status = hg_folder_make(home->homes->cache_dir, err);
    if (!status)
        status = make_below(home->homes->cache_dir, above, sizeof above / sizeof *above, err);
    if (!status && !home->key[0] &&
        !hg_disk_discard(home->homes->watch, home->homes->cache_dir, folder))
        status = hg_error_set(err, HG_E_IO, folder, NULL, "cannot remove what is there");
    if (!status)
        status = make_folder(folder, err);
    if (!status)
        status = make_below(folder, inside, sizeof inside / sizeof *inside, err);
    return status;
}

static enum hg_status make_key(struct hg_home *home, const char *tenant, uint8_t digest[32])
{
    char hex[HG_SHA256_HEX];
    if (hg_sha256(tenant, strlen(tenant), digest))
        return HG_E_NOMEM;
    hg_sha256_hex(digest, hex);
    snprintf(home->key, sizeof home->key, "%.*s", HG_HOME_KEY - 1, hex);
    return HG_OK;
}

// Moves a folder in place of another one, which goes. What is not there leaves the other one.
static enum hg_status move_folder(
    const struct hg_homes *homes, const char *from, const char *to, struct hg_error *err)
{
    struct stat st;
    if (lstat(from, &st) != 0 && errno == ENOENT)
        return HG_OK;
    return hg_disk_discard(homes->watch, homes->cache_dir, to) && rename(from, to) == 0
               ? HG_OK
               : fail(err, from, "move a tenant's folder");
}

enum hg_status hg_home_give(struct hg_home *home, const char *tenant, struct hg_error *err)
{
    char folder[HG_HOME_PATH], path[HG_HOME_PATH], store[HG_HOME_PATH];
    uint8_t digest[32];
    struct stat st;
    enum hg_status status = home_folder(home, folder, err);
    if (!status && lstat(folder, &st) != 0) // no worker has started in it
        status = hg_home_make(home, err);
    if (!status && make_key(home, tenant, digest))
        status = hg_error_set(err, HG_E_NOMEM, folder, NULL, "no memory");
    if (status || !join(path, sizeof path, folder, "owner"))
        return status ? status : HG_E_LIMIT;
    status = hg_file_write_atomic(path, home->key, HG_HOME_KEY - 1, err);
    const int length =
        snprintf(path, sizeof path, "%s/tenants/%s/store", home->homes->cache_dir, home->key);
    if (!status && (length >= HG_HOME_PATH || !join(store, sizeof store, folder, "cache/store")))
        status = HG_E_LIMIT;
    if (!status)
        status = move_folder(home->homes, path, store, err);
    if (!status && join(path, sizeof path, folder, "given/uploads")) {
        struct hg_upload_owner *owner = hg_upload_store_owner(home->homes->store, digest);
        status = owner ? hg_upload_owner_move(home->homes->store, owner, path, err) : HG_E_NOMEM;
    }
    return status;
}

// Baked data of a home go to its tenant; what that has there already is older, and goes.
static void return_store(const struct hg_homes *homes, const char *folder, const char *key)
{
    char from[HG_HOME_PATH], to[HG_HOME_PATH];
    struct hg_error err = {0};
    const bool fits =
        join(from, sizeof from, folder, "cache/store") &&
        (size_t)snprintf(to, sizeof to, "%s/tenants/%s", homes->cache_dir, key) < sizeof to - 8;
    if (!fits || make_folder(to, &err))
        return;
    strcat(to, "/store");
    if (move_folder(homes, from, to, &err))
        hg_warn(WORKER, "%s: %s; it is baked again", err.what, err.reason);
}

void hg_home_leave(struct hg_home *home)
{
    char folder[HG_HOME_PATH];
    uint8_t digest[32];
    struct hg_error err = {0};
    if (!home->homes || home_folder(home, folder, &err))
        return;
    if (home->key[0]) {
        return_store(home->homes, folder, home->key);
        hg_sha256_parse(home->key, (HG_HOME_KEY - 1) / 2, digest);
        struct hg_upload_owner *owner = hg_upload_store_owner(home->homes->store, digest);
        if (owner && hg_upload_owner_move(home->homes->store, owner, NULL, &err))
            hg_warn(WORKER, "%s: %s", err.what, err.reason);
    }
    home->key[0] = 0;
    (void)hg_disk_discard(home->homes->watch, home->homes->cache_dir, folder);
}

void hg_home_empty(struct hg_home *home)
{
    char folder[HG_HOME_PATH];
    if (home->homes && hg_home_path(home, "cache", folder, sizeof folder))
        (void)hg_disk_discard(home->homes->watch, home->homes->cache_dir, folder);
}

// ---- after the end of a daemon ------------------------------------------------------------------

static void return_uploads(const char *cache_dir, const char *folder, const char *key)
{
    char from[HG_HOME_PATH], to[HG_HOME_PATH];
    const bool fits = join(from, sizeof from, folder, "given/uploads") &&
                      (size_t)snprintf(to, sizeof to, "%s/uploads/%s", cache_dir, key) < sizeof to;
    if (fits && rename(from, to) != 0)
        hg_warn(WORKER, "%s: %s; contents are sent again", from, strerror(errno));
}

static void recover(const struct hg_homes *homes, const char *folder)
{
    char path[HG_HOME_PATH];
    uint8_t *key, digest[32];
    size_t size;
    if (!join(path, sizeof path, folder, "owner"))
        return;
    if (hg_file_read(path, HG_HOME_KEY, &key, &size, NULL) == HG_OK) {
        if (hg_sha256_parse((const char *)key, (HG_HOME_KEY - 1) / 2, digest)) {
            return_uploads(homes->cache_dir, folder, (const char *)key);
            return_store(homes, folder, (const char *)key);
        }
        hg_free(key);
    }
    (void)hg_disk_discard(NULL, homes->cache_dir, folder);
}

enum hg_status hg_homes_recover(const char *cache_dir, struct hg_error *err)
{
    const struct hg_homes homes = {.cache_dir = cache_dir};
    char workers[HG_HOME_PATH], path[HG_HOME_PATH + NAME_BYTES];
    if (!join(workers, sizeof workers - NAME_BYTES, cache_dir, "workers"))
        return hg_error_set(err, HG_E_LIMIT, "--cache-dir", NULL, "the name is too long");
    DIR *dir = opendir(workers);
    if (!dir)
        return errno == ENOENT ? HG_OK : fail(err, workers, "open the folder");
    for (struct dirent *it; (it = readdir(dir));)
        if (it->d_name[0] != '.' && join(path, sizeof path, workers, it->d_name))
            recover(&homes, path);
    closedir(dir);
    return HG_OK;
}

enum hg_status hg_home_resume(struct hg_home *home, const char *tenant, struct hg_error *err)
{
    char uploads[HG_HOME_PATH];
    uint8_t digest[32];
    if (make_key(home, tenant, digest) ||
        !hg_home_path(home, "given/uploads", uploads, sizeof uploads))
        return hg_error_set(err, HG_E_NOMEM, tenant, NULL, "no memory");
    struct hg_upload_owner *owner = hg_upload_store_owner(home->homes->store, digest);
    return owner ? hg_upload_owner_find(home->homes->store, owner, uploads, err)
                 : hg_error_set(err, HG_E_NOMEM, tenant, NULL, "no memory");
}
