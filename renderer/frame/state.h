// state.h - the state of a view.
// Floor 4. Thread: the render thread.
//
// The files of this room call each other downwards, but for the passes of light/ and
// temporal_view.c that batch/graph.c declares with its own (batch/recording.h):
//   view.h                        one step of a view; reading
//   exposure/, light/, paths/     metering; light by rays (probes, gathered light, reflections,
//                                 mirrors, glass); paths, and which views may trace them at rest
//   streaming/, temporal_view.h   pictures while pages are streamed, and pictures made of several
//   quality/                      how coarse pictures in motion may be
//   batch/                        what one batch draws
//   draw.h                        what is to be drawn, and what it is drawn with
//   look/                         how the view shows its scene; caps and outlines
//   phase.h, targets.h            how far the picture is; its images
#ifndef HG_RENDERER_FRAME_STATE_H
#define HG_RENDERER_FRAME_STATE_H

#include "renderer/camera/camera.h"
#include "renderer/frame/draw.h"
#include "renderer/frame/streaming/prefetch.h"
#include "renderer/pathtrace/path.h"
#include "renderer/frame/light/glass_view.h"
#include "renderer/frame/history.h"
#include "renderer/frame/look/look.h"
#include "renderer/frame/light/mirror_view.h"
#include "renderer/frame/quality/quality.h"
#include "renderer/frame/light/reflect_view.h"
#include "renderer/frame/temporal_view.h"
#include "renderer/frame/streaming/tiled_accumulation.h"
#include "renderer/passes/shadow.h"
#include "renderer/passes/visibility.h"

#define HG_VIEW_MAX_SAMPLES_PER_STEP 16
#define HG_VIEW_MAX_SIDE_PX          16384
// Of one sample: the frame block, and behind it the frame before (history.h).
#define HG_FRAME_BLOCK_BYTES   1536
#define HG_FRAME_HISTORY_BYTES 512
#define HG_FRAME_SLOT_BYTES    (HG_FRAME_BLOCK_BYTES + HG_FRAME_HISTORY_BYTES)
#define HG_VIEW_MODE_REALTIME  0 // as enum hg_render_mode of renderer.h
#define HG_VIEW_MODE_PATH      1
#define HG_VIEW_AO_NONE        1 // as enum hg_view_ao
#define HG_VIEW_MIRRORS_NONE          1 // as enum hg_view_mirrors
#define HG_VIEW_TEMPORAL_NONE  0 // as enum hg_view_temporal
#define HG_VIEW_TEMPORAL_AUTO         1
#define HG_VIEW_TEMPORAL_CHECKERBOARD 2
#define HG_VIEW_SHADOWS_AUTO          0 // as enum hg_view_shadow_maps
#define HG_VIEW_SHADOWS_VIRTUAL       2
// Pictures in motion before unlit tiles are searched for (passes/unlit_tiles.h).
#define HG_VIEW_UNLIT_AFTER 4

#define HG_VIEW_GI_NONE   0
#define HG_VIEW_GI_PROBES 1 // global illumination comes from a field of probes
#define HG_VIEW_GI_RAYS   2 // at rest it is gathered per pixel

#define HG_VIEW_REFLECTIONS_ENVIRONMENT 0
#define HG_VIEW_REFLECTIONS_RAYS        1 // what the rays of pictures in motion meet is shaded
#define HG_VIEW_REFLECTIONS_CACHE       2 // and kept

struct hg_view_settings {
    uint32_t width, height; // px
    struct hg_picture_region region;
    uint32_t tonemap;    // HG_FRAME_TONEMAP_*
    uint32_t background; // HG_BACKGROUND_MODE_*
    float background_color[3];
    uint32_t ground;   // enum hg_ground of renderer.h
    uint32_t gi;       // HG_VIEW_GI_*
    uint32_t reflections; // HG_VIEW_REFLECTIONS_*
    uint32_t ao;          // enum hg_view_ao
    uint32_t mirrors;     // enum hg_view_mirrors
    uint32_t temporal; // enum hg_view_temporal
    uint32_t shadow_maps; // enum hg_view_shadow_maps
    float exposure;    // linear factor
    uint32_t samples;  // per pixel until settled, >= 1
    uint32_t seed;
    uint32_t debug;  // enum hg_debug_view of renderer.h; 0 = the picture
    float error_px;  // greatest projected error of geometry
    float target_ms; // frame time in motion that quality gives way to; 0 = none
    float scale;     // of the sides of pictures in motion; 0 = as target_ms needs
    float sharpen;   // strength, of pictures in motion, 0 .. 1
    uint32_t mode;   // HG_VIEW_MODE_*
    struct hg_path_settings path;
    struct hg_look *look; // borrowed; NULL: the scene as it is
};

// What an exposure is metered for.
struct hg_meter_key {
    uint64_t scene, environment, geometry, camera;
    uint32_t width, height; // of the metered picture, px
};

// What the meter in motion (motion_meter.h) is off from that at rest, for the same camera.
struct hg_exposure_rest {
    struct hg_view_camera_state camera; // that was metered at rest
    bool known, compared;               // ev is valid; motion_ev and off are
    float ev, motion_ev, off;           // stops
};

// Automatic exposure (meter.h). settings.exposure follows from it.
struct hg_view_exposure {
    bool automatic;
    bool metered;                // metered_ev is of `key`; false: it is 0
    bool begun;                  // a picture of begun_key is being metered
    bool adapts; // what is shown approaches what is metered; false: takes it at once
    bool cut;    // the camera jumped since it was metered
    float stated_ev, metered_ev; // stops
    float shown_ev;              // on its way to metered_ev; of an automatic one stated_ev is added
    uint64_t adapted_ns;         // when it took its newest step
    uint64_t motion_metered_ns;  // when it was metered in motion last
    struct hg_meter_key key, begun_key;
    const struct hg_view_settings *metering; // of the metered picture, while a slice of it is drawn
    struct hg_exposure_rest rest;
};

// What light is gathered for.
struct hg_gather_key {
    uint64_t scene, environment, geometry, settings, camera; // revisions
};

// Light gathered per pixel (gather_view.h).
struct hg_view_gather {
    struct hg_path *path; // while it is gathered
    struct hg_gather_key key;
    bool begun, lit, done;     // for `key`; lit: `light` is there
    struct hg_gpu_image light; // shaders/shared/gi.h
    // RGBA32F: what transmissive surfaces send to the eye, times the share of the pixel that they
    // cover, and that share. None: there are no such surfaces.
    struct hg_gpu_image glass;
    struct hg_draw_blocks blocks;  // of the picture that `light` is of
    struct hg_path_stats stats[2]; // of what is gathered, or was last: for `light`, for `glass`
};

// There was no memory for it: not tried again until the scene or the size is another one, or a
// settled picture is asked for, which has no less light for want of memory.
struct hg_gi_refusal {
    bool is_set;
    bool is_of_device; // which has not what it takes, with any memory
    struct hg_gi_key key;
    uint32_t width, height;
};

// Light from probes (gi_view.h).
struct hg_view_probes {
    enum hg_gi_field_kind field; // that the next sample is drawn with
    bool gathered;               // and it has the gathered light
    struct hg_gather_key rested; // the view had a complete settled field for it; other views may
                                 // have taken its place
    struct hg_gi_refusal field_refused, gather_refused;
    struct hg_view_gather gather;
};

struct hg_view_state {
    struct hg_frame_context *context;
    struct hg_scene_gpu *scene_gpu;
    struct hg_lighting *lighting;

    // Settings. Each step turns them into a request (draw.h).
    struct hg_view_settings settings;
    struct hg_view_camera_state camera;
    uint64_t settings_revision, camera_revision;
    struct hg_view_exposure exposure;
    struct hg_view_probes gi;
    bool final;       // not displayed before the picture is settled
    uint32_t formats; // 1 << index into targets.pixels: of pixels that are read after a step

    struct hg_view_targets targets;
    struct hg_view_buffers buffers;
    struct hg_culling *culling;                // of the picture
    struct hg_gpu_frame frame;                 // of the newest sample
    struct hg_tiled_accumulation accumulation; // the picture, and how far it is

    // From one picture to the next.
    struct hg_frame_history history;
    struct hg_draw_blend blend;
    struct hg_draw_unlit unlit;
    struct hg_prefetch prefetch;
    struct { // of pictures in motion
        float budget_ms;  // target of the frame time where the settings have none; 0 = none either
        uint32_t sharing; // views of the scene that move, this one included; 0 = it alone
        uint32_t still;   // of its pictures of a state that has come to rest; 0 = it moves
        struct hg_quality quality;
        struct hg_temporal_view temporal;
        struct hg_reflect_view reflections;
        struct hg_mirror_view mirrors;
        struct hg_glass_view glass;
    } motion;
    struct hg_view_stats stats;

    struct hg_path *path; // created on first use
    bool path_begins;     // its next step begins a picture: the film is of an older one
    bool path_preview;    // `accumulated` holds a real-time sample of the same state
};

// The frame time in motion that the quality gives way to; 0 = none.
static inline float hg_view_target_ms(const struct hg_view_state *view)
{
    const float ms = view->settings.target_ms;
    return ms > 0.0f ? ms : view->motion.budget_ms;
}

// The region of the settings in full: never empty.
struct hg_picture_region hg_view_region(const struct hg_view_settings *settings);

// What is drawn with when the view is asked for `request`; borrows both.
struct hg_draw hg_view_draw(struct hg_view_state *view, const struct hg_draw_request *request);

#endif
