// cgroup.h - a control group (cgroup v2) for each worker, where one is delegated to the daemon.
// Floor 6 (broker). Thread: the loop.
//
// The daemon goes into GROUP/daemon, since a group that shares out controllers has no processes of
// its own, and workers into GROUP/worker-N
// (Documentation/admin-guide/cgroup-v2.rst, "No Internal Process Constraint").
#ifndef HG_BROKER_CGROUP_H
#define HG_BROKER_CGROUP_H

#include <stdbool.h>
#include <stdint.h>
#include <sys/types.h>

#include "base/status.h"

enum { HG_CGROUP_PATH = 1024 };

struct hg_cgroup {
    char path[HG_CGROUP_PATH]; // "": there is none
};

struct hg_cgroup_share {
    uint32_t cpu_weight;   // 1 to 10000
    uint64_t memory_bytes; // 0 = no limit
    uint32_t processes;    // threads included
};

// `wanted`: a folder of the hierarchy; "auto": the daemon's own group if its user attributes say
// that it is delegated; "off": none. HG_E_PERM, HG_E_IO, HG_E_NOTFOUND: the folder that was named
// cannot be used.
enum hg_status hg_cgroup_open(
    struct hg_cgroup *group, const char *wanted, struct hg_error *err) HG_MUST_CHECK;
// Puts a process into the group of number `number`. False, with a line in the log: it stays where
// it is.
bool hg_cgroup_enter(const struct hg_cgroup *group, uint32_t number, pid_t pid);
void hg_cgroup_set(
    const struct hg_cgroup *group, uint32_t number, const struct hg_cgroup_share *share);
// Bytes that it uses; 0: not known.
uint64_t hg_cgroup_memory(const struct hg_cgroup *group, uint32_t number);
// Removes the group of a worker; one that still has a process stays, and is used again.
void hg_cgroup_remove(const struct hg_cgroup *group, uint32_t number);

#endif
