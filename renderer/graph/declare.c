// declare.c - what one frame says; see graph.h.
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

#include "base/alloc.h"
#include "renderer/graph/internal.h"

enum hg_status hg_graph_create(struct hg_gpu *gpu, struct hg_graph **out, struct hg_error *err)
{
    *out = NULL;
    struct hg_graph *graph = hg_calloc(1, sizeof *graph);
    if (graph == NULL)
        return hg_error_set(err, HG_E_NOMEM, "frame graph", NULL, "out of host memory");
    graph->gpu = gpu;
    graph->frame = hg_calloc(1, sizeof *graph->frame);
    graph->records = hg_calloc(HG_GRAPH_MAX_PASSES, sizeof(hg_graph_record *));
    graph->users = hg_calloc(HG_GRAPH_MAX_PASSES, sizeof(void *));
    graph->imports = hg_calloc(HG_GRAPH_MAX_RESOURCES, sizeof *graph->imports);
    if (graph->frame == NULL || graph->records == NULL || graph->users == NULL ||
        graph->imports == NULL) {
        hg_graph_destroy(graph);
        return hg_error_set(err, HG_E_NOMEM, "frame graph", NULL, "out of host memory");
    }
    *out = graph;
    return HG_OK;
}

void hg_graph_destroy(struct hg_graph *graph)
{
    if (graph == NULL)
        return;
    for (uint32_t i = 0; i < HG_GRAPH_PLANS; i++) {
        struct hg_graph_plan *plan = &graph->plans[i];
        hg_graph_drop_images(graph, plan);
        hg_free(plan->resources);
        hg_free(plan->nodes);
        hg_free(plan->slots);
        hg_free(plan->order);
    }
    for (uint32_t i = 0; i < graph->store_count; i++)
        hg_graph_drop_store(graph, &graph->stores[i]);
    hg_gpu_memory_destroy(graph->gpu, &graph->heap);
    hg_free(graph->stores);
    hg_free(graph->frame);
    hg_free(graph->records);
    hg_free(graph->users);
    hg_free(graph->imports);
    hg_free(graph);
}

void hg_graph_begin(struct hg_graph *graph, uint32_t width, uint32_t height)
{
    struct hg_graph_frame *frame = graph->frame;
    memset(frame->resources, 0, frame->resource_count * sizeof frame->resources[0]);
    memset(frame->nodes, 0, frame->node_count * sizeof frame->nodes[0]);
    frame->width = width;
    frame->height = height;
    frame->resource_count = frame->node_count = 0;
    graph->is_refused = false;
    graph->plan = NULL;
    graph->number++;
}

// Declaring cannot fail: the first thing that is wrong is kept for hg_graph_compile.
__attribute__((format(printf, 3, 4))) static void refuse(
    struct hg_graph *graph, const char *name, const char *text, ...)
{
    char reason[128];
    va_list list;
    if (graph->is_refused)
        return;
    va_start(list, text);
    vsnprintf(reason, sizeof reason, text, list);
    va_end(list);
    graph->is_refused = true;
    (void)!hg_error_set(&graph->refused, HG_E_INVAL, "frame graph", name, "%s", reason);
}

// A new resource, or NULL. Only histories share a name, with what came before.
static struct hg_graph_resource *add_resource(struct hg_graph *graph, const char *name)
{
    struct hg_graph_frame *frame = graph->frame;
    for (uint32_t i = 0; i < frame->resource_count; i++) {
        if (strcmp(frame->resources[i].name, name) == 0) {
            refuse(graph, name, "the name is declared twice");
            return NULL;
        }
    }
    if (frame->resource_count == HG_GRAPH_MAX_RESOURCES) {
        refuse(graph, name, "more than %d resources", HG_GRAPH_MAX_RESOURCES);
        return NULL;
    }
    struct hg_graph_resource *r = &frame->resources[frame->resource_count++];
    r->name = name;
    return r;
}

static uint32_t number_of(const struct hg_graph *graph, const struct hg_graph_resource *r)
{
    return r != NULL ? (uint32_t)(r - graph->frame->resources) + 1 : 0;
}

static uint32_t chain_length(uint32_t width, uint32_t height, uint32_t depth)
{
    uint32_t side = width > height ? width : height, count = 1;
    side = depth > side ? depth : side;
    for (; side > 1; side /= 2)
        count++;
    return count < HG_GPU_MAX_MIPS ? count : HG_GPU_MAX_MIPS;
}

uint32_t hg_graph_image(struct hg_graph *graph, const struct hg_graph_image_params *params)
{
    static const uint32_t divisors[] = {1, 2, 4, 8};
    struct hg_graph_resource *r = add_resource(graph, params->name);
    if (r == NULL)
        return 0;
    const bool absolute = params->size == HG_GRAPH_ABSOLUTE;
    const uint32_t by = absolute ? 1 : divisors[params->size];
    r->kind = HG_GRAPH_OWN;
    r->life = params->life;
    r->format = params->format;
    r->width = ((absolute ? params->width : graph->frame->width) + by - 1) / by;
    r->height = ((absolute ? params->height : graph->frame->height) + by - 1) / by;
    r->depth = params->depth;
    r->layers = params->layers > 0 ? params->layers : 1;
    r->mips = params->mips == HG_GRAPH_ALL_MIPS ? chain_length(r->width, r->height, r->depth)
              : params->mips > 0                ? params->mips
                                                : 1;
    return number_of(graph, r);
}

uint32_t hg_graph_previous(struct hg_graph *graph, uint32_t image)
{
    struct hg_graph_frame *frame = graph->frame;
    if (image == 0)
        return 0;
    const struct hg_graph_resource *now = &frame->resources[image - 1];
    if (now->kind != HG_GRAPH_OWN || now->life != HG_GRAPH_HISTORY) {
        refuse(graph, now->name, "it has no history");
        return 0;
    }
    for (uint32_t i = 0; i < frame->resource_count; i++) {
        if (frame->resources[i].kind == HG_GRAPH_PREVIOUS &&
            frame->resources[i].current == image - 1)
            return i + 1;
    }
    if (frame->resource_count == HG_GRAPH_MAX_RESOURCES) {
        refuse(graph, now->name, "more than %d resources", HG_GRAPH_MAX_RESOURCES);
        return 0;
    }
    struct hg_graph_resource *r = &frame->resources[frame->resource_count++];
    *r = *now;
    r->kind = HG_GRAPH_PREVIOUS;
    r->current = image - 1;
    r->wanted = false;
    return number_of(graph, r);
}

uint32_t hg_graph_import(struct hg_graph *graph, const char *name, struct hg_gpu_image *image)
{
    struct hg_graph_resource *r = image != NULL ? add_resource(graph, name) : NULL;
    if (r == NULL)
        return 0;
    r->kind = HG_GRAPH_IMPORT;
    r->life = HG_GRAPH_PERSISTENT;
    r->format = image->format;
    r->width = image->width;
    r->height = image->height;
    r->layers = image->layers;
    r->mips = image->mips;
    graph->imports[r - graph->frame->resources] = image;
    return number_of(graph, r);
}

uint32_t hg_graph_buffer(struct hg_graph *graph, const char *name)
{
    struct hg_graph_resource *r = add_resource(graph, name);
    if (r == NULL)
        return 0;
    r->kind = HG_GRAPH_BUFFER;
    r->life = HG_GRAPH_PERSISTENT;
    return number_of(graph, r);
}

static void add_use(
    struct hg_graph *graph, struct hg_graph_node *node, const struct hg_graph_access *access)
{
    const struct hg_graph_resource *r = &graph->frame->resources[access->resource - 1];
    const struct hg_graph_meaning *meaning = &hg_graph_meanings[access->how];
    if (meaning->buffer != (r->kind == HG_GRAPH_BUFFER))
        refuse(graph, node->name, "%s is no %s", r->name, meaning->buffer ? "buffer" : "image");
    if (meaning->writes && r->kind == HG_GRAPH_PREVIOUS)
        refuse(graph, node->name, "writes what was in %s", r->name);
    if (access->mip_plus_one > r->mips)
        refuse(graph, node->name, "%s has no mip %u", r->name, access->mip_plus_one - 1);
    node->uses[node->use_count++] =
        (struct hg_graph_use){.resource = (uint8_t)(access->resource - 1),
            .how = (uint8_t)access->how,
            .mip_plus_one = (uint8_t)access->mip_plus_one};
}

void hg_graph_pass(struct hg_graph *graph, const struct hg_graph_pass *pass)
{
    struct hg_graph_frame *frame = graph->frame;
    if (frame->node_count == HG_GRAPH_MAX_PASSES) {
        refuse(graph, pass->name, "more than %d passes", HG_GRAPH_MAX_PASSES);
        return;
    }
    struct hg_graph_node *node = &frame->nodes[frame->node_count];
    graph->records[frame->node_count] = pass->record;
    graph->users[frame->node_count++] = pass->user;
    node->name = pass->name;
    node->keep = pass->keep;
    node->once = pass->once;
    node->untimed = pass->untimed;
    for (uint32_t i = 0; i < HG_GRAPH_MAX_ACCESSES; i++) {
        if (pass->accesses[i].resource > 0)
            add_use(graph, node, &pass->accesses[i]);
    }
}

void hg_graph_want(struct hg_graph *graph, uint32_t resource)
{
    if (resource > 0)
        graph->frame->resources[resource - 1].wanted = true;
}
