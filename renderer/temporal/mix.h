// mix.h - a row of pixels of the new picture from samples and history. Private to
// renderer/temporal. Pure.
#ifndef HG_RENDERER_TEMPORAL_MIX_H
#define HG_RENDERER_TEMPORAL_MIX_H

#include "renderer/temporal/look_up.h"

// Samples that a pixel is made of, at most: where history is looked up at its own texels, and half
// way between them, where the lookup blurs it.
#define HG_TEMPORAL_MOST_WEIGHT  4.0f
#define HG_TEMPORAL_MOST_BETWEEN 1.5f

// How near samples lie to the centres of a row of pixels (window.h).
struct hg_temporal_trust {
    float row;
    const float *columns; // [width]
    float part[2];        // of it that even and odd pixels have
};
// to: its color, depth and weight are the row of the new history. rgba: of the picture. Found
// colours and weights are overwritten.
void hg_temporal_mix(const struct hg_temporal_about *about, struct hg_temporal_found *found,
    const struct hg_temporal_trust *trust, uint32_t width, const struct hg_temporal_past *to,
    uint8_t *rgba);

#endif
