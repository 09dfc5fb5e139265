// tiled_accumulation.h - pictures whose textures arrive while they are drawn.
// Floor 4. Thread: the render thread.
//
// Two ways to draw while pages may be missing (texture/cache/page_cache.h):
//   show   one sample with the texels that are there, at once, and again as better ones arrive
//   exact  samples are added pixel by pixel: a pixel that misses a texel keeps waiting at that
//          sample, and what was missing is loaded before it is tried again. When all that waiting
//          pixels need at once does not fit the budget, the picture is cut in two areas that are
//          finished one after the other, as often as it takes. So it is when the geometry of an
//          area does not fit its budget; shadow maps are then made first, from one share of the
//          geometry after the other.
// A view that rests goes from show to exact as soon as nothing is missing, nothing more can be
// loaded, or the mip bias or coarser geometry say that a budget is too small. One that nobody looks
// at before it is settled is exact from the start: its first batch finds out what it needs. Each
// pixel adds the same samples in the same order as ever: the settled picture does not depend on
// budgets, caches or timing.
#ifndef HG_RENDERER_FRAME_TILED_ACCUMULATION_H
#define HG_RENDERER_FRAME_TILED_ACCUMULATION_H

#include "renderer/gpu/gpu.h"
#include "renderer/texture/cache/page_cache.h"

#define HG_TILED_FIND_SMALLER 2  // by which the sides of a picture are that only finds pages
#define HG_TILED_MAX_AREAS    64 // halving 16384 x 16384 px down to one takes 28

struct hg_view_state;

// All pixels inside have at least that many samples. Shadow maps have no samples: depths of one
// share of the geometry after the other are added to them.
struct hg_tiled_accumulation_area {
    VkRect2D rect;
    uint32_t samples;
    uint32_t share, shares; // of shadow maps: the share of the geometry; shares 0 or 1: all of it
};

struct hg_tiled_accumulation {
    bool on;           // pages may be missing: shaders report what they ask for
    bool exact;        // drawing the second way
    uint32_t finding;  // drawing only to learn which pages are needed: how many times smaller
    float wider;       // then: than the view's picture is; 0 = not at all
    bool inexact;      // the newest sample shows coarser texels than it should: it is drawn again
    bool shadows;      // shadow maps were drawn with coarser texels
    bool uneven;       // pixels have different numbers of samples
    bool forced;       // a pixel alone wants more geometry than the budget holds: it gets less
    bool waiting;      // for pages that the newest batch asked for
    uint32_t still;    // debug views: samples in a row for which no page came
    bool has_fallback; // the picture shown by pixels without a sample
    uint32_t missing;  // pages that the newest batch asked for in vain
    float bias;        // of the newest sample
    float fallback_error_px; // of geometry in the picture that stands in
    float shadow_error_px;   // the view's, times the texels that casters may be off; 0: one
    uint32_t run;            // of the newest sample
    struct hg_tiled_accumulation_area areas[HG_TILED_MAX_AREAS]; // a stack; what is not in it is finished
    uint32_t area_count;
    uint32_t most_samples; // that any pixel may have
    struct hg_tiled_accumulation_area
        shadow_areas[HG_TILED_MAX_AREAS]; // the same for the atlas of shadow maps
    uint32_t shadow_count;
    // What lets light through looks into a picture of all that is behind it. Where a picture is
    // drawn in parts, or some pixels are ahead of others, that of one sample is made first, in
    // parts of its own; then all areas get the sample.
    bool behind;            // it is what is being drawn
    bool behind_there;      // it is that of sample behind_sample, all of it
    uint32_t behind_sample; // while it is there or made
    struct hg_tiled_accumulation_area behind_areas[HG_TILED_MAX_AREAS];
    uint32_t behind_count, behind_tries;          // tries: of the area on top that missed pages
    bool shadow_begun;                            // maps were cleared: all else adds to them
    struct hg_gpu_buffer behind_progress;         // as `progress`: there all pixels wait
    struct hg_gpu_buffer progress, progress_read; // [height][width] u32; read: a copy for the host
    struct hg_gpu_image fallback;
};

void hg_tiled_accumulation_finish(struct hg_gpu *gpu, struct hg_tiled_accumulation *stream); // images and buffers
// Something changed: what was accumulated counts no longer. Waits and counts start anew.
void hg_tiled_accumulation_restart(struct hg_view_state *view);
// After a restart of a view that nobody looks at yet: finds out what it needs and turns to exact.
enum hg_status hg_tiled_accumulation_begin_exact(
    struct hg_view_state *view, struct hg_error *err) HG_MUST_CHECK;
// There is nothing that could be shown.
bool hg_tiled_accumulation_is_blank(const struct hg_view_state *view);
// Before a resting view shows the same again: waits a little for pages, or turns to exact.
enum hg_status hg_tiled_accumulation_rest(struct hg_view_state *view, struct hg_error *err) HG_MUST_CHECK;
// After a sample was shown: what it missed. Turns to exact when that was nothing.
enum hg_status hg_tiled_accumulation_shown(struct hg_view_state *view, struct hg_error *err) HG_MUST_CHECK;
// One batch of the exact way, at most max_samples samples. May draw nothing while pages are read.
enum hg_status hg_tiled_accumulation_draw(
    struct hg_view_state *view, uint32_t max_samples, struct hg_error *err) HG_MUST_CHECK;

#endif
