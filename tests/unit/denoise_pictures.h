// denoise_pictures.h - made pictures with known light and noise, for tests of the denoiser.
#ifndef HG_TESTS_DENOISE_PICTURES_H
#define HG_TESTS_DENOISE_PICTURES_H

#include "renderer/denoise/denoise.h"

enum { CHANNELS = HG_PATH_GUIDE_CHANNELS };

// What a pixel shows, and how its samples scatter.
struct point {
    float irradiance, mirrored; // means; light is these times the albedos
    float albedo[3], reflection, normal[3], depth, noise;
    float seen;   // albedo of what is seen in a mirror
    float behind; // and how far behind it, metres
    float knows,
        shines; // shares of samples that follow it, that see something white in it; 0: 1, 0
    bool mirrors;
};

struct picture {
    uint32_t width, height, samples;
    struct hg_denoise_input input;
    float *sums, *halves, *out;
    uint32_t *counts;
};

typedef struct point point_at(uint32_t x, uint32_t y); // of a made scene

struct picture picture_make_seeded(
    uint32_t width, uint32_t height, uint32_t samples, point_at *at, uint32_t seed);
struct picture picture_make(uint32_t width, uint32_t height, uint32_t samples, point_at *at);
void picture_finish(struct picture *p);
void picture_denoise(struct picture *p, unsigned threads); // checks that light is finite
float picture_out(const struct picture *p, uint32_t x, uint32_t y, int channel);
float picture_raw(const struct picture *p, uint32_t x, uint32_t y, int channel);
// Root of the mean squared difference from the truth in a channel, relative to the truth.
double picture_error(const struct picture *p, point_at *truth, bool raw);
// The same of what is seen in mirrors.
double picture_mirror_error(const struct picture *p, point_at *truth, bool raw);

struct point point_wall(float noise);
struct point point_noisy_wall(uint32_t x, uint32_t y);
struct point point_mirror(uint32_t x, uint32_t y);
struct point point_polished(uint32_t x, uint32_t y);

#endif
