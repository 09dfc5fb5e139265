// flight.c - what memory comes to over many laps through a scene in which a body moves (helio bench
// flight).
#include <math.h>
#include <string.h>

#include "base/alloc.h"
#include "base/clock.h"
#include "base/json.h"
#include "renderer/bench/body.h"
#include "renderer/bench/walk.h"
#include "renderer/internal.h"

#define DEFAULT_LAPS 4
#define LAPS_A_REST  3    // which takes much longer than a picture in motion
#define SAMPLES      2    // of a picture at rest
#define BODY_HALF    0.1f // of its distance from the eye

struct run {
    struct hg_renderer *renderer;
    struct hg_scene *scene;
    const struct hg_bench_settings *bench;
    struct hg_bench_walk walk;
    struct hg_view *view;
    struct hg_node *body;
    float distance; // of it from the eye, metres
    uint64_t frames;
    struct hg_writer laps; // of the report
};

static enum hg_status make_view(struct run *run, struct hg_error *err)
{
    const struct hg_view_params params = {.width = run->walk.width,
        .height = run->walk.height,
        .samples = SAMPLES,
        .gi = HG_GI_AUTO,
        .reflections = HG_REFLECTIONS_AUTO,
        .temporal = HG_TEMPORAL_AUTO,
        .exposure_mode = HG_EXPOSURE_AUTO,
        .target_ms = run->bench->target_ms};
    const enum hg_status status = hg_view_create(run->renderer, run->scene, &run->view, err);
    return status == HG_OK ? hg_view_set_params(run->view, &params, err) : status;
}

// The body ahead of the eye, off to one side and back again over a lap.
static void place_body(struct run *run, uint32_t pose)
{
    const struct hg_bench_pose *p = &run->walk.path[pose];
    const float swing = sinf(6.2831853f * (float)pose / (float)run->walk.path_count);
    float ahead[3], at[3], length = 0;
    for (int a = 0; a < 3; a++) {
        ahead[a] = p->target[a] - p->eye[a];
        length += ahead[a] * ahead[a];
    }
    const float reach = run->distance / fmaxf(sqrtf(length), 1e-6f);
    for (int a = 0; a < 3; a++)
        at[a] = p->eye[a] + reach * (ahead[a] + (a == 1 ? 0 : 0.3f * swing * ahead[2 - a]));
    hg_bench_body_place(run->scene, run->body, at);
}

static enum hg_status draw(struct run *run, uint32_t pose, struct hg_error *err)
{
    struct hg_refbuf *picture = NULL;
    place_body(run, pose);
    const enum hg_status status = hg_bench_walk_draw(&run->walk, run->view, pose, &picture, err);
    hg_refbuf_unref(picture);
    run->frames++;
    return status;
}

static enum hg_status rest(struct run *run, struct hg_error *err)
{
    struct hg_frame_info info = {0};
    enum hg_status status = HG_OK;
    while (status == HG_OK && !info.settled)
        status = hg_view_step(run->view, SAMPLES, &info, err);
    return status;
}

static enum hg_status note_lap(struct run *run, struct hg_error *err)
{
    char *stats = NULL;
    const enum hg_status status = hg_renderer_stats_json(run->renderer, run->view, &stats);
    if (status != HG_OK)
        return hg_error_set(err, status, "bench", NULL, "out of host memory");
    hg_json_put(&run->laps, "%s{\"frames\":%llu,\"stats\":", run->laps.size > 0 ? "," : "",
        (unsigned long long)run->frames);
    hg_write_bytes(&run->laps, stats, strlen(stats));
    hg_json_put(&run->laps, "}");
    hg_free(stats);
    return HG_OK;
}

// There and back, of some laps with a rest at the far end.
static enum hg_status fly_lap(struct run *run, uint32_t lap, struct hg_error *err)
{
    const uint32_t count = run->walk.path_count;
    enum hg_status status = HG_OK;
    for (uint32_t i = 0; i < count && status == HG_OK; i++)
        status = draw(run, i, err);
    if (status == HG_OK && lap % LAPS_A_REST == 0)
        status = rest(run, err);
    for (uint32_t i = count; i-- > 0 && status == HG_OK;)
        status = draw(run, i, err);
    return status == HG_OK ? note_lap(run, err) : status;
}

static enum hg_status fly(struct run *run, struct hg_error *err)
{
    const uint32_t laps = run->bench->rounds > 0 ? run->bench->rounds : DEFAULT_LAPS;
    const uint64_t start = hg_clock_now_ns(), most_ns = (uint64_t)(run->bench->time_s * 1e9);
    enum hg_status status = HG_OK;
    for (uint32_t lap = 0; status == HG_OK && (lap < laps || hg_clock_now_ns() - start < most_ns);
         lap++) {
        status = fly_lap(run, lap, err);
        if (status == HG_OK && run->bench->progress != NULL &&
            !run->bench->progress(
                run->bench->progress_user, lap + 1, lap + 1 > laps ? lap + 1 : laps))
            status = hg_error_set(err, HG_E_CANCELLED, "bench", NULL, "cancelled");
    }
    return status;
}

static enum hg_status prepare(struct run *run, struct hg_error *err)
{
    float min[3] = {-1, -1, -1}, max[3] = {1, 1, 1};
    enum hg_status status = hg_bench_walk_init(&run->walk, run->scene, run->bench, err);
    if (status != HG_OK)
        return status;
    hg_scene_bounds(run->scene, NULL, min, max);
    run->distance = 0.1f * fmaxf(fmaxf(max[0] - min[0], max[1] - min[1]), max[2] - min[2]);
    status = hg_bench_body_add(run->scene, BODY_HALF * run->distance, &run->body);
    return status == HG_OK ? make_view(run, err)
                           : hg_error_set(err, status, "bench", NULL, "no body to move");
}

static enum hg_status write_report(struct run *run, char **text, struct hg_error *err)
{
    struct hg_writer w = {0};
    hg_json_put(&w, "{\"width\":%u,\"height\":%u,\"poses\":%u,\"laps\":[", run->walk.width,
        run->walk.height, run->walk.path_count);
    hg_write_bytes(&w, run->laps.data, run->laps.size);
    w.failed |= run->laps.failed;
    hg_json_put(&w, "]}");
    const enum hg_status status = hg_json_take(&w, text);
    return status == HG_OK ? HG_OK : hg_error_set(err, status, "bench", NULL, "out of host memory");
}

enum hg_status hg_bench_flight_run(struct hg_renderer *renderer, struct hg_scene *scene,
    const struct hg_bench_settings *bench, char **text, struct hg_error *err)
{
    struct run run = {.renderer = renderer, .scene = scene, .bench = bench};
    *text = NULL;
    enum hg_status status = prepare(&run, err);
    if (status == HG_OK)
        status = fly(&run, err);
    if (status == HG_OK)
        status = write_report(&run, text, err);
    hg_writer_finish(&run.laps);
    hg_view_destroy(run.view);
    hg_bench_walk_finish(&run.walk);
    return status;
}
