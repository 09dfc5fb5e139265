// print.c - a compiled graph for people: as text, and as pictures for documents.
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

#include "renderer/graph/internal.h"

__attribute__((format(printf, 2, 3))) static void put(
    struct hg_writer *out, const char *format, ...)
{
    char line[512];
    va_list list;
    va_start(list, format);
    const int size = vsnprintf(line, sizeof line, format, list);
    va_end(list);
    if (size > 0)
        hg_write_bytes(out, line, (size_t)size < sizeof line ? (size_t)size : sizeof line - 1);
}

static const char *format_name(VkFormat format)
{
    switch (format) {
    case VK_FORMAT_R8_UNORM:
        return "R8";
    case VK_FORMAT_R8G8B8A8_UNORM:
        return "RGBA8";
    case VK_FORMAT_R8G8B8A8_SRGB:
        return "RGBA8 sRGB";
    case VK_FORMAT_R16G16_SFLOAT:
        return "RG16F";
    case VK_FORMAT_R16G16B16A16_UNORM:
        return "RGBA16";
    case VK_FORMAT_R16G16B16A16_SFLOAT:
        return "RGBA16F";
    case VK_FORMAT_R32_UINT:
        return "R32UI";
    case VK_FORMAT_R32_SFLOAT:
        return "R32F";
    case VK_FORMAT_R32G32_UINT:
        return "RG32UI";
    case VK_FORMAT_R32G32B32A32_SFLOAT:
        return "RGBA32F";
    case VK_FORMAT_D32_SFLOAT:
        return "D32";
    default:
        return "other";
    }
}

static const char *life_name(const struct hg_graph_resource *r)
{
    static const char *const lives[] = {"transient", "persistent", "history"};
    if (r->kind == HG_GRAPH_PREVIOUS)
        return "last frame's";
    return r->kind == HG_GRAPH_OWN ? lives[r->life] : "imported";
}

static bool is_live(const struct hg_graph_plan *plan, uint32_t resource)
{
    return plan->slots[resource].first != HG_GRAPH_NONE;
}

static void put_size(
    struct hg_writer *out, const struct hg_graph_plan *plan, const struct hg_graph_resource *r)
{
    if (r->width == plan->width && r->height == plan->height)
        put(out, "full");
    else
        put(out, "%ux%u", r->width, r->height);
    if (r->depth > 0)
        put(out, "x%u", r->depth);
    if (r->layers > 1)
        put(out, ", %u layers", r->layers);
    if (r->mips > 1)
        put(out, ", %u mips", r->mips);
}

// --- text ----------------------------------------------------------------------------------------

static void put_pass(struct hg_writer *out, const struct hg_graph_plan *plan, uint32_t place)
{
    const struct hg_graph_node *node = &plan->nodes[plan->order[place]];
    put(out, "%3u %s%s:", place, node->name, node->once ? " (once)" : "");
    for (uint32_t i = 0; i < node->use_count; i++) {
        const struct hg_graph_use *u = &node->uses[i];
        put(out, "%s %s%s %s", i > 0 ? "," : "", plan->resources[u->resource].name,
            plan->resources[u->resource].kind == HG_GRAPH_PREVIOUS ? " (last frame's)" : "",
            hg_graph_meanings[u->how].name);
        if (u->mip_plus_one > 0)
            put(out, " mip %u", u->mip_plus_one - 1u);
    }
    put(out, "\n");
}

static void put_resource(struct hg_writer *out, const struct hg_graph_plan *plan, uint32_t i)
{
    const struct hg_graph_resource *r = &plan->resources[i];
    const struct hg_graph_slot *slot = &plan->slots[i];
    put(out, "    %s: %s", r->name, life_name(r));
    if (r->kind != HG_GRAPH_BUFFER) {
        put(out, ", %s ", format_name(r->format));
        put_size(out, plan, r);
    }
    put(out, ", passes %u to %u", slot->first, slot->last);
    if (slot->image.handle != VK_NULL_HANDLE && !slot->alone)
        put(out, ", bytes %llu to %llu", (unsigned long long)slot->offset,
            (unsigned long long)(slot->offset + slot->need.size_bytes));
    put(out, "\n");
}

static void put_text(struct hg_writer *out, const struct hg_graph_plan *plan)
{
    put(out, "%ux%u px, %u of %u passes, transient images in %llu bytes of %llu\n", plan->width,
        plan->height, plan->order_count, plan->node_count, (unsigned long long)plan->heap_bytes,
        (unsigned long long)plan->unshared_bytes);
    for (uint32_t i = 0; i < plan->order_count; i++)
        put_pass(out, plan, i);
    for (uint32_t i = 0; i < plan->resource_count; i++)
        if (is_live(plan, i))
            put_resource(out, plan, i);
}

// --- pictures ------------------------------------------------------------------------------------

// Passes are p0.., resources r0.. by place and number; both languages know these names.
static void put_nodes(struct hg_writer *out, const struct hg_graph_plan *plan, bool mermaid)
{
    for (uint32_t i = 0; i < plan->order_count; i++) {
        const struct hg_graph_node *node = &plan->nodes[plan->order[i]];
        put(out, mermaid ? "    p%u[\"%s\"]\n" : "    p%u [shape=box,label=\"%s\"]\n", i,
            node->name);
    }
    for (uint32_t i = 0; i < plan->resource_count; i++) {
        const struct hg_graph_resource *r = &plan->resources[i];
        if (!is_live(plan, i))
            continue;
        put(out, mermaid ? "    r%u([\"%s%s" : "    r%u [label=\"%s%s", i, r->name,
            mermaid ? "<br/>" : "\\n");
        put(out, "%s", life_name(r));
        if (r->kind != HG_GRAPH_BUFFER) {
            put(out, ", %s ", format_name(r->format));
            put_size(out, plan, r);
        }
        put(out, mermaid ? "\"])\n" : "\"]\n");
    }
}

static void put_edges(struct hg_writer *out, const struct hg_graph_plan *plan, bool mermaid)
{
    const char *arrow = mermaid ? "-->" : "->";
    for (uint32_t i = 0; i < plan->order_count; i++) {
        const struct hg_graph_node *node = &plan->nodes[plan->order[i]];
        for (uint32_t k = 0; k < node->use_count; k++) {
            const struct hg_graph_meaning *meaning = &hg_graph_meanings[node->uses[k].how];
            if (meaning->reads)
                put(out, "    r%u %s p%u\n", node->uses[k].resource, arrow, i);
            if (meaning->writes)
                put(out, "    p%u %s r%u\n", i, arrow, node->uses[k].resource);
        }
    }
}

void hg_graph_print(
    const struct hg_graph *graph, enum hg_graph_format format, struct hg_writer *out)
{
    const struct hg_graph_plan *plan = graph->plan;
    if (plan == NULL)
        return;
    if (format == HG_GRAPH_TEXT) {
        put_text(out, plan);
        return;
    }
    const bool mermaid = format == HG_GRAPH_MERMAID;
    put(out, mermaid ? "flowchart TD\n" : "digraph frame {\n");
    put_nodes(out, plan, mermaid);
    put_edges(out, plan, mermaid);
    if (!mermaid)
        put(out, "}\n");
}

// --- numbers -------------------------------------------------------------------------------------

void hg_graph_stats(const struct hg_graph *graph, struct hg_graph_stats *out)
{
    const struct hg_graph_plan *plan = graph->plan;
    *out = (struct hg_graph_stats){.compilations = graph->compilations};
    if (plan == NULL)
        return;
    out->passes = plan->order_count;
    out->passes_left_out = plan->node_count - plan->order_count;
    out->transient_bytes = plan->heap_bytes;
    out->unshared_bytes = plan->unshared_bytes;
    for (uint32_t i = 0; i < plan->resource_count; i++)
        out->transient_images += plan->slots[i].image.handle != VK_NULL_HANDLE;
}

bool hg_graph_place(const struct hg_graph *graph, uint32_t resource, struct hg_graph_place *out)
{
    *out = (struct hg_graph_place){0};
    if (graph->plan == NULL || resource == 0)
        return false;
    const struct hg_graph_slot *slot = &graph->plan->slots[resource - 1];
    if (slot->image.handle == VK_NULL_HANDLE)
        return false;
    *out = (struct hg_graph_place){slot->offset, slot->need.size_bytes, slot->first, slot->last};
    return true;
}

const char *hg_graph_pass_name(const struct hg_graph *graph, uint32_t place)
{
    const struct hg_graph_plan *plan = graph->plan;
    return plan != NULL && place < plan->order_count ? plan->nodes[plan->order[place]].name : NULL;
}
