// rays.h - which texels of reflections send a ray into their lobe, and those rays.
// Floor 2, private to renderer/reflect. Thread: the render thread; on jobs.
#ifndef HG_RENDERER_REFLECT_RAYS_H
#define HG_RENDERER_REFLECT_RAYS_H

#include "renderer/reflect/work.h"

// Fills texels and casts their rays. Device errors.
enum hg_status hg_reflect_cast(struct hg_reflect_work *work, struct hg_error *err) HG_MUST_CHECK;

#endif
