// main.c - helio-worker: renders for one broker, or for one client in a private worker.
//
// Usage: helio-worker --fd N [options]; started by heliod and libhelio, not by people.
#include <errno.h>
#include <fcntl.h>
#include <getopt.h>
#include <malloc.h>
#include <pthread.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <unistd.h>

#include "base/alloc.h"
#include "base/log.h"
#include "base/spill.h"
#include "server/worker/task.h"
#include "server/worker/worker.h"

enum { INBOX_ITEMS = 4096, OUTBOX_ITEMS = 1024, ENCODE_ITEMS = 3 };
enum { EXIT_USAGE = 2, EXIT_DEVICE = 7, EXIT_DISK = WORKER_EXIT_DISK };
enum { KEPT_FREE_BYTES = 64 << 20, MAPPED_BYTES = 8 << 20 };

static const struct option long_options[] = {
    {"fd", required_argument, NULL, 'f'},
    {"asset-root", required_argument, NULL, 'a'},
    {"cache-dir", required_argument, NULL, 'c'},
    {"shader-dir", required_argument, NULL, 's'},
    {"memory-limit", required_argument, NULL, 'm'},
    {"texture-budget", required_argument, NULL, 't'},
    {"geometry-budget", required_argument, NULL, 'g'},
    {"host-budget", required_argument, NULL, 'h'},
    {"cache-limit", required_argument, NULL, 'C'},
    {"device", required_argument, NULL, 'd'},
    {"log", required_argument, NULL, 'l'},
    {"validation", no_argument, NULL, 'v'},
    {"warm-up", no_argument, NULL, 'w'},
    {"no-sandbox", no_argument, NULL, 'n'},
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
    case 'l':
        return hg_log_configure(optarg, &err) == HG_OK;
    case 'v':
        return o->validation = true;
    case 'w':
        return o->warm_up = true;
    case 'n':
        return o->no_sandbox = true;
    case 'p':
        return o->no_spill = true;
    case 'i':
        return o->device_info = true;
    default:
        return false;
    }
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

// ---- threads ------------------------------------------------------------------------------------

static enum hg_status init_queues(struct worker *w)
{
    enum hg_status status = hg_queue_init(&w->inbox, INBOX_ITEMS);
    if (!status)
        status = hg_queue_init(&w->outbox, OUTBOX_ITEMS);
    if (!status)
        status = hg_queue_init(&w->encode, ENCODE_ITEMS);
    return status;
}

static void drain_queues(struct worker *w)
{
    struct hg_refbuf *buf;
    struct command *c;
    struct encode_job *job;
    while (w->outbox.items && (buf = hg_queue_try_pop(&w->outbox)))
        hg_refbuf_unref(buf);
    while (w->inbox.items && (c = hg_queue_try_pop(&w->inbox))) {
        hg_refbuf_unref(c->payload);
        hg_free(c);
    }
    while (w->encode.items && (job = hg_queue_try_pop(&w->encode)))
        encode_job_destroy(job);
    hg_queue_finish(&w->inbox);
    hg_queue_finish(&w->outbox);
    hg_queue_finish(&w->encode);
}

static void stop_threads(struct worker *w, pthread_t render, pthread_t encoder)
{
    struct command *wake = hg_calloc(1, sizeof *wake); // an empty command wakes the render thread
    atomic_store(&w->stop, true);
    if (wake && hg_queue_push(&w->inbox, wake) != HG_OK)
        hg_free(wake);
    pthread_join(render, NULL);
    hg_queue_close(&w->encode);
    pthread_join(encoder, NULL);
}

static enum hg_status serve_link(struct worker *w)
{
    pthread_t render, encoder;
    struct hgp_worker_ready ready = {.pid = (uint32_t)getpid(), .device = hgp_str_make("{}")};
    link_send(w, 0, 0, HGP_T_worker_ready, &ready);
    if (pthread_create(&encoder, NULL, encode_main, w) != 0)
        return HG_E_LIMIT;
    if (pthread_create(&render, NULL, render_main, w) != 0) {
        hg_queue_close(&w->encode);
        pthread_join(encoder, NULL);
        return HG_E_LIMIT;
    }
    enum hg_status status = link_run(w);
    if (status == HG_E_DEVICE_LOST || atomic_load(&w->device_lost))
        _exit(EXIT_DEVICE); // the driver's state is not to be trusted any more
    if (atomic_load(&w->disk_lost))
        _exit(EXIT_DISK); // a thread stands where it looked
    stop_threads(w, render, encoder);
    return status;
}

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

// Large meshes lie there while nobody looks at them.
static void point_spill(const struct worker_options *o)
{
    char path[4096];
    if (o->cache_dir && !o->no_spill &&
        snprintf(path, sizeof path, "%s/store", o->cache_dir) < (int)sizeof path)
        hg_spill_set_folder(path);
}

// The renderer would do it, too, but by then other threads may be reading the environment.
static void point_mesa_cache(const struct worker_options *o)
{
    char path[4096];
    if (o->cache_dir && snprintf(path, sizeof path, "%s/shaders", o->cache_dir) < (int)sizeof path)
        setenv("MESA_SHADER_CACHE_DIR", path, 0);
}

int main(int argc, char **argv)
{
    struct worker w = {.options = {.fd = 3}};
    hg_log_set_sink(hg_log_sink_logfmt, (void *)(intptr_t)STDERR_FILENO);
    // Software rasterisers take and free megabytes with every draw, and so do pictures that are
    // read: kept, not faulted in anew. (Setting the first alone would map all from 128 KiB on.)
    mallopt(M_TRIM_THRESHOLD, KEPT_FREE_BYTES);
    mallopt(M_MMAP_THRESHOLD, MAPPED_BYTES);
    if (!parse_options(&w.options, argc, argv))
        return EXIT_USAGE;
    if (w.options.device_info)
        return print_device_info(&w.options);
    struct stat st;
    if (fstat(w.options.fd, &st) != 0 || !S_ISSOCK(st.st_mode)) {
        fprintf(stderr,
            "helio-worker: file descriptor %d is not a socket; heliod starts this program\n",
            w.options.fd);
        return EXIT_USAGE;
    }
    // Ctrl-C on a terminal and the stop of a service reach all processes at once. What is under way is
    // for the other end of the link to keep or to drop; the worker ends when that closes.
    signal(SIGINT, SIG_IGN);
    signal(SIGTERM, SIG_IGN);
    signal(SIGPIPE, SIG_IGN);
    fcntl(w.options.fd, F_SETFL, fcntl(w.options.fd, F_GETFL) | O_NONBLOCK);
    fcntl(w.options.fd, F_SETFD, FD_CLOEXEC);
    allow_files();
    point_mesa_cache(&w.options);
    point_spill(&w.options);
    link_watch_disk(&w);
    struct hg_error err = {0};
    enum hg_status status = sandbox_enter(&w.options, &err);
    if (!status)
        status = init_queues(&w);
    if (!status)
        status = serve_link(&w);
    drain_queues(&w);
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
