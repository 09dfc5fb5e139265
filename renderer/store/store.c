// store.c - the folder: names, last use, eviction. See store.h.
#include "renderer/store/store.h"

#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <unistd.h>

#include "base/alloc.h"
#include "base/log.h"
#include "renderer/store/internal.h"

static const char entry_suffix[] = ".hgs";
static const char temp_suffix[] = ".tmp";

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
    return make_path(store, key, "", entry_suffix);
}

char *hg_store_temp_path(const struct hg_store *store, const struct hg_store_key *key)
{
    return make_path(store, key, ".", temp_suffix);
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

// --- eviction ------------------------------------------------------------------------------------

struct file {
    char name[HG_SHA256_HEX + 8];
    uint64_t bytes;
    struct timespec used;
};

struct listing {
    struct file *files;
    size_t capacity, count;
    uint64_t bytes; // with the temporary files of writers at work
};

static bool ends_with(const char *name, const char *suffix)
{
    const size_t n = strlen(name), s = strlen(suffix);
    return n > s && strcmp(name + n - s, suffix) == 0;
}

// Writers hold a lock on their file, so one that can be locked has lost its writer.
static bool remove_stale(int folder, const char *name)
{
    const int fd = openat(folder, name, O_RDONLY | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK);
    if (fd < 0)
        return false;
    struct stat named, open;
    const bool stale = flock(fd, LOCK_EX | LOCK_NB) == 0 && fstat(fd, &open) == 0 &&
                       fstatat(folder, name, &named, AT_SYMLINK_NOFOLLOW) == 0 &&
                       named.st_ino == open.st_ino && unlinkat(folder, name, 0) == 0;
    close(fd);
    return stale;
}

static void add_file(struct listing *l, int folder, const char *name)
{
    struct stat st;
    const bool is_temp = name[0] == '.' && ends_with(name, temp_suffix);
    if ((!is_temp && !ends_with(name, entry_suffix)) || strlen(name) >= sizeof l->files->name ||
        (is_temp && remove_stale(folder, name)) ||
        fstatat(folder, name, &st, AT_SYMLINK_NOFOLLOW) != 0 || !S_ISREG(st.st_mode))
        return;
    l->bytes += (uint64_t)st.st_size;
    if (is_temp || hg_grow(&l->files, &l->capacity, l->count + 1, sizeof *l->files) != HG_OK)
        return;
    struct file *f = &l->files[l->count++];
    *f = (struct file){.bytes = (uint64_t)st.st_size, .used = st.st_mtim};
    memcpy(f->name, name, strlen(name) + 1);
}

static int compare_use(const void *a, const void *b)
{
    const struct file *x = a, *y = b;
    if (x->used.tv_sec != y->used.tv_sec)
        return x->used.tv_sec < y->used.tv_sec ? -1 : 1;
    if (x->used.tv_nsec != y->used.tv_nsec)
        return x->used.tv_nsec < y->used.tv_nsec ? -1 : 1;
    return strcmp(x->name, y->name);
}

static void list_folder(struct listing *l, int folder)
{
    const int copy = fcntl(folder, F_DUPFD_CLOEXEC, 0);
    DIR *dir = copy >= 0 ? fdopendir(copy) : NULL;
    if (dir == NULL) {
        if (copy >= 0)
            close(copy);
        return;
    }
    for (struct dirent *d; (d = readdir(dir)) != NULL;)
        add_file(l, folder, d->d_name);
    closedir(dir);
    if (l->count > 0)
        qsort(l->files, l->count, sizeof *l->files, compare_use);
}

void hg_store_evict(struct hg_store *store, uint64_t more, uint64_t at_least)
{
    const int folder = open(store->dir, O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    if (folder < 0)
        return;
    struct listing l = {0};
    list_folder(&l, folder);
    uint64_t evicted = 0, freed = 0;
    for (size_t i = 0; i < l.count; i++) {
        const bool over = store->limit_bytes > 0 && l.bytes + more > store->limit_bytes;
        if (!over && freed >= at_least)
            break;
        // Readers hold a shared lock: what is open stays.
        if (!remove_stale(folder, l.files[i].name))
            continue;
        l.bytes -= l.files[i].bytes;
        freed += l.files[i].bytes;
        evicted++;
    }
    close(folder);
    hg_free(l.files);
    pthread_mutex_lock(&store->lock);
    store->stats.bytes = l.bytes;
    store->stats.evicted += evicted;
    pthread_mutex_unlock(&store->lock);
}
