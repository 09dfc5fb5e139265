// execute.c - records a compiled plan: barriers, stages, history.
#include <assert.h>
#include <string.h>

#include "renderer/graph/internal.h"

#define COLOR   VK_IMAGE_USAGE_COLOR_ATTACHMENT_BIT
#define DEPTH   VK_IMAGE_USAGE_DEPTH_STENCIL_ATTACHMENT_BIT
#define STORAGE VK_IMAGE_USAGE_STORAGE_BIT

const struct hg_graph_meaning hg_graph_meanings[] = {
    [HG_GRAPH_SAMPLE] = {HG_GPU_USE_SAMPLED, true, false, false, 0, "sampled"},
    [HG_GRAPH_LOAD] = {HG_GPU_USE_STORAGE, true, false, false, STORAGE, "loaded"},
    [HG_GRAPH_STORE] = {HG_GPU_USE_STORAGE, false, true, false, STORAGE, "stored"},
    [HG_GRAPH_UPDATE] = {HG_GPU_USE_STORAGE, true, true, false, STORAGE, "updated"},
    [HG_GRAPH_COLOR] = {HG_GPU_USE_COLOR, false, true, false, COLOR, "drawn"},
    [HG_GRAPH_COLOR_KEEP] = {HG_GPU_USE_COLOR, true, true, false, COLOR, "blended"},
    [HG_GRAPH_DEPTH] = {HG_GPU_USE_DEPTH, false, true, false, DEPTH, "drawn"},
    [HG_GRAPH_DEPTH_KEEP] = {HG_GPU_USE_DEPTH, true, true, false, DEPTH, "drawn over"},
    [HG_GRAPH_DEPTH_TEST] = {HG_GPU_USE_DEPTH, true, false, false, DEPTH, "tested"},
    [HG_GRAPH_COPY_FROM] = {HG_GPU_USE_COPY_READ, true, false, false, 0, "copied"},
    [HG_GRAPH_COPY_TO] = {HG_GPU_USE_COPY_WRITE, false, true, false, 0, "copied to"},
    [HG_GRAPH_READ] = {HG_GPU_USE_NONE, true, false, true, 0, "read"},
    [HG_GRAPH_WRITE] = {HG_GPU_USE_NONE, false, true, true, 0, "written"},
    [HG_GRAPH_READ_WRITE] = {HG_GPU_USE_NONE, true, true, true, 0, "updated"},
};

static struct hg_gpu_image *image_of(const struct hg_graph *graph, uint32_t resource)
{
    struct hg_graph_plan *plan = graph->plan;
    const struct hg_graph_resource *r = &plan->resources[resource];
    if (r->kind == HG_GRAPH_IMPORT)
        return graph->imports[resource];
    if (r->kind == HG_GRAPH_BUFFER)
        return NULL;
    if (r->life == HG_GRAPH_TRANSIENT)
        return &plan->slots[resource].image;
    struct hg_graph_store *store = hg_graph_find_store(graph, r->name);
    if (store == NULL)
        return NULL;
    return &store->images[r->kind == HG_GRAPH_PREVIOUS ? 1 - store->current : store->current];
}

struct hg_gpu_image *hg_graph_get_image(struct hg_graph *graph, uint32_t resource)
{
    assert(graph->plan != NULL && resource > 0);
    struct hg_gpu_image *image = image_of(graph, resource - 1);
    return image != NULL && image->handle != VK_NULL_HANDLE ? image : NULL;
}

struct hg_gpu_image *hg_graph_run_image(const struct hg_graph_run *run, uint32_t resource)
{
    const struct hg_graph_node *node = &run->graph->plan->nodes[run->pass];
    bool declared = false;
    for (uint32_t i = 0; i < node->use_count; i++)
        declared |= node->uses[i].resource == resource - 1;
    assert(declared); // the graph knows nothing of this use
    return declared ? hg_graph_get_image(run->graph, resource) : NULL;
}

bool hg_graph_has_content(const struct hg_graph *graph, uint32_t resource)
{
    assert(graph->plan != NULL && resource > 0);
    const struct hg_graph_resource *r = &graph->plan->resources[resource - 1];
    const struct hg_graph_store *store = hg_graph_find_store(graph, r->name);
    if (store == NULL)
        return false;
    return store->content[r->kind == HG_GRAPH_PREVIOUS ? 1 - store->current : store->current];
}

// --- barriers ------------------------------------------------------------------------------------

// Images of a store that nothing was written to hold zeros.
static void clear_image(struct hg_gpu_cmd *cmd, struct hg_gpu_image *image)
{
    const VkImageSubresourceRange all = {
        image->aspect, 0, VK_REMAINING_MIP_LEVELS, 0, VK_REMAINING_ARRAY_LAYERS};
    hg_gpu_image_use(cmd, image, HG_GPU_USE_NONE);
    hg_gpu_image_use(cmd, image, HG_GPU_USE_COPY_WRITE);
    if (image->aspect == VK_IMAGE_ASPECT_DEPTH_BIT) {
        const VkClearDepthStencilValue zero = {0};
        vkCmdClearDepthStencilImage(hg_gpu_cmd_handle(cmd), image->handle,
            VK_IMAGE_LAYOUT_TRANSFER_DST_OPTIMAL, &zero, 1, &all);
    } else {
        const VkClearColorValue zero = {{0}};
        vkCmdClearColorImage(hg_gpu_cmd_handle(cmd), image->handle,
            VK_IMAGE_LAYOUT_TRANSFER_DST_OPTIMAL, &zero, 1, &all);
    }
}

// Reads of what was never written find zeros; writes make it content.
static void touch_store(struct hg_graph *graph, struct hg_gpu_cmd *cmd,
    const struct hg_graph_resource *r, const struct hg_graph_meaning *meaning)
{
    struct hg_graph_store *store = hg_graph_find_store(graph, r->name);
    const uint32_t i = r->kind == HG_GRAPH_PREVIOUS ? 1 - store->current : store->current;
    if (store->clear[i] && meaning->reads)
        clear_image(cmd, &store->images[i]);
    store->clear[i] = false;
    store->content[i] |= meaning->writes;
    store->written |= meaning->writes;
}

// A barrier for all buffers when one of this pass's needs it.
static void order_buffers(
    struct hg_graph *graph, struct hg_gpu_cmd *cmd, const struct hg_graph_node *node)
{
    bool wait = false;
    for (uint32_t i = 0; i < node->use_count; i++) {
        const struct hg_graph_meaning *meaning = &hg_graph_meanings[node->uses[i].how];
        const uint32_t r = node->uses[i].resource;
        if (meaning->buffer)
            wait |= graph->buffer_written[r] || (meaning->writes && graph->buffer_read[r]);
    }
    if (wait) {
        hg_gpu_memory_barrier(cmd);
        memset(graph->buffer_read, 0, sizeof graph->buffer_read);
        memset(graph->buffer_written, 0, sizeof graph->buffer_written);
    }
    for (uint32_t i = 0; i < node->use_count; i++) {
        const struct hg_graph_meaning *meaning = &hg_graph_meanings[node->uses[i].how];
        const uint32_t r = node->uses[i].resource;
        graph->buffer_read[r] |= meaning->buffer && meaning->reads;
        graph->buffer_written[r] |= meaning->buffer && meaning->writes;
    }
}

static void order_image(
    struct hg_graph *graph, const struct hg_graph_run *run, uint32_t place, uint32_t use)
{
    struct hg_graph_plan *plan = graph->plan;
    const struct hg_graph_use *u = &plan->nodes[run->pass].uses[use];
    const struct hg_graph_meaning *meaning = &hg_graph_meanings[u->how];
    const struct hg_graph_resource *r = &plan->resources[u->resource];
    struct hg_gpu_image *image = image_of(graph, u->resource);
    const bool transient = r->kind == HG_GRAPH_OWN && r->life == HG_GRAPH_TRANSIENT;
    bool first = transient && plan->slots[u->resource].first == place;
    for (uint32_t i = 0; i < use; i++) // of this pass
        first &= plan->nodes[run->pass].uses[i].resource != u->resource;
    if (first) // others may have used its memory
        hg_gpu_image_use(run->cmd, image, HG_GPU_USE_NONE);
    if (!transient && r->kind != HG_GRAPH_IMPORT)
        touch_store(graph, run->cmd, r, meaning);
    const uint32_t mip = u->mip_plus_one > 0 ? u->mip_plus_one - 1u : 0;
    hg_gpu_image_prepare(run->cmd, image, mip, u->mip_plus_one > 0 ? 1 : image->mips, meaning->use);
}

// --- execution -----------------------------------------------------------------------------------

static enum hg_status execute_pass(
    struct hg_graph *graph, struct hg_graph_run *run, uint32_t place, struct hg_error *err)
{
    run->pass = graph->plan->order[place];
    const struct hg_graph_node *node = &graph->plan->nodes[run->pass];
    if (node->once && run->repetition > 0)
        return HG_OK;
    order_buffers(graph, run->cmd, node);
    for (uint32_t i = 0; i < node->use_count; i++)
        if (!hg_graph_meanings[node->uses[i].how].buffer)
            order_image(graph, run, place, i);
    if (graph->records[run->pass] == NULL)
        return HG_OK;
    if (!node->untimed)
        hg_gpu_cmd_begin_stage(run->cmd, node->name);
    const enum hg_status status = graph->records[run->pass](run, graph->users[run->pass], err);
    if (!node->untimed)
        hg_gpu_cmd_end_stage(run->cmd);
    hg_gpu_cmd_end_prepared(run->cmd);
    return status;
}

enum hg_status hg_graph_execute(struct hg_graph *graph, struct hg_gpu_cmd *cmd, void *data,
    uint32_t repetition, struct hg_error *err)
{
    struct hg_graph_run run = {
        .graph = graph, .gpu = graph->gpu, .cmd = cmd, .data = data, .repetition = repetition};
    if (graph->plan == NULL)
        return hg_error_set(err, HG_E_STATE, "frame graph", NULL, "it was not compiled");
    if (repetition == 0) { // batches before are ordered by their submission
        memset(graph->buffer_read, 0, sizeof graph->buffer_read);
        memset(graph->buffer_written, 0, sizeof graph->buffer_written);
    }
    enum hg_status status = HG_OK;
    for (uint32_t i = 0; i < graph->plan->order_count && status == HG_OK; i++)
        status = execute_pass(graph, &run, i, err);
    return status;
}

void hg_graph_advance(struct hg_graph *graph)
{
    for (uint32_t i = 0; i < graph->store_count; i++) {
        struct hg_graph_store *store = &graph->stores[i];
        if (store->declared.life == HG_GRAPH_HISTORY && store->written) {
            store->current = 1 - store->current;
            store->content[store->current] = false;
            store->clear[store->current] = true;
        }
        store->written = false;
    }
}

void hg_graph_reset(struct hg_graph *graph)
{
    for (uint32_t i = 0; i < graph->store_count; i++) {
        struct hg_graph_store *store = &graph->stores[i];
        for (int k = 0; k < 2; k++) {
            store->content[k] = false;
            store->clear[k] = true;
        }
        store->written = false;
    }
}
