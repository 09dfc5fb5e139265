// progress.h - how far the accumulation of a picture is: passes, tiles, noise. Private to the room.
// Floor 3.5. Thread: the render thread.
#ifndef HG_RENDERER_PATHTRACE_PROGRESS_H
#define HG_RENDERER_PATHTRACE_PROGRESS_H

#include "renderer/pathtrace/film.h"

#define HG_PATH_LEAST_SAMPLES 16 // before a tile can be done by its noise
#define HG_PATH_NOISE_EVERY   8  // samples between estimates

struct hg_path_progress { // zeroed = empty; hg_path_progress_finish
    uint32_t pass;        // index of the pass = samples of its finished tiles - 1
    uint32_t next_tile;   // of the pass
    uint32_t next_row;    // of tiles: the first whose samples are not in the film yet
    uint8_t *done;        // [tile_count] converged
    float *errors;        // [tile_count]
    float noise;          // estimate, 0 = not known
    bool finished, late;  // late: the time limit is reached
    bool unshown;         // the film has samples that were not displayed
    uint64_t changes;     // since creation: hg_path_changes
    uint64_t spent_ns;    // in slices of work, including those before a checkpoint
};

// A picture of the film's tiles begins. `part`: only the tiles that the film's region and their
// neighbours in it need get samples, the others count as done. HG_E_NOMEM.
enum hg_status hg_path_progress_begin(struct hg_path_progress *progress,
    const struct hg_path_film *film, bool part, struct hg_error *err) HG_MUST_CHECK;
void hg_path_progress_finish(struct hg_path_progress *progress);
// The tiles of the next wave; 0: the pass is over.
uint32_t hg_path_progress_choose(struct hg_path_progress *progress, const struct hg_path_film *film,
    uint32_t tiles[HG_PATH_WAVE_TILES]);
bool hg_path_progress_any_left(
    const struct hg_path_progress *progress, const struct hg_path_film *film);
// Estimates the error of tiles and marks those as converged that have at most `noise` (0: none) and
// that many samples.
enum hg_status hg_path_progress_judge(struct hg_path_progress *progress, struct hg_gpu *gpu,
    struct hg_path_film *film, float noise, uint32_t least_samples,
    struct hg_error *err) HG_MUST_CHECK;

#endif
