#include "renderer/math/frustum.h"
#include "renderer/passes/shadow.h"

#include <string.h>

#include "shaders/shared/features.h"

static VkPrimitiveTopology topology_of(uint32_t flags)
{
    return (flags & HG_DRAW_LINES) != 0    ? VK_PRIMITIVE_TOPOLOGY_LINE_LIST
           : (flags & HG_DRAW_POINTS) != 0 ? VK_PRIMITIVE_TOPOLOGY_POINT_LIST
                                           : VK_PRIMITIVE_TOPOLOGY_TRIANGLE_LIST;
}

static struct hg_gpu_pipeline_params pipeline_of(
    bool holes, bool find, VkPrimitiveTopology topology, uint32_t tables, uint32_t features)
{
    return (struct hg_gpu_pipeline_params){
        .vertex = holes ? "shadow_mask.vert" : "shadow.vert",
        .fragment = holes ? "shadow_mask.frag" : NULL,
        .spec = {0, tables, features},
        .spec_count = 3,
        .depth = VK_FORMAT_D32_SFLOAT,
        .depth_compare = VK_COMPARE_OP_GREATER,
        .depth_write = !find,
        .topology = topology,
    };
}

// As hg_shadow_push of shaders/lib/shadow.glsl.
struct push {
    float view_proj[16];
    VkDeviceAddress positions, vertices, extra;
    float corner_px[2];
};

static enum hg_status draw_set(struct hg_pass *pass, const struct hg_culling *visible,
    uint32_t set_index, const struct hg_shadow_map *map, struct hg_error *err)
{
    const VkCommandBuffer cmd = hg_gpu_cmd_handle(pass->cmd);
    const struct hg_culling_set *set = hg_culling_set(visible, set_index);
    VkPipeline bound = VK_NULL_HANDLE;
    for (uint32_t i = 0; i < set->item_count; i++) {
        const struct hg_culling_item *item = hg_culling_item(visible, set->first_item + i);
        const bool holes = (item->flags & (HG_DRAW_MASK | HG_DRAW_BLEND)) != 0;
        const struct hg_gpu_pipeline_params params =
            pipeline_of(holes, pass->find, topology_of(item->flags), pass->tables, pass->features);
        if (pass->find && !holes)
            continue;
        VkPipeline pipeline;
        enum hg_status status = hg_gpu_pipeline_get(pass->gpu, &params, &pipeline, err);
        if (status != HG_OK)
            return status;
        if (pipeline != bound)
            vkCmdBindPipeline(cmd, VK_PIPELINE_BIND_POINT_GRAPHICS, pipeline);
        bound = pipeline;
        struct push push = {.positions = item->positions,
            .vertices = item->vertices,
            .extra = item->extra,
            .corner_px = {map->gpu.rect_px.x, map->gpu.rect_px.y}};
        memcpy(push.view_proj, map->view_proj, sizeof push.view_proj);
        hg_gpu_cmd_push(pass->cmd, &push, sizeof push);
        hg_culling_draw(visible, pass->cmd, item);
    }
    return HG_OK;
}

static int32_t inside(int64_t value, int64_t least, int64_t most)
{
    return (int32_t)(value < least ? least : value > most ? most : value);
}

// Intersection of a rectangle with the area of a pass, which may be empty for all of it.
static VkRect2D cut(VkRect2D r, VkRect2D area)
{
    if (area.extent.width == 0)
        return r;
    const int64_t right = (int64_t)area.offset.x + area.extent.width;
    const int64_t bottom = (int64_t)area.offset.y + area.extent.height;
    const int32_t x = inside(area.offset.x, r.offset.x, (int64_t)r.offset.x + r.extent.width);
    const int32_t y = inside(area.offset.y, r.offset.y, (int64_t)r.offset.y + r.extent.height);
    const int32_t x1 = inside(right, x, (int64_t)r.offset.x + r.extent.width);
    const int32_t y1 = inside(bottom, y, (int64_t)r.offset.y + r.extent.height);
    return (VkRect2D){{x, y}, {(uint32_t)(x1 - x), (uint32_t)(y1 - y)}};
}

// The part of a map that is drawn: where casters moved, and in the area of the pass.
static VkRect2D due_part(const struct hg_shadow_map *map, VkRect2D whole, VkRect2D area)
{
    if (map->partly) {
        const struct hg_shadow_rect *d = &map->dirty;
        whole = cut(
            whole, (VkRect2D){{(int32_t)d->x0, (int32_t)d->y0}, {d->x1 - d->x0, d->y1 - d->y0}});
    }
    return cut(whole, area);
}

static VkRect2D rect_of(const struct hg_gpu_shadow *s)
{
    const uint32_t side = (uint32_t)s->size_px;
    return (VkRect2D){{(int32_t)s->rect_px.x, (int32_t)s->rect_px.y}, {side, side}};
}

static enum hg_status draw_map(struct hg_pass *pass, const struct hg_shadow_map *map,
    struct hg_gpu_image *atlas, const struct hg_culling *visible, uint32_t set,
    struct hg_error *err)
{
    const VkRect2D whole = rect_of(&map->gpu);
    const uint32_t side = whole.extent.width;
    const struct hg_gpu_rendering rendering = {
        .depth = {.image = atlas, .clear = !pass->adds}, .area = due_part(map, whole, pass->area)};
    if (rendering.area.extent.width == 0 || rendering.area.extent.height == 0)
        return HG_OK;
    const VkViewport viewport = {
        (float)whole.offset.x, (float)whole.offset.y, (float)side, (float)side, 0.0f, 1.0f};
    hg_gpu_cmd_begin_rendering(pass->cmd, &rendering);
    vkCmdSetViewport(hg_gpu_cmd_handle(pass->cmd), 0, 1, &viewport);
    const enum hg_status status = draw_set(pass, visible, set, map, err);
    hg_gpu_cmd_end_rendering(pass->cmd);
    return status;
}

static bool is_due(const struct hg_shadow_map *map, bool coarse)
{
    return map->stale && !map->deferred && !(coarse && map->refines);
}

// Frustum planes of a map inside `part` of its rectangle, enlarged by a pixel on each side.
static uint32_t planes_of(
    const float view_proj[16], VkRect2D whole, VkRect2D part, float planes[6][4])
{
    float m[16];
    const float side = (float)whole.extent.width;
    const float size[2] = {
        ((float)part.extent.width + 2.0f) / side, ((float)part.extent.height + 2.0f) / side};
    const float low[2] = {((float)(part.offset.x - whole.offset.x) - 1.0f) / side,
        ((float)(part.offset.y - whole.offset.y) - 1.0f) / side};
    if (part.extent.width == 0 || part.extent.height == 0) {
        memcpy(planes[0], (float[4]){0.0f, 0.0f, 0.0f, -1.0f}, sizeof planes[0]);
        return 1; // everything is outside
    }
    memcpy(m, view_proj, sizeof m);
    for (int r = 0; r < 2; r++) // clip space of the part
        for (int c = 0; c < 4; c++)
            m[c * 4 + r] =
                (m[c * 4 + r] - (2.0f * low[r] + size[r] - 1.0f) * m[c * 4 + 3]) / size[r];
    return hg_frustum_planes(m, planes);
}

enum hg_status hg_shadow_select(const struct hg_geometry *geometry, struct hg_lighting *lighting,
    const struct hg_shadow_choice *choice, struct hg_jobs *jobs, struct hg_culling *visible,
    struct hg_error *err)
{
    uint32_t count;
    const struct hg_shadow_map *maps = hg_lighting_shadow_maps(lighting, &count);
    enum hg_status status = HG_OK;
    for (uint32_t i = 0; i < count && !status; i++) {
        if (!is_due(&maps[i], choice->coarse))
            continue;
        const struct hg_gpu_shadow *s = &maps[i].gpu;
        struct hg_culling_view view = {.both_sides = true,
            .eye = {s->origin_ws.x, s->origin_ws.y, s->origin_ws.z},
            .px_scale = 1.0f / s->texel_size,
            .orthographic = s->perspective == 0,
            .error_px = 1.0f,
            .near = 1e-3f,
            .wait = choice->wait,
            .whole = choice->whole,
            .share = choice->share,
            .shares = choice->shares};
        const VkRect2D whole = rect_of(s);
        view.plane_count = choice->area.extent.width == 0 && !maps[i].partly
                               ? hg_frustum_planes(maps[i].view_proj, view.planes)
                               : planes_of(maps[i].view_proj, whole,
                                     due_part(&maps[i], whole, choice->area), view.planes);
        status = hg_culling_add(visible, geometry, &view, jobs, err);
    }
    return status;
}

enum hg_status hg_shadow_record(struct hg_pass *pass, struct hg_lighting *lighting, bool coarse,
    const struct hg_culling *visible, uint32_t first_set, struct hg_error *err)
{
    if (first_set == hg_culling_count(visible))
        return HG_OK; // none is due
    uint32_t count;
    struct hg_shadow_map *maps = hg_lighting_shadow_maps(lighting, &count);
    // The atlas is what is drawn to: it must not be bound as an input.
    struct hg_gpu_bindings bindings = pass->bindings;
    bindings.images[HG_BIND_SHADOW] = NULL;
    enum hg_status status = hg_gpu_cmd_bind(pass->cmd, &bindings, err);
    if (status)
        return status;
    for (uint32_t i = 0; i < count && !status; i++) {
        if (!is_due(&maps[i], coarse))
            continue;
        status =
            draw_map(pass, &maps[i], hg_lighting_image_shadow(lighting), visible, first_set, err);
        const struct hg_culling_set *set = hg_culling_set(visible, first_set);
        maps[i].touched = true;
        maps[i].stale = pass->find || status != HG_OK || set->missing > 0 || set->crowded;
        first_set++;
    }
    hg_lighting_note_drawn(lighting);
    return status;
}

enum hg_status hg_shadow_warm_up(
    struct hg_gpu *gpu, uint32_t index, uint32_t *count, struct hg_error *err)
{
    *count = 2;
    const struct hg_gpu_pipeline_params params =
        pipeline_of(index % 2 == 1, false, VK_PRIMITIVE_TOPOLOGY_TRIANGLE_LIST, 0, HG_FEATURE_ALL);
    VkPipeline pipeline;
    return hg_gpu_pipeline_get(gpu, &params, &pipeline, err);
}
