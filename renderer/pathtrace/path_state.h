// path_state.h - what the files of path tracing share. Private to renderer/frame/path*.c.
#ifndef HG_RENDERER_PATHTRACE_PATH_STATE_H
#define HG_RENDERER_PATHTRACE_PATH_STATE_H

#include "renderer/denoise/denoise.h"
#include "renderer/frame/frame.h"
#include "renderer/geometry/pose_snapshot.h"
#include "renderer/light/emitters/emitters.h"
#include "renderer/light/lights.h"
#include "renderer/passes/path.h"
#include "renderer/trace/trace.h"

#define HG_PATH_WAVE_PX       (HG_PATH_WAVE_TILES * HG_PATH_TILE_PX)
#define HG_PATH_LEAST_SAMPLES 16 // before a tile can be done by its noise
#define HG_PATH_NOISE_EVERY   8  // samples between estimates

enum hg_path_phase {      // what the next piece of work does
    HG_PATH_PHASE_NONE,   // begins a wave, or a pass
    HG_PATH_PHASE_TRACE,  // follows rays
    HG_PATH_PHASE_SHADE,  // looks at what they found
    HG_PATH_PHASE_SHADOW, // follows rays to lights
    HG_PATH_PHASE_HOLES,  // further behind surfaces with holes
    HG_PATH_PHASE_BRANCH, // begins another branch at what the camera sees
    HG_PATH_PHASE_FILM,   // adds what they brought
};

// Slots of a wave, for kernels.
struct hg_path_list {
    struct hg_gpu_buffer buffer; // [HG_PATH_WAVE_PX] words
    uint32_t count;
};

struct hg_path {
    struct hg_frame_context *context;
    struct hg_trace *trace;
    struct hg_ray_geometry *cut;
    uint64_t cut_revision; // that `trace` has
    struct hg_emitters *emitters;
    uint32_t backend; // asked for when `trace` was made

    // Time. A pass has one part of the time that the shutter is open.
    struct hg_pose_snapshot *kept[HG_PATH_MOMENTS];            // made when first asked for
    struct hg_gpu_path_moment moments[HG_PATH_MOMENTS]; // for the block
    uint32_t options;                                   // HG_PATH_BLURS, ...
    uint32_t time_parts,
        time_part; // of the shutter's time: how many (a power of two); what is posed

    struct hg_light_set lights[2]; // when that part of the time begins, when it ends

    // What lights are called together; group 0 is the environment.
    char groups[HG_PATH_MOST_GROUPS][HG_PATH_GROUP_NAME];
    uint32_t group_count;                          // 0: not asked for
    struct hg_gpu_buffer draw_marks, light_groups; // words, mapped

    // Which draws have one name, for each list of names.
    struct hg_gpu_buffer names; // [list_count][name_draws] words, mapped
    uint32_t list_count, name_draws;
    uint32_t lists; // first channel of the film

    // Of the picture.
    uint32_t width, height, columns, rows, tile_count;
    uint32_t channels, planes[HG_PATH_PLANE_COUNT]; // of the film; first channel of each plane
    uint32_t sampled_channels; // those that each sample brings; sums over halves follow, then lists
    double origin[3];          // scene space, metres: what positions in the film are relative to
    struct hg_gpu_buffer film, film_read;
    struct hg_gpu_buffer samples; // [tile_count] words: samples of each tile, mapped
    struct hg_gpu_buffer ring;    // samples of the pass that wait for their neighbours
    struct hg_gpu_buffer traced; // [tile_count] words: samples of each tile that were in it, mapped
    uint32_t ring_rows;          // of tiles that it holds
    bool splats;                 // samples count for neighbouring pixels, too
    uint8_t *done;               // [tile_count] by its noise
    float *errors;               // [tile_count]
    float noise;
    uint32_t branch_bits;          // each surface that the camera sees gets 2^n paths for a sample
    uint32_t pass;                 // samples of the tiles that this pass has finished, less one
    uint32_t next_tile;            // of the pass
    uint32_t next_row;             // of tiles: the first one whose samples the film does not have
    bool finished, late;           // late: the time is over
    struct hg_gpu_buffer denoised; // [4][height][width] as the film's colour, mapped
    struct hg_denoise *history;    // of views that show an animation
    uint32_t denoised_pass;        // that it was made of; 0 = none
    bool transparent;              // nothing is behind the scene
    bool stale;                    // the film holds more than view->targets.accumulated
    uint64_t spent_ns;             // in slices of work, by runs before a checkpoint as well

    // Of the wave.
    struct hg_gpu_path block;
    struct hg_gpu_buffer block_buffer, rays, shadow_rays, hits, shadow_hits, blocked, status, state;
    struct hg_gpu_buffer tiles, tile_samples; // [HG_PATH_WAVE_TILES]
    uint32_t tile_index[HG_PATH_WAVE_TILES];
    uint32_t wave_tiles, slots;
    enum hg_path_phase phase;
    struct hg_path_list live, waiting, shadows, suns; // suns: paths whose second ray comes next
    struct hg_path_list seen; // whose camera rays have met something, when there are branches
    uint32_t branch;
    uint32_t missed;    // the first of `waiting` have rays that left the scene
    bool sees_hits;     // the host does
    uint32_t may;       // HG_PATH_PLANES, HG_EMITTER_KIND_*
    uint32_t second;    // 1: `shadows` have rays to directional lights
    uint32_t part;      // most paths that are shaded at once
    uint32_t fruitless; // rounds in which no waiting path got on
    uint32_t bounce, holes;
    bool wait_pages;
    uint32_t missing;

    struct hg_path_stats stats;
};

// path_wave.c: one piece of work. *over: the wave is over, and its samples are in the film.
enum hg_status hg_path_advance(
    struct hg_view_state *view, bool *over, struct hg_error *err) HG_MUST_CHECK;
enum hg_status hg_path_wave_create(struct hg_path *path, struct hg_error *err) HG_MUST_CHECK;
void hg_path_wave_destroy(struct hg_path *path);
// The tiles of the next wave are in tile_index.
enum hg_status hg_path_wave_begin(struct hg_view_state *view, struct hg_error *err) HG_MUST_CHECK;

// The block, when what it leads to may lie elsewhere while a wave is under way.
void hg_path_wave_fill(struct hg_view_state *view);

// How many bits numbers of samples have.
uint32_t hg_path_sample_bits(uint32_t samples);

// path_branch.c: chooses branch_bits, when rays can be traced and options are known.
enum hg_status hg_path_splitting_choose(
    struct hg_view_state *view, struct hg_error *err) HG_MUST_CHECK;

// path_save.c: what was loaded takes the place of the empty film of a picture that was just begun.
enum hg_status hg_path_resume(struct hg_view_state *view, struct hg_error *err) HG_MUST_CHECK;

// path_time.c: where things are at other times than the pose. Before the cut is made; the geometry
// may be posed otherwise than the scene afterwards.
enum hg_status hg_motion_blur_begin(struct hg_view_state *view, struct hg_error *err) HG_MUST_CHECK;
// The part of the shutter's time that the next pass has is posed: the cut has to be made anew.
bool hg_motion_blur_passes(const struct hg_path *path);
enum hg_status hg_motion_blur_open(struct hg_view_state *view, struct hg_error *err) HG_MUST_CHECK;
void hg_motion_blur_destroy(struct hg_path *path);

// path_denoise.c: another picture begins.
enum hg_status hg_path_denoise_begin(
    struct hg_view_state *view, struct hg_error *err) HG_MUST_CHECK;
// What the film holds, without noise, to p->denoised.
bool hg_path_denoise_due(const struct hg_path *path);
enum hg_status hg_path_denoise(struct hg_view_state *view, struct hg_error *err) HG_MUST_CHECK;
// path_groups.c: which lights belong together, and which draws catch shadows; before the film is
// made, when the geometry is synced. Adds to options.
enum hg_status hg_light_groups_make(struct hg_view_state *view, struct hg_error *err) HG_MUST_CHECK;
// Which draws rays meet in their own space: after groups were made, and whenever structures were.
void hg_light_groups_mark_placed(struct hg_view_state *view);
void hg_light_groups_destroy(struct hg_path *path);
// path_names.c: as well before the film is made.
enum hg_status hg_cryptomatte_ids_make(struct hg_view_state *view, struct hg_error *err) HG_MUST_CHECK;
void hg_cryptomatte_ids_destroy(struct hg_path *path);
// Which list has names of a kind; false: none.
bool hg_path_list_of(const struct hg_view_state *view, uint32_t kind, uint32_t *list);

// path_host.c: samples to the film by the host, where it is the device. keep: of the wave, to the
// ring; add: of `count` tiles of the picture, from there.
bool hg_film_cpu_is_used(const struct hg_path *path);
void hg_film_cpu_keep(struct hg_path *path);
void hg_film_cpu_add(struct hg_path *path, const uint32_t *tiles, uint32_t count);

// path_film.c
enum hg_status hg_path_film_create(struct hg_path *path, const struct hg_view_settings *settings,
    struct hg_error *err) HG_MUST_CHECK;
void hg_path_film_destroy(struct hg_path *path);
// Estimates the error of tiles and says which ones are done.
enum hg_status hg_path_film_judge(
    struct hg_path *path, float noise, struct hg_error *err) HG_MUST_CHECK;
// The first `channels` of the film where the host can read them.
enum hg_status hg_path_film_fetch(
    struct hg_path *path, uint32_t channels, const float **out, struct hg_error *err) HG_MUST_CHECK;
// Adds what shadow catchers show to a pixel's sums of colour and coverage, as path_show.frag does.
void hg_path_film_catch(const struct hg_path *path, const float *film, uint64_t at, float sum[4]);
// Table of offsets of a filter for hg_gpu_path.
void hg_path_filter_fill(uint32_t filter, float radius_px, float out[HG_PATH_FILTER_STEPS + 1]);
// Where the samples of a pass are in their pixels, and how much they count for those around.
void hg_path_splat_fill(
    const struct hg_path_settings *settings, uint32_t pass, uint32_t seed, struct hg_gpu_path *out);
// Of what is known of whole pixels, after so many passes: 1, 2, ...
#define HG_PATH_RESTS 256
void hg_path_splat_rest(const struct hg_path *path, const struct hg_path_settings *settings,
    uint32_t seed, struct hg_denoise_taps out[HG_PATH_RESTS]);

#endif
