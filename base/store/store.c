// store.c - names, opening and closing, statistics. See store.h.
#include "base/store/store.h"

#include <errno.h>
#include <stdio.h>
#include <string.h>
#include <sys/resource.h>
#include <unistd.h>

#include "base/alloc.h"
#include "base/log.h"
#include "base/store/internal.h"

// --- names ---------------------------------------------------------------------------------------

static char *make_path(const struct hg_store *store, const struct hg_store_key *key,
    const char *prefix, const char *suffix)
{
    char hex[HG_SHA256_HEX];
    hg_sha256_hex(key->hash, hex);
    const size_t room = strlen(store->dir) + sizeof hex + 16;
    char *path = hg_calloc(room, 1);
    if (path != NULL)
        snprintf(path, room, "%s/%s%s%s", store->dir, prefix, hex, suffix);
    return path;
}

char *hg_store_entry_path(const struct hg_store *store, const struct hg_store_key *key)
{
    return make_path(store, key, "", HG_STORE_ENTRY_SUFFIX);
}

char *hg_store_temp_path(const struct hg_store *store, const struct hg_store_key *key)
{
    return make_path(store, key, ".", HG_STORE_TEMP_SUFFIX);
}

enum hg_status hg_store_key(
    const char *kind, uint32_t version, const void *params, size_t size, struct hg_store_key *out)
{
    memset(out, 0, sizeof *out);
    struct hg_sha256 *h = hg_sha256_create();
    if (h == NULL)
        return HG_E_NOMEM;
    const uint8_t number[4] = {(uint8_t)version, (uint8_t)(version >> 8), (uint8_t)(version >> 16),
        (uint8_t)(version >> 24)};
    hg_sha256_update(h, kind, strlen(kind) + 1);
    hg_sha256_update(h, number, sizeof number);
    hg_sha256_update(h, params, size);
    hg_sha256_end(h, out->hash);
    return HG_OK;
}

bool hg_store_make_folder(const char *dir)
{
    if (mkdir(dir, 0777) == 0 || errno == EEXIST)
        return true;
    char *above = errno == ENOENT ? hg_strdup(dir) : NULL;
    char *slash = above != NULL ? strrchr(above, '/') : NULL;
    bool made = false;
    if (slash != NULL && slash != above) {
        *slash = 0;
        made = (mkdir(above, 0777) == 0 || errno == EEXIST) &&
               (mkdir(dir, 0777) == 0 || errno == EEXIST);
    }
    hg_free(above);
    return made;
}

bool hg_store_is_same_file(const char *path, int fd)
{
    struct stat named, open;
    return stat(path, &named) == 0 && fstat(fd, &open) == 0 && named.st_ino == open.st_ino &&
           named.st_dev == open.st_dev;
}

// --- open and close ------------------------------------------------------------------------------

static uint32_t most_files(void)
{
    struct rlimit files;
    if (getrlimit(RLIMIT_NOFILE, &files) != 0 || files.rlim_cur > 4096)
        return 1024;
    return files.rlim_cur < 32 ? 8 : (uint32_t)files.rlim_cur / 4;
}

enum hg_status hg_store_open(
    const struct hg_store_params *params, struct hg_store **out, struct hg_error *err)
{
    *out = NULL;
    if (params->dir == NULL || params->dir[0] == 0)
        return hg_error_set(err, HG_E_INVAL, "store", "dir", "no folder is named");
    struct hg_store *store = hg_calloc(1, sizeof *store);
    char *dir = hg_strdup(params->dir);
    if (store == NULL || dir == NULL) {
        hg_free(store);
        hg_free(dir);
        return hg_error_set(err, HG_E_NOMEM, "store", NULL, "no memory");
    }
    for (size_t end = strlen(dir); end > 1 && dir[end - 1] == '/'; end--)
        dir[end - 1] = 0;
    store->dir = dir;
    store->limit_bytes = params->limit_bytes;
    store->stats.limit_bytes = params->limit_bytes;
    store->open_most = most_files();
    pthread_mutex_init(&store->lock, NULL);
    if (!hg_store_make_folder(dir))
        hg_warn(MAIN, "cache folder %s cannot be made: %s; nothing is kept", dir, strerror(errno));
    hg_store_evict(store, 0, 0);
    *out = store;
    return HG_OK;
}

void hg_store_close(struct hg_store *store)
{
    if (store == NULL)
        return;
    pthread_mutex_destroy(&store->lock);
    hg_free(store->dir);
    hg_free(store);
}

void hg_store_stats(struct hg_store *store, struct hg_store_stats *out)
{
    pthread_mutex_lock(&store->lock);
    *out = store->stats;
    out->files_open = store->open;
    pthread_mutex_unlock(&store->lock);
}

void hg_store_count(struct hg_store *store, uint64_t *counter, uint64_t amount)
{
    pthread_mutex_lock(&store->lock);
    *counter += amount;
    pthread_mutex_unlock(&store->lock);
}

bool hg_store_has(struct hg_store *store, const struct hg_store_key *key)
{
    char *path = hg_store_entry_path(store, key);
    const bool has = path != NULL && access(path, R_OK) == 0;
    hg_free(path);
    return has;
}
