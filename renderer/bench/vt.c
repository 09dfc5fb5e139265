// vt.c - textures larger than their budget (helio bench vt).
//
// Two renderers look at the same gallery: one streams under the budget, one has no budget and has
// seen every pose before it is measured. Frames of both alternate, so that what else the machine
// does hits both alike. Then pages are sampled by the host, beside OpenImageIO's texture system.
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/alloc.h"
#include "base/clock.h"
#include "base/json.h"
#include "renderer/bench/common.h"
#include "renderer/bench/oiio_baseline.h"
#include "renderer/bench/prefetch.h"
#include "renderer/bench/scene.h"
#include "renderer/image/metrics.h"
#include "renderer/internal.h"

#define VFOV_RAD   0.8f
#define ZOOM_STEPS 24

enum {
    BASELINE_MADE = 6,
    BASELINE_SIDE_PX = 2048
}; // most made textures beside files, and their sides

enum { STREAMED, RESIDENT, SIDES };

struct sheet_result {
    uint32_t side_px;
    struct hg_bench_times sharp;
    float texel_error; // largest difference of a channel at texel scale, 0..255
    uint64_t peak_bytes;
};

struct run {
    const struct hg_bench_vt *bench;
    struct hg_bench_gallery gallery;
    struct hg_bench_scene scene;
    struct hg_renderer *renderers[SIDES];
    struct hg_bench_view views[SIDES];
    struct hg_bench_times frames[SIDES], teleports;
    uint64_t missing_frames, missing_pages; // of the flight, streamed
    uint64_t set_bytes;                     // of the gallery's textures
    uint32_t stills_same;
    double still_max; // largest difference of stills, 0..1
    struct hg_textures_stats streamed;
    uint64_t rss_bytes, rss_before_bytes;
    struct sheet_result *sheets;
    struct hg_bench_prefetch_result prefetch;
    struct hg_bench_oiio_params baseline;
    struct hg_bench_oiio_result baseline_result;
    char device[256];
    uint32_t done, total;
};

static enum hg_status step_done(struct run *run, struct hg_error *err)
{
    return hg_bench_report_progress(&run->bench->stream, ++run->done, run->total, err);
}

static struct hg_bench_pose flight(const struct run *run, uint32_t at, uint32_t count)
{
    struct hg_bench_pose pose;
    hg_bench_gallery_pose(&run->gallery, at, count, &pose);
    return pose;
}

// --- sides ---------------------------------------------------------------------------------------

static enum hg_status open_side(struct run *run, int side, struct hg_error *err)
{
    const struct hg_bench_stream *s = &run->bench->stream;
    struct hg_renderer_params params = *s->renderer;
    params.texture_budget_bytes = side == STREAMED ? s->budget_bytes : 0;
    params.geometry_budget_bytes = 0;
    const struct hg_view_params view = {
        .width = s->width, .height = s->height, .samples = s->samples};
    enum hg_status status = hg_renderer_create(&params, &run->renderers[side], err);
    if (status == HG_OK)
        status = hg_bench_view_init(
            &run->views[side], run->renderers[side], run->scene.scene, &view, err);
    run->views[side].vfov_rad = VFOV_RAD;
    return status;
}

static void close_side(struct run *run, int side)
{
    hg_bench_view_finish(&run->views[side]);
    hg_renderer_destroy(run->renderers[side]);
    run->renderers[side] = NULL;
}

// Nothing is missing anywhere on the flight afterwards, as long as it all fits.
static enum hg_status visit_all(struct run *run, int side, struct hg_error *err)
{
    enum hg_status status = HG_OK;
    for (uint32_t i = 0; i < run->bench->stream.frames && status == HG_OK; i++) {
        const struct hg_bench_pose pose = flight(run, i, run->bench->stream.frames);
        uint64_t ns;
        status = hg_bench_view_sharpen(&run->views[side], &pose, &ns, err);
        if (status == HG_OK)
            status = step_done(run, err);
    }
    return status;
}

// --- measurements --------------------------------------------------------------------------------

// Jumps between places far from each other.
static enum hg_status teleport(struct run *run, struct hg_error *err)
{
    const uint32_t count = run->bench->teleports;
    enum hg_status status = HG_OK;
    for (uint32_t i = 0; i < count && status == HG_OK; i++) {
        const struct hg_bench_pose pose = flight(run, (uint32_t)((uint64_t)i * 7919 % 1009), 1009);
        uint64_t ns;
        status = hg_bench_view_sharpen(&run->views[STREAMED], &pose, &ns, err);
        if (status == HG_OK && hg_bench_times_add(&run->teleports, ns) != HG_OK)
            status = hg_error_set(err, HG_E_NOMEM, "bench", NULL, "out of host memory");
        if (status == HG_OK)
            status = step_done(run, err);
    }
    return status;
}

static enum hg_status fly(struct run *run, struct hg_error *err)
{
    const uint32_t frames = run->bench->stream.frames;
    enum hg_status status = HG_OK;
    for (uint32_t i = 0; i < 2 * frames && status == HG_OK; i++) {
        const struct hg_bench_pose pose = flight(run, i / 2, frames);
        const int side = (i % 2 == 0) == (i / 2 % 2 == 0) ? STREAMED : RESIDENT;
        uint64_t ns;
        status = hg_bench_view_draw(&run->views[side], &pose, &ns, err);
        if (status == HG_OK && hg_bench_times_add(&run->frames[side], ns) != HG_OK)
            status = hg_error_set(err, HG_E_NOMEM, "bench", NULL, "out of host memory");
        if (side == STREAMED) {
            run->missing_frames += run->views[side].info.missing_pages > 0;
            run->missing_pages += run->views[side].info.missing_pages;
        }
        if (status == HG_OK)
            status = step_done(run, err);
    }
    return status;
}

static enum hg_status compare_still(struct run *run, uint32_t index, struct hg_error *err)
{
    const struct hg_bench_pose pose = flight(run, index * 2 + 1, run->bench->stream.stills * 2);
    struct hg_image images[SIDES] = {{0}};
    double difference = 1;
    enum hg_status status = HG_OK;
    for (int side = 0; side < SIDES && status == HG_OK; side++)
        status = hg_bench_view_settle(&run->views[side], &pose, &images[side], err);
    if (status == HG_OK) {
        const struct hg_image_pair pair = {&images[STREAMED], &images[RESIDENT], NULL};
        status = hg_image_compare(&pair, HG_METRIC_MAX, &difference, NULL, err);
    }
    run->still_max = fmax(run->still_max, difference);
    run->stills_same += difference == 0;
    for (int side = 0; side < SIDES; side++)
        hg_image_finish(&images[side]);
    return status == HG_OK ? step_done(run, err) : status;
}

static enum hg_status measure_gallery(struct run *run, struct hg_error *err)
{
    const struct hg_bench_vt *b = run->bench;
    run->gallery = (struct hg_bench_gallery){.made = b->made,
        .side_px = b->side_px,
        .images = b->images,
        .image_count = b->image_count,
        .panels = 4 * (b->made + b->image_count)};
    for (uint32_t i = 0; i < b->image_count; i++) {
        struct hg_image_info info;
        enum hg_status status = hg_image_probe_file(b->images[i], &info, err);
        if (status != HG_OK)
            return status;
        run->gallery.image_texels += (uint64_t)info.width * info.height;
    }
    run->rss_before_bytes = hg_renderer_peak_rss_bytes();
    enum hg_status status = hg_bench_gallery_make(&run->gallery, &run->scene, err);
    if (status == HG_OK)
        status = open_side(run, STREAMED, err);
    if (status == HG_OK) // whatever is made of the images once is made here
        status = visit_all(run, STREAMED, err);
    if (status == HG_OK)
        status = teleport(run, err);
    run->rss_bytes = hg_renderer_peak_rss_bytes();
    run->set_bytes = run->scene.texture_bytes;
    if (status == HG_OK)
        status = open_side(run, RESIDENT, err);
    if (status == HG_OK)
        status = visit_all(run, RESIDENT, err);
    if (status == HG_OK)
        status = fly(run, err);
    for (uint32_t i = 0; i < b->stream.stills && status == HG_OK; i++)
        status = compare_still(run, i, err);
    if (status == HG_OK) {
        struct hg_view_report report;
        hg_view_get_report(run->views[STREAMED].view, &report);
        run->streamed = report.textures;
        snprintf(run->device, sizeof run->device, "%s",
            hg_gpu_get_caps(run->renderers[STREAMED]->gpu)->device_name);
    }
    for (int side = 0; side < SIDES; side++)
        close_side(run, side);
    return status;
}

static enum hg_status measure_prefetch(struct run *run, struct hg_error *err)
{
    struct hg_renderer_params params = *run->bench->stream.renderer;
    params.texture_budget_bytes = run->bench->stream.budget_bytes;
    params.geometry_budget_bytes = 0;
    const struct hg_bench_prefetch bench = {.renderer = &params,
        .stream = &run->bench->stream,
        .gallery = &run->gallery,
        .scene = run->scene.scene,
        .vfov_rad = VFOV_RAD};
    const enum hg_status status = hg_bench_prefetch_run(&bench, &run->prefetch, err);
    return status == HG_OK ? step_done(run, err) : status;
}

static bool baseline_progress(void *user, uint32_t done)
{
    struct run *run = user;
    (void)done;
    return step_done(run, &(struct hg_error){0}) == HG_OK;
}

// With nothing else under way in this process.
static enum hg_status measure_baseline(struct run *run, struct hg_error *err)
{
    const struct hg_bench_vt *b = run->bench;
    run->baseline = (struct hg_bench_oiio_params){.cache_dir = b->stream.renderer->cache_dir,
        .memory_bytes = (uint64_t)b->baseline_mib << 20,
        .host_bytes = b->stream.renderer->host_budget_bytes,
        .made = b->made < BASELINE_MADE ? b->made : BASELINE_MADE,
        .side_px = b->side_px < BASELINE_SIDE_PX ? b->side_px : BASELINE_SIDE_PX,
        .images = b->images,
        .image_count = b->image_count,
        .moments = b->stream.frames * 5 / 2,
        .progress = baseline_progress,
        .progress_user = run};
    return hg_bench_oiio_run(&run->baseline, &run->baseline_result, err);
}

// --- single pictures -----------------------------------------------------------------------------

// From all of it to half a texel a pixel, towards a place that is nothing in particular.
static struct hg_bench_pose zoom(uint32_t side_px, uint32_t step, uint32_t height_px)
{
    const float side_m = 0.001f * (float)side_px, place[2] = {0.137f * side_m, -0.211f * side_m};
    const float near = 0.0005f * (float)height_px / (2.0f * tanf(0.5f * VFOV_RAD));
    const float far = 0.6f * side_m / tanf(0.5f * VFOV_RAD);
    const float t = (float)step / (float)(ZOOM_STEPS - 1);
    struct hg_bench_pose pose = {{place[0] * t, place[1] * t, far * powf(near / far, t)}, {0}};
    pose.target[0] = pose.eye[0];
    pose.target[1] = pose.eye[1];
    return pose;
}

// The bilinear value of the pattern at a place of mip 0, in texels.
static void expected_texel(const struct hg_bench_pattern *pattern, float x, float y, float out[3])
{
    const float fx = floorf(x - 0.5f), fy = floorf(y - 0.5f), tx = x - 0.5f - fx,
                ty = y - 0.5f - fy;
    for (int c = 0; c < 3; c++)
        out[c] = 0;
    for (uint32_t i = 0; i < 4; i++) {
        uint8_t rgba[4];
        hg_bench_pattern_row(pattern, 0, (uint32_t)fx + (i & 1), (uint32_t)fy + (i >> 1), 1, rgba);
        const float weight = ((i & 1) != 0 ? tx : 1 - tx) * ((i >> 1) != 0 ? ty : 1 - ty);
        for (int c = 0; c < 3; c++) // filtered in linear light; close enough to a power of 2.2
            out[c] += weight * powf((float)rgba[c] / 255.0f, 2.2f);
    }
    for (int c = 0; c < 3; c++)
        out[c] = 255.0f * powf(out[c], 1 / 2.2f);
}

// Compares pixels of a picture at texel scale with the texels that belong there.
static enum hg_status check_texels(
    struct run *run, struct hg_bench_view *view, struct sheet_result *result, struct hg_error *err)
{
    const struct hg_bench_stream *s = &run->bench->stream;
    const struct hg_bench_pose pose = zoom(result->side_px, ZOOM_STEPS - 1, s->height);
    struct hg_image image;
    enum hg_status status = hg_bench_view_settle(view, &pose, &image, err);
    for (uint32_t i = 0; i < 64 && status == HG_OK; i++) {
        const uint32_t x = (i % 8 * 2 + 1) * s->width / 16, y = (i / 8 * 2 + 1) * s->height / 16;
        struct hg_pick hit;
        status = hg_view_pick(view->view, x, y, &hit, err);
        if (status != HG_OK)
            break;
        float wanted[3];
        const float side = (float)result->side_px;
        expected_texel(&run->scene.patterns[0], hit.uv[0] * side, hit.uv[1] * side, wanted);
        const uint8_t *seen = (uint8_t *)image.pixels + 4 * ((size_t)y * image.width + x);
        for (int c = 0; c < 3; c++)
            result->texel_error = fmaxf(result->texel_error, fabsf(wanted[c] - (float)seen[c]));
    }
    hg_image_finish(&image);
    return status;
}

static enum hg_status measure_sheet(
    struct run *run, struct sheet_result *result, struct hg_error *err)
{
    enum hg_status status = hg_bench_sheet_make(result->side_px, &run->scene, err);
    if (status == HG_OK)
        status = open_side(run, STREAMED, err);
    struct hg_bench_view *view = &run->views[STREAMED];
    const struct hg_view_params params = {.width = run->bench->stream.width,
        .height = run->bench->stream.height,
        .samples = 1,
        .tonemap = HG_TONEMAP_LINEAR};
    if (status == HG_OK)
        status = hg_view_set_params(view->view, &params, err);
    for (uint32_t i = 0; i < ZOOM_STEPS && status == HG_OK; i++) {
        const struct hg_bench_pose pose = zoom(result->side_px, i, run->bench->stream.height);
        uint64_t ns;
        status = hg_bench_view_sharpen(view, &pose, &ns, err);
        if (status == HG_OK && hg_bench_times_add(&result->sharp, ns) != HG_OK)
            status = hg_error_set(err, HG_E_NOMEM, "bench", NULL, "out of host memory");
        if (status == HG_OK)
            status = step_done(run, err);
    }
    if (status == HG_OK)
        status = check_texels(run, view, result, err);
    if (status == HG_OK) {
        struct hg_view_report report;
        hg_view_get_report(view->view, &report);
        result->peak_bytes = report.textures.peak_bytes;
    }
    close_side(run, STREAMED);
    hg_bench_scene_finish(&run->scene);
    return status;
}

// --- report --------------------------------------------------------------------------------------

static void put_flight(const struct run *run, struct hg_writer *w)
{
    const double streamed = hg_bench_times_at(&run->frames[STREAMED], 0.5);
    const double resident = hg_bench_times_at(&run->frames[RESIDENT], 0.5);
    hg_json_put(w, "\"slowdown\":%.4f,\"frame_ms\":{\"streamed\":%.3f,\"resident\":%.3f},",
        resident > 0 ? streamed / resident : 0, streamed, resident);
    hg_bench_put_times(w, "streamed_ms", &run->frames[STREAMED]);
    hg_json_put(w, ",");
    hg_bench_put_times(w, "resident_ms", &run->frames[RESIDENT]);
    hg_json_put(w, ",\"frames\":%u,\"frames_missing\":%llu,\"pages_missing\":%llu,",
        run->frames[STREAMED].count, (unsigned long long)run->missing_frames,
        (unsigned long long)run->missing_pages);
    hg_bench_put_times(w, "teleport_ms", &run->teleports);
}

static void put_memory(const struct run *run, struct hg_writer *w)
{
    const struct hg_bench_vt *b = run->bench;
    const double ratio =
        b->stream.budget_bytes > 0 ? (double)run->set_bytes / (double)b->stream.budget_bytes : 0;
    hg_json_put(w,
        ",\"budget_bytes\":%llu,\"peak_bytes\":%llu,\"set_bytes\":%llu,\"set_ratio\":%.2f,"
        "\"process\":{\"before_bytes\":%llu,\"streamed_peak_rss_bytes\":%llu}",
        (unsigned long long)b->stream.budget_bytes, (unsigned long long)run->streamed.peak_bytes,
        (unsigned long long)run->set_bytes, ratio, (unsigned long long)run->rss_before_bytes,
        (unsigned long long)run->rss_bytes);
    hg_json_put(w, ",\"final\":{\"pictures\":%u,\"identical\":%u,\"max_difference\":%.6f}",
        b->stream.stills, run->stills_same, run->still_max);
}

static void put_sheets(const struct run *run, struct hg_writer *w)
{
    hg_json_put(w, ",\"sheets\":[");
    for (uint32_t i = 0; i < run->bench->sheet_count; i++) {
        const struct sheet_result *r = &run->sheets[i];
        hg_json_put(w, "%s{\"side_px\":%u,\"texel_error\":%.2f,\"peak_bytes\":%llu,",
            i > 0 ? "," : "", r->side_px, (double)r->texel_error,
            (unsigned long long)r->peak_bytes);
        hg_bench_put_times(w, "sharp_ms", &r->sharp);
        hg_json_put(w, "}");
    }
    hg_json_put(w, "]");
}

static enum hg_status write_report(const struct run *run, char **text)
{
    struct hg_writer w = {0};
    const struct hg_bench_stream *s = &run->bench->stream;
    hg_json_put(&w, "{\"width\":%u,\"height\":%u,", s->width, s->height);
    put_flight(run, &w);
    put_memory(run, &w);
    put_sheets(run, &w);
    hg_json_put(&w, ",");
    hg_bench_prefetch_put(&w, &run->prefetch);
    hg_json_put(&w, ",");
    hg_bench_oiio_put(&w, &run->baseline, &run->baseline_result);
    hg_json_put(&w, ",\"device\":");
    hg_json_string(&w, run->device);
    hg_json_put(&w, "}");
    return hg_json_take(&w, text);
}

// --- the benchmark -------------------------------------------------------------------------------

static void set_defaults(struct hg_bench_vt *b)
{
    static const uint32_t sheets[] = {32768, 131072};
    struct hg_bench_stream *s = &b->stream;
    s->budget_bytes = s->budget_bytes > 0 ? s->budget_bytes : UINT64_C(64) << 20;
    s->width = hg_bench_or(s->width, 1280);
    s->height = hg_bench_or(s->height, 720);
    s->frames = hg_bench_or(s->frames, 120);
    s->stills = hg_bench_or(s->stills, 3);
    s->samples = hg_bench_or(s->samples, 8);
    b->made = hg_bench_or(b->made, 12);
    b->side_px = hg_bench_or(b->side_px, 4096);
    b->teleports = hg_bench_or(b->teleports, 40);
    b->baseline_mib = hg_bench_or(b->baseline_mib, 32);
    if (b->sheets_px == NULL) {
        b->sheets_px = sheets;
        b->sheet_count = 2;
    }
}

static enum hg_status measure(struct run *run, struct hg_error *err)
{
    const struct hg_bench_vt *b = run->bench;
    enum hg_status status = HG_OK;
    for (uint32_t i = 0; i < b->sheet_count && status == HG_OK; i++) {
        run->sheets[i].side_px = b->sheets_px[i];
        status = measure_sheet(run, &run->sheets[i], err);
    }
    if (status == HG_OK)
        status = measure_gallery(run, err);
    if (status == HG_OK)
        status = measure_prefetch(run, err);
    hg_bench_scene_finish(&run->scene);
    return status == HG_OK ? measure_baseline(run, err) : status;
}

enum hg_status hg_bench_vt_run(const struct hg_bench_vt *bench, char **text, struct hg_error *err)
{
    *text = NULL;
    struct hg_bench_vt full = *bench;
    set_defaults(&full);
    struct run run = {.bench = &full,
        .total = 4 * full.stream.frames + full.teleports + full.stream.stills +
                 full.sheet_count * ZOOM_STEPS + 1 + HG_BENCH_OIIO_STEPS};
    run.sheets = hg_calloc(full.sheet_count, sizeof *run.sheets);
    enum hg_status status = run.sheets != NULL
                                ? measure(&run, err)
                                : hg_error_set(err, HG_E_NOMEM, "bench", NULL, "out of memory");
    if (status == HG_OK)
        status = write_report(&run, text);
    for (int side = 0; side < SIDES; side++) {
        close_side(&run, side);
        hg_bench_times_finish(&run.frames[side]);
    }
    for (uint32_t i = 0; run.sheets != NULL && i < full.sheet_count; i++)
        hg_bench_times_finish(&run.sheets[i].sharp);
    hg_bench_times_finish(&run.teleports);
    hg_bench_prefetch_finish(&run.prefetch);
    hg_bench_scene_finish(&run.scene);
    hg_free(run.sheets);
    return status;
}
