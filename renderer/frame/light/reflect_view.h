// reflect_view.h - reflections of pictures in motion (renderer/reflect/reflect.h).
// Floor 4. Thread: the render thread.
//
// A picture of phase DIRECT with probe light pauses after it: the host reads what the texels of
// probe light mirror with, sends rays, and shading goes on with the light that these brought.
// Without memory for it, or for what rays meet, surfaces mirror what the field of probes says.
#ifndef HG_RENDERER_FRAME_LIGHT_REFLECT_VIEW_H
#define HG_RENDERER_FRAME_LIGHT_REFLECT_VIEW_H

#include "renderer/gi/gi.h"
#include "renderer/gpu/gpu.h"
#include "renderer/reflect/reflect.h"

struct hg_view_state;
struct hg_draw;

// From one picture in motion to the next.
struct hg_reflect_view {
    struct hg_reflect *reflect; // NULL = none yet
    struct hg_gpu_image light;  // probe light with reflections
    struct hg_gpu_buffer back;  // read back: probe light, then what mirrors
    uint32_t *words;            // of `light`
    struct hg_gi_world world;   // of the next picture; no trace: it has no reflections
    struct hg_lighting_sources sources;
    bool caches;
    bool gathers;      // irradiance, too (renderer/irradiance/irradiance.h)
    uint64_t light_of; // revision of the light that is gathered
    float share;       // of texels that send rays, by the governor
    uint64_t settings; // revision that the history is of
};

void hg_reflect_view_finish(struct hg_gpu *gpu, struct hg_reflect_view *reflections);
// After the field of probes was brought up to date, before culling. moves: the next picture is one
// in motion. Device errors.
enum hg_status hg_reflect_view_step(
    struct hg_view_state *view, bool moves, struct hg_error *err) HG_MUST_CHECK;
// Paints where reflections come from over the pixels of a picture in motion.
void hg_reflect_view_show(struct hg_view_state *view, const struct hg_draw *draw);
// Whether the next picture has reflections by rays.
bool hg_reflect_view_is_on(const struct hg_draw *draw);

#endif
