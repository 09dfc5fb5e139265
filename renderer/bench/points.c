// points.c - a cloud of many points: what baking it takes, and frames of a flight over it under the
// geometry budget (helio bench points).
//
// The cloud is a scan of a made terrain: points lie at random over a square, at the height of value
// noise, in colours of their height, without normals. It is the same for the same number of points.
#include <math.h>
#include <string.h>
#include <time.h>

#include "base/alloc.h"
#include "base/clock.h"
#include "base/json.h"
#include "base/spill.h"
#include "renderer/bench/common.h"
#include "renderer/bench/mesh.h"
#include "renderer/internal.h"

#define SIDE_M         1000.0f
#define RELIEF_M       120.0f
#define VFOV_RAD       0.8f
#define BAKE_POLL_NS   100000000
#define BLOCK          65536u // points that one job makes
#define SHARPEN_FRAMES 1000u  // of a pose, at most
#define SWAY_M         1e-3f

struct run {
    const struct hg_bench_points *bench;
    struct hg_renderer *renderer;
    struct hg_bench_scene scene;
    struct hg_bench_view view;
    struct hg_bench_times frames, sharp; // sharp: from a jump to a frame with nothing missing
    struct hg_geometry_stats geometry;
    uint64_t make_ns, bake_ns, bake_cpu_ns, settle_ns;
    uint64_t drawn, missing_frames, unsharp_poses, baked_rss_bytes, rss_bytes;
    float error_px; // largest of a frame
    double covered; // of the settled picture
    uint32_t done, total;
};

static enum hg_status step_done(struct run *run, struct hg_error *err)
{
    return hg_bench_report_progress(&run->bench->stream, ++run->done, run->total, err);
}

// --- the cloud -----------------------------------------------------------------------------------

static float height_at(float u, float v)
{
    float height = 0.0f;
    for (uint32_t o = 0; o < 5; o++) {
        const float f = 4.0f * (float)(1u << o);
        height += hg_bench_noise(o + 1, u * f, v * f) / (float)(1u << o);
    }
    return height * 0.5f * RELIEF_M;
}

static float random_unit(uint64_t *state)
{
    *state = *state * 6364136223846793005ull + 1442695040888963407ull;
    return (float)(*state >> 40) * 0x1p-24f;
}

static void make_block(void *user, size_t block)
{
    struct hg_mesh_part *part = user;
    uint64_t state = 0x9e3779b97f4a7c15ull * (block + 1);
    const size_t first = block * BLOCK, left = part->vertex_count - first;
    for (size_t i = first; i < first + (left < BLOCK ? left : BLOCK); i++) {
        const float u = random_unit(&state), v = random_unit(&state), h = height_at(u, v);
        const float share = h / RELIEF_M;
        const float at[3] = {(u - 0.5f) * SIDE_M, h, (v - 0.5f) * SIDE_M};
        const float color[4] = {0.2f + 0.5f * share, 0.35f, 0.5f - 0.4f * share, 1.0f};
        part->indices[i] = (uint32_t)i;
        memcpy(part->positions + i * 3, at, sizeof at);
        memcpy(part->colors + i * 4, color, sizeof color);
    }
}

static enum hg_status make_cloud(struct run *run, struct hg_mesh *mesh)
{
    const uint32_t n = run->bench->points;
    struct hg_mesh_part *part = mesh->parts = hg_calloc(1, sizeof *mesh->parts);
    if (part == NULL)
        return HG_E_NOMEM;
    mesh->part_count = 1;
    part->topology = HG_TOPOLOGY_POINTS;
    part->indices = hg_spill_calloc(n, 4);
    part->positions = hg_spill_calloc(n, 12);
    part->colors = hg_spill_calloc(n, 16);
    if (part->indices == NULL || part->positions == NULL || part->colors == NULL)
        return HG_E_NOMEM;
    part->vertex_count = part->index_count = n;
    hg_jobs_for(hg_renderer_jobs(run->renderer), (n + BLOCK - 1) / BLOCK, make_block, part);
    for (int k = 0; k < 3; k++) {
        part->bounds_min[k] = k == 1 ? 0.0f : -0.5f * SIDE_M;
        part->bounds_max[k] = k == 1 ? RELIEF_M : 0.5f * SIDE_M;
    }
    return HG_OK;
}

static enum hg_status make_scene(struct run *run, struct hg_error *err)
{
    struct hg_mesh *mesh;
    struct hg_node *node;
    const uint64_t start = hg_clock_now_ns();
    hg_spill_begin("points");
    enum hg_status status = hg_bench_scene_begin(&run->scene, 0);
    if (status == HG_OK)
        status = hg_bench_scene_add(&run->scene, HG_OBJECT_MESH, &mesh);
    if (status == HG_OK)
        status = make_cloud(run, mesh);
    if (status == HG_OK)
        status = hg_bench_scene_add(&run->scene, HG_OBJECT_NODE, &node);
    hg_spill_end();
    if (status != HG_OK)
        return hg_error_set(err, status, "bench", NULL, "no memory for the points");
    node->mesh = mesh;
    hg_bench_scene_sky(&run->scene);
    run->make_ns = hg_clock_now_ns() - start;
    return step_done(run, err);
}

// --- measurements --------------------------------------------------------------------------------

static enum hg_status wait_baked(struct run *run, struct hg_error *err)
{
    struct hg_view_state *view = &run->view.view->state;
    const struct timespec pause = {.tv_nsec = BAKE_POLL_NS};
    const uint64_t start = hg_clock_now_ns(), cpu_start = hg_clock_cpu_ns();
    enum hg_status status = HG_OK;
    do {
        status = hg_scene_gpu_sync(view->context, view->scene_gpu, view->camera.eye, 0, err);
        if (status == HG_OK && hg_geometry_baking(view->scene_gpu->geometry) > 0)
            nanosleep(&pause, NULL);
        run->done--; // the same step again
        if (status == HG_OK)
            status = step_done(run, err);
    } while (status == HG_OK && hg_geometry_baking(view->scene_gpu->geometry) > 0);
    run->bake_ns = hg_clock_now_ns() - start;
    run->bake_cpu_ns = hg_clock_cpu_ns() - cpu_start;
    run->baked_rss_bytes = hg_renderer_peak_rss_bytes();
    return status == HG_OK ? step_done(run, err) : status;
}

// From all of the terrain to the stones, around its middle.
static void pose_of(uint32_t at, uint32_t count, struct hg_bench_pose *pose)
{
    const float t = (float)at / (float)(count > 1 ? count - 1 : 1), turn = 2.0f * t;
    const float distance = 0.9f * SIDE_M * powf(0.02f, t);
    *pose = (struct hg_bench_pose){
        .eye = {distance * sinf(turn), RELIEF_M * (1.0f - t) + 0.6f * distance + 60.0f * t,
            distance * cosf(turn)},
        .target = {0, height_at(0.5f, 0.5f), 0}};
}

// Frames in motion until nothing is missing: where the cut does not fit the budget, the error that
// the frame reports grows until it does. Views at rest would be drawn in parts instead.
static enum hg_status sharpen(
    struct run *run, const struct hg_bench_pose *pose, uint64_t *ns, struct hg_error *err)
{
    const uint64_t start = hg_clock_now_ns();
    enum hg_status status = HG_OK;
    struct hg_bench_pose at = *pose;
    for (uint32_t i = 0; i < SHARPEN_FRAMES && status == HG_OK; i++) {
        at.eye[0] = pose->eye[0] + (float)(i % 2) * SWAY_M;
        status = hg_bench_view_draw(&run->view, &at, ns, err);
        if (run->view.info.missing_clusters == 0)
            break;
    }
    *ns = hg_clock_now_ns() - start;
    run->unsharp_poses += status == HG_OK && run->view.info.missing_clusters > 0;
    return status;
}

static enum hg_status fly(struct run *run, struct hg_error *err)
{
    const uint32_t frames = run->bench->stream.frames;
    enum hg_status status = HG_OK;
    for (uint32_t i = 0; i < frames && status == HG_OK; i++) {
        struct hg_bench_pose pose;
        uint64_t frame_ns = 0, sharp_ns = 0;
        pose_of(i, frames, &pose);
        status = hg_bench_view_draw(&run->view, &pose, &frame_ns, err);
        run->missing_frames += run->view.info.missing_clusters > 0;
        if (status == HG_OK)
            status = sharpen(run, &pose, &sharp_ns, err);
        if (status == HG_OK)
            status = hg_bench_view_draw(&run->view, &pose, &frame_ns, err);
        if (status == HG_OK && (hg_bench_times_add(&run->frames, frame_ns) != HG_OK ||
                                   hg_bench_times_add(&run->sharp, sharp_ns) != HG_OK))
            status = hg_error_set(err, HG_E_NOMEM, "bench", NULL, "out of host memory");
        const uint64_t drawn = run->view.info.triangles_drawn;
        run->drawn = drawn > run->drawn ? drawn : run->drawn;
        run->error_px = fmaxf(run->error_px, run->view.info.error_px);
        if (status == HG_OK)
            status = step_done(run, err);
    }
    return status;
}

static enum hg_status settle(struct run *run, struct hg_error *err)
{
    struct hg_bench_pose pose;
    struct hg_image picture = {0};
    const uint64_t start = hg_clock_now_ns();
    pose_of(0, 2, &pose);
    enum hg_status status = hg_bench_view_settle(&run->view, &pose, &picture, err);
    run->settle_ns = hg_clock_now_ns() - start;
    size_t shown = 0;
    const size_t count = (size_t)picture.width * picture.height;
    for (size_t i = 0; status == HG_OK && i < count; i++)
        shown += ((const uint8_t *)picture.pixels)[i * 4 + 3] == 255;
    run->covered = count > 0 ? (double)shown / (double)count : 0.0;
    hg_image_finish(&picture);
    return status == HG_OK ? step_done(run, err) : status;
}

static enum hg_status measure(struct run *run, struct hg_error *err)
{
    const struct hg_bench_stream *s = &run->bench->stream;
    struct hg_renderer_params params = *s->renderer;
    params.texture_budget_bytes = 0;
    params.geometry_budget_bytes = s->budget_bytes;
    const struct hg_view_params view = {.width = s->width,
        .height = s->height,
        .samples = s->samples,
        .background = HG_BACKGROUND_NONE};
    enum hg_status status = hg_renderer_create(&params, &run->renderer, err);
    if (status == HG_OK)
        status = make_scene(run, err);
    if (status == HG_OK)
        status = hg_bench_view_init(&run->view, run->renderer, run->scene.scene, &view, err);
    run->view.vfov_rad = VFOV_RAD;
    if (status == HG_OK)
        status = wait_baked(run, err);
    if (status == HG_OK)
        status = fly(run, err);
    if (status == HG_OK)
        status = settle(run, err);
    if (status == HG_OK) {
        struct hg_view_report report;
        hg_view_get_report(run->view.view, &report);
        run->geometry = report.geometry;
    }
    run->rss_bytes = hg_renderer_peak_rss_bytes();
    return status;
}

// --- report --------------------------------------------------------------------------------------

static enum hg_status write_report(const struct run *run, char **text)
{
    struct hg_writer w = {0};
    const struct hg_bench_stream *s = &run->bench->stream;
    hg_json_put(&w,
        "{\"width\":%u,\"height\":%u,\"points\":%u,\"make_ms\":%.1f,\"bake_ms\":%.1f,"
        "\"bake_cpu_ms\":%.1f,",
        s->width, s->height, run->bench->points, (double)run->make_ns * 1e-6,
        (double)run->bake_ns * 1e-6, (double)run->bake_cpu_ns * 1e-6);
    hg_bench_put_times(&w, "frame_ms", &run->frames);
    hg_json_put(&w, ",");
    hg_bench_put_times(&w, "sharp_ms", &run->sharp);
    hg_json_put(&w,
        ",\"triangles_drawn\":%llu,\"frames_missing\":%llu,\"poses_missing\":%llu,"
        "\"error_px\":%.2f,\"settle_ms\":%.1f,\"covered\":%.5f",
        (unsigned long long)run->drawn, (unsigned long long)run->missing_frames,
        (unsigned long long)run->unsharp_poses, (double)run->error_px,
        (double)run->settle_ns * 1e-6, run->covered);
    hg_json_put(&w,
        ",\"geometry\":{\"budget_bytes\":%llu,\"peak_bytes\":%llu},\"process\":{\"baked_"
        "peak_rss_bytes\":%llu,\"peak_rss_bytes\":%llu},\"device\":",
        (unsigned long long)s->budget_bytes, (unsigned long long)run->geometry.peak_bytes,
        (unsigned long long)run->baked_rss_bytes, (unsigned long long)run->rss_bytes);
    hg_json_string(&w, hg_gpu_get_caps(run->renderer->gpu)->device_name);
    hg_json_put(&w, "}");
    return hg_json_take(&w, text);
}

enum hg_status hg_bench_points_run(
    const struct hg_bench_points *bench, char **text, struct hg_error *err)
{
    struct hg_bench_points full = *bench;
    struct hg_bench_stream *s = &full.stream;
    *text = NULL;
    s->budget_bytes = s->budget_bytes > 0 ? s->budget_bytes : UINT64_C(512) << 20;
    s->width = hg_bench_or(s->width, 1280);
    s->height = hg_bench_or(s->height, 720);
    s->frames = hg_bench_or(s->frames, 6);
    s->samples = hg_bench_or(s->samples, 8);
    full.points = hg_bench_or(full.points, 100000000);
    struct run run = {.bench = &full, .total = s->frames + 3};
    enum hg_status status = measure(&run, err);
    if (status == HG_OK)
        status = write_report(&run, text);
    hg_bench_view_finish(&run.view);
    hg_bench_scene_finish(&run.scene);
    hg_bench_times_finish(&run.frames);
    hg_bench_times_finish(&run.sharp);
    hg_renderer_destroy(run.renderer);
    return status;
}
