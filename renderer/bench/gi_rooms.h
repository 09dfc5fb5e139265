// gi_rooms.h - two rooms beside each other: how much light comes through the wall between them, and
// how soon pictures in motion follow a change of light. Private to renderer/bench. Thread: one.
#ifndef HG_RENDERER_BENCH_GI_ROOMS_H
#define HG_RENDERER_BENCH_GI_ROOMS_H

#include "renderer/bench/bench.h"

#define HG_BENCH_LEAKS     2
#define HG_BENCH_RESPONSES 4

// Light of the dark room over that of the bright one, in the worst of 8 x 6 regions.
struct hg_bench_leak {
    float wall_m;
    double probes, rays;   // settled pictures
    double motion, newest; // of pictures in motion: the brightest, and the last
};

// How far the mean of a picture in motion is on its way from before a change to one with the
// settled field.
struct hg_bench_response {
    const char *name;
    uint32_t to_90, to_99;     // pictures until it stays within 10 %, 1 %; 0: later than measured
    double after_15, after_60; // share of the way, 1 = there
    double regions_60;         // what is left of the mean difference of regions
    double settled; // mean of the settled picture over that of one in motion with the same field
};

struct hg_bench_gi_rooms {
    struct hg_bench_leak leaks[HG_BENCH_LEAKS];
    struct hg_bench_response responses[HG_BENCH_RESPONSES];
};
// Errors of the renderer; HG_E_CANCELLED.
enum hg_status hg_bench_gi_rooms_run(struct hg_renderer *renderer,
    const struct hg_bench_settings *bench, struct hg_bench_gi_rooms *out,
    struct hg_error *err) HG_MUST_CHECK;

#endif
