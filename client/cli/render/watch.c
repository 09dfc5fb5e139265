// watch.c - helio render --watch: renders again whenever a file that the picture is made of
// changes.
//
// inotify watches folders, since editors and exporters replace files by renaming others to them.
// Watches are set before each rendering, so a change during one is rendered after it.
#include <errno.h>
#include <limits.h>
#include <poll.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <sys/inotify.h>
#include <unistd.h>

#include "base/alloc.h"
#include "base/clock.h"
#include "base/file.h"
#include "client/cli/render/render.h"

enum { QUIET_MS = 150, MOST_MS = 2000 }; // without a change until it is rendered; at most

#define CHANGES                                                                                    \
    (IN_CLOSE_WRITE | IN_MODIFY | IN_CREATE | IN_MOVED_TO | IN_DELETE_SELF | IN_MOVE_SELF)

// A file in a watched folder; name NULL: any image, but for the output.
struct entry {
    int folder; // watch descriptor
    char *name;
};

struct watch {
    int fd;
    struct entry *entries;
    size_t count, capacity;
    const char *output; // name without its folder
};

static void close_watch(struct watch *w)
{
    if (w->fd >= 0)
        close(w->fd);
    for (size_t i = 0; i < w->count; i++)
        hg_free(w->entries[i].name);
    hg_free(w->entries);
    *w = (struct watch){.fd = -1};
}

static const char *name_of(const char *path)
{
    const char *slash = strrchr(path, '/');
    return slash ? slash + 1 : path;
}

// A file of that folder, or its images. What cannot be watched is left out: loading says why.
static enum hg_status add_name(struct watch *w, const char *path, bool images)
{
    char folder[PATH_MAX];
    const char *name = name_of(path);
    const size_t length = (size_t)(name - path);
    snprintf(folder, sizeof folder, "%.*s", length ? (int)length : 1, length ? path : ".");
    const int descriptor = inotify_add_watch(w->fd, folder, CHANGES | IN_ONLYDIR);
    if (descriptor < 0)
        return HG_OK;
    if (hg_grow(&w->entries, &w->capacity, w->count + 1, sizeof *w->entries))
        return HG_E_NOMEM;
    char *copy = images ? NULL : hg_strdup(name);
    if (!copy && !images)
        return HG_E_NOMEM;
    w->entries[w->count++] = (struct entry){descriptor, copy};
    return HG_OK;
}

// A file by its name, and what a symbolic link leads to.
static enum hg_status add_path(struct watch *w, const char *path)
{
    char real[PATH_MAX];
    enum hg_status status = add_name(w, path, false);
    if (!status && realpath(path, real) && strcmp(real, path) != 0)
        status = add_name(w, real, false);
    return status;
}

// Formats whose references are found by the importer alone.
static bool refers_elsewhere(const char *path)
{
    const char *dot = strrchr(name_of(path), '.');
    return dot && (strcasecmp(dot, ".fbx") == 0 || strcasecmp(dot, ".dae") == 0);
}

static enum hg_status add_scene(struct watch *w, const char *path)
{
    struct hg_cli_files files = {0};
    struct hg_error ignored = {0};
    enum hg_status status = add_path(w, path);
    if (!status && refers_elsewhere(path))
        status = add_name(w, path, true);
    if (status || hg_cli_files_of_asset(path, &files, &ignored)) // said when it is loaded
        return status;
    for (uint32_t i = 1; i < files.count && !status; i++)
        status = add_path(w, files.items[i].path);
    hg_cli_files_free(&files);
    return status;
}

static enum hg_status open_watch(
    struct watch *w, const struct hg_cli_options *o, struct hg_error *err)
{
    const bool env = o->has_env && strcmp(o->env, "none") != 0 && strcmp(o->env, "sky") != 0;
    *w =
        (struct watch){.fd = inotify_init1(IN_CLOEXEC | IN_NONBLOCK), .output = name_of(o->output)};
    if (w->fd < 0)
        return hg_error_set(err, hg_status_from_errno(errno), "--watch", NULL,
            "cannot watch files: %s", strerror(errno));
    enum hg_status status = add_scene(w, o->args[0]);
    if (!status && env)
        status = add_path(w, o->env);
    if (!status)
        return HG_OK;
    close_watch(w);
    return hg_error_set(err, status, "--watch", NULL, "no memory for the files' names");
}

static bool is_image(const char *name)
{
    static const char *const endings[] = {".png", ".jpg", ".jpeg", ".tga", ".bmp", ".tif", ".tiff",
        ".exr", ".hdr", ".webp", ".dds", ".ktx2", ".psd", ".gif"};
    const char *dot = strrchr(name, '.');
    for (size_t i = 0; dot && i < sizeof endings / sizeof *endings; i++)
        if (strcasecmp(dot, endings[i]) == 0)
            return true;
    return false;
}

// The name is that of the output, or one of its frames (before their number).
static bool is_output(const struct watch *w, const char *name)
{
    const size_t fixed = strcspn(w->output, "#%");
    return w->output[fixed] ? strncmp(name, w->output, fixed) == 0 : strcmp(name, w->output) == 0;
}

static bool concerns(const struct watch *w, const struct inotify_event *event)
{
    const char *name = event->len ? event->name : "";
    if (event->mask & (IN_Q_OVERFLOW | IN_DELETE_SELF | IN_MOVE_SELF))
        return true;
    for (size_t i = 0; i < w->count; i++) {
        const struct entry *e = &w->entries[i];
        if (e->folder == event->wd &&
            (e->name ? strcmp(e->name, name) == 0 : is_image(name) && !is_output(w, name)))
            return true;
    }
    return false;
}

// Takes the events that are there. True: one is about a file of the picture.
static bool take_events(const struct watch *w)
{
    _Alignas(struct inotify_event) char buffer[16384];
    bool changed = false;
    for (;;) {
        const ssize_t size = read(w->fd, buffer, sizeof buffer);
        if (size <= 0)
            return changed;
        for (const char *at = buffer; at < buffer + size;) {
            const struct inotify_event *event = (const struct inotify_event *)(const void *)at;
            changed |= concerns(w, event);
            at += sizeof *event + event->len;
        }
    }
}

// Until a file has changed and then rests for a moment. False: a signal ends the command.
static bool wait_change(const struct watch *w)
{
    struct pollfd fd = {w->fd, POLLIN, 0};
    sigset_t block, before;
    sigemptyset(&block);
    sigaddset(&block, SIGINT);
    sigaddset(&block, SIGTERM);
    sigaddset(&block, SIGHUP);
    sigprocmask(SIG_BLOCK, &block, &before); // a signal is not missed between the test and the wait
    uint64_t first_ns = 0;
    for (;;) {
        const struct timespec quiet = {.tv_nsec = QUIET_MS * 1000000L};
        if (hg_cli_is_stopped())
            break;
        const int ready = ppoll(&fd, 1, first_ns ? &quiet : NULL, &before);
        const uint64_t now = hg_clock_now_ns();
        if (ready > 0 && take_events(w) && !first_ns)
            first_ns = now;
        if (first_ns && (ready == 0 || now - first_ns > MOST_MS * UINT64_C(1000000)))
            break;
    }
    sigprocmask(SIG_SETMASK, &before, NULL);
    return !hg_cli_is_stopped();
}

enum hg_status hg_cli_check_watch(const struct hg_cli_options *o, struct hg_error *err)
{
    const char *reason = strcmp(o->args[0], "demo:") == 0 ? "has no file to watch for demo:"
                         : o->has_connect && !o->upload
                             ? "needs files of this machine: with --connect, --upload"
                             : NULL;
    return o->watch && reason ? hg_error_set(err, HG_E_INVAL, "--watch", NULL, "%s", reason)
                              : HG_OK;
}

// A command that is wrong stays so, whatever the files become.
static bool is_final(enum hg_cli_exit code)
{
    return code == HG_CLI_EXIT_USAGE || code == HG_CLI_EXIT_UNREACHABLE ||
           code == HG_CLI_EXIT_NOT_ALLOWED;
}

enum hg_cli_exit hg_cli_watch(
    const struct hg_cli_options *o, enum hg_cli_exit (*render)(const struct hg_cli_options *))
{
    for (bool first = true;; first = false) {
        struct watch w;
        struct hg_error err = {0};
        if (open_watch(&w, o, &err))
            return hg_cli_report(NULL, HG_CLI_DOING_ARGUMENTS, &err);
        const enum hg_cli_exit code = render(o);
        if (hg_cli_is_stopped() || (first && is_final(code))) {
            close_watch(&w);
            return code;
        }
        fprintf(
            stderr, "helio: watching %zu file%s; Ctrl-C ends\n", w.count, w.count == 1 ? "" : "s");
        const bool changed = wait_change(&w);
        close_watch(&w);
        if (!changed)
            return HG_CLI_EXIT_OK;
    }
}
