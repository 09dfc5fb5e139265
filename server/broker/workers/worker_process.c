#include "server/broker/workers/worker_process.h"

#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "base/file.h"
#include "base/log.h"
#include "base/program.h"

extern char **environ;

bool hg_worker_process_find(const struct hg_options *options, char *path, size_t size)
{
    if (options->worker && *options->worker)
        snprintf(path, size, "%s", options->worker);
    else
        hg_program_path("HELIO_WORKER", "helio-worker", path, size);
    return access(path, X_OK) == 0;
}

// ---- arguments ----------------------------------------------------------------------------------

static void add(struct hg_worker_arguments *a, const char *text)
{
    if (a->count + 1 < HG_WORKER_ARGUMENTS)
        a->items[a->count++] = (char *)text;
}

static void add_mib(struct hg_worker_arguments *a, const char *flag, uint64_t bytes)
{
    if (!bytes)
        return;
    char *text = a->text[a->texts++];
    snprintf(text, sizeof a->text[0], "%llu", (unsigned long long)(bytes >> 20));
    add(a, flag);
    add(a, text);
}

static void add_number(struct hg_worker_arguments *a, const char *flag, double value)
{
    char *text = a->text[a->texts++];
    snprintf(text, sizeof a->text[0], "%g", value);
    add(a, flag);
    add(a, text);
}

static void add_text(struct hg_worker_arguments *a, const char *flag, const char *text)
{
    if (!text)
        return;
    add(a, flag);
    add(a, text);
}

uint64_t hg_worker_cache_share(const struct hg_options *o)
{
    const uint64_t share = o->cache_limit_bytes / 2 / o->max_workers, least = 1 << 20;
    return !o->cache_limit_bytes || share > least ? share : least;
}

static bool has_home(const struct hg_worker_start *s)
{
    return s->home && s->home->homes;
}

// The folders that it reads and writes. False: a name is too long.
static bool add_folders(struct hg_worker_arguments *a, const struct hg_worker_start *s)
{
    const struct hg_options *o = s->options;
    if (has_home(s) || s->seed) {
        if ((size_t)snprintf(a->seed, sizeof a->seed, "%s/seed%s", o->cache_dir,
                s->seed ? "" : "/shaders") >= sizeof a->seed)
            return false;
    }
    if (!has_home(s)) {
        snprintf(a->cache_dir, sizeof a->cache_dir, "%s", s->seed ? a->seed : o->cache_dir);
        add_text(a, "--cache-dir", a->cache_dir);
        add_mib(a, "--cache-limit", o->cache_limit_bytes);
        return true;
    }
    if (!hg_home_path(s->home, "cache", a->cache_dir, sizeof a->cache_dir) ||
        !hg_home_path(s->home, "given", a->upload_dir, sizeof a->upload_dir))
        return false;
    add_text(a, "--cache-dir", a->cache_dir);
    add_text(a, "--upload-dir", a->upload_dir);
    add_text(a, "--shader-seed", a->seed);
    add_mib(a, "--cache-limit", hg_worker_cache_share(o));
    return true;
}

// What a worker needs of the environment: where the driver and the C library find things, and what
// tests and sanitizers set. Secrets that the daemon was started with are none of its business.
static bool is_for_worker(const char *variable)
{
    static const char *const prefixes[] = {"HELIO_", "VK_", "MESA_", "LP_", "GALLIUM_", "LIBGL_",
        "EGL_", "__GL", "__VK", "__EGL", "NVIDIA_", "CUDA_", "AMD_", "RADV_", "ANV_", "INTEL_",
        "DRI_", "DISABLE_", "ENABLE_", "XDG_", "LC_", "ASAN_", "UBSAN_", "TSAN_", "LSAN_", "OIIO_",
        "OPENIMAGEIO_", "LD_LIBRARY_PATH=", "LD_PRELOAD=", "PATH=", "HOME=", "LANG=", "TZ=",
        "TMPDIR=", "LLVM_PROFILE_FILE="};
    for (size_t i = 0; i < sizeof prefixes / sizeof *prefixes; i++)
        if (strncmp(variable, prefixes[i], strlen(prefixes[i])) == 0)
            return true;
    return false;
}

// Where the environment names a folder for compiled shaders it is that of everybody: workers that
// have a home use their own, which has a limit.
static void choose_environment(char **out, size_t capacity, bool own_shaders)
{
    static char limit[] = "MESA_SHADER_CACHE_MAX_SIZE=256M"; // HG_WORKER_SHADER_BYTES
    size_t count = 0;
    for (char **it = environ; *it && count + 2 < capacity; it++)
        if (is_for_worker(*it) && !(own_shaders && strncmp(*it, "MESA_SHADER_CACHE_DIR=", 22) == 0))
            out[count++] = *it;
    if (own_shaders) // where it is set already that counts, which is before it
        out[count++] = limit;
    out[count] = NULL;
}

int hg_worker_arguments_make(struct hg_worker_arguments *a, const struct hg_worker_start *s)
{
    const struct hg_options *o = s->options;
    *a = (struct hg_worker_arguments){0};
    if (!hg_worker_process_find(o, a->program, sizeof a->program))
        return ENOENT;
    add(a, a->program);
    if (s->fd >= 0)
        add_text(a, "--fd", "3");
    for (size_t i = 0; i < o->asset_root.count && !s->seed; i++)
        add_text(a, "--asset-root", o->asset_root.items[i]);
    if (!add_folders(a, s))
        return ENAMETOOLONG;
    add_mib(a, "--memory-limit", s->memory_bytes);
    add_mib(a, "--texture-budget", o->texture_budget_bytes);
    add_mib(a, "--geometry-budget", o->geometry_budget_bytes);
    add_mib(a, "--host-budget", o->host_budget_bytes);
    add_text(a, "--device", o->device);
    add_text(a, "--log", o->log);
    add_text(a, "--shader-dir", o->shader_dir);
    if (o->validation)
        add(a, "--validation");
    if (s->warm_up)
        add(a, "--warm-up");
    if (s->seed)
        add(a, "--compile-shaders");
    add_text(a, "--sandbox", o->sandbox);
    add_number(a, "--loader-cpu", (double)o->loader_cpu);
    add_mib(a, "--loader-memory", o->loader_memory_bytes);
    add_number(a, "--loader-timeout", (double)o->loader_timeout_ns / 1e9);
    if (s->no_spill)
        add(a, "--no-spill");
    choose_environment(a->variables, HG_WORKER_ARGUMENTS, has_home(s) || s->seed);
    return 0;
}

// Where memory is short the kernel ends a worker, whose scenes come back, not the daemon.
void hg_worker_process_make_first_victim(void)
{
    const int fd = open("/proc/self/oom_score_adj", O_WRONLY | O_CLOEXEC);
    if (fd >= 0 && write(fd, "500", 3) != 3)
        hg_debug(WORKER, "oom_score_adj: %s", strerror(errno));
    if (fd >= 0)
        close(fd);
}

enum hg_status hg_worker_process_check_roots(const struct hg_options *o, struct hg_error *err)
{
    struct stat st;
    for (size_t i = 0; i < o->asset_root.count; i++) {
        const char *root = o->asset_root.items[i];
        if (stat(root, &st) == 0 && !S_ISDIR(st.st_mode))
            errno = ENOTDIR;
        else if (access(root, F_OK) == 0)
            continue;
        return hg_error_set(err, hg_status_from_errno(errno), root, NULL,
            "--asset-root: no worker starts without it: %s", strerror(errno));
    }
    return HG_OK;
}
