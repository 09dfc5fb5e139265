// latency.h - how long inputs take to their frames, by stage: histograms of /metrics.
// Floor 6 (broker). Thread: the loop. One process, one set.
#ifndef HG_BROKER_LATENCY_H
#define HG_BROKER_LATENCY_H

#include <stdint.h>

#include "protocol/hgp.h"

enum {
    HG_LATENCY_STAGES = 7,  // latency.c names them; the last one is all of them together
    HG_LATENCY_BUCKETS = 12 // upper bounds of latency.c, and one without
};

struct hg_latency {
    uint64_t counts[HG_LATENCY_BUCKETS]; // of those up to the bound and above the one before
    uint64_t count, sum_ns;
};

extern struct hg_latency hg_latencies[HG_LATENCY_STAGES];
extern const char *const hg_latency_stage_names[HG_LATENCY_STAGES];
extern const double hg_latency_bounds_s[HG_LATENCY_BUCKETS - 1];

// The first frame that shows an input, as it is put behind what its client is to be sent. Frames
// without the times of their way, and times that run backwards, count nothing.
void hg_latency_note(const struct hgp_frame *frame, uint64_t sent_ns);

#endif
