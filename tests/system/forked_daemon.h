// forked_daemon.h - a heliod in a child of the test program: with faults.
// Test code.
#ifndef HG_TESTS_SYSTEM_FORKED_DAEMON_H
#define HG_TESTS_SYSTEM_FORKED_DAEMON_H

#include "tests/system/daemon.h"

struct forked_daemon_options {
    uint64_t fail_at; // this allocation fails; 0 = none
    int count_fd;     // gets the number of allocations (uint64_t) when the daemon ends; 0 = none
};

// Begins the daemon of `d`, which has its options. Sets d->pid; daemon_finish ends it.
void forked_daemon_begin(struct daemon *d, const struct forked_daemon_options *options);
// Waits until it listens. False: it ended instead, and has not been reaped.
bool forked_daemon_listens(struct daemon *d);

#endif
