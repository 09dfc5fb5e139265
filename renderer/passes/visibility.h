// visibility.h - the visibility buffer: draw and primitive of each pixel, and depth.
// Floor 3. RG32_UINT: x = draw + 1 (0 = nothing), y = primitive of the draw. D32, reversed.
//
// Blended surfaces go to lists (blend.h), but where one hides all behind it: there it is part of
// the opaque scene.
#ifndef HG_RENDERER_PASSES_VISIBILITY_H
#define HG_RENDERER_PASSES_VISIBILITY_H

#include "renderer/cull/culling.h"
#include "renderer/passes/pass.h"

#define HG_VISIBILITY_FORMAT VK_FORMAT_R32G32_UINT
#define HG_DEPTH_FORMAT      VK_FORMAT_D32_SFLOAT

struct hg_visibility_target {
    struct hg_gpu_image *visibility, *depth;
};

// What is drawn.
struct hg_visibility_scene {
    struct hg_culling *visible;
    uint32_t set;
    uint32_t slot; // of what the host drew, where the set is hosted
};

// Opaque and masked draws; clears the target first. Of a set with candidates the first phase:
// hg_visibility_test chooses what else is drawn, and when the set has late draws
// hg_visibility_record_late draws it.
enum hg_status hg_visibility_record(struct hg_pass *pass, const struct hg_visibility_scene *scene,
    const struct hg_visibility_target *target, struct hg_error *err) HG_MUST_CHECK;
enum hg_status hg_visibility_test(struct hg_pass *pass, const struct hg_visibility_scene *scene,
    const struct hg_visibility_target *target, struct hg_error *err) HG_MUST_CHECK;
enum hg_status hg_visibility_record_late(struct hg_pass *pass,
    const struct hg_visibility_scene *scene, const struct hg_visibility_target *target,
    struct hg_error *err) HG_MUST_CHECK;
// The nearest of the blended draws in front of the opaque scene; clears the target first.
// opaque_depth: of hg_visibility_record.
enum hg_status hg_visibility_record_nearest(struct hg_pass *pass,
    const struct hg_visibility_scene *scene, const struct hg_visibility_target *target,
    struct hg_gpu_image *opaque_depth, struct hg_error *err) HG_MUST_CHECK;
// Adds what is not see-through of blended draws to the opaque scene: fragments of alpha 1, as
// shading of this sample finds it. stochastic: of others as many pixels as their alpha says, which
// takes the place of blending.
// Source: Enderton, Sintorn, Shirley and Luebke 2010, "Stochastic Transparency" (one sample).
enum hg_status hg_visibility_record_hiding(struct hg_pass *pass,
    const struct hg_visibility_scene *scene, const struct hg_visibility_target *target,
    bool stochastic, struct hg_error *err) HG_MUST_CHECK;
// Appends the fragments of blended draws in front of `depth` to the lists of the frame block
// (hg_blend_clear before).
enum hg_status hg_visibility_collect(struct hg_pass *pass, const struct hg_visibility_scene *scene,
    struct hg_gpu_image *depth, struct hg_error *err) HG_MUST_CHECK;
// All surfaces, blended ones as if opaque, inside `area` only: for picking.
enum hg_status hg_visibility_record_pick(struct hg_pass *pass,
    const struct hg_visibility_scene *scene, const struct hg_visibility_target *target,
    VkRect2D area, struct hg_error *err) HG_MUST_CHECK;
// Adds 1 to each channel of `counts` (RGBA32F, cleared first) for every surface behind a pixel.
enum hg_status hg_visibility_record_overdraw(struct hg_pass *pass,
    const struct hg_visibility_scene *scene, struct hg_gpu_image *counts,
    struct hg_error *err) HG_MUST_CHECK;
// All pipelines of this pass. *count = how many.
enum hg_status hg_visibility_warm_up(
    struct hg_gpu *gpu, uint32_t index, uint32_t *count, struct hg_error *err) HG_MUST_CHECK;

// All fragments of opaque and masked draws of the set, both sides, whatever hides them: `list`
// holds a count, three words that are not used, and then for each of at most `capacity` its pixel
// (x, y << 16), its draw + 1 with bit 31 for a front, its depth along the view direction (float
// bits) and a word that is not used. The count goes on beyond the capacity. Outside of rendering;
// the list begins with 0.
struct hg_visibility_cuts {
    VkDeviceAddress list;
    uint32_t capacity;
    VkExtent2D size; // of the picture, px
    VkRect2D area;   // that is drawn
};
enum hg_status hg_visibility_collect_cuts(struct hg_pass *pass,
    const struct hg_visibility_scene *scene, const struct hg_visibility_cuts *cuts,
    struct hg_error *err) HG_MUST_CHECK;

#endif
