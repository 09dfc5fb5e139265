// folder.c - what lies in the folder: eviction, and looking after it from outside. See store.h.
#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <unistd.h>

#include "base/alloc.h"
#include "base/file.h"
#include "base/store/internal.h"

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

static void add_file(struct listing *l, int folder, const char *name, bool clean)
{
    struct stat st;
    const bool is_temp = name[0] == '.' && ends_with(name, HG_STORE_TEMP_SUFFIX);
    if ((!is_temp && !ends_with(name, HG_STORE_ENTRY_SUFFIX)) ||
        strlen(name) >= sizeof l->files->name || (is_temp && clean && remove_stale(folder, name)) ||
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

// clean: what dead writers left is removed
static void list_folder(struct listing *l, int folder, bool clean)
{
    const int copy = fcntl(folder, F_DUPFD_CLOEXEC, 0);
    DIR *dir = copy >= 0 ? fdopendir(copy) : NULL;
    if (dir == NULL) {
        if (copy >= 0)
            close(copy);
        return;
    }
    for (struct dirent *d; (d = readdir(dir)) != NULL;)
        add_file(l, folder, d->d_name, clean);
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
    list_folder(&l, folder, true);
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

// --- from outside --------------------------------------------------------------------------------

static enum hg_status open_folder(const char *dir, int *fd, struct hg_error *err)
{
    *fd = open(dir, O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    if (*fd >= 0)
        return HG_OK;
    const int e = errno;
    return hg_error_set(err, e == ENOENT || e == ENOTDIR ? HG_E_NOTFOUND : hg_status_from_errno(e),
        dir, NULL, "%s", strerror(e));
}

// A store without what only its users need.
static struct hg_store *open_outside(const char *dir)
{
    struct hg_store *store = hg_calloc(1, sizeof *store);
    char *copy = hg_strdup(dir);
    if (store == NULL || copy == NULL) {
        hg_free(store);
        hg_free(copy);
        return NULL;
    }
    store->dir = copy;
    pthread_mutex_init(&store->lock, NULL);
    return store;
}

static bool parse_key(const char *name, struct hg_store_key *key)
{
    static const char digits[] = "0123456789abcdef";
    if (strlen(name) != HG_SHA256_HEX - 1 + strlen(HG_STORE_ENTRY_SUFFIX))
        return false;
    for (size_t i = 0; i < HG_SHA256_HEX - 1; i++) {
        const char *digit = strchr(digits, name[i]);
        if (digit == NULL || *digit == 0)
            return false;
        key->hash[i / 2] = (uint8_t)(key->hash[i / 2] << 4 | (uint8_t)(digit - digits));
    }
    return true;
}

static bool is_locked(int folder, const char *name)
{
    const int fd = openat(folder, name, O_RDONLY | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK);
    const bool locked = fd >= 0 && flock(fd, LOCK_EX | LOCK_NB) != 0 && errno == EWOULDBLOCK;
    if (fd >= 0)
        close(fd);
    return locked;
}

// HG_E_NOTFOUND: the file is gone or is none of ours.
static enum hg_status describe(
    struct hg_store *store, int folder, const struct file *f, struct hg_store_info *out)
{
    struct hg_store_entry *entry;
    *out = (struct hg_store_info){.bytes = f->bytes, .used_s = f->used.tv_sec};
    if (!parse_key(f->name, &out->key))
        return HG_E_NOTFOUND;
    out->is_open = is_locked(folder, f->name);
    const enum hg_status status = hg_store_entry_open(store, &out->key, HG_STORE_LOOK, &entry);
    out->is_damaged = status == HG_E_HASH;
    if (status != HG_OK)
        return out->is_damaged ? HG_OK : status;
    out->blocks = hg_store_entry_blocks(entry);
    memcpy(out->label, hg_store_entry_label(entry), sizeof out->label);
    hg_store_entry_close(entry);
    return HG_OK;
}

enum hg_status hg_store_list(
    const char *dir, struct hg_store_info **out, size_t *count, struct hg_error *err)
{
    int folder;
    struct listing l = {0};
    *out = NULL;
    *count = 0;
    enum hg_status status = open_folder(dir, &folder, err);
    if (status != HG_OK)
        return status;
    list_folder(&l, folder, false);
    struct hg_store *store = open_outside(dir);
    struct hg_store_info *infos = hg_calloc(l.count + 1, sizeof *infos);
    size_t n = 0;
    if (store == NULL || infos == NULL)
        status = HG_E_NOMEM;
    for (size_t i = 0; i < l.count && status == HG_OK; i++) {
        status = describe(store, folder, &l.files[i], &infos[n]);
        n += status == HG_OK;
        status = status == HG_E_NOMEM ? status : HG_OK;
    }
    close(folder);
    hg_free(l.files);
    hg_store_close(store);
    if (status != HG_OK) {
        hg_free(infos);
        return hg_error_set(err, status, dir, NULL, "no memory");
    }
    *out = infos;
    *count = n;
    return HG_OK;
}

static enum hg_status read_blocks(struct hg_store_entry *entry, struct hg_error *err)
{
    uint8_t *block = NULL;
    size_t capacity = 0;
    enum hg_status status = HG_OK;
    for (uint32_t i = 0; i < hg_store_entry_blocks(entry) && status == HG_OK; i++) {
        const uint32_t size = hg_store_entry_size(entry, i);
        if (size == 0)
            continue;
        if (hg_grow(&block, &capacity, size, 1) != HG_OK)
            status = hg_error_set(err, HG_E_NOMEM, "cache", NULL, "no memory");
        else
            status = hg_store_entry_read(entry, i, block, size, err);
    }
    hg_free(block);
    return status;
}

enum hg_status hg_store_verify(
    const char *dir, const struct hg_store_key *key, struct hg_error *err)
{
    struct hg_store_entry *entry = NULL;
    struct hg_store *store = open_outside(dir);
    enum hg_status status = HG_E_NOMEM;
    if (store != NULL)
        status = hg_store_entry_open(store, key, HG_STORE_CHECK, &entry);
    if (status == HG_OK)
        status = read_blocks(entry, err);
    else
        hg_error_set(err, status, dir, NULL, "%s", hg_status_text(status));
    hg_store_entry_close(entry);
    hg_store_close(store);
    return status;
}

enum hg_status hg_store_clear(
    const char *dir, uint32_t *entries, uint64_t *bytes, struct hg_error *err)
{
    int folder;
    struct listing l = {0};
    *entries = 0;
    *bytes = 0;
    const enum hg_status status = open_folder(dir, &folder, err);
    if (status != HG_OK)
        return status;
    list_folder(&l, folder, true);
    for (size_t i = 0; i < l.count; i++) {
        if (!remove_stale(folder, l.files[i].name)) // readers hold a shared lock
            continue;
        ++*entries;
        *bytes += l.files[i].bytes;
    }
    close(folder);
    hg_free(l.files);
    return HG_OK;
}
