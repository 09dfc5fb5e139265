// khr.c - the backend of VK_KHR_ray_query: the device's own acceleration structures. See trace.h.
//
// Structures are built from positions and indices where the device has them; flat bodies are one
// structure per class of draw (a ray's mask is asked of instances only), brought to world space by
// the build. What does not deform is compacted. Ray queries know no time: layouts in which anything
// moves while the shutter is open go to the compute backend (trace.c). Triangles whose corners are
// not finite are made to points where the host can see them; else what they do is up to the driver.
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/alloc.h"
#include "base/clock.h"
#include "renderer/trace/internal.h"
#include "renderer/trace/khr_input.h"
#include "shaders/shared/khr.h"

#define MOST_REFITS 64u
#define LEAST_PIECE 2048u
#define CLASSES     3 // of flat structures

struct functions {
    PFN_vkCreateAccelerationStructureKHR create;
    PFN_vkDestroyAccelerationStructureKHR destroy;
    PFN_vkGetAccelerationStructureBuildSizesKHR sizes;
    PFN_vkGetAccelerationStructureDeviceAddressKHR address;
    PFN_vkCmdBuildAccelerationStructuresKHR build;
    PFN_vkCmdCopyAccelerationStructureKHR copy;
    PFN_vkCmdWriteAccelerationStructuresPropertiesKHR write_properties;
};

struct structure {
    VkAccelerationStructureKHR handle;
    struct hg_gpu_buffer buffer;
    VkDeviceAddress address;
    uint64_t bytes;
};

struct body {
    uint64_t key, shape;
    struct structure tree;
    uint32_t first_geometry, refits;
};

struct khr {
    struct hg_trace *trace;
    struct functions vk;
    VkQueryPool queries;
    struct body flat[CLASSES];
    uint64_t flat_key;
    struct body *bodies; // that are placed, by key
    uint32_t body_count;
    struct structure top;
    struct hg_gpu_buffer scratch, instances, transforms, tables;
    uint64_t geometries_at; // in tables
};

static enum hg_status no_memory(struct hg_error *err)
{
    return hg_error_set(err, HG_E_NOMEM, "ray tracing", NULL, "no memory");
}

// --- life ----------------------------------------------------------------------------------------

static void release(struct khr *k, struct structure *s)
{
    if (s->handle != VK_NULL_HANDLE)
        k->vk.destroy(hg_gpu_device(k->trace->gpu), s->handle, NULL);
    hg_gpu_buffer_destroy(k->trace->gpu, &s->buffer);
    memset(s, 0, sizeof *s);
}

static void clear(struct khr *k)
{
    for (int i = 0; i < CLASSES; i++)
        release(k, &k->flat[i].tree);
    memset(k->flat, 0, sizeof k->flat);
    k->flat_key = 0;
    for (uint32_t i = 0; i < k->body_count; i++)
        release(k, &k->bodies[i].tree);
    hg_free(k->bodies);
    k->bodies = NULL;
    k->body_count = 0;
    release(k, &k->top);
}

static void destroy(void *self)
{
    struct khr *k = self;
    if (k == NULL)
        return;
    struct hg_gpu *gpu = k->trace->gpu;
    clear(k);
    hg_gpu_buffer_destroy(gpu, &k->scratch);
    hg_gpu_buffer_destroy(gpu, &k->instances);
    hg_gpu_buffer_destroy(gpu, &k->transforms);
    hg_gpu_buffer_destroy(gpu, &k->tables);
    if (k->queries != VK_NULL_HANDLE)
        vkDestroyQueryPool(hg_gpu_device(gpu), k->queries, NULL);
    hg_free(k);
}

static bool load_functions(VkDevice device, struct functions *f)
{
#define LOAD(member, name) f->member = (PFN_##name)vkGetDeviceProcAddr(device, #name)
    LOAD(create, vkCreateAccelerationStructureKHR);
    LOAD(destroy, vkDestroyAccelerationStructureKHR);
    LOAD(sizes, vkGetAccelerationStructureBuildSizesKHR);
    LOAD(address, vkGetAccelerationStructureDeviceAddressKHR);
    LOAD(build, vkCmdBuildAccelerationStructuresKHR);
    LOAD(copy, vkCmdCopyAccelerationStructureKHR);
    LOAD(write_properties, vkCmdWriteAccelerationStructuresPropertiesKHR);
#undef LOAD
    return f->create != NULL && f->destroy != NULL && f->sizes != NULL && f->address != NULL &&
           f->build != NULL && f->copy != NULL && f->write_properties != NULL;
}

static enum hg_status create(struct hg_trace *trace, void **self, struct hg_error *err)
{
    struct hg_gpu *gpu = trace->gpu;
    const VkQueryPoolCreateInfo info = {.sType = VK_STRUCTURE_TYPE_QUERY_POOL_CREATE_INFO,
        .queryType = VK_QUERY_TYPE_ACCELERATION_STRUCTURE_COMPACTED_SIZE_KHR,
        .queryCount = 1};
    if (!hg_gpu_get_caps(gpu)->ray_query)
        return hg_error_set(err, HG_E_DEVICE, "ray tracing", "khr",
            "%.80s has no VK_KHR_ray_query and VK_KHR_acceleration_structure",
            hg_gpu_get_caps(gpu)->device_name);
    struct khr *k = hg_calloc(1, sizeof *k);
    if (k == NULL)
        return no_memory(err);
    *self = k;
    k->trace = trace;
    if (!load_functions(hg_gpu_device(gpu), &k->vk))
        return hg_error_set(
            err, HG_E_DEVICE, "ray tracing", "khr", "the driver lacks functions of its extension");
    return hg_gpu_check(gpu, vkCreateQueryPool(hg_gpu_device(gpu), &info, NULL, &k->queries),
        "vkCreateQueryPool", err);
}

// --- structures ----------------------------------------------------------------------------------

static uint64_t structure_bytes(const struct khr *k)
{
    uint64_t bytes = k->top.bytes + k->instances.size_bytes + k->tables.size_bytes;
    for (int i = 0; i < CLASSES; i++)
        bytes += k->flat[i].tree.bytes;
    for (uint32_t i = 0; i < k->body_count; i++)
        bytes += k->bodies[i].tree.bytes;
    return bytes;
}

static void note_peak(struct khr *k, uint64_t more)
{
    struct hg_trace_stats *stats = &k->trace->stats;
    const uint64_t now = structure_bytes(k) + k->scratch.size_bytes + more;
    stats->peak_bytes = now > stats->peak_bytes ? now : stats->peak_bytes;
}

static enum hg_status take(struct khr *k, VkAccelerationStructureTypeKHR type, uint64_t bytes,
    struct structure *out, struct hg_error *err)
{
    struct hg_gpu *gpu = k->trace->gpu;
    const uint64_t budget = k->trace->params.budget_bytes;
    memset(out, 0, sizeof *out);
    if (budget > 0 && structure_bytes(k) + bytes > budget)
        return hg_error_set(err, HG_E_LIMIT, "ray tracing budget", NULL,
            "%llu bytes do not hold the structures of this scene", (unsigned long long)budget);
    enum hg_status status = hg_gpu_buffer_create(
        gpu, HG_GPU_BUFFER_DEVICE, bytes, "acceleration structure", &out->buffer, err);
    if (status != HG_OK)
        return status;
    const VkAccelerationStructureCreateInfoKHR info = {
        .sType = VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_CREATE_INFO_KHR,
        .buffer = out->buffer.handle,
        .size = bytes,
        .type = type};
    status = hg_gpu_check(gpu, k->vk.create(hg_gpu_device(gpu), &info, NULL, &out->handle),
        "vkCreateAccelerationStructureKHR", err);
    if (status != HG_OK) {
        out->handle = VK_NULL_HANDLE;
        release(k, out);
        return status;
    }
    const VkAccelerationStructureDeviceAddressInfoKHR where = {
        .sType = VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_DEVICE_ADDRESS_INFO_KHR,
        .accelerationStructure = out->handle};
    out->address = k->vk.address(hg_gpu_device(gpu), &where);
    out->bytes = bytes;
    return HG_OK;
}

struct order { // of a build
    VkAccelerationStructureTypeKHR type;
    VkBuildAccelerationStructureFlagsKHR flags;
    bool refit;
    uint64_t compacted; // out: bytes
};

static enum hg_status finish_batch(struct hg_gpu *gpu, struct hg_gpu_cmd *cmd, struct hg_error *err)
{
    hg_gpu_memory_barrier(cmd);
    return hg_gpu_submit_and_wait(gpu, cmd, err);
}

static enum hg_status read_compacted(struct khr *k, uint64_t *bytes, struct hg_error *err)
{
    struct hg_gpu *gpu = k->trace->gpu;
    return hg_gpu_check(gpu,
        vkGetQueryPoolResults(hg_gpu_device(gpu), k->queries, 0, 1, sizeof *bytes, bytes,
            sizeof *bytes, VK_QUERY_RESULT_64_BIT | VK_QUERY_RESULT_WAIT_BIT),
        "vkGetQueryPoolResults", err);
}

// Builds (or refits) *s from what lies on the device.
static enum hg_status build(struct khr *k, const struct hg_khr_input *in, struct order *order,
    struct structure *s, struct hg_error *err)
{
    struct hg_gpu *gpu = k->trace->gpu;
    VkAccelerationStructureBuildGeometryInfoKHR info = {
        .sType = VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_BUILD_GEOMETRY_INFO_KHR,
        .type = order->type,
        .flags = order->flags,
        .mode = order->refit ? VK_BUILD_ACCELERATION_STRUCTURE_MODE_UPDATE_KHR
                             : VK_BUILD_ACCELERATION_STRUCTURE_MODE_BUILD_KHR,
        .srcAccelerationStructure = order->refit ? s->handle : VK_NULL_HANDLE,
        .geometryCount = in->count,
        .pGeometries = in->geometries};
    VkAccelerationStructureBuildSizesInfoKHR sizes = {
        .sType = VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_BUILD_SIZES_INFO_KHR};
    k->vk.sizes(hg_gpu_device(gpu), VK_ACCELERATION_STRUCTURE_BUILD_TYPE_DEVICE_KHR, &info,
        in->counts, &sizes);
    enum hg_status status = HG_OK;
    if (!order->refit)
        status = take(k, order->type, sizes.accelerationStructureSize, s, err);
    const uint64_t scratch = order->refit ? sizes.updateScratchSize : sizes.buildScratchSize;
    if (status == HG_OK)
        status = hg_gpu_buffer_reserve(
            gpu, HG_GPU_BUFFER_DEVICE, scratch + 256, "scratch", &k->scratch, err);
    struct hg_gpu_cmd *cmd;
    if (status == HG_OK)
        status = hg_gpu_begin(gpu, &cmd, err);
    if (status != HG_OK)
        return status;
    note_peak(k, s->bytes);
    info.dstAccelerationStructure = s->handle;
    info.scratchData.deviceAddress = k->scratch.address;
    const bool asks =
        (order->flags & VK_BUILD_ACCELERATION_STRUCTURE_ALLOW_COMPACTION_BIT_KHR) != 0;
    const VkCommandBuffer handle = hg_gpu_cmd_handle(cmd);
    if (asks)
        vkCmdResetQueryPool(handle, k->queries, 0, 1);
    hg_gpu_memory_barrier(cmd);
    const VkAccelerationStructureBuildRangeInfoKHR *ranges = in->ranges;
    k->vk.build(handle, 1, &info, &ranges);
    hg_gpu_memory_barrier(cmd);
    if (asks)
        k->vk.write_properties(handle, 1, &s->handle,
            VK_QUERY_TYPE_ACCELERATION_STRUCTURE_COMPACTED_SIZE_KHR, k->queries, 0);
    status = finish_batch(gpu, cmd, err);
    return status == HG_OK && asks ? read_compacted(k, &order->compacted, err) : status;
}

// Exchanges *s for a copy of `bytes`.
static enum hg_status compact(
    struct khr *k, uint64_t bytes, struct structure *s, struct hg_error *err)
{
    struct hg_gpu *gpu = k->trace->gpu;
    struct structure small;
    struct hg_gpu_cmd *cmd;
    if (bytes == 0 || bytes >= s->bytes)
        return HG_OK;
    enum hg_status status =
        take(k, VK_ACCELERATION_STRUCTURE_TYPE_BOTTOM_LEVEL_KHR, bytes, &small, err);
    if (status == HG_OK)
        status = hg_gpu_begin(gpu, &cmd, err);
    if (status == HG_OK) {
        const VkCopyAccelerationStructureInfoKHR info = {
            .sType = VK_STRUCTURE_TYPE_COPY_ACCELERATION_STRUCTURE_INFO_KHR,
            .src = s->handle,
            .dst = small.handle,
            .mode = VK_COPY_ACCELERATION_STRUCTURE_MODE_COMPACT_KHR};
        note_peak(k, s->bytes + bytes);
        k->vk.copy(hg_gpu_cmd_handle(cmd), &info);
        status = finish_batch(gpu, cmd, err);
    }
    if (status != HG_OK) {
        release(k, &small);
        return status;
    }
    release(k, s);
    *s = small;
    return HG_OK;
}

// --- bodies: one structure each -----------------------------------------------------------------

static enum hg_status build_body(struct khr *k, const struct hg_khr_input *in, bool deforms,
    struct body *body, struct hg_error *err)
{
    struct order order = {.type = VK_ACCELERATION_STRUCTURE_TYPE_BOTTOM_LEVEL_KHR,
        .flags = VK_BUILD_ACCELERATION_STRUCTURE_PREFER_FAST_TRACE_BIT_KHR |
                 (deforms ? VK_BUILD_ACCELERATION_STRUCTURE_ALLOW_UPDATE_BIT_KHR
                          : VK_BUILD_ACCELERATION_STRUCTURE_ALLOW_COMPACTION_BIT_KHR)};
    const enum hg_status status = build(k, in, &order, &body->tree, err);
    return status == HG_OK && !deforms ? compact(k, order.compacted, &body->tree, err) : status;
}

// --- tables: what hits mean ----------------------------------------------------------------------

struct tables {
    struct hg_gpu_khr_geometry *geometries;
    size_t geometry_capacity;
    uint32_t geometry_count;
    struct hg_gpu_khr_instance *instances;
    VkAccelerationStructureInstanceKHR *placed;
    uint32_t instance_count;
};

static enum hg_status add_geometry(struct tables *t, uint32_t draw, uint32_t first_primitive)
{
    const enum hg_status status = hg_grow(
        &t->geometries, &t->geometry_capacity, t->geometry_count + 1, sizeof *t->geometries);
    if (status == HG_OK)
        t->geometries[t->geometry_count++] = (struct hg_gpu_khr_geometry){draw, first_primitive};
    return status;
}

static void add_instance(
    struct tables *t, const struct body *body, const float world[12], uint32_t mask, uint32_t draw)
{
    VkAccelerationStructureInstanceKHR *i = &t->placed[t->instance_count];
    *i = (VkAccelerationStructureInstanceKHR){
        .flags = VK_GEOMETRY_INSTANCE_TRIANGLE_FACING_CULL_DISABLE_BIT_KHR,
        .accelerationStructureReference = body->tree.address};
    i->mask = mask & 0xffu;
    i->instanceCustomIndex = t->instance_count & 0xffffffu;
    hg_khr_rows(world, &i->transform);
    t->instances[t->instance_count++] = (struct hg_gpu_khr_instance){draw, body->first_geometry};
}

// --- flat ----------------------------------------------------------------------------------------

// Matrices of all flat places, in the order of add_flat.
static enum hg_status upload_transforms(
    struct khr *k, const struct hg_trace_layout *l, struct hg_error *err)
{
    VkTransformMatrixKHR *matrices = hg_calloc(l->place_count, sizeof *matrices);
    if (matrices == NULL)
        return no_memory(err);
    for (uint32_t i = 0; i < l->place_count; i++)
        hg_khr_rows(l->pieces[l->places[i].first_piece].world, &matrices[i]);
    struct hg_gpu *gpu = k->trace->gpu;
    enum hg_status status = hg_gpu_buffer_reserve(gpu, HG_GPU_BUFFER_DEVICE,
        (uint64_t)l->place_count * sizeof *matrices, "transforms", &k->transforms, err);
    if (status == HG_OK)
        status = hg_gpu_buffer_upload(
            gpu, &k->transforms, 0, matrices, (uint64_t)l->place_count * sizeof *matrices, err);
    hg_free(matrices);
    return status;
}

// Pieces of one class; geometry numbers go to the tables whether they are built again or not.
static enum hg_status list_flat(struct khr *k, const struct hg_trace_layout *l, uint32_t class,
    struct hg_khr_input *in, struct tables *t, struct hg_error *err)
{
    enum hg_status status = HG_OK;
    k->flat[class].first_geometry = t->geometry_count;
    for (uint32_t i = 0; i < l->body_count; i++) {
        const struct hg_trace_body *body = &l->bodies[i];
        for (uint32_t p = 0; body->flat && p < body->place_count; p++) {
            const uint32_t at = body->first_place + p;
            const struct hg_trace_place *place = &l->places[at];
            for (uint32_t n = 0;
                 place->mask == 1u << class && n < place->piece_count && status == HG_OK; n++) {
                const struct hg_ray_geometry_piece *piece = hg_trace_piece(l, place, n);
                status = hg_khr_input_add(k->trace->gpu, in, piece,
                    k->transforms.address + at * sizeof(VkTransformMatrixKHR), err);
                if (status == HG_OK &&
                    add_geometry(t, place->draw, piece->first_primitive) != HG_OK)
                    status = no_memory(err);
            }
        }
    }
    return status;
}

static enum hg_status build_flat(
    struct khr *k, const struct hg_trace_layout *l, struct tables *t, struct hg_error *err)
{
    const bool same = k->flat_key == l->flat_key && !l->flat_deforms;
    enum hg_status status = l->place_count > 0 ? upload_transforms(k, l, err) : HG_OK;
    for (uint32_t class = 0; class < CLASSES && status == HG_OK; class ++) {
        struct hg_khr_input in = {0};
        if (!same)
            release(k, &k->flat[class].tree);
        status = list_flat(k, l, class, &in, t, err);
        if (status == HG_OK && !same && in.count > 0)
            status = build_body(k, &in, false, &k->flat[class], err);
        hg_khr_input_finish(k->trace->gpu, &in);
    }
    k->flat_key = l->flat_key;
    k->trace->stats.built_triangles += same ? 0 : l->flat_triangles;
    return status;
}

// --- bodies --------------------------------------------------------------------------------------

static enum hg_status list_body(struct khr *k, const struct hg_trace_layout *l,
    const struct hg_trace_body *from, struct hg_khr_input *in, struct tables *t,
    struct hg_error *err)
{
    const struct hg_trace_place *place = &l->places[from->first_place];
    enum hg_status status = HG_OK;
    for (uint32_t i = 0; i < place->piece_count && status == HG_OK; i++) {
        const struct hg_ray_geometry_piece *piece = hg_trace_piece(l, place, i);
        const VkDeviceAddress matrix =
            k->transforms.address + from->first_place * sizeof(VkTransformMatrixKHR);
        status = hg_khr_input_add(k->trace->gpu, in, piece, from->in_world ? matrix : 0, err);
        if (status == HG_OK && add_geometry(t, 0, piece->first_primitive) != HG_OK)
            status = no_memory(err);
    }
    return status;
}

static uint64_t shape_of(const struct hg_khr_input *in)
{
    uint64_t h = 1;
    for (uint32_t i = 0; i < in->count; i++) {
        h = h * 31 + in->geometries[i].geometry.triangles.vertexData.deviceAddress;
        h = h * 31 + in->geometries[i].geometry.triangles.indexData.deviceAddress;
    }
    return h;
}

static enum hg_status bring_body(struct khr *k, const struct hg_trace_body *from,
    struct hg_khr_input *in, struct body *old, struct hg_error *err)
{
    struct hg_trace_stats *stats = &k->trace->stats;
    struct body *body = &k->bodies[k->body_count - 1];
    const uint32_t first_geometry = body->first_geometry;
    const uint64_t start = hg_clock_now_ns(), shape = shape_of(in);
    struct order order = {.type = VK_ACCELERATION_STRUCTURE_TYPE_BOTTOM_LEVEL_KHR,
        .flags = VK_BUILD_ACCELERATION_STRUCTURE_PREFER_FAST_TRACE_BIT_KHR |
                 VK_BUILD_ACCELERATION_STRUCTURE_ALLOW_UPDATE_BIT_KHR,
        .refit = true};
    enum hg_status status = HG_OK;
    // Inputs of bodies that do not deform are not read again.
    if (old != NULL && (!from->deforms || (old->shape == shape && old->refits < MOST_REFITS))) {
        *body = *old;
        memset(old, 0, sizeof *old);
        if (from->deforms) {
            status = build(k, in, &order, &body->tree, err);
            stats->refit_triangles += from->triangles;
            body->refits++;
        }
        stats->refit_ns += hg_clock_now_ns() - start;
    } else {
        status = build_body(k, in, from->deforms, body, err);
        stats->built_triangles += from->triangles;
        stats->build_ns += hg_clock_now_ns() - start;
    }
    body->key = from->key;
    body->shape = shape;
    body->first_geometry = first_geometry;
    return status;
}

static int by_key(const void *a, const void *b)
{
    const uint64_t x = *(const uint64_t *)a, y = *(const uint64_t *)b;
    return x < y ? -1 : x > y;
}

static enum hg_status build_bodies(
    struct khr *k, const struct hg_trace_layout *l, struct tables *t, struct hg_error *err)
{
    struct body *old = k->bodies;
    const uint32_t old_count = k->body_count;
    k->bodies = hg_calloc(l->body_count, sizeof *k->bodies);
    k->body_count = 0;
    enum hg_status status = k->bodies != NULL ? HG_OK : no_memory(err);
    for (uint32_t i = 0; i < l->body_count && status == HG_OK; i++) {
        if (l->bodies[i].flat)
            continue;
        struct hg_khr_input in = {0};
        struct body *found =
            old_count > 0 ? bsearch(&l->bodies[i].key, old, old_count, sizeof *old, by_key) : NULL;
        k->bodies[k->body_count++].first_geometry = t->geometry_count;
        status = list_body(k, l, &l->bodies[i], &in, t, err);
        if (status == HG_OK)
            status = bring_body(k, &l->bodies[i], &in, found, err);
        hg_khr_input_finish(k->trace->gpu, &in);
    }
    for (uint32_t i = 0; i < old_count; i++)
        release(k, &old[i].tree);
    hg_free(old);
    return status;
}

// --- instances -----------------------------------------------------------------------------------

static void place_all(struct khr *k, const struct hg_trace_layout *l, struct tables *t)
{
    static const float identity[12] = {1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0};
    uint32_t at = 0;
    for (uint32_t class = 0; class < CLASSES; class ++)
        if (k->flat[class].tree.handle != VK_NULL_HANDLE)
            add_instance(t, &k->flat[class], identity, 1u << class, 0);
    for (uint32_t i = 0; i < l->body_count; i++) {
        const struct hg_trace_body *from = &l->bodies[i];
        for (uint32_t p = 0; !from->flat && p < from->place_count; p++) {
            const struct hg_trace_place *place = &l->places[from->first_place + p];
            const float *world = hg_trace_matrix(from, &l->pieces[place->first_piece]);
            add_instance(t, &k->bodies[at], world, place->mask, place->draw);
        }
        at += !from->flat;
    }
}

static enum hg_status upload_tables(struct khr *k, const struct tables *t, struct hg_error *err)
{
    struct hg_gpu *gpu = k->trace->gpu;
    const uint64_t instances = t->instance_count * (uint64_t)sizeof *t->instances;
    const uint64_t geometries = t->geometry_count * (uint64_t)sizeof *t->geometries;
    const uint64_t placed = t->instance_count * (uint64_t)sizeof *t->placed;
    k->geometries_at = instances;
    enum hg_status status = hg_gpu_buffer_reserve(
        gpu, HG_GPU_BUFFER_DEVICE, instances + geometries + 8, "hit tables", &k->tables, err);
    if (status == HG_OK)
        status = hg_gpu_buffer_reserve(
            gpu, HG_GPU_BUFFER_DEVICE, placed + 64, "instances", &k->instances, err);
    if (status == HG_OK && instances > 0)
        status = hg_gpu_buffer_upload(gpu, &k->tables, 0, t->instances, instances, err);
    if (status == HG_OK && geometries > 0)
        status = hg_gpu_buffer_upload(gpu, &k->tables, instances, t->geometries, geometries, err);
    if (status == HG_OK && placed > 0)
        status = hg_gpu_buffer_upload(gpu, &k->instances, 0, t->placed, placed, err);
    return status;
}

static enum hg_status build_top(
    struct khr *k, const struct hg_trace_layout *l, struct tables *t, struct hg_error *err)
{
    const size_t most = (size_t)l->instances + CLASSES;
    release(k, &k->top);
    if (most > 1u << 24)
        return hg_error_set(err, HG_E_LIMIT, "ray tracing", "khr", "more than 2^24 instances");
    t->instances = hg_calloc(most, sizeof *t->instances);
    t->placed = hg_calloc(most, sizeof *t->placed);
    if (t->instances == NULL || t->placed == NULL)
        return no_memory(err);
    place_all(k, l, t);
    const enum hg_status status = upload_tables(k, t, err);
    if (status != HG_OK || t->instance_count == 0)
        return status;
    VkAccelerationStructureGeometryKHR geometry = {
        .sType = VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_GEOMETRY_KHR,
        .geometryType = VK_GEOMETRY_TYPE_INSTANCES_KHR,
        .geometry.instances = {
            .sType = VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_GEOMETRY_INSTANCES_DATA_KHR,
            .data.deviceAddress = k->instances.address}};
    VkAccelerationStructureBuildRangeInfoKHR range = {.primitiveCount = t->instance_count};
    const struct hg_khr_input in = {
        .geometries = &geometry, .ranges = &range, .counts = &t->instance_count, .count = 1};
    struct order order = {.type = VK_ACCELERATION_STRUCTURE_TYPE_TOP_LEVEL_KHR,
        .flags = VK_BUILD_ACCELERATION_STRUCTURE_PREFER_FAST_TRACE_BIT_KHR};
    return build(k, &in, &order, &k->top, err);
}

// --- all of it -----------------------------------------------------------------------------------

static enum hg_status sync(void *self, const struct hg_trace_layout *l, struct hg_error *err)
{
    struct khr *k = self;
    struct hg_trace_stats *stats = &k->trace->stats;
    struct tables t = {0};
    const uint64_t start = hg_clock_now_ns();
    if (l->motion)
        return hg_error_set(
            err, HG_E_UNSUPPORTED, "ray tracing", "khr", "ray queries know no motion");
    enum hg_status status = build_flat(k, l, &t, err);
    stats->build_ns += hg_clock_now_ns() - start;
    if (status == HG_OK)
        status = build_bodies(k, l, &t, err);
    const uint64_t top = hg_clock_now_ns();
    if (status == HG_OK)
        status = build_top(k, l, &t, err);
    stats->refit_ns += hg_clock_now_ns() - top;
    hg_free(t.geometries);
    hg_free(t.instances);
    hg_free(t.placed);
    if (status != HG_OK)
        clear(k);
    hg_gpu_buffer_destroy(k->trace->gpu, &k->scratch);
    stats->bytes = structure_bytes(k);
    return status;
}

// --- waves ---------------------------------------------------------------------------------------

static enum hg_status submit(
    void *self, const struct hg_trace_piece *piece, uint64_t *value, struct hg_error *err)
{
    struct khr *k = self;
    const struct hg_trace_addresses at = hg_trace_addresses(piece);
    struct hg_gpu_khr_wave wave = {.rays = at.rays,
        .list = at.list,
        .instances = k->tables.address,
        .geometries = k->tables.address + k->geometries_at,
        .scene = k->top.address,
        .count = piece->count};
    *(piece->any ? &wave.blocked : &wave.hits) = at.out;
    const struct hg_gpu_pipeline_params pipeline = {
        .compute = "trace_khr.comp", .spec = {piece->any}, .spec_count = 1};
    const struct hg_trace_dispatch dispatch = {
        &pipeline, &wave, sizeof wave, (piece->count + HG_KHR_GROUP - 1) / HG_KHR_GROUP};
    return hg_trace_submit_dispatch(k->trace->gpu, &dispatch, value, err);
}

const struct hg_trace_ops hg_trace_khr = {.create = create,
    .destroy = destroy,
    .sync = sync,
    .submit = submit,
    .least_piece = LEAST_PIECE};
