#include "base/spill.h"

#include <errno.h>
#include <fcntl.h>
#include <linux/magic.h>
#include <pthread.h>
#include <signal.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <sys/statvfs.h>
#include <sys/vfs.h>
#include <unistd.h>

#include "base/alloc.h"
#include "base/checked.h"
#include "base/cond.h"
#include "base/log.h"
#include "base/spill_internal.h"

#define LOOK_NS    5000000u // between looks at what is resident
#define ARRAYS_MAX 32768u   // half of what the kernel lets a process map
#define PATH_BYTES 4096
#define WHAT_BYTES 128
#define PAGE_MASK  4095u

struct array {
    uint8_t *data;
    size_t bytes;
    char *what; // NULL: not known
    uint32_t refs;
};

static struct {
    pthread_mutex_t lock; // of all but `count`
    pthread_cond_t changed;
    char dir[PATH_BYTES];
    struct array arrays[ARRAYS_MAX]; // sorted by address
    _Atomic size_t count;            // written under the lock
    struct hg_spill_stats stats;
    uint32_t users;
    pthread_t pager; // drops pages while there are users
    bool paging;
    uint32_t turn; // of the pager; those of other turns end
    bool warned;   // that there is no file, since there was one
} spill = {.lock = PTHREAD_MUTEX_INITIALIZER};

static pthread_once_t once = PTHREAD_ONCE_INIT;

// What the thread looks at, since the first begin.
static _Thread_local struct {
    char what[WHAT_BYTES];
    uint32_t depth;
} looking;

static void init_changed(void)
{
    hg_cond_init(&spill.changed);
}

// --- files ---------------------------------------------------------------------------------------

static int open_unlinked(const char *dir)
{
    int fd = open(dir, O_TMPFILE | O_RDWR | O_CLOEXEC, 0600);
    if (fd < 0 && errno == ENOENT && mkdir(dir, 0777) == 0)
        fd = open(dir, O_TMPFILE | O_RDWR | O_CLOEXEC, 0600);
    if (fd >= 0 || (errno != EOPNOTSUPP && errno != EISDIR && errno != EINVAL))
        return fd;
    // The file system does not know of files without names. A name lives for a moment.
    char path[PATH_BYTES + 32];
    snprintf(path, sizeof path, "%s/.spill-XXXXXX", dir);
    fd = mkostemp(path, O_CLOEXEC);
    if (fd >= 0)
        unlink(path);
    return fd;
}

static bool is_memory(int fd)
{
    struct statfs fs;
    return fstatfs(fd, &fs) == 0 && (fs.f_type == TMPFS_MAGIC || fs.f_type == RAMFS_MAGIC);
}

static bool has_room(int fd, size_t bytes)
{
    struct statvfs fs;
    return fstatvfs(fd, &fs) != 0 ||
           (uint64_t)fs.f_bavail * fs.f_frsize >= bytes + HG_SPILL_SPARE_BYTES;
}

// NULL with errno set.
static void *map_file(const char *dir, size_t bytes)
{
    void *data = MAP_FAILED;
    const int fd = open_unlinked(dir);
    if (fd < 0)
        return NULL;
    int problem = is_memory(fd) ? EOPNOTSUPP : !has_room(fd, bytes) ? ENOSPC : 0;
    while (problem == 0 && (problem = posix_fallocate(fd, 0, (off_t)bytes)) == EINTR)
        problem = 0;
    if (problem == 0) {
        data = mmap(NULL, bytes, PROT_READ | PROT_WRITE, MAP_SHARED, fd, 0);
        problem = data == MAP_FAILED ? errno : 0;
    }
    close(fd);
    errno = problem;
    return problem == 0 ? data : NULL;
}

// --- the list ------------------------------------------------------------------------------------

// Index of the first array at or behind ptr.
static size_t place_of(const void *ptr)
{
    size_t low = 0, high = atomic_load(&spill.count);
    while (low < high) {
        const size_t middle = low + (high - low) / 2;
        if ((uintptr_t)spill.arrays[middle].data < (uintptr_t)ptr)
            low = middle + 1;
        else
            high = middle;
    }
    return low;
}

static struct array *find(const void *ptr)
{
    const size_t at = place_of(ptr);
    return at < atomic_load(&spill.count) && spill.arrays[at].data == ptr ? &spill.arrays[at]
                                                                          : NULL;
}

static bool add(void *data, size_t bytes, char *what)
{
    const size_t count = atomic_load(&spill.count);
    if (count >= ARRAYS_MAX)
        return false;
    const size_t at = place_of(data);
    memmove(spill.arrays + at + 1, spill.arrays + at, (count - at) * sizeof *spill.arrays);
    spill.arrays[at] = (struct array){data, bytes, what, 1};
    atomic_store(&spill.count, count + 1);
    spill.stats.bytes += bytes;
    if (spill.stats.bytes > spill.stats.peak_bytes)
        spill.stats.peak_bytes = spill.stats.bytes;
    spill.warned = false;
    return true;
}

static void drop_pages(void)
{
    for (size_t i = 0; i < atomic_load(&spill.count); i++)
        madvise(spill.arrays[i].data, spill.arrays[i].bytes, MADV_DONTNEED);
}

// --- what is resident ----------------------------------------------------------------------------

// Bytes of mapped files, libraries included, that this process has in its page tables.
static size_t mapped_resident_bytes(void)
{
    char text[128];
    unsigned long shared = 0;
    const int fd = open("/proc/self/statm", O_RDONLY | O_CLOEXEC);
    const ssize_t n = fd >= 0 ? read(fd, text, sizeof text - 1) : -1;
    if (fd >= 0)
        close(fd);
    text[n > 0 ? n : 0] = 0;
    if (sscanf(text, "%*u %*u %lu", &shared) != 1)
        return SIZE_MAX; // not to be had: as if it were too much
    return (size_t)shared * (size_t)sysconf(_SC_PAGESIZE);
}

// Distinguishes spilled arrays from other memory by the bytes that remain when they are dropped.
static void *pager_main(void *user)
{
    const uint32_t turn = (uint32_t)(uintptr_t)user;
    pthread_mutex_lock(&spill.lock);
    drop_pages();
    size_t rest = mapped_resident_bytes();
    while (spill.turn == turn) {
        hg_cond_wait(&spill.changed, &spill.lock, hg_cond_after(LOOK_NS));
        const size_t now = mapped_resident_bytes();
        if (now != SIZE_MAX && now <= rest + HG_SPILL_WINDOW_BYTES)
            continue;
        drop_pages();
        rest = mapped_resident_bytes();
    }
    pthread_mutex_unlock(&spill.lock);
    return NULL;
}

// Where all would fit the window, no thread is needed. Without a thread pages stay until the end.
static void start_pager(void)
{
    if (spill.users == 0 || spill.paging || spill.stats.bytes <= HG_SPILL_WINDOW_BYTES)
        return;
    pthread_once(&once, init_changed);
    spill.paging =
        pthread_create(&spill.pager, NULL, pager_main, (void *)(uintptr_t)spill.turn) == 0;
}

void hg_spill_begin(const char *what)
{
    if (looking.depth++ == 0)
        snprintf(looking.what, sizeof looking.what, "%s", what != NULL ? what : "");
    pthread_mutex_lock(&spill.lock);
    spill.users++;
    start_pager();
    pthread_mutex_unlock(&spill.lock);
}

void hg_spill_end(void)
{
    if (--looking.depth == 0)
        looking.what[0] = 0;
    pthread_mutex_lock(&spill.lock);
    const bool last = --spill.users == 0, join = last && spill.paging;
    const pthread_t pager = spill.pager;
    if (join) {
        spill.turn++;
        spill.paging = false;
        pthread_cond_broadcast(&spill.changed);
    }
    if (last)
        drop_pages();
    pthread_mutex_unlock(&spill.lock);
    if (join)
        pthread_join(pager, NULL);
}

// --- pages that are lost -------------------------------------------------------------------------

static struct {
    hg_spill_lost_fn *fn;
    void *user;
    struct sigaction before;
    atomic_bool lost;
    char folder[PATH_BYTES], what[WHAT_BYTES]; // of the loss: written once
} watch;

static bool describe_loss(const uint8_t *at, struct hg_spill_loss *out)
{
    const size_t behind = place_of(at + 1);
    const struct array *array = behind > 0 ? &spill.arrays[behind - 1] : NULL;
    if (array == NULL || at >= array->data + array->bytes)
        return false;
    memcpy(watch.folder, spill.dir, sizeof watch.folder);
    if (array->what != NULL)
        strncpy(watch.what, array->what, sizeof watch.what - 1);
    *out = (struct hg_spill_loss){
        watch.folder, watch.what, (uint64_t)(at - array->data), array->bytes};
    return true;
}

static bool find_loss(const siginfo_t *info, struct hg_spill_loss *out)
{
    if (info->si_code != BUS_ADRERR && info->si_code != BUS_MCEERR_AR)
        return false; // sent by a process
    pthread_mutex_lock(&spill.lock);
    const bool ours = describe_loss(info->si_addr, out);
    pthread_mutex_unlock(&spill.lock);
    return ours;
}

// Comes from an access to memory and not from within a function, so that locks may be taken: no
// thread looks at arrays with this one.
static void on_bus_error(int number, siginfo_t *info, void *context)
{
    (void)context;
    struct hg_spill_loss loss;
    while (atomic_exchange(&watch.lost, true))
        pause();
    if (find_loss(info, &loss))
        watch.fn(watch.user, &loss);
    sigaction(number, &watch.before, NULL); // and again, at once
    if (info->si_code <= 0)
        raise(number);
}

void hg_spill_watch(hg_spill_lost_fn *fn, void *user)
{
    watch.fn = fn;
    watch.user = user;
    struct sigaction action = {.sa_sigaction = on_bus_error, .sa_flags = SA_SIGINFO};
    sigemptyset(&action.sa_mask);
    sigaction(SIGBUS, &action, &watch.before);
}

// --- arrays --------------------------------------------------------------------------------------

void hg_spill_set_folder(const char *dir)
{
    pthread_mutex_lock(&spill.lock);
    spill.dir[0] = 0;
    if (dir != NULL && strlen(dir) < sizeof spill.dir)
        memcpy(spill.dir, dir, strlen(dir) + 1);
    spill.warned = false;
    pthread_mutex_unlock(&spill.lock);
}

// Once until a file could be made again: arrays come by the thousand.
static void note_refusal(const char *dir, size_t bytes, int problem)
{
    pthread_mutex_lock(&spill.lock);
    const bool warn = !spill.warned;
    spill.warned = true;
    spill.stats.refused_bytes += bytes;
    pthread_mutex_unlock(&spill.lock);
    if (warn)
        hg_warn(MAIN, "%s: no file for %zu bytes (%s): large meshes stay in memory", dir, bytes,
            problem == EOPNOTSUPP ? "a file system in memory" : strerror(problem));
}

void *hg_spill_calloc(size_t count, size_t size)
{
    char dir[PATH_BYTES];
    size_t bytes;
    if (!hg_mul_size(count, size, &bytes) || bytes > PTRDIFF_MAX - PAGE_MASK)
        return NULL;
    pthread_mutex_lock(&spill.lock);
    memcpy(dir, spill.dir, strlen(spill.dir) + 1);
    pthread_mutex_unlock(&spill.lock);
    if (bytes < HG_SPILL_FROM_BYTES || dir[0] == 0)
        return hg_calloc(count, size);
    if (hg_alloc_should_fail())
        return NULL;
    void *data = map_file(dir, bytes);
    int problem = errno;
    char *what = data != NULL && looking.what[0] != 0 ? hg_strdup(looking.what) : NULL;
    pthread_mutex_lock(&spill.lock);
    if (data != NULL && !add(data, bytes, what)) {
        munmap(data, bytes);
        data = NULL;
        problem = ENOMEM;
    }
    if (data != NULL)
        start_pager();
    pthread_mutex_unlock(&spill.lock);
    if (data != NULL)
        return data;
    hg_free(what);
    note_refusal(dir, bytes, problem);
    return hg_calloc(count, size);
}

void *hg_spill_scratch(size_t count, size_t size)
{
    size_t bytes;
    return hg_mul_size(count, size, &bytes) && bytes >= HG_SPILL_SCRATCH_BYTES
               ? hg_spill_calloc(count, size)
               : hg_calloc(count, size);
}

// Heap memory hardly ever begins a page.
static bool may_be_spilled(const void *ptr)
{
    return ptr != NULL && ((uintptr_t)ptr & PAGE_MASK) == 0 && atomic_load(&spill.count) > 0;
}

bool hg_spill_share(void *ptr)
{
    if (!may_be_spilled(ptr))
        return false;
    pthread_mutex_lock(&spill.lock);
    struct array *array = find(ptr);
    if (array != NULL)
        array->refs++;
    pthread_mutex_unlock(&spill.lock);
    return array != NULL;
}

bool hg_spill_unref(void *ptr)
{
    if (!may_be_spilled(ptr))
        return false;
    pthread_mutex_lock(&spill.lock);
    struct array *array = find(ptr);
    char *what = NULL;
    size_t bytes = 0;
    if (array != NULL && --array->refs == 0) {
        const size_t at = (size_t)(array - spill.arrays), count = atomic_load(&spill.count) - 1;
        bytes = array->bytes;
        what = array->what;
        memmove(array, array + 1, (count - at) * sizeof *array);
        atomic_store(&spill.count, count);
        spill.stats.bytes -= bytes;
    }
    pthread_mutex_unlock(&spill.lock);
    const bool found = array != NULL;
    if (bytes > 0) {
        munmap(ptr, bytes);
        hg_free(what);
    }
    return found;
}

size_t hg_spill_size(const void *ptr)
{
    if (!may_be_spilled(ptr))
        return 0;
    pthread_mutex_lock(&spill.lock);
    const struct array *array = find(ptr);
    const size_t bytes = array != NULL ? array->bytes : 0;
    pthread_mutex_unlock(&spill.lock);
    return bytes;
}

void hg_spill_stats(struct hg_spill_stats *out)
{
    pthread_mutex_lock(&spill.lock);
    *out = spill.stats;
    out->arrays = (uint32_t)atomic_load(&spill.count);
    pthread_mutex_unlock(&spill.lock);
}
