// command.c - batches, the timeline, rendering, stage timers.
#include <string.h>

#include "base/alloc.h"
#include "base/clock.h"
#include "base/log.h"
#include "renderer/gpu/internal.h"

#define WAIT_SLICE_NS 1000000000u

static enum hg_status init_slot(struct hg_gpu *gpu, struct hg_gpu_cmd *slot, struct hg_error *err)
{
    slot->gpu = gpu;
    const VkCommandPoolCreateInfo pool = {.sType = VK_STRUCTURE_TYPE_COMMAND_POOL_CREATE_INFO,
        .flags = VK_COMMAND_POOL_CREATE_TRANSIENT_BIT,
        .queueFamilyIndex = gpu->queue_family};
    enum hg_status status =
        HG_VK(gpu, err, vkCreateCommandPool, gpu->device, &pool, NULL, &slot->pool);
    if (status != HG_OK)
        return status;
    const VkCommandBufferAllocateInfo buffers = {
        .sType = VK_STRUCTURE_TYPE_COMMAND_BUFFER_ALLOCATE_INFO,
        .commandPool = slot->pool,
        .commandBufferCount = 1};
    status = HG_VK(gpu, err, vkAllocateCommandBuffers, gpu->device, &buffers, &slot->handle);
    const VkQueryPoolCreateInfo queries = {.sType = VK_STRUCTURE_TYPE_QUERY_POOL_CREATE_INFO,
        .queryType = VK_QUERY_TYPE_TIMESTAMP,
        .queryCount = 2 * HG_GPU_MAX_STAGES};
    if (status == HG_OK && gpu->caps.timestamp_period_ns > 0)
        status = HG_VK(gpu, err, vkCreateQueryPool, gpu->device, &queries, NULL, &slot->queries);
    return status;
}

static enum hg_status init_upload(
    struct hg_gpu *gpu, struct hg_gpu_upload *upload, struct hg_error *err)
{
    const VkCommandPoolCreateInfo pool = {.sType = VK_STRUCTURE_TYPE_COMMAND_POOL_CREATE_INFO,
        .flags = VK_COMMAND_POOL_CREATE_TRANSIENT_BIT,
        .queueFamilyIndex = gpu->queue_family};
    enum hg_status status =
        HG_VK(gpu, err, vkCreateCommandPool, gpu->device, &pool, NULL, &upload->pool);
    if (status != HG_OK)
        return status;
    const VkCommandBufferAllocateInfo buffers = {
        .sType = VK_STRUCTURE_TYPE_COMMAND_BUFFER_ALLOCATE_INFO,
        .commandPool = upload->pool,
        .commandBufferCount = 1};
    return HG_VK(gpu, err, vkAllocateCommandBuffers, gpu->device, &buffers, &upload->handle);
}

enum hg_status hg_gpu_commands_init(struct hg_gpu *gpu, struct hg_error *err)
{
    const VkSemaphoreTypeCreateInfo type = {.sType = VK_STRUCTURE_TYPE_SEMAPHORE_TYPE_CREATE_INFO,
        .semaphoreType = VK_SEMAPHORE_TYPE_TIMELINE};
    const VkSemaphoreCreateInfo info = {
        .sType = VK_STRUCTURE_TYPE_SEMAPHORE_CREATE_INFO, .pNext = &type};
    enum hg_status status =
        HG_VK(gpu, err, vkCreateSemaphore, gpu->device, &info, NULL, &gpu->batches.timeline);
    for (uint32_t i = 0; i < HG_GPU_SLOTS && status == HG_OK; i++)
        status = init_slot(gpu, &gpu->batches.slots[i], err);
    for (uint32_t i = 0; i < HG_GPU_SLOTS && status == HG_OK; i++)
        status = init_upload(gpu, &gpu->uploads.slots[i], err);
    return status;
}

static void finish_slot(struct hg_gpu *gpu, struct hg_gpu_cmd *slot)
{
    for (uint32_t i = 0; i < slot->set_pool_count; i++)
        vkDestroyDescriptorPool(gpu->device, slot->set_pools[i], NULL);
    hg_free(slot->set_pools);
    if (slot->queries != VK_NULL_HANDLE)
        vkDestroyQueryPool(gpu->device, slot->queries, NULL);
    if (slot->pool != VK_NULL_HANDLE)
        vkDestroyCommandPool(gpu->device, slot->pool, NULL);
    *slot = (struct hg_gpu_cmd){0};
}

static void free_retired(struct hg_gpu *gpu, const struct hg_gpu_retired *object)
{
    for (uint32_t i = 0; i < object->layer_view_count; i++)
        vkDestroyImageView(gpu->device, object->layer_views[i], NULL);
    for (uint32_t i = 0; i < object->mip_view_count; i++)
        vkDestroyImageView(gpu->device, object->mip_views[i], NULL);
    hg_free(object->layer_views);
    hg_free(object->mip_views);
    vkDestroyImageView(gpu->device, object->view, NULL);
    vkDestroyImage(gpu->device, object->image, NULL);
    vkDestroyBufferView(gpu->device, object->texels, NULL);
    vkDestroyBuffer(gpu->device, object->buffer, NULL);
    struct hg_gpu_memory memory = object->memory;
    hg_gpu_memory_give(gpu, &memory);
}

void hg_gpu_commands_finish(struct hg_gpu *gpu)
{
    for (uint32_t i = 0; i < HG_GPU_SLOTS; i++)
        finish_slot(gpu, &gpu->batches.slots[i]);
    for (uint32_t i = 0; i < gpu->retired.count; i++)
        free_retired(gpu, &gpu->retired.items[i]);
    hg_free(gpu->retired.items);
    hg_free(gpu->images.states);
    gpu->retired.items = NULL;
    gpu->retired.count = 0;
    if (gpu->batches.timeline != VK_NULL_HANDLE)
        vkDestroySemaphore(gpu->device, gpu->batches.timeline, NULL);
    gpu->batches.timeline = VK_NULL_HANDLE;
}

// --- lifetime ------------------------------------------------------------------------------------

void hg_gpu_retire(struct hg_gpu *gpu, const struct hg_gpu_retired *object)
{
    const bool idle = gpu->batches.open == NULL && gpu->uploads.open == NULL &&
                      gpu->batches.completed >= gpu->batches.submitted;
    if (!idle && hg_grow(&gpu->retired.items, &gpu->retired.capacity, gpu->retired.count + 1,
                     sizeof *gpu->retired.items) == HG_OK) {
        gpu->retired.items[gpu->retired.count] = *object;
        gpu->retired.items[gpu->retired.count++].value = gpu->batches.submitted + 1;
        return;
    }
    if (!idle) // no memory to remember it: wait instead
        vkQueueWaitIdle(gpu->queue);
    free_retired(gpu, object);
}

static void sweep(struct hg_gpu *gpu)
{
    uint32_t kept = 0;
    const bool idle = gpu->batches.open == NULL && gpu->uploads.open == NULL &&
                      gpu->batches.completed >= gpu->batches.submitted;
    for (uint32_t i = 0; i < gpu->retired.count; i++) {
        if (idle || gpu->retired.items[i].value <= gpu->batches.completed)
            free_retired(gpu, &gpu->retired.items[i]);
        else
            gpu->retired.items[kept++] = gpu->retired.items[i];
    }
    gpu->retired.count = kept;
}

static void add_time(struct hg_gpu *gpu, const char *name, uint64_t ns)
{
    for (uint32_t i = 0; i < gpu->times.count; i++) {
        if (strcmp(gpu->times.items[i].name, name) == 0) {
            gpu->times.items[i].ns += ns;
            return;
        }
    }
    gpu->times.items[gpu->times.count++] = (struct hg_gpu_stage_time){name, ns};
}

static void read_times(struct hg_gpu *gpu, struct hg_gpu_cmd *slot)
{
    uint64_t ticks[2 * HG_GPU_MAX_STAGES];
    gpu->times.count = 0;
    if (slot->stage_count == 0 || slot->queries == VK_NULL_HANDLE)
        return;
    const uint32_t count = 2 * slot->stage_count;
    if (vkGetQueryPoolResults(gpu->device, slot->queries, 0, count, count * sizeof ticks[0], ticks,
            sizeof ticks[0], VK_QUERY_RESULT_64_BIT) != VK_SUCCESS)
        return;
    for (uint32_t i = 0; i < slot->stage_count; i++) {
        const uint64_t span = ticks[2 * i + 1] - ticks[2 * i];
        add_time(
            gpu, slot->stages[i], (uint64_t)((double)span * (double)gpu->caps.timestamp_period_ns));
    }
    slot->stage_count = 0;
}

uint32_t hg_gpu_stage_times(
    const struct hg_gpu *gpu, struct hg_gpu_stage_time out[HG_GPU_MAX_STAGES])
{
    memcpy(out, gpu->times.items, gpu->times.count * sizeof *out);
    return gpu->times.count;
}

bool hg_gpu_is_stuck(bool is_cpu, uint64_t waited_ns, uint64_t used_ns)
{
    if (waited_ns < HG_GPU_WAIT_NS)
        return false;
    return !is_cpu || used_ns >= HG_GPU_WAIT_NS / 2 || waited_ns >= 10 * HG_GPU_WAIT_NS;
}

static VkResult wait_for_timeline(const struct hg_gpu *gpu, const VkSemaphoreWaitInfo *info)
{
    const uint64_t begin_ns = hg_clock_now_ns(), begin_cpu_ns = hg_clock_cpu_ns();
    VkResult result;
    do {
        result = vkWaitSemaphores(gpu->device, info, WAIT_SLICE_NS);
    } while (
        result == VK_TIMEOUT && !hg_gpu_is_stuck(gpu->caps.is_cpu, hg_clock_now_ns() - begin_ns,
                                    hg_clock_cpu_ns() - begin_cpu_ns));
    return result;
}

enum hg_status hg_gpu_wait(struct hg_gpu *gpu, uint64_t value, struct hg_error *err)
{
    if (gpu->lost)
        return hg_error_set(err, HG_E_DEVICE_LOST, "device", NULL, "the device was lost");
    if (value > gpu->batches.completed) {
        const VkSemaphoreWaitInfo info = {.sType = VK_STRUCTURE_TYPE_SEMAPHORE_WAIT_INFO,
            .semaphoreCount = 1,
            .pSemaphores = &gpu->batches.timeline,
            .pValues = &value};
        const VkResult result =
            hg_gpu_call_fails(&(VkResult){0}) ? hg_gpu_injected() : wait_for_timeline(gpu, &info);
        enum hg_status status = hg_gpu_check(gpu, result, "vkWaitSemaphores", err);
        if (status != HG_OK)
            return status;
        gpu->batches.completed = value;
        for (uint32_t i = 0; i < HG_GPU_SLOTS; i++) {
            if (gpu->batches.slots[i].value == value)
                read_times(gpu, &gpu->batches.slots[i]);
        }
    }
    sweep(gpu);
    return HG_OK;
}

bool hg_gpu_is_lost(const struct hg_gpu *gpu)
{
    return gpu->lost;
}

// --- batches -------------------------------------------------------------------------------------

VkCommandBuffer hg_gpu_cmd_handle(const struct hg_gpu_cmd *cmd)
{
    return cmd->handle;
}

enum hg_status hg_gpu_begin(struct hg_gpu *gpu, struct hg_gpu_cmd **out, struct hg_error *err)
{
    *out = NULL;
    struct hg_gpu_cmd *slot = &gpu->batches.slots[gpu->batches.next_slot];
    if (gpu->batches.open != NULL)
        return hg_error_set(err, HG_E_STATE, "batch", NULL, "another batch is being recorded");
    enum hg_status status = hg_gpu_wait(gpu, slot->value, err);
    if (status == HG_OK)
        status = HG_VK(gpu, err, vkResetCommandPool, gpu->device, slot->pool, 0);
    for (uint32_t i = 0; i < slot->set_pool_count && status == HG_OK; i++)
        status = HG_VK(gpu, err, vkResetDescriptorPool, gpu->device, slot->set_pools[i], 0);
    const VkCommandBufferBeginInfo info = {.sType = VK_STRUCTURE_TYPE_COMMAND_BUFFER_BEGIN_INFO,
        .flags = VK_COMMAND_BUFFER_USAGE_ONE_TIME_SUBMIT_BIT};
    if (status == HG_OK)
        status = HG_VK(gpu, err, vkBeginCommandBuffer, slot->handle, &info);
    if (status != HG_OK)
        return status;
    slot->sets_used = 0;
    slot->stage_count = 0;
    slot->stage_open = false;
    if (slot->queries != VK_NULL_HANDLE)
        vkCmdResetQueryPool(slot->handle, slot->queries, 0, 2 * HG_GPU_MAX_STAGES);
    gpu->batches.next_slot = (gpu->batches.next_slot + 1) % HG_GPU_SLOTS;
    gpu->batches.open = slot;
    *out = slot;
    return HG_OK;
}

static enum hg_status submit(struct hg_gpu *gpu, const VkCommandBuffer *handles, uint32_t count,
    uint64_t *value, struct hg_error *err)
{
    *value = 0;
    VkCommandBufferSubmitInfo buffers[2];
    for (uint32_t i = 0; i < count; i++) {
        buffers[i] = (VkCommandBufferSubmitInfo){
            .sType = VK_STRUCTURE_TYPE_COMMAND_BUFFER_SUBMIT_INFO, .commandBuffer = handles[i]};
    }
    const VkSemaphoreSubmitInfo signal = {.sType = VK_STRUCTURE_TYPE_SEMAPHORE_SUBMIT_INFO,
        .semaphore = gpu->batches.timeline,
        .value = gpu->batches.submitted + 1,
        .stageMask = VK_PIPELINE_STAGE_2_ALL_COMMANDS_BIT};
    const VkSubmitInfo2 info = {.sType = VK_STRUCTURE_TYPE_SUBMIT_INFO_2,
        .commandBufferInfoCount = count,
        .pCommandBufferInfos = buffers,
        .signalSemaphoreInfoCount = 1,
        .pSignalSemaphoreInfos = &signal};
    enum hg_status status = HG_VK(gpu, err, vkQueueSubmit2, gpu->queue, 1, &info, VK_NULL_HANDLE);
    if (status != HG_OK)
        return status;
    *value = ++gpu->batches.submitted;
    return HG_OK;
}

// Ends the open upload, so that all its copies are visible to what follows; *closed is it.
static enum hg_status close_upload(
    struct hg_gpu *gpu, struct hg_gpu_upload **closed, struct hg_error *err)
{
    *closed = gpu->uploads.open;
    if (gpu->uploads.open == NULL)
        return HG_OK;
    gpu->uploads.open = NULL;
    hg_gpu_full_barrier((*closed)->handle);
    return HG_VK(gpu, err, vkEndCommandBuffer, (*closed)->handle);
}

enum hg_status hg_gpu_submit_uploads(struct hg_gpu *gpu, struct hg_error *err)
{
    struct hg_gpu_upload *upload;
    if (gpu->uploads.open == NULL)
        return HG_OK;
    enum hg_status status = close_upload(gpu, &upload, err);
    if (status == HG_OK)
        status = submit(gpu, &upload->handle, 1, &upload->value, err);
    if (status != HG_OK)
        hg_gpu_restore_states(gpu, 1);
    gpu->images.epoch[1]++;
    return status;
}

enum hg_status hg_gpu_submit(
    struct hg_gpu *gpu, struct hg_gpu_cmd *cmd, uint64_t *value, struct hg_error *err)
{
    *value = 0;
    gpu->batches.open = NULL;
    hg_gpu_full_barrier(cmd->handle);
    struct hg_gpu_upload *upload = NULL;
    enum hg_status status = HG_VK(gpu, err, vkEndCommandBuffer, cmd->handle);
    if (status == HG_OK)
        status = close_upload(gpu, &upload, err);
    VkCommandBuffer handles[2];
    uint32_t count = 0;
    if (upload != NULL)
        handles[count++] = upload->handle;
    handles[count++] = cmd->handle;
    if (status == HG_OK)
        status = submit(gpu, handles, count, value, err);
    if (status != HG_OK) {
        hg_gpu_restore_states(gpu, 0);
        if (upload != NULL)
            hg_gpu_restore_states(gpu, 1);
        return status;
    }
    gpu->images.epoch[0]++;
    cmd->value = *value;
    if (upload != NULL) {
        upload->value = *value;
        gpu->images.epoch[1]++;
    }
    return HG_OK;
}

enum hg_status hg_gpu_submit_and_wait(
    struct hg_gpu *gpu, struct hg_gpu_cmd *cmd, struct hg_error *err)
{
    uint64_t value;
    const enum hg_status status = hg_gpu_submit(gpu, cmd, &value, err);
    return status == HG_OK ? hg_gpu_wait(gpu, value, err) : status;
}

enum hg_status hg_gpu_pause(struct hg_gpu *gpu, struct hg_gpu_cmd *cmd, struct hg_error *err)
{
    return hg_gpu_submit_and_wait(gpu, cmd, err);
}

enum hg_status hg_gpu_resume(struct hg_gpu *gpu, struct hg_gpu_cmd *cmd, struct hg_error *err)
{
    struct hg_gpu_cmd *same;
    gpu->batches.next_slot = (uint32_t)(cmd - gpu->batches.slots);
    return hg_gpu_begin(gpu, &same, err);
}

void hg_gpu_discard(struct hg_gpu *gpu, struct hg_gpu_cmd *cmd)
{
    if (gpu->batches.open != cmd || cmd == NULL)
        return;
    gpu->batches.open = NULL;
    cmd->stage_count = 0;
    hg_gpu_restore_states(gpu, 0);
    if (vkEndCommandBuffer(cmd->handle) != VK_SUCCESS)
        hg_debug(GPU, "a discarded batch could not be ended");
}

// --- rendering -----------------------------------------------------------------------------------

static VkRenderingAttachmentInfo attachment(
    struct hg_gpu_cmd *cmd, const struct hg_gpu_target *target, enum hg_gpu_use use)
{
    struct hg_gpu_image *image = target->image;
    hg_gpu_image_use_mips(cmd, image, target->mip, 1, use);
    VkImageView view = image->view;
    if (image->layer_views != NULL)
        view = image->layer_views[target->mip * image->layers + target->layer];
    return (VkRenderingAttachmentInfo){
        .sType = VK_STRUCTURE_TYPE_RENDERING_ATTACHMENT_INFO,
        .imageView = view,
        .imageLayout = hg_gpu_layout(use),
        .loadOp = target->clear     ? VK_ATTACHMENT_LOAD_OP_CLEAR
                  : target->discard ? VK_ATTACHMENT_LOAD_OP_DONT_CARE
                                    : VK_ATTACHMENT_LOAD_OP_LOAD,
        .storeOp = VK_ATTACHMENT_STORE_OP_STORE,
        .clearValue = target->value,
    };
}

static void set_defaults(VkCommandBuffer cmd, const VkRect2D *area)
{
    const VkViewport viewport = {(float)area->offset.x, (float)area->offset.y,
        (float)area->extent.width, (float)area->extent.height, 0.0f, 1.0f};
    vkCmdSetViewport(cmd, 0, 1, &viewport);
    vkCmdSetScissor(cmd, 0, 1, area);
    vkCmdSetCullMode(cmd, VK_CULL_MODE_NONE);
    vkCmdSetFrontFace(cmd, VK_FRONT_FACE_COUNTER_CLOCKWISE);
    vkCmdSetDepthBias(cmd, 0.0f, 0.0f, 0.0f);
}

static uint32_t side_of(uint32_t side, uint32_t mip)
{
    return side >> mip > 0 ? side >> mip : 1;
}

void hg_gpu_cmd_begin_rendering(struct hg_gpu_cmd *cmd, const struct hg_gpu_rendering *rendering)
{
    VkRenderingAttachmentInfo colors[HG_GPU_MAX_COLORS];
    for (uint32_t i = 0; i < rendering->color_count; i++)
        colors[i] = attachment(cmd, &rendering->colors[i], HG_GPU_USE_COLOR);
    VkRenderingAttachmentInfo depth = {0};
    const bool has_depth = rendering->depth.image != NULL;
    if (has_depth)
        depth = attachment(cmd, &rendering->depth, HG_GPU_USE_DEPTH);
    const struct hg_gpu_target *first = has_depth ? &rendering->depth : &rendering->colors[0];
    VkRect2D area = rendering->area;
    if (area.extent.width == 0)
        area.extent = (VkExtent2D){
            side_of(first->image->width, first->mip), side_of(first->image->height, first->mip)};
    const VkRenderingInfo info = {
        .sType = VK_STRUCTURE_TYPE_RENDERING_INFO,
        .renderArea = area,
        .layerCount = 1,
        .colorAttachmentCount = rendering->color_count,
        .pColorAttachments = colors,
        .pDepthAttachment = has_depth ? &depth : NULL,
    };
    vkCmdBeginRendering(cmd->handle, &info);
    set_defaults(cmd->handle, &area);
}

void hg_gpu_cmd_end_rendering(struct hg_gpu_cmd *cmd)
{
    vkCmdEndRendering(cmd->handle);
}

void hg_gpu_cmd_push(struct hg_gpu_cmd *cmd, const void *data, uint32_t size_bytes)
{
    vkCmdPushConstants(cmd->handle, cmd->gpu->shared_set.pipeline_layout, VK_SHADER_STAGE_ALL, 0,
        size_bytes, data);
}

void hg_gpu_cmd_begin_stage(struct hg_gpu_cmd *cmd, const char *name)
{
    if (cmd->queries == VK_NULL_HANDLE || cmd->stage_count == HG_GPU_MAX_STAGES)
        return;
    cmd->stages[cmd->stage_count] = name;
    cmd->stage_open = true;
    vkCmdWriteTimestamp2(
        cmd->handle, VK_PIPELINE_STAGE_2_ALL_COMMANDS_BIT, cmd->queries, 2 * cmd->stage_count);
}

void hg_gpu_cmd_end_stage(struct hg_gpu_cmd *cmd)
{
    if (!cmd->stage_open)
        return;
    vkCmdWriteTimestamp2(
        cmd->handle, VK_PIPELINE_STAGE_2_ALL_COMMANDS_BIT, cmd->queries, 2 * cmd->stage_count + 1);
    cmd->stage_count++;
    cmd->stage_open = false;
}
