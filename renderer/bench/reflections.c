// reflections.c - reflections of pictures in motion, full ray shading against the radiance cache
// (helio bench reflections).
#include <string.h>

#include "base/alloc.h"
#include "base/clock.h"
#include "base/json.h"
#include "renderer/bench/common.h"
#include "renderer/bench/references.h"
#include "renderer/bench/walk.h"
#include "renderer/internal.h"

#define DEFAULT_SAMPLES 64 // of a reference
#define VIEWS           5
#define SEVERAL         4 // rays of the second view
#define PICTURES        32
#define MEASURED        16
#define TREMBLE         1e-4f // of the distance to the target

// Default poses: places within the bounds of the scene, 0 to 1 along each axis. Curtains from near,
// twice; across the court onto one; along it; down onto the floor.
static const struct {
    float eye[3], target[3];
} places[VIEWS] = {{{0.40f, 0.12f, 0.46f}, {0.45f, 0.22f, 0.75f}},
    {{0.40f, 0.12f, 0.46f}, {0.45f, 0.22f, 0.75f}}, {{0.30f, 0.30f, 0.50f}, {0.50f, 0.35f, 0.95f}},
    {{0.75f, 0.12f, 0.50f}, {0.20f, 0.20f, 0.52f}}, {{0.60f, 0.14f, 0.50f}, {0.50f, 0.00f, 0.50f}}};

static const struct way {
    const char *name;
    enum hg_view_reflections reflections;
    uint32_t side;
    bool dense;
} ways[] = {{"environment", HG_REFLECTIONS_ENVIRONMENT, 0, false},
    {"full", HG_REFLECTIONS_RAYS, 0, true}, {"rays", HG_REFLECTIONS_RAYS, 0, false},
    {"cache_32", HG_REFLECTIONS_CACHE, 32, false}, {"cache_256", HG_REFLECTIONS_CACHE, 256, false}};
#define WAYS (sizeof ways / sizeof *ways)
enum { FULL = 1 };

struct result {
    double cpu_ms, frame_cpu_ms, flip;
    struct hg_reflect_stats stats; // of the last picture
    uint32_t gathered;             // its rays for what rough surfaces mirror
};

struct run {
    struct hg_renderer *renderer;
    const struct hg_bench_settings *bench;
    struct hg_bench_walk walk;
    struct hg_bench_pose poses[VIEWS];
    uint32_t done;
    struct { // [path_count]
        float exposure_ev;
        uint32_t samples;
        struct result results[WAYS];
    } * views;
};

static enum hg_status no_memory(struct hg_error *err)
{
    return hg_error_set(err, HG_E_NOMEM, "bench", NULL, "out of host memory");
}

static enum hg_status tell(struct run *run, struct hg_error *err)
{
    const uint32_t total = run->walk.path_count * (uint32_t)(WAYS + 1);
    run->done++;
    return run->bench->progress == NULL ||
                   run->bench->progress(run->bench->progress_user, run->done, total)
               ? HG_OK
               : hg_error_set(err, HG_E_CANCELLED, "bench", NULL, "cancelled");
}

static enum hg_status open_view(struct run *run, const struct hg_view_params *params, uint32_t pose,
    struct hg_view **out, struct hg_error *err)
{
    enum hg_status status = hg_view_create(run->renderer, run->walk.scene, out, err);
    if (status == HG_OK)
        status = hg_view_set_params(*out, params, err);
    return status == HG_OK ? hg_bench_walk_look(&run->walk, *out, pose, err) : status;
}

static struct hg_view_params params_of(const struct run *run, uint32_t pose)
{
    return (struct hg_view_params){.width = run->walk.width,
        .height = run->walk.height,
        .samples = 2,
        .gi = HG_GI_PROBES,
        .exposure_ev = run->views[pose].exposure_ev};
}

static enum hg_status settle(struct hg_view *view, struct hg_frame_info *info, struct hg_error *err)
{
    enum hg_status status = HG_OK;
    *info = (struct hg_frame_info){0};
    while (status == HG_OK && !info->settled)
        status = hg_view_step(view, 16, info, err);
    return status;
}

// --- the truth -----------------------------------------------------------------------------------

static enum hg_status meter(struct run *run, uint32_t pose, struct hg_error *err)
{
    struct hg_view_params params = params_of(run, pose);
    struct hg_view *view = NULL;
    struct hg_frame_info info = {0};
    params.gi = HG_GI_NONE;
    params.samples = 1;
    params.exposure_mode = HG_EXPOSURE_AUTO;
    enum hg_status status = open_view(run, &params, pose, &view, err);
    if (status == HG_OK)
        status = settle(view, &info, err);
    run->views[pose].exposure_ev = info.exposure_ev;
    hg_view_destroy(view);
    return status;
}

static enum hg_status find_truth(
    struct run *run, uint32_t pose, struct hg_refbuf **out, struct hg_error *err)
{
    struct hg_view_params params = params_of(run, pose);
    struct hg_bench_references references;
    struct hg_view *view = NULL;
    params.mode = HG_MODE_PATH;
    params.denoise = HG_DENOISE_STILL;
    params.gi = HG_GI_NONE;
    params.samples = hg_bench_or(run->bench->samples, DEFAULT_SAMPLES);
    enum hg_status status = hg_bench_references_begin(
        &references, run->walk.scene, run->bench->references, &params, err);
    if (status == HG_OK)
        status = open_view(run, &params, pose, &view, err);
    if (status == HG_OK) {
        hg_view_set_final(view, true);
        status = hg_bench_references_get(&references, &run->walk, view, pose, out, err);
    }
    hg_view_destroy(view);
    return status;
}

// --- pictures ------------------------------------------------------------------------------------

static enum hg_status tremble(const struct run *run, struct hg_view *view, uint32_t pose,
    uint32_t picture, struct hg_error *err)
{
    const struct hg_bench_pose *p = &run->walk.path[pose];
    struct hg_view_camera camera = {.vfov_rad = run->walk.vfov_rad};
    const float off = TREMBLE * (float)(PICTURES - 1 - picture);
    for (int a = 0; a < 3; a++) {
        camera.eye[a] = p->eye[a] + off * (p->target[(a + 1) % 3] - p->eye[(a + 1) % 3]);
        camera.target[a] = p->target[a];
    }
    return hg_view_set_camera(view, &camera, err);
}

static enum hg_status draw_all(
    struct run *run, struct hg_view *view, uint32_t pose, struct result *out, struct hg_error *err)
{
    struct hg_bench_times host = {0}, frames = {0};
    struct hg_frame_info info;
    enum hg_status status = HG_OK;
    for (uint32_t i = 0; i < PICTURES && status == HG_OK; i++) {
        status = tremble(run, view, pose, i, err);
        const uint64_t cpu = hg_clock_cpu_ns();
        if (status == HG_OK)
            status = hg_view_step(view, 1, &info, err);
        hg_reflect_stats(view->state.motion.reflections.reflect, &out->stats);
        struct hg_irradiance_stats rough = {0}; // what rough surfaces mirror
        if (view->state.motion.reflections.gathers)
            hg_irradiance_stats(view->state.scene_gpu->irradiance, &rough);
        out->gathered = rough.rays;
        if (i < PICTURES - MEASURED || status != HG_OK)
            continue;
        if (hg_bench_times_add(&frames, hg_clock_cpu_ns() - cpu) != HG_OK ||
            hg_bench_times_add(&host, out->stats.cpu_ns + rough.cpu_ns) != HG_OK)
            status = no_memory(err);
    }
    out->cpu_ms = hg_bench_times_at(&host, 0.5);
    out->frame_cpu_ms = hg_bench_times_at(&frames, 0.5);
    hg_bench_times_finish(&host);
    hg_bench_times_finish(&frames);
    return status;
}

static enum hg_status measure_way(
    struct run *run, uint32_t pose, size_t number, struct hg_refbuf *truth, struct hg_error *err)
{
    const struct way *way = &ways[number];
    struct hg_view_params params = params_of(run, pose);
    struct hg_view *view = NULL;
    struct hg_refbuf *picture = NULL;
    struct result *out = &run->views[pose].results[number];
    params.reflections = way->reflections;
    enum hg_status status = open_view(run, &params, pose, &view, err);
    if (status == HG_OK) {
        struct hg_debug_overrides *o = &view->state.context->overrides;
        const struct hg_debug_overrides kept = *o;
        o->cache_side = way->side;
        o->reflect_dense = way->dense;
        o->reflect_samples = run->views[pose].samples;
        status = draw_all(run, view, pose, out, err);
        *o = kept;
    }
    if (status == HG_OK)
        status = hg_view_read_pixels(view, HG_PIXEL_RGBA8, &picture, err);
    if (status == HG_OK)
        status = hg_bench_walk_flip(&run->walk, truth->data, picture->data, &out->flip, err);
    hg_refbuf_unref(picture);
    hg_view_destroy(view);
    return status == HG_OK ? tell(run, err) : status;
}

// A view at rest holds the settled field for the others.
static enum hg_status measure_pose(struct run *run, uint32_t pose, struct hg_error *err)
{
    struct hg_view *resting = NULL;
    struct hg_refbuf *truth = NULL;
    struct hg_frame_info info;
    run->views[pose].samples = pose == 1 && run->bench->path_count == 0 ? SEVERAL : 1;
    enum hg_status status = meter(run, pose, err);
    if (status == HG_OK)
        status = find_truth(run, pose, &truth, err);
    if (status == HG_OK)
        status = tell(run, err);
    const struct hg_view_params params = params_of(run, pose);
    if (status == HG_OK)
        status = open_view(run, &params, pose, &resting, err);
    if (status == HG_OK)
        status = settle(resting, &info, err);
    for (size_t k = 0; k < WAYS && status == HG_OK; k++)
        status = measure_way(run, pose, k, truth, err);
    hg_view_destroy(resting);
    hg_refbuf_unref(truth);
    return status;
}

// --- report --------------------------------------------------------------------------------------

static void put_result(struct hg_writer *w, const char *name, const struct result *r, double full)
{
    const struct hg_reflect_stats *s = &r->stats;
    hg_json_put(w, ",\"%s\":{\"flip\":%.5f,\"frame_cpu_ms\":%.3f", name, r->flip, r->frame_cpu_ms);
    if (s->texels > 0)
        hg_json_put(w,
            ",\"cpu_ms\":%.3f,\"ratio\":%.3f,\"texels\":%u,\"sky\":%u,\"cached\":%u,\"shaded\":%u,"
            "\"late\":%u,\"gathered\":%u",
            r->cpu_ms, r->cpu_ms > 0 ? full / r->cpu_ms : 0,
            s->texels - s->counts[HG_REFLECT_NOTHING] - s->counts[HG_REFLECT_ROUGH],
            s->counts[HG_REFLECT_SKY], s->counts[HG_REFLECT_CACHED], s->counts[HG_REFLECT_SHADED],
            s->counts[HG_REFLECT_LATE], r->gathered);
    hg_json_put(w, "}");
}

static enum hg_status write_report(const struct run *run, char **text)
{
    struct hg_writer w = {0};
    hg_json_put(&w, "{\"width\":%u,\"height\":%u,\"views\":[", run->walk.width, run->walk.height);
    for (uint32_t i = 0; i < run->walk.path_count; i++) {
        hg_json_put(&w, "%s{\"samples\":%u,\"exposure_ev\":%.3f", i > 0 ? "," : "",
            run->views[i].samples, (double)run->views[i].exposure_ev);
        for (size_t k = 0; k < WAYS; k++)
            put_result(
                &w, ways[k].name, &run->views[i].results[k], run->views[i].results[FULL].cpu_ms);
        hg_json_put(&w, "}");
    }
    hg_json_put(&w, "]}");
    return hg_json_take(&w, text);
}

static enum hg_status begin(struct run *run, struct hg_scene *scene, struct hg_error *err)
{
    enum hg_status status = hg_bench_walk_init(&run->walk, scene, run->bench, err);
    float min[3] = {-1, -1, -1}, max[3] = {1, 1, 1};
    if (status != HG_OK)
        return status;
    hg_scene_bounds(scene, NULL, min, max);
    for (int i = 0; i < VIEWS; i++)
        for (int a = 0; a < 3; a++) {
            const float size = max[a] - min[a];
            run->poses[i].eye[a] = min[a] + places[i].eye[a] * size;
            run->poses[i].target[a] = min[a] + places[i].target[a] * size;
        }
    if (run->bench->path_count == 0) {
        run->walk.path = run->poses;
        run->walk.path_count = VIEWS;
    }
    run->views = hg_calloc(run->walk.path_count, sizeof *run->views);
    return run->views != NULL ? HG_OK : no_memory(err);
}

enum hg_status hg_bench_reflections_run(struct hg_renderer *renderer, struct hg_scene *scene,
    const struct hg_bench_settings *bench, char **text, struct hg_error *err)
{
    *text = NULL;
    struct run *run = hg_calloc(1, sizeof *run);
    if (run == NULL)
        return no_memory(err);
    run->renderer = renderer;
    run->bench = bench;
    enum hg_status status = begin(run, scene, err);
    for (uint32_t i = 0; i < run->walk.path_count && status == HG_OK; i++)
        status = measure_pose(run, i, err);
    if (status == HG_OK)
        status = write_report(run, text);
    hg_bench_walk_finish(&run->walk);
    hg_free(run->views);
    hg_free(run);
    return status;
}
