// path_state.h - state of a path-traced picture, shared by the files of this room. Private to the
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

// Ray geometry and emitters.
struct hg_path_scene {
    struct hg_rays_scene *rays; // a reference; NULL: none yet
    uint32_t backend;           // requested when it was created
    struct hg_emitters *emitters;
    struct hg_light_groups groups;
    struct hg_cryptomatte_ids ids;
    struct hg_motion_blur blur;
    uint32_t has_alpha_mask; // 1: there are masked or blended surfaces
};

struct hg_path_denoiser {
    struct hg_gpu_buffer image;   // [4][height][width] as the film's colour, mapped
    struct hg_denoise *history;   // for views of an animation
    struct hg_denoise *loaded;    // replaces it when the next picture begins; NULL = none
    struct hg_gpu_buffer samples; // [tile_count] words: that `image` was made of, mapped
    uint32_t pass;                // the same of the picture; 0 = none
    bool unshown;                 // `image` was not displayed yet
};

// A loaded checkpoint.
struct hg_path_resume {
    uint8_t *data;                              // NULL = none
    struct hg_path_identity expected, identity; // of the request; of the checkpoint
};

struct hg_path {
    struct hg_frame_context *context;
    struct hg_scene_gpu *scene_gpu;
    struct hg_path_host host;
    struct hg_path_request request; // of the newest step
    uint32_t options;               // HG_PATH_BLURS, ...
    uint32_t branch_bits;           // 2^n paths per camera hit
    struct hg_path_scene scene;
    struct hg_path_film film;
    struct hg_path_progress progress;
    struct hg_path_wave wave;
    struct hg_path_denoiser denoiser;
    struct hg_path_resume resume;
    struct hg_path_stats stats;
};

struct hg_page_cache *hg_path_pages(const struct hg_path *path);
// Restores the scene's pose, if motion blur has changed it.
enum hg_status hg_path_sync_scene(struct hg_path *path, struct hg_error *err) HG_MUST_CHECK;

// wave.c: one piece of work. *over: the wave has ended, and its samples are in the film.
enum hg_status hg_path_wave_advance(
    struct hg_path *path, bool *over, struct hg_error *err) HG_MUST_CHECK;
enum hg_status hg_path_wave_create(struct hg_path *path, struct hg_error *err) HG_MUST_CHECK;
void hg_path_wave_destroy(struct hg_path_wave *wave, struct hg_gpu *gpu);
// The tiles of the next wave are in wave.tile_index.
enum hg_status hg_path_wave_begin(struct hg_path *path, struct hg_error *err) HG_MUST_CHECK;
// Refreshes the block when buffer addresses may have changed during a wave.
void hg_path_wave_fill(struct hg_path *path);
// Number of bits of sample indices.
uint32_t hg_path_sample_bits(uint32_t samples);
// The sample from which on gathering paths tell of lamps alone, as many as request.gather says.
uint32_t hg_path_lamps_from(const struct hg_path *path);

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

// checkpoint.c: copies the loaded checkpoint to the empty film of a new picture.
enum hg_status hg_path_resume(struct hg_path *path, struct hg_error *err) HG_MUST_CHECK;

// path_denoise.c: another picture begins.
enum hg_status hg_path_denoise_begin(struct hg_path *path, struct hg_error *err) HG_MUST_CHECK;
// Denoises the film to denoiser.image, if that is due.
enum hg_status hg_path_denoise_if_due(struct hg_path *path, struct hg_error *err) HG_MUST_CHECK;
void hg_path_denoise_destroy(struct hg_path_denoiser *denoiser, struct hg_gpu *gpu);

// film_cpu.c: accumulation on the host, for CPU devices. keep: from the wave to the ring; add: from
// the ring to the film, for `count` tiles.
bool hg_film_cpu_is_used(const struct hg_path *path);
void hg_film_cpu_keep(const struct hg_path *path);
void hg_film_cpu_add(const struct hg_path *path, const uint32_t *tiles, uint32_t count);

#endif
