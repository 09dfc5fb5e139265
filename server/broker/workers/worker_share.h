// worker_share.h - what of the machine's cores and memory a worker gets, by its tenant's weight.
// Floor 6 (broker). Thread: the loop.
//
// In a control group of its own: cpu.weight and memory.max. Else its private writable memory is
// limited (RLIMIT_DATA), and threads of tenants give way (nice) to those of the heaviest one.
#ifndef HG_BROKER_WORKER_SHARE_H
#define HG_BROKER_WORKER_SHARE_H

#include "server/broker/connection/auth.h"
#include "server/broker/workers/cgroup.h"
#include "server/broker/options.h"

// What is shared out.
struct hg_machine {
    struct hg_cgroup group;
    uint64_t memory_bytes; // of all workers; 0 = each has memory-limit
};

struct hg_worker_share {
    uint64_t memory_bytes; // 0 = no limit
    uint32_t weight;       // 1 to HG_TOKEN_WEIGHT_MAX
    uint32_t heaviest;     // that any worker has had since the daemon started
};

// HG_E_PERM, HG_E_NOTFOUND, HG_E_LIMIT: option cgroup.
enum hg_status hg_machine_init(struct hg_machine *machine, const struct hg_options *options,
    struct hg_error *err) HG_MUST_CHECK;
// The most that one worker may ever have; 0 = no limit.
uint64_t hg_machine_most_bytes(const struct hg_machine *machine, const struct hg_options *options);
// Of a worker beside others whose weights add up to `others`.
struct hg_worker_share hg_machine_share(const struct hg_machine *machine,
    const struct hg_options *options, uint32_t weight, uint64_t others);
// Puts it into effect. What the worker has already stays allowed, so that it is not ended by
// another one that comes.
void hg_worker_share_apply(const struct hg_machine *machine, const struct hg_options *options,
    uint32_t number, pid_t pid, const struct hg_worker_share *share);

#endif
