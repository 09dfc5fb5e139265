// rays.h - which texels of reflections send a ray into their lobe, and those rays.
// Floor 2, private to renderer/reflect. Thread: the render thread; on jobs.
#ifndef HG_RENDERER_REFLECT_RAYS_H
#define HG_RENDERER_REFLECT_RAYS_H

#include "renderer/reflect/work.h"

// Where a texel of probe light is, its normal and the way to the eye; out->depth is set.
void hg_reflect_place(
    const struct hg_reflect_work *work, uint32_t x, uint32_t y, struct hg_reflect_texel *out);
// Fills texels of both levels and casts their rays. Device errors.
enum hg_status hg_reflect_cast(struct hg_reflect_work *work, struct hg_error *err) HG_MUST_CHECK;

#endif
