// shadow.h - draws the shadow maps that are stale into the atlas.
// Floor 3. D32, reversed: 0 = nothing between the light and infinity.
//
// Opaque and masked surfaces cast, both of their sides; blended ones do not (they would have to
// cast coloured, partial shadows; the path tracer does).
#ifndef HG_RENDERER_PASSES_SHADOW_H
#define HG_RENDERER_PASSES_SHADOW_H

#include "renderer/geometry/geometry.h"
#include "renderer/light/lighting.h"
#include "renderer/passes/pass.h"

// Call once per step before shading. `scratch` keeps the memory of draw lists between uses. When
// nothing is stale nothing is recorded. coarse: leave out (and leave stale) what only refines the
// map of the whole scene; the frame block must carry HG_FRAME_COARSE_SHADOWS then. HG_E_NOMEM,
// device errors.
enum hg_status hg_shadow_record(struct hg_pass *pass, const struct hg_geometry *geometry,
    struct hg_lighting *lighting, bool coarse, struct hg_draw_ranges *scratch,
    struct hg_error *err) HG_MUST_CHECK;
// All pipelines of this pass. *count = how many.
enum hg_status hg_shadow_warm_up(
    struct hg_gpu *gpu, uint32_t index, uint32_t *count, struct hg_error *err) HG_MUST_CHECK;

#endif
