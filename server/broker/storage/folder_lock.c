#include "server/broker/storage/folder_lock.h"

#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include "base/alloc.h"
#include "base/clock.h"
#include "base/file.h"

// A daemon that was killed while it started a process: that one has its descriptors, the lock among
// them, until it executes its program.
enum { LOCK_TRIES = 100, LOCK_STEP_NS = 10000000, NUMBER_BYTES = 16 };

static enum hg_status fail_errno(
    struct hg_error *err, const char *path, const char *option, const char *action)
{
    const int e = errno;
    return hg_error_set(err, hg_status_from_errno(e), path, NULL, "%s%scannot %s: %s",
        option ? option : "", option ? ": " : "", action, strerror(e));
}

char *hg_folder_path(const char *folder, const char *name)
{
    size_t size = strlen(folder) + strlen(name) + 2;
    char *path = hg_calloc(size, 1);
    if (path)
        snprintf(path, size, "%s/%s", folder, name);
    return path;
}

enum hg_status hg_folder_make(const char *folder, struct hg_error *err)
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
            status = fail_errno(err, path, NULL, "make the folder");
        if (slash)
            *slash = '/';
    }
    hg_free(path);
    return status;
}

static enum hg_status refuse(const char *path, const char *option, int fd, struct hg_error *err)
{
    char text[NUMBER_BYTES] = "";
    const ssize_t size = pread(fd, text, sizeof text - 1, 0);
    const int number = size > 0 ? atoi(text) : 0;
    if (number > 0)
        return hg_error_set(err, HG_E_BUSY, path, NULL,
            "%s: another heliod uses this folder (process %d)", option, number);
    return hg_error_set(err, HG_E_BUSY, path, NULL, "%s: another heliod uses this folder", option);
}

// Who reads it only wants to know whom to ask: no error if it cannot be written.
static void write_number(int fd)
{
    char text[NUMBER_BYTES];
    const int size = snprintf(text, sizeof text, "%d\n", (int)getpid());
    if (ftruncate(fd, 0) == 0 && pwrite(fd, text, (size_t)size, 0) != size)
        (void)!ftruncate(fd, 0);
}

enum hg_status hg_folder_lock(
    const char *path, const char *option, bool patient, int *fd, struct hg_error *err)
{
    char name[PATH_MAX];
    if ((size_t)snprintf(name, sizeof name, "%s/lock", path) >= sizeof name)
        return hg_error_set(err, HG_E_LIMIT, option, NULL, "the name is too long");
    *fd = open(name, O_RDWR | O_CREAT | O_CLOEXEC | O_NOFOLLOW, 0600);
    if (*fd < 0)
        return fail_errno(err, path, option, "write to the folder");
    int failed = flock(*fd, LOCK_EX | LOCK_NB);
    for (int i = 0; failed && errno == EWOULDBLOCK && patient && i < LOCK_TRIES; i++) {
        hg_clock_sleep_ns(LOCK_STEP_NS);
        failed = flock(*fd, LOCK_EX | LOCK_NB);
    }
    if (!failed) {
        write_number(*fd);
        return HG_OK;
    }
    enum hg_status status = errno == EWOULDBLOCK ? refuse(path, option, *fd, err)
                                                 : fail_errno(err, path, option, "lock the folder");
    close(*fd);
    *fd = -1;
    return status;
}
