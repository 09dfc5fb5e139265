// worker_pool.h - the worker processes: which tenant has which, a spare, who is stopped.
// Floor 6 (broker). Thread: the loop.
//
// A scene and all its sessions live in one worker, for as long as there is the scene; what happens
// to another worker does not reach them. With isolation `tenant` a worker has scenes of one tenant
// only, and never of another one afterwards: it is stopped when its tenant has had no scene for
// worker-idle, and a spare that has served no tenant yet is kept running for the next tenant. With
// `shared` there are shared-workers of them for everybody. The policy is one place:
// hg_worker_pool_route. Each worker of a tenant has folders of its own (worker_home.h). A process
// that reads no tenant's files compiles shaders in advance, which all homes begin with.
#ifndef HG_BROKER_WORKER_POOL_H
#define HG_BROKER_WORKER_POOL_H

#include "server/broker/workers/worker_link.h"

struct hg_worker_pool {
    struct hg_link *links; // [count]; those that are not `wanted` have no process
    uint32_t count;
    bool is_shared;
    uint32_t heaviest; // weight of any worker so far: what gives way cannot take it back
    struct hg_homes homes;
    const struct hg_machine *machine; // shared out among the workers; NULL: no limits
    struct hg_pool_seeder {
        pid_t pid;       // 0 = does not run
        uint64_t due_ns; // when it starts; 0 = has been started, or is not wanted
    } seeder;
};

// `like` has the loop, options and events of every link; `least`: there are at least so many.
// HG_E_NOMEM. No process is started.
enum hg_status hg_worker_pool_init(struct hg_worker_pool *pool, const struct hg_link *like,
    struct hg_upload_store *store, const struct hg_machine *machine, uint32_t least) HG_MUST_CHECK;
// Workers that were taken over are in their homes.
void hg_worker_pool_take_homes(struct hg_worker_pool *pool);
void hg_worker_pool_start(struct hg_worker_pool *pool);
void hg_worker_pool_finish(struct hg_worker_pool *pool); // accepts a zeroed one

// The worker for a new scene of a tenant. Shared: of those that run (of all, if none does) the one
// with fewest scenes. Else the tenant's, or the spare, which is its from now on; where max-workers
// have tenants, the one that has been without a scene for longest is stopped for it. NULL: all of
// them have scenes. `weight` is the tenant's from now on, 0 the usual one.
struct hg_link *hg_worker_pool_route(
    struct hg_worker_pool *pool, const char *tenant, uint32_t weight);
// A session of the worker's tenant has come: its weight is the tenant's from now on.
void hg_worker_pool_weigh(struct hg_worker_pool *pool, struct hg_link *link, uint32_t weight);

// SIGCHLD. True: the process `other` (0 = none) has ended, with *status.
bool hg_worker_pool_reap(struct hg_worker_pool *pool, pid_t other, int *status);
void hg_worker_pool_check_times(struct hg_worker_pool *pool); // once in a while
// At the end of an event loop round: replaces failed workers, restarts those that are due.
void hg_worker_pool_end_round(struct hg_worker_pool *pool, uint64_t now_ns);
bool hg_worker_pool_is_up(const struct hg_worker_pool *pool); // all that are wanted
// When the next worker is to be started; UINT64_MAX = none waits.
uint64_t hg_worker_pool_deadline_ns(const struct hg_worker_pool *pool);

#endif
