// path_state.h - what a path-traced picture consists of, and what its files share. Private to the
// room. Floor 3.5. Thread: the render thread.
#ifndef HG_RENDERER_PATHTRACE_PATH_STATE_H
#define HG_RENDERER_PATHTRACE_PATH_STATE_H

#include "renderer/denoise/denoise.h"
#include "renderer/light/emitters/emitters.h"
#include "renderer/pathtrace/cryptomatte_ids.h"
#include "renderer/pathtrace/film.h"
#include "renderer/pathtrace/light_groups.h"
#include "renderer/pathtrace/motion_blur.h"
#include "renderer/pathtrace/path.h"
#include "renderer/pathtrace/progress.h"
#include "renderer/pathtrace/wave.h"
#include "renderer/passes/path.h"
#include "renderer/trace/rays.h"

// What light is followed through.
struct hg_path_scene {
    struct hg_rays_scene *rays; // a reference; NULL: none yet
    uint32_t backend;           // asked for when that was made
    struct hg_emitters *emitters;
    struct hg_light_groups groups;
    struct hg_cryptomatte_ids ids;
    struct hg_motion_blur blur;
    uint32_t has_alpha_mask; // 1: there are masked or blended surfaces
};

struct hg_path_denoiser {
    struct hg_gpu_buffer image;   // [4][height][width] as the film's colour, mapped
    struct hg_denoise *history;   // of views that show an animation
    struct hg_denoise *loaded;    // takes its place when the next picture begins; NULL = none
    struct hg_gpu_buffer samples; // [tile_count] words: that `image` was made of, mapped
    uint32_t pass;                // the same of the picture; 0 = none
    bool unshown;                 // `image` is newer than what was shown
};

// A checkpoint to go on from.
struct hg_path_resume {
    uint8_t *data;                              // NULL = none
    struct hg_path_identity expected, identity; // of the request; of when it was loaded
};

struct hg_path {
    struct hg_frame_context *context;
    struct hg_scene_gpu *scene_gpu;
    struct hg_path_host host;
    struct hg_path_request request; // of the newest step
    uint32_t options;               // HG_PATH_BLURS, ...
    uint32_t branch_bits;           // each surface that the camera sees gets 2^n paths for a sample
    struct hg_path_scene scene;
    struct hg_path_film film;
    struct hg_path_progress progress;
    struct hg_path_wave wave;
    struct hg_path_denoiser denoiser;
    struct hg_path_resume resume;
    struct hg_path_stats stats;
};

struct hg_page_cache *hg_path_pages(const struct hg_path *path);
// Puts the scene back to its pose, where it was brought elsewhere.
enum hg_status hg_path_sync_scene(struct hg_path *path, struct hg_error *err) HG_MUST_CHECK;

// wave.c: one piece of work. *over: the wave is over, and its samples are in the film.
enum hg_status hg_path_wave_advance(
    struct hg_path *path, bool *over, struct hg_error *err) HG_MUST_CHECK;
enum hg_status hg_path_wave_create(struct hg_path *path, struct hg_error *err) HG_MUST_CHECK;
void hg_path_wave_destroy(struct hg_path_wave *wave, struct hg_gpu *gpu);
// The tiles of the next wave are in wave.tile_index.
enum hg_status hg_path_wave_begin(struct hg_path *path, struct hg_error *err) HG_MUST_CHECK;
// The block, when what it leads to may lie elsewhere while a wave is under way.
void hg_path_wave_fill(struct hg_path *path);
// How many bits numbers of samples have.
uint32_t hg_path_sample_bits(uint32_t samples);

// wave_kernels.c: runs a kernel on `count` slots of a list (from `first`). *demand: pages it
// missed.
struct hg_path_run {
    enum hg_path_kernel kernel;
    const struct hg_path_list *list;
    uint32_t first, count;
};
enum hg_status hg_path_wave_run(struct hg_path *path, const struct hg_path_run *run,
    struct hg_page_demand *demand, struct hg_error *err) HG_MUST_CHECK;

// path_splitting.c: chooses branch_bits, when rays can be traced and options are known.
enum hg_status hg_path_splitting_choose(struct hg_path *path, struct hg_error *err) HG_MUST_CHECK;

// checkpoint.c: what was loaded takes the place of the empty film of a picture that was just begun.
enum hg_status hg_path_resume(struct hg_path *path, struct hg_error *err) HG_MUST_CHECK;

// path_denoise.c: another picture begins.
enum hg_status hg_path_denoise_begin(struct hg_path *path, struct hg_error *err) HG_MUST_CHECK;
// What the film holds, without noise, to denoiser.image, if it is time for that.
enum hg_status hg_path_denoise_if_due(struct hg_path *path, struct hg_error *err) HG_MUST_CHECK;
void hg_path_denoise_destroy(struct hg_path_denoiser *denoiser, struct hg_gpu *gpu);

// film_cpu.c: samples to the film by the host, where it is the device. keep: of the wave, to the
// ring; add: of `count` tiles of the picture, from there.
bool hg_film_cpu_is_used(const struct hg_path *path);
void hg_film_cpu_keep(const struct hg_path *path);
void hg_film_cpu_add(const struct hg_path *path, const uint32_t *tiles, uint32_t count);

#endif
