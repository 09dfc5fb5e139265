// renderer.h - the facade of everything between a scene and pixels.
// Floor 5. No Vulkan types. All calls come from one thread, the render thread, unless said.
//
// A renderer owns a device. Views look at scenes (scene/scene.h, edited by the caller between
// calls). hg_view_step renders one slice of work and never more than a few samples, so that the
// caller stays responsive; repeated steps of an unchanged view accumulate until it is settled.
#ifndef HG_RENDERER_RENDERER_H
#define HG_RENDERER_RENDERER_H

#include "base/bytes.h"
#include "base/jobs.h"
#include "base/refbuf.h"
#include "base/status.h"
#include "renderer/frame/phase.h"
#include "renderer/scene_gpu/debug_overrides.h"
#include "renderer/image/image.h"
#include "renderer/scene/load.h"
#include "renderer/scene/scene.h"

struct hg_renderer;
struct hg_view;

// Sets up a process for rendering, before it starts threads: the allocator keeps what frames take
// and free, as many files may be open as the system allows, Mesa's shader cache lies under
// cache_dir and, with `spill`, large arrays may go there as well. cache_dir may be NULL.
void hg_renderer_prepare_process(const char *cache_dir, bool spill);

struct hg_renderer_params {
    const char *device;     // part of a device name or an index; NULL = best (GPU before CPU)
    const char *cache_dir;  // shader, environment, page and cluster caches; NULL = none
    const char *shader_dir; // recompile GLSL from here at run time; NULL = embedded SPIR-V
    uint64_t texture_budget_bytes;  // of page pools; 0 = half of the device's memory
    uint64_t geometry_budget_bytes; // 0 = unlimited
    uint64_t host_budget_bytes;     // decoded images and mips until they are baked; 0 = 512 MiB
    uint64_t cache_limit_bytes;     // page packs and cluster files under cache_dir; 0 = unlimited
    bool validation;                // Vulkan validation layers with synchronization validation
    unsigned threads;               // CPU jobs; 0 = one per core
    struct hg_debug_overrides overrides; // of tests and benchmarks; zero = none
};

// HG_E_DEVICE with the reason when no Vulkan 1.3 device fits. HG_E_NOMEM.
enum hg_status hg_renderer_create(const struct hg_renderer_params *params, struct hg_renderer **out,
    struct hg_error *err) HG_MUST_CHECK;
void hg_renderer_destroy(struct hg_renderer *renderer); // views first; accepts NULL
// To be called before the views go when the process is about to end: for at most `most_ns` textures
// that are in memory are kept as packs, so that the next process finds them.
void hg_renderer_linger(struct hg_renderer *renderer, uint64_t most_ns); // accepts NULL
// One JSON object: device, driver, features, fallbacks in use (heliod --device-info).
enum hg_status hg_renderer_device_json(struct hg_renderer *renderer, char **text) HG_MUST_CHECK;
// Whether what it keeps on the device is memory of this process; false for NULL.
bool hg_renderer_shares_memory(const struct hg_renderer *renderer);
struct hg_jobs *hg_renderer_jobs(struct hg_renderer *renderer);
// Compiles what common frames need. progress may be NULL.
enum hg_status hg_renderer_warm_up(struct hg_renderer *renderer,
    void (*progress)(void *user, uint32_t done, uint32_t total), void *user,
    struct hg_error *err) HG_MUST_CHECK;
// Number of validation messages seen since creation (tests expect 0).
uint32_t hg_renderer_validation_messages(const struct hg_renderer *renderer);

enum hg_tonemap { HG_TONEMAP_ACES, HG_TONEMAP_AGX, HG_TONEMAP_PBR_NEUTRAL, HG_TONEMAP_LINEAR };
// Which way is up where a plane below the scene's bounds shows the shadow on it, and nothing else
// of itself. It is seen from above only.
enum hg_ground {
    HG_GROUND_NONE,
    HG_GROUND_Y,
    HG_GROUND_Z,
    HG_GROUND_X,
    HG_GROUND_MINUS_Y,
    HG_GROUND_MINUS_Z,
    HG_GROUND_MINUS_X,
};
enum hg_background {
    HG_BACKGROUND_ENV,
    HG_BACKGROUND_NONE,
    HG_BACKGROUND_COLOR,
    HG_BACKGROUND_BLUR,
    HG_BACKGROUND_DISPLAY,
};
enum hg_view_gi { // global illumination, of HG_MODE_REALTIME
    HG_GI_NONE,
    HG_GI_AUTO,   // the best that there is; at present RAYS. The default of views of the protocol
    HG_GI_RAYS,   // gathered by rays: at rest from each pixel, in motion into cells on surfaces
    HG_GI_PROBES, // irradiance probes alone, at rest as well
};
enum hg_view_reflections {      // of pictures in motion that have global illumination
    HG_REFLECTIONS_ENVIRONMENT, // no rays: the environment, and surfaces as the probes have them
    HG_REFLECTIONS_AUTO,        // the best that there is; at present CACHE. The default of views of
                                // the protocol
    HG_REFLECTIONS_RAYS,        // rays whose hits are shaded
    HG_REFLECTIONS_CACHE,       // rays whose hits are looked up in a radiance cache where it can be
};
enum hg_view_ao { // of pictures in motion that have light from probes
    HG_AO_AUTO,   // screen-space ambient occlusion (GTAO)
    HG_AO_NONE,
};
enum hg_view_mirrors { // planar mirrors of pictures in motion that have reflections by rays
    HG_MIRRORS_AUTO,   // the one or two planes that mirror most
    HG_MIRRORS_NONE,
};
enum hg_view_temporal { // pictures in motion of HG_MODE_REALTIME, RGBA8
    HG_TEMPORAL_NONE,   // one sample per pixel
    HG_TEMPORAL_AUTO,   // made of samples of this and the pictures before; the default of views of
                        // the protocol that have global illumination
    HG_TEMPORAL_CHECKERBOARD, // likewise, with every second pixel shaded, in turn; AUTO where
                              // surfaces blend or transmit. Without parameter scale
};
enum hg_view_shadow_maps { // of a sun, in pictures in motion
    HG_SHADOW_MAPS_AUTO,
    HG_SHADOW_MAPS_CASCADES,
    HG_SHADOW_MAPS_VIRTUAL, // cached pages
};
enum hg_exposure_mode {
    HG_EXPOSURE_FIXED, // exposure_ev
    HG_EXPOSURE_AUTO,  // metered for the scene and the camera, plus exposure_ev
    HG_EXPOSURE_CAMERA // of f_number, shutter_s and iso, plus exposure_ev
};
enum hg_debug_view { // as the protocol's debug_view
    HG_DEBUG_OFF,
    HG_DEBUG_MIP,
    HG_DEBUG_RESIDENCY,
    HG_DEBUG_MISSING,
    HG_DEBUG_CLUSTER,
    HG_DEBUG_LOD,
    HG_DEBUG_OVERDRAW,
    HG_DEBUG_MOTION, // of pictures in motion: what they are made of besides
    HG_DEBUG_HISTORY,
    HG_DEBUG_PROBES, // these two have probes, whatever parameter gi says
    HG_DEBUG_IRRADIANCE,
    HG_DEBUG_SHADOWS,
    HG_DEBUG_REFLECTIONS, // of pictures in motion, which have probes and the radiance cache unless
                          // parameter reflections is RAYS
    HG_DEBUG_SCALE,       // of pictures in motion
    HG_DEBUG_SHADOW_PAGES,
};

enum hg_render_mode {
    HG_MODE_REALTIME,
    HG_MODE_PATH, // path tracing: while the view moves it is drawn as in realtime
};
enum hg_view_trace { // who walks the rays of HG_MODE_PATH; as enum hg_trace_backend
    HG_VIEW_TRACE_AUTO,
    HG_VIEW_TRACE_EMBREE,
    HG_VIEW_TRACE_COMPUTE,
    HG_VIEW_TRACE_KHR,
};
enum hg_filter {               // of pixels in HG_MODE_PATH, with their default radius
    HG_FILTER_BLACKMAN_HARRIS, // 1.5 px, as in realtime
    HG_FILTER_BOX,             // 0.5 px
    HG_FILTER_TENT,            // 1 px
    HG_FILTER_GAUSSIAN,        // 1.5 px, standard deviation a third of the radius
};

enum hg_view_denoise { // of HG_MODE_PATH: the picture, not its planes
    HG_DENOISE_OFF,
    HG_DENOISE_STILL,     // from its own samples
    HG_DENOISE_ANIMATION, // and from the pictures that the view made before
};

// Float planes for compositing. Means over the samples of a pixel, those of samples that hit
// nothing are 0. Radiance is linear, without exposure, premultiplied. OBJECT and MATERIAL are those
// of a pixel's first sample; 0 = none. HG_MODE_REALTIME has all but COLOR, DIRECT_*, INDIRECT_*,
// VARIANCE, NOISY and LIGHT_GROUPS, of settled pictures: the planes of path-traced ones, but what
// has one side is not seen from behind.
enum hg_plane {
    HG_PLANE_COLOR,                 // 4: radiance, coverage; sum of all lights
    HG_PLANE_ALBEDO,                // 3
    HG_PLANE_NORMAL,                // 3: shading normal, world space
    HG_PLANE_GEOMETRIC_NORMAL,      // 3
    HG_PLANE_DEPTH,                 // 1: along the view direction, metres; of samples that hit
    HG_PLANE_POSITION,              // 3: scene space, of samples that hit
    HG_PLANE_EMISSION,              // 3: seen directly, background included
    HG_PLANE_DIRECT_DIFFUSE,        // 3: light that was reflected or let through once;
    HG_PLANE_DIRECT_SPECULAR,       // 3  by what the first surface did with it
    HG_PLANE_DIRECT_TRANSMISSION,   // 3
    HG_PLANE_INDIRECT_DIFFUSE,      // 3: more than once
    HG_PLANE_INDIRECT_SPECULAR,     // 3
    HG_PLANE_INDIRECT_TRANSMISSION, // 3
    HG_PLANE_MOTION,                // 4: px, see below
    HG_PLANE_OBJECT, // 1: low 32 bits of the node's id, plus 1; exact to 2^24; of the first sample
    HG_PLANE_MATERIAL, // 1: number of its material in the picture, from 1
    HG_PLANE_SAMPLES,  // 1: samples of the pixel
    HG_PLANE_VARIANCE, // 1: of the mean's luminance
    // 2 HG_PLANE_DRAWS_LENGTH: names that samples met, of the first kind of `mattes`, in the order
    // in which they came: first draw of that name + 1 (0: no more), samples. What comes when there
    // is no room is left out. For hg_view_read_matte
    HG_PLANE_DRAWS,
    HG_PLANE_NOISY,        // 3: the colour before it was denoised
    HG_PLANE_LIGHT_GROUPS, // 3 for each group of lights, see hg_view_light_groups
    HG_PLANE_COUNT
};
#define HG_PLANE_DRAWS_LENGTH 8
// MOTION: x, y: where what the pixel shows was a frame (frame_s) before, less where it is at the
// pose; then z, w: where it will be a frame after, less where it is. x to the right, y down, so
// that pixel + (x, y) is the pixel of the frame before. Camera, transforms, skins and morphs count,
// a shutter does not. Backgrounds move as what is infinitely far. 0 where that was or will be
// behind the camera. Mean over the samples of a pixel, those that hit nothing included.

// Kinds of Cryptomattes.
enum hg_matte_kind { HG_MATTE_OBJECT, HG_MATTE_MATERIAL, HG_MATTE_ASSET };

// Parameters of a view; the table protocol/view_params.def has ranges, units and defaults. Zero
// of each member = its default. Notes beyond the table:
//   exposure_mode  AUTO: pictures in motion approach the exposure that is metered for them, at
//                  first 0; the view is not settled before it has that of what it shows. Same in
//                  every mode, size and seed
//   debug_view     other than OFF: one sample per pixel, no tone curve
//   time_limit_s   of path-traced views: hg_frame_info.spent_ns
//   planes         1 << HG_PLANE_*: kept for hg_view_read_plane, besides COLOR. HG_E_UNSUPPORTED
//                  names one that the mode does not have
//   frame_s        animations that were posed (hg_asset_pose), and cameras of nodes or with a next
//                  place, go on before and after the pose
//   shutter_close  >= shutter_open; equal: all light comes at one moment, that of the pose
#define HG_VIEW_TYPE_U32(field, a)  uint32_t field;
#define HG_VIEW_TYPE_F32(field, a)  float field;
#define HG_VIEW_TYPE_VEC3(field, a) float field[3];
#define HG_VIEW_TYPE_VEC4(field, a) float field[4];
#define HG_VIEW_TYPE_ENUM(field, a) HG_VIEW_ENUM_##a field;
#define HG_VIEW_ENUM_render_mode    enum hg_render_mode
#define HG_VIEW_ENUM_tonemap        enum hg_tonemap
#define HG_VIEW_ENUM_background     enum hg_background
#define HG_VIEW_ENUM_exposure_mode  enum hg_exposure_mode
#define HG_VIEW_ENUM_ground         enum hg_ground
#define HG_VIEW_ENUM_gi             enum hg_view_gi
#define HG_VIEW_ENUM_reflections    enum hg_view_reflections
#define HG_VIEW_ENUM_ao             enum hg_view_ao
#define HG_VIEW_ENUM_mirrors        enum hg_view_mirrors
#define HG_VIEW_ENUM_shadow_maps    enum hg_view_shadow_maps
#define HG_VIEW_ENUM_temporal       enum hg_view_temporal
#define HG_VIEW_ENUM_debug_view     enum hg_debug_view
#define HG_VIEW_ENUM_trace_backend  enum hg_view_trace
#define HG_VIEW_ENUM_denoise        enum hg_view_denoise
#define HG_VIEW_ENUM_filter         enum hg_filter
struct hg_view_params {
#define HGP_VIEW_PARAM(kind, field, a, b, standard, unit, mode, key, place, doc)                   \
    HG_VIEW_TYPE_##kind(field, a)
#include "protocol/view_params.def"
    uint32_t mattes; // of HG_PLANE_DRAWS: 1 << HG_MATTE_*, 64 bytes a pixel each; 0 = all three
};

// HG_E_INVAL names the member that is outside its range; HG_E_UNSUPPORTED: see planes.
enum hg_status hg_view_params_check(
    const struct hg_view_params *params, struct hg_error *err) HG_MUST_CHECK;
// The same parameters with defaults in place of zeros, so that what is left says what counts.
struct hg_view_params hg_view_params_filled(const struct hg_view_params *params);
// Stops that the parameters state: exposure_ev, with mode CAMERA that of the camera as well.
float hg_view_params_ev(const struct hg_view_params *params);

struct hg_view_camera {             // world space, metres
    float eye[3], target[3], up[3]; // up is made orthogonal; 0 = +Y
    bool orthographic;
    float vfov_rad;    // vertical; default 45 degrees
    float half_height; // orthographic
    float near, far;   // near 0 = from the scene; far 0 = infinite
    // Thin lens of HG_MODE_PATH, perspective only. Radius 0 = all is sharp.
    float lens_radius, focus_distance; // metres; distance 0 = that of the target
    uint64_t input_seq;                // returned in frames
    // Where it will be a frame later, for motion; between and before on the straight line.
    bool moves;
    float next_eye[3], next_target[3], next_up[3]; // up 0 = as `up`
};

// The view keeps a pointer to the scene, which must outlive it.
enum hg_status hg_view_create(struct hg_renderer *renderer, struct hg_scene *scene,
    struct hg_view **out, struct hg_error *err) HG_MUST_CHECK;
void hg_view_destroy(struct hg_view *view); // accepts NULL
// HG_E_INVAL names the field; HG_E_LIMIT; HG_E_NOMEM. On error the old parameters stay.
enum hg_status hg_view_set_params(
    struct hg_view *view, const struct hg_view_params *params, struct hg_error *err) HG_MUST_CHECK;
enum hg_status hg_view_set_camera(
    struct hg_view *view, const struct hg_view_camera *camera, struct hg_error *err) HG_MUST_CHECK;
// Camera of a scene's node at its present pose; `with`: its lens_radius, focus_distance and
// input_seq. What its file says of lens and sensor (hg_camera_optics) stands for a focus_distance,
// and for parameters of the view, that are 0. HG_E_NOTFOUND when the node has none; HG_E_INVAL: a
// lens needs a distance.
enum hg_status hg_view_set_camera_node(struct hg_view *view, uint64_t node_id,
    const struct hg_view_camera *with, struct hg_error *err) HG_MUST_CHECK;

// Of the view's camera, column-major, without lens or jitter. Camera space looks along -z, y is up.
// NDC: x and y in -1..1, y up; z 1 at the near plane of the newest step, 0 at the far one or at
// infinity.
struct hg_view_matrices {
    float world_to_camera[16], world_to_ndc[16];
};
void hg_view_matrices(const struct hg_view *view, struct hg_view_matrices *out);

// Of path-traced pictures: the lens, of a camera or of f_number and sensor_mm.
struct hg_view_lens {
    float radius_m; // 0: all is sharp
    float focus_m;  // along the line of sight
};
void hg_view_lens(const struct hg_view *view, struct hg_view_lens *out);

struct hg_stage_time {
    char name[32];
    uint64_t ns;
};

// Provenance of the newest step.
struct hg_frame_info {
    uint64_t number, scene_revision, input_seq;
    uint32_t width, height;
    uint32_t samples; // accumulated per pixel
    float noise;      // estimated relative error of a path-traced picture; 0 = not known
    // Time for which steps of a path-traced picture followed light, in runs before a checkpoint as
    // well; that between steps is not in it, nor are structures of rays and denoising.
    uint64_t spent_ns;
    uint32_t missing_pages, missing_clusters;
    float mip_bias;    // mips left out everywhere because the texture budget is too small; 0 = none
    float exposure_ev; // that pixels are shown with; of AUTO the metered one and compensation
    bool metered;      // AUTO: that is the exposure of what is shown now
    bool adapts;       // it is on its way to that, which is all that is left to do
    bool waits;        // other views of the scene rest, too, and are first: try again soon
    float error_px;    // projected error of geometry in this picture, >= that of the parameters
    bool settled;
    enum hg_view_phase phase; // of a real-time picture
    uint32_t shortfall;       // enum hg_view_shortfall of its newest samples
    uint64_t triangles_total, triangles_drawn;
    uint32_t stage_count;
    struct hg_stage_time stages[64]; // render passes of this step
};

// The view is not displayed before its picture is settled: steps skip intermediate pictures, and
// load missing pages and chunks before drawing. Until it is called with false.
void hg_view_set_final(struct hg_view *view, bool final);
// While others wait: a large settled picture that is not displayed before is drawn in areas, so
// that a step takes about so long. 0: as a whole. It is the same picture.
void hg_view_set_slice(struct hg_view *view, uint64_t slice_ns);
// Frame time in motion that the quality gives way to where the parameters name none (target_ms).
// 0: none. Changes no settled picture.
void hg_view_set_budget(struct hg_view *view, float target_ms);
// Number of views of its scene that move, this one included. Probes and caches of a scene are
// shared, so each of these views casts one part in `views` of the scene's rays for global
// illumination per frame.
void hg_view_set_sharing(struct hg_view *view, uint32_t views);
// Which pixels are read after the next steps: bits 1 << enum hg_pixel_format; at first
// HG_PIXEL_RGBA8 alone. A picture in motion has no others; one that rests has all.
void hg_view_set_formats(struct hg_view *view, uint32_t formats);
// Renders one slice: picks up scene, parameter and camera changes (these restart accumulation),
// uploads what is new, draws 1..max_samples samples. A settled view does nothing and says so.
// HG_E_DEVICE_LOST, HG_E_NOMEM, HG_E_LIMIT (budget) with *err; the view stays usable.
enum hg_status hg_view_step(struct hg_view *view, uint32_t max_samples, struct hg_frame_info *info,
    struct hg_error *err) HG_MUST_CHECK;

// Pixels of the newest step into *out (width*height*4). RGBA8: tone-mapped, sRGB, straight alpha.
// RGBA32F: linear radiance times exposure, straight alpha, before tone mapping.
// RGBA16: as RGBA8 with 16 bits. Renders nothing. HG_E_STATE: hg_view_has_pixels says no.
enum hg_status hg_view_read_pixels(struct hg_view *view, enum hg_pixel_format format,
    struct hg_refbuf **out, struct hg_error *err) HG_MUST_CHECK;
// The same where the device wrote them, for the whole picture without a label: not a copy, which
// further steps leave alone. To be released, on any thread, before the renderer is destroyed.
enum hg_status hg_view_lend_pixels(struct hg_view *view, enum hg_pixel_format format,
    struct hg_refbuf **out, struct hg_error *err) HG_MUST_CHECK;

// False before the first step, and for a picture in motion in formats that were not requested
// (hg_view_set_formats).
bool hg_view_has_pixels(const struct hg_view *view, enum hg_pixel_format format);

// Plane of a path-traced film as [height][width][channels] floats: COLOR, SAMPLES, VARIANCE, or one
// of those in the view's parameters; of a settled real-time picture one of the latter. HG_E_STATE:
// none yet, or not requested.
enum hg_status hg_view_read_plane(struct hg_view *view, enum hg_plane plane, struct hg_refbuf **out,
    struct hg_error *err) HG_MUST_CHECK;
uint32_t hg_plane_channels(enum hg_plane plane);
const char *hg_plane_name(enum hg_plane plane); // "direct_diffuse", ...

// Groups of lights of a view that keeps HG_PLANE_LIGHT_GROUPS, once it is path-traced: their
// number, the environment first; the others by the names of lights, and of nodes whose meshes
// shine, in 20 bytes without dots (~2, ~3, ... at the end where that was taken). The sum of all is
// COLOR, but for what shadow catchers show. Radiance by one: 3 floats a pixel. Errors as of
// hg_view_read_plane.
uint32_t hg_view_light_groups(const struct hg_view *view);
const char *hg_view_light_group_name(const struct hg_view *view, uint32_t group);
enum hg_status hg_view_read_light_group(struct hg_view *view, uint32_t group,
    struct hg_refbuf **out, struct hg_error *err) HG_MUST_CHECK;

// Cryptomatte of a view that keeps HG_PLANE_DRAWS and the kind in `mattes`, by the names of nodes,
// materials or assets (renderer/image/cryptomatte.h). What has no name goes by its kind and number.
#define HG_MATTE_RANKS 6
struct hg_matte {
    struct hg_refbuf *ranks; // [height][width][HG_MATTE_RANKS][id, coverage] floats
    char *manifest;          // JSON of the names met; NULL when longer than 16 MiB
};
// HG_E_STATE as for planes; HG_E_NOMEM. Freed with hg_cryptomatte_view_finish, which accepts a
// zeroed one.
enum hg_status hg_view_read_matte(struct hg_view *view, enum hg_matte_kind kind,
    struct hg_matte *out, struct hg_error *err) HG_MUST_CHECK;
void hg_cryptomatte_view_finish(struct hg_matte *matte);

// Checkpoints of a path-traced view: all it needs to go on, to the bit, in another process with the
// same scene, camera and parameters. HG_E_STATE: nothing to save.
enum hg_status hg_view_save(
    struct hg_view *view, struct hg_refbuf **out, struct hg_error *err) HG_MUST_CHECK;
// HG_E_INVAL: made of another size, camera, scene or parameters, or damaged; the view stays as it
// was. Call after parameters and camera are set. Replaces the view's film; a change before the next
// step discards it.
enum hg_status hg_view_load(struct hg_view *view, const void *data, uint64_t size_bytes,
    struct hg_error *err) HG_MUST_CHECK;
// The denoiser's history of a view of HG_DENOISE_ANIMATION: its settled picture, for another
// process that renders the next one, bit for bit. HG_E_STATE: there is none.
enum hg_status hg_view_save_history(
    struct hg_view *view, struct hg_refbuf **out, struct hg_error *err) HG_MUST_CHECK;
// HG_E_INVAL: damaged, or the view is of no animation; the view stays as it was. Replaces the
// view's history.
enum hg_status hg_view_load_history(struct hg_view *view, const void *data, uint64_t size_bytes,
    struct hg_error *err) HG_MUST_CHECK;

struct hg_pick {
    bool hit;
    uint64_t revision, node, mesh, material;
    uint32_t part, triangle;
    float position[3], normal[3], uv[2], distance; // world space, metres
};

// Picking: the surface at a pixel centre in the newest step (unjittered sample of the same state).
enum hg_status hg_view_pick(struct hg_view *view, uint32_t x, uint32_t y, struct hg_pick *out,
    struct hg_error *err) HG_MUST_CHECK;

// Background bakes: textures of the whole renderer that are being baked, and parts of this view's
// scene whose hierarchies are not built yet.
struct hg_baking {
    uint64_t texels_done, texels_total;
    uint32_t mesh_parts;
};
void hg_view_baking(struct hg_view *view, struct hg_baking *out);
// Images of the scene that cannot be read (any more) and are drawn white.
uint32_t hg_view_failed_textures(struct hg_view *view);
// Primitives that the view shows in real time and leaves out of path-traced pictures, one for each
// instance: lines, and points without discs (skinned and morphed ones), which rays do not hit.
struct hg_untraced {
    uint32_t lines, points;
};
void hg_view_untraced(struct hg_view *view, struct hg_untraced *out);

// One JSON object with the keys of docs/client.md (--stats); view may be NULL.
enum hg_status hg_renderer_stats_json(
    struct hg_renderer *renderer, struct hg_view *view, char **text) HG_MUST_CHECK;

#endif
