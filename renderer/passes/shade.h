// shade.h - deferred material shading of a visibility buffer, as a full-screen pass.
// Floor 3. Colours are linear radiance, premultiplied by alpha, RGBA32F.
#ifndef HG_RENDERER_PASSES_SHADE_H
#define HG_RENDERER_PASSES_SHADE_H

#include "renderer/passes/pass.h"

#define HG_COLOR_FORMAT VK_FORMAT_R32G32B32A32_SFLOAT

struct hg_shade {
    struct hg_gpu_image *visibility;
    struct hg_gpu_image *depth;  // of the visibility buffer; tells surfaces from background
    struct hg_gpu_image *target; // written at its size
    // In place of the target, whole: RGBA8 as hg_resolve_record makes it of one sample, with the
    // exposure of the frame block and this curve (HG_FRAME_TONEMAP_*). The opaque scene only.
    struct hg_gpu_image *picture;
    bool checkerboard; // of every second pixel of a row (checkerboard.h): picture and depth are
                       // half as wide
    uint32_t tonemap;
    bool clear; // target starts at zero, else it is added or blended to
    bool layer; // blended surfaces alone, and nothing elsewhere; else: the opaque scene and the
                // background, seen through `front` and added to the target
    bool lists; // with layer: all of the lists that `depth` marks (blend.h), else one of
                // `visibility`
    bool unlit; // surfaces at HG_UNLIT_TILES_DEPTH are reached by no light, others lie in front of
                // it. Not for layers.
    struct hg_gpu_image *front; // blended layers in front of the opaque scene, NULL = none
    // The opaque scene alone, to be seen through layers that let light through: alpha is how deep
    // it lies (shade.glsl), with a minus where it is not as it will be. Needs `clear`; keeps no
    // count.
    bool alone;
    struct hg_gpu_image *behind; // of layers: that picture
    // Light on opaque surfaces (shaders/shared/gi.h): gathered, else of the probes; NULL = none.
    struct hg_gpu_image *gathered, *probe_light;
    struct hg_gpu_image *mirrored; // with probe light: of planar mirrors (shaders/shared/mirror.h)
    struct hg_gpu_image *glass;    // with layer: light by way of transmissive surfaces; NULL = none
    struct hg_gpu_image *glass_rays; // with layer: what rays brought to clear glass
                                     // (shaders/shared/glass.h); NULL = none
    // Pixels whose depth is HG_UNLIT_TILES_DEPTH are left out: with `clear` they are zero, else the
    // target keeps what it has.
    bool masked;
};

enum hg_status hg_shade_record(
    struct hg_pass *pass, const struct hg_shade *shade, struct hg_error *err) HG_MUST_CHECK;
enum hg_status hg_shade_warm_up(
    struct hg_gpu *gpu, uint32_t index, uint32_t *count, struct hg_error *err) HG_MUST_CHECK;

#endif
