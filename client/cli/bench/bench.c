// bench.c - helio bench: starts helio-bench (renderer/bench/main.c), shows its progress, keeps its
// report.
#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <poll.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>
#include <unistd.h>

#include "base/alloc.h"
#include "base/bytes.h"
#include "base/clock.h"
#include "base/file.h"
#include "base/program.h"
#include "client/cli/bench/bench_flow.h"
#include "client/cli/bench/bench_stream.h"
#include "client/cli/cli.h"
#include "client/cli/bench/siege.h"

enum { TICK_MS = 100, LINE_BYTES = 64 * 1024 * 1024, END_NS = 2000000000 };

struct bench {
    struct hg_cli *cli;
    char path[4096]; // of the program
    pid_t pid;       // 0: not running
    int fd;          // its standard output; -1: closed
    struct hg_writer text;
    char *report; // once the program has given it
};

// ---- the program -------------------------------------------------------------------------------

static enum hg_status start(
    struct bench *b, const struct hg_cli_args *args, const char *options, struct hg_error *err)
{
    int ends[2];
    hg_program_path("HELIO_BENCH", "helio-bench", b->path, sizeof b->path);
    const char **argv = hg_calloc(args->count + 4, sizeof *argv);
    if (!argv)
        return hg_error_set(err, HG_E_NOMEM, b->path, NULL, "no memory for its arguments");
    memcpy(argv + 1, args->items, args->count * sizeof *argv);
    argv[0] = b->path;
    argv[args->count + 1] = b->cli->options->args[0];
    argv[args->count + 2] = options;
    if (pipe2(ends, O_CLOEXEC)) {
        hg_free(argv);
        return hg_error_set(
            err, hg_status_from_errno(errno), b->path, NULL, "no pipe: %s", strerror(errno));
    }
    const int failed =
        hg_program_spawn(b->path, argv, (const int[2]){ends[1], STDOUT_FILENO}, 0, &b->pid);
    hg_free(argv);
    close(ends[1]);
    b->fd = ends[0];
    if (!failed)
        return HG_OK;
    return hg_error_set(err, HG_E_WORKER, b->path, NULL, "cannot start: %s", strerror(failed));
}

// Ends it when it runs: it has a moment to remove what it has written.
static void stop(struct bench *b)
{
    int how;
    if (b->fd >= 0)
        close(b->fd);
    b->fd = -1;
    if (!b->pid)
        return;
    kill(b->pid, SIGTERM);
    uint64_t end_ns = hg_clock_now_ns() + END_NS;
    while (waitpid(b->pid, &how, WNOHANG) == 0) {
        if (hg_clock_now_ns() >= end_ns)
            kill(b->pid, SIGKILL);
        hg_clock_sleep_ns(1000 * 1000);
    }
    b->pid = 0;
}

static enum hg_status describe_end(struct bench *b, struct hg_error *err)
{
    int how = 0;
    pid_t got;
    do
        got = waitpid(b->pid, &how, 0);
    while (got < 0 && errno == EINTR && !hg_cli_is_stopped());
    if (got < 0)
        return hg_error_set(err, HG_E_CANCELLED, b->path, NULL, "interrupted");
    b->pid = 0;
    if (b->report)
        return HG_OK;
    if (WIFSIGNALED(how))
        return hg_error_set(err, HG_E_WORKER, b->path, NULL, "was killed by signal %d (%s)",
            WTERMSIG(how), strsignal(WTERMSIG(how)));
    return hg_error_set(
        err, HG_E_WORKER, b->path, NULL, "ended with exit code %d", WEXITSTATUS(how));
}

// ---- its lines ---------------------------------------------------------------------------------

static enum hg_status on_error(const char *json, struct hg_error *err)
{
    int code = 0;
    const char *what = "", *where = "", *reason = "";
    json_t *object = json_loads(json, 0, NULL);
    int bad = json_unpack(object, "{s:i, s:s, s:s, s:s}", "code", &code, "what", &what, "where",
        &where, "reason", &reason);
    enum hg_status status = hg_error_set(
        err, bad || !code ? HG_E_INTERNAL : (enum hg_status)code, what, where, "%s", reason);
    json_decref(object);
    return status;
}

static void on_progress(struct bench *b, const char *json)
{
    unsigned done, total;
    if (sscanf(json, "[%u,%u]", &done, &total) == 2)
        hg_cli_progress_update(&b->cli->progress, "frames", done, total);
}

static enum hg_status take_line(struct bench *b, const char *line, struct hg_error *err)
{
    static const char progress[] = "progress ", error[] = "error ", result[] = "result ";
    if (strncmp(line, progress, sizeof progress - 1) == 0) {
        on_progress(b, line + sizeof progress - 1);
        return HG_OK;
    }
    if (strncmp(line, error, sizeof error - 1) == 0)
        return on_error(line + sizeof error - 1, err);
    if (strncmp(line, result, sizeof result - 1) != 0 || b->report)
        return hg_error_set(err, HG_E_WORKER, b->path, NULL, "wrote something unexpected");
    b->report = hg_strdup(line + sizeof result - 1);
    return b->report ? HG_OK : hg_error_set(err, HG_E_NOMEM, b->path, NULL, "no memory");
}

static enum hg_status take_lines(struct bench *b, struct hg_error *err)
{
    char *text = (char *)b->text.data, *end;
    size_t taken = 0;
    enum hg_status status = HG_OK;
    while (!status && (end = memchr(text + taken, '\n', b->text.size - taken))) {
        *end = 0;
        status = take_line(b, text + taken, err);
        taken = (size_t)(end - text) + 1;
    }
    memmove(text, text + taken, b->text.size - taken);
    b->text.size -= taken;
    if (!status && b->text.size > LINE_BYTES)
        return hg_error_set(err, HG_E_WORKER, b->path, NULL, "wrote a line without an end");
    return status;
}

// HG_E_AGAIN: there will be more.
static enum hg_status read_some(struct bench *b, struct hg_error *err)
{
    char bytes[65536];
    ssize_t n = read(b->fd, bytes, sizeof bytes);
    if (n < 0 && errno == EINTR)
        return HG_E_AGAIN;
    if (n < 0)
        return hg_error_set(err, HG_E_WORKER, b->path, NULL, "cannot read: %s", strerror(errno));
    if (n == 0)
        return describe_end(b, err);
    hg_write_bytes(&b->text, bytes, (size_t)n);
    if (b->text.failed)
        return hg_error_set(err, HG_E_NOMEM, b->path, NULL, "no memory for its answer");
    enum hg_status status = take_lines(b, err);
    return status ? status : HG_E_AGAIN;
}

static enum hg_status follow(struct bench *b, struct hg_error *err)
{
    const struct hg_cli_options *o = b->cli->options;
    uint64_t begin_ns = hg_clock_now_ns();
    uint64_t most_ns = o->has_timeout ? (uint64_t)(o->timeout * 1e9) : UINT64_MAX;
    for (;;) {
        struct pollfd p = {.fd = b->fd, .events = POLLIN};
        if (hg_cli_is_stopped())
            return hg_error_set(err, HG_E_CANCELLED, b->path, NULL, "interrupted");
        if (hg_clock_now_ns() - begin_ns >= most_ns)
            return hg_error_set(err, HG_E_TIMEOUT, b->path, NULL, "no answer in time");
        if (poll(&p, 1, TICK_MS) <= 0) {
            hg_cli_on_tick(&b->cli->progress);
            continue;
        }
        enum hg_status status = read_some(b, err);
        if (status != HG_E_AGAIN)
            return status;
    }
}

// ---- the command -------------------------------------------------------------------------------

// Names of files that are there become absolute and are gathered: their folders may be read.
static void gather_files(json_t *value, struct hg_cli_texts *files)
{
    size_t index;
    const char *key;
    json_t *item;
    char full[PATH_MAX];
    json_array_foreach(value, index, item)
    {
        gather_files(item, files);
    }
    json_object_foreach(value, key, item)
    {
        gather_files(item, files);
    }
    const char *text = json_string_value(value);
    if (!text || !*text || !realpath(text, full) || files->count == HG_CLI_TEXTS_MAX)
        return;
    if (!json_string_set(value, full))
        files->items[files->count++] = json_string_value(value);
}

static enum hg_status read_options(
    const struct hg_cli_options *o, json_t **options, struct hg_error *err)
{
    json_error_t wrong;
    *options = NULL;
    if (o->json_file) {
        enum hg_status status = hg_cli_check_output(o->json_file, err);
        if (status)
            return status;
    }
    *options = json_loads(o->bench_options ? o->bench_options : "{}", 0, &wrong);
    if (json_is_object(*options))
        return HG_OK;
    json_decref(*options);
    *options = NULL;
    return hg_error_set(err, HG_E_INVAL, "--options", NULL, "is not a JSON object");
}

static enum hg_status start_with(struct bench *b, json_t *options, struct hg_error *err)
{
    struct hg_cli_texts files = {0};
    struct hg_cli_args args;
    gather_files(options, &files);
    enum hg_status status = hg_cli_args_make(&args, b->cli->options, &files, err);
    if (status)
        return status;
    char *text = json_dumps(options, JSON_COMPACT);
    status = text ? start(b, &args, text, err)
                  : hg_error_set(err, HG_E_NOMEM, "--options", NULL, "no memory");
    free(text);
    hg_cli_args_finish(&args);
    return status;
}

// Benchmarks that need no renderer of their own: clients of a daemon.
static const struct {
    const char *name;
    enum hg_status (*run)(
        struct hg_cli *cli, const json_t *options, char **report, struct hg_error *err);
} own[] = {{"siege", hg_cli_siege}, {"latency", hg_cli_bench_latency}, {"many", hg_cli_bench_many},
    {"stream", hg_cli_bench_stream}};

static enum hg_status run(struct bench *b, struct hg_error *err)
{
    json_t *options;
    enum hg_status status = read_options(b->cli->options, &options, err);
    if (status)
        return status;
    hg_cli_progress_stage(&b->cli->progress, "measuring");
    for (size_t i = 0; i < sizeof own / sizeof *own; i++)
        if (strcmp(b->cli->options->args[0], own[i].name) == 0) {
            status = own[i].run(b->cli, options, &b->report, err);
            json_decref(options);
            return status;
        }
    status = start_with(b, options, err);
    json_decref(options);
    if (status)
        return status;
    return follow(b, err);
}

static enum hg_status write_report(
    const struct hg_cli_options *o, const char *report, struct hg_error *err)
{
    if (o->json_file)
        return hg_cli_write_output(o->json_file, report, strlen(report), err);
    if (puts(report) == EOF)
        return hg_error_set(err, HG_E_IO, "standard output", NULL, "cannot write");
    return HG_OK;
}

enum hg_cli_exit hg_cli_bench(const struct hg_cli_options *options)
{
    struct hg_cli cli;
    struct hg_error err = {0};
    enum hg_cli_doing doing = HG_CLI_DOING_ARGUMENTS; // an unknown name or option
    hg_cli_init(&cli, options);
    struct bench b = {.cli = &cli, .fd = -1};
    enum hg_status status = run(&b, &err);
    hg_cli_progress_clear(&cli.progress);
    stop(&b);
    if (!status) {
        doing = HG_CLI_DOING_OUTPUT;
        status = write_report(options, b.report, &err);
    }
    hg_writer_finish(&b.text);
    hg_free(b.report);
    enum hg_cli_exit code = status ? hg_cli_report(&cli, doing, &err) : HG_CLI_EXIT_OK;
    hg_cli_finish(&cli, code);
    return code;
}
