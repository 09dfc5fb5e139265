// metrics.h - how far two pictures are from each other.
// Floor 1. Thread-safe. Both images have the same size and format RGBA8 (display sRGB) or RGBA32F
// (taken as display values for PSNR, SSIM, FLIP after clamping to 0..1). Alpha: both are blended
// over black first for PSNR, SSIM and FLIP; RMSE and MAX also compare alpha.
#ifndef HG_RENDERER_IMAGE_METRICS_H
#define HG_RENDERER_IMAGE_METRICS_H

#include "renderer/image/image.h"

enum hg_metric {
    HG_METRIC_PSNR, // dB, peak 1, over RGB; identical = 999
    HG_METRIC_SSIM, // mean SSIM on luma, 11x11 Gaussian sigma 1.5. Wang et al. 2004
    HG_METRIC_FLIP, // mean LDR-FLIP at 67 px per degree. Andersson et al. 2020
    HG_METRIC_RMSE, // 0..1 for RGBA8 (levels / 255); alpha counts when either is not opaque
    HG_METRIC_MAX,  // likewise; a value that is not a number in one picture only is infinite
};

// *diff, when not NULL, receives an RGBA8 heat map of the error, to be finished by the caller:
// the error for FLIP and 1 - SSIM; differences (PSNR, RMSE, MAX) are hottest from 1/8 up.
// mask: NULL, or RGBA8 of the same size: only pixels whose luma is at least half count; the others
// are taken as equal in both pictures, and are in no mean. HG_E_INVAL when sizes or formats differ,
// or when the mask leaves no pixel; HG_E_NOMEM.
struct hg_image_pair {
    const struct hg_image *a, *b, *mask;
};
enum hg_status hg_image_compare(const struct hg_image_pair *pair, enum hg_metric metric,
    double *value, struct hg_image *diff, struct hg_error *err) HG_MUST_CHECK;

#endif
