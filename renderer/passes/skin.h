// skin.h - records the poses of skinned and morphed parts that changed.
// Floor 3. Thread: the render thread.
#ifndef HG_RENDERER_PASSES_SKIN_H
#define HG_RENDERER_PASSES_SKIN_H

#include "renderer/geometry/geometry.h"
#include "renderer/gpu/gpu.h"

// Records one dispatch per changed part and makes the streams visible to what follows; nothing when
// no pose changed. Record after hg_geometry_sync and before anything that draws, outside rendering.
// Call hg_geometry_deforms_done once the batch is submitted. Device errors.
enum hg_status hg_skin_record(
    struct hg_gpu_cmd *cmd, const struct hg_geometry *geometry, struct hg_error *err) HG_MUST_CHECK;
// The same in a batch of its own, and waits for it: poses are there when it returns.
enum hg_status hg_skin_run(
    struct hg_gpu *gpu, struct hg_geometry *geometry, struct hg_error *err) HG_MUST_CHECK;

#endif
