// launcher.h - the process that starts workers. Floor 6 (broker). Thread: the loop.
//
// It is forked before the daemon accepts clients, reads nothing of theirs, and takes requests from
// the daemon: which place, which limits. So the daemon itself needs neither the right to start
// programs nor to make namespaces, and forking costs the same however much memory the daemon has.
// Workers become children of the daemon (which is a subreaper, prctl(2)): a process between them
// and the launcher ends at once.
#ifndef HG_BROKER_LAUNCHER_H
#define HG_BROKER_LAUNCHER_H

#include "server/broker/cgroup.h"
#include "server/broker/worker_process.h"

struct hg_launcher {
    int fd; // -1 = none
    pid_t pid;
    uint32_t last_serial; // of the newest request
};

// Before the daemon has threads and handles signals. Workers are put into groups below `group`
// before their programs start; it is copied. HG_E_LIMIT.
enum hg_status hg_launcher_start(struct hg_launcher *launcher, const struct hg_options *options,
    const struct hg_cgroup *group, struct hg_error *err) HG_MUST_CHECK;
void hg_launcher_stop(struct hg_launcher *launcher); // accepts a zeroed one, with fd -1
// Starts a worker. Returns 0, or an errno. Says once in the log what the kernel did not allow.
int hg_launcher_run(struct hg_launcher *launcher, const struct hg_worker_start *start, pid_t *pid);

#endif
