// main.c - helio-bench: runs one benchmark. Started by `helio bench`, not by people.
//
// Usage: helio-bench NAME OPTIONS [--asset-root DIR]... [--cache-dir DIR] [--device NAME] ...
// OPTIONS is one JSON object. On the standard output are lines, each a word, a blank and JSON:
//
//   progress [DONE,TOTAL]
//   error {"code":STATUS,"what":TEXT,"where":TEXT,"reason":TEXT}
//   result REPORT
//
// The last line is an error (exit code 1) or the result (0). It has no sandbox and no memory limit:
// what is measured is the renderer, on files that its user has chosen.
#include <errno.h>
#include <getopt.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "base/alloc.h"
#include "base/clock.h"
#include "base/log.h"
#include "renderer/bench/run.h"
#include "renderer/debug_environment.h"

enum { EXIT_ERROR = 1, EXIT_USAGE = 2, PROGRESS_NS = 100 * 1000 * 1000 };

struct program {
    struct hg_bench_host host;
    char **roots;         // of `host`
    uint64_t progress_ns; // when it was printed last
};

static volatile sig_atomic_t stopped;

static void on_stop(int number)
{
    (void)number;
    stopped = 1;
}

// ---- command line -------------------------------------------------------------------------------

static const struct option long_options[] = {
    {"asset-root", required_argument, NULL, 'a'},
    {"cache-dir", required_argument, NULL, 'c'},
    {"texture-budget", required_argument, NULL, 't'},
    {"geometry-budget", required_argument, NULL, 'g'},
    {"host-budget", required_argument, NULL, 'h'},
    {"cache-limit", required_argument, NULL, 'C'},
    {"device", required_argument, NULL, 'd'},
    {"log", required_argument, NULL, 'l'},
    {0},
};

static bool parse_mib(const char *text, uint64_t *bytes)
{
    char *end;
    errno = 0;
    unsigned long long mib = strtoull(text, &end, 10);
    if (errno || end == text || *end || text[0] == '-' || mib > UINT64_MAX >> 21)
        return false;
    *bytes = (uint64_t)mib << 20;
    return true;
}

static bool add_root(struct program *p, const char *path)
{
    uint32_t count = p->host.roots.count;
    char *real = realpath(path, NULL);
    char **roots = real ? hg_realloc(p->roots, count + 1, sizeof *roots) : NULL;
    if (!roots) {
        free(real);
        return false;
    }
    roots[count] = real;
    p->roots = roots;
    p->host.roots = (struct hg_roots){.items = (const char *const *)roots, .count = count + 1};
    return true;
}

static bool apply_option(struct program *p, int option)
{
    struct hg_renderer_params *r = &p->host.renderer;
    switch (option) {
    case 'a':
        return add_root(p, optarg);
    case 'c':
        r->cache_dir = optarg;
        return true;
    case 't':
        return parse_mib(optarg, &r->texture_budget_bytes);
    case 'g':
        return parse_mib(optarg, &r->geometry_budget_bytes);
    case 'h':
        return parse_mib(optarg, &r->host_budget_bytes);
    case 'C':
        return parse_mib(optarg, &r->cache_limit_bytes);
    case 'd':
        r->device = optarg;
        return true;
    case 'l':
        return hg_log_configure(optarg, NULL) == HG_OK;
    default:
        return false;
    }
}

static bool parse_options(struct program *p, int argc, char **argv)
{
    for (int option, index = 0; (option = getopt_long(argc, argv, "", long_options, &index)) != -1;)
        if (!apply_option(p, option)) {
            if (option != '?')
                fprintf(stderr, "helio-bench: --%s: bad value '%s'\n", long_options[index].name,
                    optarg ? optarg : "");
            return false;
        }
    if (optind + 2 == argc)
        return true;
    fprintf(stderr, "helio-bench: expected NAME OPTIONS; `helio bench` starts this program\n");
    return false;
}

// ---- lines --------------------------------------------------------------------------------------

// False when the reader is gone.
static bool put_line(const char *word, const char *json)
{
    return printf("%s %s\n", word, json) > 0 && fflush(stdout) == 0;
}

static bool show_progress(void *user, uint32_t done, uint32_t total)
{
    struct program *p = user;
    uint64_t now = hg_clock_now_ns();
    char json[32];
    if (now - p->progress_ns >= PROGRESS_NS) {
        p->progress_ns = now;
        snprintf(json, sizeof json, "[%u,%u]", done, total);
        if (!put_line("progress", json))
            stopped = 1;
    }
    return !stopped;
}

static int put_error(const struct hg_error *err)
{
    json_t *object = json_pack("{s:i, s:s, s:s, s:s}", "code", (int)err->status, "what", err->what,
        "where", err->where, "reason", err->reason);
    char *text = object ? json_dumps(object, JSON_COMPACT) : NULL;
    put_line("error", text ? text : "{}");
    free(text);
    json_decref(object);
    return EXIT_ERROR;
}

// ---- run ----------------------------------------------------------------------------------------

static enum hg_status run(
    struct program *p, const char *name, const char *options_text, struct hg_error *err)
{
    char *report;
    json_error_t fault;
    json_t *options = json_loads(options_text, 0, &fault);
    if (!json_is_object(options)) {
        json_decref(options);
        return hg_error_set(
            err, HG_E_INVAL, "bench", "options", "not a JSON object: %s", fault.text);
    }
    enum hg_status status = hg_bench_run(&p->host, name, options, &report, err);
    json_decref(options);
    if (status)
        return status;
    put_line("result", report);
    hg_free(report);
    return HG_OK;
}

// The parent process asks to stop with SIGTERM; Ctrl-C on a terminal reaches both.
static void watch_signals(void)
{
    struct sigaction stop = {.sa_handler = on_stop};
    sigaction(SIGTERM, &stop, NULL);
    sigaction(SIGINT, &stop, NULL);
    signal(SIGPIPE, SIG_IGN);
    signal(SIGXFSZ, SIG_IGN);
}

int main(int argc, char **argv)
{
    struct program p = {.host.progress = show_progress};
    struct hg_error err = {0};
    p.host.progress_user = &p;
    p.host.renderer.overrides = hg_debug_environment_read();
    hg_log_set_sink(hg_log_sink_logfmt, (void *)(intptr_t)STDERR_FILENO);
    watch_signals();
    int code = EXIT_USAGE;
    if (parse_options(&p, argc, argv)) {
        hg_renderer_prepare_process(p.host.renderer.cache_dir, true);
        enum hg_status status = run(&p, argv[optind], argv[optind + 1], &err);
        code = status ? put_error(&err) : 0;
    }
    for (uint32_t i = 0; i < p.host.roots.count; i++)
        free(p.roots[i]);
    hg_free(p.roots);
    return code;
}
