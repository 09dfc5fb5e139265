// bench_cpu.h - processor time and memory of a benchmark's processes: daemon, its workers, the
// benchmark. Floor 6 (client).
#ifndef HG_CLIENT_CLI_BENCH_BENCH_CPU_H
#define HG_CLIENT_CLI_BENCH_BENCH_CPU_H

#include <jansson.h>
#include <stdbool.h>
#include <stdint.h>
#include <sys/types.h>

struct hg_bench_cpu {
    double daemon_s, workers_s, client_s; // since each began
    uint64_t daemon_bytes, workers_bytes; // resident memory
};

// Now; `daemon`: its process, or 0 for one that is not ours, whose times are 0 then. Workers are
// all processes below the daemon, with those that have ended and were waited for. Resolution: a
// clock tick (10 ms). Source: proc(5), /proc/PID/stat.
struct hg_bench_cpu hg_bench_cpu_now(pid_t daemon);

// Milliseconds a frame {daemon, workers, client, total} from `begin` to `end`; all but the client's
// are null where the daemon is not ours. NULL: no memory.
json_t *hg_bench_cpu_report(const struct hg_bench_cpu *begin, const struct hg_bench_cpu *end,
    uint64_t frames, bool is_ours);

#endif
