// state.h - what a view is: camera, parameters, images, how far the picture is.
// Floor 4. Thread: the render thread.
//
// The files of this room call each other downwards only:
//   view.h                         one step of a view; reading
//   tiled_accumulation.h, prefetch.h, path_view.h
//                                  how its picture comes about when not all fits at once, what
//                                  comes next, paths
//   frame.h                        what one batch draws
//   state.h
#ifndef HG_RENDERER_FRAME_STATE_H
#define HG_RENDERER_FRAME_STATE_H

#include "renderer/frame/prefetch.h"
#include "renderer/camera/camera.h"
#include "renderer/pathtrace/path.h"
#include "renderer/frame/history.h"
#include "renderer/frame/quality.h"
#include "renderer/frame/targets.h"
#include "renderer/scene_gpu/scene_gpu.h"
#include "renderer/frame/tiled_accumulation.h"
#include "renderer/light/lighting.h"
#include "renderer/passes/unlit_tiles.h"
#include "renderer/passes/shadow.h"
#include "renderer/passes/visibility.h"

#define HG_VIEW_MAX_SAMPLES_PER_STEP 16
#define HG_VIEW_MAX_SIDE_PX          16384
// Layers of blended surfaces: peeled at first, and at most. What lies deeper than those is not
// seen.
#define HG_VIEW_FIRST_LAYERS  8
#define HG_VIEW_MAX_LAYERS    64
// Of one sample: the frame block, and behind it the frame before (history.h).
#define HG_FRAME_BLOCK_BYTES   1536
#define HG_FRAME_HISTORY_BYTES 512
#define HG_FRAME_SLOT_BYTES    (HG_FRAME_BLOCK_BYTES + HG_FRAME_HISTORY_BYTES)
#define HG_VIEW_MAX_STAGES    64
#define HG_VIEW_MODE_REALTIME 0 // as enum hg_render_mode of renderer.h
#define HG_VIEW_MODE_PATH     1
#define HG_VIEW_DARK_AFTER    4 // pictures in motion before dark cells are told apart (passes/unlit_tiles.h)

struct hg_view_settings {
    uint32_t width, height; // px
    uint32_t tonemap;       // HG_FRAME_TONEMAP_*
    uint32_t background;    // HG_BACKGROUND_MODE_*
    float background_color[3];
    float exposure;   // linear factor
    uint32_t samples; // per pixel until settled, >= 1
    uint32_t seed;
    uint32_t debug;  // enum hg_debug_view of renderer.h; 0 = the picture
    float error_px;  // greatest projected error of geometry
    float target_ms; // frame time in motion that quality gives way to; 0 = none
    uint32_t mode;   // HG_VIEW_MODE_*
    struct hg_path_settings path;
};

// What the accumulated samples were made of; any difference restarts.
struct hg_view_key {
    uint64_t scene, environment, geometry, settings, camera;
};

struct hg_view_stage {
    const char *name; // literal
    uint64_t ns;
};

struct hg_view_state {
    struct hg_frame_context *context;
    struct hg_scene_gpu *scene_gpu;
    struct hg_lighting *lighting;
    struct hg_view_settings settings;
    struct hg_view_camera_state camera;
    uint64_t settings_revision, camera_revision;
    struct hg_view_key key;

    struct hg_view_targets targets;
    struct hg_frame_history history;
    struct hg_gpu_buffer blocks, readback, pick;
    struct hg_gpu_buffer layers_full; // per sample of a batch: its last layer held something
    struct hg_unlit_tiles dark;
    uint32_t dark_wait;         // pictures in motion until dark cells are looked for
    bool dark_told;             // in the newest sample they were
    struct hg_culling *visible; // set 0: the camera; then stale shadow maps
    struct hg_gpu_frame frame;  // of the newest sample
    struct hg_tiled_accumulation stream;
    struct hg_prefetch ahead;
    struct hg_path *path; // made when the mode asks for it
    bool path_begins;  // its next step begins a picture: the film is of an older one
    bool path_preview; // `accumulated` holds a real-time sample of the same state

    uint64_t number; // frames that changed something
    uint32_t samples;
    uint32_t stale_shadows;
    bool coarse;     // the newest sample went without finer cascades; the next one starts anew
    bool direct;     // the newest sample went straight to pixels[0] and `readback`, and was not
                     // accumulated; the next one starts anew
    bool accumulate; // no direct samples
    uint32_t layer_limit; // layers that the next step peels
    bool shallow;         // the newest samples may lack deeper layers; the next one starts anew
    bool too_deep_told;   // even HG_VIEW_MAX_LAYERS were not enough
    bool final;           // nobody looks before the picture is settled
    bool wait;            // this step loads what is missing
    bool eased;           // its error was raised to keep to the frame time
    float error_px;       // of geometry, asked for by the newest sample
    uint32_t missing_clusters; // chunks that the newest sample went without
    bool crowded;              // the geometry budget did not hold all that the newest cull wanted
    bool clipped;              // so the picture shown is coarser than asked for
    float shown_error_px;      // of geometry in the picture
    struct hg_culling *pick_visible; // what one pixel shows
    struct hg_quality quality;
    uint64_t triangles_drawn, draws_drawn;
    struct hg_view_stage stages[HG_VIEW_MAX_STAGES];
    uint32_t stage_count;
    uint64_t step_ns; // of the newest step that drew something
};

void hg_view_add_stage(struct hg_view_state *view, const char *name, uint64_t ns);
// An image of the view's size, to draw to; keeps one that is there. HG_E_NOMEM, device errors.
enum hg_status hg_view_make_image(struct hg_view_state *view, VkFormat format, const char *name,
    struct hg_gpu_image *image, struct hg_error *err) HG_MUST_CHECK;
// Projected error of the geometry in the newest sample.
float hg_view_error_px(const struct hg_view_state *view);
// The area that is drawn now (stream.h); NULL: not in areas.
const struct hg_tiled_accumulation_area *hg_view_area(const struct hg_view_state *view);
// Number of the first sample of the next batch.
uint32_t hg_view_first_sample(const struct hg_view_state *view);
void hg_view_mark_shadows(struct hg_view_state *view, bool stale); // all maps

#endif
