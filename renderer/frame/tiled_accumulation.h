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

#include "renderer/frame/draw.h"
#include "renderer/texture/cache/page_cache.h"

#define HG_TILED_FIND_SMALLER 2  // by which the sides of a picture are that only finds pages
#define HG_TILED_MAX_AREAS    64 // halving 16384 x 16384 px down to one takes 28

// All pixels inside have at least that many samples. Shadow maps have no samples: depths of one
// share of the geometry after the other are added to them.
struct hg_tiled_area {
    VkRect2D rect;
    uint32_t samples;
    uint32_t share, shares; // of shadow maps: the share of the geometry; shares 0 or 1: all of it
};

// A stack; what is not in it is finished.
struct hg_tiled_areas {
    struct hg_tiled_area items[HG_TILED_MAX_AREAS];
    uint32_t count;
};

// What the accumulated samples were made of; any difference restarts.
struct hg_view_key {
    uint64_t scene, environment, geometry, settings, camera;
};

// Texture pages that the newest batch asked for.
struct hg_tiled_pages {
    bool on;          // pages may be missing: shaders report what they ask for
    bool waiting;     // for pages that the newest batch asked for
    uint32_t missing; // that it asked for in vain
    uint32_t still;   // debug views: samples in a row for which no page came
    uint32_t run;     // of the newest sample
    float bias;       // of the newest sample
};

// The atlas of shadow maps.
struct hg_tiled_shadows {
    bool coarse_texels; // maps were drawn with coarser texels
    bool begun;         // maps were cleared: all else adds to them
    float error_px;     // the view's, times the texels that casters may be off; 0: one
    struct hg_tiled_areas areas;
};

// What lets light through looks into a picture of all that is behind it. Where a picture is drawn
// in parts, or some pixels are ahead of others, that of one sample is made first, in parts of its
// own; then all areas get the sample.
struct hg_tiled_behind {
    bool there;      // it is that of `sample`, all of it
    uint32_t sample; // while it is there or made
    uint32_t tries;  // of the area on top that missed pages
    struct hg_tiled_areas areas;
    struct hg_gpu_buffer progress; // as that of the picture: there all pixels wait
};

struct hg_tiled_accumulation {
    struct hg_view_key key;
    enum hg_view_phase phase;
    uint32_t shortfall;    // enum hg_view_shortfall
    uint32_t samples;      // that all pixels have
    uint32_t most_samples; // that any pixel may have
    float error_px;        // of geometry in the picture
    bool uneven;           // pixels have different numbers of samples
    bool forced;           // a pixel alone wants more geometry than the budget holds: it gets less
    bool has_fallback;     // the picture shown by pixels without a sample
    float fallback_error_px; // of geometry in it
    struct hg_gpu_image fallback;
    struct hg_gpu_buffer progress, progress_read; // [height][width] u32; read: a copy for the host
    struct hg_tiled_areas areas;
    struct hg_tiled_pages pages;
    struct hg_tiled_shadows shadows;
    struct hg_tiled_behind behind;
};

// Images and buffers. Nothing is drawn any more, but what fits pictures of any size stays.
void hg_tiled_accumulation_finish(struct hg_gpu *gpu, struct hg_tiled_accumulation *accumulation);
// Something changed: what was accumulated counts no longer. Waits and counts start anew.
void hg_tiled_accumulation_restart(
    struct hg_tiled_accumulation *accumulation, struct hg_lighting *lighting);
// After a restart of a view that nobody looks at yet: finds out what it needs and turns to exact.
enum hg_status hg_tiled_accumulation_begin_exact(
    const struct hg_draw *draw, struct hg_error *err) HG_MUST_CHECK;
// There is nothing that could be shown.
bool hg_tiled_accumulation_is_blank(const struct hg_tiled_accumulation *accumulation);
// Sets or clears what the newest samples lack.
void hg_tiled_accumulation_note(
    struct hg_tiled_accumulation *accumulation, enum hg_view_shortfall what, bool lacks);
// Before a resting view shows the same again: waits a little for pages, or turns to exact.
enum hg_status hg_tiled_accumulation_rest(
    const struct hg_draw *draw, struct hg_error *err) HG_MUST_CHECK;
// After a sample was shown: what it missed, and the phase that follows from it. Turns to exact when
// that was nothing.
enum hg_status hg_tiled_accumulation_shown(
    const struct hg_draw *draw, struct hg_error *err) HG_MUST_CHECK;
// One batch of the exact way. May draw nothing while pages are read.
enum hg_status hg_tiled_accumulation_draw(
    const struct hg_draw *draw, struct hg_error *err) HG_MUST_CHECK;
// Projected error of the geometry in what is shown, where asked_px was asked for.
float hg_tiled_accumulation_error_px(
    const struct hg_tiled_accumulation *accumulation, float asked_px);
void hg_tiled_accumulation_mark_shadows(struct hg_lighting *lighting, bool stale); // all maps

#endif
