// cli.c - connection, exit codes and messages shared by the commands.
#include "client/cli/cli.h"

#include <errno.h>
#include <limits.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "base/alloc.h"
#include "base/clock.h"
#include "base/file.h"
#include "base/log.h"

enum { CACHE_LIMIT_MIB = 32768 };

static struct helio *volatile interrupt_target;
static volatile sig_atomic_t stopped;

static void on_signal(int number)
{
    struct helio *h = interrupt_target;
    (void)number;
    stopped = 1;
    if (h)
        helio_interrupt(h);
}

bool hg_cli_is_stopped(void)
{
    return stopped;
}

void hg_cli_init(struct hg_cli *cli, const struct hg_cli_options *options)
{
    // A second Ctrl-C kills at once; a terminal that goes may say so twice, and nohup says it does
    // not matter.
    struct sigaction action = {.sa_handler = on_signal, .sa_flags = (int)SA_RESETHAND}, before;
    sigaction(SIGINT, &action, NULL);
    sigaction(SIGTERM, &action, NULL);
    action.sa_flags = 0;
    if (sigaction(SIGHUP, NULL, &before) == 0 && before.sa_handler != SIG_IGN)
        sigaction(SIGHUP, &action, NULL);
    signal(SIGXFSZ, SIG_IGN); // ulimit -f: writing fails and names the file
    *cli = (struct hg_cli){.options = options, .view = HG_CLI_VIEW, .begin_ns = hg_clock_now_ns()};
    hg_cli_progress_init(&cli->progress, options->progress);
    cli->progress.quiet = options->quiet;
    cli->progress.verbose = options->verbose;
}

void hg_cli_finish(struct hg_cli *cli, enum hg_cli_exit code)
{
    hg_cli_progress_end(&cli->progress, (int)code);
    hg_cli_disconnect(cli);
}

void hg_cli_disconnect(struct hg_cli *cli)
{
    interrupt_target = NULL;
    helio_destroy(cli->h);
    cli->h = NULL;
}

void hg_cli_clean(char *dst, size_t size, const char *text, size_t length)
{
    size_t n = 0;
    for (size_t i = 0; text && i < length && n + 1 < size; i++) {
        unsigned char c = (unsigned char)text[i];
        dst[n++] = (char)(c < 0x20 || c == 0x7f ? '?' : c);
    }
    dst[n] = 0;
}

static enum hg_cli_exit exit_of(enum hg_cli_doing doing, enum hg_status status)
{
    static const enum hg_cli_exit otherwise[] = {HG_CLI_EXIT_USAGE, HG_CLI_EXIT_UNREACHABLE,
        HG_CLI_EXIT_INPUT, HG_CLI_EXIT_RENDER, HG_CLI_EXIT_RENDER};
    switch (status) {
    case HG_OK:
        return HG_CLI_EXIT_OK;
    case HG_E_PERM:
    case HG_E_AUTH:
        return HG_CLI_EXIT_NOT_ALLOWED;
    case HG_E_LIMIT:
    case HG_E_NOSPACE:
    case HG_E_NOMEM:
    case HG_E_BUSY:
        return HG_CLI_EXIT_LIMIT;
    case HG_E_CANCELLED:
        return HG_CLI_EXIT_STOPPED;
    case HG_E_CLOSED:
    case HG_E_VERSION:
        return HG_CLI_EXIT_UNREACHABLE;
    case HG_E_TIMEOUT:
        return doing == HG_CLI_DOING_CONNECT ? HG_CLI_EXIT_UNREACHABLE : HG_CLI_EXIT_RENDER;
    case HG_E_DEVICE:
        return HG_CLI_EXIT_DEVICE;
    case HG_E_UNSUPPORTED:
        return doing == HG_CLI_DOING_CONNECT  ? HG_CLI_EXIT_USAGE
               : doing == HG_CLI_DOING_RENDER ? HG_CLI_EXIT_DEVICE
                                              : otherwise[doing];
    case HG_E_WORKER:
    case HG_E_DEVICE_LOST:
    case HG_E_INTERNAL:
        return HG_CLI_EXIT_RENDER;
    case HG_E_INVAL:
    case HG_E_NOTFOUND: // --token-file
        return doing == HG_CLI_DOING_CONNECT ? HG_CLI_EXIT_USAGE : otherwise[doing];
    default:
        return doing == HG_CLI_DOING_ARGUMENTS ? HG_CLI_EXIT_RENDER : otherwise[doing];
    }
}

enum hg_cli_exit hg_cli_report(
    struct hg_cli *cli, enum hg_cli_doing doing, const struct hg_error *err)
{
    char text[800], clean[800];
    snprintf(text, sizeof text, "%s%s%s%s%s", err->what, err->what[0] ? ": " : "", err->where,
        err->where[0] ? ": " : "", err->reason[0] ? err->reason : hg_status_text(err->status));
    hg_cli_clean(clean, sizeof clean, text, strlen(text));
    hg_cli_progress_error(cli ? &cli->progress : NULL, err, clean);
    if (cli && cli->embedded && doing == HG_CLI_DOING_INPUT && err->status == HG_E_PERM)
        hg_cli_progress_say(
            &cli->progress, "--asset-root DIR lets the private worker read further folders");
    const bool missing = err->status == HG_E_PERM || err->status == HG_E_NOTFOUND;
    if (cli && cli->h && !cli->embedded && doing == HG_CLI_DOING_INPUT && missing &&
        cli->options->command == HG_CLI_RENDER && !cli->options->upload &&
        access(err->what, R_OK) == 0)
        hg_cli_progress_say(&cli->progress,
            "%s is a file of this machine; --upload sends it to the daemon", err->what);
    if (cli && cli->h) { // a connection that broke is not the input's fault
        struct helio_info info;
        helio_get_info(cli->h, &info);
        if (info.state == HELIO_CLOSED)
            doing = HG_CLI_DOING_CONNECT;
    }
    if (cli && cli->embedded && doing == HG_CLI_DOING_CONNECT)
        doing = err->status == HG_E_INVAL ? HG_CLI_DOING_ARGUMENTS : HG_CLI_DOING_RENDER;
    // Limits and rights exceeded by an entry of a file are errors of that file, unless an option
    // sets the limit.
    bool in_file = doing == HG_CLI_DOING_INPUT && err->where[0] && !err->limit[0] &&
                   (err->status == HG_E_LIMIT || err->status == HG_E_PERM);
    enum hg_status status = in_file ? HG_E_FORMAT : err->status;
    if (status == HG_E_CANCELLED) // by the daemon, which ends or is replaced
        status = HG_E_CLOSED;
    return exit_of(doing, stopped ? HG_E_CANCELLED : status);
}

// ---- arguments of programs that work for this one ----------------------------------------------

static enum hg_status add_arg(struct hg_cli_args *args, const char *option, const char *value)
{
    if (hg_grow(&args->items, &args->capacity, args->count + 3, sizeof *args->items))
        return HG_E_NOMEM;
    char *copy = hg_arena_strndup(&args->arena, value, strlen(value));
    if (!copy)
        return HG_E_NOMEM;
    args->items[args->count++] = option;
    args->items[args->count++] = copy;
    args->items[args->count] = NULL;
    return HG_OK;
}

// The folder of a file, absolute, symbolic links resolved.
static enum hg_status add_folder_of(struct hg_cli_args *args, const char *file)
{
    char full[PATH_MAX];
    if (!realpath(file, full))
        return HG_OK; // said when it is loaded
    char *slash = strrchr(full, '/');
    slash[slash == full] = 0;
    for (size_t i = 1; i < args->count; i += 2)
        if (strcmp(args->items[i], full) == 0)
            return HG_OK;
    return add_arg(args, "--asset-root", full);
}

bool hg_cli_cache_dir(const char *given, char *path, size_t size)
{
    const char *xdg = getenv("XDG_CACHE_HOME"), *home = getenv("HOME");
    if (given)
        snprintf(path, size, "%s", given);
    else if (xdg && *xdg == '/')
        snprintf(path, size, "%s/heliograph", xdg);
    else if (home && *home == '/')
        snprintf(path, size, "%s/.cache/heliograph", home);
    else
        return false;
    return true;
}

// The first error that is not that one of them is there; 0: there is none.
static int make_folders(char *path)
{
    int failed = 0;
    for (char *p = path + 1; *p; p++) // its parents
        if (*p == '/') {
            *p = 0;
            if (mkdir(path, 0777) && errno != EEXIST && !failed)
                failed = errno;
            *p = '/';
        }
    if (mkdir(path, 0777) && errno != EEXIST && !failed)
        failed = errno;
    return failed;
}

static enum hg_status add_cache_dir(struct hg_cli_args *args, const char *given)
{
    char path[PATH_MAX];
    if (!hg_cli_cache_dir(given, path, sizeof path)) {
        snprintf(args->no_cache, sizeof args->no_cache, "HOME is not set");
        return HG_OK;
    }
    const int failed = make_folders(path);
    char full[PATH_MAX];
    if (realpath(path, full) && access(full, R_OK | X_OK) == 0) // one that is only read has entries
        return add_arg(args, "--cache-dir", full);
    snprintf(args->no_cache, sizeof args->no_cache, "%.400s: %s", path,
        strerror(failed ? failed : errno));
    return HG_OK; // works without caches
}

static enum hg_status add_options(struct hg_cli_args *args, const struct hg_cli_options *o)
{
    const struct {
        const char *option;
        bool has;
        uint32_t value; // of budgets MiB
    } numbers[] = {{"--texture-budget", o->has_texture_budget, o->texture_budget},
        {"--geometry-budget", o->has_geometry_budget, o->geometry_budget},
        {"--host-budget", o->has_host_budget, o->host_budget},
        {"--cache-limit", true, o->has_cache_limit ? o->cache_limit : CACHE_LIMIT_MIB},
        {"--threads", o->has_threads, o->threads}};
    char number[16];
    enum hg_status status = add_cache_dir(args, o->bake_dir ? o->bake_dir : o->cache_dir);
    for (uint32_t i = 0; !status && i < o->asset_root.count; i++) {
        char full[PATH_MAX];
        if (realpath(o->asset_root.items[i], full)) // checked before
            status = add_arg(args, "--asset-root", full);
    }
    for (size_t i = 0; !status && i < sizeof numbers / sizeof *numbers; i++) {
        snprintf(number, sizeof number, "%u", numbers[i].value);
        if (numbers[i].has)
            status = add_arg(args, numbers[i].option, number);
    }
    if (!status && o->device)
        status = add_arg(args, "--device", o->device);
    const bool json = o->progress && strcmp(o->progress, "json") == 0; // nothing else there
    const char *level = json ? "off" : o->quiet ? "error" : "warn";
    return status ? status : add_arg(args, "--log", o->log ? o->log : level);
}

static enum hg_status add_all(
    struct hg_cli_args *args, const struct hg_cli_options *o, const struct hg_cli_texts *files)
{
    for (uint32_t i = 0; files && i < files->count; i++) {
        if (!files->items[i] || strcmp(files->items[i], "demo:") == 0)
            continue;
        enum hg_status status = add_folder_of(args, files->items[i]);
        if (status)
            return status;
    }
    return add_options(args, o);
}

// What the other program would refuse without saying so to the client.
static enum hg_status check_options(const struct hg_cli_options *o, struct hg_error *err)
{
    struct hg_error inner = {0};
    for (uint32_t i = 0; i < o->asset_root.count; i++) {
        struct stat st;
        if (stat(o->asset_root.items[i], &st) || !S_ISDIR(st.st_mode))
            return hg_error_set(err, HG_E_INVAL, "--asset-root", NULL, "'%s' is not a folder",
                o->asset_root.items[i]);
    }
    if (o->log && hg_log_configure(o->log, &inner))
        return hg_error_set(err, HG_E_INVAL, "--log", NULL, "%s", inner.reason);
    return HG_OK;
}

enum hg_status hg_cli_args_make(struct hg_cli_args *args, const struct hg_cli_options *o,
    const struct hg_cli_texts *files, struct hg_error *err)
{
    *args = (struct hg_cli_args){0};
    enum hg_status status = check_options(o, err);
    if (status)
        return status;
    if (add_all(args, o, files)) {
        hg_cli_args_finish(args);
        return hg_error_set(err, HG_E_NOMEM, "worker", NULL, "no memory for its arguments");
    }
    return HG_OK;
}

void hg_cli_args_finish(struct hg_cli_args *args)
{
    hg_arena_finish(&args->arena);
    hg_free(args->items);
    *args = (struct hg_cli_args){0};
}

// ---- connecting --------------------------------------------------------------------------------

static enum hg_status refuse_worker_options(const struct hg_cli_options *o, struct hg_error *err)
{
    const char *name = o->has_texture_budget    ? "--texture-budget"
                       : o->has_geometry_budget ? "--geometry-budget"
                       : o->has_host_budget     ? "--host-budget"
                       : o->has_cache_limit     ? "--cache-limit"
                       : o->has_device          ? "--device"
                       : o->has_threads         ? "--threads"
                       : o->has_asset_root      ? "--asset-root"
                       : o->has_cache_dir       ? "--cache-dir"
                       : o->has_log             ? "--log"
                                                : NULL;
    if (!name)
        return HG_OK;
    return hg_error_set(err, HG_E_INVAL, name, NULL,
        "is for the private worker; with --connect the daemon decides");
}

static enum hg_status find_token(
    const struct hg_cli_options *o, char *token, size_t size, bool *found, struct hg_error *err)
{
    const char *env = getenv("HELIO_TOKEN");
    const char *text = o->token ? o->token : !o->token_file && env && *env ? env : NULL;
    *found = true;
    if (text) {
        if (strlen(text) >= size)
            return hg_error_set(
                err, HG_E_INVAL, "--token", NULL, "longer than %zu bytes", size - 1);
        snprintf(token, size, "%s", text);
        return HG_OK;
    }
    *found = o->token_file != NULL;
    if (!o->token_file)
        return HG_OK;
    uint8_t *data;
    size_t length;
    enum hg_status status = hg_file_read(o->token_file, 4096, &data, &length, err);
    if (status)
        return status;
    size_t n = strcspn((const char *)data, " \t\r\n");
    if (n == 0 || n >= size)
        status = hg_error_set(err, HG_E_INVAL, o->token_file, NULL,
            "its first line is not a token of 1 to %zu bytes", size - 1);
    else
        snprintf(token, size, "%.*s", (int)n, (const char *)data);
    hg_free(data);
    return status;
}

// As helio_connect, but Ctrl-C already reaches the connection while it is made.
void hg_cli_attach(struct hg_cli *cli)
{
    interrupt_target = cli->h;
    if (stopped)
        helio_interrupt(cli->h);
    helio_set_handlers(cli->h, &(struct helio_handlers){.user = &cli->progress,
                                   .tick = hg_cli_on_tick,
                                   .progress = hg_cli_on_progress,
                                   .notice = hg_cli_on_notice,
                                   .message = hg_cli_on_message,
                                   .idle = hg_cli_on_idle});
}

static enum hg_status open_session(
    struct hg_cli *cli, const struct helio_options *options, struct hg_error *err)
{
    enum hg_status status = helio_start(options, &cli->h, err);
    if (status)
        return status;
    hg_cli_attach(cli);
    uint64_t end = hg_clock_now_ns() + options->timeout_ns;
    struct helio_info info;
    for (helio_get_info(cli->h, &info); info.state != HELIO_OPEN; helio_get_info(cli->h, &info)) {
        uint64_t now = hg_clock_now_ns();
        status = helio_wait(cli->h, end > now ? end - now : 0, err);
        if (status)
            return status;
    }
    return HG_OK;
}

static void note_connection(struct hg_cli *cli, const struct hg_cli_args *args)
{
    const struct hg_cli_options *o = cli->options;
    if (o->insecure)
        hg_cli_progress_print(&cli->progress,
            "helio: --insecure: the daemon's certificate is not checked; whoever is in between can "
            "read and change everything");
    if (args->no_cache[0] && (o->cache_dir || o->output))
        hg_cli_progress_say(&cli->progress,
            "no cache folder: %s; shaders, textures and meshes are rebuilt by every run",
            args->no_cache);
}

enum hg_status hg_cli_connect(struct hg_cli *cli, const char *url, const struct hg_cli_texts *files,
    bool with_scene, struct hg_error *err)
{
    const struct hg_cli_options *o = cli->options;
    char token[257];
    bool has_token = false;
    struct hg_cli_args args = {0};
    cli->embedded = !url;
    enum hg_status status =
        url ? refuse_worker_options(o, err) : hg_cli_args_make(&args, o, files, err);
    if (!status && url)
        status = find_token(o, token, sizeof token, &has_token, err);
    uint64_t begin = hg_clock_now_ns();
    uint64_t timeout = o->has_timeout ? (uint64_t)(o->timeout * 1e9) : 0;
    struct helio_options options = {
        .url = url,
        .token = has_token ? token : NULL,
        .client = "helio/" HELIO_VERSION,
        .timeout_ns = timeout ? timeout : UINT64_C(30000000000),
        .max_receive_bytes = 640u * 1024 * 1024,
        .worker_args = args.items,
        .tls_ca = o->tls_ca,
        .tls_pin = o->tls_pin,
        .tls_cert = o->tls_cert,
        .tls_key = o->tls_key,
        .tls_insecure = o->insecure,
        .scene = cli->scene_name ? cli->scene_name
                 : o->join       ? o->join
                                 : o->to_scene,
        .reconnect_ns = o->has_reconnect ? (uint64_t)(o->reconnect * 1e9) : 0,
    };
    if (!status)
        note_connection(cli, &args);
    if (!status)
        status = open_session(cli, &options, err);
    explicit_bzero(token, sizeof token);
    hg_cli_args_finish(&args);
    if (status)
        return status;
    cli->connect_ns = hg_clock_now_ns() - begin;
    helio_set_timeout(cli->h, timeout ? timeout : HELIO_NO_TIMEOUT);
    return with_scene ? helio_scene_open(cli->h, "", &cli->scene, err) : HG_OK;
}

enum hg_status hg_cli_server_path(
    const struct hg_cli *cli, const char *path, char **out, struct hg_error *err)
{
    char full[PATH_MAX];
    *out = NULL;
    const char *use = path;
    if (cli->embedded && strcmp(path, "demo:") != 0) {
        if (!realpath(path, full))
            return hg_error_set(
                err, hg_status_from_errno(errno), path, NULL, "cannot open: %s", strerror(errno));
        use = full;
    }
    *out = hg_strdup(use);
    return *out ? HG_OK : hg_error_set(err, HG_E_NOMEM, path, NULL, "no memory for the name");
}

enum hg_status hg_cli_error_of(const struct hgp_error *e, struct hg_error *err)
{
    char what[264], where[136];
    hg_cli_clean(what, sizeof what, e->what.data, e->what.size);
    hg_cli_clean(where, sizeof where, e->where.data, e->where.size);
    return hg_error_set(err, e->code ? (enum hg_status)e->code : HG_E_INTERNAL, what, where, "%.*s",
        (int)e->reason.size, e->reason.data ? e->reason.data : "");
}

static bool is_pixel_rate(const struct hg_error *e)
{
    return e->status == HG_E_LIMIT && e->retry_after_ms > 0 &&
           (strcmp(e->limit, "max-pixel-rate") == 0 || strcmp(e->limit, "pixel-rate-total") == 0);
}

enum hg_status hg_cli_wait_for_pixels(
    struct hg_cli *cli, enum hg_status refused, struct hg_error *err)
{
    char stage[64];
    if (!refused || !is_pixel_rate(err))
        return refused;
    snprintf(stage, sizeof stage, "waiting for %s", err->limit);
    hg_cli_progress_stage(&cli->progress, stage);
    const uint64_t until_ns = hg_clock_now_ns() + (uint64_t)err->retry_after_ms * 1000000;
    for (uint64_t now_ns; (now_ns = hg_clock_now_ns()) < until_ns;) {
        enum hg_status status = helio_wait(cli->h, until_ns - now_ns, err);
        if (status && status != HG_E_TIMEOUT)
            return status;
    }
    return HG_OK;
}

enum hg_status hg_cli_drain_queue(struct hg_cli *cli, struct hg_error *err)
{
    struct helio_message *m;
    enum hg_status found = HG_OK;
    struct hg_error ignored;
    while (helio_next(cli->h, &m, &ignored) == HG_OK) {
        if (m->type == HGP_T_error && !found) {
            found = hg_cli_error_of(&m->body->error, err);
        } else if (m->type == HGP_T_notice) {
            hg_cli_on_notice(&cli->progress, &m->body->notice);
        }
        helio_message_free(m);
    }
    return found;
}

enum hg_status hg_cli_check_warnings(const struct hg_cli *cli, struct hg_error *err)
{
    const struct hg_cli_options *o = cli->options;
    const uint32_t n = cli->progress.warnings;
    if (!o->strict || n == 0)
        return HG_OK;
    return hg_error_set(err, HG_E_FORMAT, o->args[0], NULL,
        "%u warning%s, which --strict does not take", n, n == 1 ? "" : "s");
}
