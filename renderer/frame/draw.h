// draw.h - a draw request and its context.
// Floor 4. Thread: the render thread.
//
// A request is created once: by a step for its view, by prefetch for the predicted camera, by a
// preview for one sample. It is immutable while it is drawn; a part of the work that differs has a
// request of its own (hg_draw_with).
#ifndef HG_RENDERER_FRAME_DRAW_H
#define HG_RENDERER_FRAME_DRAW_H

#include "renderer/cull/culling.h"
#include "renderer/frame/history.h"
#include "renderer/frame/phase.h"
#include "renderer/frame/targets.h"
#include "renderer/gpu/readback.h"
#include "renderer/light/lighting.h"
#include "renderer/passes/blend.h"
#include "renderer/passes/unlit_tiles.h"
#include "renderer/scene_gpu/scene_gpu.h"

struct hg_tiled_accumulation;
struct hg_tiled_area;
struct hg_temporal_view;
struct hg_reflect_view;
struct hg_mirror_view;
struct hg_glass_view;
struct hg_view_camera_state;
struct hg_view_settings;

#define HG_VIEW_MAX_STAGES 64

enum hg_draw_flag {
    HG_DRAW_FINAL = 1 << 0,          // not displayed before the picture is settled
    HG_DRAW_WAIT = 1 << 1,           // loads what is missing, for a while
    HG_DRAW_ACCUMULATE = 1 << 2,     // more than RGBA8 will be read: no direct samples
    HG_DRAW_DIRECT = 1 << 3,         // straight to RGBA8 pixels
    HG_DRAW_COARSE_SHADOWS = 1 << 4, // without the finer shadow cascades
    HG_DRAW_EXACT = 1 << 5,          // samples are counted per pixel, inside the area on top
    HG_DRAW_BEHIND = 1 << 6,         // the opaque scene behind transmissive surfaces
    HG_DRAW_MOVES = 1 << 10,         // another picture follows: shadows of some lamps may wait
    HG_DRAW_STILL = 1 << 11,         // the view has come to rest
    HG_DRAW_MOTION = 1 << 7,         // depth is read back for motion vectors (temporal_view.h)
    HG_DRAW_MOTION_IDS = 1 << 8,     // and the visibility buffer: something moved by itself
    HG_DRAW_MOTION_POSED = 1 << 9,   // and where posed surfaces were
    HG_DRAW_CHECKERBOARD = 1 << 16,  // every second pixel of a row is shaded, in turn
};

struct hg_draw_request {
    const struct hg_view_settings *settings;
    const struct hg_view_camera_state *camera;
    uint32_t flags;       // enum hg_draw_flag
    uint32_t samples;     // per pixel until settled, >= 1
    uint32_t max_samples; // of this step, >= 1
    float error_px;       // greatest projected error of geometry, >= that of the settings
    // Prefetch: only the texture requests matter. Image sides are divided by `smaller`, the field
    // of view is widened by `wider`. 0: an ordinary picture.
    uint32_t smaller;
    float wider;
    // Pictures in motion that make up one: number of this one, from 1, and where its sample lies in
    // its pixel; 0: an ordinary picture.
    uint32_t moment;
    float jitter_px[2];
    VkExtent2D drawn; // their size, which history makes that of the settings; zero: no other
};

// --- what lasts from one picture to the next -----------------------------------------------------

// Lists of blended surfaces. Where they take more memory than there is for them, the picture is
// drawn in strips.
struct hg_draw_blend {
    struct hg_blend_lists lists;
    uint32_t nodes, strips; // of the next batch; 0: not known yet
    uint32_t most_nodes;    // of one strip
    bool listed;            // the newest batch had lists
    bool many;              // the newest lists looked at more fragments than there are pixels
    uint32_t unseen;        // pictures in motion without lists since
    bool too_deep;          // the newest picture lacked the deepest surfaces
};

// Unlit tiles; searched for in consecutive pictures in motion.
struct hg_draw_unlit {
    struct hg_unlit_tiles tiles;
    uint32_t wait; // pictures in motion until the next search
    bool found;    // in the newest sample they are marked in the depth
};

// Samples that are enough for each block of pixels of a settled picture
// (shaders/shared/sample_blocks.h).
struct hg_draw_blocks {
    struct hg_gpu_buffer buffer;
    uint32_t *counts; // [rows][columns] the same for the host; NULL: all pixels have all samples
    uint32_t columns;
    uint32_t least; // of counts
};

struct hg_view_stage {
    const char *name; // literal
    uint64_t ns;
};

struct hg_view_stats {
    uint64_t number; // frames with new content
    uint64_t triangles_drawn, triangles_hosted, draws_drawn; // hosted: of those by the host
    uint32_t stale_shadows;
    uint32_t missing_clusters; // missing in the newest sample
    uint64_t step_ns;          // of the newest step that drew something
    uint32_t stage_count;
    struct hg_view_stage stages[HG_VIEW_MAX_STAGES]; // of the newest step
    bool waits; // the newest step, for paths of other views (path_lease.h)
};

// Appends a stage, named by a literal; those beyond HG_VIEW_MAX_STAGES are dropped.
void hg_view_stats_add_stage(struct hg_view_stats *stats, const char *name, uint64_t ns);
// Adds the stages of the device's newest batch, or part of one.
void hg_view_stats_add_device(struct hg_view_stats *stats, const struct hg_gpu *gpu);

struct hg_view_buffers {
    struct hg_gpu_buffer blocks;   // frame blocks of the samples of a batch
    struct hg_gpu_readback readback; // pixels
    struct hg_gpu_buffer pick;     // struct hg_gpu_pick of each pixel that is looked at
    struct hg_gpu_buffer motion;   // depth; visibility (temporal_view.h)
    struct hg_culling *pick_culling; // of what one pixel shows
    struct hg_view_targets grid;     // of hg_view_state_grid; made when first needed
};

// --- one batch -----------------------------------------------------------------------------------

// All is borrowed.
struct hg_draw {
    struct hg_frame_context *context;
    struct hg_scene_gpu *scene_gpu;
    struct hg_lighting *lighting;
    const struct hg_draw_request *request;
    struct hg_view_targets *targets;
    struct hg_culling *culling; // set 0: the camera; then stale shadow maps
    struct hg_gpu_frame *frame; // of the newest sample
    struct hg_view_buffers *buffers;
    struct hg_frame_history *history;
    struct hg_temporal_view *temporal;
    struct hg_reflect_view *reflections;
    struct hg_mirror_view *mirrors;
    struct hg_glass_view *clear_glass;
    struct hg_tiled_accumulation *accumulation;
    struct hg_draw_blend *blend;
    struct hg_draw_unlit *unlit;
    struct hg_view_stats *stats;
    uint64_t settings_revision; // of the view
    struct {
        enum hg_gi_field_kind kind;
        uint64_t view;             // whose camera it is
    } probes;                      // of the scene, that samples are drawn with
    struct hg_gpu_image *gathered; // light on opaque surfaces; NULL: the probes'
    struct hg_gpu_image *glass;    // light by way of transmissive ones; NULL: none was gathered
    const struct hg_draw_blocks *blocks; // NULL: all pixels have all samples
    bool crowded; // of the newest cull: the geometry budget did not hold all that was chosen
};

// Size of the picture that is drawn, px.
VkExtent2D hg_draw_size(const struct hg_draw_request *request);
// What a picture in motion is shaded to.
struct hg_gpu_image *hg_draw_picture(const struct hg_draw *draw);
// The same for another request, which outlives it.
struct hg_draw hg_draw_with(const struct hg_draw *draw, const struct hg_draw_request *request);
bool hg_draw_is(const struct hg_draw *draw, enum hg_draw_flag flag);
// The area that is drawn (tiled_accumulation.h); NULL: the whole picture.
const struct hg_tiled_area *hg_draw_area(const struct hg_draw *draw);
// Some surface that is drawn in layers is not there everywhere.
bool hg_draw_has_holes(const struct hg_draw *draw);
// Number of the first sample of the batch.
uint32_t hg_draw_first_sample(const struct hg_draw *draw);
// The ground of the settings, through the lowest point of the scene's bounds. False: none is asked
// for, or there is no geometry. height: along up, relative to the geometry's origin, metres.
bool hg_draw_ground(const struct hg_draw *draw, float up[3], float *height);
// An image of the drawn size, to draw to; keeps one that is there. HG_E_NOMEM, device errors.
enum hg_status hg_draw_make_image(const struct hg_draw *draw, VkFormat format, const char *name,
    struct hg_gpu_image *image, struct hg_error *err) HG_MUST_CHECK;

#endif
