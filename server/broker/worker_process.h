// worker_process.h - starts the worker's program: arguments, environment, descriptors.
// Floor 6 (broker). Thread: the loop.
#ifndef HG_BROKER_WORKER_PROCESS_H
#define HG_BROKER_WORKER_PROCESS_H

#include <sys/types.h>

#include "server/broker/options.h"
#include "server/broker/worker_home.h"

struct hg_worker_start {
    const struct hg_options *options;
    const struct hg_home *home; // NULL, or without homes: the daemon's cache folder
    int fd;                     // its end of the link; -1 = none
    uint64_t memory_bytes;      // the most that it may take; 0 = no limit
    bool no_spill, warm_up;
    bool seed; // compiles shaders into CACHE/seed and ends
};

// Path of the worker's program; false when there is none.
bool hg_worker_process_find(const struct hg_options *options, char *path, size_t size);
// The child gets the link as descriptor 3, nothing to read, our stderr and no other descriptor, no
// blocked signals, of the environment what drivers and the C library need, and the first place when
// memory is short. Returns 0, or an errno.
int hg_worker_process_start(const struct hg_worker_start *start, pid_t *pid);

#endif
