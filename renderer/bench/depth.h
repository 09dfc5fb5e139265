// depth.h - how far what each pixel of two pictures shows is from the eye, side by side.
// Private to renderer/bench (tests look in too). Thread: the render thread.
#ifndef HG_RENDERER_BENCH_DEPTH_H
#define HG_RENDERER_BENCH_DEPTH_H

#include "renderer/bench/common.h"

struct hg_bench_depth {
    float *metres; // [width * height] along the view axis; INFINITY: nothing there
    uint32_t width, height;
    float px_per_radian;
};

// Of the newest sample of a perspective view. HG_E_NOMEM, device errors.
enum hg_status hg_bench_depth_read(
    struct hg_view *view, struct hg_bench_depth *out, struct hg_error *err) HG_MUST_CHECK;
void hg_bench_depth_finish(struct hg_bench_depth *depth); // accepts a zeroed one
// Pixels of either picture where the other has nothing like it: the depth is outside of what the
// other has within two pixels (an error of one and the rounding to pixels) by more than error_px
// pixels at that distance. So surfaces are as near as they should be and silhouettes are within two
// pixels. Some are left even of equal surfaces that moved by less: what a slit or a grazing edge
// lets through may lie a little deeper. What a crack lets through lies far behind.
struct hg_bench_depth_gap {
    uint64_t shown_px;       // where either has something
    uint64_t off_px, far_px; // far: off by more than a fiftieth of the distance
};
// Both are of one size and camera.
struct hg_bench_depth_gap hg_bench_depth_compare(
    const struct hg_bench_depth *a, const struct hg_bench_depth *b, float error_px);

#endif
