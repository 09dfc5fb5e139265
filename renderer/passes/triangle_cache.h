// triangle_cache.h - records updates of the triangle cache for changed draws.
// Floor 3. Thread: the render thread.
#ifndef HG_RENDERER_PASSES_TRIANGLE_CACHE_H
#define HG_RENDERER_PASSES_TRIANGLE_CACHE_H

#include "renderer/geometry/geometry.h"
#include "renderer/passes/pass.h"

// One dispatch per changed draw; nothing when there is no triangle cache or none changed. Record
// after poses and before anything that shades, outside rendering. Call
// hg_geometry_triangle_cache_done once the batch is submitted. Device errors.
enum hg_status hg_triangle_cache_record(
    struct hg_pass *pass, const struct hg_geometry *geometry, struct hg_error *err) HG_MUST_CHECK;

#endif
