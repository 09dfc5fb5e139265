#include "server/broker/worker_pool.h"

#include <stdio.h>
#include <string.h>
#include <sys/wait.h>

#include "base/alloc.h"
#include "base/log.h"

enum hg_status hg_worker_pool_init(struct hg_worker_pool *pool, const struct hg_link *like)
{
    const struct hg_options *o = like->options;
    bool is_shared = strcmp(o->isolation, "shared") == 0;
    uint32_t count = is_shared ? o->shared_workers : o->max_workers + 1; // and the spare
    *pool = (struct hg_worker_pool){
        .links = hg_calloc(count, sizeof *pool->links), .is_shared = is_shared};
    if (!pool->links)
        return HG_E_NOMEM;
    pool->count = count;
    for (uint32_t i = 0; i < count; i++) {
        pool->links[i] = *like;
        pool->links[i].whose.wanted = is_shared || i == 0;
        pool->links[i].source.fd = pool->links[i].transport.fd = -1;
    }
    return HG_OK;
}

void hg_worker_pool_start(struct hg_worker_pool *pool)
{
    for (uint32_t i = 0; i < pool->count; i++)
        if (pool->links[i].whose.wanted)
            hg_link_start(&pool->links[i]);
}

void hg_worker_pool_finish(struct hg_worker_pool *pool)
{
    for (uint32_t i = 0; i < pool->count; i++)
        hg_link_stop(&pool->links[i]);
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
    hg_info(WORKER, "worker %d of %s is stopped: %s", (int)link->pid, link->whose.tenant, reason);
    hg_link_end(link);
    link->whose.wanted = false;
    link->whose.tenant[0] = 0;
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

struct hg_link *hg_worker_pool_route(struct hg_worker_pool *pool, const char *tenant)
{
    if (pool->is_shared)
        return least_loaded(pool);
    struct hg_link *link = find(pool, tenant);
    if (link)
        return link;
    struct hg_link *spare = find(pool, ""), *idle = longest_idle(pool);
    if (!find_free(pool) && idle)
        release(idle, "another tenant needs its place");
    if (!find_free(pool) || !spare) // the last place is the spare's
        return NULL;
    snprintf(spare->whose.tenant, sizeof spare->whose.tenant, "%s", tenant);
    keep_spare(pool);
    return spare;
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

void hg_worker_pool_reap(struct hg_worker_pool *pool)
{
    int status;
    for (pid_t pid; (pid = waitpid(-1, &status, WNOHANG)) > 0;)
        for (uint32_t i = 0; i < pool->count; i++)
            if (pool->links[i].pid == pid)
                hg_link_exited(&pool->links[i], status);
}

void hg_worker_pool_check_times(struct hg_worker_pool *pool)
{
    for (uint32_t i = 0; i < pool->count; i++) {
        struct hg_link *link = &pool->links[i];
        if (!link->whose.wanted)
            continue;
        hg_link_check_time(link);
        check_idle(link);
        link->feed.pump |= link->trial.session != NULL; // its patience may be over
    }
    keep_spare(pool);
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
