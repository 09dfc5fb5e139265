// process.c - what a process that renders sets once, before it starts threads.
#include <errno.h>
#include <malloc.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>

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
    // The device room would do it, too, but by then other threads may be reading the environment.
    if (snprintf(path, sizeof path, "%s/shaders", cache_dir) < (int)sizeof path)
        setenv("MESA_SHADER_CACHE_DIR", path, 0);
    if (spill && snprintf(path, sizeof path, "%s/store", cache_dir) < (int)sizeof path)
        hg_spill_set_folder(path);
}
