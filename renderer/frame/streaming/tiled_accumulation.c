// tiled_accumulation.c - see tiled_accumulation.h.
#include "renderer/frame/streaming/tiled_accumulation.h"

#include <string.h>

#include "base/clock.h"
#include "renderer/frame/batch/batch.h"
#include "renderer/frame/streaming/waiting_pixels.h"
#include "renderer/passes/shade.h"
#include "shaders/shared/sample_blocks.h"

#define REST_LEAST_NS   20000000u  // for pages, before a resting picture is shown again;
#define REST_MOST_NS    500000000u // between the two four times as long as drawing it took
#define EXACT_WAIT_NS   50000000u  // per step
#define STILL_SAMPLES   8          // of a debug view that will not get sharper
#define REGION_ALIGN_PX 16u        // of what is drawn of a picture with a region
#define BEHIND_TRIES    4          // of an area whose pages may drive each other out
#define COARSE_PICTURES 16         // in motion, until maps are drawn again while pages still come
#define SLICES_FROM_PX  (1u << 18) // smaller pictures are drawn as a whole,
#define SLICE_LEAST_PX  (1u << 13) // and so are smaller areas: culling takes as long for all

static struct hg_page_cache *pages_of(const struct hg_draw *draw)
{
    return hg_textures_cache(draw->scene_gpu->textures);
}

void hg_tiled_accumulation_finish(struct hg_gpu *gpu, struct hg_tiled_accumulation *s)
{
    hg_gpu_buffer_destroy(gpu, &s->progress);
    hg_gpu_buffer_destroy(gpu, &s->progress_read);
    hg_gpu_buffer_destroy(gpu, &s->behind.progress);
    hg_gpu_image_destroy(gpu, &s->fallback);
    s->phase = HG_VIEW_EMPTY;
    s->uneven = s->has_fallback = false;
    s->areas.count = s->samples = 0;
}

void hg_tiled_accumulation_mark_shadows(struct hg_lighting *lighting, bool stale)
{
    uint32_t count;
    struct hg_shadow_map *maps = hg_lighting_shadow_maps(lighting, &count);
    for (uint32_t i = 0; i < count; i++) {
        maps[i].stale = stale;
        maps[i].partly = false;
        maps[i].touched = true;
    }
}

static void forget_shadows(struct hg_tiled_accumulation *s, struct hg_lighting *lighting)
{
    hg_tiled_accumulation_mark_shadows(lighting, true);
    s->shadows.coarse_texels = false;
}

static void forget_behind(struct hg_tiled_accumulation *s)
{
    s->behind.there = false;
    s->behind.areas.count = 0;
}

void hg_tiled_accumulation_restart(struct hg_tiled_accumulation *s, struct hg_lighting *lighting)
{
    forget_behind(s);
    s->phase = HG_VIEW_EMPTY;
    s->shortfall = s->samples = 0;
    s->uneven = s->has_fallback = s->forced = s->pages.waiting = false;
    s->areas.count = s->shadows.areas.count = s->pages.still = 0;
    if (s->shadows.error_px > 0.0f) // coarse maps are not kept
        forget_shadows(s, lighting);
    s->shadows.error_px = 0.0f;
}

// All maps wait for all pages that are on their way, but not for ever.
void hg_tiled_accumulation_sharpen_shadows(const struct hg_draw *draw)
{
    struct hg_tiled_accumulation *s = draw->accumulation;
    if (!s->shadows.coarse_texels)
        return;
    struct hg_page_cache_stats stats;
    hg_page_cache_stats(pages_of(draw), &stats);
    const bool waits = s->pages.bias > 0.0f || hg_page_cache_under_way(pages_of(draw)) > 0;
    if (stats.pages_loaded == s->shadows.loaded ||
        (waits && ++s->shadows.pictures < COARSE_PICTURES))
        return;
    forget_shadows(s, draw->lighting);
    hg_lighting_forget_pages(draw->lighting);
}

void hg_tiled_accumulation_note(
    struct hg_tiled_accumulation *s, enum hg_view_shortfall what, bool lacks)
{
    s->shortfall = (s->shortfall & ~(uint32_t)what) | (lacks ? (uint32_t)what : 0);
}

static bool lacks(const struct hg_tiled_accumulation *s, enum hg_view_shortfall what)
{
    return (s->shortfall & (uint32_t)what) != 0;
}

float hg_tiled_accumulation_error_px(const struct hg_tiled_accumulation *s, float asked_px)
{
    const float drawn = s->error_px > 0.0f ? s->error_px : asked_px;
    const float shown = drawn > s->shadows.error_px ? drawn : s->shadows.error_px;
    return s->uneven && s->has_fallback && s->fallback_error_px > shown ? s->fallback_error_px
                                                                        : shown;
}

// --- turning to exact ----------------------------------------------------------------------------

// The host reads the progress of pixels where it lies, or a copy of it.
static bool reads_progress(const struct hg_draw *draw)
{
    return draw->accumulation->progress.mapped != NULL &&
           hg_gpu_strategy(draw->context->gpu)->host_reads;
}

static enum hg_status reserve(const struct hg_draw *draw, struct hg_error *err)
{
    struct hg_gpu *gpu = draw->context->gpu;
    struct hg_tiled_accumulation *s = draw->accumulation;
    const struct hg_view_settings *settings = draw->request->settings;
    const uint64_t bytes = (uint64_t)settings->width * settings->height * 4;
    enum hg_status status = hg_gpu_buffer_reserve(
        gpu, HG_GPU_BUFFER_DEVICE, bytes, "pixel progress", &s->progress, err);
    if (status == HG_OK && !reads_progress(draw))
        status = hg_gpu_buffer_reserve(
            gpu, HG_GPU_BUFFER_READBACK, bytes, "progress readback", &s->progress_read, err);
    return status == HG_OK
               ? hg_draw_make_image(draw, HG_COLOR_FORMAT, "fallback", &s->fallback, err)
               : status;
}

// What is drawn of a picture with a region: all of the region, up to multiples of REGION_ALIGN_PX.
static VkRect2D drawn_rect(const struct hg_view_settings *settings)
{
    const struct hg_picture_region r = hg_view_region(settings);
    const uint32_t x = r.x & ~(REGION_ALIGN_PX - 1u), y = r.y & ~(REGION_ALIGN_PX - 1u);
    uint32_t right = (r.x + r.width + REGION_ALIGN_PX - 1) & ~(REGION_ALIGN_PX - 1u);
    uint32_t bottom = (r.y + r.height + REGION_ALIGN_PX - 1) & ~(REGION_ALIGN_PX - 1u);
    right = right < settings->width ? right : settings->width;
    bottom = bottom < settings->height ? bottom : settings->height;
    return (VkRect2D){{(int32_t)x, (int32_t)y}, {right - x, bottom - y}};
}

// All pixels have `samples` samples; 0: what is shown becomes the fallback.
static enum hg_status start_exact(
    const struct hg_draw *draw, uint32_t samples, struct hg_error *err)
{
    struct hg_tiled_accumulation *s = draw->accumulation;
    struct hg_gpu_cmd *cmd;
    enum hg_status status = reserve(draw, err);
    if (status == HG_OK)
        status = hg_gpu_begin(draw->context->gpu, &cmd, err);
    if (status != HG_OK)
        return status;
    vkCmdFillBuffer(hg_gpu_cmd_handle(cmd), s->progress.handle, 0, VK_WHOLE_SIZE, samples);
    if (samples == 0) {
        const struct hg_gpu_image shown = draw->targets->accumulated;
        draw->targets->accumulated = s->fallback;
        s->fallback = shown;
        const struct hg_gpu_rendering clear = {
            .colors = {{.image = &draw->targets->accumulated, .clear = true}}, .color_count = 1};
        hg_gpu_cmd_begin_rendering(cmd, &clear);
        hg_gpu_cmd_end_rendering(cmd);
    }
    status = hg_gpu_submit_and_wait(draw->context->gpu, cmd, err);
    forget_behind(s);
    s->phase = HG_VIEW_EXACT;
    s->shortfall &= ~(uint32_t)(HG_SHORT_OF_SHADOWS | HG_SHORT_OF_TEXELS | HG_SHORT_OF_GEOMETRY);
    s->pages.on = true; // pixels are counted whatever may be missing
    s->pages.waiting = s->forced = false;
    s->most_samples = samples;
    s->fallback_error_px = hg_tiled_accumulation_error_px(s, draw->request->settings->error_px);
    s->error_px = draw->request->error_px;
    s->has_fallback = s->uneven = samples == 0;
    s->pages.bias = 0.0f;
    s->areas.items[0] =
        (struct hg_tiled_area){.rect = drawn_rect(draw->request->settings), .samples = samples};
    s->areas.count = 1;
    s->samples = samples;
    return status;
}

bool hg_tiled_accumulation_is_blank(const struct hg_tiled_accumulation *s)
{
    return s->phase == HG_VIEW_EXACT && !s->has_fallback && s->samples == 0;
}

enum hg_status hg_tiled_accumulation_rest(const struct hg_draw *draw, struct hg_error *err)
{
    struct hg_tiled_accumulation *s = draw->accumulation;
    if (lacks(s, HG_SHORT_OF_GEOMETRY))
        return start_exact(draw, 0, err);
    if (!lacks(s, HG_SHORT_OF_TEXELS))
        return HG_OK;
    const bool debug = draw->request->settings->debug != 0;
    if (!debug && (hg_draw_is(draw, HG_DRAW_FINAL) || s->pages.bias > 0.0f ||
                      hg_page_cache_under_way(pages_of(draw)) == 0))
        return start_exact(draw, 0, err);
    uint64_t most = 4 * draw->stats->step_ns;
    most = most > REST_LEAST_NS ? most : REST_LEAST_NS;
    most = most < REST_MOST_NS ? most : REST_MOST_NS;
    const enum hg_status status = hg_tiled_accumulation_await(draw, most, err);
    if (s->shadows.coarse_texels)
        forget_shadows(s, draw->lighting);
    return status;
}

enum hg_status hg_tiled_accumulation_await(
    const struct hg_draw *draw, uint64_t most_ns, struct hg_error *err)
{
    const uint64_t start = hg_clock_now_ns();
    uint64_t spent = 0;
    enum hg_status status = HG_OK;
    while (status == HG_OK && spent < most_ns && hg_page_cache_under_way(pages_of(draw)) > 0) {
        hg_page_cache_wait(pages_of(draw), most_ns - spent);
        status = hg_page_cache_update(pages_of(draw), HG_PAGES_SHOW, UINT64_MAX, err);
        spent = hg_clock_now_ns() - start;
    }
    hg_view_stats_add_stage(draw->stats, "pages", spent);
    return status;
}

// `missed`: maps of the sample were drawn without texels that they asked for.
static void note_coarse_shadows(const struct hg_draw *draw, bool missed)
{
    struct hg_tiled_shadows *shadows = &draw->accumulation->shadows;
    const bool biased = draw->accumulation->pages.bias > 0.0f && draw->stats->stale_shadows > 0;
    if (!missed && !biased)
        return;
    struct hg_page_cache_stats stats;
    hg_page_cache_stats(pages_of(draw), &stats);
    shadows->coarse_texels = true;
    shadows->pictures = 0;
    shadows->loaded = stats.pages_loaded;
}

// Texture requests of the sample.
static void note_pages(const struct hg_draw *draw)
{
    struct hg_tiled_accumulation *s = draw->accumulation;
    struct hg_page_demand demand;
    const uint32_t missed = s->pages.missing;
    s->pages.missing = 0;
    s->pages.bias = 0.0f;
    // Also where all pages have come since the maps were drawn.
    hg_tiled_accumulation_note(s, HG_SHORT_OF_TEXELS, s->shadows.coarse_texels);
    if (!s->pages.on)
        return;
    hg_page_cache_collect(pages_of(draw), HG_PAGES_SHOW, &demand);
    s->pages.missing = demand.missing;
    s->pages.bias = draw->frame->textures.bias;
    note_coarse_shadows(draw, demand.shadows);
    if (draw->request->settings->debug !=
        0) { // provisional until nothing is missing, or nothing more can be loaded
        const bool idle = hg_page_cache_under_way(pages_of(draw)) == 0;
        s->pages.still = idle && demand.missing == missed ? s->pages.still + 1 : 0;
        hg_tiled_accumulation_note(
            s, HG_SHORT_OF_TEXELS, demand.missing > 0 && s->pages.still < STILL_SAMPLES);
        return;
    }
    hg_tiled_accumulation_note(s, HG_SHORT_OF_TEXELS,
        demand.missing > 0 || s->pages.bias > 0.0f || s->shadows.coarse_texels);
}

enum hg_status hg_tiled_accumulation_shown(const struct hg_draw *draw, struct hg_error *err)
{
    struct hg_tiled_accumulation *s = draw->accumulation;
    note_pages(draw);
    if (hg_draw_is(draw, HG_DRAW_DIRECT))
        s->phase = HG_VIEW_DIRECT;
    else
        s->phase = s->shortfall != 0 ? HG_VIEW_PROVISIONAL : HG_VIEW_ACCUMULATING;
    const bool more = s->samples < draw->request->samples;
    const bool counts = s->pages.on && draw->request->settings->debug == 0;
    // More than one, if textures of another scene came into the cache in the meantime.
    return s->phase == HG_VIEW_ACCUMULATING && more && counts ? start_exact(draw, s->samples, err)
                                                              : HG_OK;
}

// --- drawing -------------------------------------------------------------------------------------

static struct hg_waiting_pixels waiting_pixels(const struct hg_draw *draw)
{
    const struct hg_tiled_accumulation *s = draw->accumulation;
    const struct hg_draw_blocks *b = draw->blocks;
    return (struct hg_waiting_pixels){
        .progress = reads_progress(draw) ? s->progress.mapped : s->progress_read.mapped,
        .width = draw->request->settings->width,
        .samples = draw->request->samples,
        .counts = b != NULL ? b->counts : NULL,
        .columns = b != NULL ? b->columns : 0};
}

static uint64_t pixels_of(VkExtent2D size)
{
    return (uint64_t)size.width * size.height;
}

bool hg_tiled_accumulation_slices(const struct hg_draw *draw)
{
    const struct hg_view_settings *settings = draw->request->settings;
    const VkExtent2D size = {settings->width, settings->height};
    return draw->accumulation->slices.ns > 0 && hg_draw_is(draw, HG_DRAW_FINAL) &&
           pixels_of(size) > SLICES_FROM_PX && !hg_frame_transmits(draw);
}

// A sample of `pixels` took so long.
static void note_slice(struct hg_tiled_accumulation *s, uint64_t pixels, uint64_t ns)
{
    s->slices.px_ns = (float)((double)ns / (double)(pixels > 0 ? pixels : 1));
}

// Halves the area on top until a sample of it takes about as long as a slice may.
static void cut_slice(const struct hg_draw *draw)
{
    struct hg_tiled_accumulation *s = draw->accumulation;
    if (!hg_tiled_accumulation_slices(draw) || !(s->slices.px_ns > 0.0f))
        return;
    const float most = (float)s->slices.ns / s->slices.px_ns;
    const uint64_t most_px = most > (float)SLICE_LEAST_PX ? (uint64_t)most : SLICE_LEAST_PX;
    while (pixels_of(s->areas.items[s->areas.count - 1].rect.extent) > most_px &&
           hg_tiled_areas_split(&s->areas))
        ;
}

static enum hg_status run_batch(struct hg_draw *draw, uint32_t samples, bool shadows,
    struct hg_page_demand *demand, struct hg_error *err)
{
    struct hg_tiled_accumulation *s = draw->accumulation;
    struct hg_gpu_cmd *cmd;
    enum hg_status status = hg_gpu_begin(draw->context->gpu, &cmd, err);
    if (status != HG_OK)
        return status;
    if (hg_draw_is(draw, HG_DRAW_BEHIND)) {
        vkCmdFillBuffer(
            hg_gpu_cmd_handle(cmd), s->behind.progress.handle, 0, VK_WHOLE_SIZE, s->behind.sample);
        hg_gpu_memory_barrier(cmd);
    }
    memset(draw->blend->lists.reports.mapped, 0, draw->blend->lists.reports.size_bytes);
    hg_page_cache_begin(pages_of(draw), cmd);
    status = shadows ? hg_frame_record_shadows(draw, cmd, err)
                     : hg_frame_record(draw, cmd, samples, err);
    if (status != HG_OK) {
        hg_gpu_discard(draw->context->gpu, cmd);
        return status;
    }
    hg_page_cache_end(pages_of(draw), cmd);
    if (!reads_progress(draw)) {
        const VkBufferCopy copy = {.size = s->progress_read.size_bytes < s->progress.size_bytes
                                               ? s->progress_read.size_bytes
                                               : s->progress.size_bytes};
        vkCmdCopyBuffer(
            hg_gpu_cmd_handle(cmd), s->progress.handle, s->progress_read.handle, 1, &copy);
    }
    status = hg_gpu_submit_and_wait(draw->context->gpu, cmd, err);
    if (status == HG_OK) {
        hg_geometry_deforms_done(draw->scene_gpu->geometry);
        if (!shadows)
            hg_geometry_triangle_cache_done(draw->scene_gpu->geometry);
        hg_page_cache_collect(pages_of(draw), HG_PAGES_EXACT, demand);
    }
    return status;
}

static struct hg_draw_request exact_request(const struct hg_draw *draw)
{
    struct hg_draw_request request = *draw->request;
    request.flags &= ~(uint32_t)(HG_DRAW_DIRECT | HG_DRAW_COARSE_SHADOWS | HG_DRAW_MOTION);
    request.flags |= HG_DRAW_EXACT;
    request.moment = 0;
    return request;
}

enum hg_status hg_tiled_accumulation_begin_exact(const struct hg_draw *draw, struct hg_error *err)
{
    struct hg_tiled_accumulation *s = draw->accumulation;
    struct hg_page_demand demand = {0};
    struct hg_draw_request request = exact_request(draw);
    request.smaller = HG_TILED_FIND_SMALLER;
    struct hg_draw find = hg_draw_with(draw, &request);
    enum hg_status status = start_exact(draw, 0, err);
    if (status != HG_OK)
        return status;
    const uint64_t start = hg_clock_now_ns();
    status = hg_frame_cull(&find, HG_FRAME_PICTURE, 1, err);
    if (status == HG_OK)
        status = run_batch(&find, 1, false, &demand, err);
    if (status == HG_OK) {
        note_slice(s,
            pixels_of(hg_draw_size(&request)) / (HG_TILED_FIND_SMALLER * HG_TILED_FIND_SMALLER),
            hg_clock_now_ns() - start);
        hg_frame_note_blend(&find, 1);
        status = start_exact(draw, 0, err); // discards it
    }
    s->has_fallback = false; // it would be outdated
    s->pages.missing = demand.missing;
    s->pages.waiting = demand.missing > 0;
    s->shadows.coarse_texels = demand.shadows;
    draw->stats->number++;
    return status;
}

// Waits for pages for a limited time. *arrived: all requests are resident or have failed.
static enum hg_status wait_pages(const struct hg_draw *draw, bool *arrived, struct hg_error *err)
{
    struct hg_page_cache *pages = pages_of(draw);
    const uint64_t start = hg_clock_now_ns();
    enum hg_status status = hg_page_cache_update(pages, HG_PAGES_EXACT, UINT64_MAX, err);
    uint64_t spent = 0;
    while (status == HG_OK && hg_page_cache_under_way(pages) > 0 && spent < EXACT_WAIT_NS) {
        hg_page_cache_wait(pages, EXACT_WAIT_NS - spent);
        status = hg_page_cache_update(pages, HG_PAGES_EXACT, UINT64_MAX, err);
        spent = hg_clock_now_ns() - start;
    }
    *arrived = hg_page_cache_under_way(pages) == 0;
    hg_view_stats_add_stage(draw->stats, "pages", hg_clock_now_ns() - start);
    return status;
}

// All of the atlas is as good as it gets.
static void keep_shadows(const struct hg_tiled_accumulation *s, struct hg_lighting *lighting)
{
    uint32_t count;
    struct hg_shadow_map *maps = hg_lighting_shadow_maps(lighting, &count);
    hg_tiled_accumulation_mark_shadows(lighting, false);
    for (uint32_t i = 0; i < count; i++)
        maps[i].own = s->shadows.error_px > 0.0f;
}

// Shadow maps are completed before anything is shaded with them. Depth tests are independent of
// order, so geometry that exceeds the budget is drawn in shares, each of which is loaded once, and
// not in parts of the atlas: a single texel may be covered by more than the budget holds. Masked
// casters skip fragments that miss a page and are drawn again, in parts of the atlas if necessary.
static enum hg_status finish_shadows(struct hg_draw *draw, struct hg_error *err)
{
    struct hg_tiled_accumulation *s = draw->accumulation;
    struct hg_page_demand demand;
    const struct hg_gpu_image *atlas = hg_lighting_image_shadow(draw->lighting);
    if (s->shadows.areas.count == 0) {
        s->shadows.areas.items[s->shadows.areas.count++] =
            (struct hg_tiled_area){.rect = {{0, 0}, {atlas->width, atlas->height}}};
        s->shadows.begun = false;
        s->shadows.error_px = 0.0f;
    }
    forget_shadows(s, draw->lighting);
    enum hg_status status = hg_frame_cull(draw, HG_FRAME_SHADOWS, 0, err);
    s->shadows.coarse_texels = true;
    if (status == HG_OK && draw->crowded && !s->forced) {
        s->forced = !hg_tiled_areas_share(&s->shadows.areas);
        return HG_OK;
    }
    if (status == HG_OK)
        status = run_batch(draw, 0, true, &demand, err);
    if (status != HG_OK)
        return status;
    s->forced = false;
    s->shadows.begun = true;
    s->pages.missing = demand.missing;
    s->pages.waiting = demand.missing > 0;
    if (!demand.shadows)
        s->shadows.coarse_texels = --s->shadows.areas.count > 0;
    else if (!demand.fits)
        hg_tiled_areas_split(&s->shadows.areas);
    if (!s->shadows.coarse_texels)
        keep_shadows(s, draw->lighting);
    return HG_OK;
}

static void count_samples(struct hg_draw *draw)
{
    struct hg_tiled_accumulation *s = draw->accumulation;
    s->samples = draw->request->samples;
    for (uint32_t i = 0; i < s->areas.count; i++)
        if (s->areas.items[i].samples < s->samples)
            s->samples = s->areas.items[i].samples;
}

// With transmissive surfaces, areas are not finished one after the other but sample by sample: the
// area with the fewest samples is next. False: no background picture is needed first. Pixels with
// more samples do not read their neighbours.
static bool wants_behind(struct hg_draw *draw)
{
    struct hg_tiled_accumulation *s = draw->accumulation;
    struct hg_tiled_area *top = &s->areas.items[s->areas.count - 1];
    const VkExtent2D size = top->rect.extent,
                     whole = {draw->request->settings->width, draw->request->settings->height};
    if (!hg_frame_transmits(draw) || draw->request->settings->debug != 0)
        return false;
    if (size.width == whole.width && size.height == whole.height &&
        top->samples == s->most_samples) {
        forget_behind(s);
        return false;
    }
    for (uint32_t i = 0; i + 1 < s->areas.count; i++) {
        const struct hg_tiled_area other = s->areas.items[i];
        if (other.samples >= top->samples)
            continue;
        s->areas.items[i] = *top;
        *top = other;
    }
    if (s->behind.there && s->behind.sample == top->samples)
        return false;
    if (s->behind.areas.count == 0 || s->behind.sample != top->samples) {
        s->behind.there = false;
        s->behind.sample = top->samples;
        s->behind.tries = 0;
        s->behind.areas.items[0] =
            (struct hg_tiled_area){.rect.extent = whole, .samples = top->samples};
        s->behind.areas.count = 1;
    }
    return true;
}

static enum hg_status draw_behind(const struct hg_draw *draw, struct hg_error *err)
{
    struct hg_tiled_accumulation *s = draw->accumulation;
    struct hg_page_demand demand;
    struct hg_draw_request request = *draw->request;
    request.flags |= HG_DRAW_BEHIND;
    struct hg_draw behind = hg_draw_with(draw, &request);
    enum hg_status status = hg_gpu_buffer_reserve(draw->context->gpu, HG_GPU_BUFFER_DEVICE,
        s->progress.size_bytes, "progress behind", &s->behind.progress, err);
    if (status == HG_OK)
        status = hg_frame_cull(&behind, HG_FRAME_PICTURE, 1, err);
    const bool fits = !behind.crowded || s->forced;
    if (status == HG_OK && fits)
        status = run_batch(&behind, 1, false, &demand, err);
    if (status != HG_OK)
        return status;
    if (!fits) {
        s->shadows.coarse_texels =
            hg_culling_count(draw->culling) > 1; // without the camera they may fit
        if (!s->shadows.coarse_texels)
            s->forced = !hg_tiled_areas_split(&s->behind.areas);
        return HG_OK;
    }
    s->pages.missing = demand.missing;
    s->pages.waiting = demand.missing > 0;
    s->shadows.coarse_texels = demand.shadows;
    if (demand.missing == 0 && !demand.shadows) {
        s->forced = false;
        s->behind.tries = 0;
        s->behind.there = --s->behind.areas.count == 0;
    } else if (!demand.fits || ++s->behind.tries == BEHIND_TRIES) {
        s->behind.tries = 0;
        hg_tiled_areas_split(&s->behind.areas);
    }
    draw->stats->number++;
    return HG_OK;
}

// Samples that the pixels of an area are drawn to.
static uint32_t end_of(const struct hg_draw *draw, const struct hg_tiled_area *area)
{
    return area->end > 0 ? area->end : draw->request->samples;
}

// Few pixels of the area on top miss pages: they are drawn again in areas of their own, and the
// others go on.
static bool set_apart(const struct hg_draw *draw, uint32_t reached)
{
    struct hg_tiled_accumulation *s = draw->accumulation;
    const struct hg_waiting_pixels waiting = waiting_pixels(draw);
    const struct hg_tiled_area base = s->areas.items[s->areas.count - 1];
    VkRect2D rects[HG_WAITING_MOST_RECTS];
    if (base.end > 0 || s->forced || hg_frame_transmits(draw) ||
        s->areas.count + HG_WAITING_MOST_RECTS > HG_TILED_MAX_AREAS)
        return false;
    const uint32_t count = hg_waiting_pixels_rects(&waiting, base.rect, reached, rects);
    if (count == 0)
        return false;
    if (reached == draw->request->samples)
        s->areas.count--;
    else
        s->areas.items[s->areas.count - 1].samples = reached;
    for (uint32_t i = 0; i < count; i++)
        s->areas.items[s->areas.count++] = (struct hg_tiled_area){.rect = rects[i],
            .samples = hg_waiting_pixels_least(&waiting, rects[i]),
            .end = reached};
    return true;
}

// The area on top was drawn up to `reached` samples.
static void advance(
    const struct hg_draw *draw, uint32_t reached, const struct hg_page_demand *demand)
{
    struct hg_tiled_accumulation *s = draw->accumulation;
    struct hg_tiled_area *area = &s->areas.items[s->areas.count - 1];
    const struct hg_waiting_pixels waiting = waiting_pixels(draw);
    s->most_samples = reached > s->most_samples ? reached : s->most_samples;
    if (demand->missing > 0 && !demand->shadows && demand->fits && set_apart(draw, reached))
        return;
    area->samples = demand->missing == 0 && !demand->shadows
                        ? reached
                        : hg_waiting_pixels_least(&waiting, area->rect);
    s->forced = s->forced && area->samples < draw->request->samples;
    if (area->samples >= end_of(draw, area))
        s->areas.count--;
    else if (!demand->fits)
        hg_tiled_areas_split(&s->areas);
}

static bool is_all(const struct hg_draw *draw, const struct hg_tiled_area *area)
{
    const struct hg_view_settings *settings = draw->request->settings;
    return pixels_of(area->rect.extent) == (uint64_t)settings->width * settings->height;
}

static enum hg_status draw_area(struct hg_draw *draw, struct hg_error *err)
{
    struct hg_tiled_accumulation *s = draw->accumulation;
    cut_slice(draw);
    if (wants_behind(draw))
        return draw_behind(draw, err);
    const struct hg_tiled_area area = s->areas.items[s->areas.count - 1];
    struct hg_page_demand demand;
    uint32_t count = end_of(draw, &area) - area.samples;
    count = count < draw->request->max_samples ? count : draw->request->max_samples;
    count = count < HG_VIEW_MAX_SAMPLES_PER_STEP ? count : HG_VIEW_MAX_SAMPLES_PER_STEP;
    count = s->behind.there ? 1 : count;
    const uint64_t start = hg_clock_now_ns();
    enum hg_status status = hg_frame_cull(draw, HG_FRAME_PICTURE, count, err);
    if (status == HG_OK && draw->crowded && !s->forced) {
        s->shadows.coarse_texels =
            hg_culling_count(draw->culling) > 1; // without the camera they may fit
        // A single pixel may need more than the budget holds: it is drawn coarser, and the picture
        // reports the larger error.
        if (!s->shadows.coarse_texels)
            s->forced = !hg_tiled_areas_split(&s->areas);
        return HG_OK;
    }
    if (status != HG_OK)
        return status;
    count = hg_frame_batch(draw, count);
    status = run_batch(draw, count, false, &demand, err);
    if (status != HG_OK)
        return status;
    if (area.end == 0) // small ones say little of others
        note_slice(s, pixels_of(area.rect.extent) * count, hg_clock_now_ns() - start);
    hg_frame_note_drawn(draw, count);
    s->pages.missing = demand.missing;
    s->pages.waiting = demand.missing > 0;
    s->shadows.coarse_texels = demand.shadows;
    advance(draw, area.samples + count, &demand);
    s->uneven = demand.missing > 0 || s->areas.count > 1 ||
                (s->areas.count == 1 && !is_all(draw, &s->areas.items[0]));
    count_samples(draw);
    draw->stats->number++;
    return HG_OK;
}

enum hg_status hg_tiled_accumulation_draw(const struct hg_draw *draw, struct hg_error *err)
{
    struct hg_tiled_accumulation *s = draw->accumulation;
    const struct hg_draw_request request = exact_request(draw);
    struct hg_draw exact = hg_draw_with(draw, &request);
    enum hg_status status = HG_OK;
    bool arrived = true;
    if (s->pages.waiting)
        status = wait_pages(draw, &arrived, err);
    if (status != HG_OK || !arrived)
        return status;
    s->pages.waiting = false;
    s->pages.missing = 0;
    if (hg_lighting_is_lost(draw->lighting))
        s->shadows.areas.count = 0; // begun again
    if (s->shadows.coarse_texels)
        status = finish_shadows(&exact, err);
    if (status != HG_OK || s->shadows.coarse_texels || s->areas.count == 0)
        return status;
    return draw_area(&exact, err);
}
