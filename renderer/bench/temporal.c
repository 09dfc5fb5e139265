// temporal.c - pictures in motion against settled ones (helio bench temporal).
#include <math.h>
#include <string.h>

#include "base/alloc.h"
#include "base/clock.h"
#include "base/json.h"
#include "renderer/bench/body.h"
#include "renderer/bench/common.h"
#include "renderer/bench/walk.h"
#include "renderer/internal.h"

#define DEFAULT_SAMPLES 64
#define GHOST_STEPS     8    // of the body
#define GHOST_STEP      0.1f // each, of its distance from the eye
#define GHOST_HALF      0.08f

// Ways of making pictures; the first finds the motion for all.
static const struct mode {
    const char *name;
    enum hg_view_temporal temporal;
    float scale; // percent; 0: not set
    float sharpen;
} modes[] = {{"auto", HG_TEMPORAL_AUTO, 0, 0}, {"none", HG_TEMPORAL_NONE, 0, 0},
    {"checkerboard", HG_TEMPORAL_CHECKERBOARD, 0, 0}, {"scale_77", HG_TEMPORAL_AUTO, 77, 0},
    {"scale_71", HG_TEMPORAL_AUTO, 71, 0}, {"scale_67", HG_TEMPORAL_AUTO, 67, 0},
    {"sharp_67", HG_TEMPORAL_AUTO, 67, 0.5f}, {"scale_50", HG_TEMPORAL_AUTO, 50, 0}};
#define MODES (sizeof modes / sizeof modes[0])

// What one of them came to.
struct result {
    double flip, luma_error, change, cpu_ms;
    double temporal_ms; // of it, on the clock
    struct hg_bench_times frames;
    double ghost;     // mean error of luma where a fast body was before
    double after_cut; // FLIP of the first picture after a jump
};

struct run {
    struct hg_renderer *renderer;
    struct hg_scene *scene;
    const struct hg_bench_settings *bench;
    struct hg_bench_walk walk;
    uint32_t compared, done;
    struct hg_view *settled, *moving;
    struct hg_node *body;
    float distance;           // of it from the eye, metres
    struct hg_refbuf *behind; // settled picture with the body where it comes to rest
    struct hg_refbuf **truth; // [path_count] settled pictures of those that are compared
    struct result results[MODES];
    double truth_change;
};

static enum hg_status tell(struct run *run, struct hg_error *err)
{
    const uint32_t total = (uint32_t)(MODES + 1) * run->walk.path_count;
    run->done++;
    return run->bench->progress == NULL || run->bench->progress(run->bench->progress_user,
                                               run->done < total ? run->done : total, total)
               ? HG_OK
               : hg_error_set(err, HG_E_CANCELLED, "bench", NULL, "cancelled");
}

// --- pictures ------------------------------------------------------------------------------------

static enum hg_status settle(
    struct run *run, uint32_t pose, struct hg_refbuf **out, struct hg_error *err)
{
    struct hg_frame_info info = {0};
    enum hg_status status = hg_bench_walk_look(&run->walk, run->settled, pose, err);
    while (status == HG_OK && !info.settled)
        status = hg_view_step(run->settled, 16, &info, err);
    return status == HG_OK ? hg_view_read_pixels(run->settled, HG_PIXEL_RGBA8, out, err) : status;
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
    struct run *run, const struct mode *mode, struct hg_view **out, struct hg_error *err)
{
    const struct hg_view_params params = {.width = run->walk.width,
        .height = run->walk.height,
        .samples = run->bench->samples > 0 ? run->bench->samples : DEFAULT_SAMPLES,
        .gi = (enum hg_view_gi)run->bench->gi,
        .reflections = (enum hg_view_reflections)run->bench->reflections,
        .temporal = mode->temporal,
        .shadow_maps = (enum hg_view_shadow_maps)run->bench->shadow_maps,
        .scale = mode->scale,
        .sharpen = mode->sharpen};
    const enum hg_status status = hg_view_create(run->renderer, run->scene, out, err);
    return status == HG_OK ? hg_view_set_params(*out, &params, err) : status;
}

// Time of a stage of the newest step.
static double stage_ms(const struct hg_view *view, const char *name)
{
    const struct hg_view_stats *s = &view->state.stats;
    double ms = 0;
    for (uint32_t i = 0; i < s->stage_count; i++)
        ms += strcmp(s->stages[i].name, name) == 0 ? (double)s->stages[i].ns * 1e-6 : 0;
    return ms;
}

// From the end of the path to its first pose that is compared.
static enum hg_status cut(struct run *run, struct result *result, struct hg_error *err)
{
    struct hg_refbuf *picture = NULL;
    struct result first = {0};
    if (run->walk.path_count < HG_BENCH_WALK_EVERY)
        return HG_OK;
    enum hg_status status =
        hg_bench_walk_draw(&run->walk, run->moving, HG_BENCH_WALK_EVERY - 1, &picture, err);
    if (status == HG_OK)
        status = compare(run, run->truth[HG_BENCH_WALK_EVERY - 1], picture, &first, err);
    hg_refbuf_unref(picture);
    result->after_cut = first.flip;
    return status;
}

// The body at a step of its way across the picture of the first pose.
static void place_body(struct run *run, uint32_t step)
{
    const struct hg_bench_pose *p = &run->walk.path[0];
    float ahead[3], at[3], length = 0;
    for (int i = 0; i < 3; i++) {
        ahead[i] = p->target[i] - p->eye[i];
        length += ahead[i] * ahead[i];
    }
    const float across[3] = {-ahead[2], 0, ahead[0]}; // to the right, with y up
    const float flat = hypotf(ahead[0], ahead[2]), d = run->distance;
    const float right = d * GHOST_STEP * ((float)step - 0.5f * (GHOST_STEPS - 1));
    for (int i = 0; i < 3; i++)
        at[i] = p->eye[i] + d * ahead[i] / sqrtf(length) + right * across[i] / flat;
    hg_bench_body_place(run->scene, run->body, at);
}

// Mean error in the rows of the body, from where it began to where it is.
static double trail_error(const struct run *run, const struct hg_refbuf *picture)
{
    const float vfov = run->bench->vfov_rad > 0 ? run->bench->vfov_rad : 0.7853981634f;
    const float px = 0.5f * (float)run->walk.height / tanf(0.5f * vfov); // of one distance
    const float reach = 0.5f * GHOST_STEP * (GHOST_STEPS - 1);
    const float first = 0.5f * (float)run->walk.width - reach * px;
    const float end = 0.5f * (float)run->walk.width + (reach - 1.2f * GHOST_HALF) * px;
    const uint32_t half = (uint32_t)(0.8f * GHOST_HALF * px), middle = run->walk.height / 2;
    double sum = 0;
    uint32_t count = 0;
    for (uint32_t y = middle - half; y < middle + half; y++)
        for (uint32_t x = (uint32_t)fmaxf(first, 0.0f); x < (uint32_t)fmaxf(end, 0.0f); x++) {
            const size_t at = 4 * ((size_t)y * run->walk.width + x);
            sum += fabs((
                double)(hg_bench_luma(run->behind->data + at) - hg_bench_luma(picture->data + at)));
            count++;
        }
    return count > 0 ? sum / count : 0;
}

// A body that crosses the picture, at about a sixth of its height with each picture.
static enum hg_status haunt(struct run *run, struct result *result, struct hg_error *err)
{
    enum hg_status status = HG_OK;
    for (uint32_t i = 0; i < GHOST_STEPS && status == HG_OK; i++) {
        struct hg_refbuf *picture = NULL;
        place_body(run, i);
        status = hg_bench_walk_draw(&run->walk, run->moving, 0, &picture, err);
        if (status == HG_OK && i == GHOST_STEPS - 1)
            result->ghost = trail_error(run, picture);
        hg_refbuf_unref(picture);
    }
    hg_bench_body_place(run->scene, run->body, NULL);
    return status;
}

static enum hg_status walk(struct run *run, uint32_t number, struct hg_error *err)
{
    const struct mode *mode = &modes[number];
    struct result *result = &run->results[number];
    struct hg_refbuf *before = NULL, *now = NULL;
    float *depth = NULL;
    enum hg_status status = make_view(run, mode, &run->moving, err);
    if (status == HG_OK)
        status = hg_bench_walk_warm_up(&run->walk, run->moving, err);
    for (uint32_t i = 0; i < run->walk.path_count && status == HG_OK; i++) {
        const uint64_t cpu = hg_clock_cpu_ns(), start = hg_clock_now_ns();
        status = hg_bench_walk_draw(&run->walk, run->moving, i, &now, err);
        const uint64_t end = hg_clock_now_ns();
        result->cpu_ms += (double)(hg_clock_cpu_ns() - cpu) * 1e-6;
        if (status == HG_OK && hg_bench_times_add(&result->frames, end - start) != HG_OK)
            status = hg_error_set(err, HG_E_NOMEM, "bench", NULL, "out of host memory");
        result->temporal_ms += stage_ms(run->moving, "temporal");
        if (status == HG_OK && number == 0)
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
    if (status == HG_OK)
        status = cut(run, result, err);
    if (status == HG_OK)
        status = haunt(run, result, err);
    hg_free(depth);
    hg_refbuf_unref(before);
    hg_view_destroy(run->moving);
    run->moving = NULL;
    return status;
}

static enum hg_status settle_all(struct run *run, struct hg_error *err)
{
    enum hg_status status = make_view(run, &modes[0], &run->settled, err);
    if (status == HG_OK)
        hg_view_set_final(run->settled, true);
    for (uint32_t i = 0; i < run->walk.path_count && status == HG_OK; i++) {
        if (hg_bench_walk_is_compared(i) || hg_bench_walk_is_compared(i + 1))
            status = settle(run, i, &run->truth[i], err);
        if (status == HG_OK)
            status = tell(run, err);
    }
    place_body(run, GHOST_STEPS - 1);
    if (status == HG_OK)
        status = settle(run, 0, &run->behind, err);
    hg_bench_body_place(run->scene, run->body, NULL);
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
    const double count = run->compared > 0 ? run->compared : 1, poses = run->walk.path_count;
    struct hg_writer w = {0};
    hg_json_put(&w, "{\"width\":%u,\"height\":%u,\"poses\":%u,\"compared\":%u", run->walk.width,
        run->walk.height, run->walk.path_count, run->compared);
    for (uint32_t m = 0; m < MODES; m++) {
        const struct result *r = &run->results[m];
        const double median = hg_bench_times_at(&r->frames, 0.5);
        hg_json_put(&w,
            ",\"%s\":{\"flip\":%.5f,\"luma_error\":%.6f,\"flicker\":%.4f,\"ghost\":%.6f,\"after_"
            "cut\":%.5f,"
            "\"cpu_ms\":%.3f,\"temporal_ms\":%.3f,\"frame_ms\":%.3f,\"p95_over_median\":%.3f}",
            modes[m].name, r->flip / count, r->luma_error / count,
            run->truth_change > 0 ? r->change / run->truth_change : 0, r->ghost, r->after_cut,
            r->cpu_ms / poses, r->temporal_ms / poses, median,
            median > 0 ? hg_bench_times_at(&r->frames, 0.95) / median : 0);
    }
    hg_json_put(&w, "}");
    return hg_json_take(&w, text);
}

static enum hg_status prepare(struct run *run, struct hg_error *err)
{
    float min[3] = {-1, -1, -1}, max[3] = {1, 1, 1};
    enum hg_status status = hg_bench_walk_init(&run->walk, run->scene, run->bench, err);
    if (status != HG_OK)
        return status;
    hg_scene_bounds(run->scene, NULL, min, max);
    run->distance = 0.2f * fmaxf(fmaxf(max[0] - min[0], max[1] - min[1]), max[2] - min[2]);
    status = hg_bench_body_add(run->scene, GHOST_HALF * run->distance, &run->body);
    if (status != HG_OK)
        return hg_error_set(err, status, "bench", NULL, "no body to move");
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
    for (uint32_t m = 0; m < MODES && status == HG_OK; m++)
        status = walk(run, m, err);
    if (status == HG_OK) {
        change_of_truth(run);
        status = write_report(run, text);
    }
    hg_view_destroy(run->moving);
    hg_view_destroy(run->settled);
    hg_refbuf_unref(run->behind);
    for (uint32_t i = 0; i < run->walk.path_count && run->truth != NULL; i++)
        hg_refbuf_unref(run->truth[i]);
    for (uint32_t m = 0; m < MODES; m++)
        hg_bench_times_finish(&run->results[m].frames);
    hg_free(run->truth);
    hg_bench_walk_finish(&run->walk);
    hg_free(run);
    return status;
}
