// run.c - helio run: executes the steps of scripts, a session for each, and writes the reports.
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#include "base/alloc.h"
#include "base/file.h"
#include "client/cli/run/run.h"

enum { SCRIPT_BYTES = 16 * 1024 * 1024 };

// All scripts of a command.
struct runs {
    const struct hg_cli_options *o;
    struct hg_cli_script scripts[HG_CLI_ARGS_MAX];
    struct hg_cli_report report;
    struct hg_cli_recorder *recorder; // of --record
    enum hg_cli_doing doing;
    char folder[4096]; // for ${SCRIPT_DIR}
};

// ---- reading -----------------------------------------------------------------------------------

static const char *folder_of(struct runs *r, const char *file)
{
    const char *slash = strrchr(file, '/');
    snprintf(
        r->folder, sizeof r->folder, "%.*s", slash ? (int)(slash - file) : 1, slash ? file : ".");
    return r->folder;
}

static const char *variable(void *user, const char *file, const char *name, size_t length)
{
    struct runs *r = user;
    char text[256];
    for (uint32_t i = r->o->define.count; i-- > 0;) {
        const char *d = r->o->define.items[i];
        if (strncmp(d, name, length) == 0 && d[length] == '=')
            return d + length + 1;
    }
    if (length == strlen("SCRIPT_DIR") && memcmp(name, "SCRIPT_DIR", length) == 0)
        return folder_of(r, file);
    if (length >= sizeof text)
        return NULL;
    snprintf(text, sizeof text, "%.*s", (int)length, name);
    return getenv(text);
}

static enum hg_status read_stdin(uint8_t **data, size_t *size, struct hg_error *err)
{
    size_t capacity = 0, got;
    *data = NULL;
    *size = 0;
    do {
        if (hg_grow(data, &capacity, *size + 65536, 1))
            return hg_error_set(
                err, HG_E_NOMEM, "standard input", NULL, "no memory for the script");
        got = fread(*data + *size, 1, 65535, stdin);
        *size += got;
        (*data)[*size] = 0;
        if (*size > SCRIPT_BYTES)
            return hg_error_set(err, HG_E_LIMIT, "standard input", NULL,
                "the script is longer than %d bytes", SCRIPT_BYTES);
    } while (got > 0);
    return ferror(stdin) ? hg_error_set(err, HG_E_IO, "standard input", NULL, "cannot be read")
                         : HG_OK;
}

static enum hg_status read_text(void *user, const char *path, char **text, struct hg_error *err)
{
    uint8_t *data = NULL;
    size_t size = 0;
    (void)user;
    *text = NULL;
    enum hg_status status = strcmp(path, "-") == 0
                                ? read_stdin(&data, &size, err)
                                : hg_file_read(path, SCRIPT_BYTES, &data, &size, err);
    if (!status && strlen((const char *)data) != size)
        status = hg_error_set(err, HG_E_INVAL, path, NULL, "holds a zero byte");
    if (status)
        hg_free(data);
    else
        *text = (char *)data;
    return status;
}

static enum hg_status read_script(struct runs *r, uint32_t i, struct hg_error *err)
{
    const struct hg_cli_script_source source = {variable, read_text, r};
    const char *path = r->o->args[i];
    char *text;
    r->doing = HG_CLI_DOING_INPUT;
    enum hg_status status = read_text(r, path, &text, err);
    if (status)
        return status;
    r->doing = HG_CLI_DOING_ARGUMENTS;
    status = hg_cli_script_parse(
        strcmp(path, "-") == 0 ? "standard input" : path, text, &source, &r->scripts[i], err);
    hg_free(text);
    return status;
}

// Pictures can be written: their folders are there, which no line of a script makes.
static enum hg_status check_frames(const struct hg_cli_script *script, struct hg_error *err)
{
    for (size_t i = 0; i < script->count; i++) {
        const struct hg_cli_step *s = &script->steps[i];
        struct hg_cli_format format = hg_cli_run_png;
        struct hg_error why = {0};
        if (s->kind != HG_CLI_STEP_FRAME || !s->path ||
            (!hg_cli_format_of(s->path, NULL, &format, &why) &&
                !hg_cli_check_output(format.path, &why)))
            continue;
        char place[300];
        snprintf(place, sizeof place, "%.280s:%u", s->file, s->line);
        return hg_error_set(err, why.status, place, NULL, "%s: %s", s->path, why.reason);
    }
    return HG_OK;
}

static enum hg_status check_options(const struct hg_cli_options *o, struct hg_error *err)
{
    if (o->arg_count == 0)
        return hg_error_set(err, HG_E_INVAL, "run", NULL, "needs SCRIPT..., or --replay");
    if (o->has_pace)
        return hg_error_set(err, HG_E_INVAL, "--pace", NULL, "needs --replay");
    if (o->record && hg_cli_check_output(o->record, err))
        return err->status;
    for (uint32_t i = 0; i < o->define.count; i++)
        if (!strchr(o->define.items[i], '=') || o->define.items[i][0] == '=')
            return hg_error_set(
                err, HG_E_INVAL, "--define", NULL, "'%s' is not NAME=VALUE", o->define.items[i]);
    for (uint32_t i = 0, inputs = 0; i < o->arg_count; i++)
        if (strcmp(o->args[i], "-") == 0 && inputs++ > 0)
            return hg_error_set(err, HG_E_INVAL, "-", NULL, "the standard input is one script");
    if (o->report && mkdir(o->report, 0777) && errno != EEXIST)
        return hg_error_set(err, hg_status_from_errno(errno), o->report, NULL, "cannot be made: %s",
            strerror(errno));
    return o->junit ? hg_cli_check_output(o->junit, err) : HG_OK;
}

// ---- one script --------------------------------------------------------------------------------

// The worker starts before the script loads anything: its folders are gathered first.
static void gather_files(struct hg_cli_run *r)
{
    for (size_t i = 0; i < r->script->count; i++) {
        const struct hg_cli_step *s = &r->script->steps[i];
        bool read = s->kind == HG_CLI_STEP_LOAD || (s->kind == HG_CLI_STEP_ENVIRONMENT && s->path);
        if (read && r->files.count < HG_CLI_TEXTS_MAX)
            r->files.items[r->files.count++] = s->path;
    }
}

static uint32_t count_frames(const struct hg_cli_script *script)
{
    uint32_t count = 0;
    for (size_t i = 0; i < script->count; i++)
        count += script->steps[i].kind == HG_CLI_STEP_FRAME && script->steps[i].path;
    return count;
}

// The scene that is opened by the connection of this step; NULL: a private one.
static const char *scene_behind(const struct hg_cli_run *r, const struct hg_cli_step *s)
{
    const struct hg_cli_step *end = r->script->steps + r->script->count;
    for (s++; s < end && s->kind != HG_CLI_STEP_CONNECT; s++)
        if (s->kind == HG_CLI_STEP_SCENE)
            return s->name;
    return NULL;
}

static enum hg_status do_step(
    struct hg_cli_run *r, const struct hg_cli_step *s, struct hg_error *err)
{
    if (s->kind == HG_CLI_STEP_CONNECT)
        return hg_cli_run_connect(r, s->path, scene_behind(r, s), err);
    if (s->kind == HG_CLI_STEP_SCENE)
        return hg_cli_run_join(r, s->name, err);
    enum hg_status status = hg_cli_run_need_scene(r, err);
    if (status)
        return status;
    r->doing = HG_CLI_DOING_ARGUMENTS;
    if (hg_cli_run_is_expectation(s))
        return hg_cli_run_expect(r, s, err);
    if (s->kind == HG_CLI_STEP_SWITCH)
        return hg_cli_run_switch(r, s, err);
    return s->kind == HG_CLI_STEP_FRAME ? hg_cli_run_frame(r, s, err) : hg_cli_run_edit(r, s, err);
}

// The line that ended the script, on the error stream and in the report; expectations behind it are
// skipped.
static void report_broken(struct hg_cli_run *r, size_t step, const struct hg_error *err)
{
    char name[300], message[1024], reason[400];
    const struct hg_cli_step *s = &r->script->steps[step];
    hg_error_format(err, reason, sizeof reason);
    snprintf(name, sizeof name, "line %u: %.256s", s->line, s->text);
    snprintf(message, sizeof message, "%.200s:%u: %.200s: %s", s->file, s->line, s->text, reason);
    char line[1024];
    snprintf(line, sizeof line, "%.700s:%u: %.200s", s->file, s->line, s->text);
    hg_cli_progress_print(&r->cli.progress, line);
    struct hg_cli_case c = {.verdict = HG_CLI_BROKEN, .name = name, .message = message};
    bool kept = hg_cli_report_add(r->report, &c) == HG_OK;
    for (size_t i = step + 1; kept && i < r->script->count; i++) {
        s = &r->script->steps[i];
        if (!hg_cli_run_is_expectation(s))
            continue;
        snprintf(name, sizeof name, "line %u: %.256s", s->line, s->text);
        c = (struct hg_cli_case){.verdict = HG_CLI_SKIPPED, .name = name};
        kept = hg_cli_report_add(r->report, &c) == HG_OK;
    }
    if (!kept)
        fprintf(stderr, "helio: no memory for the report\n");
}

static void print_summary(
    const struct hg_cli_options *o, const struct hg_cli_report *report, const char *script)
{
    FILE *out = o->junit && hg_cli_is_stdout(o->junit) ? stderr : stdout;
    const int64_t suite = (int64_t)report->suite_count - 1;
    size_t expectations = 0;
    for (size_t i = 0; i < report->count; i++)
        expectations +=
            report->cases[i].suite == suite && report->cases[i].verdict != HG_CLI_BROKEN;
    fprintf(out, "%s: %zu expectation%s, %zu failed", script, expectations,
        expectations == 1 ? "" : "s", hg_cli_report_count(report, suite, HG_CLI_DIFFERS));
    const size_t updated = hg_cli_report_count(report, suite, HG_CLI_UPDATED);
    const size_t skipped = hg_cli_report_count(report, suite, HG_CLI_SKIPPED);
    if (updated)
        fprintf(out, ", %zu reference%s replaced", updated, updated == 1 ? "" : "s");
    if (skipped)
        fprintf(out, ", %zu skipped", skipped);
    fputc('\n', out);
}

static enum hg_cli_exit run_steps(struct hg_cli_run *r)
{
    struct hg_error err = {0};
    enum hg_status status = HG_OK;
    enum hg_cli_exit code = HG_CLI_EXIT_OK;
    gather_files(r);
    hg_cli_progress_frames(&r->cli.progress, count_frames(r->script));
    for (size_t i = 0; !status && i < r->script->count; i++) {
        status = hg_cli_is_stopped() ? HG_E_CANCELLED : do_step(r, &r->script->steps[i], &err);
        if (!status)
            continue;
        err.status = status;
        report_broken(r, i, &err);
        code = hg_cli_report(&r->cli, r->doing, &err);
    }
    const int64_t suite = (int64_t)r->report->suite_count - 1;
    hg_cli_progress_clear(&r->cli.progress);
    return !status && hg_cli_report_count(r->report, suite, HG_CLI_DIFFERS) ? HG_CLI_EXIT_FAILED
                                                                            : code;
}

static enum hg_cli_exit run_script(struct runs *runs, uint32_t i)
{
    struct hg_cli_run *r = hg_calloc(1, sizeof *r);
    if (!r || hg_cli_report_begin(&runs->report, runs->o->args[i])) {
        hg_free(r);
        fprintf(stderr, "helio: no memory for a script\n");
        return HG_CLI_EXIT_LIMIT;
    }
    r->o = runs->o;
    r->report = &runs->report;
    r->recorder = runs->recorder;
    r->script = &runs->scripts[i];
    r->doing = HG_CLI_DOING_ARGUMENTS;
    hg_cli_init(&r->cli, runs->o);
    hg_cli_run_forget(r);
    enum hg_cli_exit code = run_steps(r);
    print_summary(runs->o, &runs->report, runs->o->args[i]);
    hg_cli_run_forget(r);
    hg_cli_finish(&r->cli, code);
    hg_free(r);
    return code;
}

// ---- the command -------------------------------------------------------------------------------

// Mistakes of any script are found before the first line of the first one runs.
static enum hg_cli_exit read_scripts(struct runs *r)
{
    struct hg_error err = {0};
    r->doing = HG_CLI_DOING_ARGUMENTS;
    enum hg_status status = check_options(r->o, &err);
    const bool checked = !status;
    uint32_t i = 0;
    while (!status && i < r->o->arg_count) {
        status = read_script(r, i, &err);
        if (!status)
            status = check_frames(&r->scripts[i], &err);
        i += !status;
    }
    if (!status)
        return HG_CLI_EXIT_OK;
    const struct hg_cli_case c = {
        .verdict = HG_CLI_BROKEN, .name = "script", .message = err.reason};
    if (checked &&
        (hg_cli_report_begin(&r->report, r->o->args[i]) || hg_cli_report_add(&r->report, &c)))
        fprintf(stderr, "helio: no memory for the report\n");
    return hg_cli_report(NULL, r->doing, &err);
}

static enum hg_status write_report(const struct runs *r, bool html, struct hg_error *err)
{
    char path[4200];
    struct hg_writer w = {0};
    if (html)
        snprintf(path, sizeof path, "%.4096s/index.html", r->o->report);
    else
        snprintf(path, sizeof path, "%.4096s", r->o->junit);
    enum hg_status status = html ? hg_cli_report_write_html(&r->report, &w)
                                 : hg_cli_report_write_junit(&r->report, r->o->report, &w);
    if (status)
        hg_error_set(err, status, path, NULL, "no memory for the report");
    else
        status = hg_cli_write_output(path, w.data, w.size, err);
    hg_writer_finish(&w);
    return status;
}

// An error counts more than expectations that failed, and the first error more than later ones.
static enum hg_cli_exit worse(enum hg_cli_exit a, enum hg_cli_exit b)
{
    return a == HG_CLI_EXIT_OK || (a == HG_CLI_EXIT_FAILED && b != HG_CLI_EXIT_OK) ? b : a;
}

static enum hg_cli_exit run_all(struct runs *r)
{
    struct hg_error err = {0};
    enum hg_cli_exit code = read_scripts(r);
    if (code == HG_CLI_EXIT_OK && r->o->record &&
        hg_cli_recorder_create(r->o->record, &r->recorder, &err))
        code = hg_cli_report(NULL, HG_CLI_DOING_OUTPUT, &err);
    if (code == HG_CLI_EXIT_OK)
        for (uint32_t i = 0; i < r->o->arg_count; i++)
            code = worse(code, run_script(r, i));
    if (hg_cli_recorder_finish(r->recorder, &err))
        code = hg_cli_report(NULL, HG_CLI_DOING_OUTPUT, &err);
    if (r->report.suite_count == 0)
        return code;
    if (r->o->junit && write_report(r, false, &err))
        code = hg_cli_report(NULL, HG_CLI_DOING_OUTPUT, &err);
    if (r->o->report && write_report(r, true, &err))
        code = hg_cli_report(NULL, HG_CLI_DOING_OUTPUT, &err);
    return code;
}

enum hg_cli_exit hg_cli_run(const struct hg_cli_options *options)
{
    if (options->replay)
        return hg_cli_run_replay(options);
    struct runs *r = hg_calloc(1, sizeof *r);
    if (!r)
        return HG_CLI_EXIT_LIMIT;
    r->o = options;
    enum hg_cli_exit code = run_all(r);
    for (uint32_t i = 0; i < options->arg_count; i++)
        hg_cli_script_finish(&r->scripts[i]);
    hg_cli_report_finish(&r->report);
    hg_free(r);
    return code;
}
