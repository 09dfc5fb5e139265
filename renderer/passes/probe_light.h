// probe_light.h - light from the field of probes on the opaque surfaces of a picture in motion, a
// quarter of its sides large, which shading blends by surface. Floor 3.
//
// A lookup reads some 50 words by address, which would be most of what a pixel costs on CPU
// devices.
#ifndef HG_RENDERER_PASSES_PROBE_LIGHT_H
#define HG_RENDERER_PASSES_PROBE_LIGHT_H

#include "renderer/passes/pass.h"

#define HG_PROBE_LIGHT_FORMAT VK_FORMAT_R32G32B32A32_UINT
#define HG_MIRRORS_FORMAT     VK_FORMAT_R32G32_UINT

struct hg_probe_light {
    struct hg_gpu_image *visibility, *depth; // of the opaque scene
    struct hg_gpu_image *target;     // shaders/shared/gi.h, written whole
    struct hg_gpu_image *surfaces; // where these mirror (shaders/shared/reflect.h); NULL: not asked
};

enum hg_status hg_probe_light_record(
    struct hg_pass *pass, const struct hg_probe_light *light, struct hg_error *err) HG_MUST_CHECK;

#endif
