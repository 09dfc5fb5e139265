#include "server/broker/metrics/counters.h"

uint64_t hg_counters[HG_COUNTERS];
uint64_t hg_errors[HG_ERROR_STATUSES];
struct hg_reload hg_reload;
