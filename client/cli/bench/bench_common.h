// bench_common.h - what the benchmarks of the client share: a daemon of their own, percentiles.
// Floor 6 (client).
#ifndef HG_CLIENT_CLI_BENCH_BENCH_COMMON_H
#define HG_CLIENT_CLI_BENCH_BENCH_COMMON_H

#include <sys/types.h>

#include "client/cli/cli.h"

struct hg_bench_daemon {
    char folder[64], url[128]; // of its socket; removed at the end
    char program[4096];
    pid_t pid;       // 0: none runs
    pid_t guard_pid; // ends the daemon when this process has ended in whatever way; 0: none
    int guard_fd;    // what it waits for
};

// How long a benchmark waits for one thing (a picture that settles, an answer): --timeout, or ten
// minutes.
uint64_t hg_bench_wait_ns(const struct hg_cli *cli);

// A scene of a daemon of our own: "demo:", or a file, whose folder the daemon is to read.
struct hg_bench_scene {
    char path[4096], folder[4096]; // folder: "" of what is no file
};
// HG_E_NOT_FOUND: there is no such file.
enum hg_status hg_bench_scene_find(
    struct hg_bench_scene *scene, const char *name, struct hg_error *err) HG_MUST_CHECK;

// Starts heliod on a unix socket in a temporary folder and waits until it takes sessions. It writes
// nothing to our standard output, and ends with this process.
// `tokens`: of its token file; NULL: it trusts its own user. `cache_dir`: of its caches, which stay
// for the next one; NULL: an empty folder, removed at the end. `more`: further options, ended by
// NULL. On failure hg_bench_daemon_stop is still to be called.
enum hg_status hg_bench_daemon_start(struct hg_bench_daemon *d, const char *tokens,
    const char *token, const char *cache_dir, const char *const *more,
    struct hg_error *err) HG_MUST_CHECK;
void hg_bench_daemon_stop(struct hg_bench_daemon *d); // accepts a zeroed one

// Milliseconds {p50, p95, p99, max, count} of times in ns, which are sorted. NULL: no memory.
json_t *hg_bench_percentiles(int64_t *ns, uint32_t count);

#endif
