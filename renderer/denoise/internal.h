// internal.h - what the files of the denoiser share. Private to renderer/denoise/.
//
// Planes have a border, so that filters may look beyond the picture; nothing counts there (`seen`
// is 0). Index of pixel (x, y): (y + BORDER) * stride + x + BORDER.
#ifndef HG_RENDERER_DENOISE_INTERNAL_H
#define HG_RENDERER_DENOISE_INTERNAL_H

#include <stdbool.h>

#include "renderer/denoise/denoise.h"

#define HG_DN_BORDER 32 // px

// Kinds of light, in the order of HG_PATH_GUIDE_*; what its albedo is.
enum { HG_DN_DIRECT, HG_DN_INDIRECT, HG_DN_SPECULAR, HG_DN_KINDS };
enum { HG_DN_SCATTERS, HG_DN_MIRRORS, HG_DN_LOBES };

static inline int hg_dn_lobe(int kind)
{
    return kind == HG_DN_SPECULAR ? HG_DN_MIRRORS : HG_DN_SCATTERS;
}

// Light of one kind in one half of the samples, divided by its albedo.
struct hg_dn_light {
    float *rgb[3];
    float *luma;
};

// What a lobe shows: of the first surface, or, of smooth lobes, of what is seen in it.
struct hg_dn_face {
    float *normal[3], *normal_var;
    float *disparity, *disparity_dx, *disparity_dy, *disparity_var; // 1 / metres
    float *albedo[3];                                               // of all samples
    float *tone, *tone_var;                                         // luma of it where seen
};

// Pixels of a picture.
struct hg_dn_rect {
    uint32_t x, y, width, height;
};

// All of a picture, or a part of it with what its filters look at around.
struct hg_dn_planes {
    uint32_t x, y, width, height; // in the picture
    size_t stride, count;         // floats of a row, of a plane
    bool halves;                  // there are two; else the first one holds all samples
    float *seen;                  // share of samples that hit a lit surface
    float *share;                 // of the first half among the samples, 0..1
    float *roughness;
    struct hg_dn_face face[HG_DN_LOBES];
    struct hg_dn_light light[HG_DN_KINDS][2];
    float *variance[HG_DN_KINDS]; // of the luma of a half
    float *highlight[3], *highlight_var; // highlights.c; of specular light, of the mean's luma
    float *scratch[3];
    float *memory;
};

#define HG_DN_LEAST_ALBEDO                                                                         \
    0.01f // of a surface that is lit; the filter divides by it and multiplies again

// planes.c
enum hg_status hg_dn_planes_init(struct hg_dn_planes *p, struct hg_jobs *jobs,
    const struct hg_denoise_input *input, const struct hg_dn_rect *part);
void hg_dn_planes_finish(struct hg_dn_planes *p);
// Means over 5x5 px of what is seen; *plane changes places with a scratch plane.
void hg_dn_smooth(struct hg_dn_planes *p, struct hg_jobs *jobs, float **plane);

// seen.c: variances of what smooth surfaces show, where scratch[0] says that halves do not tell;
// then, when variances are smooth, its albedo becomes what it is without noise. Uses all scratch
// planes.
void hg_dn_seen_guess(struct hg_dn_planes *p, struct hg_jobs *jobs);
void hg_dn_seen_calm(struct hg_dn_planes *p, struct hg_jobs *jobs);

// Light without noise, divided by its albedo: that of a picture, in its planes' layout.
struct hg_dn_clean {
    float *rgb[HG_DN_KINDS][3];
    float *variance[HG_DN_KINDS]; // of what is left of the noise, in the luma
};

// highlights.c: takes highlights of smooth surfaces out of both halves; adds them to what came out.
// Uses all scratch planes.
void hg_dn_split_highlights(struct hg_dn_planes *p, struct hg_jobs *jobs);
void hg_dn_put_highlights(const struct hg_dn_planes *p, size_t at, struct hg_dn_clean *clean);

// shown.c: light and albedos of pixels become those that they show, in `rect` of the planes; both
// change places with planes that nothing needs any longer: to, and light of the planes.
void hg_dn_show(struct hg_dn_planes *p, struct hg_jobs *jobs, const struct hg_denoise_input *input,
    const struct hg_dn_rect *rect, struct hg_dn_clean *clean, float *to[HG_DN_KINDS][3]);

static inline size_t hg_dn_at(const struct hg_dn_planes *p, uint32_t x, uint32_t y)
{
    return (size_t)(y + HG_DN_BORDER) * p->stride + x + HG_DN_BORDER;
}

static inline float hg_dn_luma(float r, float g, float b)
{
    return 0.2126f * r + 0.7152f * g + 0.0722f * b;
}

// filter.c: weights by the patches of `guide` and its variance, and by features.
struct hg_dn_filter {
    const float *guide[HG_DN_KINDS][2], *variance[HG_DN_KINDS];
    struct hg_dn_light out[HG_DN_KINDS][2];
    struct hg_dn_rect rect; // what is wanted, in the planes
    int radius;             // px: of the window
    int patch;              // radius of patches
    float strength;         // distances in standard deviations that are still alike
};
enum hg_status hg_dn_filter_run(
    const struct hg_dn_planes *p, struct hg_jobs *jobs, const struct hg_dn_filter *filter);

static inline uint32_t hg_dn_samples(const struct hg_denoise_input *in, uint32_t x, uint32_t y)
{
    const uint32_t columns = (in->width + HG_PATH_TILE_SIDE - 1) / HG_PATH_TILE_SIDE;
    return in->samples[y / HG_PATH_TILE_SIDE * columns + x / HG_PATH_TILE_SIDE];
}

// energy.c: factors of the light of each kind that give back what the filter has lost of it, or
// added, around: between nodes in a grid.
struct hg_dn_energy {
    uint32_t columns, rows;
    float *factor[HG_DN_KINDS]; // of nodes
};
// light: what came out, [HG_DENOISE_LIGHT][height][width], times the albedo. HG_E_NOMEM.
enum hg_status hg_dn_energy_find(struct hg_dn_energy *e, struct hg_jobs *jobs,
    const struct hg_denoise_input *input, const float *light);
void hg_dn_energy_finish(struct hg_dn_energy *e);
float hg_dn_energy_at(const struct hg_dn_energy *e, int kind, uint32_t x, uint32_t y);

#endif
