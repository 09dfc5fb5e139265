// bad_sync.c - a disk that does not take what is synced: preloaded into a program, fsync of files
// fails with EIO as long as the file HELIO_SYNC_FAILS is there.
#include <dlfcn.h>
#include <errno.h>
#include <stdlib.h>
#include <sys/stat.h>
#include <unistd.h>

typedef int fsync_fn(int);

int fsync(int fd)
{
    const char *flag = getenv("HELIO_SYNC_FAILS");
    fsync_fn *next = (fsync_fn *)dlsym(RTLD_NEXT, "fsync");
    struct stat st;
    if (flag && stat(flag, &st) == 0 && fstat(fd, &st) == 0 && S_ISREG(st.st_mode)) {
        errno = EIO;
        return -1;
    }
    return next ? next(fd) : fdatasync(fd);
}
