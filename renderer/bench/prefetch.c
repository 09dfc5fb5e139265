#include "renderer/bench/prefetch.h"

#include <time.h>

#include "base/clock.h"
#include "base/json.h"
#include "renderer/internal.h"

enum { JUMPS = 4 }; // of a round and side

static enum hg_status add_time(struct hg_bench_times *times, uint64_t ns, struct hg_error *err)
{
    return hg_bench_times_add(times, ns) == HG_OK
               ? HG_OK
               : hg_error_set(err, HG_E_NOMEM, "bench", NULL, "out of host memory");
}

static void sleep_until(uint64_t ns)
{
    const uint64_t now = hg_clock_now_ns(), left = ns > now ? ns - now : 0;
    const struct timespec t = {(time_t)(left / 1000000000u), (long)(left % 1000000000u)};
    if (left > 0)
        nanosleep(&t, NULL);
}

static uint64_t pages_loaded(const struct hg_bench_view *view)
{
    struct hg_view_report report;
    hg_view_get_report(view->view, &report);
    return report.textures.loaded;
}

// What is shown stays on the screen until the next frame is there.
static enum hg_status fly(struct hg_bench_view *view, uint32_t frames,
    struct hg_bench_prefetch_side *side, struct hg_error *err)
{
    enum hg_status status = HG_OK;
    uint64_t shown_ns = 0;
    const uint64_t before = pages_loaded(view);
    bool missing = false;
    for (uint32_t i = 0; i < frames && status == HG_OK; i++) {
        struct hg_bench_pose pose;
        hg_bench_gallery_walk(i, &pose);
        const uint64_t start = hg_clock_now_ns();
        uint64_t ns;
        status = hg_bench_view_draw(view, &pose, &ns, err);
        if (status == HG_OK)
            status = add_time(&side->frames, ns, err);
        const uint64_t now = hg_clock_now_ns();
        side->missing_ms += missing ? (double)(now - shown_ns) * 1e-6 : 0;
        shown_ns = now;
        missing = view->info.missing_pages > 0;
        side->frames_missing += missing;
        side->pages_missing += view->info.missing_pages;
        sleep_until(start + 1000000000u / HG_BENCH_PREFETCH_FPS);
    }
    side->pages_loaded += pages_loaded(view) - before;
    return status;
}

static enum hg_status jump(struct hg_bench_view *view, const struct hg_bench_gallery *gallery,
    uint32_t index, struct hg_bench_prefetch_side *side, struct hg_error *err)
{
    struct hg_bench_pose pose;
    uint64_t ns;
    hg_bench_gallery_pose(gallery, index * 7919 % 1009, 1009, &pose);
    const enum hg_status status = hg_bench_view_sharpen(view, &pose, &ns, err);
    return status == HG_OK ? add_time(&side->sharp, ns, err) : status;
}

// In a renderer of its own, which has no pages yet.
static enum hg_status run_side(const struct hg_bench_prefetch *bench, bool on,
    struct hg_bench_prefetch_side *side, struct hg_error *err)
{
    struct hg_renderer *renderer = NULL;
    struct hg_bench_view view = {0};
    const struct hg_view_params params = {
        .width = bench->stream->width, .height = bench->stream->height, .samples = 1};
    enum hg_status status = hg_renderer_create(bench->renderer, &renderer, err);
    if (status == HG_OK) {
        renderer->context.overrides.no_prefetch = !on;
        status = hg_bench_view_init(&view, renderer, bench->scene, &params, err);
    }
    view.vfov_rad = bench->vfov_rad;
    struct hg_bench_pose first;
    uint64_t ns;
    hg_bench_gallery_walk(0, &first);
    if (status == HG_OK) // whatever is made once is made here
        status = hg_bench_view_sharpen(&view, &first, &ns, err);
    if (status == HG_OK)
        status = fly(&view, bench->stream->frames, side, err);
    for (uint32_t i = 0; i < JUMPS && status == HG_OK; i++)
        status = jump(&view, bench->gallery, i + 1, side, err);
    hg_bench_view_finish(&view);
    hg_renderer_destroy(renderer);
    return status;
}

enum hg_status hg_bench_prefetch_run(const struct hg_bench_prefetch *bench,
    struct hg_bench_prefetch_result *out, struct hg_error *err)
{
    *out = (struct hg_bench_prefetch_result){0};
    enum hg_status status = HG_OK;
    for (uint32_t i = 0; i < 2 * HG_BENCH_PREFETCH_ROUNDS && status == HG_OK; i++) {
        const bool on = (i + i / 2) % 2 == 1; // off, on, on, off, off, on
        status = run_side(bench, on, on ? &out->on : &out->off, err);
    }
    return status;
}

void hg_bench_prefetch_finish(struct hg_bench_prefetch_result *r)
{
    hg_bench_times_finish(&r->on.frames);
    hg_bench_times_finish(&r->on.sharp);
    hg_bench_times_finish(&r->off.frames);
    hg_bench_times_finish(&r->off.sharp);
}

// --- report --------------------------------------------------------------------------------------

static void put_side(struct hg_writer *w, const char *key, const struct hg_bench_prefetch_side *s)
{
    hg_json_put(w,
        "\"%s\":{\"frames_missing\":%llu,\"pages_missing\":%llu,\"missing_ms\":%.1f,"
        "\"pages_loaded\":%llu,",
        key, (unsigned long long)s->frames_missing, (unsigned long long)s->pages_missing,
        s->missing_ms, (unsigned long long)s->pages_loaded);
    hg_bench_put_times(w, "frame_ms", &s->frames);
    hg_json_put(w, ",");
    hg_bench_put_times(w, "teleport_ms", &s->sharp);
    hg_json_put(w, "},");
}

static double ratio(double a, double b)
{
    return b > 0 ? a / b : 0;
}

void hg_bench_prefetch_put(struct hg_writer *w, const struct hg_bench_prefetch_result *r)
{
    const struct hg_bench_prefetch_side *on = &r->on, *off = &r->off;
    hg_json_put(w, "\"prefetch\":{\"flights\":%d,", HG_BENCH_PREFETCH_ROUNDS);
    put_side(w, "off", off);
    put_side(w, "on", on);
    hg_json_put(w,
        "\"pages_missing_ratio\":%.4f,\"missing_ms_ratio\":%.4f,\"frame_ratio\":%.4f,"
        "\"teleport_ratio\":%.4f}",
        ratio((double)on->pages_missing, (double)off->pages_missing),
        ratio(on->missing_ms, off->missing_ms),
        ratio(hg_bench_times_at(&on->frames, 0.5), hg_bench_times_at(&off->frames, 0.5)),
        ratio(hg_bench_times_at(&on->sharp, 0.5), hg_bench_times_at(&off->sharp, 0.5)));
}
