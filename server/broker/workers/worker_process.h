// worker_process.h - what the worker's program is started with: arguments, environment.
// Floor 6 (broker).
#ifndef HG_BROKER_WORKER_PROCESS_H
#define HG_BROKER_WORKER_PROCESS_H

#include <sys/types.h>

#include "server/broker/options.h"
#include "server/broker/workers/worker_home.h"

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

enum { HG_WORKER_ARGUMENTS = 1024, HG_WORKER_FILES = 1000000 };
#define HG_WORKER_SHADER_BYTES (UINT64_C(256) << 20) // Mesa's cache of one worker

// All asset roots are folders: else no worker would start. HG_E_NOTFOUND, HG_E_PERM, HG_E_IO.
enum hg_status hg_worker_process_check_roots(
    const struct hg_options *options, struct hg_error *err) HG_MUST_CHECK;
// What a tenant's baked data may take: those that have workers share half of it, the rest is for
// those that have none. 0 = no limit.
uint64_t hg_worker_cache_share(const struct hg_options *options);

// What its program is started with.
struct hg_worker_arguments {
    char *items[HG_WORKER_ARGUMENTS], *variables[HG_WORKER_ARGUMENTS];
    char text[16][32]; // numbers in words
    int count, texts;
    char program[HG_HOME_PATH], cache_dir[HG_HOME_PATH], upload_dir[HG_HOME_PATH];
    char seed[HG_HOME_PATH];
};

// Of the environment it gets what drivers and the C library need. Borrows the strings of `start`.
// Returns 0, or an errno.
int hg_worker_arguments_make(
    struct hg_worker_arguments *arguments, const struct hg_worker_start *start);
// Called in the new process.
void hg_worker_process_make_first_victim(void);

#endif
