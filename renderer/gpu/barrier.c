// barrier.c - what each image is used for, and the barriers between uses.
#include <string.h>

#include "base/alloc.h"
#include "renderer/gpu/internal.h"

void hg_gpu_full_barrier(VkCommandBuffer cmd)
{
    const VkMemoryBarrier2 barrier = {.sType = VK_STRUCTURE_TYPE_MEMORY_BARRIER_2,
        .srcStageMask = VK_PIPELINE_STAGE_2_ALL_COMMANDS_BIT,
        .srcAccessMask = VK_ACCESS_2_MEMORY_WRITE_BIT,
        .dstStageMask = VK_PIPELINE_STAGE_2_ALL_COMMANDS_BIT | VK_PIPELINE_STAGE_2_HOST_BIT,
        .dstAccessMask =
            VK_ACCESS_2_MEMORY_READ_BIT | VK_ACCESS_2_MEMORY_WRITE_BIT | VK_ACCESS_2_HOST_READ_BIT};
    const VkDependencyInfo info = {.sType = VK_STRUCTURE_TYPE_DEPENDENCY_INFO,
        .memoryBarrierCount = 1,
        .pMemoryBarriers = &barrier};
    vkCmdPipelineBarrier2(cmd, &info);
}

void hg_gpu_memory_barrier(struct hg_gpu_cmd *cmd)
{
    hg_gpu_full_barrier(cmd->handle);
}

static const struct {
    VkPipelineStageFlags2 stages;
    VkAccessFlags2 read, write;
    VkImageLayout layout;
} uses[] = {
    // Whatever was done with its memory is over: another image may have been there.
    [HG_GPU_USE_NONE] = {VK_PIPELINE_STAGE_2_ALL_COMMANDS_BIT, 0, VK_ACCESS_2_MEMORY_WRITE_BIT,
        VK_IMAGE_LAYOUT_UNDEFINED},
    [HG_GPU_USE_SAMPLED] = {VK_PIPELINE_STAGE_2_VERTEX_SHADER_BIT |
                                VK_PIPELINE_STAGE_2_FRAGMENT_SHADER_BIT |
                                VK_PIPELINE_STAGE_2_COMPUTE_SHADER_BIT,
        VK_ACCESS_2_SHADER_SAMPLED_READ_BIT, 0, VK_IMAGE_LAYOUT_SHADER_READ_ONLY_OPTIMAL},
    [HG_GPU_USE_COLOR] = {VK_PIPELINE_STAGE_2_COLOR_ATTACHMENT_OUTPUT_BIT,
        VK_ACCESS_2_COLOR_ATTACHMENT_READ_BIT, VK_ACCESS_2_COLOR_ATTACHMENT_WRITE_BIT,
        VK_IMAGE_LAYOUT_COLOR_ATTACHMENT_OPTIMAL},
    [HG_GPU_USE_DEPTH] = {VK_PIPELINE_STAGE_2_EARLY_FRAGMENT_TESTS_BIT |
                              VK_PIPELINE_STAGE_2_LATE_FRAGMENT_TESTS_BIT,
        VK_ACCESS_2_DEPTH_STENCIL_ATTACHMENT_READ_BIT,
        VK_ACCESS_2_DEPTH_STENCIL_ATTACHMENT_WRITE_BIT,
        VK_IMAGE_LAYOUT_DEPTH_STENCIL_ATTACHMENT_OPTIMAL},
    [HG_GPU_USE_COPY_READ] = {VK_PIPELINE_STAGE_2_ALL_TRANSFER_BIT, VK_ACCESS_2_TRANSFER_READ_BIT,
        0, VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL},
    [HG_GPU_USE_COPY_WRITE] = {VK_PIPELINE_STAGE_2_ALL_TRANSFER_BIT, 0,
        VK_ACCESS_2_TRANSFER_WRITE_BIT, VK_IMAGE_LAYOUT_TRANSFER_DST_OPTIMAL},
    [HG_GPU_USE_STORAGE] = {VK_PIPELINE_STAGE_2_FRAGMENT_SHADER_BIT |
                                VK_PIPELINE_STAGE_2_COMPUTE_SHADER_BIT,
        VK_ACCESS_2_SHADER_STORAGE_READ_BIT, VK_ACCESS_2_SHADER_STORAGE_WRITE_BIT,
        VK_IMAGE_LAYOUT_GENERAL},
};

VkImageLayout hg_gpu_layout(enum hg_gpu_use use)
{
    return uses[use].layout;
}

static struct hg_gpu_image_state *find_state(struct hg_gpu *gpu, VkImage image)
{
    for (uint32_t i = 0; i < gpu->images.count; i++) {
        if (gpu->images.states[i].handle == image)
            return &gpu->images.states[i];
    }
    return NULL;
}

bool hg_gpu_state_add(struct hg_gpu *gpu, VkImage image)
{
    if (hg_grow(&gpu->images.states, &gpu->images.capacity, gpu->images.count + 1,
            sizeof *gpu->images.states) != HG_OK)
        return false;
    gpu->images.states[gpu->images.count++] = (struct hg_gpu_image_state){.handle = image};
    return true;
}

void hg_gpu_state_remove(struct hg_gpu *gpu, VkImage image)
{
    struct hg_gpu_image_state *state = find_state(gpu, image);
    if (state != NULL)
        *state = gpu->images.states[--gpu->images.count];
}

// Images go back to what they were before the open batch or upload.
void hg_gpu_restore_states(struct hg_gpu *gpu, int kind)
{
    for (uint32_t i = 0; i < gpu->images.count; i++) {
        struct hg_gpu_image_state *state = &gpu->images.states[i];
        if (state->epoch[kind] == gpu->images.epoch[kind])
            memcpy(state->use, state->saved[kind], sizeof state->use);
    }
    gpu->images.preparation++;
    gpu->images.epoch[kind]++;
}

// Reads do not wait for reads; uploads see to their own order (upload.c). Contents that do not
// matter any more need no barrier before something is done with them.
static bool is_free(enum hg_gpu_use before, enum hg_gpu_use use)
{
    return before == use &&
           (uses[use].write == 0 || use == HG_GPU_USE_COPY_WRITE || use == HG_GPU_USE_NONE);
}

static void put_barrier(VkCommandBuffer cmd, const struct hg_gpu_image *image,
    struct hg_gpu_mips mips, enum hg_gpu_use before, enum hg_gpu_use use)
{
    const VkImageMemoryBarrier2 barrier = {
        .sType = VK_STRUCTURE_TYPE_IMAGE_MEMORY_BARRIER_2,
        .srcStageMask = uses[before].stages,
        .srcAccessMask = uses[before].write,
        .dstStageMask = uses[use].stages,
        .dstAccessMask = uses[use].read | uses[use].write,
        .oldLayout = uses[before].layout,
        .newLayout = uses[use].layout,
        .srcQueueFamilyIndex = VK_QUEUE_FAMILY_IGNORED,
        .dstQueueFamilyIndex = VK_QUEUE_FAMILY_IGNORED,
        .image = image->handle,
        .subresourceRange = {image->aspect, mips.first, mips.count, 0, VK_REMAINING_ARRAY_LAYERS},
    };
    const VkDependencyInfo info = {.sType = VK_STRUCTURE_TYPE_DEPENDENCY_INFO,
        .imageMemoryBarrierCount = 1,
        .pImageMemoryBarriers = &barrier};
    vkCmdPipelineBarrier2(cmd, &info);
}

void hg_gpu_image_barrier(struct hg_gpu *gpu, int kind, struct hg_gpu_image *image,
    struct hg_gpu_mips mips, enum hg_gpu_use use)
{
    struct hg_gpu_image_state *state = find_state(gpu, image->handle);
    if (state == NULL)
        return;
    const uint32_t end = mips.first + mips.count;
    const uint32_t mask = ((1u << mips.count) - 1) << mips.first;
    const bool prepared =
        state->prepared_in == gpu->images.preparation && (state->prepared & mask) == mask;
    state->prepared &= ~mask;
    for (uint32_t first = mips.first, last; first < end; first = last) {
        const enum hg_gpu_use before = state->use[first];
        for (last = first + 1; last < end && state->use[last] == before;)
            last++;
        if (is_free(before, use) || (prepared && before == use))
            continue;
        if (state->epoch[kind] != gpu->images.epoch[kind]) {
            state->epoch[kind] = gpu->images.epoch[kind];
            memcpy(state->saved[kind], state->use, sizeof state->use);
        }
        memset(state->use + first, use, last - first);
        if (use != HG_GPU_USE_NONE)
            put_barrier(kind == 0 ? gpu->batches.open->handle : gpu->uploads.open->handle, image,
                (struct hg_gpu_mips){first, last - first}, before, use);
    }
}

void hg_gpu_image_use_mips(struct hg_gpu_cmd *cmd, struct hg_gpu_image *image, uint32_t first,
    uint32_t count, enum hg_gpu_use use)
{
    hg_gpu_image_barrier(cmd->gpu, 0, image, (struct hg_gpu_mips){first, count}, use);
}

void hg_gpu_image_prepare(struct hg_gpu_cmd *cmd, struct hg_gpu_image *image, uint32_t first,
    uint32_t count, enum hg_gpu_use use)
{
    struct hg_gpu_image_state *state = find_state(cmd->gpu, image->handle);
    if (state == NULL)
        return;
    const uint32_t others =
        state->prepared_in == cmd->gpu->images.preparation ? state->prepared : 0;
    const uint32_t mask = ((1u << count) - 1) << first;
    state->prepared = 0;
    hg_gpu_image_use_mips(cmd, image, first, count, use);
    state->prepared = others | mask;
    state->prepared_in = cmd->gpu->images.preparation;
}

void hg_gpu_cmd_end_prepared(struct hg_gpu_cmd *cmd)
{
    cmd->gpu->images.preparation++;
}

void hg_gpu_image_use(struct hg_gpu_cmd *cmd, struct hg_gpu_image *image, enum hg_gpu_use use)
{
    hg_gpu_image_use_mips(cmd, image, 0, image->mips, use);
}

static VkBufferImageCopy copy_of(
    const struct hg_gpu_image *image, const struct hg_gpu_region *region, uint64_t offset)
{
    const bool slices = image->kind == HG_GPU_IMAGE_3D;
    return (VkBufferImageCopy){
        .bufferOffset = offset,
        .imageSubresource = {image->aspect, region->mip, slices ? 0 : region->layer, 1},
        .imageOffset = {(int32_t)region->x, (int32_t)region->y,
            slices ? (int32_t)region->layer : 0},
        .imageExtent = {region->width, region->height, 1},
    };
}

void hg_gpu_image_read(struct hg_gpu_cmd *cmd, struct hg_gpu_image *image,
    const struct hg_gpu_region *region, const struct hg_gpu_buffer *to, uint64_t offset)
{
    const VkBufferImageCopy copy = copy_of(image, region, offset);
    hg_gpu_image_use_mips(cmd, image, region->mip, 1, HG_GPU_USE_COPY_READ);
    vkCmdCopyImageToBuffer(
        cmd->handle, image->handle, VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL, to->handle, 1, &copy);
}

void hg_gpu_image_write(struct hg_gpu_cmd *cmd, struct hg_gpu_image *image,
    const struct hg_gpu_region *region, const struct hg_gpu_buffer *from, uint64_t offset,
    uint32_t row_px)
{
    VkBufferImageCopy copy = copy_of(image, region, offset);
    copy.bufferRowLength = row_px;
    hg_gpu_image_use_mips(cmd, image, region->mip, 1, HG_GPU_USE_COPY_WRITE);
    vkCmdCopyBufferToImage(
        cmd->handle, from->handle, image->handle, VK_IMAGE_LAYOUT_TRANSFER_DST_OPTIMAL, 1, &copy);
}
