// call_filter.h - which system calls the daemon still has once it listens.
// Floor 6 (broker). Thread: before there are others, which inherit it.
#ifndef HG_BROKER_CALL_FILTER_H
#define HG_BROKER_CALL_FILTER_H

#include <stdbool.h>

// An allowlist; the rest is refused with EPERM, other architectures' calls end the process. A
// program that this one becomes keeps it, so what starts workers is allowed. After no_new_privs.
// False: the kernel has no such filters.
bool hg_call_filter_enter(void);

#endif
