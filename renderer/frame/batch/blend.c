// blend.c - the passes of blended surfaces. See recording.h.
#include "base/log.h"
#include "renderer/frame/batch/recording.h"
#include "renderer/passes/blend.h"
#include "renderer/passes/shade.h"
#include "shaders/shared/blend.h"

#define LISTS_EVERY 60 // pictures in motion, to see whether lists still take many

// --- the nearest one -----------------------------------------------------------------------------
//
// Transmissive surfaces without holes sample the scene behind them, and hide further ones.

static enum hg_status record_nearest(
    const struct hg_graph_run *run, void *user, struct hg_error *err)
{
    struct hg_batch *f = hg_batch_of(run);
    const struct hg_visibility_scene scene = {f->draw->culling, 0, 0};
    const struct hg_visibility_target target = {
        hg_graph_run_image(run, f->blend.visibility), hg_graph_run_image(run, f->blend.depth)};
    (void)user;
    return hg_visibility_record_nearest(
        &f->pass, &scene, &target, hg_graph_run_image(run, f->depth), err);
}

static enum hg_status shade_nearest(
    const struct hg_graph_run *run, void *user, struct hg_error *err)
{
    struct hg_batch *f = hg_batch_of(run);
    (void)user;
    const struct hg_shade shade = {.visibility = hg_graph_run_image(run, f->blend.visibility),
        .depth = hg_graph_run_image(run, f->blend.depth),
        .target = hg_graph_run_image(run, f->blend.color),
        .layer = true,
        .behind = f->behind > 0 ? hg_graph_run_image(run, f->behind) : NULL,
        .glass = f->blend.glass > 0 ? hg_graph_run_image(run, f->blend.glass) : NULL,
        .glass_rays = f->blend.rays > 0 ? hg_graph_run_image(run, f->blend.rays) : NULL};
    return hg_shade_record(&f->pass, &shade, err);
}

static void declare_nearest(struct hg_batch *f)
{
    hg_batch_add(
        f, &(struct hg_graph_pass){.name = "blend visibility",
               .record = record_nearest,
               .accesses = {{f->depth, HG_GRAPH_SAMPLE, 0}, {f->cache, HG_GRAPH_READ, 0},
                   {f->progress, HG_GRAPH_READ_WRITE, 0}, {f->blend.visibility, HG_GRAPH_COLOR, 0},
                   {f->blend.depth, HG_GRAPH_DEPTH, 0}}});
    hg_batch_add(
        f, &(struct hg_graph_pass){.name = "blend shading",
               .record = shade_nearest,
               .accesses = {{f->blend.visibility, HG_GRAPH_SAMPLE, 0},
                   {f->blend.depth, HG_GRAPH_DEPTH_TEST, 0}, {f->behind, HG_GRAPH_SAMPLE, 0},
                   {f->blend.glass, HG_GRAPH_SAMPLE, 0}, {f->blend.rays, HG_GRAPH_SAMPLE, 0},
                   {f->atlas, HG_GRAPH_SAMPLE, 0}, {f->cache, HG_GRAPH_READ, 0},
                   {f->progress, HG_GRAPH_READ_WRITE, 0}, {f->blend.color, HG_GRAPH_COLOR, 0}}});
}

// --- all of them ---------------------------------------------------------------------------------

// The pass of one strip of the area: as many rows of it as lists have memory for.
static struct hg_pass strip_of(struct hg_batch *f, void *user)
{
    const uint32_t i = (uint32_t)(uintptr_t)user, strips = f->draw->blend->strips;
    struct hg_pass pass = f->pass;
    if (strips == 1 || pass.find)
        return pass;
    if (pass.area.extent.width == 0)
        pass.area.extent = hg_frame_size(f->draw);
    const uint64_t rows = pass.area.extent.height;
    const uint32_t first = (uint32_t)(rows * i / strips), end = (uint32_t)(rows * (i + 1) / strips);
    pass.area.offset.y += (int32_t)first;
    pass.area.extent.height = end - first;
    return pass;
}

static bool is_empty(const struct hg_pass *pass)
{
    return pass->area.extent.width > 0 && pass->area.extent.height == 0;
}

static enum hg_status record_hiding(
    const struct hg_graph_run *run, void *user, struct hg_error *err)
{
    struct hg_batch *f = hg_batch_of(run);
    const struct hg_visibility_scene scene = {f->draw->culling, 0, 0};
    const struct hg_visibility_target target = {
        hg_graph_run_image(run, f->visibility), hg_graph_run_image(run, f->depth)};
    return hg_visibility_record_hiding(&f->pass, &scene, &target, user != NULL, err);
}

static enum hg_status clear_lists(const struct hg_graph_run *run, void *user, struct hg_error *err)
{
    struct hg_batch *f = hg_batch_of(run);
    (void)err;
    if (user == NULL)
        hg_blend_clear(&f->pass, &f->draw->blend->lists);
    else
        hg_blend_clear_nodes(&f->pass, &f->draw->blend->lists);
    return HG_OK;
}

static enum hg_status collect(const struct hg_graph_run *run, void *user, struct hg_error *err)
{
    struct hg_batch *f = hg_batch_of(run);
    struct hg_pass pass = strip_of(f, user);
    const struct hg_visibility_scene scene = {f->draw->culling, 0, 0};
    return is_empty(&pass)
               ? HG_OK
               : hg_visibility_collect(&pass, &scene, hg_graph_run_image(run, f->depth), err);
}

static enum hg_status sort(const struct hg_graph_run *run, void *user, struct hg_error *err)
{
    struct hg_batch *f = hg_batch_of(run);
    struct hg_pass pass = strip_of(f, user);
    return is_empty(&pass) ? HG_OK
                           : hg_blend_sort(&pass, &f->draw->blend->lists,
                                 hg_graph_run_image(run, f->blend.depth), f->slot, err);
}

static enum hg_status shade_lists(const struct hg_graph_run *run, void *user, struct hg_error *err)
{
    struct hg_batch *f = hg_batch_of(run);
    struct hg_pass pass = strip_of(f, user);
    const struct hg_shade shade = {.depth = hg_graph_run_image(run, f->blend.depth),
        .target = hg_graph_run_image(run, f->blend.color),
        .layer = true,
        .lists = true,
        .behind = f->behind > 0 ? hg_graph_run_image(run, f->behind) : NULL,
        .glass = f->blend.glass > 0 ? hg_graph_run_image(run, f->blend.glass) : NULL,
        .glass_rays = f->blend.rays > 0 ? hg_graph_run_image(run, f->blend.rays) : NULL};
    return is_empty(&pass) ? HG_OK : hg_shade_record(&pass, &shade, err);
}

static void declare_strip(struct hg_batch *f, uintptr_t i)
{
    hg_batch_add(f, &(struct hg_graph_pass){.name = "blend clear",
                        .record = clear_lists,
                        .user = (void *)i,
                        .accesses = {{f->blend.lists, HG_GRAPH_READ_WRITE, 0}}});
    hg_batch_add(f,
        &(struct hg_graph_pass){.name = "blend visibility",
            .record = collect,
            .user = (void *)i,
            .accesses = {{f->depth, HG_GRAPH_DEPTH_TEST, 0}, {f->cache, HG_GRAPH_READ, 0},
                {f->progress, HG_GRAPH_READ_WRITE, 0}, {f->blend.lists, HG_GRAPH_READ_WRITE, 0}}});
    hg_batch_add(f, &(struct hg_graph_pass){.name = "blend sort",
                        .record = sort,
                        .user = (void *)i,
                        .accesses = {{f->blend.lists, HG_GRAPH_READ_WRITE, 0},
                            {f->blend.depth, i == 0 ? HG_GRAPH_DEPTH : HG_GRAPH_DEPTH_KEEP, 0}}});
    hg_batch_add(f, &(struct hg_graph_pass){.name = "blend shading",
                        .record = shade_lists,
                        .user = (void *)i,
                        .accesses = {{f->blend.lists, HG_GRAPH_READ_WRITE, 0},
                            {f->blend.depth, HG_GRAPH_DEPTH_TEST, 0},
                            {f->behind, HG_GRAPH_SAMPLE, 0}, {f->blend.glass, HG_GRAPH_SAMPLE, 0},
                            {f->blend.rays, HG_GRAPH_SAMPLE, 0}, {f->atlas, HG_GRAPH_SAMPLE, 0},
                            {f->cache, HG_GRAPH_READ, 0}, {f->progress, HG_GRAPH_READ_WRITE, 0},
                            {f->blend.color, i == 0 ? HG_GRAPH_COLOR : HG_GRAPH_COLOR_KEEP, 0}}});
}

static void declare_hiding(struct hg_batch *f, bool stochastic)
{
    hg_batch_add(
        f, &(struct hg_graph_pass){.name = "blend opaque",
               .record = record_hiding,
               .user = stochastic ? f : NULL,
               .accesses = {{f->cache, HG_GRAPH_READ, 0}, {f->progress, HG_GRAPH_READ_WRITE, 0},
                   {f->visibility, HG_GRAPH_COLOR_KEEP, 0}, {f->depth, HG_GRAPH_DEPTH_KEEP, 0}}});
}

static void declare_lists(struct hg_batch *f)
{
    const uint32_t strips = f->pass.find ? 1 : f->draw->blend->strips;
    f->draw->blend->listed = true;
    f->blend.lists = hg_graph_buffer(f->graph, "blend lists");
    // What glass shows of the scene behind it has no blended surfaces.
    if (!hg_frame_transmits(f->draw))
        declare_hiding(f, false);
    for (uint32_t i = 0; i < strips; i++)
        declare_strip(f, i);
}

// Pictures in motion, which are discarded when the view rests, are not to cost more than twice the
// opaque scene: where lists took many fragments, stochastic transparency takes their place.
static bool is_bounded(struct hg_batch *f)
{
    struct hg_draw_blend *b = f->draw->blend;
    if (!hg_draw_is(f->draw, HG_DRAW_DIRECT) || hg_frame_transmits(f->draw) || !b->many ||
        f->draw->context->overrides.blend_lists)
        return false;
    b->unseen = b->unseen < LISTS_EVERY ? b->unseen + 1 : 0;
    return b->unseen > 0;
}

void hg_batch_declare_blend(struct hg_batch *f)
{
    if (hg_draw_has_holes(f->draw) && is_bounded(f)) {
        declare_hiding(f, true);
        return;
    }
    if (f->draw->glass != NULL && f->draw->request->smaller == 0)
        f->blend.glass = hg_graph_import(f->graph, "light by way of glass", f->draw->glass);
    if (!hg_draw_has_holes(f->draw))
        f->blend.visibility = hg_batch_image(f, "layer visibility", HG_VISIBILITY_FORMAT);
    f->blend.color = hg_batch_image(f, "layer colour", HG_COLOR_FORMAT);
    f->blend.depth = hg_batch_image(f, "layer depth", HG_DEPTH_FORMAT);
    if (hg_draw_has_holes(f->draw))
        declare_lists(f);
    else
        declare_nearest(f);
}

// --- memory --------------------------------------------------------------------------------------

#define NODE_BYTES  sizeof(struct hg_gpu_blend_node)
#define MOST_NODES  (UINT32_C(8) << 20) // of one strip: 128 MiB
#define LEAST_NODES UINT32_C(65536)
#define MOST_STRIPS 32

enum hg_status hg_batch_reserve_blend(struct hg_draw *draw, struct hg_error *err)
{
    struct hg_gpu *gpu = draw->context->gpu;
    struct hg_draw_blend *b = draw->blend;
    const struct hg_debug_overrides *over = &draw->context->overrides;
    const VkExtent2D size = hg_draw_size(draw->request);
    const uint64_t pixels = (uint64_t)size.width * size.height;
    b->listed = false;
    if (!hg_draw_has_holes(draw))
        return HG_OK;
    b->most_nodes = over->blend_most_nodes > 0 ? over->blend_most_nodes : MOST_NODES;
    b->strips = b->strips > 0 ? b->strips : 1;
    if (b->nodes == 0) { // two surfaces behind each other
        const uint64_t two = 2 * pixels > LEAST_NODES ? 2 * pixels : LEAST_NODES,
                       first = over->blend_first_nodes > 0 ? over->blend_first_nodes : two;
        b->nodes = first < b->most_nodes ? (uint32_t)first : b->most_nodes;
    }
    enum hg_status status = hg_gpu_buffer_reserve(
        gpu, HG_GPU_BUFFER_DEVICE, pixels * 4, "blend heads", &b->lists.heads, err);
    if (status == HG_OK)
        status = hg_gpu_buffer_reserve(
            gpu, HG_GPU_BUFFER_DEVICE, b->nodes * NODE_BYTES, "blend nodes", &b->lists.nodes, err);
    return status;
}

// Makes room for so many nodes of the whole area. False where it cannot.
static bool grow(struct hg_draw_blend *b, uint64_t nodes)
{
    nodes += nodes / 4; // other samples have others
    if (nodes <= b->most_nodes) {
        b->nodes = (uint32_t)nodes;
        return true;
    }
    b->nodes = b->most_nodes;
    if (b->strips == MOST_STRIPS)
        return false;
    while (b->strips < MOST_STRIPS && (uint64_t)b->strips * b->most_nodes < nodes)
        b->strips *= 2;
    return true;
}

void hg_frame_note_blend(struct hg_draw *draw, uint32_t samples)
{
    const struct hg_gpu_blend_report *reports = draw->blend->lists.reports.mapped;
    struct hg_draw_blend *b = draw->blend;
    const uint64_t room = b->lists.nodes.size_bytes / NODE_BYTES;
    const uint32_t smaller = draw->request->smaller;
    uint64_t nodes = 0, fragments = 0;
    bool too_deep = false;
    for (uint32_t i = 0; i < samples; i++) {
        nodes = reports[i].nodes > nodes ? reports[i].nodes : nodes;
        fragments = reports[i].fragments > fragments ? reports[i].fragments : fragments;
        too_deep |= reports[i].too_deep != 0;
    }
    if (smaller > 0) { // of a part of the pixels that are drawn next
        if (nodes * smaller * smaller >= room)
            (void)grow(b, nodes * smaller * smaller);
        return;
    }
    const VkExtent2D size = hg_frame_size(draw);
    if (b->listed && hg_draw_area(draw) == NULL) // more than one for each pixel
        b->many =
            fragments * HG_BLEND_COUNTED * HG_BLEND_COUNTED > (uint64_t)size.width * size.height;
    const bool full = nodes > 0 && nodes >= room;
    const bool grows = full && grow(b, nodes * b->strips);
    hg_tiled_accumulation_note(draw->accumulation, HG_SHORT_OF_LAYERS, grows);
    too_deep |= full && !grows;
    if (too_deep && !b->too_deep)
        hg_warn(FRAME, "%u layers of blended surfaces or more: what lies deeper is not seen",
            (unsigned)HG_BLEND_MAX_LAYERS);
    b->too_deep = too_deep;
}
