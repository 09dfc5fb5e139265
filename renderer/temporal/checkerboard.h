// checkerboard.h - pixels between those that were shaded, by their four neighbours. Private to
// renderer/temporal. Pure.
#ifndef HG_RENDERER_TEMPORAL_CHECKERBOARD_H
#define HG_RENDERER_TEMPORAL_CHECKERBOARD_H

#include "renderer/temporal/rows.h"

#define HG_TEMPORAL_CHECKERBOARD_ROWS 4 // above, here, below; what lies between

// Planes of rows that are half as wide.
struct hg_temporal_checkerboard {
    float *rows[HG_TEMPORAL_CHECKERBOARD_ROWS][HG_TEMPORAL_CHANNELS];
};

// Colours of row y of a picture that is a checkerboard, and its repeated ends, in place of
// hg_temporal_line_fill. scratch: its rows have room for the picture's width.
void hg_temporal_checkerboard_fill(const struct hg_temporal_picture *picture, uint32_t y,
    const struct hg_temporal_checkerboard *scratch, struct hg_temporal_line *line);

#endif
