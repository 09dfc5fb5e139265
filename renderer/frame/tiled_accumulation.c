// tiled_accumulation.c - see tiled_accumulation.h.
#include "renderer/frame/tiled_accumulation.h"

#include <string.h>

#include "base/clock.h"
#include "renderer/frame/frame.h"
#include "renderer/passes/shade.h"

#define REST_LEAST_NS 20000000u  // for pages, before a resting picture is shown again;
#define REST_MOST_NS  500000000u // between the two four times as long as drawing it took
#define EXACT_WAIT_NS 50000000u  // per step
#define STILL_SAMPLES 8          // of a debug view that will not get sharper
#define AREA_LEAST_PX 8          // areas are cut at multiples of this
#define BEHIND_TRIES  4          // of an area whose pages may drive each other out
#define MOST_SHARES   (1u << 20) // of the geometry of shadow maps

static struct hg_page_cache *pages_of(const struct hg_view_state *view)
{
    return hg_textures_cache(view->scene_gpu->textures);
}

void hg_tiled_accumulation_finish(struct hg_gpu *gpu, struct hg_tiled_accumulation *s)
{
    hg_gpu_buffer_destroy(gpu, &s->progress);
    hg_gpu_buffer_destroy(gpu, &s->progress_read);
    hg_gpu_buffer_destroy(gpu, &s->behind_progress);
    hg_gpu_image_destroy(gpu, &s->fallback);
    s->exact = s->uneven = s->has_fallback = false;
    s->area_count = 0;
}

static void forget_shadows(struct hg_view_state *view)
{
    hg_view_mark_shadows(view, true);
    view->stream.shadows = false;
}

static void forget_behind(struct hg_view_state *view)
{
    view->stream.behind = view->stream.behind_there = false;
    view->stream.behind_count = 0;
}

void hg_tiled_accumulation_restart(struct hg_view_state *view)
{
    struct hg_tiled_accumulation *s = &view->stream;
    forget_behind(view);
    s->exact = s->inexact = s->uneven = s->waiting = s->has_fallback = s->forced = false;
    s->area_count = s->shadow_count = s->still = 0;
    if (s->shadow_error_px > 0.0f) // coarse maps are not kept
        forget_shadows(view);
    s->shadow_error_px = 0.0f;
}

// --- turning to exact ----------------------------------------------------------------------------

static enum hg_status reserve(struct hg_view_state *view, struct hg_error *err)
{
    struct hg_gpu *gpu = view->context->gpu;
    struct hg_tiled_accumulation *s = &view->stream;
    const uint64_t bytes = (uint64_t)view->settings.width * view->settings.height * 4;
    enum hg_status status = hg_gpu_buffer_reserve(
        gpu, HG_GPU_BUFFER_DEVICE, bytes, "pixel progress", &s->progress, err);
    if (status == HG_OK && s->progress.mapped == NULL)
        status = hg_gpu_buffer_reserve(
            gpu, HG_GPU_BUFFER_READBACK, bytes, "progress readback", &s->progress_read, err);
    return status == HG_OK
               ? hg_view_make_image(view, HG_COLOR_FORMAT, "fallback", &s->fallback, err)
               : status;
}

// All pixels have `samples` samples (0 or 1); 0: what is shown becomes the fallback.
static enum hg_status start_exact(
    struct hg_view_state *view, uint32_t samples, struct hg_error *err)
{
    struct hg_tiled_accumulation *s = &view->stream;
    struct hg_gpu_cmd *cmd;
    enum hg_status status = reserve(view, err);
    if (status == HG_OK)
        status = hg_gpu_begin(view->context->gpu, &cmd, err);
    if (status != HG_OK)
        return status;
    vkCmdFillBuffer(hg_gpu_cmd_handle(cmd), s->progress.handle, 0, VK_WHOLE_SIZE, samples);
    if (samples == 0) {
        const struct hg_gpu_image shown = view->targets.accumulated;
        view->targets.accumulated = s->fallback;
        s->fallback = shown;
        const struct hg_gpu_rendering clear = {
            .colors = {{.image = &view->targets.accumulated, .clear = true}}, .color_count = 1};
        hg_gpu_cmd_begin_rendering(cmd, &clear);
        hg_gpu_cmd_end_rendering(cmd);
    }
    status = hg_gpu_submit_and_wait(view->context->gpu, cmd, err);
    forget_behind(view);
    s->exact = s->on = true; // pixels are counted whatever may be missing
    s->inexact = s->waiting = s->forced = false;
    s->most_samples = samples;
    s->fallback_error_px = hg_view_error_px(view);
    view->shown_error_px = view->error_px;
    view->clipped = false;
    s->has_fallback = s->uneven = samples == 0;
    s->bias = 0.0f;
    s->areas[0] = (struct hg_tiled_accumulation_area){
        .rect = {{0, 0}, {view->settings.width, view->settings.height}}, .samples = samples};
    s->area_count = 1;
    view->samples = samples;
    return status;
}

bool hg_tiled_accumulation_is_blank(const struct hg_view_state *view)
{
    return view->stream.exact && !view->stream.has_fallback && view->samples == 0;
}

enum hg_status hg_tiled_accumulation_rest(struct hg_view_state *view, struct hg_error *err)
{
    struct hg_tiled_accumulation *s = &view->stream;
    if (view->clipped)
        return start_exact(view, 0, err);
    if (!s->inexact)
        return HG_OK;
    const uint64_t start = hg_clock_now_ns();
    const bool debug = view->settings.debug != 0;
    if (!debug && (view->final || s->bias > 0.0f || hg_page_cache_under_way(pages_of(view)) == 0))
        return start_exact(view, 0, err);
    uint64_t most = 4 * view->step_ns, spent = 0;
    most = most > REST_LEAST_NS ? most : REST_LEAST_NS;
    most = most < REST_MOST_NS ? most : REST_MOST_NS;
    enum hg_status status = HG_OK;
    while (status == HG_OK && spent < most && hg_page_cache_under_way(pages_of(view)) > 0) {
        hg_page_cache_wait(pages_of(view), most - spent);
        status = hg_page_cache_update(pages_of(view), HG_PAGES_SHOW, UINT64_MAX, err);
        spent = hg_clock_now_ns() - start;
    }
    hg_view_add_stage(view, "pages", spent);
    if (s->shadows)
        forget_shadows(view);
    return status;
}

enum hg_status hg_tiled_accumulation_shown(struct hg_view_state *view, struct hg_error *err)
{
    struct hg_tiled_accumulation *s = &view->stream;
    struct hg_page_demand demand;
    const uint32_t missed = s->missing;
    s->missing = 0;
    s->bias = 0.0f;
    if (!s->on)
        return HG_OK;
    hg_page_cache_collect(pages_of(view), HG_PAGES_SHOW, &demand);
    s->missing = demand.missing;
    s->bias = view->frame.textures.bias;
    s->shadows |= demand.shadows;
    if (view->settings.debug != 0) { // shown until nothing is missing, or nothing more comes
        const bool idle = hg_page_cache_under_way(pages_of(view)) == 0;
        s->still = idle && demand.missing == missed ? s->still + 1 : 0;
        s->inexact = demand.missing > 0 && s->still < STILL_SAMPLES;
        return HG_OK;
    }
    s->inexact = demand.missing > 0 || s->bias > 0.0f || s->shadows;
    const bool more = view->samples < view->settings.samples;
    const bool again = s->inexact || view->coarse || view->direct || view->shallow || view->clipped;
    return again || !more ? HG_OK : start_exact(view, 1, err);
}

// --- drawing -------------------------------------------------------------------------------------

// Least number of samples of the pixels of a rectangle.
static uint32_t least_samples(const struct hg_view_state *view, VkRect2D rect)
{
    const struct hg_tiled_accumulation *s = &view->stream;
    const uint32_t *words =
        s->progress.mapped != NULL ? s->progress.mapped : s->progress_read.mapped;
    uint32_t least = UINT32_MAX;
    for (uint32_t y = 0; y < rect.extent.height; y++) {
        const uint32_t *row =
            words + (size_t)((uint32_t)rect.offset.y + y) * view->settings.width + rect.offset.x;
        for (uint32_t x = 0; x < rect.extent.width; x++) {
            const uint32_t samples = row[x] & HG_PROGRESS_SAMPLES_MASK;
            least = samples < least ? samples : least;
        }
    }
    return least;
}

// Cuts the area on top in two. False when it is a single pixel already, or the stack is full.
static bool split(struct hg_tiled_accumulation_area *areas, uint32_t *count)
{
    struct hg_tiled_accumulation_area *a = &areas[*count - 1], b = *a;
    const VkExtent2D size = a->rect.extent;
    const bool wide = size.width >= size.height;
    uint32_t half = (wide ? size.width : size.height) / 2;
    if (half > AREA_LEAST_PX)
        half -= half % AREA_LEAST_PX;
    if (half == 0 || *count == HG_TILED_MAX_AREAS)
        return false;
    if (wide) {
        b.rect.offset.x += (int32_t)half;
        b.rect.extent.width -= half;
        a->rect.extent.width = half;
    } else {
        b.rect.offset.y += (int32_t)half;
        b.rect.extent.height -= half;
        a->rect.extent.height = half;
    }
    areas[(*count)++] = *a; // the first half is finished first
    areas[*count - 2] = b;
    return true;
}

// Cuts the share of the geometry on top in two. False when hardly more than a chunk can be in it.
static bool share(struct hg_tiled_accumulation_area *areas, uint32_t *count)
{
    struct hg_tiled_accumulation_area *a = &areas[*count - 1], b = *a;
    if (a->shares >= MOST_SHARES || *count == HG_TILED_MAX_AREAS)
        return false;
    a->shares = b.shares = a->shares > 0 ? 2 * a->shares : 2;
    b.share += b.shares / 2;
    areas[(*count)++] = b;
    return true;
}

static enum hg_status run_batch(struct hg_view_state *view, uint32_t samples, bool shadows,
    struct hg_page_demand *demand, struct hg_error *err)
{
    struct hg_tiled_accumulation *s = &view->stream;
    struct hg_gpu_cmd *cmd;
    enum hg_status status = hg_gpu_begin(view->context->gpu, &cmd, err);
    if (status != HG_OK)
        return status;
    if (s->behind) {
        vkCmdFillBuffer(
            hg_gpu_cmd_handle(cmd), s->behind_progress.handle, 0, VK_WHOLE_SIZE, s->behind_sample);
        hg_gpu_memory_barrier(cmd);
    }
    memset(view->layers_full.mapped, 0, HG_VIEW_MAX_SAMPLES_PER_STEP * sizeof(uint32_t));
    hg_page_cache_begin(pages_of(view), cmd);
    status = shadows ? hg_frame_record_shadows(view, cmd, err)
                     : hg_frame_record(view, cmd, samples, err);
    if (status != HG_OK) {
        hg_gpu_discard(view->context->gpu, cmd);
        return status;
    }
    hg_page_cache_end(pages_of(view), cmd);
    if (s->progress.mapped == NULL) {
        const VkBufferCopy copy = {.size = s->progress_read.size_bytes < s->progress.size_bytes
                                               ? s->progress_read.size_bytes
                                               : s->progress.size_bytes};
        vkCmdCopyBuffer(
            hg_gpu_cmd_handle(cmd), s->progress.handle, s->progress_read.handle, 1, &copy);
    }
    status = hg_gpu_submit_and_wait(view->context->gpu, cmd, err);
    if (status == HG_OK) {
        hg_geometry_deforms_done(view->scene_gpu->geometry);
        if (!shadows)
            hg_geometry_triangle_cache_done(view->scene_gpu->geometry);
        hg_page_cache_collect(pages_of(view), HG_PAGES_EXACT, demand);
    }
    return status;
}

enum hg_status hg_tiled_accumulation_begin_exact(struct hg_view_state *view, struct hg_error *err)
{
    struct hg_tiled_accumulation *s = &view->stream;
    struct hg_page_demand demand = {0};
    enum hg_status status = start_exact(view, 0, err);
    if (status != HG_OK)
        return status;
    s->finding = HG_TILED_FIND_SMALLER;
    status = hg_frame_cull(view, HG_FRAME_PICTURE, 1, err);
    if (status == HG_OK)
        status = run_batch(view, 1, false, &demand, err);
    s->finding = 0;
    if (status == HG_OK)
        status = start_exact(view, 0, err); // none of it counts
    s->has_fallback = false;                // that would be a picture of the past
    s->missing = demand.missing;
    s->waiting = demand.missing > 0;
    s->shadows = demand.shadows;
    view->number++;
    return status;
}

// Waits for pages for a while. *arrived: all that were asked for are there, or will never be.
static enum hg_status wait_pages(struct hg_view_state *view, bool *arrived, struct hg_error *err)
{
    struct hg_page_cache *pages = pages_of(view);
    const uint64_t start = hg_clock_now_ns();
    enum hg_status status = hg_page_cache_update(pages, HG_PAGES_EXACT, UINT64_MAX, err);
    uint64_t spent = 0;
    while (status == HG_OK && hg_page_cache_under_way(pages) > 0 && spent < EXACT_WAIT_NS) {
        hg_page_cache_wait(pages, EXACT_WAIT_NS - spent);
        status = hg_page_cache_update(pages, HG_PAGES_EXACT, UINT64_MAX, err);
        spent = hg_clock_now_ns() - start;
    }
    *arrived = hg_page_cache_under_way(pages) == 0;
    hg_view_add_stage(view, "pages", hg_clock_now_ns() - start);
    return status;
}

// Shadow maps are made whole before anything is drawn with them. Depths may come in any order, so
// what does not fit the budget comes in shares of the geometry, each of which is loaded once, and
// not in parts of the atlas: a single texel may lie below more than the budget holds. Casters with
// holes leave out what misses a texel and are drawn again, in parts of the atlas if need be.
static enum hg_status finish_shadows(struct hg_view_state *view, struct hg_error *err)
{
    struct hg_tiled_accumulation *s = &view->stream;
    struct hg_page_demand demand;
    const struct hg_gpu_image *atlas = hg_lighting_image_shadow(view->lighting);
    if (s->shadow_count == 0) {
        s->shadow_areas[s->shadow_count++] =
            (struct hg_tiled_accumulation_area){.rect = {{0, 0}, {atlas->width, atlas->height}}};
        s->shadow_begun = false;
        s->shadow_error_px = 0.0f;
    }
    forget_shadows(view);
    enum hg_status status = hg_frame_cull(view, HG_FRAME_SHADOWS, 0, err);
    s->shadows = true;
    if (status == HG_OK && view->crowded && !s->forced) {
        s->forced = !share(s->shadow_areas, &s->shadow_count);
        return HG_OK;
    }
    if (status == HG_OK)
        status = run_batch(view, 0, true, &demand, err);
    if (status != HG_OK)
        return status;
    s->forced = false;
    s->shadow_begun = true;
    s->missing = demand.missing;
    s->waiting = demand.missing > 0;
    if (!demand.shadows)
        s->shadows = --s->shadow_count > 0;
    else if (!demand.fits)
        split(s->shadow_areas, &s->shadow_count);
    if (!s->shadows)
        hg_view_mark_shadows(view, false); // all of the atlas is as good as it gets
    return HG_OK;
}

static void count_samples(struct hg_view_state *view)
{
    struct hg_tiled_accumulation *s = &view->stream;
    view->samples = view->settings.samples;
    for (uint32_t i = 0; i < s->area_count; i++)
        if (s->areas[i].samples < view->samples)
            view->samples = s->areas[i].samples;
}

// Areas of a picture through which light is let are not finished one after the other, but sample by
// sample: the one with the fewest comes next. False: nothing is to be made for it first. Pixels
// that are ahead ask for nothing that others may see of them.
static bool wants_behind(struct hg_view_state *view)
{
    struct hg_tiled_accumulation *s = &view->stream;
    struct hg_tiled_accumulation_area *top = &s->areas[s->area_count - 1];
    const VkExtent2D size = top->rect.extent, whole = {view->settings.width, view->settings.height};
    if (!hg_frame_transmits(view) || view->settings.debug != 0)
        return false;
    if (size.width == whole.width && size.height == whole.height &&
        top->samples == s->most_samples) {
        forget_behind(view);
        return false;
    }
    for (uint32_t i = 0; i + 1 < s->area_count; i++) {
        const struct hg_tiled_accumulation_area other = s->areas[i];
        if (other.samples >= top->samples)
            continue;
        s->areas[i] = *top;
        *top = other;
    }
    if (s->behind_there && s->behind_sample == top->samples)
        return false;
    if (s->behind_count == 0 || s->behind_sample != top->samples) {
        s->behind_there = false;
        s->behind_sample = top->samples;
        s->behind_tries = 0;
        s->behind_areas[0] =
            (struct hg_tiled_accumulation_area){.rect.extent = whole, .samples = top->samples};
        s->behind_count = 1;
    }
    return true;
}

static enum hg_status draw_behind(struct hg_view_state *view, struct hg_error *err)
{
    struct hg_tiled_accumulation *s = &view->stream;
    struct hg_page_demand demand;
    enum hg_status status = hg_gpu_buffer_reserve(view->context->gpu, HG_GPU_BUFFER_DEVICE,
        s->progress.size_bytes, "progress behind", &s->behind_progress, err);
    s->behind = true;
    if (status == HG_OK)
        status = hg_frame_cull(view, HG_FRAME_PICTURE, 1, err);
    const bool fits = !view->crowded || s->forced;
    if (status == HG_OK && fits)
        status = run_batch(view, 1, false, &demand, err);
    s->behind = false;
    if (status != HG_OK)
        return status;
    if (!fits) {
        s->shadows = hg_culling_count(view->visible) > 1; // without the camera they may fit
        if (!s->shadows)
            s->forced = !split(s->behind_areas, &s->behind_count);
        return HG_OK;
    }
    s->missing = demand.missing;
    s->waiting = demand.missing > 0;
    s->shadows = demand.shadows;
    if (demand.missing == 0 && !demand.shadows) {
        s->forced = false;
        s->behind_tries = 0;
        s->behind_there = --s->behind_count == 0;
    } else if (!demand.fits || ++s->behind_tries == BEHIND_TRIES) {
        s->behind_tries = 0;
        split(s->behind_areas, &s->behind_count);
    }
    view->number++;
    return HG_OK;
}

static enum hg_status draw_area(
    struct hg_view_state *view, uint32_t max_samples, struct hg_error *err)
{
    struct hg_tiled_accumulation *s = &view->stream;
    if (wants_behind(view))
        return draw_behind(view, err);
    struct hg_tiled_accumulation_area *area = &s->areas[s->area_count - 1];
    struct hg_page_demand demand;
    uint32_t count = view->settings.samples - area->samples;
    count = count < max_samples ? count : max_samples;
    count = count < HG_VIEW_MAX_SAMPLES_PER_STEP ? count : HG_VIEW_MAX_SAMPLES_PER_STEP;
    count = s->behind_there ? 1 : count;
    enum hg_status status = hg_frame_cull(view, HG_FRAME_PICTURE, count, err);
    if (status == HG_OK && view->crowded && !s->forced) {
        s->shadows = hg_culling_count(view->visible) > 1; // without the camera they may fit
        // What even one pixel needs may be more than the budget holds: it is drawn coarser, and the
        // picture says so by its error.
        if (!s->shadows)
            s->forced = !split(s->areas, &s->area_count);
        return HG_OK;
    }
    if (status != HG_OK)
        return status;
    count = hg_frame_batch(view, count);
    status = run_batch(view, count, false, &demand, err);
    if (status != HG_OK)
        return status;
    hg_frame_note_drawn(view, count);
    s->missing = demand.missing;
    s->waiting = demand.missing > 0;
    s->shadows = demand.shadows;
    const uint32_t reached = area->samples + count;
    s->most_samples = reached > s->most_samples ? reached : s->most_samples;
    area->samples =
        demand.missing == 0 && !demand.shadows ? reached : least_samples(view, area->rect);
    s->forced = s->forced && area->samples < view->settings.samples;
    if (area->samples == view->settings.samples)
        s->area_count--;
    else if (!demand.fits)
        split(s->areas, &s->area_count);
    s->uneven = demand.missing > 0 || s->area_count > 1 ||
                (s->area_count == 1 &&
                    s->areas[0].rect.extent.width * (uint64_t)s->areas[0].rect.extent.height <
                        (uint64_t)view->settings.width * view->settings.height);
    count_samples(view);
    view->number++;
    return HG_OK;
}

enum hg_status hg_tiled_accumulation_draw(
    struct hg_view_state *view, uint32_t max_samples, struct hg_error *err)
{
    struct hg_tiled_accumulation *s = &view->stream;
    enum hg_status status = HG_OK;
    bool arrived = true;
    if (s->waiting)
        status = wait_pages(view, &arrived, err);
    if (status != HG_OK || !arrived)
        return status;
    s->waiting = false;
    s->missing = 0;
    if (s->shadows)
        status = finish_shadows(view, err);
    if (status != HG_OK || s->shadows || s->area_count == 0)
        return status;
    return draw_area(view, max_samples, err);
}
