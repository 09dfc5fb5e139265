// occlusion.h - what is behind other things, by a pyramid of the depth of what was seen before (see
// culling.h). Floor 2 (geometry). Private to the room. Thread: the render thread.
#ifndef HG_RENDERER_CULL_OCCLUSION_H
#define HG_RENDERER_CULL_OCCLUSION_H

#include "renderer/cull/select.h"

struct hg_occlusion { // zeroed = empty; keeps its memory
    // Runs that are tested, and indirect draws of those that are drawn only where they are seen.
    struct hg_gpu_candidate *candidates;
    uint32_t *bits, *triangles; // [count] bit of the history; triangles
    struct hg_gpu_draw_command *commands;
    size_t candidate_capacity, bit_capacity, triangle_capacity, command_capacity;
    uint32_t count, command_count;

    uint64_t layout; // of the draws that the history is of
    uint32_t *history;
    size_t history_capacity;
    uint32_t history_bits;
    bool tested; // flags of set 0 are those of its newest sample

    struct hg_gpu_buffer candidate_buffer, command_buffer, flags; // flags: [count] u32 seen
    struct hg_gpu_buffer depth, blocks, seen;
};

void hg_occlusion_finish(struct hg_gpu *gpu, struct hg_occlusion *o);
uint64_t hg_occlusion_bytes(const struct hg_occlusion *o); // on the device
// Forgets candidates and draws; the history stays.
void hg_occlusion_reset(struct hg_occlusion *o);
// Of a set that was tested: what its newest sample saw goes to the history. Runs that were not in
// the frustum keep their bits.
void hg_occlusion_learn(struct hg_occlusion *o, const struct hg_culling_set *set);
// Where the history is of another list of draws everything counts as seen. HG_E_NOMEM.
enum hg_status hg_occlusion_keep_history(
    struct hg_occlusion *o, const struct hg_geometry *g) HG_MUST_CHECK;
bool hg_occlusion_was_seen(const struct hg_occlusion *o, uint32_t bit);

// Adds a candidate, number count - 1. command: HG_CLUSTER_NONE: it is drawn anyway. HG_E_NOMEM.
enum hg_status hg_occlusion_add(
    struct hg_occlusion *o, const struct hg_run *run, uint32_t command) HG_MUST_CHECK;
// Adds an indirect draw, number command_count - 1. HG_E_NOMEM.
enum hg_status hg_occlusion_add_command(
    struct hg_occlusion *o, const struct hg_gpu_draw_command *command) HG_MUST_CHECK;
// Brings candidates and draws to the device. HG_E_NOMEM, device errors.
enum hg_status hg_occlusion_upload(
    struct hg_gpu *gpu, struct hg_occlusion *o, struct hg_error *err) HG_MUST_CHECK;
// See hg_culling_test. set: the one that the test names.
enum hg_status hg_occlusion_test(struct hg_gpu *gpu, struct hg_occlusion *o, struct hg_gpu_cmd *cmd,
    const struct hg_culling_set *set, const struct hg_culling_test *test,
    struct hg_error *err) HG_MUST_CHECK;
// Of a set that was tested: adds candidates that were not seen, and triangles of late ones that
// were.
void hg_occlusion_count(const struct hg_occlusion *o, const struct hg_culling_set *set,
    uint32_t *hidden, uint64_t *triangles);

#endif
