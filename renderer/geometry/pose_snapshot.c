#include "renderer/geometry/pose_snapshot.h"

#include <string.h>

#include "base/alloc.h"
#include "base/checked.h"
#include "renderer/geometry/geometry_state.h"

struct hg_pose_snapshot {
    struct hg_gpu *gpu;
    struct hg_gpu_array worlds, parts;
    struct hg_gpu_buffer deformed; // outputs, one after the other
};

bool hg_geometry_deform_all(struct hg_geometry *g)
{
    const bool is_new = !g->deform_all;
    g->deform_all = true;
    if (is_new)
        g->signature = 0;
    return is_new;
}

void hg_pose_snapshot_free(struct hg_pose_snapshot *m)
{
    if (m == NULL)
        return;
    hg_gpu_array_finish(m->gpu, &m->worlds);
    hg_gpu_array_finish(m->gpu, &m->parts);
    hg_gpu_buffer_destroy(m->gpu, &m->deformed);
    hg_free(m);
}

static enum hg_status no_memory(struct hg_error *err)
{
    return hg_error_set(err, HG_E_NOMEM, "moment", NULL, "no memory");
}

static enum hg_status take_worlds(
    const struct hg_geometry *g, struct hg_pose_snapshot *m, struct hg_error *err)
{
    const struct hg_gpu_instance *instances = hg_geometry_instances(g);
    uint64_t written = 0;
    struct hg_mat4x3 *worlds = hg_calloc(g->tables.instance_count + 1u, sizeof *worlds);
    if (worlds == NULL)
        return no_memory(err);
    for (uint32_t i = 0; i < g->tables.instance_count; i++)
        worlds[i] = instances[i].world;
    const enum hg_status status = hg_gpu_array_write(
        g->gpu, &m->worlds, worlds, g->tables.instance_count * sizeof *worlds, &written, err);
    hg_free(worlds);
    return status;
}

// The part table, where deformed parts lead to what is kept here.
static enum hg_status take_parts(
    const struct hg_geometry *g, struct hg_pose_snapshot *m, struct hg_error *err)
{
    uint64_t written = 0, at = m->deformed.address;
    const uint64_t bytes = g->tables.part_count * sizeof(struct hg_gpu_part);
    struct hg_gpu_part *parts = hg_calloc(g->tables.part_count + 1u, sizeof *parts);
    if (parts == NULL)
        return no_memory(err);
    if (bytes > 0)
        memcpy(parts, g->tables.parts.shadow, bytes);
    for (uint32_t i = 0; i < g->deforms.count; i++) {
        const struct hg_deform_entry *d = &g->deforms.items[i];
        if (d->vertex_count == 0)
            continue;
        parts[d->index].positions = at;
        parts[d->index].vertices = at + d->vertices_offset;
        at += d->output_bytes;
    }
    const enum hg_status status =
        hg_gpu_array_write(g->gpu, &m->parts, parts, bytes, &written, err);
    hg_free(parts);
    return status;
}

static enum hg_status copy_deformed(
    const struct hg_geometry *g, struct hg_pose_snapshot *m, struct hg_error *err)
{
    struct hg_gpu_cmd *cmd;
    uint64_t at = 0;
    enum hg_status status = hg_gpu_begin(g->gpu, &cmd, err);
    if (status != HG_OK)
        return status;
    hg_gpu_memory_barrier(cmd);
    for (uint32_t i = 0; i < g->deforms.count; i++) {
        const struct hg_deform_entry *d = &g->deforms.items[i];
        const VkBufferCopy region = {0, at, d->output_bytes};
        if (d->vertex_count == 0)
            continue;
        vkCmdCopyBuffer(hg_gpu_cmd_handle(cmd), d->output.handle, m->deformed.handle, 1, &region);
        at += d->output_bytes;
    }
    hg_gpu_memory_barrier(cmd);
    return hg_gpu_submit_and_wait(g->gpu, cmd, err);
}

static enum hg_status take_deformed(
    const struct hg_geometry *g, struct hg_pose_snapshot *m, struct hg_error *err)
{
    uint64_t bytes = 0;
    for (uint32_t i = 0; i < g->deforms.count; i++)
        if (g->deforms.items[i].vertex_count > 0 &&
            !hg_add_u64(bytes, g->deforms.items[i].output_bytes, &bytes))
            return no_memory(err);
    if (bytes == 0)
        return HG_OK;
    const enum hg_status status = hg_gpu_buffer_reserve(
        g->gpu, HG_GPU_BUFFER_DEVICE, bytes, "poses of a moment", &m->deformed, err);
    return status == HG_OK ? copy_deformed(g, m, err) : status;
}

enum hg_status hg_pose_snapshot_take(
    struct hg_geometry *geometry, struct hg_pose_snapshot **moment, struct hg_error *err)
{
    if (*moment == NULL)
        *moment = hg_calloc(1, sizeof **moment);
    if (*moment == NULL)
        return no_memory(err);
    struct hg_pose_snapshot *m = *moment;
    m->gpu = geometry->gpu;
    m->worlds.name = "matrices of a moment";
    m->parts.name = "parts of a moment";
    enum hg_status status = take_worlds(geometry, m, err);
    if (status == HG_OK)
        status = take_deformed(geometry, m, err);
    return status == HG_OK ? take_parts(geometry, m, err) : status;
}

void hg_pose_snapshot_fill(const struct hg_pose_snapshot *m, struct hg_gpu_pose_snapshot *out)
{
    *out = (struct hg_gpu_pose_snapshot){
        .worlds = m->worlds.buffer.address, .parts = m->parts.buffer.address};
}
