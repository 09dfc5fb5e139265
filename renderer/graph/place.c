// place.c - the images of a plan: transient ones share memory, others are kept by name.
#include <string.h>

#include "base/alloc.h"
#include "renderer/graph/internal.h"

// --- images --------------------------------------------------------------------------------------

static VkImageUsageFlags usage_of(const struct hg_graph_plan *plan, uint32_t resource)
{
    VkImageUsageFlags usage = 0;
    for (uint32_t i = 0; i < plan->node_count; i++) {
        const struct hg_graph_node *node = &plan->nodes[i];
        for (uint32_t k = 0; k < node->use_count; k++)
            if (node->uses[k].resource == resource)
                usage |= hg_graph_meanings[node->uses[k].how].needs;
    }
    return usage;
}

static struct hg_gpu_image_params params_of(
    const struct hg_graph_resource *r, VkImageUsageFlags usage)
{
    return (struct hg_gpu_image_params){.kind = r->depth > 0    ? HG_GPU_IMAGE_3D
                                                : r->layers > 1 ? HG_GPU_IMAGE_2D_ARRAY
                                                                : HG_GPU_IMAGE_2D,
        .format = r->format,
        .width = r->width,
        .height = r->height,
        .depth = r->depth,
        .layers = r->layers,
        .mips = r->mips,
        .attachment = (usage & (VK_IMAGE_USAGE_COLOR_ATTACHMENT_BIT |
                                   VK_IMAGE_USAGE_DEPTH_STENCIL_ATTACHMENT_BIT)) != 0,
        .storage = (usage & VK_IMAGE_USAGE_STORAGE_BIT) != 0,
        .name = r->name};
}

static bool is_transient(const struct hg_graph_plan *plan, uint32_t i)
{
    return plan->resources[i].kind == HG_GRAPH_OWN &&
           plan->resources[i].life == HG_GRAPH_TRANSIENT && plan->slots[i].first != HG_GRAPH_NONE;
}

void hg_graph_drop_images(struct hg_graph *graph, struct hg_graph_plan *plan)
{
    for (uint32_t i = 0; plan->slots != NULL && i < plan->resource_count; i++)
        hg_gpu_image_destroy(graph->gpu, &plan->slots[i].image);
}

// --- memory of transient images ------------------------------------------------------------------

static uint64_t align(uint64_t offset, uint64_t to)
{
    return (offset + to - 1) / to * to;
}

static bool meet(const struct hg_graph_slot *a, const struct hg_graph_slot *b)
{
    return a->first <= b->last && b->first <= a->last;
}

// The lowest place where nothing that lives at the same time lies.
static uint64_t find_place(
    const struct hg_graph_plan *plan, uint32_t image, const bool placed[HG_GRAPH_MAX_RESOURCES])
{
    const struct hg_graph_slot *slot = &plan->slots[image];
    uint64_t offset = 0;
    for (bool moved = true; moved;) {
        moved = false;
        for (uint32_t i = 0; i < plan->resource_count; i++) {
            const struct hg_graph_slot *other = &plan->slots[i];
            if (!placed[i] || other->alone || !meet(slot, other) ||
                offset >= other->offset + other->need.size_bytes ||
                other->offset >= offset + slot->need.size_bytes)
                continue;
            offset = align(other->offset + other->need.size_bytes, slot->need.alignment);
            moved = true;
        }
    }
    return offset;
}

static uint32_t largest_left(
    const struct hg_graph_plan *plan, const bool placed[HG_GRAPH_MAX_RESOURCES])
{
    uint32_t best = HG_GRAPH_NONE;
    for (uint32_t i = 0; i < plan->resource_count; i++) {
        if (!placed[i] && is_transient(plan, i) &&
            (best == HG_GRAPH_NONE ||
                plan->slots[i].need.size_bytes > plan->slots[best].need.size_bytes))
            best = i;
    }
    return best;
}

// Largest first: a large one that comes late seldom finds room. *need: of the memory for all.
static void place_images(
    struct hg_graph *graph, struct hg_graph_plan *plan, struct hg_gpu_image_need *need)
{
    bool placed[HG_GRAPH_MAX_RESOURCES] = {false};
    *need = (struct hg_gpu_image_need){0, 256, UINT32_MAX};
    plan->unshared_bytes = 0;
    for (uint32_t i = 0; i < plan->resource_count; i++) {
        if (!is_transient(plan, i))
            continue;
        const struct hg_gpu_image_params params = params_of(&plan->resources[i], usage_of(plan, i));
        hg_gpu_image_need(graph->gpu, &params, &plan->slots[i].need);
    }
    for (uint32_t i; (i = largest_left(plan, placed)) != HG_GRAPH_NONE; placed[i] = true) {
        struct hg_graph_slot *slot = &plan->slots[i];
        slot->alone = (need->type_bits & slot->need.type_bits) == 0;
        plan->unshared_bytes += slot->need.size_bytes;
        if (slot->alone)
            continue;
        slot->offset = find_place(plan, i, placed);
        need->type_bits &= slot->need.type_bits;
        if (slot->need.alignment > need->alignment)
            need->alignment = slot->need.alignment;
        if (slot->offset + slot->need.size_bytes > need->size_bytes)
            need->size_bytes = slot->offset + slot->need.size_bytes;
    }
    plan->heap_bytes = need->size_bytes;
}

// Memory for this plan; when the one that is there does not do, the images of all plans go with it.
static enum hg_status reserve_heap(
    struct hg_graph *graph, const struct hg_gpu_image_need *need, struct hg_error *err)
{
    const struct hg_gpu_image_need *have = &graph->heap_need;
    if (graph->heap.block != NULL && have->size_bytes >= need->size_bytes &&
        have->alignment >= need->alignment && (have->type_bits & ~need->type_bits) == 0)
        return HG_OK;
    for (uint32_t i = 0; i < HG_GRAPH_PLANS; i++)
        hg_graph_drop_images(graph, &graph->plans[i]);
    hg_gpu_memory_destroy(graph->gpu, &graph->heap);
    graph->heap_need = *need;
    return hg_gpu_memory_create(graph->gpu, need, &graph->heap, err);
}

static bool lacks_images(const struct hg_graph_plan *plan)
{
    for (uint32_t i = 0; i < plan->resource_count; i++)
        if (is_transient(plan, i) && plan->slots[i].image.handle == VK_NULL_HANDLE)
            return true;
    return false;
}

enum hg_status hg_graph_place_all(
    struct hg_graph *graph, struct hg_graph_plan *plan, struct hg_error *err)
{
    struct hg_gpu_image_need need;
    if (!lacks_images(plan))
        return HG_OK;
    place_images(graph, plan, &need);
    enum hg_status status = need.size_bytes > 0 ? reserve_heap(graph, &need, err) : HG_OK;
    for (uint32_t i = 0; i < plan->resource_count && status == HG_OK; i++) {
        struct hg_graph_slot *slot = &plan->slots[i];
        if (!is_transient(plan, i) || slot->image.handle != VK_NULL_HANDLE)
            continue;
        struct hg_gpu_image_params params = params_of(&plan->resources[i], usage_of(plan, i));
        params.memory = slot->alone ? NULL : &graph->heap;
        params.memory_offset = slot->offset;
        status = hg_gpu_image_create(graph->gpu, &params, &slot->image, err);
    }
    return status;
}

// --- images that are kept ------------------------------------------------------------------------

struct hg_graph_store *hg_graph_find_store(const struct hg_graph *graph, const char *name)
{
    for (uint32_t i = 0; i < graph->store_count; i++)
        if (strcmp(graph->stores[i].declared.name, name) == 0)
            return &graph->stores[i];
    return NULL;
}

void hg_graph_drop_store(struct hg_graph *graph, struct hg_graph_store *store)
{
    for (int i = 0; i < 2; i++)
        hg_gpu_image_destroy(graph->gpu, &store->images[i]);
    const struct hg_graph_resource declared = store->declared;
    *store = (struct hg_graph_store){.declared = declared};
}

void hg_graph_drop_old_stores(struct hg_graph *graph)
{
    for (uint32_t i = 0; i < graph->store_count; i++)
        if (graph->stores[i].used + HG_GRAPH_KEEP < graph->number)
            hg_graph_drop_store(graph, &graph->stores[i]);
}

static bool fits(
    const struct hg_graph_store *store, const struct hg_graph_resource *r, VkImageUsageFlags usage)
{
    struct hg_graph_resource same = *r;
    same.name = store->declared.name;
    same.wanted = store->declared.wanted;
    return store->images[0].handle != VK_NULL_HANDLE && (usage & ~store->usage) == 0 &&
           memcmp(&same, &store->declared, sizeof same) == 0;
}

static enum hg_status make_store(struct hg_graph *graph, const struct hg_graph_resource *r,
    VkImageUsageFlags usage, struct hg_error *err)
{
    struct hg_graph_store *store = hg_graph_find_store(graph, r->name);
    if (store != NULL && fits(store, r, usage)) {
        store->used = graph->number;
        return HG_OK;
    }
    if (store == NULL) {
        if (hg_grow(&graph->stores, &graph->store_capacity, graph->store_count + 1,
                sizeof *graph->stores) != HG_OK)
            return hg_error_set(err, HG_E_NOMEM, r->name, NULL, "out of host memory");
        store = &graph->stores[graph->store_count++];
        *store = (struct hg_graph_store){.declared = *r};
    }
    hg_graph_drop_store(graph, store);
    memcpy(&store->declared, r, sizeof *r);
    store->usage = usage;
    store->used = graph->number;
    const struct hg_gpu_image_params params = params_of(r, usage);
    enum hg_status status = HG_OK;
    for (int i = 0; i < (r->life == HG_GRAPH_HISTORY ? 2 : 1) && status == HG_OK; i++) {
        store->clear[i] = true;
        status = hg_gpu_image_create(graph->gpu, &params, &store->images[i], err);
    }
    if (status != HG_OK)
        hg_graph_drop_store(graph, store);
    return status;
}

// Whether any live pass of the plan touches it, or what was in it.
static bool is_used(const struct hg_graph_plan *plan, uint32_t resource)
{
    bool used = plan->slots[resource].first != HG_GRAPH_NONE;
    for (uint32_t i = 0; i < plan->resource_count; i++)
        used |= plan->resources[i].kind == HG_GRAPH_PREVIOUS &&
                plan->resources[i].current == resource && plan->slots[i].first != HG_GRAPH_NONE;
    return used;
}

enum hg_status hg_graph_make_stores(
    struct hg_graph *graph, const struct hg_graph_plan *plan, struct hg_error *err)
{
    enum hg_status status = HG_OK;
    for (uint32_t i = 0; i < plan->resource_count && status == HG_OK; i++) {
        const struct hg_graph_resource *r = &plan->resources[i];
        if (r->kind != HG_GRAPH_OWN || r->life == HG_GRAPH_TRANSIENT || !is_used(plan, i))
            continue;
        VkImageUsageFlags usage = usage_of(plan, i);
        status = make_store(graph, r, usage, err);
    }
    return status;
}
