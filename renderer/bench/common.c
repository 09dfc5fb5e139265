#include "renderer/bench/common.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/alloc.h"
#include "base/clock.h"
#include "base/json.h"
#include "renderer/internal.h"

#define PATIENCE_NS (UINT64_C(600) * 1000000000)

// --- times ---------------------------------------------------------------------------------------

enum hg_status hg_bench_times_add(struct hg_bench_times *times, uint64_t ns)
{
    if (hg_grow(&times->ms, &times->capacity, times->count + 1, sizeof *times->ms) != HG_OK)
        return HG_E_NOMEM;
    times->ms[times->count++] = (float)((double)ns * 1e-6);
    return HG_OK;
}

static int compare_floats(const void *a, const void *b)
{
    const float x = *(const float *)a, y = *(const float *)b;
    return (x > y) - (x < y);
}

double hg_bench_times_at(const struct hg_bench_times *times, double fraction)
{
    const uint32_t n = times->count;
    float *sorted = n > 0 ? hg_calloc(n, sizeof *sorted) : NULL;
    if (sorted == NULL)
        return 0;
    memcpy(sorted, times->ms, n * sizeof *sorted);
    qsort(sorted, n, sizeof *sorted, compare_floats);
    const uint32_t rank = (uint32_t)ceil(fraction * n), at = rank > 0 ? rank - 1 : 0;
    double value = (double)sorted[at < n ? at : n - 1];
    if (fraction == 0.5)
        value = 0.5 * ((double)sorted[(n - 1) / 2] + (double)sorted[n / 2]);
    hg_free(sorted);
    return value;
}

void hg_bench_times_finish(struct hg_bench_times *times)
{
    hg_free(times->ms);
    *times = (struct hg_bench_times){0};
}

void hg_bench_put_times(struct hg_writer *w, const char *key, const struct hg_bench_times *times)
{
    hg_json_put(w, "\"%s\":{\"p50\":%.3f,\"p95\":%.3f,\"max\":%.3f,\"count\":%u}", key,
        hg_bench_times_at(times, 0.5), hg_bench_times_at(times, 0.95),
        hg_bench_times_at(times, 1.0), times->count);
}

// --- views ---------------------------------------------------------------------------------------

enum hg_status hg_bench_view_init(struct hg_bench_view *view, struct hg_renderer *renderer,
    struct hg_scene *scene, const struct hg_view_params *params, struct hg_error *err)
{
    *view = (struct hg_bench_view){0};
    enum hg_status status = hg_view_create(renderer, scene, &view->view, err);
    if (status == HG_OK)
        status = hg_view_set_params(view->view, params, err);
    if (status != HG_OK)
        hg_bench_view_finish(view);
    return status;
}

void hg_bench_view_finish(struct hg_bench_view *view)
{
    hg_view_destroy(view->view);
    *view = (struct hg_bench_view){0};
}

static enum hg_status look(
    struct hg_bench_view *view, const struct hg_bench_pose *pose, struct hg_error *err)
{
    struct hg_view_camera camera = {.vfov_rad = view->vfov_rad};
    memcpy(camera.eye, pose->eye, sizeof camera.eye);
    memcpy(camera.target, pose->target, sizeof camera.target);
    return hg_view_set_camera(view->view, &camera, err);
}

enum hg_status hg_bench_view_draw(struct hg_bench_view *view, const struct hg_bench_pose *pose,
    uint64_t *ns, struct hg_error *err)
{
    struct hg_refbuf *pixels = NULL;
    const uint64_t start = hg_clock_now_ns();
    enum hg_status status = look(view, pose, err);
    if (status == HG_OK)
        status = hg_view_step(view->view, 1, &view->info, err);
    if (status == HG_OK)
        status = hg_view_read_pixels(view->view, HG_PIXEL_RGBA8, &pixels, err);
    *ns = hg_clock_now_ns() - start;
    hg_refbuf_unref(pixels);
    return status;
}

enum hg_status hg_bench_view_sharpen(struct hg_bench_view *view, const struct hg_bench_pose *pose,
    uint64_t *ns, struct hg_error *err)
{
    const uint64_t start = hg_clock_now_ns();
    *ns = 0;
    enum hg_status status = look(view, pose, err);
    do {
        if (status == HG_OK)
            status = hg_view_step(view->view, 1, &view->info, err);
        *ns = hg_clock_now_ns() - start;
        if (status == HG_OK && *ns > PATIENCE_NS)
            status = hg_error_set(err, HG_E_TIMEOUT, "bench", NULL,
                "%u pages and %u clusters are still missing", view->info.missing_pages,
                view->info.missing_clusters);
    } while (status == HG_OK && (view->info.missing_pages > 0 || view->info.missing_clusters > 0));
    return status;
}

enum hg_status hg_bench_view_settle(struct hg_bench_view *view, const struct hg_bench_pose *pose,
    struct hg_image *out, struct hg_error *err)
{
    struct hg_refbuf *pixels = NULL;
    *out = (struct hg_image){0};
    const uint64_t start = hg_clock_now_ns();
    enum hg_status status = look(view, pose, err);
    do {
        if (status == HG_OK)
            status = hg_view_step(view->view, 16, &view->info, err);
        if (status == HG_OK && hg_clock_now_ns() - start > 4 * PATIENCE_NS)
            status = hg_error_set(err, HG_E_TIMEOUT, "bench", NULL, "a view does not settle");
    } while (status == HG_OK && !view->info.settled);
    if (status == HG_OK)
        status = hg_view_read_pixels(view->view, HG_PIXEL_RGBA8, &pixels, err);
    if (status == HG_OK)
        status = hg_image_create(view->info.width, view->info.height, HG_PIXEL_RGBA8, NULL, out);
    if (status == HG_OK)
        memcpy(out->pixels, pixels->data, out->size_bytes);
    hg_refbuf_unref(pixels);
    return status;
}

enum hg_status hg_bench_report_progress(
    const struct hg_bench_stream *stream, uint32_t done, uint32_t total, struct hg_error *err)
{
    if (stream->progress == NULL || stream->progress(stream->progress_user, done, total))
        return HG_OK;
    return hg_error_set(err, HG_E_CANCELLED, "bench", NULL, "cancelled");
}
