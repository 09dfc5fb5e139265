// spill.h - large arrays in pages of unlinked files: while no thread looks at them the kernel keeps
// them on disk, and they take no memory of their own.
// Floor 0. Thread-safe. Results are freed with hg_free and grow with hg_realloc like all others.
//
// A file's blocks are reserved before it is mapped, so a disk that is full is found then and not by
// a signal, and it has no name, so that nothing is left of it whenever the process ends. What
// cannot have a file is in memory as usual.
//
// Code that reads large ranges of such arrays does so between hg_spill_begin and hg_spill_end.
// Until the last end about HG_SPILL_WINDOW_BYTES of all of them are resident at a time, whatever
// the order of the accesses, and nothing after it. Without the two all is right as well; only pages
// stay.
//
// A disk may fail when a page is read back. Nothing can go on then with what it held: the kernel
// sends SIGBUS, and the function of hg_spill_watch gets what was lost.
#ifndef HG_BASE_SPILL_H
#define HG_BASE_SPILL_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "base/status.h"

#define HG_SPILL_FROM_BYTES    ((size_t)256 << 10) // smaller arrays are in memory
#define HG_SPILL_SCRATCH_BYTES ((size_t)4 << 20)   // the same for scratch
#define HG_SPILL_WINDOW_BYTES  ((size_t)128 << 20)
#define HG_SPILL_SPARE_BYTES   ((uint64_t)64 << 20) // of the disk, left for others

// The folder of this process's files, from now on; made when it is missing. NULL: no files. A file
// system that is itself memory does not do.
void hg_spill_set_folder(const char *dir);

// As hg_calloc.
void *hg_spill_calloc(size_t count, size_t size) HG_MUST_CHECK;
// As hg_spill_calloc, for short-lived scratch: spilled from HG_SPILL_SCRATCH_BYTES on.
void *hg_spill_scratch(size_t count, size_t size) HG_MUST_CHECK;
// Bytes of the file of an array; 0: it is in memory, or NULL.
size_t hg_spill_size(const void *ptr);
// Adds a reference: one more hg_free; read-only from now on. False: it is in memory, or NULL.
bool hg_spill_share(void *ptr) HG_MUST_CHECK;

// Nests, in any threads. Arrays that this thread makes until the last end are called `what` of the
// first begin (copied; NULL: nothing), for messages.
void hg_spill_begin(const char *what);
void hg_spill_end(void);

struct hg_spill_loss {
    const char *folder, *what; // what "": not known
    uint64_t offset, bytes;    // the page's place, the array's size
};
// Called in the handler of SIGBUS, on the thread that read the page, once per process: does only
// what handlers may, and does not return. Other threads that read lost pages wait for ever.
typedef void hg_spill_lost_fn(void *user, const struct hg_spill_loss *loss);
// Sets that function for the whole process. SIGBUS of other memory does what it did before.
void hg_spill_watch(hg_spill_lost_fn *fn, void *user);

struct hg_spill_stats {
    uint64_t bytes, peak_bytes; // of the files
    uint64_t refused_bytes;     // since the start: in memory for want of a file
    uint32_t arrays;
};
void hg_spill_stats(struct hg_spill_stats *out);

#endif
