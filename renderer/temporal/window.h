// window.h - the window that samples are weighed with. Private to renderer/temporal. Pure.
#ifndef HG_RENDERER_TEMPORAL_WINDOW_H
#define HG_RENDERER_TEMPORAL_WINDOW_H

#include <stdint.h>

// Which three samples of a line of `samples` belong to each of `pixels` output pixels, by how much.
struct hg_temporal_taps {
    uint32_t *first; // [pixels] number of the first of the three, plus 1: -1 .. samples
    float *weight;   // [3][pixels], sum 1
    float *trust;    // [pixels + HG_LANES] how near the nearest sample lies: 1 = in the centre
};
void hg_temporal_taps_fill(
    struct hg_temporal_taps *taps, uint32_t pixels, uint32_t samples, float jitter);

#endif
