// bench.h - the benchmarks behind `helio bench NAME`: each renders, measures and writes a report,
// one JSON object that is freed with hg_free. Floor 6, the program helio-bench; one thread.
#ifndef HG_RENDERER_BENCH_BENCH_H
#define HG_RENDERER_BENCH_BENCH_H

#include "renderer/renderer.h"

struct hg_bench_pose {
    float eye[3], target[3]; // metres
};

// How pictures of gi are made: without light from surfaces; with probes that follow the camera;
// with those of a view that has been at rest; both again with all that is on by default; at rest.
enum hg_bench_way {
    HG_BENCH_NONE,
    HG_BENCH_PROBES,
    HG_BENCH_RESTED,
    HG_BENCH_SHOWN,
    HG_BENCH_SHOWN_RESTED,
    HG_BENCH_SETTLED,
    HG_BENCH_WAYS,
};
extern const char *const hg_bench_way_names[HG_BENCH_WAYS];

struct hg_bench_settings {  // zero of each field = default
    uint32_t width, height; // px; 1280 x 720
    float vfov_rad;         // 45 degrees
    uint32_t rounds;        // walks along the path that are measured; 3. Others come before, until
                            // nothing is streamed or baked any more, at most two minutes
    double time_s;          // of flight: laps go on for so long; 0
    const struct hg_bench_pose *path; // [path_count]; none: 16 poses on a circle about the scene
    uint32_t path_count;
    uint32_t gi;       // enum hg_view_gi; of realtime, temporal
    uint32_t temporal; // enum hg_view_temporal; of realtime
    uint32_t reflections; // enum hg_view_reflections; of realtime, temporal, gi
    float target_ms;      // of realtime; 0: none
    float scale;          // percent; of realtime; 0: not set
    uint32_t shadow_maps; // enum hg_view_shadow_maps; of realtime, temporal
    uint32_t samples;  // of the references of temporal, 64, and of gi, 128
    uint32_t lamps;    // of the night of gi, 8; added to the scene of realtime, 0
    enum {
        HG_BENCH_TRUTH_PATHS,
        HG_BENCH_TRUTH_RAYS,
    } truth;                // of gi: path-traced pictures, or settled ones of parameter gi RAYS
    const char *references; // folder of cached reference pictures; NULL: rendered each time
    enum {
        HG_BENCH_WALK = 1,
        HG_BENCH_NIGHT = 2,
        HG_BENCH_ROOMS = 4,
    } left_out;           // of gi: parts that are not measured
    uint32_t ways;        // of gi: bits of enum hg_bench_way that are walked; 0: all
    float sun_rad[2];     // of gi by day: a sky with its sun at this azimuth (from +z towards +x)
                          // and elevation; 0: the scene's light
    float exposure_ev;    // of gi by day; 0: metered from the pose in the middle
    const char *pictures; // of gi: folder for the pictures that are compared; NULL: not written
    // Called after each frame; false cancels (HG_E_CANCELLED). May be NULL.
    bool (*progress)(void *user, uint32_t done, uint32_t total);
    void *progress_user;
};

// Frames in motion: one full-quality sample of each pose, drawn and read back as RGBA8. One JSON
// object: frames_ms, lights (count, listed: in the lists of clusters, shadowed, unshadowed), pages
// (of virtual shadow maps, means of the frames: asked, hits, drawn, held), frame_ms (median),
// p95_over_median, at_rest (nothing was streamed or baked meanwhile), motion (means over the
// measured frames of what target_ms chose: scale of the sides, rays: share of the probes', error:
// factor, checkerboard: share of the frames), passes[] (name, ms: medians over the frames in which
// they ran, frames), triangles_total, triangles_drawn, memory. HG_E_INVAL; errors of hg_view_step.
enum hg_status hg_bench_realtime_run(struct hg_renderer *renderer, struct hg_scene *scene,
    const struct hg_bench_settings *bench, char **text, struct hg_error *err) HG_MUST_CHECK;

// What pictures in motion are worth, with each value of the parameter temporal and several scales:
// the poses are walked one picture each, every fifth is held against its settled picture, and so is
// its change since the picture before, after reprojection; then a body crosses the picture. Fields
// are those of realtime; default path: 60 poses through the longer axis of the scene at a third of
// its height. One JSON object: poses, compared; auto, none, checkerboard, scale_77 and others:
// {flip: mean FLIP to the settled picture, luma_error: mean difference of luma, 0..1, flicker: mean
// change of luma after reprojection over that of settled pictures, ghost: mean error of luma where
// the body was before, after_cut: FLIP of the first picture after a jump, cpu_ms of a picture,
// temporal_ms: of it on the clock, frame_ms: median, p95_over_median}.
enum hg_status hg_bench_temporal_run(struct hg_renderer *renderer, struct hg_scene *scene,
    const struct hg_bench_settings *bench, char **text, struct hg_error *err) HG_MUST_CHECK;

// What global illumination is worth in motion. Poses as of temporal, walked by day (the light
// of the scene) and by night (lamps along the walk alone), at the exposure metered from the middle
// one, and held against references: every fifth, and its change since the one before. Then two
// rooms (gi_rooms.h). Fields are those of temporal. One JSON object: poses, compared, truth; day,
// night: {exposure_ev, references_found, references_made; none, probes (those of motion), rested
// (the settled field), both with parameter temporal as set; shown, shown_rested: the same as
// viewers see them, all that is on by default; settled: pictures at rest: {flip, region_error: mean
// relative error of luminance in 8 x 6 regions, worst_region_error: of the worst, flicker,
// cpu_ms}}; leaks[]: {wall_m, light behind the wall over
// that before it with probes, rays, in motion at most and at last}; responses[]: {change,
// pictures_to_90, pictures_to_99: until the mean stays that near to the one in motion with the
// settled field, 0 more than 90; after_15, after_60: share of the way; regions_left_60: share of
// the difference in regions; settled_over_motion: mean of the settled picture over that}.
enum hg_status hg_bench_gi_run(struct hg_renderer *renderer, struct hg_scene *scene,
    const struct hg_bench_settings *bench, char **text, struct hg_error *err) HG_MUST_CHECK;

// What reflections of pictures in motion cost and are worth, with the settled field: each pose is
// drawn 32 times by a camera that trembles, of which the last 16 count, in each of these ways: what
// the field of probes says (environment); every texel sends rays, which are shaded (full); of
// rough ones one in four (rays); and with a radiance cache of 32 and of 256 texels
// along a face. The last picture is held against a path-traced one at the exposure metered there.
// Fields are those of gi; default path: five poses within the scene, of which the second is the
// first with four rays. One JSON object: views[]: {samples, exposure_ev; environment, full, rays,
// cache_32, cache_256: {cpu_ms: processor time of what the host does for reflections, median;
// frame_cpu_ms: of a picture; flip; texels that sent rays, and of these cached, shaded,
// late, sky; ratio: cpu_ms of full over this}}.
enum hg_status hg_bench_reflections_run(struct hg_renderer *renderer, struct hg_scene *scene,
    const struct hg_bench_settings *bench, char **text, struct hg_error *err) HG_MUST_CHECK;

// What memory comes to over many laps: there and back along the path with one sample a picture, all
// light and reflections on, while a body moves ahead of the eye; at the far end of every third
// lap the view comes to rest. Fields are those of temporal and target_ms; rounds: laps, at least;
// 4; time_s. One JSON object: poses, laps[]: {frames, stats: those of `--stats` after the lap}.
enum hg_status hg_bench_flight_run(struct hg_renderer *renderer, struct hg_scene *scene,
    const struct hg_bench_settings *bench, char **text, struct hg_error *err) HG_MUST_CHECK;

// Rays of three kinds through each backend, at the first pose of the path: primary (centres of all
// pixels), diffuse (one cosine-distributed bounce each, in any direction) and shadow (whether a
// light above the scene is seen). Fields are those of realtime; rounds: the fastest counts. One
// JSON object: triangles, rays; embree, compute, khr: {primary, diffuse, shadow in Mrays/s,
// cpu_ns_per_ray of each, build_ms, bytes, bytes_per_triangle, peak_bytes, differ_per_million (rays
// that hit something else than Embree's)} or {refused}; raw: Embree alone on the same rays; ratio:
// embree over raw.
enum hg_status hg_bench_trace_run(struct hg_renderer *renderer, struct hg_scene *scene,
    const struct hg_bench_settings *bench, char **text, struct hg_error *err) HG_MUST_CHECK;

// Where the time of a path-traced picture goes, at the first pose of the path. Fields are those of
// realtime; rounds: samples per pixel; 8. One JSON object: ms, cpu_ms (processor time of all
// threads), cpu_us_per_path, pieces[] (name, items: rays or paths, ms, cpu_ms, share of the
// processor time, cpu_ns_per_item), mrays_per_s {closest, shadow}, raw_mrays_per_s: Embree alone
// with the same rays, ratio: the former over the latter.
enum hg_status hg_bench_path_run(struct hg_renderer *renderer, struct hg_scene *scene,
    const struct hg_bench_settings *bench, char **text, struct hg_error *err) HG_MUST_CHECK;

// What the benchmarks of streaming have in common. They make renderers of their own.
struct hg_bench_stream {                       // zero of each field = default
    const struct hg_renderer_params *renderer; // device, caches, threads; budgets are set here
    uint64_t budget_bytes;                     // of what is streamed
    uint32_t width, height;                    // px; 1280 x 720
    uint32_t frames;                           // of the fly-through; vt 120, lod 6
    uint32_t stills;                           // settled pictures that are compared; vt 3, lod 1
    uint32_t samples;                          // of each; 8
    bool (*progress)(void *user, uint32_t done, uint32_t total); // as in hg_bench_settings
    void *progress_user;
};

// `helio bench vt`: textures many times larger than their budget against all of them resident, and
// page packs beside OpenImageIO's texture system (needs a cache folder).
struct hg_bench_vt {
    struct hg_bench_stream stream; // budget: 64 MiB of texture pages
    uint32_t made, side_px;        // textures that are made on demand; 12 of 4096 px
    const char *const *images;     // [image_count] further ones, from files
    uint32_t image_count;
    uint32_t teleports;        // 40
    uint32_t baseline_mib;     // memory for texels beside OpenImageIO's texture system; 32
    const uint32_t *sheets_px; // [sheet_count] sides of single pictures, up to 131072
    uint32_t sheet_count;
};
enum hg_status hg_bench_vt_run(
    const struct hg_bench_vt *bench, char **text, struct hg_error *err) HG_MUST_CHECK;

// `helio bench lod`: a scene of many triangles against one of few that covers the same pixels.
struct hg_bench_lod {
    struct hg_bench_stream stream; // budget: 512 MiB of geometry
    const char *heights;           // picture of 16-bit heights; NULL: made
    const char *statue;            // mesh file; NULL: made
    uint32_t cells;                // of the made terrain's side; 1200
    uint32_t tiles, statues; // of the large scene: tiles^2 meshes of terrain, instances; 3, 1440
};
enum hg_status hg_bench_lod_run(
    const struct hg_bench_lod *bench, char **text, struct hg_error *err) HG_MUST_CHECK;

// `helio bench points`: a cloud of points that is baked, flown over and settled under the budget.
struct hg_bench_points {
    struct hg_bench_stream stream; // budget: 512 MiB of geometry; frames 6
    uint32_t points;               // 100 million
};
enum hg_status hg_bench_points_run(
    const struct hg_bench_points *bench, char **text, struct hg_error *err) HG_MUST_CHECK;

#endif
