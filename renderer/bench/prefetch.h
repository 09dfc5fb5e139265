// prefetch.h - what looking ahead of a moving camera brings (frame/streaming/prefetch.h): flights
// with and without it, turn by turn, each in a renderer that has no pages yet. Private to
// renderer/bench.
//
// A flight is a walk along the corridor, turning to either wall, with a frame each
// 1 / HG_BENCH_PREFETCH_FPS s (or as fast as they come), as an interactive client asks for them.
// After it the camera jumps to and fro and waits each time until nothing is missing.
#ifndef HG_RENDERER_BENCH_PREFETCH_H
#define HG_RENDERER_BENCH_PREFETCH_H

#include "renderer/bench/common.h"
#include "renderer/bench/scene.h"

#define HG_BENCH_PREFETCH_ROUNDS 3
#define HG_BENCH_PREFETCH_FPS    20

struct hg_bench_prefetch_side {
    struct hg_bench_times frames; // drawing each frame
    struct hg_bench_times sharp;  // jumps: until nothing is missing
    uint64_t frames_missing, pages_missing;
    double missing_ms; // shown with something missing, sum over all flights
    uint64_t pages_loaded;
};

struct hg_bench_prefetch_result {
    struct hg_bench_prefetch_side off, on;
};

struct hg_bench_prefetch {
    const struct hg_renderer_params *renderer; // with the texture budget
    const struct hg_bench_stream *stream;      // width, height; frames of a flight
    const struct hg_bench_gallery *gallery;
    struct hg_scene *scene; // the gallery's
    float vfov_rad;
};

enum hg_status hg_bench_prefetch_run(const struct hg_bench_prefetch *bench,
    struct hg_bench_prefetch_result *out, struct hg_error *err) HG_MUST_CHECK;
void hg_bench_prefetch_finish(struct hg_bench_prefetch_result *result); // accepts a zeroed one
// "prefetch":{...}
void hg_bench_prefetch_put(struct hg_writer *w, const struct hg_bench_prefetch_result *result);

#endif
