// clock.h - time. Floor 0. Thread-safe.
#ifndef HG_BASE_CLOCK_H
#define HG_BASE_CLOCK_H

#include <stdint.h>

// Monotonic nanoseconds since an arbitrary start; never 0.
uint64_t hg_clock_now_ns(void);
// Nanoseconds since 1970-01-01 UTC.
uint64_t hg_clock_wall_ns(void);
// Nanoseconds of CPU time that all threads of this process have used.
uint64_t hg_clock_cpu_ns(void);
// Sleeps at least this long (signals do not shorten it).
void hg_clock_sleep_ns(uint64_t ns);

#endif
