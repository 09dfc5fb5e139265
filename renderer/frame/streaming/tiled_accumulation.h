// tiled_accumulation.h - accumulation while texture pages and chunks are streamed.
// Floor 4. Thread: the render thread.
//
// Two ways to draw while pages may be missing (texture/cache/page_cache.h):
//   show   one sample with the resident texels, immediately, and again as better ones arrive
//   exact  samples are added pixel by pixel: a pixel that misses a texel stays at that sample until
//          the page is loaded. When the pages of all waiting pixels exceed the budget, the area is
//          split in two that are finished one after the other, recursively. The same happens when
//          the geometry of an area exceeds its budget; shadow maps are then completed first, from
//          one share of the geometry after the other.
// A resting view goes from show to exact as soon as nothing is missing, nothing more can be loaded,
// or the mip bias or coarser geometry show that a budget is too small. A view that is not displayed
// before it is settled is exact from the start: its first batch finds the pages that it needs. Each
// pixel adds the same samples in the same order in either case: the settled picture does not depend
// on budgets, caches or timing. In the same way a large picture is cut where others wait for the
// device.
#ifndef HG_RENDERER_FRAME_STREAMING_TILED_ACCUMULATION_H
#define HG_RENDERER_FRAME_STREAMING_TILED_ACCUMULATION_H

#include "renderer/frame/draw.h"
#include "renderer/frame/streaming/tiled_areas.h"
#include "renderer/texture/cache/page_cache.h"

#define HG_TILED_FIND_SMALLER 2 // by which the sides of a picture are that only finds pages

// What the accumulated samples were made of; any difference restarts.
struct hg_view_key {
    uint64_t scene, environment, geometry, settings, camera;
    uint64_t gi; // enum hg_gi_view_stage
};

// Texture page requests of the newest batch.
struct hg_tiled_pages {
    bool on;          // pages may be missing: shaders report requests
    bool waiting;     // for requests of the newest batch
    uint32_t missing; // requests that were not resident
    uint32_t still;   // debug views: samples in a row for which no page came
    uint32_t run;     // of the newest sample
    float bias;       // of the newest sample
};

// The atlas of shadow maps.
struct hg_tiled_shadows {
    bool coarse_texels; // maps were drawn with coarser texels
    bool begun;         // maps were cleared: all else adds to them
    uint32_t pictures;  // that were displayed since; and the pages that had been loaded by then
    uint64_t loaded;
    float error_px; // the view's, times the texels that casters may be off; 0: one
    struct hg_tiled_areas areas;
};

// Transmissive surfaces sample a background picture of the opaque scene behind them. Where a
// picture is drawn in areas, or pixels have different numbers of samples, the background of one
// sample is completed first, in areas of its own; then all areas get that sample.
struct hg_tiled_behind {
    bool there;      // it is that of `sample`, all of it
    uint32_t sample; // while it is there or made
    uint32_t tries;  // of the area on top that missed pages
    struct hg_tiled_areas areas;
    struct hg_gpu_buffer progress; // as that of the picture: there all pixels wait
};

// Areas of pictures that are not displayed before they are settled, while others wait for the
// device.
struct hg_tiled_slices {
    uint64_t ns; // that a batch takes about; 0: no matter how long
    float px_ns; // that a sample of a pixel took, in the newest batch; 0: not known
};

struct hg_tiled_accumulation {
    struct hg_view_key key;
    enum hg_view_phase phase;
    uint32_t shortfall;    // enum hg_view_shortfall
    uint32_t samples;      // that all pixels have
    uint32_t most_samples; // that any pixel may have
    float error_px;        // of geometry in the picture
    bool uneven;           // pixels have different numbers of samples
    bool forced; // a single pixel needs more geometry than the budget holds: it is drawn coarser
    bool has_fallback;       // the picture displayed for pixels without a sample
    float fallback_error_px; // of geometry in it
    struct hg_gpu_image fallback;
    struct hg_gpu_buffer progress, progress_read; // [height][width] u32; read: a copy for the host
    struct hg_tiled_areas areas;
    struct hg_tiled_pages pages;
    struct hg_tiled_shadows shadows;
    struct hg_tiled_behind behind;
    struct hg_tiled_slices slices;
};

// Frees images and buffers that depend on the size. Nothing may be drawing.
void hg_tiled_accumulation_finish(struct hg_gpu *gpu, struct hg_tiled_accumulation *accumulation);
// Restarts after a change: discards samples, resets waits and counters.
void hg_tiled_accumulation_restart(
    struct hg_tiled_accumulation *accumulation, struct hg_lighting *lighting);
// The picture of a view that is not displayed yet is to be drawn in areas from the start.
bool hg_tiled_accumulation_slices(const struct hg_draw *draw);
// Before the picture of another state is displayed: shadow maps that were drawn with coarser texels
// are to be drawn again, when those have come.
void hg_tiled_accumulation_sharpen_shadows(const struct hg_draw *draw);
// After a restart of a view that is not displayed yet: collects its requests and switches to exact.
enum hg_status hg_tiled_accumulation_begin_exact(
    const struct hg_draw *draw, struct hg_error *err) HG_MUST_CHECK;
// There is nothing that could be shown.
bool hg_tiled_accumulation_is_blank(const struct hg_tiled_accumulation *accumulation);
// Sets or clears shortfall bits of the newest samples.
void hg_tiled_accumulation_note(
    struct hg_tiled_accumulation *accumulation, enum hg_view_shortfall what, bool lacks);
// Before a resting view repeats a provisional sample: waits briefly for pages, or switches to
// exact.
enum hg_status hg_tiled_accumulation_rest(
    const struct hg_draw *draw, struct hg_error *err) HG_MUST_CHECK;
// Waits until the pages that displayed samples missed are there, so long at most.
enum hg_status hg_tiled_accumulation_await(
    const struct hg_draw *draw, uint64_t most_ns, struct hg_error *err) HG_MUST_CHECK;
// After a displayed sample: evaluates what it missed, and the next phase. Switches to exact when
// nothing was missing.
enum hg_status hg_tiled_accumulation_shown(
    const struct hg_draw *draw, struct hg_error *err) HG_MUST_CHECK;
// One batch in exact mode. May draw nothing while pages are loaded.
enum hg_status hg_tiled_accumulation_draw(
    const struct hg_draw *draw, struct hg_error *err) HG_MUST_CHECK;
// Projected error of the geometry in what is shown, where asked_px was asked for.
float hg_tiled_accumulation_error_px(
    const struct hg_tiled_accumulation *accumulation, float asked_px);
void hg_tiled_accumulation_mark_shadows(struct hg_lighting *lighting, bool stale); // all maps

#endif
