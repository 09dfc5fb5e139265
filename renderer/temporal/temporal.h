// temporal.h - pictures of a view in motion, made of the newest sample and of those before it.
// Floor 2. Pure host work on planar floats. Thread: any, one at a time per history; the work of one
// picture is spread over `jobs`. Results depend on the pictures and their order alone, never on
// threads.
//
// A picture is one sample per pixel of a smaller or equal size, with the depth of what each sample
// hit. Colours are blended as radiance behind the tone curve (the square of encoded values), where
// bright samples weigh no more than they are seen (Karis 2014, "High-Quality Temporal
// Supersampling"). Steps for each pixel of the output:
//   motion of the nearest of 3x3 samples; colour, mean and deviation of the same, weighted by the
//   window of accumulated pictures; history where the pixel was (Catmull-Rom), if what was seen
//   there is not nearer than it should have been; clipped to the deviation (Salvi 2016, "An
//   Excursion in Temporal Supersampling"); mixed by the weights of all samples so far.
// Pixels without history are smoothed along edges as far as one sample shows them.
// Of a checkerboard every second pixel of a row was shaded; those between are made of their four
// neighbours, and count less.
#ifndef HG_RENDERER_TEMPORAL_TEMPORAL_H
#define HG_RENDERER_TEMPORAL_TEMPORAL_H

#include <stdbool.h>

#include "base/jobs.h"
#include "base/status.h"

#define HG_TEMPORAL_MOST_MATRICES 65534
#define HG_TEMPORAL_DEFORMED      65535 // of `matrix_of_draw`: posed vertices, or new

// Where posed surfaces were, of a rectangle of samples. Zeroed: not known.
struct hg_temporal_posed {
    uint32_t x, y, width, height;
    const float (*was)[3]; // [height][width] NDC of the picture before: x, y, depth < 0: not known
};

// One picture of [height][width] samples; all is borrowed.
struct hg_temporal_picture {
    uint32_t width, height; // samples; at most those of the history, at least half of them
    float jitter_px[2];     // sample position less the centre of its pixel, in samples
    const uint8_t *rgba;    // [height][width][4] sRGB, straight alpha
    bool checkerboard;      // of the whole size; rgba is [height][(width + 1) / 2][4], of row y the
    uint32_t first;         // pixels 2 x + ((y + first) & 1)
    const float *depth;     // [height][width] reversed: 0 = infinitely far; NDC of `to_previous`
    const uint32_t *ids;    // [height][width][2] draw + 1, not used; NULL: nothing moved by itself
    const uint16_t *matrix_of_draw; // [draw_count] index into to_previous, HG_TEMPORAL_DEFORMED
    uint32_t draw_count;
    struct hg_temporal_posed posed; // of draws that are HG_TEMPORAL_DEFORMED
    // NDC of a sample (x, y down, depth, 1) to clip space of the picture before, column-major. The
    // first is that of what stands still and of the background.
    const double (*to_previous)[16];
    uint32_t matrix_count; // 1 .. HG_TEMPORAL_MOST_MATRICES
    bool continues; // the picture before belongs to the same motion; else nothing of it is used
    float cut;      // continues, but not when a larger share of samples is not found; 1 = always
};

struct hg_temporal; // history of one view

// HG_E_NOMEM. width, height: of the output, px, 1 .. 16384.
enum hg_status hg_temporal_create(
    uint32_t width, uint32_t height, struct hg_temporal **out) HG_MUST_CHECK;
void hg_temporal_destroy(struct hg_temporal *temporal); // accepts NULL
void hg_temporal_size(const struct hg_temporal *temporal, uint32_t *width, uint32_t *height);
uint64_t hg_temporal_bytes(const struct hg_temporal *temporal); // host memory

struct hg_temporal_stats {
    uint32_t pictures; // of the present motion, this one included
    float found;       // share of the samples looked at that had a history
};

enum hg_temporal_show {
    HG_TEMPORAL_PICTURE,
    HG_TEMPORAL_MOTION,
    HG_TEMPORAL_HISTORY,
    HG_TEMPORAL_SCALE
};

// The next picture. rgba: [height][width][4] of the output, as the picture's; or a debug view of
// it, opaque: MOTION where a pixel was a picture before (motion_color), HISTORY how much history it
// has: black none, white all, SCALE of what share it is of the newest samples, black none, green
// (at the whole size) to red (at half of it) all. HG_E_NOMEM: the history is empty afterwards.
enum hg_status hg_temporal_resolve(struct hg_temporal *temporal, struct hg_jobs *jobs,
    const struct hg_temporal_picture *picture, enum hg_temporal_show show, uint8_t *rgba,
    struct hg_temporal_stats *stats) HG_MUST_CHECK;
void hg_temporal_forget(struct hg_temporal *temporal);

// Motion vectors of a picture's samples: [height][width][3]: px to where the sample was in the
// picture before, less where it is; then 1 if it was seen there, else 0. depth_before: [height]
// [width] of the picture before, at the same size; NULL: what is inside is taken as seen. Pure.
// HG_E_NOMEM.
enum hg_status hg_temporal_motion(const struct hg_temporal_picture *picture,
    const float *depth_before, float *motion_px) HG_MUST_CHECK;

#endif
