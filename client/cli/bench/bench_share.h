// bench_share.h - how alike the shares of viewers are, and how well that is known.
// Floor 6 (client). Pure.
//
// A share is estimated from frames whose times scatter, so the ratio of the least to the most of
// several equal shares is below 1 by chance, the more so the fewer frames and the more viewers. The
// scatter is taken from the frames of equal parts of the window (batch means), with what all
// viewers have in common, such as the load of the machine, left out. Sources: Law and Kelton 2000,
// "Simulation Modeling and Analysis", section 9.5.3 (batch means); Cochran 1977, "Sampling
// Techniques", section 6.3 (error of a ratio); Blom 1958, "Statistical Estimates and Transformed
// Beta-Variables" (the most of several normal values).
#ifndef HG_CLIENT_CLI_BENCH_BENCH_SHARE_H
#define HG_CLIENT_CLI_BENCH_BENCH_SHARE_H

#include <stdint.h>

enum { HG_BENCH_SHARE_PARTS = 10 };

// When the frames of a viewer came, in rising order.
struct hg_bench_times {
    const uint64_t *ns;
    uint32_t count;
};

struct hg_bench_shares {
    double fairness; // frames of the viewer with least to those of the one with most; 0: no frames
    double error;    // standard error of that
    double equal;    // what shares that are equal and scatter as these do show on average
};

// Of `count` viewers from begin_ns to end_ns. One alone: 1, 0, 1.
void hg_bench_shares(const struct hg_bench_times *viewers, uint32_t count, uint64_t begin_ns,
    uint64_t end_ns, struct hg_bench_shares *out);

#endif
