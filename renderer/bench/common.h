// common.h - what the benchmarks share: times, poses, drawing to a goal. Private to renderer/bench.
#ifndef HG_RENDERER_BENCH_COMMON_H
#define HG_RENDERER_BENCH_COMMON_H

#include "base/bytes.h"
#include "renderer/bench/bench.h"

// A list of measured times. Zeroed = empty; hg_bench_times_finish frees it.
struct hg_bench_times {
    float *ms;
    size_t capacity;
    uint32_t count;
};

enum hg_status hg_bench_times_add(struct hg_bench_times *times, uint64_t ns) HG_MUST_CHECK;
// Nearest rank of fraction 0..1; 0.5 is the median (mean of the middle two). 0 when empty.
double hg_bench_times_at(const struct hg_bench_times *times, double fraction);
void hg_bench_times_finish(struct hg_bench_times *times);
// "key":{"p50":..,"p95":..,"max":..,"count":..}
void hg_bench_put_times(struct hg_writer *w, const char *key, const struct hg_bench_times *times);

// A view of a scene that is measured.
struct hg_bench_view {
    struct hg_view *view;
    float vfov_rad;
    struct hg_frame_info info; // of the newest step
};

// A new view; samples as of the settled picture.
enum hg_status hg_bench_view_init(struct hg_bench_view *view, struct hg_renderer *renderer,
    struct hg_scene *scene, const struct hg_view_params *params,
    struct hg_error *err) HG_MUST_CHECK;
void hg_bench_view_finish(struct hg_bench_view *view); // accepts a zeroed one
// Looks at a pose, draws one sample and reads it back as RGBA8. *ns: how long that took.
enum hg_status hg_bench_view_draw(struct hg_bench_view *view, const struct hg_bench_pose *pose,
    uint64_t *ns, struct hg_error *err) HG_MUST_CHECK;
// Looks at a pose and draws until nothing is missing. *ns: until the first such picture is there.
// HG_E_TIMEOUT after ten minutes.
enum hg_status hg_bench_view_sharpen(struct hg_bench_view *view, const struct hg_bench_pose *pose,
    uint64_t *ns, struct hg_error *err) HG_MUST_CHECK;
// Looks at a pose and reads the settled picture; freed with hg_image_finish.
enum hg_status hg_bench_view_settle(struct hg_bench_view *view, const struct hg_bench_pose *pose,
    struct hg_image *out, struct hg_error *err) HG_MUST_CHECK;

// Reports the progress of a run; HG_E_CANCELLED when it was cancelled.
enum hg_status hg_bench_report_progress(const struct hg_bench_stream *stream, uint32_t done,
    uint32_t total, struct hg_error *err) HG_MUST_CHECK;
// An option: 0 means the default.
static inline uint32_t hg_bench_or(uint32_t value, uint32_t otherwise)
{
    return value > 0 ? value : otherwise;
}

#endif
