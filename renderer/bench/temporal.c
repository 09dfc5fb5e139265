// temporal.c - pictures in motion against settled ones (helio bench temporal).
#include "base/alloc.h"
#include "base/clock.h"
#include "base/json.h"
#include "renderer/bench/walk.h"

#define DEFAULT_SAMPLES 64
#define MODES           2

// What one way of making pictures came to.
struct result {
    double flip, luma_error, change, cpu_ms;
};

struct run {
    struct hg_renderer *renderer;
    struct hg_scene *scene;
    const struct hg_bench_settings *bench;
    struct hg_bench_walk walk;
    uint32_t compared, done;
    struct hg_view *settled, *moving;
    struct hg_refbuf **truth; // [path_count] settled pictures of those that are compared
    struct result results[MODES];
    double truth_change;
};

static enum hg_status tell(struct run *run, struct hg_error *err)
{
    const uint32_t total = (MODES + 1) * run->walk.path_count;
    run->done++;
    return run->bench->progress == NULL || run->bench->progress(run->bench->progress_user,
                                               run->done < total ? run->done : total, total)
               ? HG_OK
               : hg_error_set(err, HG_E_CANCELLED, "bench", NULL, "cancelled");
}

// --- pictures ------------------------------------------------------------------------------------

static enum hg_status settle(struct run *run, uint32_t pose, struct hg_error *err)
{
    struct hg_frame_info info = {0};
    enum hg_status status = hg_bench_walk_look(&run->walk, run->settled, pose, err);
    while (status == HG_OK && !info.settled)
        status = hg_view_step(run->settled, 16, &info, err);
    return status == HG_OK
               ? hg_view_read_pixels(run->settled, HG_PIXEL_RGBA8, &run->truth[pose], err)
               : status;
}

static enum hg_status compare(const struct run *run, struct hg_refbuf *truth,
    struct hg_refbuf *picture, struct result *result, struct hg_error *err)
{
    double flip = 0;
    const enum hg_status status =
        hg_bench_walk_flip(&run->walk, truth->data, picture->data, &flip, err);
    result->flip += flip;
    result->luma_error += hg_bench_walk_luma_error(&run->walk, truth->data, picture->data);
    return status;
}

// --- walks ---------------------------------------------------------------------------------------

static enum hg_status make_view(
    struct run *run, enum hg_view_temporal temporal, struct hg_view **out, struct hg_error *err)
{
    const struct hg_view_params params = {.width = run->walk.width,
        .height = run->walk.height,
        .samples = run->bench->samples > 0 ? run->bench->samples : DEFAULT_SAMPLES,
        .gi = (enum hg_view_gi)run->bench->gi,
        .temporal = temporal};
    const enum hg_status status = hg_view_create(run->renderer, run->scene, out, err);
    return status == HG_OK ? hg_view_set_params(*out, &params, err) : status;
}

static enum hg_status walk(struct run *run, enum hg_view_temporal temporal, struct hg_error *err)
{
    struct result *result = &run->results[temporal];
    struct hg_refbuf *before = NULL, *now = NULL;
    float *depth = NULL;
    enum hg_status status = make_view(run, temporal, &run->moving, err);
    if (status == HG_OK)
        status = hg_bench_walk_warm_up(&run->walk, run->moving, err);
    for (uint32_t i = 0; i < run->walk.path_count && status == HG_OK; i++) {
        const uint64_t cpu = hg_clock_cpu_ns();
        status = hg_bench_walk_draw(&run->walk, run->moving, i, &now, err);
        result->cpu_ms += (double)(hg_clock_cpu_ns() - cpu) * 1e-6;
        if (status == HG_OK && temporal == HG_TEMPORAL_AUTO)
            status = hg_bench_walk_find_motion(&run->walk, run->moving, i, &depth, err);
        if (status == HG_OK && hg_bench_walk_is_compared(i)) {
            status = compare(run, run->truth[i], now, result, err);
            if (run->walk.motion[i] != NULL)
                result->change += hg_bench_walk_change(&run->walk, i, before->data, now->data);
        }
        hg_refbuf_unref(before);
        before = now;
        now = NULL;
        if (status == HG_OK)
            status = tell(run, err);
    }
    hg_free(depth);
    hg_refbuf_unref(before);
    hg_view_destroy(run->moving);
    run->moving = NULL;
    return status;
}

static enum hg_status settle_all(struct run *run, struct hg_error *err)
{
    enum hg_status status = make_view(run, HG_TEMPORAL_NONE, &run->settled, err);
    if (status == HG_OK)
        hg_view_set_final(run->settled, true);
    for (uint32_t i = 0; i < run->walk.path_count && status == HG_OK; i++) {
        if (hg_bench_walk_is_compared(i) || hg_bench_walk_is_compared(i + 1))
            status = settle(run, i, err);
        if (status == HG_OK)
            status = tell(run, err);
    }
    return status;
}

static void change_of_truth(struct run *run)
{
    for (uint32_t i = 1; i < run->walk.path_count; i++) {
        if (run->walk.motion[i] == NULL)
            continue;
        run->compared++;
        run->truth_change +=
            hg_bench_walk_change(&run->walk, i, run->truth[i - 1]->data, run->truth[i]->data);
    }
}

// --- report --------------------------------------------------------------------------------------

static enum hg_status write_report(const struct run *run, char **text)
{
    static const char *const names[MODES] = {
        [HG_TEMPORAL_NONE] = "none", [HG_TEMPORAL_AUTO] = "auto"};
    const double count = run->compared > 0 ? run->compared : 1;
    struct hg_writer w = {0};
    hg_json_put(&w, "{\"width\":%u,\"height\":%u,\"poses\":%u,\"compared\":%u", run->walk.width,
        run->walk.height, run->walk.path_count, run->compared);
    for (int m = 0; m < MODES; m++) {
        const struct result *r = &run->results[m];
        hg_json_put(&w,
            ",\"%s\":{\"flip\":%.5f,\"luma_error\":%.6f,\"flicker\":%.4f,\"cpu_ms\":%.3f}",
            names[m], r->flip / count, r->luma_error / count,
            run->truth_change > 0 ? r->change / run->truth_change : 0,
            r->cpu_ms / (double)run->walk.path_count);
    }
    hg_json_put(&w, "}");
    return hg_json_take(&w, text);
}

static enum hg_status prepare(struct run *run, struct hg_error *err)
{
    const enum hg_status status = hg_bench_walk_init(&run->walk, run->scene, run->bench, err);
    if (status != HG_OK)
        return status;
    run->truth = hg_calloc(run->walk.path_count, sizeof *run->truth);
    return run->truth != NULL ? HG_OK
                              : hg_error_set(err, HG_E_NOMEM, "bench", NULL, "out of host memory");
}

enum hg_status hg_bench_temporal_run(struct hg_renderer *renderer, struct hg_scene *scene,
    const struct hg_bench_settings *bench, char **text, struct hg_error *err)
{
    *text = NULL;
    struct run *run = hg_calloc(1, sizeof *run);
    if (run == NULL)
        return hg_error_set(err, HG_E_NOMEM, "bench", NULL, "out of host memory");
    run->renderer = renderer;
    run->scene = scene;
    run->bench = bench;
    enum hg_status status = prepare(run, err);
    if (status == HG_OK)
        status = settle_all(run, err);
    if (status == HG_OK)
        status = walk(run, HG_TEMPORAL_AUTO, err); // finds the motion for both
    if (status == HG_OK)
        status = walk(run, HG_TEMPORAL_NONE, err);
    if (status == HG_OK) {
        change_of_truth(run);
        status = write_report(run, text);
    }
    hg_view_destroy(run->moving);
    hg_view_destroy(run->settled);
    for (uint32_t i = 0; i < run->walk.path_count && run->truth != NULL; i++)
        hg_refbuf_unref(run->truth[i]);
    hg_free(run->truth);
    hg_bench_walk_finish(&run->walk);
    hg_free(run);
    return status;
}
