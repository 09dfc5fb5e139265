// shadow.h - draws the shadow maps that are stale into the atlas.
// Floor 3. D32, reversed: 0 = nothing between the light and infinity.
//
// All surfaces cast, both of their sides: blended ones cover the share of texels that their alpha
// says, transmissive ones that of the light that they hold back.
#ifndef HG_RENDERER_PASSES_SHADOW_H
#define HG_RENDERER_PASSES_SHADOW_H

#include "renderer/cull/culling.h"
#include "renderer/light/lighting.h"
#include "renderer/passes/pass.h"

struct hg_shadow_choice {
    bool coarse; // leave out (and leave stale) what only refines the map of the whole scene; the
                 // frame block must carry HG_FRAME_COARSE_SHADOWS then
    bool wait, whole;       // as of struct hg_culling_view
    VkRect2D area;          // of the atlas; nothing else will be drawn. Zero = all of it
    uint32_t share, shares; // as of struct hg_culling_view
};
// Once per step, before hg_culling_upload: adds a set for each map that is stale. Levels of detail
// are as fine as the map's texels, wherever the camera is, so that a map that is kept fits every
// view. HG_E_NOMEM.
enum hg_status hg_shadow_select(const struct hg_geometry *geometry, struct hg_lighting *lighting,
    const struct hg_shadow_choice *choice, struct hg_jobs *jobs, struct hg_culling *visible,
    struct hg_error *err) HG_MUST_CHECK;
// Draws the sets from first_set on, which hg_shadow_select added, before shading; nothing is
// recorded when there are none. A map stays stale while its set is coarser than requested.
// Device errors.
enum hg_status hg_shadow_record(struct hg_pass *pass, struct hg_lighting *lighting, bool coarse,
    const struct hg_culling *visible, uint32_t first_set, struct hg_error *err) HG_MUST_CHECK;
// All pipelines of this pass. *count = how many.
enum hg_status hg_shadow_warm_up(
    struct hg_gpu *gpu, uint32_t index, uint32_t *count, struct hg_error *err) HG_MUST_CHECK;

#endif
