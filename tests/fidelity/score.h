// score.h - the published distance of Render-Fidelity, and what its pictures need.
// Test code. One thread.
// Source: google/model-viewer, packages/render-fidelity-tools (the figures of common.ts and
// color-delta.ts, as facts), after Kotsarenko and Ramos 2010, "Measuring perceived color
// difference using YIQ NTSC transmission color space in mobile applications".
#ifndef HG_TESTS_FIDELITY_SCORE_H
#define HG_TESTS_FIDELITY_SCORE_H

#include "renderer/image/image.h"

// Root mean square colour difference in decibels: 0 is black against white, lower is closer, -100
// stands for equal. Pixels that are transparent in `candidate` are left out; both are laid over
// white. RGBA8 of one size. NAN when the candidate is empty.
double score_db(const struct hg_image *candidate, const struct hg_image *golden);

// The published distance is blind where the candidate is transparent, so it is taken in both
// directions and the worse counts: an object that is missing is never free.
double score_distance(const struct hg_image *a, const struct hg_image *b);

// Lanczos (three lobes) on premultiplied display values, as the goldens' thumbs were made.
// `out` is RGBA8, finished by the caller. Aborts the program when memory is short.
void score_resize(
    const struct hg_image *image, uint32_t width, uint32_t height, struct hg_image *out);

// A WebP file, read by libwebp alone: it holds straight alpha, as the metric wants it, and a
// process that asks for a size loads no image library. Errors name the file. Closed by the caller,
// read or not.
struct score_webp {
    uint8_t *bytes;
    size_t size;
    uint32_t width, height;
    bool has_alpha;
};
enum hg_status score_open_webp(
    const char *path, struct score_webp *out, struct hg_error *err) HG_MUST_CHECK;
void score_close_webp(struct score_webp *webp); // accepts a zeroed one
// Its pixels, RGBA8, finished by the caller.
enum hg_status score_read_webp(
    const char *path, struct hg_image *out, struct hg_error *err) HG_MUST_CHECK;

// What WebP at this quality leaves of the picture (as the published thumbs were stored): 4:2:0
// colour and its quantisation. In place; RGBA8. False when libwebp fails.
bool score_as_webp(struct hg_image *image, float quality);

#endif
