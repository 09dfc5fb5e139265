// disk_watch.h - what workers have on the disk: counted, and removed when they are done with it, by
// a thread of its own. Floor 6 (broker). Thread: the loop; but for the calls nothing of it waits.
//
// A worker keeps its limits itself, as long as it is what it was started as. One that was taken
// over writes what it likes, in files that have names below its home and in such that have none
// (worker_home.h): it is found here.
//
//   files with names   bytes and number of them are limited
//   files without      workers that have a tenant share three quarters of what the disk has room
//                      for; what one has already it keeps
#ifndef HG_BROKER_DISK_WATCH_H
#define HG_BROKER_DISK_WATCH_H

#include <stdbool.h>
#include <stdint.h>
#include <sys/types.h>

#include "base/status.h"

struct hg_disk_watch;

struct hg_disk_limits {
    uint64_t named_bytes, named_files; // of one worker; 0 bytes = no limits
    uint64_t unnamed_bytes; // of all workers together; 0 = three quarters of the disk's room
    uint64_t rest_bytes;    // of tenants without a worker, together; 0 = no limit
    uint64_t interval_ns;   // from one count to the next; more where counting takes long
};

enum hg_disk_fault {
    HG_DISK_FINE,
    HG_DISK_NAMED,   // too much in its folder
    HG_DISK_UNNAMED, // too much in files without a name
    HG_DISK_HIDDEN,  // it prevents its open files from being counted
};

// `cache_dir` of the daemon, `places` of workers. HG_E_NOMEM: no memory, or no thread.
enum hg_status hg_disk_watch_start(const char *cache_dir, uint32_t places,
    const struct hg_disk_limits *limits, struct hg_disk_watch **out) HG_MUST_CHECK;
// Removes what is left to remove, and ends the thread. Accepts NULL.
void hg_disk_watch_stop(struct hg_disk_watch *watch);

// The process in a place, 0 = none, and whether it works for a tenant.
void hg_disk_watch_set(struct hg_disk_watch *watch, uint32_t place, pid_t pid, bool has_tenant);
// What the newest count of that process came to.
enum hg_disk_fault hg_disk_watch_fault(struct hg_disk_watch *watch, uint32_t place, pid_t pid);

// Gives a folder below CACHE another name at once, and lets the thread remove it (without one: the
// next run). What is not there is fine. False: it could not be renamed.
bool hg_disk_discard(struct hg_disk_watch *watch, const char *cache_dir, const char *folder);

#endif
