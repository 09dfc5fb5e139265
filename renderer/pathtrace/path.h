// path.h - pictures made by following light (HG_MODE_PATH), and planes of real-time ones.
// Floor 4. Thread: the render thread.
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
#include "base/status.h"

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

struct hg_path;
struct hg_view_state;

void hg_path_destroy(struct hg_path *path); // accepts NULL

// One slice of work for a view, made on first use in view->path. changed: what was
// there counts no longer. Errors of tracing, budgets and devices; then the next slice starts anew.
enum hg_status hg_path_step(
    struct hg_view_state *view, bool changed, struct hg_error *err) HG_MUST_CHECK;
// The picture goes on from a pose of the geometry that is still there: nothing is to be synced.
bool hg_path_is_posed(const struct hg_view_state *view);
// The settings ask for other times than that of the pose, and something moves.
bool hg_path_needs_time(const struct hg_view_state *view);
// All tiles are done, or the time is over.
bool hg_path_done(const struct hg_path *path); // NULL: false
// Brings what the film holds to view->targets.accumulated, if it does not show it yet.
enum hg_status hg_path_show(struct hg_view_state *view, struct hg_error *err) HG_MUST_CHECK;
// Light was followed for that long, runs before a checkpoint included: what time_s is compared
// with.
uint64_t hg_path_spent_ns(const struct hg_path *path);
uint32_t hg_path_samples(const struct hg_path *path); // that all pixels have
float hg_path_noise(const struct hg_path *path);      // estimate, 0 = not known

// Planes of the film by enum hg_plane of renderer.h: [height][width][channels] floats.
// HG_E_STATE: not asked for, or nothing there.
enum hg_status hg_path_read(struct hg_view_state *view, uint32_t plane, uint32_t channels,
    struct hg_refbuf **out, struct hg_error *err) HG_MUST_CHECK;
// Groups of lights, of a picture that keeps HG_PATH_PLANE_GROUPS: their names, and the radiance by
// one of them, [height][width][3] floats. 0, HG_E_STATE: not asked for, or nothing there.
#define HG_PATH_GROUP_NAME 21 // longer names are cut, and end in ~2, ~3, ... where that was taken
uint32_t hg_path_group_count(const struct hg_view_state *view);
const char *hg_path_group_name(const struct hg_view_state *view, uint32_t group);
enum hg_status hg_path_read_group(struct hg_view_state *view, uint32_t group,
    struct hg_refbuf **out, struct hg_error *err) HG_MUST_CHECK;
// Names that pixels show, by enum hg_matte_kind of renderer.h:
// [height][width][HG_PLANE_DRAWS_LENGTH] pairs of floats (first draw of that name + 1, samples).
// Errors as of hg_path_read.
enum hg_status hg_path_read_names(struct hg_view_state *view, uint32_t kind, struct hg_refbuf **out,
    struct hg_error *err) HG_MUST_CHECK;
#define HG_PATH_NAME 256 // bytes
struct hg_draw_info;
void hg_path_name_draw(uint32_t kind, const struct hg_draw_info *draw, char out[HG_PATH_NAME]);
// Checkpoints (renderer.h). Load: takes effect with the next step, which makes sure of the rest.
enum hg_status hg_path_save(
    struct hg_view_state *view, struct hg_refbuf **out, struct hg_error *err) HG_MUST_CHECK;
enum hg_status hg_path_load(struct hg_view_state *view, const void *data, uint64_t size_bytes,
    struct hg_error *err) HG_MUST_CHECK;

// The history of a series (renderer.h). Load: takes effect with the next picture.
enum hg_status hg_path_history_save(
    struct hg_view_state *view, struct hg_refbuf **out, struct hg_error *err) HG_MUST_CHECK;
enum hg_status hg_path_history_load(struct hg_view_state *view, const void *data,
    uint64_t size_bytes, struct hg_error *err) HG_MUST_CHECK;

enum hg_path_piece {      // what the time of a picture goes into
    HG_PATH_PIECE_BEGIN,  // camera rays
    HG_PATH_PIECE_TRACE,  // nearest hits
    HG_PATH_PIECE_MISS,   // shading of rays that left the scene
    HG_PATH_PIECE_SHADE,  // shading of surfaces (of all rays, where the host does not see hits)
    HG_PATH_PIECE_SHADOW, // rays to lights
    HG_PATH_PIECE_LIGHT,  // what they bring
    HG_PATH_PIECE_HOLES,  // surfaces with holes on their way: rays and shading
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
void hg_path_get_stats(const struct hg_path *path, struct hg_path_stats *out);

#endif
