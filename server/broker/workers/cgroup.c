#include "server/broker/workers/cgroup.h"

#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/xattr.h>
#include <unistd.h>

#include "base/log.h"

static const char root[] = "/sys/fs/cgroup";

// errno, 0 = written. Files are there already in a real hierarchy.
static int write_file(const char *folder, const char *name, const char *text)
{
    char path[HG_CGROUP_PATH + 64];
    snprintf(path, sizeof path, "%s/%s", folder, name);
    const int fd = open(path, O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0600);
    const ssize_t size = (ssize_t)strlen(text);
    const int failed = fd < 0 || write(fd, text, (size_t)size) != size ? errno : 0;
    if (fd >= 0)
        close(fd);
    return failed;
}

static void worker_folder(
    const struct hg_cgroup *group, uint32_t number, char path[HG_CGROUP_PATH + 32])
{
    snprintf(path, HG_CGROUP_PATH + 32, "%s/worker-%u", group->path, number);
}

// ---- which group --------------------------------------------------------------------------------

// Of the one line "0::PATH" (cgroups(7)); a machine without version 2 has none.
static bool find_own(char *path, size_t size)
{
    char line[HG_CGROUP_PATH], text[HG_CGROUP_PATH] = "";
    FILE *file = fopen("/proc/self/cgroup", "r");
    while (file && fgets(line, sizeof line, file))
        if (strncmp(line, "0::", 3) == 0)
            snprintf(text, sizeof text, "%.*s", (int)strcspn(line + 3, "\n"), line + 3);
    if (file)
        fclose(file);
    return text[0] && (size_t)snprintf(path, size, "%s%s", root, text) < size;
}

// As service managers mark what they have given away (systemd: Delegate=, CGROUP_DELEGATION).
static bool is_delegated(const char *path)
{
    static const char *const names[] = {"user.delegate", "trusted.delegate"};
    char value = 0;
    for (size_t i = 0; i < sizeof names / sizeof *names; i++)
        if (getxattr(path, names[i], &value, 1) == 1 && value == '1')
            return true;
    return false;
}

// Controllers are shared out to groups below one that has no process.
static int prepare(const struct hg_cgroup *group)
{
    static const char *const controllers[] = {"+cpu", "+memory", "+pids"};
    char below[HG_CGROUP_PATH + 32], pid[32];
    snprintf(below, sizeof below, "%s/daemon", group->path);
    snprintf(pid, sizeof pid, "%d", (int)getpid());
    if (mkdir(below, 0700) != 0 && errno != EEXIST)
        return errno;
    int failed = write_file(below, "cgroup.procs", pid);
    for (size_t i = 0; i < sizeof controllers / sizeof *controllers && !failed; i++) {
        failed = write_file(group->path, "cgroup.subtree_control", controllers[i]);
        if (failed == ENOENT || failed == EINVAL) { // this one is not there
            hg_info(WORKER, "cgroup %s has no controller %s", group->path, controllers[i] + 1);
            failed = 0;
        }
    }
    return failed;
}

enum hg_status hg_cgroup_open(struct hg_cgroup *group, const char *wanted, struct hg_error *err)
{
    const bool is_auto = strcmp(wanted, "auto") == 0;
    char path[HG_CGROUP_PATH];
    *group = (struct hg_cgroup){0};
    if (strcmp(wanted, "off") == 0)
        return HG_OK;
    if (is_auto && !find_own(path, sizeof path))
        return HG_OK;
    char *last = is_auto && !is_delegated(path) ? strrchr(path, '/') : NULL;
    if (last && strcmp(last, "/daemon") == 0) // a program before this one has moved there
        *last = 0;
    if (is_auto && !is_delegated(path))
        return HG_OK;
    if (!is_auto && (size_t)snprintf(path, sizeof path, "%s", wanted) >= sizeof path)
        return hg_error_set(err, HG_E_LIMIT, "--cgroup", NULL, "the name is too long");
    memcpy(group->path, path, sizeof path);
    const int failed = prepare(group);
    if (!failed) {
        hg_info(WORKER, "workers get control groups below %s", path);
        return HG_OK;
    }
    group->path[0] = 0;
    if (!is_auto)
        return hg_error_set(err, failed == ENOENT ? HG_E_NOTFOUND : HG_E_PERM, "--cgroup", NULL,
            "%s cannot be used: %s", path, strerror(failed));
    hg_warn(WORKER, "no control groups for workers: %s: %s", path, strerror(failed));
    return HG_OK;
}

// ---- workers ------------------------------------------------------------------------------------

bool hg_cgroup_enter(const struct hg_cgroup *group, uint32_t number, pid_t pid)
{
    char folder[HG_CGROUP_PATH + 32], text[32];
    if (!group->path[0])
        return false;
    worker_folder(group, number, folder);
    snprintf(text, sizeof text, "%d", (int)pid);
    int failed = mkdir(folder, 0700) != 0 && errno != EEXIST ? errno : 0;
    if (!failed)
        failed = write_file(folder, "cgroup.procs", text);
    if (failed)
        hg_warn(WORKER, "worker %s is in no control group: %s: %s", text, folder, strerror(failed));
    return !failed;
}

void hg_cgroup_set(
    const struct hg_cgroup *group, uint32_t number, const struct hg_cgroup_share *share)
{
    char folder[HG_CGROUP_PATH + 32], weight[32], memory[32] = "max", processes[32];
    if (!group->path[0])
        return;
    worker_folder(group, number, folder);
    snprintf(weight, sizeof weight, "%u", share->cpu_weight);
    snprintf(processes, sizeof processes, "%u", share->processes);
    if (share->memory_bytes)
        snprintf(memory, sizeof memory, "%llu", (unsigned long long)share->memory_bytes);
    const struct {
        const char *name, *text;
    } files[] = {{"cpu.weight", weight}, {"memory.max", memory}, {"pids.max", processes}};
    for (size_t i = 0; i < sizeof files / sizeof *files; i++) {
        const int failed = write_file(folder, files[i].name, files[i].text);
        if (failed)
            hg_debug(WORKER, "%s/%s: %s", folder, files[i].name, strerror(failed));
    }
}

uint64_t hg_cgroup_memory(const struct hg_cgroup *group, uint32_t number)
{
    char path[HG_CGROUP_PATH + 64];
    unsigned long long bytes = 0;
    worker_folder(group, number, path);
    strcat(path, "/memory.current");
    FILE *file = fopen(path, "r");
    if (file && fscanf(file, "%llu", &bytes) != 1)
        bytes = 0;
    if (file)
        fclose(file);
    return bytes;
}

void hg_cgroup_remove(const struct hg_cgroup *group, uint32_t number)
{
    char folder[HG_CGROUP_PATH + 32];
    if (!group->path[0])
        return;
    worker_folder(group, number, folder);
    if (rmdir(folder) != 0)
        hg_debug(WORKER, "%s: %s", folder, strerror(errno));
}
