// lost_disk.c - a disk that does not give back what was put there: preloaded into a program, it
// takes the blocks of the files that were reserved and mapped. Their pages are gone, as pages are
// that cannot be read. Files are taken at SIGUSR1, or the n-th one at once with HELIO_LOSE=n.
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <signal.h>
#include <stdatomic.h>
#include <stdlib.h>
#include <unistd.h>

#define FILES 4096

typedef int fallocate_fn(int, off_t, off_t);

static int files[FILES];
static atomic_int count;

static void take(int fd)
{
    if (ftruncate(fd, 0) != 0)
        abort();
}

static void take_all(int number)
{
    (void)number;
    for (int i = 0; i < atomic_load(&count); i++)
        take(files[i]);
}

__attribute__((constructor)) static void begin(void)
{
    signal(SIGUSR1, take_all);
}

int posix_fallocate(int fd, off_t offset, off_t size)
{
    fallocate_fn *next = (fallocate_fn *)dlsym(RTLD_NEXT, "posix_fallocate");
    const int problem = next != NULL ? next(fd, offset, size) : ENOSYS;
    const int copy = problem == 0 ? fcntl(fd, F_DUPFD_CLOEXEC, 1000) : -1;
    if (copy < 0)
        return problem;
    const int at = atomic_load(&count);
    const char *lose = getenv("HELIO_LOSE");
    if (at >= FILES)
        abort();
    files[at] = copy;
    atomic_store(&count, at + 1);
    if (lose != NULL && atoi(lose) == at + 1)
        take(copy);
    return 0;
}

int posix_fallocate64(int fd, off64_t offset, off64_t size)
{
    return posix_fallocate(fd, offset, size);
}
