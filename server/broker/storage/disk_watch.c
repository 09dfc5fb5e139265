#include "server/broker/storage/disk_watch.h"

#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <pthread.h>
#include <signal.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/statvfs.h>
#include <unistd.h>

#include "base/alloc.h"
#include "base/clock.h"
#include "base/cond.h"
#include "base/log.h"

// Folders that a worker makes are not as deep.
enum { DEPTH_MAX = 16, NAME_BYTES = 300, PATH_BYTES = 4096, REST_FACTOR = 20 };

struct use {
    uint64_t bytes, files;
};

struct place {
    pid_t pid;
    bool has_tenant;
    enum hg_disk_fault fault; // of that process
    // Of the thread.
    pid_t counted_pid;
    uint64_t allowed_bytes; // without names
    bool seen;              // its open files could be looked at
};

struct hg_disk_watch {
    char cache_dir[PATH_BYTES];
    struct hg_disk_limits limits;
    uint32_t count;
    pthread_t thread;
    pthread_mutex_t lock; // of what follows
    pthread_cond_t wake;
    bool stop, removing;
    struct place places[];
};

static bool join(char *out, size_t size, const char *folder, const char *name)
{
    return (size_t)snprintf(out, size, "%s/%s", folder, name) < size;
}

// Never through a link. NULL: it cannot be opened.
static DIR *open_folder(int parent, const char *name)
{
    const int fd = openat(parent, name, O_RDONLY | O_DIRECTORY | O_NOFOLLOW | O_CLOEXEC);
    DIR *dir = fd < 0 ? NULL : fdopendir(fd);
    if (fd >= 0 && !dir)
        close(fd);
    return dir;
}

// ---- removing -----------------------------------------------------------------------------------

struct removal {
    int root;        // CACHE/discarded
    unsigned number; // of the newest folder that was moved to there
    bool moved;      // in this pass
};

// A folder that is too deep becomes one of those that are discarded.
static void move_up(struct removal *r, int parent, const char *name)
{
    char up[32];
    for (int tries = 0; tries < 100; tries++) { // those of earlier passes may be there still
        snprintf(up, sizeof up, "deep%u", ++r->number);
        if (renameat(parent, name, r->root, up) == 0) {
            r->moved = true;
            return;
        }
    }
}

// Whatever a worker has made there: links are links, and what is deep comes up first.
static void empty(struct removal *r, int parent, const char *name, int depth)
{
    DIR *dir = open_folder(parent, name);
    const int fd = dir ? dirfd(dir) : -1;
    for (struct dirent *it; dir && (it = readdir(dir));) {
        if (strcmp(it->d_name, ".") == 0 || strcmp(it->d_name, "..") == 0 ||
            unlinkat(fd, it->d_name, 0) == 0)
            continue;
        if (depth < DEPTH_MAX)
            empty(r, fd, it->d_name, depth + 1);
        else
            move_up(r, fd, it->d_name);
        unlinkat(fd, it->d_name, AT_REMOVEDIR);
    }
    if (dir)
        closedir(dir);
}

static void remove_discarded(const char *cache_dir)
{
    char path[PATH_BYTES];
    struct removal r = {.root = -1};
    if (join(path, sizeof path, cache_dir, "discarded"))
        r.root = open(path, O_RDONLY | O_DIRECTORY | O_NOFOLLOW | O_CLOEXEC);
    if (r.root < 0)
        return;
    do {
        r.moved = false;
        empty(&r, AT_FDCWD, path, 0);
    } while (r.moved);
    close(r.root);
}

bool hg_disk_discard(struct hg_disk_watch *watch, const char *cache_dir, const char *folder)
{
    static unsigned number; // of the loop
    char above[PATH_BYTES], to[PATH_BYTES + NAME_BYTES];
    struct stat st;
    if (lstat(folder, &st) != 0)
        return errno == ENOENT;
    if (!join(above, sizeof above, cache_dir, "discarded") ||
        (mkdir(above, 0700) != 0 && errno != EEXIST))
        return false;
    do // those of an earlier run may be there still
        snprintf(to, sizeof to, "%s/%u", above, ++number);
    while (lstat(to, &st) == 0);
    if (rename(folder, to) != 0) {
        hg_warn(WORKER, "%s cannot be removed: %s", folder, strerror(errno));
        return false;
    }
    if (watch) {
        pthread_mutex_lock(&watch->lock);
        watch->removing = true;
        pthread_cond_signal(&watch->wake);
        pthread_mutex_unlock(&watch->lock);
    }
    return true;
}

// ---- counting -----------------------------------------------------------------------------------

static uint64_t blocks_of(const struct stat *st)
{
    return (uint64_t)st->st_blocks * 512;
}

// Adds what is below a folder; stops above `most`. *used_s: the last use of a file.
static void count_folder(int parent, const char *name, const struct use *most, int depth,
    struct use *use, int64_t *used_s)
{
    struct stat st;
    DIR *dir = open_folder(parent, name);
    const int fd = dir ? dirfd(dir) : -1;
    for (struct dirent *it; dir && (it = readdir(dir));) {
        if (strcmp(it->d_name, ".") == 0 || strcmp(it->d_name, "..") == 0 ||
            fstatat(fd, it->d_name, &st, AT_SYMLINK_NOFOLLOW) != 0)
            continue;
        use->files++;
        use->bytes += blocks_of(&st);
        *used_s = st.st_mtime > *used_s ? st.st_mtime : *used_s;
        if (use->files > most->files || use->bytes > most->bytes)
            break;
        if (S_ISDIR(st.st_mode) && depth < DEPTH_MAX)
            count_folder(fd, it->d_name, most, depth + 1, use, used_s);
        else if (S_ISDIR(st.st_mode))
            use->files = UINT64_MAX / 2; // nothing that a worker makes
    }
    if (dir)
        closedir(dir);
}

// Bytes of files without a name that a process has open, on the file system of the cache. False:
// its open files cannot be looked at.
static bool count_unnamed(pid_t pid, dev_t device, uint64_t *bytes)
{
    char path[64];
    struct stat st;
    snprintf(path, sizeof path, "/proc/%d/fd", (int)pid);
    DIR *dir = opendir(path);
    bool seen = dir || errno == ENOENT;
    *bytes = 0;
    for (struct dirent *it; dir && (it = readdir(dir));) {
        if (it->d_name[0] == '.')
            continue;
        if (fstatat(dirfd(dir), it->d_name, &st, 0) != 0)
            seen &= errno != EACCES && errno != EPERM; // else it has been closed
        else if (S_ISREG(st.st_mode) && !st.st_nlink && st.st_dev == device)
            *bytes += blocks_of(&st);
    }
    if (dir)
        closedir(dir);
    return seen;
}

// ---- tenants at rest ----------------------------------------------------------------------------

// The folder of baked data that was used longest ago, and the bytes of all.
static uint64_t find_oldest(const char *tenants, char *oldest, size_t size)
{
    static const struct use most = {UINT64_MAX / 4, UINT64_MAX / 4};
    uint64_t sum = 0;
    int64_t least_s = INT64_MAX;
    DIR *dir = opendir(tenants);
    oldest[0] = 0;
    for (struct dirent *it; dir && (it = readdir(dir));) {
        struct use use = {0};
        int64_t used_s = 0;
        if (it->d_name[0] == '.')
            continue;
        count_folder(dirfd(dir), it->d_name, &most, 0, &use, &used_s);
        sum += use.bytes;
        if (!use.bytes || used_s >= least_s)
            continue;
        least_s = used_s;
        snprintf(oldest, size, "%s/%s", tenants, it->d_name);
    }
    if (dir)
        closedir(dir);
    return sum;
}

static void make_room(const struct hg_disk_watch *w)
{
    char tenants[PATH_BYTES], oldest[PATH_BYTES + NAME_BYTES], above[PATH_BYTES], out[PATH_BYTES];
    if (!w->limits.rest_bytes || !join(tenants, sizeof tenants, w->cache_dir, "tenants") ||
        !join(above, sizeof above, w->cache_dir, "discarded") ||
        !join(out, sizeof out, above, "rest"))
        return;
    mkdir(above, 0700);
    while (find_oldest(tenants, oldest, sizeof oldest) > w->limits.rest_bytes && oldest[0]) {
        // By name, so that a tenant that comes now has all of it or nothing.
        if (rename(oldest, out) != 0)
            return;
        hg_info(WORKER, "%s goes: tenants without a worker keep too much (cache-limit)", oldest);
        remove_discarded(w->cache_dir);
    }
}

// ---- the thread ---------------------------------------------------------------------------------

static enum hg_disk_fault judge_named(const struct hg_disk_watch *w, uint32_t number)
{
    const struct use most = {w->limits.named_bytes, w->limits.named_files};
    char path[PATH_BYTES];
    struct use use = {0};
    int64_t used_s = 0;
    if (!most.bytes || (size_t)snprintf(path, sizeof path, "%s/workers/%u/cache", w->cache_dir,
                           number) >= sizeof path)
        return HG_DISK_FINE;
    count_folder(AT_FDCWD, path, &most, 0, &use, &used_s);
    return use.bytes > most.bytes || use.files > most.files ? HG_DISK_NAMED : HG_DISK_FINE;
}

// Of all places as they are now, without the lock; `copy` is the thread's.
static void judge_unnamed(const struct hg_disk_watch *w, struct place *copy)
{
    struct stat st;
    struct statvfs fs;
    uint64_t tenants = 0, room, *bytes = hg_calloc(w->count, sizeof *bytes);
    if (!bytes || stat(w->cache_dir, &st) != 0 || statvfs(w->cache_dir, &fs) != 0) {
        hg_free(bytes);
        return;
    }
    room = w->limits.unnamed_bytes ? 0 : (uint64_t)fs.f_bavail * fs.f_frsize;
    for (uint32_t i = 0; i < w->count; i++) {
        struct place *p = &copy[i];
        tenants += p->pid && p->has_tenant;
        const bool seen = !p->pid || count_unnamed(p->pid, st.st_dev, &bytes[i]);
        if (p->seen && !seen)
            p->fault = HG_DISK_HIDDEN;
        p->seen |= p->pid && seen;
        room += bytes[i];
    }
    const uint64_t all = w->limits.unnamed_bytes ? w->limits.unnamed_bytes : room / 4 * 3,
                   share = all / (tenants ? tenants : 1);
    for (uint32_t i = 0; i < w->count; i++) {
        struct place *p = &copy[i];
        if (bytes[i] > share && bytes[i] > p->allowed_bytes && p->allowed_bytes)
            p->fault = HG_DISK_UNNAMED;
        else
            p->allowed_bytes = bytes[i] > share ? bytes[i] : share;
    }
    hg_free(bytes);
}

static void count_all(struct hg_disk_watch *w, struct place *copy)
{
    pthread_mutex_lock(&w->lock);
    for (uint32_t i = 0; i < w->count; i++) {
        if (copy[i].pid != w->places[i].pid)
            copy[i] = (struct place){.pid = w->places[i].pid};
        copy[i].has_tenant = w->places[i].has_tenant;
    }
    pthread_mutex_unlock(&w->lock);
    for (uint32_t i = 0; i < w->count; i++)
        copy[i].fault = copy[i].pid ? judge_named(w, i) : HG_DISK_FINE;
    judge_unnamed(w, copy);
    pthread_mutex_lock(&w->lock);
    for (uint32_t i = 0; i < w->count; i++)
        if (copy[i].pid == w->places[i].pid)
            w->places[i].fault = copy[i].fault;
    pthread_mutex_unlock(&w->lock);
}

// Waits until there is something to remove, or for so long. False: it is to end.
static bool wait(struct hg_disk_watch *w, uint64_t until_ns)
{
    pthread_mutex_lock(&w->lock);
    while (!w->stop && !w->removing && hg_cond_wait(&w->wake, &w->lock, until_ns))
        ;
    w->removing = false;
    const bool goes_on = !w->stop;
    pthread_mutex_unlock(&w->lock);
    return goes_on;
}

static void *run(void *user)
{
    struct hg_disk_watch *w = user;
    struct place *copy = hg_calloc(w->count, sizeof *copy);
    uint64_t due_ns = copy ? 0 : HG_COND_FOREVER;
    do {
        remove_discarded(w->cache_dir);
        const uint64_t begun_ns = hg_clock_now_ns();
        if (copy && begun_ns >= due_ns) {
            count_all(w, copy);
            make_room(w);
            const uint64_t rest_ns = (hg_clock_now_ns() - begun_ns) * REST_FACTOR;
            due_ns =
                hg_cond_after(rest_ns > w->limits.interval_ns ? rest_ns : w->limits.interval_ns);
        }
    } while (wait(w, due_ns));
    remove_discarded(w->cache_dir);
    hg_free(copy);
    return NULL;
}

// ---- the loop's side ----------------------------------------------------------------------------

enum hg_status hg_disk_watch_start(const char *cache_dir, uint32_t places,
    const struct hg_disk_limits *limits, struct hg_disk_watch **out)
{
    sigset_t all, before;
    *out = NULL;
    struct hg_disk_watch *w = hg_calloc(1, sizeof *w + places * sizeof w->places[0]);
    if (!w)
        return HG_E_NOMEM;
    snprintf(w->cache_dir, sizeof w->cache_dir, "%s", cache_dir);
    w->limits = *limits;
    w->count = places;
    pthread_mutex_init(&w->lock, NULL);
    hg_cond_init(&w->wake);
    sigfillset(&all); // signals are for the loop
    pthread_sigmask(SIG_SETMASK, &all, &before);
    const int rc = pthread_create(&w->thread, NULL, run, w);
    pthread_sigmask(SIG_SETMASK, &before, NULL);
    if (rc) {
        pthread_mutex_destroy(&w->lock);
        pthread_cond_destroy(&w->wake);
        hg_free(w);
        return HG_E_NOMEM;
    }
    *out = w;
    return HG_OK;
}

void hg_disk_watch_stop(struct hg_disk_watch *w)
{
    if (!w)
        return;
    pthread_mutex_lock(&w->lock);
    w->stop = true;
    pthread_cond_signal(&w->wake);
    pthread_mutex_unlock(&w->lock);
    pthread_join(w->thread, NULL);
    pthread_mutex_destroy(&w->lock);
    pthread_cond_destroy(&w->wake);
    hg_free(w);
}

void hg_disk_watch_set(struct hg_disk_watch *w, uint32_t place, pid_t pid, bool has_tenant)
{
    pthread_mutex_lock(&w->lock);
    struct place *p = &w->places[place];
    if (p->pid != pid)
        *p = (struct place){.pid = pid};
    p->has_tenant = has_tenant;
    pthread_mutex_unlock(&w->lock);
}

enum hg_disk_fault hg_disk_watch_fault(struct hg_disk_watch *w, uint32_t place, pid_t pid)
{
    pthread_mutex_lock(&w->lock);
    const struct place *p = &w->places[place];
    const enum hg_disk_fault fault = p->pid == pid ? p->fault : HG_DISK_FINE;
    pthread_mutex_unlock(&w->lock);
    return fault;
}
