// view.h - one viewer of a scene: camera, parameters, images, accumulation.
// Floor 4. Thread: the render thread. Declared to callers in renderer/renderer.h.
#ifndef HG_RENDERER_FRAME_VIEW_H
#define HG_RENDERER_FRAME_VIEW_H

#include "base/refbuf.h"
#include "renderer/frame/ahead.h"
#include "renderer/frame/camera.h"
#include "renderer/frame/path.h"
#include "renderer/frame/quality.h"
#include "renderer/frame/rooms.h"
#include "renderer/frame/stream.h"
#include "renderer/light/lighting.h"
#include "renderer/passes/dark.h"
#include "renderer/passes/shadow.h"
#include "renderer/passes/visibility.h"

#define HG_VIEW_MAX_SAMPLES_PER_STEP 16
#define HG_VIEW_MAX_SIDE_PX          16384
// Layers of blended surfaces: peeled at first, and at most. What lies deeper than those is not
// seen.
#define HG_VIEW_FIRST_LAYERS  8
#define HG_VIEW_MAX_LAYERS    64
#define HG_FRAME_BLOCK_BYTES  1024
#define HG_VIEW_MAX_STAGES    64
#define HG_VIEW_MODE_REALTIME 0 // as enum hg_render_mode of renderer.h
#define HG_VIEW_MODE_PATH     1
#define HG_VIEW_DARK_AFTER    4 // pictures in motion before dark cells are told apart (passes/dark.h)

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

// In scene space; jitter and near and far are filled in by each step.
struct hg_view_camera_state {
    double eye[3], target[3], up[3];
    bool orthographic;
    float vfov_rad, half_height, near, far;
    float lens_radius, focus_distance; // metres; 0 = no lens, at the target
    uint64_t input_seq;
    uint64_t node;                                  // that it was taken from; 0 = none
    bool moves;                                     // a frame later it stands
    double next_eye[3], next_target[3], next_up[3]; // here; at other times on the line
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
    struct hg_rooms *rooms;
    struct hg_lighting *lighting;
    struct hg_view_settings settings;
    struct hg_view_camera_state camera;
    uint64_t settings_revision, camera_revision;
    struct hg_view_key key;

    struct hg_gpu_image visibility, depth, accumulated;
    struct hg_gpu_image layers[2], layer_visibility, layer_color; // while blended draws are seen
    struct hg_gpu_image behind;    // the opaque scene, while draws that let light through are
    struct hg_gpu_image pixels[3]; // RGBA8, RGBA16, RGBA32F; made on first read
    struct hg_gpu_buffer blocks, readback, pick;
    struct hg_gpu_buffer layers_full; // per sample of a batch: its last layer held something
    struct hg_dark dark;
    uint32_t dark_wait;         // pictures in motion until dark cells are looked for
    bool dark_told;             // in the newest sample they were
    struct hg_visible *visible; // set 0: the camera; then stale shadow maps
    struct hg_gpu_frame frame;  // of the newest sample
    struct hg_stream stream;
    struct hg_ahead ahead;
    struct hg_path *path;     // made when the mode asks for it
    uint8_t *path_checkpoint; // to go on from (path_save.c); NULL = none
    struct hg_denoise *path_history; // that was loaded for the next picture; NULL = none
    bool path_begins;         // its next step begins a picture
    bool path_preview;        // `accumulated` holds a real-time sample of the same state

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
    struct hg_visible *pick_visible; // what one pixel shows
    struct hg_quality quality;
    uint64_t triangles_drawn, draws_drawn;
    struct hg_view_stage stages[HG_VIEW_MAX_STAGES];
    uint32_t stage_count;
    uint64_t step_ns; // of the newest step that drew something
};

enum hg_status hg_view_state_init(struct hg_view_state *view, struct hg_frame_context *context,
    struct hg_scene *scene, struct hg_error *err) HG_MUST_CHECK;
void hg_view_state_finish(struct hg_view_state *view); // accepts a zeroed one

// HG_E_LIMIT when images of that size are not to be had; the old settings stay.
enum hg_status hg_view_state_set(struct hg_view_state *view,
    const struct hg_view_settings *settings, struct hg_error *err) HG_MUST_CHECK;
void hg_view_state_look(struct hg_view_state *view, const struct hg_view_camera_state *camera);

// One slice: up to max_samples samples, in one batch. In motion (max_samples 1 and something has
// changed) cascades that would have to be drawn again are left out: the map of the whole scene
// serves until the view rests, then accumulation starts with all of them. Such a sample that will
// not be the last one becomes RGBA8 pixels at once.
enum hg_status hg_view_state_step(
    struct hg_view_state *view, uint32_t max_samples, struct hg_error *err) HG_MUST_CHECK;
// Projected error of the geometry in the newest sample.
float hg_view_error_px(const struct hg_view_state *view);
bool hg_view_state_settled(const struct hg_view_state *view);
// Of the real-time picture that was drawn last.
bool hg_view_state_has_planes(const struct hg_view_state *view);
// format index as in `pixels`; size in bytes of *out: width * height * bytes per pixel.
enum hg_status hg_view_state_read(struct hg_view_state *view, uint32_t format,
    struct hg_refbuf **out, struct hg_error *err) HG_MUST_CHECK;
struct hg_gpu_pick;
enum hg_status hg_view_state_pick(struct hg_view_state *view, uint32_t x, uint32_t y,
    struct hg_gpu_pick *out, struct hg_error *err) HG_MUST_CHECK;

// frame.c: what one batch draws. Sync and cull before the batch is begun: they may submit copies of
// their own.
enum hg_status hg_frame_sync(struct hg_view_state *view, struct hg_error *err) HG_MUST_CHECK;
enum hg_frame_part { HG_FRAME_PICTURE, HG_FRAME_SHADOWS };
// Chooses what the batch draws: camera and stale shadow maps, or the latter alone, inside of the
// area that is drawn, for the next `samples` samples or fewer. view->crowded in exact mode: it is
// not all there and must not be drawn.
enum hg_status hg_frame_cull(struct hg_view_state *view, enum hg_frame_part part, uint32_t samples,
    struct hg_error *err) HG_MUST_CHECK;
// What the camera sees of a rectangle of the image, all of it loaded at once.
enum hg_status hg_frame_cull_part(struct hg_view_state *view, VkRect2D part,
    struct hg_visible *visible, struct hg_error *err) HG_MUST_CHECK;
// Materials of the scene let light through.
bool hg_frame_transmits(const struct hg_view_state *view);
// How many of so many samples one batch takes: what the host draws of them needs memory.
uint32_t hg_frame_batch(const struct hg_view_state *view, uint32_t samples);
enum hg_status hg_frame_record(struct hg_view_state *view, struct hg_gpu_cmd *cmd, uint32_t samples,
    struct hg_error *err) HG_MUST_CHECK;
// After the batch: how much it drew; whether it had too few layers, and then how many the next one
// peels.
void hg_frame_note_drawn(struct hg_view_state *view, uint32_t samples);
// Only what its pixels ask of textures counts; the camera is the one that the view has now.
enum hg_status hg_frame_record_ahead(
    struct hg_view_state *view, struct hg_gpu_cmd *cmd, struct hg_error *err) HG_MUST_CHECK;
// Shadow maps that are stale, nothing else. After a cull of HG_FRAME_SHADOWS.
enum hg_status hg_frame_record_shadows(
    struct hg_view_state *view, struct hg_gpu_cmd *cmd, struct hg_error *err) HG_MUST_CHECK;
// Block of one sample (index into the accumulation; jitter on or off) at `slot`; the pass for it.
struct hg_pass hg_frame_pass(struct hg_view_state *view, struct hg_gpu_cmd *cmd, uint32_t slot);
void hg_frame_fill(struct hg_view_state *view, uint32_t sample, bool jitter, uint32_t slot);
// For paths: no jitter, pages waited for.
void hg_frame_fill_path(struct hg_view_state *view);
// Another camera for the same picture, without jitter.
void hg_frame_camera(const struct hg_view_state *view, const struct hg_view_camera_state *camera,
    struct hg_gpu_camera *out);
void hg_view_add_stage(struct hg_view_state *view, const char *name, uint64_t ns);

#endif
