#include "server/broker/worker_process.h"

#include <errno.h>
#include <fcntl.h>
#include <signal.h>
#include <spawn.h>
#include <stdio.h>
#include <string.h>
#include <sys/resource.h>
#include <unistd.h>

#include "base/log.h"
#include "base/program.h"

enum { WORKER_FD = 3, MAX_ARGS = 1024, SEED_NICE = 19 };

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

struct arguments {
    char *items[MAX_ARGS];
    char text[12][32]; // numbers in words
    int count, texts;
    char program[HG_HOME_PATH], cache_dir[HG_HOME_PATH], upload_dir[HG_HOME_PATH];
    char seed[HG_HOME_PATH];
};

static void add(struct arguments *a, const char *text)
{
    if (a->count + 1 < MAX_ARGS)
        a->items[a->count++] = (char *)text;
}

static void add_mib(struct arguments *a, const char *flag, uint64_t bytes)
{
    if (!bytes)
        return;
    char *text = a->text[a->texts++];
    snprintf(text, sizeof a->text[0], "%llu", (unsigned long long)(bytes >> 20));
    add(a, flag);
    add(a, text);
}

static void add_number(struct arguments *a, const char *flag, double value)
{
    char *text = a->text[a->texts++];
    snprintf(text, sizeof a->text[0], "%g", value);
    add(a, flag);
    add(a, text);
}

static void add_text(struct arguments *a, const char *flag, const char *text)
{
    if (!text)
        return;
    add(a, flag);
    add(a, text);
}

// What a tenant's baked data may take: those that have workers share half of it, the rest is for
// those that have none.
static uint64_t share_of_cache(const struct hg_options *o)
{
    const uint64_t share = o->cache_limit_bytes / 2 / o->max_workers, least = 1 << 20;
    return !o->cache_limit_bytes || share > least ? share : least;
}

// The folders that it reads and writes. False: a name is too long.
static bool add_folders(struct arguments *a, const struct hg_worker_start *s)
{
    const struct hg_options *o = s->options;
    const bool has_home = s->home && s->home->homes;
    if (has_home || s->seed) {
        if ((size_t)snprintf(a->seed, sizeof a->seed, "%s/seed%s", o->cache_dir,
                s->seed ? "" : "/shaders") >= sizeof a->seed)
            return false;
    }
    if (!has_home) {
        add_text(a, "--cache-dir", s->seed ? a->seed : o->cache_dir);
        add_mib(a, "--cache-limit", o->cache_limit_bytes);
        return true;
    }
    if (!hg_home_path(s->home, "cache", a->cache_dir, sizeof a->cache_dir) ||
        !hg_home_path(s->home, "uploads", a->upload_dir, sizeof a->upload_dir))
        return false;
    add_text(a, "--cache-dir", a->cache_dir);
    add_text(a, "--upload-dir", a->upload_dir);
    add_text(a, "--shader-seed", a->seed);
    add_mib(a, "--cache-limit", share_of_cache(o));
    return true;
}

static int make_arguments(struct arguments *a, const struct hg_worker_start *s)
{
    const struct hg_options *o = s->options;
    *a = (struct arguments){0};
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
    return 0;
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
// have a home use their own.
static void choose_environment(char **out, size_t capacity, bool has_home)
{
    size_t count = 0;
    for (char **it = environ; *it && count + 1 < capacity; it++)
        if (is_for_worker(*it) && !(has_home && strncmp(*it, "MESA_SHADER_CACHE_DIR=", 22) == 0))
            out[count++] = *it;
    out[count] = NULL;
}

// ---- starting -----------------------------------------------------------------------------------

static int spawn(const struct hg_worker_start *s, struct arguments *a, pid_t *pid)
{
    posix_spawn_file_actions_t actions;
    posix_spawnattr_t attributes;
    sigset_t none, standard;
    char *variables[MAX_ARGS];
    choose_environment(variables, MAX_ARGS, (s->home && s->home->homes) || s->seed);
    sigemptyset(&none);
    sigfillset(&standard);
    posix_spawn_file_actions_init(&actions);
    posix_spawn_file_actions_addopen(&actions, 0, "/dev/null", O_RDONLY, 0);
    if (s->fd >= 0)
        posix_spawn_file_actions_adddup2(&actions, s->fd, WORKER_FD);
    posix_spawn_file_actions_addclosefrom_np(&actions, s->fd >= 0 ? WORKER_FD + 1 : WORKER_FD);
    posix_spawnattr_init(&attributes);
    posix_spawnattr_setsigmask(&attributes, &none);
    posix_spawnattr_setsigdefault(&attributes, &standard);
    posix_spawnattr_setpgroup(&attributes, 0); // a ^C is for the broker, which drains
    posix_spawnattr_setflags(
        &attributes, POSIX_SPAWN_SETSIGMASK | POSIX_SPAWN_SETSIGDEF | POSIX_SPAWN_SETPGROUP);
    int rc = posix_spawn(pid, a->program, &actions, &attributes, a->items, variables);
    posix_spawn_file_actions_destroy(&actions);
    posix_spawnattr_destroy(&attributes);
    return rc;
}

// Where memory is short the kernel ends a worker, whose scenes come back, not the daemon.
static void make_first_victim(pid_t pid)
{
    char path[64];
    snprintf(path, sizeof path, "/proc/%d/oom_score_adj", (int)pid);
    int fd = open(path, O_WRONLY | O_CLOEXEC);
    if (fd < 0 || write(fd, "500", 3) != 3)
        hg_debug(WORKER, "%s: %s", path, strerror(errno));
    if (fd >= 0)
        close(fd);
}

int hg_worker_process_start(const struct hg_worker_start *s, pid_t *pid)
{
    struct arguments arguments;
    *pid = 0;
    int rc = make_arguments(&arguments, s);
    if (!rc)
        rc = spawn(s, &arguments, pid);
    if (rc) {
        *pid = 0;
        return rc;
    }
    make_first_victim(*pid);
    if (s->seed)
        setpriority(PRIO_PROCESS, (id_t)*pid, SEED_NICE); // nobody waits for it
    return 0;
}
