// process.c - what a process that renders sets once, before it starts threads.
#include <errno.h>
#include <fcntl.h>
#include <malloc.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/statvfs.h>
#include <unistd.h>

#include "base/log.h"
#include "base/spill.h"
#include "renderer/renderer.h"

enum { KEPT_FREE_BYTES = 64 << 20, MAPPED_BYTES = 8 << 20 };

// Open packs hold a file descriptor each, and a scene may have thousands of textures.
static void allow_files(void)
{
    struct rlimit files;
    if (getrlimit(RLIMIT_NOFILE, &files) == 0 && files.rlim_cur < files.rlim_max) {
        files.rlim_cur = files.rlim_max;
        if (setrlimit(RLIMIT_NOFILE, &files) != 0)
            hg_debug(WORKER, "files: %s", strerror(errno));
    }
}

// ---- Mesa's shader cache ------------------------------------------------------------------------

// Mesa maps its index of compiled shaders, a file with holes (src/util/disk_cache_os.c): a page of
// it that the disk has no room for is SIGBUS. Its blocks are taken here, before Mesa maps it; where
// they cannot be had, Mesa keeps no shaders. Later versions keep a data base, which they do not
// map.
enum {
    INDEX_BYTES = 8 + 65536 * 20,
    SHADERS_BYTES = 16 << 20, // room that must be there where blocks cannot be reserved
};

// 0, or why the index cannot have all of its blocks.
static int reserve_blocks(int fd)
{
    struct stat st;
    struct statvfs disk;
    if (fstat(fd, &st) != 0)
        return errno;
    const off_t size = st.st_size > INDEX_BYTES ? st.st_size : INDEX_BYTES;
    int failed;
    do
        failed = fallocate(fd, 0, 0, size) == 0 ? 0 : errno;
    while (failed == EINTR);
    if (failed != EOPNOTSUPP && failed != ENOSYS)
        return failed;
    if (fstatvfs(fd, &disk) != 0)
        return errno;
    return (uint64_t)disk.f_bavail * disk.f_frsize < SHADERS_BYTES ? ENOSPC : 0;
}

static int reserve_index(const char *folder)
{
    char path[4200];
    if (mkdir(folder, 0700) != 0 && errno != EEXIST)
        return errno;
    snprintf(path, sizeof path, "%s/mesa_shader_cache", folder);
    if (mkdir(path, 0700) != 0 && errno != EEXIST)
        return errno;
    strncat(path, "/index", sizeof path - strlen(path) - 1);
    const int fd = open(path, O_RDWR | O_CREAT | O_CLOEXEC, 0644);
    if (fd < 0)
        return errno;
    const int failed = reserve_blocks(fd);
    close(fd);
    return failed;
}

// The device room would set it, too, but by then other threads may be reading the environment.
static void set_shader_cache(const char *cache_dir)
{
    char path[4096];
    if (snprintf(path, sizeof path, "%s/shaders", cache_dir) >= (int)sizeof path)
        return;
    setenv("MESA_SHADER_CACHE_DIR", path, 0);
    const char *folder = getenv("MESA_SHADER_CACHE_DIR");
    if (mkdir(cache_dir, 0700) != 0 && errno != EEXIST)
        hg_debug(WORKER, "%s: %s", cache_dir, strerror(errno));
    const int failed = folder ? reserve_index(folder) : ENOMEM;
    if (!failed)
        return;
    setenv("MESA_SHADER_CACHE_DISABLE", "true", 1);
    hg_warn(
        WORKER, "compiled shaders are not kept: %s: %s", folder ? folder : path, strerror(failed));
}

void hg_renderer_prepare_process(const char *cache_dir, bool spill)
{
    char path[4096];
    // Software rasterisers take and free megabytes with every draw, and so do pictures that are
    // read: kept, not faulted in again. (Setting the first alone would map all from 128 KiB on.)
    mallopt(M_TRIM_THRESHOLD, KEPT_FREE_BYTES);
    mallopt(M_MMAP_THRESHOLD, MAPPED_BYTES);
    allow_files();
    if (!cache_dir)
        return;
    set_shader_cache(cache_dir);
    if (spill && snprintf(path, sizeof path, "%s/store", cache_dir) < (int)sizeof path)
        hg_spill_set_folder(path);
}
