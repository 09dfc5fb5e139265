// full_disk.c - a disk that is full, for users who may not mount one: preloaded into a program, it
// refuses writes to files below HELIO_FULL_DIR with ENOSPC once the files there would have more
// than HELIO_FULL_BYTES bytes. A write that fits in part is done in part, as disks do.
#include <dirent.h>
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#define FILES 1024

// The real calls, looked up by name; none of them is a variadic one.
typedef ssize_t write_fn(int, const void *, size_t);
typedef ssize_t pwrite_fn(int, const void *, size_t, off_t);
typedef int open_fn(const char *, int, ...);
typedef int fallocate_fn(int, off_t, off_t);

// Files below the folder, by descriptor: a descriptor may be something else by now.
static struct {
    dev_t dev;
    ino_t ino;
} files[FILES];

static void *real(const char *name)
{
    void *f = dlsym(RTLD_NEXT, name);
    if (f == NULL)
        abort();
    return f;
}

static long long bytes_below(const char *dir, int depth)
{
    char path[4096];
    long long sum = 0;
    DIR *d = opendir(dir);
    for (struct dirent *e; d != NULL && (e = readdir(d)) != NULL;) {
        struct stat st;
        snprintf(path, sizeof path, "%s/%s", dir, e->d_name);
        if (strcmp(e->d_name, ".") == 0 || strcmp(e->d_name, "..") == 0 || lstat(path, &st) != 0)
            continue;
        if (S_ISREG(st.st_mode))
            sum += st.st_size;
        else if (S_ISDIR(st.st_mode) && depth < 4)
            sum += bytes_below(path, depth + 1);
    }
    if (d != NULL)
        closedir(d);
    return sum;
}

static void note(int fd, const char *path)
{
    const char *dir = getenv("HELIO_FULL_DIR");
    struct stat st;
    if (fd < 0 || fd >= FILES)
        return;
    memset(&files[fd], 0, sizeof files[fd]);
    if (dir == NULL || strncmp(path, dir, strlen(dir)) != 0 || fstat(fd, &st) != 0 ||
        !S_ISREG(st.st_mode))
        return;
    files[fd].dev = st.st_dev;
    files[fd].ino = st.st_ino;
}

// How much of `size` bytes may be written at `offset` (-1: at the end).
static size_t room(int fd, size_t size, off_t offset)
{
    struct stat st;
    if (fd < 0 || fd >= FILES || files[fd].ino == 0 || fstat(fd, &st) != 0 ||
        st.st_ino != files[fd].ino || st.st_dev != files[fd].dev)
        return size;
    const long long limit = atoll(getenv("HELIO_FULL_BYTES"));
    const long long left = limit - bytes_below(getenv("HELIO_FULL_DIR"), 0);
    const long long within = offset >= 0 && st.st_size > offset ? st.st_size - offset : 0;
    const long long fits = (left > 0 ? left : 0) + within;
    return (long long)size <= fits ? size : (size_t)fits;
}

int open(const char *path, int flags, ...)
{
    static open_fn *next;
    va_list list;
    va_start(list, flags);
    const mode_t mode = (flags & (O_CREAT | O_TMPFILE)) != 0 ? va_arg(list, mode_t) : 0;
    va_end(list);
    if (next == NULL)
        next = (open_fn *)real("open");
    const int fd = next(path, flags, mode);
    note(fd, path);
    return fd;
}

int open64(const char *path, int flags, ...)
{
    va_list list;
    va_start(list, flags);
    const mode_t mode = (flags & (O_CREAT | O_TMPFILE)) != 0 ? va_arg(list, mode_t) : 0;
    va_end(list);
    return open(path, flags | O_LARGEFILE, mode);
}

ssize_t pwrite(int fd, const void *data, size_t size, off_t offset)
{
    static pwrite_fn *next;
    if (next == NULL)
        next = (pwrite_fn *)real("pwrite");
    const size_t some = room(fd, size, offset);
    if (some == 0 && size > 0) {
        errno = ENOSPC;
        return -1;
    }
    return next(fd, data, some, offset);
}

ssize_t pwrite64(int fd, const void *data, size_t size, off64_t offset)
{
    return pwrite(fd, data, size, offset);
}

ssize_t write(int fd, const void *data, size_t size)
{
    static write_fn *next;
    if (next == NULL)
        next = (write_fn *)real("write");
    const size_t some = room(fd, size, -1);
    if (some == 0 && size > 0) {
        errno = ENOSPC;
        return -1;
    }
    return next(fd, data, some);
}

// Blocks that are reserved need as much room as blocks that are written.
int posix_fallocate(int fd, off_t offset, off_t size)
{
    static fallocate_fn *next;
    if (next == NULL)
        next = (fallocate_fn *)real("posix_fallocate");
    return room(fd, (size_t)size, offset) < (size_t)size ? ENOSPC : next(fd, offset, size);
}

int posix_fallocate64(int fd, off64_t offset, off64_t size)
{
    return posix_fallocate(fd, offset, size);
}
