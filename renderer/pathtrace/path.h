// path.h - pictures made by following light (HG_MODE_PATH), and planes of real-time ones.
// Floor 3.5. Thread: the render thread.
//
// The picture is cut in tiles of HG_PATH_TILE_SIDE px. A wave is one sample of each pixel of some
// tiles, at most HG_PATH_WAVE_TILES; a pass gives each tile that is not done one sample more. Rays
// of a wave are traced by a backend of renderer/trace/, hits shaded on the device, again and again,
// until all paths have ended; then they are added to the film. Paths whose textures are not there
// wait at that place and are shaded again when these have come; when all that waiting paths need at
// once does not fit the budget, part of them is shaded first. What a path brings does not depend on
// that, nor on which paths are in its wave: the film is the same whatever the budget, the machine's
// threads, and where work was interrupted.
//
// A view of another mode that asks for planes has them from paths that end at the first surface
// that the real-time mode sees: the film then holds what shines there and the planes, no other
// light.
#ifndef HG_RENDERER_PATHTRACE_PATH_H
#define HG_RENDERER_PATHTRACE_PATH_H

#include <stdbool.h>
#include <stdint.h>

#include "base/refbuf.h"
#include "base/sha256.h"
#include "renderer/camera/camera.h"
#include "renderer/passes/pass.h"
#include "renderer/scene_gpu/scene_gpu.h"

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
    float frame_s;  // from one frame to the next
    float series_s; // from the picture before to this one; of a series that is denoised
    float shutter_open, shutter_close; // frames from the pose of the scene; equal = no motion blur
};

#define HG_PATH_DENOISE_SERIES 2u // of `denoise`: with the pictures before

// What is asked for. It does not change while one picture is made, but for what only says when that
// ends (samples excepted) and how long others wait.
struct hg_path_request {
    struct hg_path_settings settings;
    struct hg_view_camera_state camera;
    uint32_t width, height; // px
    uint32_t samples;       // per pixel, at most
    uint32_t seed;
    float error_px;   // greatest projected error of geometry
    bool surfaces;    // paths end where they begin: planes of a picture of another mode
    bool transparent; // nothing is behind the scene
    bool watched;     // pictures of fewer samples are shown: they are denoised, too
    // How long bringing the scene in line may wait for levels of detail that are being made.
    uint64_t build_wait_ns;
};

// What whoever shows the picture does for its kernels: the frame block, textures and environment.
struct hg_path_host {
    void *user;
    const struct hg_gpu_camera *camera; // as kernels have it; `fill` brings it up to date
    // Brings the frame block in line with what the geometry shows: no jitter, pages waited for.
    void (*fill)(void *user);
    // The same, and a pass for a batch. streams: its shaders report what they miss of textures.
    struct hg_pass (*begin)(void *user, struct hg_gpu_cmd *cmd, bool streams);
    void (*add_stage)(void *user, const char *name, uint64_t ns); // name: literal
};

struct hg_path;

// NULL: no memory. Everything is borrowed and outlives it; *host is copied.
struct hg_path *hg_path_create(struct hg_frame_context *context, struct hg_scene_gpu *scene_gpu,
    const struct hg_path_host *host) HG_MUST_CHECK;
void hg_path_destroy(struct hg_path *path); // accepts NULL

// One slice of work. begins: what was there counts no longer. The slice that completes what is to
// be shown also denoises it. Errors of tracing, budgets and devices; then the next slice begins
// anew.
enum hg_status hg_path_step(struct hg_path *path, const struct hg_path_request *request,
    bool begins, struct hg_error *err) HG_MUST_CHECK;
// The picture goes on from a pose of the geometry that is still there: nothing is to be synced.
bool hg_path_is_posed(const struct hg_path *path); // NULL: false
// The request asks for other times than that of the pose, and something moves.
bool hg_path_needs_time(
    const struct hg_path_request *request, const struct hg_scene_gpu *scene_gpu);
// There is a film: of all that follows, only then anything is known.
bool hg_path_has_film(const struct hg_path *path); // NULL: false
// All tiles are done, or the time is over.
bool hg_path_done(const struct hg_path *path); // NULL: false
// Pictures that differ, so far: one more for each that has something new.
uint64_t hg_path_changes(const struct hg_path *path);
uint32_t hg_path_missing(const struct hg_path *path); // texture pages, of the newest kernel
// Light was followed for that long, runs before a checkpoint included: what time_s is compared
// with.
uint64_t hg_path_spent_ns(const struct hg_path *path); // NULL: 0
uint32_t hg_path_samples(const struct hg_path *path);  // that all pixels have. NULL: 0
float hg_path_noise(const struct hg_path *path);       // estimate, 0 = not known. NULL: 0

// Brings what is there, denoised where that is asked for, to an image of the picture's size, unless
// that was done already. clear: pixels without samples; else they are kept. Renders nothing.
enum hg_status hg_path_show(struct hg_path *path, struct hg_gpu_image *target, bool clear,
    struct hg_error *err) HG_MUST_CHECK;

// Planes of the film by enum hg_plane of renderer.h: [height][width][channels] floats.
// HG_E_STATE: not asked for, or nothing there.
enum hg_status hg_path_read(struct hg_path *path, uint32_t plane, uint32_t channels,
    struct hg_refbuf **out, struct hg_error *err) HG_MUST_CHECK;
// Groups of lights, of a picture that keeps HG_PATH_PLANE_GROUPS: their names, and the radiance by
// one of them, [height][width][3] floats. 0, HG_E_STATE: not asked for, or nothing there.
#define HG_PATH_GROUP_NAME 21 // longer names are cut, and end in ~2, ~3, ... where that was taken
uint32_t hg_path_group_count(const struct hg_path *path); // NULL: 0
const char *hg_path_group_name(const struct hg_path *path, uint32_t group);
enum hg_status hg_path_read_group(struct hg_path *path, uint32_t group, struct hg_refbuf **out,
    struct hg_error *err) HG_MUST_CHECK;
// Names that pixels show, by enum hg_matte_kind of renderer.h:
// [height][width][HG_PLANE_DRAWS_LENGTH] pairs of floats (first draw of that name + 1, samples).
// Errors as of hg_path_read.
enum hg_status hg_path_read_names(struct hg_path *path, uint32_t kind, struct hg_refbuf **out,
    struct hg_error *err) HG_MUST_CHECK;
#define HG_PATH_NAME 256 // bytes
struct hg_draw_info;
void hg_path_name_draw(uint32_t kind, const struct hg_draw_info *draw, char out[HG_PATH_NAME]);

// Checkpoints (renderer.h). state: hash of all that samples depend on besides the scene; scene:
// numbers that differ when it is another one, or asked for otherwise.
struct hg_path_identity {
    uint8_t state[HG_SHA256_BYTES];
    uint64_t scene[4];
};
enum hg_status hg_path_save(struct hg_path *path, const struct hg_path_identity *identity,
    struct hg_refbuf **out, struct hg_error *err) HG_MUST_CHECK;
// The next picture goes on from there. Its first step makes sure of the rest: when it is asked for
// something else by then (hg_path_expect), it begins anew.
struct hg_path_checkpoint {
    const void *data;
    uint64_t size_bytes;
    uint32_t width, height; // of the picture that is asked for
};
enum hg_status hg_path_load(struct hg_path *path, const struct hg_path_identity *identity,
    const struct hg_path_checkpoint *checkpoint, struct hg_error *err) HG_MUST_CHECK;
// Before a step that begins a picture: what is asked for now.
void hg_path_expect(struct hg_path *path, const struct hg_path_identity *identity);

// The history of a series (renderer.h). Load: takes effect with the next picture.
enum hg_status hg_path_history_save(
    struct hg_path *path, struct hg_refbuf **out, struct hg_error *err) HG_MUST_CHECK;
enum hg_status hg_path_history_load(struct hg_path *path, const void *data, uint64_t size_bytes,
    struct hg_error *err) HG_MUST_CHECK;

enum hg_path_piece {          // what the time of a picture goes into
    HG_PATH_PIECE_BEGIN,      // camera rays
    HG_PATH_PIECE_TRACE,      // nearest hits
    HG_PATH_PIECE_MISS,       // shading of rays that left the scene
    HG_PATH_PIECE_SHADE,      // shading of surfaces (of all rays, where the host does not see hits)
    HG_PATH_PIECE_SHADOW,     // rays to lights
    HG_PATH_PIECE_LIGHT,      // what they bring
    HG_PATH_PIECE_ALPHA_MASK, // masked and blended surfaces on their way: rays and shading
    HG_PATH_PIECE_FILM,
    HG_PATH_PIECE_LISTS, // the host's lists
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
};
void hg_path_get_stats(const struct hg_path *path, struct hg_path_stats *out); // NULL: zeros

#endif
