// counters.h - what the daemon has counted since it started: one row of counters.def each.
// Floor 6 (broker). Thread: the loop. One process, one set: a metric is counted where it happens.
#ifndef HG_BROKER_COUNTERS_H
#define HG_BROKER_COUNTERS_H

#include <stdbool.h>
#include <stdint.h>

#include "base/status.h"

enum hg_counter {
#define HG_COUNTER(id, metric, labels, help) HG_COUNT_##id,
#include "server/broker/metrics/counters.def"
    HG_COUNTERS,
};

extern uint64_t hg_counters[HG_COUNTERS];

// How the configuration was read last.
struct hg_reload {
    bool is_refused;    // the newest SIGHUP; what was before goes on
    uint64_t success_s; // Unix time at which one was taken
};

extern struct hg_reload hg_reload;

static inline void hg_count(enum hg_counter counter)
{
    hg_counters[counter]++;
}

static inline void hg_count_add(enum hg_counter counter, uint64_t amount)
{
    hg_counters[counter] += amount;
}

// Requests that were answered with an error, by its status.
enum { HG_ERROR_STATUSES = 32 }; // all of base/status.def
extern uint64_t hg_errors[HG_ERROR_STATUSES];

static inline void hg_count_error(unsigned status)
{
    hg_errors[status < HG_ERROR_STATUSES ? status : HG_E_INTERNAL]++;
}

#endif
