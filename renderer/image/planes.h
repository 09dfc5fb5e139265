// planes.h - planar float pictures for the metrics: conversion, separable filters, heat maps.
// Floor 1, private to renderer/image. Thread-safe; no state.
#ifndef HG_RENDERER_IMAGE_PLANES_H
#define HG_RENDERER_IMAGE_PLANES_H

#include "renderer/image/image.h"

enum { hg_max_filter_radius = 64 };

// A separable filter: taps at -radius..radius, stored from index 0.
struct hg_taps {
    int radius;
    float x[2 * hg_max_filter_radius + 1];
    float y[2 * hg_max_filter_radius + 1];
};

// `count` zeroed planes of width x height floats in one block; NULL = no memory. hg_free.
float *hg_planes_create(uint32_t width, uint32_t height, size_t count) HG_MUST_CHECK;

// Colour over black, clamped to 0..1 (NaN is 0), of pixel i. Takes RGBA8 and RGBA32F.
void hg_display_pixel(const struct hg_image *image, size_t i, float rgb[3]);

// dst += weight * (src filtered). Pixels beyond the border repeat the nearest one.
//   size_px    width, height
//   dst, src   [height][width]     may not overlap
//   scratch    [height][width]     overwritten
void hg_plane_filter_add(float *dst, const float *src, float *scratch, const uint32_t size_px[2],
    const struct hg_taps *taps, float weight);

// RGBA8 picture of errors 0..1: black, violet, red, orange, pale yellow. HG_E_NOMEM, HG_E_LIMIT.
enum hg_status hg_heat_map(
    const float *error, uint32_t width, uint32_t height, struct hg_image *out) HG_MUST_CHECK;

#endif
