// occlusion.c - see occlusion.h.
#include "renderer/cull/occlusion.h"

#include <string.h>

#include "base/alloc.h"

void hg_occlusion_finish(struct hg_gpu *gpu, struct hg_occlusion *o)
{
    struct hg_gpu_buffer *buffers[] = {
        &o->candidate_buffer, &o->command_buffer, &o->flags, &o->depth, &o->blocks, &o->seen};
    for (size_t i = 0; i < sizeof buffers / sizeof buffers[0]; i++)
        hg_gpu_buffer_destroy(gpu, buffers[i]);
    hg_free(o->candidates);
    hg_free(o->bits);
    hg_free(o->triangles);
    hg_free(o->commands);
    hg_free(o->history);
}

uint64_t hg_occlusion_bytes(const struct hg_occlusion *o)
{
    return o->candidate_buffer.size_bytes + o->command_buffer.size_bytes + o->flags.size_bytes +
           o->depth.size_bytes + o->blocks.size_bytes + o->seen.size_bytes;
}

void hg_occlusion_reset(struct hg_occlusion *o)
{
    o->tested = false;
    o->count = o->command_count = 0;
}

// --- history -------------------------------------------------------------------------------------

bool hg_occlusion_was_seen(const struct hg_occlusion *o, uint32_t bit)
{
    return bit >= o->history_bits || (o->history[bit / 32] >> bit % 32 & 1u) != 0;
}

void hg_occlusion_learn(struct hg_occlusion *o, const struct hg_culling_set *set)
{
    const uint32_t *flags = o->flags.mapped;
    // First hidden ones: a run may be one of several of a bit.
    for (int pass = 0; pass < 2; pass++) {
        for (uint32_t i = 0; i < set->candidate_count; i++) {
            const uint32_t bit = o->bits[set->first_candidate + i];
            if (bit >= o->history_bits)
                continue;
            if (pass == 0)
                o->history[bit / 32] &= ~(1u << bit % 32);
            else if (flags[set->first_candidate + i] != 0)
                o->history[bit / 32] |= 1u << bit % 32;
        }
    }
}

enum hg_status hg_occlusion_keep_history(struct hg_occlusion *o, const struct hg_geometry *g)
{
    const uint32_t bits = g->bits.count + (g->pool != NULL ? hg_select_lod_bits() : 0);
    const size_t words = ((size_t)bits + 31) / 32;
    if (o->layout == g->bits.layout && o->history_bits == bits)
        return HG_OK;
    o->history_bits = 0;
    const enum hg_status status =
        hg_grow(&o->history, &o->history_capacity, words, sizeof *o->history);
    if (status != HG_OK)
        return status;
    if (words > 0)
        memset(o->history, 0xff, words * sizeof *o->history);
    o->history_bits = bits;
    o->layout = g->bits.layout;
    return HG_OK;
}

// --- candidates ----------------------------------------------------------------------------------

enum hg_status hg_occlusion_add(struct hg_occlusion *o, const struct hg_run *run, uint32_t command)
{
    const size_t need = (size_t)o->count + 1;
    if (hg_grow(&o->candidates, &o->candidate_capacity, need, sizeof *o->candidates) != HG_OK ||
        hg_grow(&o->bits, &o->bit_capacity, need, sizeof *o->bits) != HG_OK ||
        hg_grow(&o->triangles, &o->triangle_capacity, need, sizeof *o->triangles) != HG_OK)
        return HG_E_NOMEM;
    const uint32_t i = o->count++;
    o->candidates[i] = (struct hg_gpu_candidate){.draw = run->draw,
        .command = command,
        .center = {run->center[0], run->center[1], run->center[2]},
        .extent = {run->extent[0], run->extent[1], run->extent[2]}};
    o->bits[i] = run->bit;
    o->triangles[i] = run->count;
    return HG_OK;
}

enum hg_status hg_occlusion_add_command(
    struct hg_occlusion *o, const struct hg_gpu_draw_command *command)
{
    const enum hg_status status =
        hg_grow(&o->commands, &o->command_capacity, o->command_count + 1, sizeof *o->commands);
    if (status == HG_OK)
        o->commands[o->command_count++] = *command;
    return status;
}

enum hg_status hg_occlusion_upload(struct hg_gpu *gpu, struct hg_occlusion *o, struct hg_error *err)
{
    const uint64_t candidate_bytes = o->count * sizeof *o->candidates;
    const uint64_t command_bytes = o->command_count * sizeof *o->commands;
    if (o->count == 0)
        return HG_OK; // then there are no draws either
    enum hg_status status = hg_gpu_buffer_reserve(
        gpu, HG_GPU_BUFFER_UPLOAD, candidate_bytes, "candidates", &o->candidate_buffer, err);
    if (status == HG_OK)
        status = hg_gpu_buffer_reserve(
            gpu, HG_GPU_BUFFER_UPLOAD, command_bytes, "late draws", &o->command_buffer, err);
    if (status == HG_OK)
        status = hg_gpu_buffer_reserve(
            gpu, HG_GPU_BUFFER_READBACK, o->count * 4ull, "visible candidates", &o->flags, err);
    if (status != HG_OK)
        return status;
    memcpy(o->candidate_buffer.mapped, o->candidates, candidate_bytes);
    if (command_bytes > 0)
        memcpy(o->command_buffer.mapped, o->commands, command_bytes);
    return HG_OK;
}

// --- test ----------------------------------------------------------------------------------------

static enum hg_status reserve_pyramid(struct hg_gpu *gpu, struct hg_occlusion *o,
    const struct hg_gpu_image *depth, bool late, struct hg_error *err)
{
    const uint64_t px = (uint64_t)depth->width * depth->height;
    const uint64_t side = HG_OCCLUSION_BLOCK;
    const uint64_t fine = ((depth->width + side - 1) / side) * ((depth->height + side - 1) / side);
    enum hg_status status = hg_gpu_buffer_reserve(
        gpu, HG_GPU_BUFFER_DEVICE, px * 4, "depth of the first phase", &o->depth, err);
    if (status == HG_OK)
        status = hg_gpu_buffer_reserve(
            gpu, HG_GPU_BUFFER_DEVICE, fine * 8, "depth pyramid", &o->blocks, err);
    if (status == HG_OK && late)
        status = hg_gpu_buffer_reserve(
            gpu, HG_GPU_BUFFER_DEVICE, px * 8, "ids of the first phase", &o->seen, err);
    return status;
}

struct kernel {
    const char *shader;
    uint32_t variant, groups[2];
};

static enum hg_status dispatch(struct hg_gpu_cmd *cmd, const struct kernel *kernel, uint32_t tables,
    uint32_t features, const struct hg_gpu_occlusion *push, struct hg_error *err)
{
    const struct hg_gpu_pipeline_params params = {
        .compute = kernel->shader, .spec = {0, tables, features, kernel->variant}, .spec_count = 4};
    const enum hg_status status = hg_gpu_cmd_pipeline(cmd, &params, err);
    if (status != HG_OK)
        return status;
    hg_gpu_cmd_push(cmd, push, sizeof *push);
    vkCmdDispatch(hg_gpu_cmd_handle(cmd), kernel->groups[0], kernel->groups[1], 1);
    hg_gpu_memory_barrier(cmd);
    return HG_OK;
}

enum hg_status hg_occlusion_test(struct hg_gpu *gpu, struct hg_occlusion *o, struct hg_gpu_cmd *cmd,
    const struct hg_culling_set *set, const struct hg_culling_test *test, struct hg_error *err)
{
    struct hg_gpu_image *depth = test->depth;
    const struct hg_gpu_region all = {.width = depth->width, .height = depth->height};
    enum hg_status status = reserve_pyramid(gpu, o, depth, set->late_count > 0, err);
    if (status != HG_OK)
        return status;
    hg_gpu_image_read(cmd, depth, &all, &o->depth, 0);
    if (set->late_count > 0)
        hg_gpu_image_read(cmd, test->visibility, &all, &o->seen, 0);
    hg_gpu_memory_barrier(cmd);
    const struct hg_gpu_occlusion push = {
        .candidates =
            o->candidate_buffer.address + set->first_candidate * (uint64_t)sizeof *o->candidates,
        .visible = o->flags.address + set->first_candidate * 4ull,
        .commands = o->command_buffer.address,
        .depth = o->depth.address,
        .blocks = o->blocks.address,
        .candidate_count = set->candidate_count,
        .width = depth->width,
        .height = depth->height};
    const uint32_t b = HG_OCCLUSION_BLOCK, w = HG_OCCLUSION_WIDE;
    const uint32_t fine[2] = {(depth->width + b - 1) / b, (depth->height + b - 1) / b};
    const struct kernel kernels[] = {
        {"occlusion_reduce.comp", 0, {(fine[0] + 7) / 8, (fine[1] + 7) / 8}},
        {"occlusion_reduce.comp", 1,
            {((fine[0] + w - 1) / w + 7) / 8, ((fine[1] + w - 1) / w + 7) / 8}},
        {"occlusion_test.comp", 0,
            {(set->candidate_count + HG_CLUSTER_GROUP - 1) / HG_CLUSTER_GROUP, 1}},
    };
    for (size_t i = 0; i < sizeof kernels / sizeof kernels[0] && status == HG_OK; i++)
        status = dispatch(cmd, &kernels[i], test->tables, test->features, &push, err);
    return status;
}

void hg_occlusion_count(const struct hg_occlusion *o, const struct hg_culling_set *set,
    uint32_t *hidden, uint64_t *triangles)
{
    const uint32_t *flags = o->flags.mapped;
    for (uint32_t i = 0; i < set->candidate_count; i++) {
        const bool seen = flags[set->first_candidate + i] != 0;
        *hidden += !seen;
        if (seen && o->candidates[set->first_candidate + i].command != HG_CLUSTER_NONE)
            *triangles += o->triangles[set->first_candidate + i];
    }
}
