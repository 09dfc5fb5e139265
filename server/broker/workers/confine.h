// confine.h - what a worker's process is before its program starts: namespaces of its own, a file
// system that has what it may read and write and nothing else, no capabilities.
// Floor 6 (broker). Called in the new process.
#ifndef HG_BROKER_CONFINE_H
#define HG_BROKER_CONFINE_H

#include <stdbool.h>
#include <sys/types.h>

enum hg_confine_level { // each with all of those before it
    HG_CONFINE_NONE,    // no capabilities and no new privileges
    HG_CONFINE_FILES,   // namespaces for users, mounts, network, IPC and host name
    HG_CONFINE_ALL,     // and for processes
    HG_CONFINE_LEVELS
};

enum hg_confine_access { HG_CONFINE_READ, HG_CONFINE_WRITE, HG_CONFINE_DEVICE };

struct hg_confine_path {
    const char *path; // absolute; what does not exist is left out
    enum hg_confine_access access;
};

// Flags of clone(2).
int hg_confine_clone_flags(enum hg_confine_level level);
// Makes the file system of `paths` (and of what programs need: libraries, settings of drivers,
// devices) the only one, and gives up all privileges. Later paths cover earlier ones. `uid` and
// `gid`: as before the process was made. Returns 0, or an errno, and in *step what failed.
int hg_confine_enter(enum hg_confine_level level, const struct hg_confine_path *paths, size_t count,
    uid_t uid, gid_t gid, const char **step);
// No capability is left, nor can one be had by starting a program. Returns 0 or an errno.
int hg_confine_drop_capabilities(void);

#endif
