#include "client/cli/bench/bench_cpu.h"

#include <dirent.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <unistd.h>

#include "base/alloc.h"

struct process {
    pid_t pid, parent;
    double own_s, ended_s; // of itself; of its children that have ended
    uint64_t bytes;        // resident
    bool belongs;          // below the daemon
};

struct processes {
    struct process *items;
    size_t count, room;
};

// False: it has ended meanwhile.
static bool read_process(pid_t pid, struct process *p)
{
    char path[64], text[1024];
    unsigned long long user, system, ended_user, ended_system;
    long long pages;
    int parent;
    snprintf(path, sizeof path, "/proc/%d/stat", (int)pid);
    FILE *file = fopen(path, "re");
    if (!file)
        return false;
    const size_t n = fread(text, 1, sizeof text - 1, file);
    fclose(file);
    text[n] = 0;
    const char *rest = strrchr(text, ')'); // behind the program's name, which may hold anything
    if (!rest || sscanf(rest + 1,
                     " %*c %d %*d %*d %*d %*d %*u %*u %*u %*u %*u %llu %llu %llu %llu"
                     " %*d %*d %*d %*d %*u %*u %lld",
                     &parent, &user, &system, &ended_user, &ended_system, &pages) != 6)
        return false;
    const double tick_s = 1.0 / (double)sysconf(_SC_CLK_TCK);
    *p = (struct process){.pid = pid,
        .parent = parent,
        .bytes = (uint64_t)pages * (uint64_t)sysconf(_SC_PAGESIZE),
        .own_s = (double)(user + system) * tick_s,
        .ended_s = (double)(ended_user + ended_system) * tick_s};
    return true;
}

static void read_all(struct processes *all)
{
    DIR *dir = opendir("/proc");
    for (struct dirent *it; dir && (it = readdir(dir));) {
        const pid_t pid = atoi(it->d_name);
        if (all->count == all->room) {
            const size_t room = all->room ? 2 * all->room : 256;
            struct process *items = hg_realloc(all->items, room, sizeof *items);
            if (!items)
                break;
            all->items = items;
            all->room = room;
        }
        if (pid > 0)
            all->count += read_process(pid, &all->items[all->count]);
    }
    if (dir)
        closedir(dir);
}

static const struct process *find(const struct processes *all, pid_t pid)
{
    for (size_t i = 0; i < all->count; i++)
        if (all->items[i].pid == pid)
            return &all->items[i];
    return NULL;
}

// Parents may follow their children: until no more are found.
static void mark(const struct processes *all, pid_t daemon)
{
    for (bool found = true; found;) {
        found = false;
        for (size_t i = 0; i < all->count; i++) {
            struct process *p = &all->items[i];
            const struct process *parent = find(all, p->parent);
            if (p->belongs || !(p->parent == daemon || (parent && parent->belongs)))
                continue;
            p->belongs = found = true;
        }
    }
}

static double seconds_of(struct timeval t)
{
    return (double)t.tv_sec + (double)t.tv_usec * 1e-6;
}

struct hg_bench_cpu hg_bench_cpu_now(pid_t daemon)
{
    struct hg_bench_cpu now = {0};
    struct processes all = {0};
    struct rusage usage;
    if (getrusage(RUSAGE_SELF, &usage) == 0)
        now.client_s = seconds_of(usage.ru_utime) + seconds_of(usage.ru_stime);
    if (!daemon)
        return now;
    read_all(&all);
    mark(&all, daemon);
    for (size_t i = 0; i < all.count; i++) {
        const struct process *p = &all.items[i];
        if (p->pid == daemon) {
            now.daemon_s = p->own_s;
            now.daemon_bytes = p->bytes;
            now.workers_s += p->ended_s;
        } else if (p->belongs) {
            now.workers_s += p->own_s + p->ended_s;
            now.workers_bytes += p->bytes;
        }
    }
    hg_free(all.items);
    return now;
}

json_t *hg_bench_cpu_report(
    const struct hg_bench_cpu *begin, const struct hg_bench_cpu *end, uint64_t frames, bool is_ours)
{
    const double to_ms = frames ? 1e3 / (double)frames : 0.0,
                 daemon_ms = (end->daemon_s - begin->daemon_s) * to_ms,
                 workers_ms = (end->workers_s - begin->workers_s) * to_ms,
                 client_ms = (end->client_s - begin->client_s) * to_ms;
    if (!is_ours)
        return json_pack("{s:n, s:n, s:f, s:n}", "daemon", "workers", "client", client_ms, "total");
    return json_pack("{s:f, s:f, s:f, s:f}", "daemon", daemon_ms, "workers", workers_ms, "client",
        client_ms, "total", daemon_ms + workers_ms + client_ms);
}
