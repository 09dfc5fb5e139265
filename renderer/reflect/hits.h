// hits.h - light of what the rays of reflections meet: the radiance cache's, else shaded.
// Floor 2, private to renderer/reflect. Thread: the render thread; on jobs.
#ifndef HG_RENDERER_REFLECT_HITS_H
#define HG_RENDERER_REFLECT_HITS_H

#include "renderer/reflect/work.h"

// Adds what rays brought to the sums. Device errors.
enum hg_status hg_reflect_shade(
    const struct hg_reflect_work *work, struct hg_error *err) HG_MUST_CHECK;

#endif
