// debug.h - debug views: mips, residency, clusters, levels of detail, overdraw, probes and their
// light, shadow maps. Floor 3.
//
// Colours are linear, to be displayed without a tone curve (HG_TONEMAP_LINEAR, exposure 1). The
// legend is in docs/client.md. Blended surfaces are left out, except by overdraw.
#ifndef HG_RENDERER_PASSES_DEBUG_H
#define HG_RENDERER_PASSES_DEBUG_H

#include "renderer/passes/pass.h"

struct hg_debug {
    uint32_t view;                   // enum hg_debug_view of renderer.h, not OFF
    struct hg_gpu_image *visibility; // of the opaque scene
    struct hg_gpu_image *counts;     // overdraw: surfaces behind each pixel, RGBA32F; else NULL
    struct hg_gpu_image *target;     // RGBA32F, written whole
};

enum hg_status hg_debug_record(
    struct hg_pass *pass, const struct hg_debug *debug, struct hg_error *err) HG_MUST_CHECK;

#endif
