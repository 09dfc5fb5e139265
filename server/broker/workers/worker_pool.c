#include "server/broker/workers/worker_pool.h"

#include <signal.h>
#include <stdio.h>
#include <string.h>
#include <sys/wait.h>

#include "base/alloc.h"
#include "base/log.h"

static const uint64_t seed_delay_ns = 2000000000; // spares first
static const uint64_t count_interval_ns = 2000000000;

enum hg_status hg_worker_pool_init(struct hg_worker_pool *pool, const struct hg_link *like,
    struct hg_upload_store *store, const struct hg_machine *machine, uint32_t least)
{
    const struct hg_options *o = like->options;
    bool is_shared = strcmp(o->isolation, "shared") == 0;
    uint32_t count = is_shared ? o->shared_workers : o->max_workers + 1; // and the spare
    count = count < least ? least : count;
    *pool = (struct hg_worker_pool){.links = hg_calloc(count, sizeof *pool->links),
        .is_shared = is_shared,
        .heaviest = HG_TOKEN_WEIGHT};
    if (!pool->links)
        return HG_E_NOMEM;
    pool->count = count;
    pool->machine = machine;
    pool->homes = (struct hg_homes){.cache_dir = o->cache_dir, .store = store};
    for (uint32_t i = 0; i < count; i++) {
        pool->links[i] = *like;
        pool->links[i].whose.home =
            (struct hg_home){.homes = is_shared ? NULL : &pool->homes, .number = i};
        pool->links[i].whose.machine = machine;
        pool->links[i].whose.weight = HG_TOKEN_WEIGHT;
        pool->links[i].whose.wanted = is_shared ? i < o->shared_workers : i == 0;
        pool->links[i].source.fd = pool->links[i].transport.fd = -1;
    }
    return HG_OK;
}

// Twice what a worker that keeps its limits may have, and its compiled shaders.
static void start_watch(struct hg_worker_pool *pool)
{
    const struct hg_options *o = pool->links[0].options;
    const uint64_t share = pool->is_shared ? 0 : hg_worker_cache_share(o);
    const struct hg_disk_limits limits = {
        .named_bytes = share ? 2 * share + 2 * HG_WORKER_SHADER_BYTES : 0,
        .named_files = HG_WORKER_FILES,
        .rest_bytes = o->cache_limit_bytes / 2,
        .interval_ns = count_interval_ns};
    if (hg_disk_watch_start(o->cache_dir, pool->count, &limits, &pool->homes.watch))
        hg_warn(WORKER, "no memory to watch what workers have on the disk");
}

void hg_worker_pool_start(struct hg_worker_pool *pool)
{
    start_watch(pool);
    for (uint32_t i = 0; i < pool->count; i++)
        if (pool->links[i].whose.wanted && pool->links[i].state == HG_LINK_DOWN)
            hg_link_start(&pool->links[i]);
    if (!pool->is_shared && pool->links[0].options->seed_shaders)
        pool->seeder.due_ns = pool->links[0].loop->now_ns + seed_delay_ns;
}

void hg_worker_pool_finish(struct hg_worker_pool *pool)
{
    if (pool->seeder.pid)
        kill(pool->seeder.pid, SIGKILL);
    for (uint32_t i = 0; i < pool->count; i++) {
        hg_link_stop(&pool->links[i]);
        if (pool->machine)
            hg_cgroup_remove(&pool->machine->group, i);
        hg_home_leave(&pool->links[i].whose.home);
    }
    hg_disk_watch_stop(pool->homes.watch);
    hg_free(pool->links);
    *pool = (struct hg_worker_pool){0};
}

// ---- which worker -------------------------------------------------------------------------------

static bool is_better(const struct hg_link *a, const struct hg_link *b)
{
    bool a_up = a->state == HG_LINK_UP, b_up = b->state == HG_LINK_UP;
    return a_up != b_up ? a_up : a->whose.scene_count < b->whose.scene_count;
}

static struct hg_link *least_loaded(const struct hg_worker_pool *pool)
{
    struct hg_link *best = &pool->links[0];
    for (uint32_t i = 1; i < pool->count; i++)
        if (is_better(&pool->links[i], best))
            best = &pool->links[i];
    return best;
}

static struct hg_link *find(const struct hg_worker_pool *pool, const char *tenant)
{
    for (uint32_t i = 0; i < pool->count; i++)
        if (pool->links[i].whose.wanted && strcmp(pool->links[i].whose.tenant, tenant) == 0)
            return &pool->links[i];
    return NULL;
}

static struct hg_link *find_free(const struct hg_worker_pool *pool)
{
    for (uint32_t i = 0; i < pool->count; i++)
        if (!pool->links[i].whose.wanted)
            return &pool->links[i];
    return NULL;
}

static struct hg_link *longest_idle(const struct hg_worker_pool *pool)
{
    struct hg_link *oldest = NULL;
    for (uint32_t i = 0; i < pool->count; i++) {
        struct hg_link *it = &pool->links[i];
        if (it->whose.wanted && it->whose.tenant[0] && !it->whose.scene_count &&
            (!oldest || it->whose.idle_ns < oldest->whose.idle_ns))
            oldest = it;
    }
    return oldest;
}

static void release(struct hg_link *link, const char *reason)
{
    const pid_t pid = link->pid;
    hg_link_end(link);
    hg_home_leave(&link->whose.home);
    hg_info(WORKER, "worker %d of %s is stopped: %s", (int)pid, link->whose.tenant, reason);
    link->whose.wanted = false;
    link->whose.tenant[0] = 0;
    link->whose.weight = HG_TOKEN_WEIGHT;
    link->deaths = 0;
    link->restart_ns = 0;
}

static void want(struct hg_link *link)
{
    link->whose.wanted = true;
    link->whose.tenant[0] = 0;
    hg_link_start(link);
}

// The spare runs, as long as there is a place for it.
static void keep_spare(struct hg_worker_pool *pool)
{
    struct hg_link *place = pool->is_shared || find(pool, "") ? NULL : find_free(pool);
    if (place)
        want(place);
}

static void take(struct hg_link *spare, const char *tenant)
{
    struct hg_error err = {0};
    snprintf(spare->whose.tenant, sizeof spare->whose.tenant, "%s", tenant);
    if (hg_home_give(&spare->whose.home, tenant, &err))
        hg_warn(WORKER, "%s begins without what it had: %s: %s", tenant, err.what, err.reason);
}

void hg_worker_pool_take_homes(struct hg_worker_pool *pool)
{
    for (uint32_t i = 0; i < pool->count && !pool->is_shared; i++) {
        struct hg_link_owner *whose = &pool->links[i].whose;
        struct hg_error err = {0};
        if (whose->tenant[0] && hg_home_resume(&whose->home, whose->tenant, &err))
            hg_warn(WORKER, "%s goes on without its uploads: %s: %s", whose->tenant, err.what,
                err.reason);
    }
}

void hg_worker_pool_weigh(struct hg_worker_pool *pool, struct hg_link *link, uint32_t weight)
{
    if (!pool->is_shared)
        link->whose.weight = weight ? weight : HG_TOKEN_WEIGHT;
}

struct hg_link *hg_worker_pool_route(
    struct hg_worker_pool *pool, const char *tenant, uint32_t weight)
{
    if (pool->is_shared)
        return least_loaded(pool);
    struct hg_link *link = find(pool, tenant);
    if (link) {
        hg_worker_pool_weigh(pool, link, weight);
        return link;
    }
    struct hg_link *spare = find(pool, ""), *idle = longest_idle(pool);
    if (!find_free(pool) && idle)
        release(idle, "another tenant needs its place");
    if (!find_free(pool) || !spare) // the last place is the spare's
        return NULL;
    take(spare, tenant);
    hg_worker_pool_weigh(pool, spare, weight);
    keep_spare(pool);
    return spare;
}

// ---- compiled shaders ---------------------------------------------------------------------------

static void check_seeder(struct hg_worker_pool *pool)
{
    const struct hg_link *any = &pool->links[0];
    if (!pool->seeder.due_ns || any->loop->now_ns < pool->seeder.due_ns)
        return;
    pool->seeder.due_ns = 0;
    const struct hg_worker_start start = {.options = any->options, .fd = -1, .seed = true};
    int rc = hg_launcher_run(any->whose.launcher, &start, &pool->seeder.pid);
    if (rc)
        hg_warn(WORKER, "shaders are not compiled in advance: %s", strerror(rc));
}

// A spare that was there before has served no tenant: its place is for one that begins with all of
// them.
static void end_seeder(struct hg_worker_pool *pool, int status)
{
    struct hg_link *spare = find(pool, "");
    pool->seeder.pid = 0;
    if (!WIFEXITED(status) || WEXITSTATUS(status)) {
        hg_warn(WORKER, "shaders are not compiled in advance: the process ended with %d",
            WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status));
        return;
    }
    hg_info(WORKER, "shaders are compiled in advance");
    if (!spare)
        return;
    hg_link_end(spare);
    hg_home_leave(&spare->whose.home);
    want(spare);
}

// ---- time ---------------------------------------------------------------------------------------

static void check_idle(struct hg_link *link)
{
    uint64_t now_ns = link->loop->now_ns;
    if (!link->whose.tenant[0] || link->whose.scene_count)
        link->whose.idle_ns = now_ns;
    else if (now_ns - link->whose.idle_ns > link->options->worker_idle_ns)
        release(link, "its tenant has had no scene for worker-idle");
}

bool hg_worker_pool_reap(struct hg_worker_pool *pool, pid_t other, int *other_status)
{
    int status;
    bool found = false;
    for (pid_t pid; (pid = waitpid(-1, &status, WNOHANG)) > 0;) {
        const struct hg_link *any = &pool->links[0];
        if (pid == other) {
            *other_status = status;
            found = true;
        }
        if (pid == pool->seeder.pid)
            end_seeder(pool, status);
        if (any->whose.launcher && pid == any->whose.launcher->pid) {
            hg_fault(WORKER, HG_E_WORKER, "the process that starts workers has ended");
            any->whose.launcher->pid = 0;
            any->loop->stop = true; // a service manager starts all anew
        }
        for (uint32_t i = 0; i < pool->count; i++)
            if (pool->links[i].pid == pid || pool->links[i].farewell.pid == pid)
                hg_link_exited(&pool->links[i], pid, status);
    }
    return found;
}

// Shares follow who is there. A worker limits itself when it starts, so it must have started.
static void share_out(struct hg_worker_pool *pool)
{
    uint64_t sum = 0;
    for (uint32_t i = 0; i < pool->count; i++)
        if (pool->links[i].whose.tenant[0] || (pool->is_shared && pool->links[i].whose.wanted)) {
            const uint32_t weight = pool->links[i].whose.weight;
            sum += weight;
            pool->heaviest = weight > pool->heaviest ? weight : pool->heaviest;
        }
    for (uint32_t i = 0; i < pool->count; i++) {
        struct hg_link *link = &pool->links[i];
        const struct hg_link_owner *whose = &link->whose;
        if (link->state != HG_LINK_UP || !link->pid)
            continue;
        const bool counted = whose->tenant[0] || pool->is_shared;
        struct hg_worker_share share = hg_machine_share(
            pool->machine, link->options, whose->weight, sum - (counted ? whose->weight : 0));
        share.heaviest = pool->heaviest;
        if (share.weight == whose->share.weight && share.heaviest == whose->share.heaviest &&
            share.memory_bytes == whose->share.memory_bytes)
            continue;
        hg_worker_share_apply(pool->machine, link->options, whose->home.number, link->pid, &share);
        link->whose.share = share;
    }
}

// What a worker that does not keep its limits has written goes with it.
static void check_disk(struct hg_worker_pool *pool, uint32_t place)
{
    struct hg_link *link = &pool->links[place];
    struct hg_disk_watch *watch = pool->is_shared ? NULL : pool->homes.watch;
    if (!watch)
        return;
    hg_disk_watch_set(watch, place, link->pid, link->whose.tenant[0] != 0);
    switch (link->pid ? hg_disk_watch_fault(watch, place, link->pid) : HG_DISK_FINE) {
    case HG_DISK_FINE:
        return;
    case HG_DISK_NAMED:
        hg_link_fail(link, "its folder is far above what cache-limit allows it");
        hg_home_empty(&link->whose.home);
        return;
    case HG_DISK_UNNAMED: // that would be arrays of an honest one
        link->no_spill = true;
        hg_link_fail(link, "its files without a name are more than its part of the disk; large "
                           "arrays stay in memory from now on");
        return;
    case HG_DISK_HIDDEN:
        hg_link_fail(link, "it prevents that its open files are counted");
        return;
    }
}

void hg_worker_pool_check_times(struct hg_worker_pool *pool)
{
    for (uint32_t i = 0; i < pool->count; i++) {
        struct hg_link *link = &pool->links[i];
        if (!link->whose.wanted)
            continue;
        check_disk(pool, i);
        hg_link_check_time(link);
        check_idle(link);
        link->feed.pump |= link->trial.session != NULL; // its patience may be over
    }
    keep_spare(pool);
    if (pool->machine)
        share_out(pool);
    check_seeder(pool);
}

void hg_worker_pool_end_round(struct hg_worker_pool *pool, uint64_t now_ns)
{
    for (uint32_t i = 0; i < pool->count; i++) {
        struct hg_link *link = &pool->links[i];
        if (link->broken) {
            link->broken = false;
            hg_link_fail(link, "no memory to send to it");
        }
        if (link->whose.wanted && link->state == HG_LINK_DOWN && now_ns >= link->restart_ns)
            hg_link_check_time(link);
    }
}

bool hg_worker_pool_is_up(const struct hg_worker_pool *pool)
{
    for (uint32_t i = 0; i < pool->count; i++)
        if (pool->links[i].whose.wanted && pool->links[i].state != HG_LINK_UP)
            return false;
    return true;
}

uint64_t hg_worker_pool_deadline_ns(const struct hg_worker_pool *pool)
{
    uint64_t deadline_ns = UINT64_MAX;
    for (uint32_t i = 0; i < pool->count; i++)
        if (pool->links[i].whose.wanted && pool->links[i].state == HG_LINK_DOWN &&
            pool->links[i].restart_ns < deadline_ns)
            deadline_ns = pool->links[i].restart_ns;
    return deadline_ns;
}
