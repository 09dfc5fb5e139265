// film.h - the film of a path-traced picture: sums of samples by channel. Private to the room.
// Floor 3.5. Thread: the render thread.
#ifndef HG_RENDERER_PATHTRACE_FILM_H
#define HG_RENDERER_PATHTRACE_FILM_H

#include "renderer/gpu/gpu.h"
#include "renderer/pathtrace/path.h"
#include "shaders/shared/path.h"

struct hg_path_film { // zeroed = empty; hg_path_film_destroy
    struct hg_picture_region region; // that is read
    uint32_t width, height, columns, rows, tile_count;
    uint32_t channels, planes[HG_PATH_PLANE_COUNT]; // first channel of each plane
    uint32_t sampled_channels; // written by each sample; half buffers follow, then lists
    uint32_t lists;            // first channel of the Cryptomatte lists
    uint32_t lamp_count;       // channels of HG_PATH_PLANE_LAMPS
    double origin[3];          // scene space, metres: what positions are relative to
    struct hg_gpu_buffer sums, read_back;
    struct hg_gpu_buffer samples; // [tile_count] words: samples of each tile, mapped
    struct hg_gpu_buffer ring;    // samples of the pass whose neighbouring tiles are not traced yet
    struct hg_gpu_buffer traced; // [tile_count] words: samples of each tile that were in it, mapped
    uint32_t ring_rows;          // of tiles that it holds
    uint32_t halves; // channels of the guide of which there are those of half of the samples
    bool splats;                 // samples are splatted to neighbouring pixels
    bool transparent;            // the background has alpha 0
};

// Determines the film's channels.
struct hg_path_film_plan {
    uint32_t options;     // of which HG_PATH_CATCHER, _GATHERS and _LAMPS are used
    uint32_t group_count; // of lights
    uint32_t list_count;  // of names
    uint32_t lamp_count;  // of HG_PATH_PLANE_LAMPS, at most HG_GATHERED_LAMPS
};

// HG_E_NOMEM, device errors. Destroys the previous film.
enum hg_status hg_path_film_create(struct hg_gpu *gpu, const struct hg_path_request *request,
    const struct hg_path_film_plan *plan, struct hg_path_film *film,
    struct hg_error *err) HG_MUST_CHECK;
void hg_path_film_destroy(struct hg_gpu *gpu, struct hg_path_film *film);
// Sets all sums to 0: those of tiles that get no samples are saved in checkpoints, too.
enum hg_status hg_path_film_clear(
    struct hg_gpu *gpu, struct hg_path_film *film, struct hg_error *err) HG_MUST_CHECK;
// Maps the first `channels` channels for reading by the host.
enum hg_status hg_path_film_fetch(struct hg_gpu *gpu, struct hg_path_film *film, uint32_t channels,
    const float **out, struct hg_error *err) HG_MUST_CHECK;

// Of a pixel (`at` = y * width + x) of sums that were fetched. Samples of its tile.
uint32_t hg_path_film_samples_at(const struct hg_path_film *film, uint32_t x, uint32_t y);
double hg_path_film_luminance(const float *sums, uint64_t at, uint64_t pixels);
// Variance of a pixel's mean, of its luminance; n >= 2.
double hg_path_film_variance(
    const struct hg_path_film *film, const float *sums, uint64_t at, double n, double *mean);
// Estimated share of the unshadowed light that reaches a shadow catcher.
float hg_path_film_caught(const struct hg_path_film *film, const float *sums, uint64_t at);
// Adds shadow catchers to a pixel's sums of colour and coverage, as path_show.frag does.
void hg_path_film_catch(
    const struct hg_path_film *film, const float *sums, uint64_t at, float sum[4]);

#endif
