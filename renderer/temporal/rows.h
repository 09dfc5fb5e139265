// rows.h - colour statistics and nearest motion of 3x3 samples, a row of pixels at a time. Private
// to renderer/temporal. Pure.
#ifndef HG_RENDERER_TEMPORAL_ROWS_H
#define HG_RENDERER_TEMPORAL_ROWS_H

#include "renderer/temporal/reproject.h"
#include "renderer/temporal/window.h"

#define HG_TEMPORAL_ROW_PAD 8 // floats before and behind each row

// Colour planes: luma, orange, green (YCoCg of squared encoded values, premultiplied), alpha.
enum { HG_TEMPORAL_CHANNELS = 4 };

// One row of samples, with one more at each end.
struct hg_temporal_line {
    bool opaque; // alpha is 1 everywhere
    float *color[HG_TEMPORAL_CHANNELS];
    struct hg_temporal_motion_row motion;
};

// What 3x3 samples say for a row of pixels.
struct hg_temporal_about {
    int channels; // that differ: all, or all but alpha, which is 1; of the arrays below
    float *color[HG_TEMPORAL_CHANNELS]; // by the window
    float *mean[HG_TEMPORAL_CHANNELS], *deviation[HG_TEMPORAL_CHANNELS];
    struct hg_temporal_motion_row motion; // of the nearest sample; depth: its own
    float *slope;                         // depth of the nearest less that of the middle one
    float *spare[4];
};

// Planes of texels. True: alpha is 1 everywhere.
bool hg_temporal_decode(const uint8_t *rgba, uint32_t count, float *const color[4]);
// Colours of a row and its repeated ends; the motion's ends as well.
void hg_temporal_line_fill(
    const struct hg_temporal_picture *picture, uint32_t y, struct hg_temporal_line *line);
// The latter alone.
void hg_temporal_line_repeat(uint32_t samples, struct hg_temporal_line *line);

// Of samples: lines above, in the middle and below, by weight[3]; colours are summed over columns
// only.
void hg_temporal_about_fill(const struct hg_temporal_line *const lines[3], const float weight[3],
    uint32_t samples, struct hg_temporal_about *out);
// Other weights for the same lines.
void hg_temporal_about_weigh(const struct hg_temporal_line *const lines[3], const float weight[3],
    uint32_t samples, struct hg_temporal_about *about);
// Then colours along the row, where pixels are samples; or for pixels that are not: colours, and
// all of it unless only weights are others.
void hg_temporal_about_blur(
    struct hg_temporal_about *about, const float weight[3], uint32_t samples);
void hg_temporal_about_expand(const struct hg_temporal_about *samples,
    const struct hg_temporal_taps *columns, uint32_t pixels, bool all,
    struct hg_temporal_about *out);

// Of each pixel the value of a sample, and of three by the weights of the taps; there are no more
// samples than pixels. The second of each only where the processor has AVX2, with the same results;
// they write up to seven values behind the row.
void hg_temporal_expand_plain(
    const float *from, const struct hg_temporal_taps *taps, uint32_t pixels, float *to);
void hg_temporal_expand_weighed_plain(
    const float *from, const struct hg_temporal_taps *taps, uint32_t pixels, float *to);
bool hg_temporal_has_avx2(void);
void hg_temporal_expand_avx2(
    const float *from, const struct hg_temporal_taps *taps, uint32_t pixels, float *to);
void hg_temporal_expand_weighed_avx2(
    const float *from, const struct hg_temporal_taps *taps, uint32_t pixels, float *to);

#endif
