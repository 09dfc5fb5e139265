#include "server/broker/worker_pool.h"

#include <sys/wait.h>

#include "base/alloc.h"

enum hg_status hg_worker_pool_init(
    struct hg_worker_pool *pool, uint32_t count, const struct hg_link *like)
{
    *pool = (struct hg_worker_pool){.links = hg_calloc(count, sizeof *pool->links)};
    if (!pool->links)
        return HG_E_NOMEM;
    pool->count = count;
    for (uint32_t i = 0; i < count; i++) {
        pool->links[i] = *like;
        pool->links[i].source.fd = pool->links[i].transport.fd = -1;
    }
    return HG_OK;
}

void hg_worker_pool_start(struct hg_worker_pool *pool)
{
    for (uint32_t i = 0; i < pool->count; i++)
        hg_link_start(&pool->links[i]);
}

void hg_worker_pool_finish(struct hg_worker_pool *pool)
{
    for (uint32_t i = 0; i < pool->count; i++)
        hg_link_stop(&pool->links[i]);
    hg_free(pool->links);
    *pool = (struct hg_worker_pool){0};
}

static bool is_better(const struct hg_link *a, const struct hg_link *b)
{
    bool a_up = a->state == HG_LINK_UP, b_up = b->state == HG_LINK_UP;
    return a_up != b_up ? a_up : a->scene_count < b->scene_count;
}

struct hg_link *hg_worker_pool_route(const struct hg_worker_pool *pool)
{
    struct hg_link *best = &pool->links[0];
    for (uint32_t i = 1; i < pool->count; i++)
        if (is_better(&pool->links[i], best))
            best = &pool->links[i];
    return best;
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
        hg_link_check_time(link);
        link->pump |= link->suspect.session != NULL; // its patience may be over
    }
}

void hg_worker_pool_end_round(struct hg_worker_pool *pool, uint64_t now_ns)
{
    for (uint32_t i = 0; i < pool->count; i++) {
        struct hg_link *link = &pool->links[i];
        if (link->broken) {
            link->broken = false;
            hg_link_fail(link, "no memory to send to it");
        }
        if (link->state == HG_LINK_DOWN && now_ns >= link->restart_ns)
            hg_link_check_time(link);
    }
}

bool hg_worker_pool_is_up(const struct hg_worker_pool *pool)
{
    for (uint32_t i = 0; i < pool->count; i++)
        if (pool->links[i].state != HG_LINK_UP)
            return false;
    return true;
}

uint64_t hg_worker_pool_deadline_ns(const struct hg_worker_pool *pool)
{
    uint64_t deadline_ns = UINT64_MAX;
    for (uint32_t i = 0; i < pool->count; i++)
        if (pool->links[i].state == HG_LINK_DOWN && pool->links[i].restart_ns < deadline_ns)
            deadline_ns = pool->links[i].restart_ns;
    return deadline_ns;
}
