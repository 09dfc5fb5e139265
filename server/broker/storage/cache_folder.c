#include "server/broker/storage/cache_folder.h"

#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "base/alloc.h"
#include "base/log.h"
#include "server/broker/storage/folder_lock.h"

enum { DAEMONS_MAX = 64 };

enum hg_status hg_cache_folder_choose(struct hg_options *o, struct hg_error *err)
{
    const char *given = getenv("CACHE_DIRECTORY"), *xdg = getenv("XDG_CACHE_HOME"),
               *home = getenv("HOME");
    if (o->cache_dir)
        return HG_OK;
    if (given && *given)
        o->cache_dir = hg_strdup(given);
    else if (xdg && *xdg)
        o->cache_dir = hg_folder_path(xdg, "heliograph");
    else if (home && *home)
        o->cache_dir = hg_folder_path(home, ".cache/heliograph");
    else
        return hg_error_set(
            err, HG_E_INVAL, "--cache-dir", NULL, "name a folder: the environment gives none");
    return o->cache_dir ? HG_OK : hg_error_set(err, HG_E_NOMEM, "--cache-dir", NULL, "no memory");
}

static enum hg_status try_folder(
    struct hg_cache_folder *folder, const char *path, bool patient, struct hg_error *err)
{
    enum hg_status status = hg_folder_make(path, err);
    return status ? status : hg_folder_lock(path, "--cache-dir", patient, &folder->lock_fd, err);
}

static enum hg_status try_others(
    struct hg_cache_folder *folder, struct hg_options *o, struct hg_error *err)
{
    enum hg_status status = HG_E_BUSY;
    for (int i = 2; i <= DAEMONS_MAX && status == HG_E_BUSY; i++) {
        char name[32];
        snprintf(name, sizeof name, "daemons/%d", i);
        char *path = hg_folder_path(folder->asked, name);
        *err = (struct hg_error){0};
        status = path ? try_folder(folder, path, false, err)
                      : hg_error_set(err, HG_E_NOMEM, "--cache-dir", NULL, "no memory");
        if (!status) {
            hg_info(MAIN, "another heliod uses %s: this one has %s", folder->asked, path);
            hg_free(o->cache_dir);
            o->cache_dir = path;
            path = NULL;
        }
        hg_free(path);
    }
    return status;
}

enum hg_status hg_cache_folder_open(
    struct hg_cache_folder *folder, struct hg_options *o, struct hg_error *err)
{
    if (folder->lock_fd >= 0)
        return HG_OK;
    if (!folder->asked && !(folder->asked = hg_strdup(o->cache_dir)))
        return hg_error_set(err, HG_E_NOMEM, "--cache-dir", NULL, "no memory");
    enum hg_status status = try_folder(folder, o->cache_dir, o->state_dir != NULL, err);
    if (status == HG_E_BUSY && !o->state_dir)
        status = try_others(folder, o, err);
    return status;
}

// A folder for one of several daemons belongs to the one that was asked for.
static bool belongs_to(const char *used, const char *asked)
{
    const size_t size = strlen(asked);
    return strncmp(used, asked, size) == 0 &&
           (!used[size] || strncmp(used + size, "/daemons/", 9) == 0);
}

bool hg_cache_folder_inherit(
    struct hg_cache_folder *folder, struct hg_options *o, const char *used, int lock_fd)
{
    char *copy = hg_strdup(used);
    folder->lock_fd = lock_fd;
    if (lock_fd >= 0)
        fcntl(lock_fd, F_SETFD, FD_CLOEXEC);
    folder->asked = hg_strdup(belongs_to(used, o->cache_dir) ? o->cache_dir : used);
    if (!copy || !folder->asked) {
        hg_free(copy);
        return false;
    }
    if (!belongs_to(used, o->cache_dir))
        hg_warn(MAIN, "cache-dir stays %s: another one needs a restart", used);
    hg_free(o->cache_dir);
    o->cache_dir = copy;
    return true;
}

bool hg_cache_folder_compare(const struct hg_cache_folder *folder, const struct hg_options *in_use,
    struct hg_options *reloaded)
{
    if (strcmp(reloaded->cache_dir, folder->asked) != 0)
        return true;
    hg_free(reloaded->cache_dir);
    reloaded->cache_dir = hg_strdup(in_use->cache_dir);
    return reloaded->cache_dir != NULL;
}

void hg_cache_folder_keep_open(const struct hg_cache_folder *folder)
{
    fcntl(folder->lock_fd, F_SETFD, 0);
}

void hg_cache_folder_close(struct hg_cache_folder *folder)
{
    if (folder->lock_fd >= 0)
        close(folder->lock_fd);
    hg_free(folder->asked);
    *folder = (struct hg_cache_folder){.lock_fd = -1};
}
