// memory.c - suballocation: blocks per memory type, first fit over ordered free ranges.
#include <sys/mman.h>
#include <unistd.h>

#include "base/alloc.h"
#include "base/log.h"
#include "renderer/gpu/internal.h"

static bool type_fits(const struct hg_gpu *gpu, uint32_t type, uint32_t bits, VkFlags flags)
{
    return (bits >> type & 1) != 0 &&
           (gpu->physical.memory_types.memoryTypes[type].propertyFlags & flags) == flags;
}

// Best memory type: wishes are tried in order, the last one is what the kind cannot do without.
static uint32_t choose_type(const struct hg_gpu *gpu, enum hg_gpu_memory_kind kind, uint32_t bits)
{
    const VkFlags local = VK_MEMORY_PROPERTY_DEVICE_LOCAL_BIT;
    const VkFlags host = VK_MEMORY_PROPERTY_HOST_VISIBLE_BIT | VK_MEMORY_PROPERTY_HOST_COHERENT_BIT;
    const VkFlags cached = VK_MEMORY_PROPERTY_HOST_CACHED_BIT;
    const VkFlags wishes[3][3] = {
        [HG_GPU_MEMORY_DEVICE] = {gpu->caps.mapped ? local | host : local, local, 0},
        [HG_GPU_MEMORY_UPLOAD] = {host, host, host},
        [HG_GPU_MEMORY_READBACK] = {host | cached, host, host},
    };
    for (int w = 0; w < 3; w++) {
        for (uint32_t t = 0; t < gpu->physical.memory_types.memoryTypeCount; t++) {
            if (type_fits(gpu, t, bits, wishes[kind][w]))
                return t;
        }
    }
    return UINT32_MAX;
}

static void destroy_block(struct hg_gpu *gpu, struct hg_gpu_block *block)
{
    struct hg_gpu_block **link = &gpu->memory.blocks;
    while (*link != NULL && *link != block)
        link = &(*link)->next;
    if (*link == block) {
        *link = block->next;
        gpu->memory.stats.reserved_bytes -= block->size_bytes;
    }
    if (block->memory != VK_NULL_HANDLE)
        vkFreeMemory(gpu->device, block->memory, NULL);
    hg_free(block->ranges);
    hg_free(block);
}

// Memory of a CPU device is that of the process. Rows of texels and of pictures lie apart by more
// than a page of 4 KiB, so that filtering would walk the page tables for every few texels.
static void ask_for_huge_pages(const struct hg_gpu_block *block)
{
    const uintptr_t page = (uintptr_t)sysconf(_SC_PAGESIZE);
    const uintptr_t start = ((uintptr_t)block->mapped + page - 1) & ~(page - 1);
    const uintptr_t end = ((uintptr_t)block->mapped + block->size_bytes) & ~(page - 1);
    if (end > start) // a wish: systems without them say no
        (void)madvise((void *)start, end - start, MADV_HUGEPAGE);
}

static enum hg_status allocate(struct hg_gpu *gpu, struct hg_gpu_block *block, struct hg_error *err)
{
    const VkMemoryAllocateFlagsInfo flags = {
        .sType = VK_STRUCTURE_TYPE_MEMORY_ALLOCATE_FLAGS_INFO,
        .flags = VK_MEMORY_ALLOCATE_DEVICE_ADDRESS_BIT,
    };
    const VkMemoryAllocateInfo info = {
        .sType = VK_STRUCTURE_TYPE_MEMORY_ALLOCATE_INFO,
        .pNext = &flags,
        .allocationSize = block->size_bytes,
        .memoryTypeIndex = block->type,
    };
    enum hg_status status =
        HG_VK(gpu, err, vkAllocateMemory, gpu->device, &info, NULL, &block->memory);
    const VkFlags props = gpu->physical.memory_types.memoryTypes[block->type].propertyFlags;
    if (status == HG_OK && (props & VK_MEMORY_PROPERTY_HOST_VISIBLE_BIT) != 0) {
        status = HG_VK(
            gpu, err, vkMapMemory, gpu->device, block->memory, 0, VK_WHOLE_SIZE, 0, &block->mapped);
        if (status == HG_OK && gpu->strategy.huge_pages)
            ask_for_huge_pages(block);
    }
    return status;
}

static enum hg_status create_block(struct hg_gpu *gpu, uint32_t type, uint64_t size_bytes,
    bool dedicated, struct hg_gpu_block **out, struct hg_error *err)
{
    *out = NULL;
    struct hg_gpu_block *block = hg_calloc(1, sizeof *block);
    if (block == NULL)
        return hg_error_set(err, HG_E_NOMEM, "device memory", NULL, "out of host memory");
    block->type = type;
    block->size_bytes = size_bytes;
    block->dedicated = dedicated;
    if (hg_grow(&block->ranges, &block->range_capacity, 16, sizeof *block->ranges) != HG_OK) {
        destroy_block(gpu, block);
        return hg_error_set(err, HG_E_NOMEM, "device memory", NULL, "out of host memory");
    }
    enum hg_status status = allocate(gpu, block, err);
    if (status != HG_OK) {
        destroy_block(gpu, block);
        return status;
    }
    block->ranges[block->range_count++] = (struct hg_gpu_range){0, size_bytes};
    block->next = gpu->memory.blocks;
    gpu->memory.blocks = block;
    gpu->memory.stats.reserved_bytes += size_bytes;
    if (gpu->memory.stats.reserved_bytes > gpu->memory.stats.peak_bytes)
        gpu->memory.stats.peak_bytes = gpu->memory.stats.reserved_bytes;
    *out = block;
    return HG_OK;
}

// Cuts `need` bytes at an aligned offset out of free range `i`. One more range may be needed.
static bool cut(struct hg_gpu_block *block, size_t i, uint64_t align, uint64_t need, uint64_t *out)
{
    struct hg_gpu_range *range = &block->ranges[i];
    const uint64_t start = (range->offset + align - 1) & ~(align - 1);
    const uint64_t end = range->offset + range->size_bytes;
    if (start > end || end - start < need)
        return false;
    const struct hg_gpu_range before = {range->offset, start - range->offset};
    const struct hg_gpu_range after = {start + need, end - (start + need)};
    if (hg_grow(&block->ranges, &block->range_capacity, block->range_count + 1,
            sizeof *block->ranges) != HG_OK)
        return false;
    const size_t pieces = (before.size_bytes > 0) + (after.size_bytes > 0);
    __builtin_memmove(block->ranges + i + pieces, block->ranges + i + 1,
        (block->range_count - i - 1) * sizeof *block->ranges);
    block->range_count += pieces - 1;
    if (before.size_bytes > 0)
        block->ranges[i++] = before;
    if (after.size_bytes > 0)
        block->ranges[i] = after;
    *out = start;
    return true;
}

static bool take_from_block(struct hg_gpu *gpu, struct hg_gpu_block *block, uint64_t align,
    uint64_t need, struct hg_gpu_memory *out)
{
    for (size_t i = 0; i < block->range_count; i++) {
        uint64_t offset;
        if (cut(block, i, align, need, &offset)) {
            *out = (struct hg_gpu_memory){block, offset, need};
            gpu->memory.stats.used_bytes += need;
            return true;
        }
    }
    return false;
}

enum hg_status hg_gpu_memory_take(struct hg_gpu *gpu, enum hg_gpu_memory_kind kind,
    const VkMemoryRequirements *need, struct hg_gpu_memory *out, struct hg_error *err)
{
    *out = (struct hg_gpu_memory){0};
    const uint32_t type = choose_type(gpu, kind, need->memoryTypeBits);
    if (type == UINT32_MAX)
        return hg_error_set(err, HG_E_DEVICE, "device memory", NULL, "no memory type fits");
    if (need->size > gpu->caps.max_allocation_bytes) {
        return hg_error_set(err, HG_E_LIMIT, "device memory", NULL,
            "%llu bytes in one piece, the device allows %llu", (unsigned long long)need->size,
            (unsigned long long)gpu->caps.max_allocation_bytes);
    }
    // Buffers and images share blocks: keep the granularity between them, and room for both.
    uint64_t align = need->alignment > 256 ? need->alignment : 256;
    if (gpu->physical.properties.limits.bufferImageGranularity > align)
        align = gpu->physical.properties.limits.bufferImageGranularity;
    const uint64_t size = (need->size + align - 1) & ~(align - 1);
    const bool dedicated = size > HG_GPU_BLOCK_BYTES / 2;
    if (!dedicated) {
        for (struct hg_gpu_block *b = gpu->memory.blocks; b != NULL; b = b->next) {
            if (b->type == type && !b->dedicated && take_from_block(gpu, b, align, size, out))
                return HG_OK;
        }
    }
    struct hg_gpu_block *block;
    enum hg_status status =
        create_block(gpu, type, dedicated ? size : HG_GPU_BLOCK_BYTES, dedicated, &block, err);
    if (status != HG_OK)
        return status;
    if (!take_from_block(gpu, block, align, size, out)) {
        destroy_block(gpu, block);
        return hg_error_set(err, HG_E_NOMEM, "device memory", NULL, "out of host memory");
    }
    return HG_OK;
}

static void merge(struct hg_gpu_block *block, size_t i)
{
    struct hg_gpu_range *r = block->ranges;
    if (i + 1 >= block->range_count || r[i].offset + r[i].size_bytes != r[i + 1].offset)
        return;
    r[i].size_bytes += r[i + 1].size_bytes;
    __builtin_memmove(r + i + 1, r + i + 2, (block->range_count - i - 2) * sizeof *r);
    block->range_count--;
}

void hg_gpu_memory_give(struct hg_gpu *gpu, struct hg_gpu_memory *memory)
{
    struct hg_gpu_block *block = memory->block;
    if (block == NULL)
        return;
    gpu->memory.stats.used_bytes -= memory->size_bytes;
    if (block->dedicated) {
        destroy_block(gpu, block);
        *memory = (struct hg_gpu_memory){0};
        return;
    }
    // When the list cannot grow the range is lost until the block goes; nothing else breaks.
    if (hg_grow(&block->ranges, &block->range_capacity, block->range_count + 1,
            sizeof *block->ranges) == HG_OK) {
        size_t i = 0;
        while (i < block->range_count && block->ranges[i].offset < memory->offset)
            i++;
        __builtin_memmove(block->ranges + i + 1, block->ranges + i,
            (block->range_count - i) * sizeof *block->ranges);
        block->ranges[i] = (struct hg_gpu_range){memory->offset, memory->size_bytes};
        block->range_count++;
        merge(block, i);
        if (i > 0)
            merge(block, i - 1);
    }
    *memory = (struct hg_gpu_memory){0};
}

void hg_gpu_memory_finish(struct hg_gpu *gpu)
{
    while (gpu->memory.blocks != NULL)
        destroy_block(gpu, gpu->memory.blocks);
}

void hg_gpu_memory_stats(const struct hg_gpu *gpu, struct hg_gpu_memory_stats *out)
{
    *out = gpu->memory.stats;
}
