// main.c - helio-worker: renders for one broker, or for one client in a private worker.
//
// Usage: helio-worker --fd N [options]; started by heliod and libhelio, not by people.
#include <errno.h>
#include <fcntl.h>
#include <getopt.h>
#include <pthread.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "base/alloc.h"
#include "base/jobs.h"
#include "base/log.h"
#include "renderer/debug_environment.h"
#include "renderer/renderer.h"
#include "server/worker/dispatch.h"
#include "server/worker/encode/encode_queue.h"
#include "server/worker/io_thread.h"
#include "server/worker/reply.h"
#include "server/worker/sandbox.h"
#include "server/worker/shader_seed.h"

enum { EXIT_USAGE = 2, EXIT_DEVICE = 7, EXIT_DISK = WORKER_EXIT_DISK };

static const struct option long_options[] = {
    {"fd", required_argument, NULL, 'f'},
    {"asset-root", required_argument, NULL, 'a'},
    {"cache-dir", required_argument, NULL, 'c'},
    {"upload-dir", required_argument, NULL, 'U'},
    {"shader-seed", required_argument, NULL, 'S'},
    {"compile-shaders", no_argument, NULL, 'k'},
    {"shader-dir", required_argument, NULL, 's'},
    {"memory-limit", required_argument, NULL, 'm'},
    {"texture-budget", required_argument, NULL, 't'},
    {"geometry-budget", required_argument, NULL, 'g'},
    {"host-budget", required_argument, NULL, 'h'},
    {"cache-limit", required_argument, NULL, 'C'},
    {"device", required_argument, NULL, 'd'},
    {"threads", required_argument, NULL, 'T'},
    {"log", required_argument, NULL, 'l'},
    {"validation", no_argument, NULL, 'v'},
    {"warm-up", no_argument, NULL, 'w'},
    {"sandbox", required_argument, NULL, 'n'},
    {"loader-cpu", required_argument, NULL, 'x'},
    {"loader-memory", required_argument, NULL, 'M'},
    {"loader-timeout", required_argument, NULL, 'o'},
    {"no-spill", no_argument, NULL, 'p'},
    {"device-info", no_argument, NULL, 'i'},
    {0},
};

static bool parse_mib(const char *text, uint64_t *bytes)
{
    char *end;
    errno = 0;
    unsigned long long mib = strtoull(text, &end, 10);
    if (errno || end == text || *end || text[0] == '-' || mib > (UINT64_MAX >> 21))
        return false;
    *bytes = (uint64_t)mib << 20;
    return true;
}

static bool add_root(struct worker_options *o, const char *path)
{
    char *real = realpath(path, NULL);
    size_t count = (size_t)o->asset_root_count + 1;
    char **roots = real ? hg_realloc(o->asset_roots, count, sizeof *roots) : NULL;
    if (!roots) {
        fprintf(stderr, "helio-worker: --asset-root %s: %s\n", path, strerror(errno));
        free(real);
        return false;
    }
    roots[o->asset_root_count++] = real;
    o->asset_roots = roots;
    return true;
}

static bool apply_option(struct worker_options *o, int option)
{
    struct hg_error err = {0};
    switch (option) {
    case 'f':
        o->fd = atoi(optarg);
        return o->fd > 2;
    case 'a':
        return add_root(o, optarg);
    case 'c':
        o->cache_dir = optarg;
        return true;
    case 'U':
        o->upload_dir = optarg;
        return true;
    case 'S':
        o->shader_seed = optarg;
        return true;
    case 'k':
        return o->compile_shaders = true;
    case 's':
        o->shader_dir = optarg;
        return true;
    case 'm':
        return parse_mib(optarg, &o->memory_limit_bytes);
    case 't':
        return parse_mib(optarg, &o->texture_budget_bytes);
    case 'g':
        return parse_mib(optarg, &o->geometry_budget_bytes);
    case 'h':
        return parse_mib(optarg, &o->host_budget_bytes);
    case 'C':
        return parse_mib(optarg, &o->cache_limit_bytes);
    case 'd':
        o->device = optarg;
        return true;
    case 'T':
        o->threads = (uint32_t)strtoul(optarg, NULL, 10);
        return o->threads > 0;
    case 'l':
        o->loader.log = optarg;
        return hg_log_configure(optarg, &err) == HG_OK;
    case 'v':
        return o->validation = true;
    case 'w':
        return o->warm_up = true;
    case 'n':
        o->loader.sandbox = optarg;
        return hg_sandbox_parse(optarg, &o->sandbox);
    case 'x':
        o->loader.cpu_s = (uint32_t)strtoul(optarg, NULL, 10);
        return o->loader.cpu_s > 0;
    case 'M':
        o->loader.memory_mib = (uint32_t)strtoul(optarg, NULL, 10);
        return o->loader.memory_mib > 0;
    case 'o':
        o->loader.timeout_s = strtod(optarg, NULL);
        return o->loader.timeout_s > 0;
    case 'p':
        return o->no_spill = true;
    case 'i':
        return o->device_info = true;
    default:
        return false;
    }
}

// Pools of this program and Embree's by the limit, Mesa's rasteriser by its variable.
static void limit_threads(uint32_t threads)
{
    char number[16];
    if (!threads)
        return;
    hg_jobs_set_limit(threads);
    snprintf(number, sizeof number, "%u", threads);
    setenv("LP_NUM_THREADS", number, 1);
}

static bool parse_options(struct worker_options *o, int argc, char **argv)
{
    for (int option, index = 0; (option = getopt_long(argc, argv, "", long_options, &index)) != -1;)
        if (!apply_option(o, option)) {
            if (option != '?')
                fprintf(stderr, "helio-worker: --%s: bad value '%s'\n", long_options[index].name,
                    optarg ? optarg : "");
            return false;
        }
    if (optind < argc)
        fprintf(stderr, "helio-worker: unexpected argument '%s'\n", argv[optind]);
    return optind == argc;
}

static struct hg_renderer_params renderer_params(const struct worker_options *o)
{
    return (struct hg_renderer_params){
        .device = o->device,
        .cache_dir = o->cache_dir,
        .shader_dir = o->shader_dir,
        .validation = o->validation,
    };
}

static int print_device_info(const struct worker_options *o)
{
    struct hg_renderer *renderer = NULL;
    struct hg_error err = {0};
    char *text = NULL;
    struct hg_renderer_params params = renderer_params(o);
    enum hg_status status = hg_renderer_create(&params, &renderer, &err);
    if (!status)
        status = hg_renderer_device_json(renderer, &text);
    if (status) {
        char line[700];
        hg_error_format(&err, line, sizeof line);
        fprintf(stderr, "helio-worker: %s\n", line);
    } else {
        puts(text);
    }
    hg_free(text);
    hg_renderer_destroy(renderer);
    return status ? EXIT_DEVICE : 0;
}

// Ends with 0 when all of them are in the cache folder.
static int compile_shaders(const struct worker_options *o)
{
    struct hg_error err = {0};
    const struct hg_renderer_params params = renderer_params(o);
    enum hg_status status = hg_sandbox_enter(o, &err);
    if (!status)
        status = hg_shader_seed_compile(&params, &err);
    if (status)
        hg_fault(WORKER, status, "shaders: %s: %s", err.what, err.reason);
    return status ? EXIT_DEVICE : 0;
}

// ---- threads ------------------------------------------------------------------------------------

static void stop_threads(struct worker *w, pthread_t render)
{
    atomic_store(&w->stop, true);
    hg_worker_wake(w);
    pthread_join(render, NULL);
    hg_encode_queue_destroy(w->encoders);
    w->encoders = NULL;
}

static enum hg_status serve_link(struct worker *w)
{
    pthread_t render;
    const struct hgp_worker_ready ready = {.pid = (uint32_t)getpid(), .device = hgp_str_make("{}")};
    hg_reply_send((struct reply_to){.w = w}, HGP_T_worker_ready, &ready);
    enum hg_status status = hg_encode_queue_create(w, 0, hg_encoder_find, &w->encoders);
    if (status)
        return status;
    if (pthread_create(&render, NULL, hg_dispatch_main, w) != 0) {
        hg_encode_queue_destroy(w->encoders);
        return HG_E_LIMIT;
    }
    status = hg_io_thread_run(w);
    if (status == HG_E_DEVICE_LOST || atomic_load(&w->device_lost))
        _exit(EXIT_DEVICE); // the driver's state is not to be trusted any more
    if (atomic_load(&w->disk_lost))
        _exit(EXIT_DISK); // a thread still waits for what it was reading
    stop_threads(w, render);
    return status;
}

int main(int argc, char **argv)
{
    struct worker w = {.options = {.fd = 3,
                           .overrides = hg_debug_environment_read(),
                           .loader = {.sandbox = "best-effort"}}};
    hg_log_set_sink(hg_log_sink_logfmt, (void *)(intptr_t)STDERR_FILENO);
    signal(SIGXFSZ, SIG_IGN); // a file size limit is an error of write, of the driver's threads too
    if (!parse_options(&w.options, argc, argv))
        return EXIT_USAGE;
    if (w.options.device_info)
        return print_device_info(&w.options);
    if (w.options.shader_seed && w.options.cache_dir)
        hg_shader_seed_copy(w.options.shader_seed, w.options.cache_dir);
    if (!w.options.cache_dir && !getenv("MESA_SHADER_CACHE_DIR"))
        setenv("MESA_SHADER_CACHE_DISABLE", "true", 0); // its own folder is outside of the sandbox
    hg_renderer_prepare_process(w.options.cache_dir, !w.options.no_spill);
    if (w.options.compile_shaders)
        return compile_shaders(&w.options);
    struct stat st;
    if (fstat(w.options.fd, &st) != 0 || !S_ISSOCK(st.st_mode)) {
        fprintf(stderr,
            "helio-worker: file descriptor %d is not a socket; heliod starts this program\n",
            w.options.fd);
        return EXIT_USAGE;
    }
    // Ctrl-C on a terminal and the stop of a service reach all processes at once. What is under way
    // is for the other end of the link to keep or to drop; the worker ends when that closes.
    signal(SIGINT, SIG_IGN);
    signal(SIGTERM, SIG_IGN);
    signal(SIGPIPE, SIG_IGN);
    limit_threads(w.options.threads);
    fcntl(w.options.fd, F_SETFL, fcntl(w.options.fd, F_GETFL) | O_NONBLOCK);
    fcntl(w.options.fd, F_SETFD, FD_CLOEXEC);
    hg_io_thread_watch_disk(&w);
    struct hg_error err = {0};
    enum hg_status status = hg_loader_start(&w.options.loader, &err);
    if (!status)
        status = hg_sandbox_enter(&w.options, &err);
    if (!status)
        status = hg_worker_init(&w);
    if (!status)
        status = serve_link(&w);
    hg_worker_finish(&w);
    for (uint32_t i = 0; i < w.options.asset_root_count; i++)
        free(w.options.asset_roots[i]);
    hg_free(w.options.asset_roots);
    if (status && status != HG_E_CLOSED) {
        hg_fault(
            WORKER, status, "stopped: %s", err.reason[0] ? err.reason : hg_status_text(status));
        return 1;
    }
    return 0;
}
