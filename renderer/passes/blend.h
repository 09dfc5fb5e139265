// blend.h - lists of the blended surfaces of each pixel (shaders/shared/blend.h).
// Floor 3. All fragments of blended surfaces that are in front of the opaque scene are collected
// once (hg_visibility_collect), sorted, and shaded front to back (hg_shade_record).
// Source: Yang, Hensley, Gruen and Thibieroz 2010, "Real-Time Concurrent Linked List Construction
// on the GPU".
#ifndef HG_RENDERER_PASSES_BLEND_H
#define HG_RENDERER_PASSES_BLEND_H

#include "renderer/passes/pass.h"

struct hg_blend_lists {
    struct hg_gpu_buffer heads;   // u32 [height][width]
    struct hg_gpu_buffer nodes;   // struct hg_gpu_blend_node
    struct hg_gpu_buffer reports; // struct hg_gpu_blend_report per sample of a batch; readback
};

// Empties all lists. Outside rendering.
void hg_blend_clear(struct hg_pass *pass, const struct hg_blend_lists *lists);
// Empties the nodes only, for another area of the same sample.
void hg_blend_clear_nodes(struct hg_pass *pass, const struct hg_blend_lists *lists);
// Sorts the lists of the pass's area, nearest first, without surfaces at the same depth, and adds
// to report number `report`. depth (D32): above 0 where there is a list, 0 elsewhere in the area.
enum hg_status hg_blend_sort(struct hg_pass *pass, const struct hg_blend_lists *lists,
    struct hg_gpu_image *depth, uint32_t report, struct hg_error *err) HG_MUST_CHECK;
enum hg_status hg_blend_warm_up(
    struct hg_gpu *gpu, uint32_t index, uint32_t *count, struct hg_error *err) HG_MUST_CHECK;

#endif
