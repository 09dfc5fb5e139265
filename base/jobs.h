// jobs.h - a bounded pool of threads for CPU work (decode, LOD build, filtering).
// Floor 0. hg_jobs_for may be called from any thread, also from inside a job (it helps itself).
#ifndef HG_BASE_JOBS_H
#define HG_BASE_JOBS_H

#include <stddef.h>

#include "base/status.h"

struct hg_jobs;

typedef void hg_jobs_fn(void *user, size_t index);

// Threads that the process may use for one task at a time; 0 = as many as there are cores. Set it
// before threads start.
void hg_jobs_set_limit(unsigned threads);
unsigned hg_jobs_limit(void); // as it was set
unsigned hg_jobs_cores(void); // the limit, else the cores; at least 1

// threads 0 = hg_jobs_cores. NULL: no memory, or a thread could not be started.
struct hg_jobs *hg_jobs_create(unsigned threads) HG_MUST_CHECK;
void hg_jobs_destroy(struct hg_jobs *jobs); // waits for running work
unsigned hg_jobs_threads(const struct hg_jobs *jobs);

// Calls fn(user, i) once for every i in [0, count), on all threads including the caller's;
// returns when all are done. Order is unspecified; results must not depend on it.
void hg_jobs_for(struct hg_jobs *jobs, size_t count, hg_jobs_fn *fn, void *user);

#endif
