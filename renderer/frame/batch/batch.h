// batch.h - one batch: sync the device, cull, record samples.
// Floor 4. Thread: the render thread. Sync and cull before the batch is begun: they may submit
// copies of their own.
#ifndef HG_RENDERER_FRAME_BATCH_BATCH_H
#define HG_RENDERER_FRAME_BATCH_BATCH_H

#include "renderer/frame/state.h"

// --- block.c: the uniform block of a sample ------------------------------------------------------

// Size of the picture that is drawn, px. Not that of the settings with temporal upscaling, and
// where a picture only finds the texture pages that are needed.
VkExtent2D hg_frame_size(const struct hg_draw *draw);
// The view's camera for a picture of that size, relative to the geometry's origin; no jitter.
struct hg_camera_setup hg_frame_setup(const struct hg_draw *draw);
// Height that is drawn over that of the settings: 1, or less in motion with temporal upscaling.
float hg_frame_scale(const struct hg_draw *draw);
// Block of one sample (index into the accumulation; jitter on or off) at `slot`; the pass for it.
struct hg_pass hg_frame_pass(struct hg_draw *draw, struct hg_gpu_cmd *cmd, uint32_t slot);
// `pass` reads the draws and materials of the scene in place of those that the view shows.
void hg_frame_pass_use_scene(const struct hg_draw *draw, struct hg_pass *pass);
void hg_frame_fill(struct hg_draw *draw, uint32_t sample, bool jitter, uint32_t slot);
// For paths: no jitter, pages waited for.
void hg_frame_fill_path(struct hg_view_state *view);
// streams: pages may be missing, so shaders report the pages that they request.
struct hg_pass hg_frame_pass_path(struct hg_view_state *view, struct hg_gpu_cmd *cmd, bool streams);

// --- cull.c: culling -----------------------------------------------------------------------------

enum hg_frame_part { HG_FRAME_PICTURE, HG_FRAME_SHADOWS };
// Culls camera and stale shadow maps, or only the latter, inside of the drawn area, for at most the
// next `samples` samples. draw->crowded in exact mode: not all of it is resident, and it must not
// be drawn.
enum hg_status hg_frame_cull(struct hg_draw *draw, enum hg_frame_part part, uint32_t samples,
    struct hg_error *err) HG_MUST_CHECK;
// Culls a rectangle of the drawn size for the camera, and loads all of it at once.
enum hg_status hg_frame_cull_part(
    struct hg_draw *draw, VkRect2D part, struct hg_error *err) HG_MUST_CHECK;
// Culls a rectangle of the drawn size for what the planes of the frame block cut, both sides of it.
enum hg_status hg_frame_cull_cuts(
    struct hg_draw *draw, VkRect2D part, struct hg_error *err) HG_MUST_CHECK;
// Culls the whole picture for the camera, for hg_frame_record_prefetch; no shadow maps.
enum hg_status hg_frame_cull_prefetch(struct hg_draw *draw, struct hg_error *err) HG_MUST_CHECK;
// Sample positions of a picture of that size: pixel centres.
struct hg_culling_lens hg_frame_lens(const struct hg_gpu_camera *camera, VkExtent2D size);

// --- batch.c -------------------------------------------------------------------------------------

// How long a step waits for hierarchies in the LOD build queue.
#define HG_FRAME_BUILD_WAIT_NS UINT64_C(20000000)
// Brings geometry, texture pages and lights of the scene up to date on the device.
enum hg_status hg_frame_sync(struct hg_draw *draw, struct hg_error *err) HG_MUST_CHECK;
// Whether the scene has transmissive materials.
bool hg_frame_transmits(const struct hg_draw *draw);
// How many of `samples` one batch may take: pixels that the host draws need memory for each.
uint32_t hg_frame_batch(const struct hg_draw *draw, uint32_t samples);
// After the batch: statistics of what it drew, hg_frame_note_blend.
void hg_frame_note_drawn(struct hg_draw *draw, uint32_t samples);

// --- blend.c: the passes of blended surfaces -----------------------------------------------------

// After the batch: whether its lists of blended surfaces had too little memory, and then how much
// the next one takes.
void hg_frame_note_blend(struct hg_draw *draw, uint32_t samples);

// --- graph.c: the passes of a batch --------------------------------------------------------------

// Moved geometry, stale shadow maps and samples of the picture, or a debug view. After a cull of
// HG_FRAME_PICTURE.
enum hg_status hg_frame_record(struct hg_draw *draw, struct hg_gpu_cmd *cmd, uint32_t samples,
    struct hg_error *err) HG_MUST_CHECK;
// A picture of which only the texture requests matter.
enum hg_status hg_frame_record_prefetch(
    struct hg_draw *draw, struct hg_gpu_cmd *cmd, struct hg_error *err) HG_MUST_CHECK;
// Shadow maps that are stale, nothing else. After a cull of HG_FRAME_SHADOWS.
enum hg_status hg_frame_record_shadows(
    struct hg_draw *draw, struct hg_gpu_cmd *cmd, struct hg_error *err) HG_MUST_CHECK;
// Resolves what is accumulated to targets.pixels[format], and copies that to `readback`.
enum hg_status hg_frame_record_read(struct hg_draw *draw, struct hg_gpu_cmd *cmd, uint32_t format,
    struct hg_error *err) HG_MUST_CHECK;
// Surface points of `pixels`, to `pick`. After hg_frame_cull_part of them.
enum hg_status hg_frame_record_pick(struct hg_draw *draw, struct hg_gpu_cmd *cmd, VkRect2D pixels,
    struct hg_error *err) HG_MUST_CHECK;

#endif
