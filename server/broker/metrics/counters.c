#include "server/broker/metrics/counters.h"

uint64_t hg_counters[HG_COUNTERS];
struct hg_reload hg_reload;
