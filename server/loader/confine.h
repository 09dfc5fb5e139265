// confine.h - what a loader gives up before it reads its file: everything but its processor time,
// its memory and the descriptors it was given.
// Floor 6, private to server/loader. Before there are threads.
#ifndef HG_SERVER_LOADER_CONFINE_H
#define HG_SERVER_LOADER_CONFINE_H

#include <stdbool.h>
#include <stdint.h>

struct confinement {
    uint64_t memory_bytes;
    uint32_t cpu_s;
    bool required, off; // without what the kernel lacks; without anything but the limits
};

// Of the spawner, and so of all its loaders: no file can be opened by path, no new privileges.
// False: required, and not to be had.
bool hg_confine_spawner(const struct confinement *c);
// Of one loader: the limits, and no system calls but those on memory and open descriptors. False:
// required, and not to be had, or what must fail does not.
bool hg_confine_loader(const struct confinement *c);

#endif
