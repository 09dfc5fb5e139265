// lod.c - frame time and picture of scenes with many triangles (helio bench lod).
//
// All scenes are a terrain of tiles^2 meshes under the same flight, with statues on it. Two kinds
// of comparisons:
//  - base and hundred, looking down, so that terrain covers every pixel of both: the base has all
//    triangles and few statues; in the hundred the terrain goes on in all directions, a hundred
//    times as large, with a hundred times as many triangles and statues, instances of the same
//    meshes.
//  - small, covering and large, looking to the horizon: as many objects in the same places, of a
//    hundredth, a tenth and all of their triangles. Triangles of the small scene are several pixels
//    large: it has less detail than the screen could show.
// Frames of all take turns in one renderer, when everything is baked.
#include <math.h>
#include <stdio.h>
#include <string.h>
#include <time.h>

#include "base/alloc.h"
#include "base/clock.h"
#include "base/json.h"
#include "renderer/bench/common.h"
#include "renderer/bench/depth.h"
#include "renderer/bench/scene.h"
#include "renderer/lod/lod.h"
#include "renderer/image/metrics.h"
#include "renderer/internal.h"

#define VFOV_RAD      0.8f
#define STILL_STATUES 24 // drawn whole for comparison
#define THIN          100
#define THIN_COVERING 10
#define BAKE_FROM     512       // triangles: the thin statue has levels as well
#define BAKE_POLL_NS  100000000 // between looks at what is baked

#define LOOK_DOWN   1.0f // metres per metre ahead: 45 degrees
#define GROWTH      100  // of triangles, from base to hundred
#define GROWTH_SIDE 10   // its root: copies of tiles per side

enum { SMALL, COVERING, LARGE, BASE, HUNDRED, SIDES, STILL = SIDES, SCENES };
static const char *const side_names[SIDES] = {"small", "covering", "large", "base", "hundred"};

struct run {
    const struct hg_bench_lod *bench;
    struct hg_image heights;              // empty: made
    struct hg_renderer *renderer, *whole; // whole: without levels of detail
    struct hg_bench_scene scenes[SCENES];
    struct hg_bench_view views[SCENES], whole_view;  // whole_view: of scenes[STILL]
    struct hg_bench_times frames[SIDES], cpu[SIDES]; // cpu: of all threads
    uint64_t triangles[SIDES], drawn[SIDES];
    double covered[SIDES]; // least share of the pixels of a frame that show something
    double psnr_db, flip;  // the worst of the stills
    uint64_t holes_px;     // all stills
    struct hg_bench_depth_gap depth;
    uint64_t rss_bytes;
    struct hg_geometry_stats geometry;
    uint64_t baked_triangles, baked_bytes, bake_ns; // of the scene of the stills
    uint32_t threads;
    uint32_t done, total;
};

static enum hg_status step_done(struct run *run, struct hg_error *err)
{
    return hg_bench_report_progress(&run->bench->stream, ++run->done, run->total, err);
}

// --- scenes --------------------------------------------------------------------------------------

static enum hg_status load_statue(struct run *run, struct hg_asset **out, struct hg_error *err)
{
    *out = NULL;
    if (run->bench->statue == NULL)
        return HG_OK;
    const struct hg_load_params params = {.path = run->bench->statue,
        .asset_number = 1,
        .scene_index = -1,
        .jobs = hg_renderer_jobs(run->renderer)};
    return hg_load_asset(&params, out, err);
}

static enum hg_status make_scene(
    struct run *run, int which, uint32_t tiles, uint32_t statues, struct hg_error *err)
{
    struct hg_bench_terrain terrain = {
        .heights = run->heights.pixels != NULL ? &run->heights : NULL,
        .tiles = tiles,
        .statues = statues,
        .cells = run->bench->cells,
        .thin = which == SMALL      ? THIN
                : which == COVERING ? THIN_COVERING
                                    : 0,
        .copies = which == HUNDRED ? GROWTH_SIDE : 1};
    enum hg_status status = load_statue(run, &terrain.statue, err);
    if (status == HG_OK) {
        status = hg_bench_terrain_make(
            &terrain, hg_renderer_jobs(run->renderer), &run->scenes[which], err);
    }
    const struct hg_view_params view = {.width = run->bench->stream.width,
        .height = run->bench->stream.height,
        .samples = run->bench->stream.samples};
    if (status == HG_OK) {
        status = hg_bench_view_init(
            &run->views[which], run->renderer, run->scenes[which].scene, &view, err);
    }
    run->views[which].vfov_rad = VFOV_RAD;
    return status == HG_OK ? step_done(run, err) : status;
}

// Until then the meshes would be drawn whole, which takes minutes per frame.
static enum hg_status wait_baked(struct run *run, int which, struct hg_error *err)
{
    struct hg_view_state *view = &run->views[which].view->state;
    const struct timespec pause = {.tv_nsec = BAKE_POLL_NS};
    enum hg_status status = HG_OK;
    do {
        status = hg_scene_gpu_sync(view->context, view->scene_gpu, view->camera.eye, 0, err);
        if (status == HG_OK && hg_geometry_baking(view->scene_gpu->geometry) > 0)
            nanosleep(&pause, NULL);
        run->done--; // the same step, told again
        if (status == HG_OK)
            status = step_done(run, err);
    } while (status == HG_OK && hg_geometry_baking(view->scene_gpu->geometry) > 0);
    return status == HG_OK ? step_done(run, err) : status;
}

static enum hg_status open_scenes(struct run *run, struct hg_error *err)
{
    const struct hg_bench_lod *b = run->bench;
    struct hg_renderer_params params = *b->stream.renderer;
    params.texture_budget_bytes = 0;
    params.geometry_budget_bytes = b->stream.budget_bytes;
    enum hg_status status = hg_renderer_create(&params, &run->renderer, err);
    if (status == HG_OK && b->heights != NULL)
        status = hg_image_read_file(b->heights, HG_PIXEL_RGBA16, NULL, &run->heights, err);
    if (status == HG_OK)
        run->renderer->context.bake_from = BAKE_FROM;
    const uint32_t sparse = b->statues / GROWTH;
    for (int side = 0; side < SIDES && status == HG_OK; side++)
        status = make_scene(run, side, b->tiles, side == BASE ? sparse : b->statues, err);
    const uint32_t few = b->statues < STILL_STATUES ? b->statues : STILL_STATUES;
    if (status == HG_OK)
        status = make_scene(run, STILL, 1, few, err);
    hg_image_finish(&run->heights);
    for (int i = 0; i < SCENES && status == HG_OK; i++)
        status = wait_baked(run, i, err);
    return status;
}

// --- measurements --------------------------------------------------------------------------------

static void pose_of(int side, uint32_t at, uint32_t count, struct hg_bench_pose *pose)
{
    hg_bench_terrain_pose(at, count, pose);
    if (side == BASE || side == HUNDRED)
        pose->target[1] = pose->eye[1] - LOOK_DOWN;
}

// The least share of the pixels of a frame that show something.
static enum hg_status note_covered(struct run *run, uint32_t side, struct hg_error *err)
{
    struct hg_bench_depth depth = {0};
    const enum hg_status status = hg_bench_depth_read(run->views[side].view, &depth, err);
    const size_t count = (size_t)depth.width * depth.height;
    size_t shown = 0;
    for (size_t i = 0; status == HG_OK && i < count; i++)
        shown += isfinite(depth.metres[i]) ? 1 : 0;
    if (status == HG_OK)
        run->covered[side] = fmin(run->covered[side], (double)shown / (double)count);
    hg_bench_depth_finish(&depth);
    return status;
}

static enum hg_status visit_all(struct run *run, struct hg_error *err)
{
    const uint32_t frames = run->bench->stream.frames;
    enum hg_status status = HG_OK;
    for (uint32_t i = 0; i < SIDES * frames && status == HG_OK; i++) {
        struct hg_bench_pose pose;
        uint64_t ns;
        pose_of((int)(i % SIDES), i / SIDES, frames, &pose);
        status = hg_bench_view_sharpen(&run->views[i % SIDES], &pose, &ns, err);
        if (status == HG_OK)
            status = step_done(run, err);
    }
    return status;
}

static enum hg_status fly(struct run *run, struct hg_error *err)
{
    const uint32_t frames = run->bench->stream.frames;
    enum hg_status status = HG_OK;
    for (uint32_t i = 0; i < SIDES * frames && status == HG_OK; i++) {
        const uint32_t at = i / SIDES, turn = i % SIDES;
        const uint32_t side = at % 2 == 0 ? turn : SIDES - 1 - turn;
        struct hg_bench_pose pose;
        uint64_t ns;
        pose_of((int)side, at, frames, &pose);
        const uint64_t cpu = hg_clock_cpu_ns();
        status = hg_bench_view_draw(&run->views[side], &pose, &ns, err);
        const uint64_t cpu_ns = hg_clock_cpu_ns() - cpu;
        if (status == HG_OK && (hg_bench_times_add(&run->frames[side], ns) != HG_OK ||
                                   hg_bench_times_add(&run->cpu[side], cpu_ns) != HG_OK))
            status = hg_error_set(err, HG_E_NOMEM, "bench", NULL, "out of host memory");
        const struct hg_frame_info *info = &run->views[side].info;
        run->triangles[side] = info->triangles_total;
        run->drawn[side] =
            info->triangles_drawn > run->drawn[side] ? info->triangles_drawn : run->drawn[side];
        if (status == HG_OK)
            status = note_covered(run, side, err);
        if (status == HG_OK)
            status = step_done(run, err);
    }
    return status;
}

static bool is_covered(const struct hg_image *image, uint32_t x, uint32_t y)
{
    return ((const uint8_t *)image->pixels)[4 * ((size_t)y * image->width + x) + 3] == 255;
}

// Pixels that a picture lets through although the full one covers them and all their neighbours.
static uint64_t count_holes(const struct hg_image *lod, const struct hg_image *full)
{
    uint64_t holes = 0;
    for (uint32_t y = 1; y + 1 < full->height; y++) {
        for (uint32_t x = 1; x + 1 < full->width; x++) {
            bool inside = !is_covered(lod, x, y);
            for (uint32_t k = 0; k < 9 && inside; k++)
                inside = is_covered(full, x + k % 3 - 1, y + k / 3 - 1);
            holes += inside;
        }
    }
    return holes;
}

static enum hg_status compare_depth(struct run *run, struct hg_error *err)
{
    struct hg_bench_depth levels = {0}, whole = {0};
    const float error_px = run->views[STILL].info.error_px;
    enum hg_status status = hg_bench_depth_read(run->views[STILL].view, &levels, err);
    if (status == HG_OK)
        status = hg_bench_depth_read(run->whole_view.view, &whole, err);
    if (status == HG_OK) {
        const struct hg_bench_depth_gap gap = hg_bench_depth_compare(&levels, &whole, error_px);
        run->depth.shown_px += gap.shown_px;
        run->depth.off_px += gap.off_px;
        run->depth.far_px += gap.far_px;
    }
    hg_bench_depth_finish(&levels);
    hg_bench_depth_finish(&whole);
    return status;
}

static enum hg_status compare_still(struct run *run, uint32_t index, struct hg_error *err)
{
    struct hg_image images[2] = {{0}};
    struct hg_bench_pose pose;
    double psnr_db = 0, flip = 1;
    hg_bench_terrain_pose(2 * index + 1, 2 * run->bench->stream.stills, &pose);
    enum hg_status status = hg_bench_view_settle(&run->views[STILL], &pose, &images[0], err);
    if (status == HG_OK)
        status = hg_bench_view_settle(&run->whole_view, &pose, &images[1], err);
    if (status == HG_OK)
        status = hg_image_compare(&(struct hg_image_pair){&images[0], &images[1], NULL},
            HG_METRIC_PSNR, &psnr_db, NULL, err);
    if (status == HG_OK)
        status = hg_image_compare(&(struct hg_image_pair){&images[0], &images[1], NULL},
            HG_METRIC_FLIP, &flip, NULL, err);
    if (status == HG_OK)
        status = compare_depth(run, err);
    if (status == HG_OK)
        run->holes_px += count_holes(&images[0], &images[1]);
    run->psnr_db = fmin(run->psnr_db, psnr_db);
    run->flip = fmax(run->flip, flip);
    hg_image_finish(&images[0]);
    hg_image_finish(&images[1]);
    return status == HG_OK ? step_done(run, err) : status;
}

// A terrain mesh and the statue, baked in memory.
static enum hg_status bake_meshes(struct run *run, struct hg_error *err)
{
    const struct hg_object_list *list = &run->scenes[STILL].scene->objects[HG_OBJECT_MESH];
    struct hg_jobs *jobs = hg_renderer_jobs(run->renderer);
    enum hg_status status = HG_OK;
    run->threads = hg_jobs_threads(jobs);
    for (uint32_t i = 0; i < list->count && status == HG_OK; i++) {
        const struct hg_mesh *mesh = (const struct hg_mesh *)list->items[i];
        const struct hg_lod_params params = {.jobs = jobs};
        struct hg_lod_report report;
        uint8_t *data = NULL;
        size_t size = 0;
        if (mesh->part_count == 0 || !hg_lod_can_bake(&mesh->parts[0], mesh->target_count))
            continue;
        status = hg_lod_bake(&mesh->parts[0], &params, &data, &size, &report, err);
        hg_free(data);
        if (status != HG_OK)
            break;
        run->baked_triangles += report.source_triangles;
        run->baked_bytes += size;
        run->bake_ns += report.total_ns;
    }
    return status == HG_OK ? step_done(run, err) : status;
}

// The same scene in a renderer that draws the meshes as they are.
static enum hg_status compare_stills(struct run *run, struct hg_error *err)
{
    const struct hg_view_params view = {.width = run->bench->stream.width,
        .height = run->bench->stream.height,
        .samples = run->bench->stream.samples,
        .background = HG_BACKGROUND_NONE};
    struct hg_renderer_params params = *run->bench->stream.renderer;
    params.texture_budget_bytes = params.geometry_budget_bytes = 0;
    enum hg_status status = hg_renderer_create(&params, &run->whole, err);
    if (status == HG_OK) {
        run->whole->context.bake_from = HG_GEOMETRY_BAKE_NONE;
        status =
            hg_bench_view_init(&run->whole_view, run->whole, run->scenes[STILL].scene, &view, err);
    }
    run->whole_view.vfov_rad = VFOV_RAD;
    if (status == HG_OK)
        status = hg_view_set_params(run->views[STILL].view, &view, err);
    run->psnr_db = 999;
    for (uint32_t i = 0; i < run->bench->stream.stills && status == HG_OK; i++)
        status = compare_still(run, i, err);
    return status;
}

// --- report --------------------------------------------------------------------------------------

static double ratio(const struct hg_bench_times *more, const struct hg_bench_times *less)
{
    const double base = hg_bench_times_at(less, 0.5);
    return base > 0 ? hg_bench_times_at(more, 0.5) / base : 0;
}

static double triangle_ratio(const struct run *run, int more, int less)
{
    return (double)run->triangles[more] /
           (double)(run->triangles[less] > 0 ? run->triangles[less] : 1);
}

static void put_side(const struct run *run, int side, struct hg_writer *w)
{
    char key[32];
    hg_json_put(w, ",\"%s_triangles\":%llu,\"%s_drawn\":%llu,\"%s_covered\":%.5f,",
        side_names[side], (unsigned long long)run->triangles[side], side_names[side],
        (unsigned long long)run->drawn[side], side_names[side], run->covered[side]);
    snprintf(key, sizeof key, "%s_ms", side_names[side]);
    hg_bench_put_times(w, key, &run->frames[side]);
    hg_json_put(w, ",");
    snprintf(key, sizeof key, "%s_cpu_ms", side_names[side]);
    hg_bench_put_times(w, key, &run->cpu[side]);
}

static void put_scale(const struct run *run, struct hg_writer *w)
{
    hg_json_put(w,
        "\"scale\":{\"triangle_ratio\":%.3f,\"frame_time_ratio\":%.4f,\"cpu_time_ratio\":%.4f,",
        triangle_ratio(run, HUNDRED, BASE), ratio(&run->frames[HUNDRED], &run->frames[BASE]),
        ratio(&run->cpu[HUNDRED], &run->cpu[BASE]));
    hg_json_put(w,
        "\"thin_triangle_ratio\":%.3f,\"thin_frame_time_ratio\":%.4f,\"thin_cpu_time_ratio\":%.4f,",
        triangle_ratio(run, LARGE, SMALL), ratio(&run->frames[LARGE], &run->frames[SMALL]),
        ratio(&run->cpu[LARGE], &run->cpu[SMALL]));
    hg_json_put(w,
        "\"covered_triangle_ratio\":%.3f,\"covered_frame_time_ratio\":%.4f,"
        "\"covered_cpu_time_ratio\":%.4f,\"large_unique_triangles\":%llu,"
        "\"hundred_unique_triangles\":%llu",
        triangle_ratio(run, LARGE, COVERING), ratio(&run->frames[LARGE], &run->frames[COVERING]),
        ratio(&run->cpu[LARGE], &run->cpu[COVERING]),
        (unsigned long long)run->scenes[LARGE].unique_triangles,
        (unsigned long long)run->scenes[HUNDRED].unique_triangles);
    for (int side = 0; side < SIDES; side++)
        put_side(run, side, w);
    hg_json_put(w, "}");
}

static enum hg_status write_report(const struct run *run, char **text)
{
    struct hg_writer w = {0};
    const struct hg_bench_stream *s = &run->bench->stream;
    hg_json_put(&w, "{\"width\":%u,\"height\":%u,", s->width, s->height);
    put_scale(run, &w);
    hg_json_put(&w,
        ",\"image\":{\"psnr_db\":%.3f,\"flip\":%.6f,\"holes_px\":%llu,\"depth_off_px\":%llu,"
        "\"depth_far_px\":%llu,"
        "\"depth_px\":%llu,"
        "\"pictures\":%u}",
        run->psnr_db, run->flip, (unsigned long long)run->holes_px,
        (unsigned long long)run->depth.off_px, (unsigned long long)run->depth.far_px,
        (unsigned long long)run->depth.shown_px, s->stills);
    const double triangles = run->baked_triangles > 0 ? (double)run->baked_triangles : 1;
    const double seconds = run->bake_ns > 0 ? (double)run->bake_ns * 1e-9 : 1;
    hg_json_put(&w,
        ",\"disk\":{\"bytes_per_triangle\":%.4f},\"bake\":{\"triangles_per_s\":%.0f,"
        "\"triangles\":%llu,\"threads\":%u}",
        (double)run->baked_bytes / triangles, (double)run->baked_triangles / seconds,
        (unsigned long long)run->baked_triangles, run->threads);
    hg_json_put(&w,
        ",\"geometry\":{\"budget_bytes\":%llu,\"peak_bytes\":%llu},\"process\":{\"peak_rss_bytes\":"
        "%llu},\"device\":",
        (unsigned long long)s->budget_bytes, (unsigned long long)run->geometry.peak_bytes,
        (unsigned long long)run->rss_bytes);
    hg_json_string(&w, hg_gpu_get_caps(run->renderer->gpu)->device_name);
    hg_json_put(&w, "}");
    return hg_json_take(&w, text);
}

// --- the benchmark -------------------------------------------------------------------------------

static void set_defaults(struct hg_bench_lod *b)
{
    struct hg_bench_stream *s = &b->stream;
    s->budget_bytes = s->budget_bytes > 0 ? s->budget_bytes : UINT64_C(512) << 20;
    s->width = hg_bench_or(s->width, 1280);
    s->height = hg_bench_or(s->height, 720);
    s->frames = hg_bench_or(s->frames, 6);
    s->stills = hg_bench_or(s->stills, 1);
    s->samples = hg_bench_or(s->samples, 8);
    b->cells = hg_bench_or(b->cells, 1200);
    b->tiles = hg_bench_or(b->tiles, 3);
    b->statues = hg_bench_or(b->statues, 1440);
}

static enum hg_status measure(struct run *run, struct hg_error *err)
{
    enum hg_status status = open_scenes(run, err);
    if (status == HG_OK)
        status = visit_all(run, err);
    if (status == HG_OK)
        status = fly(run, err);
    if (status == HG_OK)
        status = compare_stills(run, err);
    if (status == HG_OK)
        status = bake_meshes(run, err);
    if (status == HG_OK) {
        struct hg_view_report report;
        hg_view_get_report(run->views[LARGE].view, &report);
        run->geometry = report.geometry;
    }
    run->rss_bytes = hg_renderer_peak_rss_bytes();
    return status;
}

enum hg_status hg_bench_lod_run(const struct hg_bench_lod *bench, char **text, struct hg_error *err)
{
    *text = NULL;
    struct hg_bench_lod full = *bench;
    set_defaults(&full);
    struct run run = {.bench = &full,
        .total = 2 * SCENES + 1 + 2 * SIDES * full.stream.frames + full.stream.stills};
    for (int side = 0; side < SIDES; side++)
        run.covered[side] = 1;
    enum hg_status status = measure(&run, err);
    if (status == HG_OK)
        status = write_report(&run, text);
    hg_bench_view_finish(&run.whole_view);
    hg_renderer_destroy(run.whole);
    for (int i = 0; i < SCENES; i++) {
        hg_bench_view_finish(&run.views[i]);
        hg_bench_scene_finish(&run.scenes[i]);
    }
    for (int side = 0; side < SIDES; side++) {
        hg_bench_times_finish(&run.frames[side]);
        hg_bench_times_finish(&run.cpu[side]);
    }
    hg_image_finish(&run.heights);
    hg_renderer_destroy(run.renderer);
    return status;
}
