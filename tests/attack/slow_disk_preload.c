// slow_disk_preload.c - a disk that stands still, or fails: preloaded into heliod, it acts on the
// files of uploads that are still arriving. In the folder HELIO_SLOW_DISK
//   hold         naming a content waits as long as this file is there, and makes the file `held`
//   fail-link    naming a content fails with the error number in this file
//   fail-write   writing a content does
// Test code.
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

typedef int link_fn(const char *from, const char *to);
typedef ssize_t write_fn(int fd, const void *data, size_t size);

static bool path_of(const char *name, char path[512])
{
    const char *folder = getenv("HELIO_SLOW_DISK");
    return folder && snprintf(path, 512, "%s/%s", folder, name) < 512;
}

static bool is_there(const char *name)
{
    struct stat st;
    char path[512];
    return path_of(name, path) && stat(path, &st) == 0;
}

// The error number in a file; 0: it is not there.
static int fault(const char *name)
{
    char path[512], text[16] = "";
    FILE *file = path_of(name, path) ? fopen(path, "re") : NULL;
    if (!file)
        return 0;
    if (!fgets(text, sizeof text, file))
        text[0] = 0;
    fclose(file);
    return atoi(text);
}

static void make(const char *name)
{
    char path[512];
    const int fd = path_of(name, path) ? open(path, O_WRONLY | O_CREAT | O_CLOEXEC, 0600) : -1;
    if (fd >= 0)
        close(fd);
}

int link(const char *from, const char *to)
{
    link_fn *next = (link_fn *)dlsym(RTLD_NEXT, "link");
    if (strstr(from, "/.incoming.")) {
        const int e = fault("fail-link");
        while (is_there("hold")) {
            make("held");
            usleep(1000);
        }
        if (e) {
            errno = e;
            return -1;
        }
    }
    return next(from, to);
}

ssize_t write(int fd, const void *data, size_t size)
{
    write_fn *next = (write_fn *)dlsym(RTLD_NEXT, "write");
    const int e = is_there("fail-write") ? fault("fail-write") : 0;
    char proc[64], path[512];
    if (e) {
        snprintf(proc, sizeof proc, "/proc/self/fd/%d", fd);
        const ssize_t length = readlink(proc, path, sizeof path - 1);
        path[length > 0 ? length : 0] = 0;
        if (strstr(path, "/.incoming.")) {
            errno = e;
            return -1;
        }
    }
    return next(fd, data, size);
}
