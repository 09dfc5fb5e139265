// loader_client.h - the worker's side of loaders: throwaway processes in which foreign parsers run.
// Floor 6. Thread-safe once started.
#ifndef HG_SERVER_LOADER_LOADER_CLIENT_H
#define HG_SERVER_LOADER_LOADER_CLIENT_H

#include "base/status.h"

enum {
    LOADER_CPU_S = 60,
    LOADER_MEMORY_MIB = 2048,
    LOADER_TIMEOUT_S = 90,
}; // unless an option says otherwise

struct loader_options {
    uint32_t cpu_s, memory_mib; // of one process; 0: the above
    double timeout_s;           // for one call
    const char *sandbox, *log;  // as the worker's options
};

// Sets the functions of base/isolate.h. Before the worker's sandbox, which allows no processes, and
// before its threads: forks the spawner, which becomes helio-loader when the first loader is asked
// for, so a worker that meets no foreign format pays for a fork. HG_E_WORKER: no process.
enum hg_status hg_loader_start(
    const struct loader_options *options, struct hg_error *err) HG_MUST_CHECK;

#endif
