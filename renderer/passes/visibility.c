#include "renderer/passes/visibility.h"

#include "shaders/shared/features.h"

static const struct hg_gpu_io alpha_mask_io = HG_GPU_IO(HG_ALPHA_MASK_IO);
struct alpha_mask_inputs {
    HG_ALPHA_MASK_IO(HG_GPU_IO_MEMBER)
};
static const struct alpha_mask_inputs nothing; // masks read no image of the frame

// How surfaces are drawn. Values are also the specialisation constant of visibility_alpha.frag.
enum variant { SOLID, MASK, NEAREST, HIDING, COLLECT, STOCHASTIC, OVERDRAW, CUTS };

static const VkPrimitiveTopology topologies[3] = {VK_PRIMITIVE_TOPOLOGY_TRIANGLE_LIST,
    VK_PRIMITIVE_TOPOLOGY_LINE_LIST, VK_PRIMITIVE_TOPOLOGY_POINT_LIST};

static VkPrimitiveTopology topology_of(uint32_t flags)
{
    return topologies[(flags & HG_DRAW_LINES) != 0 ? 1 : (flags & HG_DRAW_POINTS) != 0 ? 2 : 0];
}

// Values of constant 3, shaders/lib/item.glsl.
#define MAPPED   1u
#define LATE     2u
#define NUMBERED 4u
#define CLIPPED  8u

struct style {
    bool listed; // numbered: vertices that are made for this frame
    enum variant variant;
    VkPrimitiveTopology topology;
    uint32_t item; // MAPPED, LATE, NUMBERED, CLIPPED
};

static struct hg_gpu_pipeline_params pipeline_of(
    const struct style *style, uint32_t tables, uint32_t features)
{
    const bool numbered = (style->item & NUMBERED) != 0;
    const char *vertex = style->listed ? "visibility_index_list.vert"
                         : numbered    ? "visibility_provoking.vert"
                                       : "visibility.vert";
    if (style->variant == OVERDRAW) {
        return (struct hg_gpu_pipeline_params){
            .vertex = vertex,
            .positions = numbered,
            .with_words = style->listed,
            .fragment = "overdraw.frag",
            .spec = {0, tables, features},
            .spec_count = 3,
            .colors = {VK_FORMAT_R32G32B32A32_SFLOAT},
            .color_count = 1,
            .topology = style->topology,
            .blend = HG_GPU_BLEND_ADD,
        };
    }
    if (style->variant == CUTS)
        return (struct hg_gpu_pipeline_params){.vertex = vertex,
            .positions = numbered,
            .with_words = style->listed,
            .fragment = "cut_collect.frag",
            .spec = {0, tables, features, style->item},
            .spec_count = 4,
            .topology = style->topology};
    static const char *const fragments[3][2] = {{"visibility.frag", "visibility_provoking.frag"},
        {"visibility_alpha.frag", "visibility_alpha_provoking.frag"},
        {"blend_collect.frag", "blend_collect_provoking.frag"}};
    const bool textured = style->variant != SOLID, late = (style->item & LATE) != 0;
    const bool collects = style->variant == COLLECT;
    return (struct hg_gpu_pipeline_params){
        .vertex = vertex,
        .positions = numbered,
        .with_words = style->listed,
        .fragment = fragments[collects ? 2 : textured][numbered],
        .spec = {textured ? (uint32_t)style->variant : 0, tables, features, style->item},
        .spec_count = 4,
        .colors = {collects ? VK_FORMAT_UNDEFINED : HG_VISIBILITY_FORMAT},
        .color_count = collects ? 0 : 1,
        .depth = HG_DEPTH_FORMAT,
        .depth_compare = late ? VK_COMPARE_OP_GREATER_OR_EQUAL : VK_COMPARE_OP_GREATER,
        .depth_write = !collects,
        .topology = style->topology,
        .io = textured && !collects ? &alpha_mask_io : NULL,
    };
}

static void set_culling(VkCommandBuffer cmd, uint32_t flags)
{
    const bool both = (flags & (HG_DRAW_DOUBLE_SIDED | HG_DRAW_LINES | HG_DRAW_POINTS)) != 0;
    vkCmdSetCullMode(cmd, both ? VK_CULL_MODE_NONE : VK_CULL_MODE_BACK_BIT);
    vkCmdSetFrontFace(cmd, (flags & HG_DRAW_MIRRORED) != 0 ? VK_FRONT_FACE_CLOCKWISE
                                                           : VK_FRONT_FACE_COUNTER_CLOCKWISE);
}

// How items are drawn: `solid` and `mask` surfaces. late: second phase, of an image `width` wide.
struct manner {
    enum variant solid, mask;
    uint32_t width;
    bool late;
    const struct hg_visibility_cuts *cuts; // with CUTS
};

static void push_item(struct hg_pass *pass, const struct hg_culling *visible,
    const struct hg_culling_item *item, const struct manner *manner)
{
    struct hg_gpu_item push;
    hg_culling_fill(visible, item, &push);
    push.width = manner->width;
    if (manner->cuts != NULL) {
        push.depth = manner->cuts->list;
        push.reserved = manner->cuts->capacity;
    }
    hg_gpu_cmd_push(pass->cmd, &push, sizeof push);
}

static enum hg_status draw_items(struct hg_pass *pass, const struct hg_culling *visible,
    uint32_t first, uint32_t end, const struct manner *manner, struct hg_error *err)
{
    const VkCommandBuffer cmd = hg_gpu_cmd_handle(pass->cmd);
    VkPipeline bound = VK_NULL_HANDLE;
    for (uint32_t i = first; i < end; i++) {
        const struct hg_culling_item *item = hg_culling_item(visible, i);
        if (item->index_count == 0)
            continue;
        const struct style style = {.listed = item->listed,
            .variant = (item->flags & HG_DRAW_MASK) != 0 ? manner->mask : manner->solid,
            .topology = topology_of(item->flags),
            .item = (item->first_primitive != HG_CLUSTER_NONE ? MAPPED : 0) |
                    (manner->late ? LATE : 0) | (item->numbered ? NUMBERED : 0) |
                    (pass->clips ? CLIPPED : 0)};
        const struct hg_gpu_pipeline_params params =
            pipeline_of(&style, pass->tables, pass->features);
        VkPipeline pipeline;
        enum hg_status status = hg_gpu_pipeline_get(pass->gpu, &params, &pipeline, err);
        if (status != HG_OK)
            return status;
        if (pipeline != bound)
            vkCmdBindPipeline(cmd, VK_PIPELINE_BIND_POINT_GRAPHICS, pipeline);
        set_culling(cmd, item->flags);
        if (manner->cuts != NULL)
            vkCmdSetCullMode(cmd, VK_CULL_MODE_NONE);
        // Numbered ones read what is the same for all.
        if (pipeline != bound || !item->numbered)
            push_item(pass, visible, item, manner);
        bound = pipeline;
        hg_culling_draw(visible, pass->cmd, item);
    }
    return HG_OK;
}

static void begin(
    struct hg_pass *pass, const struct hg_visibility_target *target, VkRect2D area, bool clear)
{
    const struct hg_gpu_rendering rendering = {
        .colors = {{.image = target->visibility, .clear = clear}},
        .color_count = 1,
        .depth = {.image = target->depth, .clear = clear}, // 0 = infinitely far
        .area = area,
    };
    hg_gpu_cmd_begin_rendering(pass->cmd, &rendering);
    hg_pass_view_whole(pass, target->visibility);
}

enum hg_status hg_visibility_test(struct hg_pass *pass, const struct hg_visibility_scene *scene,
    const struct hg_visibility_target *target, struct hg_error *err)
{
    const struct hg_culling_test test = {.set = scene->set,
        .depth = target->depth,
        .visibility = target->visibility,
        .tables = pass->tables,
        .features = pass->features};
    return hg_culling_test(scene->visible, pass->cmd, &test, err);
}

enum hg_status hg_visibility_record_late(struct hg_pass *pass,
    const struct hg_visibility_scene *scene, const struct hg_visibility_target *target,
    struct hg_error *err)
{
    const struct hg_culling_set *set = hg_culling_set(scene->visible, scene->set);
    const struct manner manner = {
        .solid = SOLID, .mask = MASK, .width = target->visibility->width, .late = true};
    begin(pass, target, pass->area, false);
    const enum hg_status status = draw_items(
        pass, scene->visible, set->first_late, set->first_late + set->late_count, &manner, err);
    hg_gpu_cmd_end_rendering(pass->cmd);
    return status;
}

enum hg_status hg_visibility_record(struct hg_pass *pass, const struct hg_visibility_scene *scene,
    const struct hg_visibility_target *target, struct hg_error *err)
{
    const struct hg_culling_set *set = hg_culling_set(scene->visible, scene->set);
    const struct manner manner = {.solid = SOLID, .mask = MASK};
    const uint32_t first = set->class_first[HG_DRAW_CLASS_OPAQUE];
    const uint32_t end = set->class_first[HG_DRAW_CLASS_BLEND];
    enum hg_status status = hg_pass_bind(pass, &alpha_mask_io, &nothing, sizeof nothing, err);
    if (status != HG_OK)
        return status;
    if (set->hosted)
        hg_culling_copy_cpu(
            scene->visible, pass->cmd, scene->slot, target->visibility, target->depth, pass->area);
    if (!set->hosted || end > first) {
        begin(pass, target, pass->area, !set->hosted);
        status = draw_items(pass, scene->visible, first, end, &manner, err);
        hg_gpu_cmd_end_rendering(pass->cmd);
    }
    return status;
}

// Draws that blend.
static enum hg_status draw_blended(struct hg_pass *pass, const struct hg_visibility_scene *scene,
    enum variant variant, struct hg_error *err)
{
    const struct hg_culling_set *set = hg_culling_set(scene->visible, scene->set);
    const struct manner manner = {.solid = variant, .mask = variant};
    return draw_items(pass, scene->visible, set->class_first[HG_DRAW_CLASS_BLEND],
        set->class_first[HG_DRAW_CLASS_BLEND + 1], &manner, err);
}

enum hg_status hg_visibility_record_nearest(struct hg_pass *pass,
    const struct hg_visibility_scene *scene, const struct hg_visibility_target *target,
    struct hg_gpu_image *opaque_depth, struct hg_error *err)
{
    const struct alpha_mask_inputs inputs = {.opaque_depth = {.image = opaque_depth}};
    enum hg_status status = hg_pass_bind(pass, &alpha_mask_io, &inputs, sizeof inputs, err);
    if (status != HG_OK)
        return status;
    begin(pass, target, pass->area, true);
    status = draw_blended(pass, scene, NEAREST, err);
    hg_gpu_cmd_end_rendering(pass->cmd);
    return status;
}

enum hg_status hg_visibility_record_hiding(struct hg_pass *pass,
    const struct hg_visibility_scene *scene, const struct hg_visibility_target *target,
    bool stochastic, struct hg_error *err)
{
    enum hg_status status = hg_pass_bind(pass, &alpha_mask_io, &nothing, sizeof nothing, err);
    if (status != HG_OK)
        return status;
    begin(pass, target, pass->area, false);
    status = draw_blended(pass, scene, stochastic ? STOCHASTIC : HIDING, err);
    hg_gpu_cmd_end_rendering(pass->cmd);
    return status;
}

enum hg_status hg_visibility_collect(struct hg_pass *pass, const struct hg_visibility_scene *scene,
    struct hg_gpu_image *depth, struct hg_error *err)
{
    enum hg_status status = hg_gpu_cmd_bind(pass->cmd, &pass->bindings, err);
    if (status != HG_OK)
        return status;
    const struct hg_gpu_rendering rendering = {.depth = {.image = depth}, .area = pass->area};
    hg_gpu_cmd_begin_rendering(pass->cmd, &rendering);
    hg_pass_view_whole(pass, depth);
    status = draw_blended(pass, scene, COLLECT, err);
    hg_gpu_cmd_end_rendering(pass->cmd);
    return status;
}

enum hg_status hg_visibility_record_pick(struct hg_pass *pass,
    const struct hg_visibility_scene *scene, const struct hg_visibility_target *target,
    VkRect2D area, struct hg_error *err)
{
    const struct hg_culling_set *set = hg_culling_set(scene->visible, scene->set);
    const struct manner manner = {.solid = SOLID, .mask = MASK};
    enum hg_status status = hg_pass_bind(pass, &alpha_mask_io, &nothing, sizeof nothing, err);
    if (status != HG_OK)
        return status;
    struct hg_pass part = *pass;
    part.area = area;
    begin(&part, target, area, true);
    status = draw_items(
        pass, scene->visible, set->first_item, set->first_item + set->item_count, &manner, err);
    if (status == HG_OK) // as far as the frame saw them
        status = draw_items(
            pass, scene->visible, set->first_late, set->first_late + set->late_count, &manner, err);
    hg_gpu_cmd_end_rendering(pass->cmd);
    return status;
}

enum hg_status hg_visibility_record_overdraw(struct hg_pass *pass,
    const struct hg_visibility_scene *scene, struct hg_gpu_image *counts, struct hg_error *err)
{
    const struct hg_culling_set *set = hg_culling_set(scene->visible, scene->set);
    const struct manner manner = {.solid = OVERDRAW, .mask = OVERDRAW};
    enum hg_status status = hg_gpu_cmd_bind(pass->cmd, &pass->bindings, err);
    if (status != HG_OK)
        return status;
    const struct hg_gpu_rendering rendering = {
        .colors = {{.image = counts, .clear = true}}, .color_count = 1};
    hg_gpu_cmd_begin_rendering(pass->cmd, &rendering);
    status = draw_items(
        pass, scene->visible, set->first_item, set->first_item + set->item_count, &manner, err);
    hg_gpu_cmd_end_rendering(pass->cmd);
    return status;
}

enum hg_status hg_visibility_collect_cuts(struct hg_pass *pass,
    const struct hg_visibility_scene *scene, const struct hg_visibility_cuts *cuts,
    struct hg_error *err)
{
    const struct hg_culling_set *set = hg_culling_set(scene->visible, scene->set);
    const struct manner manner = {.solid = CUTS, .mask = CUTS, .cuts = cuts};
    struct hg_pass whole = *pass;
    whole.clips = false;
    enum hg_status status = hg_gpu_cmd_bind(pass->cmd, &pass->bindings, err);
    if (status != HG_OK)
        return status;
    const struct hg_gpu_rendering rendering = {.area = cuts->area};
    const VkViewport view = {
        0.0f, 0.0f, (float)cuts->size.width, (float)cuts->size.height, 0.0f, 1.0f};
    hg_gpu_cmd_begin_rendering(pass->cmd, &rendering);
    vkCmdSetViewport(hg_gpu_cmd_handle(pass->cmd), 0, 1, &view);
    status = draw_items(&whole, scene->visible, set->class_first[HG_DRAW_CLASS_OPAQUE],
        set->class_first[HG_DRAW_CLASS_BLEND], &manner, err);
    hg_gpu_cmd_end_rendering(pass->cmd);
    return status;
}

enum hg_status hg_visibility_warm_up(
    struct hg_gpu *gpu, uint32_t index, uint32_t *count, struct hg_error *err)
{
    static const struct style with_numbers[] = {
        {false, SOLID, VK_PRIMITIVE_TOPOLOGY_TRIANGLE_LIST, NUMBERED},
        {false, SOLID, VK_PRIMITIVE_TOPOLOGY_TRIANGLE_LIST, NUMBERED | LATE},
        {false, MASK, VK_PRIMITIVE_TOPOLOGY_TRIANGLE_LIST, NUMBERED},
        {false, MASK, VK_PRIMITIVE_TOPOLOGY_TRIANGLE_LIST, NUMBERED | LATE},
        {true, SOLID, VK_PRIMITIVE_TOPOLOGY_TRIANGLE_LIST, NUMBERED},
        {true, SOLID, VK_PRIMITIVE_TOPOLOGY_TRIANGLE_LIST, NUMBERED | LATE},
        {true, MASK, VK_PRIMITIVE_TOPOLOGY_TRIANGLE_LIST, NUMBERED},
        {false, HIDING, VK_PRIMITIVE_TOPOLOGY_TRIANGLE_LIST, NUMBERED},
        {false, COLLECT, VK_PRIMITIVE_TOPOLOGY_TRIANGLE_LIST, NUMBERED},
        {false, STOCHASTIC, VK_PRIMITIVE_TOPOLOGY_TRIANGLE_LIST, NUMBERED},
    };
    static const struct style without[] = {
        {false, SOLID, VK_PRIMITIVE_TOPOLOGY_TRIANGLE_LIST, 0},
        {false, SOLID, VK_PRIMITIVE_TOPOLOGY_TRIANGLE_LIST, MAPPED},
        {false, SOLID, VK_PRIMITIVE_TOPOLOGY_TRIANGLE_LIST, MAPPED | LATE},
        {false, MASK, VK_PRIMITIVE_TOPOLOGY_TRIANGLE_LIST, 0},
        {false, MASK, VK_PRIMITIVE_TOPOLOGY_TRIANGLE_LIST, MAPPED},
        {false, MASK, VK_PRIMITIVE_TOPOLOGY_TRIANGLE_LIST, MAPPED | LATE},
        {false, HIDING, VK_PRIMITIVE_TOPOLOGY_TRIANGLE_LIST, 0},
        {false, COLLECT, VK_PRIMITIVE_TOPOLOGY_TRIANGLE_LIST, 0},
        {false, STOCHASTIC, VK_PRIMITIVE_TOPOLOGY_TRIANGLE_LIST, 0},
    };
    const bool numbered = hg_gpu_strategy(gpu)->provoking_vertices;
    const struct style *styles = numbered ? with_numbers : without;
    *count = (uint32_t)(numbered ? sizeof with_numbers / sizeof with_numbers[0]
                                 : sizeof without / sizeof without[0]);
    const struct hg_gpu_pipeline_params params =
        pipeline_of(&styles[index % *count], 0, HG_FEATURE_ALL);
    VkPipeline pipeline;
    return hg_gpu_pipeline_get(gpu, &params, &pipeline, err);
}
