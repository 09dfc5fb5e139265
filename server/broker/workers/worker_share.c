#include "server/broker/workers/worker_share.h"

#include <dirent.h>
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <unistd.h>

#include "base/log.h"

enum { THREADS_MAX = 1024 };
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
enum { IS_SANITIZED = true }; // their shadow memory would count
#else
enum { IS_SANITIZED = false };
#endif
static const uint64_t room_bytes = UINT64_C(256) << 20; // above what a worker has already

// Of the machine, or of the control group where that has less.
static uint64_t whole_memory(const struct hg_cgroup *group)
{
    char path[HG_CGROUP_PATH + 16];
    unsigned long long limit = 0;
    uint64_t bytes = (uint64_t)sysconf(_SC_PHYS_PAGES) * (uint64_t)sysconf(_SC_PAGESIZE);
    snprintf(path, sizeof path, "%s/memory.max", group->path);
    FILE *file = group->path[0] ? fopen(path, "r") : NULL;
    if (file && fscanf(file, "%llu", &limit) == 1 && limit && limit < bytes)
        bytes = limit;
    if (file)
        fclose(file);
    return bytes;
}

enum hg_status hg_machine_init(
    struct hg_machine *machine, const struct hg_options *o, struct hg_error *err)
{
    *machine = (struct hg_machine){0};
    enum hg_status status = hg_cgroup_open(&machine->group, o->cgroup, err);
    if (!status && !o->memory_limit_bytes &&
        !IS_SANITIZED) // the rest is for the daemon and the system
        machine->memory_bytes = whole_memory(&machine->group) / 4 * 3;
    return status;
}

uint64_t hg_machine_most_bytes(const struct hg_machine *machine, const struct hg_options *o)
{
    return machine->memory_bytes ? machine->memory_bytes : o->memory_limit_bytes;
}

struct hg_worker_share hg_machine_share(
    const struct hg_machine *machine, const struct hg_options *o, uint32_t weight, uint64_t others)
{
    const uint64_t bytes =
        machine->memory_bytes
            ? (uint64_t)((double)machine->memory_bytes * weight / (double)(weight + others))
            : o->memory_limit_bytes;
    return (struct hg_worker_share){.memory_bytes = bytes, .weight = weight};
}

// How much a process of that weight gives way to one of the heaviest: 0 to 19. The kernel gives a
// thread 1.25 times the time of one that is nicer by one (sched(7)).
static int nice_of(uint32_t weight, uint32_t heaviest)
{
    if (weight >= heaviest)
        return 0;
    const double steps = log((double)heaviest / weight) / log(1.25);
    return steps > 19 ? 19 : (int)lround(steps);
}

// ---- without a control group --------------------------------------------------------------------

// Private writable memory, as RLIMIT_DATA counts it (proc(5), statm). 0: not known.
static uint64_t data_bytes(pid_t pid)
{
    char path[64];
    unsigned long long pages = 0;
    snprintf(path, sizeof path, "/proc/%d/statm", (int)pid);
    FILE *file = fopen(path, "r");
    if (file && fscanf(file, "%*u %*u %*u %*u %*u %llu", &pages) != 1)
        pages = 0;
    if (file)
        fclose(file);
    return (uint64_t)pages * (uint64_t)sysconf(_SC_PAGESIZE);
}

static void limit_data(pid_t pid, uint64_t bytes)
{
    struct rlimit limit;
    const uint64_t least = data_bytes(pid) + room_bytes;
    if (prlimit(pid, RLIMIT_DATA, NULL, &limit) != 0)
        return;
    limit.rlim_cur = bytes > least ? bytes : least;
    if (limit.rlim_cur > limit.rlim_max)
        limit.rlim_cur = limit.rlim_max;
    if (prlimit(pid, RLIMIT_DATA, &limit, NULL) != 0)
        hg_debug(WORKER, "memory of worker %d: %s", (int)pid, strerror(errno));
}

// Each thread has its own; those to come have that of the one that starts them. It never falls
// again: that takes a right that the daemon does not have.
static void give_way(pid_t pid, int nice)
{
    char path[64];
    snprintf(path, sizeof path, "/proc/%d/task", (int)pid);
    DIR *dir = nice ? opendir(path) : NULL;
    for (struct dirent *it; dir && (it = readdir(dir));) {
        const int thread = atoi(it->d_name);
        if (thread > 0 && getpriority(PRIO_PROCESS, (id_t)thread) < nice)
            setpriority(PRIO_PROCESS, (id_t)thread, nice);
    }
    if (dir)
        closedir(dir);
}

void hg_worker_share_apply(const struct hg_machine *machine, const struct hg_options *o,
    uint32_t number, pid_t pid, const struct hg_worker_share *share)
{
    if (machine->group.path[0]) {
        const uint64_t least = hg_cgroup_memory(&machine->group, number) + room_bytes;
        hg_cgroup_set(&machine->group, number,
            &(struct hg_cgroup_share){.cpu_weight = share->weight,
                .memory_bytes = share->memory_bytes && share->memory_bytes < least
                                    ? least
                                    : share->memory_bytes,
                .processes = THREADS_MAX});
        return;
    }
    if (share->memory_bytes && strcmp(o->sandbox, "off") != 0)
        limit_data(pid, share->memory_bytes);
    const int steps = nice_of(share->weight, share->heaviest);
    const int nice = steps + getpriority(PRIO_PROCESS, 0) + (int)o->worker_nice;
    give_way(pid, !steps ? 0 : nice > 19 ? 19 : nice);
}
