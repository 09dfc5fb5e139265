// path.c - where the time of path-traced pictures goes (helio bench path).
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "base/clock.h"
#include "base/json.h"
#include "renderer/bench/common.h"
#include "renderer/internal.h"
#include "renderer/pathtrace/path.h"

#define DEFAULT_SAMPLES 8
#define WARM_UP_SEED    1000003u // of the picture before: its rays are others

struct run {
    struct hg_renderer *renderer;
    const struct hg_bench_settings *bench;
    struct hg_bench_pose pose;
    struct hg_bench_view view;
    struct hg_path_stats stats, raw; // of the picture that counts; of the one with Embree alone
    uint32_t samples;
    uint64_t ns, cpu_ns; // of the whole picture
};

static void choose_pose(struct run *run, const struct hg_scene *scene)
{
    float min[3] = {-1, -1, -1}, max[3] = {1, 1, 1}, size2 = 0;
    if (run->bench->path_count > 0) {
        run->pose = run->bench->path[0];
        return;
    }
    if (!hg_scene_bounds(scene, NULL, min, max))
        return;
    for (int i = 0; i < 3; i++) {
        run->pose.eye[i] = run->pose.target[i] = 0.5f * (min[i] + max[i]);
        size2 += (max[i] - min[i]) * (max[i] - min[i]);
    }
    run->pose.eye[1] += 0.3f * sqrtf(size2);
    run->pose.eye[2] += 0.75f * sqrtf(size2);
}

// One picture; its times are those of the newest one.
static enum hg_status draw(struct run *run, uint32_t samples, uint32_t seed,
    struct hg_path_stats *stats, struct hg_error *err)
{
    const struct hg_bench_settings *b = run->bench;
    const struct hg_view_params params = {.mode = HG_MODE_PATH,
        .width = b->width,
        .height = b->height,
        .samples = samples,
        .seed = seed};
    struct hg_image image;
    enum hg_status status = hg_view_set_params(run->view.view, &params, err);
    const uint64_t start = hg_clock_now_ns(), cpu = hg_clock_cpu_ns();
    if (status == HG_OK)
        status = hg_bench_view_settle(&run->view, &run->pose, &image, err);
    if (status != HG_OK)
        return status;
    hg_image_finish(&image);
    run->ns = hg_clock_now_ns() - start;
    run->cpu_ns = hg_clock_cpu_ns() - cpu;
    hg_path_get_stats(run->view.view->state.path, stats);
    return HG_OK;
}

static double per(double value, uint64_t count)
{
    return count > 0 ? value / (double)count : 0.0;
}

static void put_pieces(struct hg_writer *w, const struct run *run)
{
    const struct hg_path_stats *s = &run->stats;
    uint64_t sum = 0;
    for (int i = 0; i < HG_PATH_PIECES; i++)
        sum += s->pieces[i].cpu_ns;
    hg_json_put(w, ",\"pieces\":[");
    for (int i = 0; i < HG_PATH_PIECES; i++) {
        const struct hg_path_time *t = &s->pieces[i];
        hg_json_put(w,
            "%s{\"name\":\"%s\",\"items\":%llu,\"ms\":%.3f,\"cpu_ms\":%.3f,\"share\":%.4f,"
            "\"cpu_ns_per_item\":%.1f}",
            i > 0 ? "," : "", hg_path_piece_name((enum hg_path_piece)i),
            (unsigned long long)t->items, (double)t->ns * 1e-6, (double)t->cpu_ns * 1e-6,
            per((double)t->cpu_ns, sum), per((double)t->cpu_ns, t->items));
    }
    hg_json_put(w, "]");
}

static double mrays(uint64_t rays, uint64_t ns)
{
    return per((double)rays * 1e3, ns);
}

static enum hg_status write_report(const struct run *run, char **text)
{
    const struct hg_path_stats *s = &run->stats;
    const struct hg_path_stats *r = &run->raw;
    const struct hg_path_time *trace = &r->pieces[HG_PATH_PIECE_TRACE];
    const struct hg_path_time *shadow = &r->pieces[HG_PATH_PIECE_SHADOW];
    struct hg_writer w = {0};
    hg_json_put(&w, "{\"width\":%u,\"height\":%u,\"samples\":%u,\"device\":", run->view.info.width,
        run->view.info.height, run->samples);
    hg_json_string(&w, hg_gpu_get_caps(run->renderer->gpu)->device_name);
    hg_json_put(&w,
        ",\"ms\":%.3f,\"cpu_ms\":%.3f,\"build_ms\":%.3f,\"paths\":%llu,\"cpu_us_per_path\":%.4f",
        (double)run->ns * 1e-6, (double)run->cpu_ns * 1e-6, (double)s->build_ns * 1e-6,
        (unsigned long long)s->paths, per((double)run->cpu_ns * 1e-3, s->paths));
    hg_json_put(&w,
        ",\"mrays_per_s\":{\"closest\":%.3f,\"shadow\":%.3f},\"raw_mrays_per_s\":{\"closest\":%.3f,"
        "\"shadow\":%.3f},\"ratio\":{\"closest\":%.3f,\"shadow\":%.3f}",
        mrays(trace->items, trace->ns), mrays(shadow->items, shadow->ns),
        mrays(r->raw_rays[0], r->raw_ns[0]), mrays(r->raw_rays[1], r->raw_ns[1]),
        per((double)r->raw_ns[0], trace->ns), per((double)r->raw_ns[1], shadow->ns));
    put_pieces(&w, run);
    hg_json_put(&w, "}");
    return hg_json_take(&w, text);
}

// A first picture brings textures and compiles kernels; rays of a second one go through Embree
// alone as well; the last one counts.
static enum hg_status measure(struct run *run, struct hg_error *err)
{
    struct hg_path_stats unused;
    enum hg_status status = draw(run, 2, WARM_UP_SEED, &unused, err);
    run->renderer->context.overrides.trace_raw = true;
    if (status == HG_OK)
        status = draw(run, run->samples, 0, &run->raw, err);
    run->renderer->context.overrides.trace_raw = false;
    return status == HG_OK ? draw(run, run->samples, 1, &run->stats, err) : status;
}

enum hg_status hg_bench_path_run(struct hg_renderer *renderer, struct hg_scene *scene,
    const struct hg_bench_settings *bench, char **text, struct hg_error *err)
{
    *text = NULL;
    struct run run = {.renderer = renderer,
        .bench = bench,
        .samples = hg_bench_or(bench->rounds, DEFAULT_SAMPLES)};
    const struct hg_view_params params = {
        .width = bench->width, .height = bench->height, .samples = 1};
    hg_scene_update(scene);
    choose_pose(&run, scene);
    enum hg_status status = hg_bench_view_init(&run.view, renderer, scene, &params, err);
    run.view.vfov_rad = bench->vfov_rad;
    if (status == HG_OK)
        status = measure(&run, err);
    if (status == HG_OK)
        status = write_report(&run, text);
    hg_bench_view_finish(&run.view);
    return status;
}
