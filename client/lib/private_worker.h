// private_worker.h - a worker process of one connection, started and reaped by the library.
// Floor 6 (client). One thread at a time.
#ifndef HG_CLIENT_LIB_PRIVATE_WORKER_H
#define HG_CLIENT_LIB_PRIVATE_WORKER_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <sys/types.h>

#include "base/status.h"

// Starts the worker's program (`given`, else $HELIO_WORKER, else ../libexec/helio-worker beside
// this one) with `args` (NULL-terminated; may be NULL). *fd is our end of the link. HG_E_WORKER,
// HG_E_NOMEM, HG_E_LIMIT.
enum hg_status hg_client_worker_start(const char *given, const char *const *args, pid_t *pid,
    int *fd, struct hg_error *err) HG_MUST_CHECK;
// Waits up to `wait_ns` for the end of *pid and reaps it: *pid is 0 then, and `text` says how it
// ended
// ("was killed by signal 9"). False: it still runs, or there is none.
bool hg_client_worker_reap(pid_t *pid, uint64_t wait_ns, char *text, size_t size);
// The same, but a worker that does not end is killed.
void hg_client_worker_stop(pid_t *pid, uint64_t wait_ns);

#endif
