// launcher.h - the process that starts workers. Floor 6 (broker). Thread: the loop.
//
// It is forked before the daemon accepts clients, reads nothing of theirs, and takes requests from
// the daemon: which place, which limits. So the daemon itself needs neither the right to start
// programs nor to make namespaces, and forking costs the same however much memory the daemon has.
// Workers become children of the daemon (which is a subreaper, prctl(2)): a process between them
// and the launcher ends at once.
//
// A program that takes over (takeover.h) keeps it: the process that was forked first has what the
// daemon has given up since. It becomes the new program as well, with the options of now.
#ifndef HG_BROKER_LAUNCHER_H
#define HG_BROKER_LAUNCHER_H

#include "server/broker/workers/cgroup.h"
#include "server/broker/workers/worker_process.h"

struct hg_launcher {
    int fd; // -1 = none
    pid_t pid;
    uint32_t last_serial; // of the newest request
    const struct hg_cgroup *group;
};

// Before the daemon has threads and handles signals. `argv` starts this program; workers are put
// into groups below `group`, which outlives the launcher, before their programs start. HG_E_LIMIT.
enum hg_status hg_launcher_start(struct hg_launcher *launcher, const struct hg_options *options,
    char *const *argv, const struct hg_cgroup *group, struct hg_error *err) HG_MUST_CHECK;
// In every process of the program: does not return in one that a launcher has become.
void hg_launcher_continue(const struct hg_options *options, char *const *argv);
void hg_launcher_keep_open(const struct hg_launcher *launcher); // over exec
// That of the program before, whose members are those of `launcher`. False: it is gone, none is
// there.
bool hg_launcher_adopt(struct hg_launcher *launcher, const struct hg_cgroup *group) HG_MUST_CHECK;
void hg_launcher_stop(struct hg_launcher *launcher); // accepts a zeroed one, with fd -1
// Starts a worker. Returns 0, or an errno. Says once in the log what the kernel did not allow.
int hg_launcher_run(struct hg_launcher *launcher, const struct hg_worker_start *start, pid_t *pid);

#endif
