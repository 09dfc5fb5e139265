// path.h - path-traced pictures (HG_MODE_PATH), and the planes of real-time ones.
// Floor 3.5. Thread: the render thread.
//
// The picture is divided into tiles of HG_PATH_TILE_SIDE px. A wave is one sample of each pixel of
// at most HG_PATH_WAVE_TILES tiles; a pass adds one sample to each tile that is not converged. The
// wave is a wavefront: a backend of renderer/trace/ traces its rays, the device shades the hits,
// and so on until all paths have ended; then they are added to the film. Paths that miss texture
// pages are suspended and shaded again when the pages are resident; when the pages of all suspended
// paths exceed the budget, a subset is shaded first. A path's result depends neither on that nor on
// the other paths of its wave: the film is identical for any budget, thread count and interruption.
//
// Planes of a view in another mode come from paths that end at the first surface that the real-time
// mode shows: the film then holds that surface's emission and the planes, no other light.
#ifndef HG_RENDERER_PATHTRACE_PATH_H
#define HG_RENDERER_PATHTRACE_PATH_H

#include <stdbool.h>
#include <stdint.h>

#include "base/refbuf.h"
#include "base/sha256.h"
#include "renderer/camera/camera.h"
#include "renderer/passes/pass.h"
#include "renderer/scene_gpu/scene_gpu.h"
#include "renderer/trace/trace.h"

#define HG_PATH_WAVE_TILES 512 // 2^17 paths, 26 MiB

// What a path-traced picture depends on besides the settings of every view. Compared as bytes.
struct hg_path_settings {
    uint32_t trace;  // enum hg_trace_backend
    uint32_t filter; // enum hg_filter of renderer.h
    uint32_t max_bounces;
    uint32_t planes;  // 1 << enum hg_plane of renderer.h
    uint32_t mattes;  // 1 << enum hg_matte_kind of renderer.h, of HG_PLANE_DRAWS
    uint32_t denoise; // enum hg_view_denoise of renderer.h
    float filter_radius_px, noise, time_s, clamp_indirect;
    float frame_s;                     // from one frame to the next
    float series_s;                    // from the previous picture of a denoised series to this one
    float sensor_share_m; // lens radius times tangent of half the field of view, of cameras without
                          // a lens of their own; 0 = none
    float shutter_open, shutter_close; // frames from the pose of the scene; equal = no motion blur
};

// Final gathering for a real-time picture: paths bring to its opaque surfaces what it does not draw
// itself, and end in the scene's field of irradiance probes, which the frame block names
// (HG_PATH_GATHERS of shaders/shared/path.h). The film is read by hg_path_read_gathered.
struct hg_path_gather {
    bool on;
    bool glass; // to transmissive surfaces, of which the colour is read, too; else to opaque ones
    // Numbers of lamps that have shadow maps, at most HG_GATHERED_LAMPS: for each the share of its
    // light that arrives is measured. 0: there are none.
    uint32_t lamps;
    float reach; // from which on a hit is shaded by the field, in spacings of its probes there
    float near_m;  // nearer than that no hit is, wherever: `reach` of the finest grid's spacing
    uint32_t full; // samples, the first ones: others bring the light of directional lights alone,
                   // if there are any
    uint32_t lamp_samples; // behind all of them: of what lamps bring alone
};

#define HG_PATH_DENOISE_SERIES 2u // flag of `denoise`: temporal, with the previous pictures

// Constant while one picture is rendered, except for the stopping criteria (but not `samples`) and
// build_wait_ns.
struct hg_path_request {
    struct hg_path_settings settings;
    struct hg_view_camera_state camera;
    uint32_t width, height; // px
    struct hg_picture_region region; // that is read, never empty
    uint32_t samples;       // per pixel, at most
    uint32_t seed;
    float error_px;   // greatest projected error of geometry
    struct hg_path_gather gather;
    bool surfaces;    // paths end at the first surface: planes of a view in another mode
    bool transparent; // the background has alpha 0
    bool aside;       // between two pictures of the view: what the next one takes up stays
    bool ground;      // the frame block may have a ground that catches shadows
    bool watched;     // intermediate pictures are displayed, so they are denoised as well
    // Longest that sync may wait for hierarchies in the LOD build queue.
    uint64_t build_wait_ns;
};

// Callbacks of the view: it provides the frame block, textures and environment for kernels.
struct hg_path_host {
    void *user;
    const struct hg_gpu_camera *camera; // as kernels use it; updated by `fill`
    // Fills the frame block for the geometry's current pose: no jitter, missing pages are waited
    // for.
    void (*fill)(void *user);
    // The same, and returns a pass for a batch. streams: its shaders report missing texture pages.
    struct hg_pass (*begin)(void *user, struct hg_gpu_cmd *cmd, bool streams);
    void (*add_stage)(void *user, const char *name, uint64_t ns); // name: literal
};

struct hg_path;

// NULL: no memory. Everything is borrowed and outlives it; *host is copied.
struct hg_path *hg_path_create(struct hg_frame_context *context, struct hg_scene_gpu *scene_gpu,
    const struct hg_path_host *host) HG_MUST_CHECK;
void hg_path_destroy(struct hg_path *path); // accepts NULL

// One slice of work. begins: the film restarts. The slice that completes a displayed picture also
// denoises it. Errors of tracing, budgets and devices; the next slice then restarts.
enum hg_status hg_path_step(struct hg_path *path, const struct hg_path_request *request,
    bool begins, struct hg_error *err) HG_MUST_CHECK;
// The geometry is still in the pose of the running picture: no sync is needed.
bool hg_path_is_posed(const struct hg_path *path); // NULL: false
// The request needs other times than that of the pose, and something moves.
bool hg_path_needs_time(
    const struct hg_path_request *request, const struct hg_scene_gpu *scene_gpu);
// There is a film; without one the functions below return nothing.
bool hg_path_has_film(const struct hg_path *path); // NULL: false
// All tiles have converged, or the time limit is reached.
bool hg_path_done(const struct hg_path *path); // NULL: false
// Incremented whenever the film has new samples.
uint64_t hg_path_changes(const struct hg_path *path);
uint32_t hg_path_missing(const struct hg_path *path); // texture pages, of the newest kernel
// Accumulated rendering time, including that before a checkpoint; compared with time_s.
uint64_t hg_path_spent_ns(const struct hg_path *path); // NULL: 0
uint32_t hg_path_samples(const struct hg_path *path);  // that all pixels have. NULL: 0
float hg_path_noise(const struct hg_path *path);       // estimate, 0 = unknown. NULL: 0

// Writes the film, denoised if requested, to an image of the picture's size, unless it is there
// already. clear: clears pixels without samples, else they are kept. Traces nothing.
enum hg_status hg_path_show(struct hg_path *path, struct hg_gpu_image *target, bool clear,
    struct hg_error *err) HG_MUST_CHECK;

// Planes of the film by enum hg_plane of renderer.h: [height][width][channels] floats.
// HG_E_STATE: not requested, or no samples.
enum hg_status hg_path_read(struct hg_path *path, uint32_t plane, uint32_t channels,
    struct hg_refbuf **out, struct hg_error *err) HG_MUST_CHECK;
// Light groups of a picture with HG_PATH_PLANE_GROUPS: their names, and the radiance of one group,
// [height][width][3] floats. 0, HG_E_STATE: not requested, or no samples.
#define HG_PATH_GROUP_NAME 21 // longer names are cut, and end in ~2, ~3, ... where that was taken
uint32_t hg_path_group_count(const struct hg_path *path); // NULL: 0
const char *hg_path_group_name(const struct hg_path *path, uint32_t group);
enum hg_status hg_path_read_group(struct hg_path *path, uint32_t group, struct hg_refbuf **out,
    struct hg_error *err) HG_MUST_CHECK;
// Cryptomatte lists by enum hg_matte_kind of renderer.h:
// [height][width][HG_PLANE_DRAWS_LENGTH] pairs of floats (first draw of that name + 1, samples).
// Errors as of hg_path_read.
enum hg_status hg_path_read_names(struct hg_path *path, uint32_t kind, struct hg_refbuf **out,
    struct hg_error *err) HG_MUST_CHECK;
#define HG_PATH_NAME 256 // bytes
struct hg_draw_info;
void hg_path_name_draw(uint32_t kind, const struct hg_draw_info *draw, char out[HG_PATH_NAME]);

// Checkpoints (renderer.h). state: hash of all inputs of samples besides the scene; scene: counts
// that detect another scene or LOD error.
struct hg_path_identity {
    uint8_t state[HG_SHA256_BYTES];
    uint64_t scene[4];
};
enum hg_status hg_path_save(struct hg_path *path, const struct hg_path_identity *identity,
    struct hg_refbuf **out, struct hg_error *err) HG_MUST_CHECK;
// The next picture continues from it. Its first step checks the identity: when the request has
// changed by then (hg_path_expect), it restarts.
struct hg_path_checkpoint {
    const void *data;
    uint64_t size_bytes;
    uint32_t width, height; // of the requested picture
};
enum hg_status hg_path_load(struct hg_path *path, const struct hg_path_identity *identity,
    const struct hg_path_checkpoint *checkpoint, struct hg_error *err) HG_MUST_CHECK;
// Before a step that begins a picture: the identity of the current request.
void hg_path_expect(struct hg_path *path, const struct hg_path_identity *identity);

// The history of a series (renderer.h). Load: takes effect with the next picture.
enum hg_status hg_path_history_save(
    struct hg_path *path, struct hg_refbuf **out, struct hg_error *err) HG_MUST_CHECK;
enum hg_status hg_path_history_load(struct hg_path *path, const void *data, uint64_t size_bytes,
    struct hg_error *err) HG_MUST_CHECK;

// Sums of a gathering film, [channel][height][width] floats.
struct hg_path_gathered {
    const float *sums;   // HG_PATH_GUIDE_*
    const float *lamps;  // HG_PATH_PLANE_LAMPS; NULL where that is not there
    uint32_t lamp_count; // channels of that
};
// Borrowed until the next step. HG_E_STATE: there is none, or it is not complete.
enum hg_status hg_path_read_gathered(
    struct hg_path *path, struct hg_path_gathered *out, struct hg_error *err) HG_MUST_CHECK;

enum hg_path_piece {      // where the time of a picture is spent
    HG_PATH_PIECE_BEGIN,  // camera rays
    HG_PATH_PIECE_TRACE,  // nearest hits
    HG_PATH_PIECE_MISS,   // shading of rays that left the scene
    HG_PATH_PIECE_SHADE,  // shading of surfaces (of all rays, where the host does not read hits)
    HG_PATH_PIECE_SHADOW, // rays to lights
    HG_PATH_PIECE_LIGHT,  // adding their light
    HG_PATH_PIECE_ALPHA_MASK, // masked and blended surfaces along shadow rays: tracing and shading
    HG_PATH_PIECE_FILM,
    HG_PATH_PIECE_LISTS, // compaction of slot lists on the host
    HG_PATH_PIECE_PAGES, // waiting for textures
    HG_PATH_PIECES,
};
const char *hg_path_piece_name(enum hg_path_piece piece);

struct hg_path_time {
    uint64_t ns, cpu_ns; // wall time; processor time of the whole process meanwhile
    uint64_t items;      // rays or paths
};

struct hg_path_stats { // since the picture was begun
    struct hg_path_time pieces[HG_PATH_PIECES];
    uint64_t build_ns; // of acceleration structures
    uint64_t denoise_ns;
    uint64_t paths, waves;
    // Embree alone on the same rays, where hg_debug_overrides.trace_raw asks for it: nearest hits,
    // and rays to lights.
    uint64_t raw_ns[2], raw_rays[2];
    uint32_t branch_bits; // each path goes on in 2^branch_bits directions from what the camera sees
    struct hg_trace_stats structures; // what its rays meet
};
void hg_path_get_stats(const struct hg_path *path, struct hg_path_stats *out); // NULL: zeros

#endif
