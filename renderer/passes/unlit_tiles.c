#include "renderer/passes/unlit_tiles.h"

#include "shaders/shared/unlit_tiles.h"

static const struct hg_gpu_io depth_io = HG_GPU_IO(HG_DEPTH_IO);
struct depth_inputs {
    HG_DEPTH_IO(HG_GPU_IO_MEMBER)
};

static uint32_t cells_along(uint32_t px)
{
    return (px + HG_UNLIT_TILES_CELL_PX - 1) / HG_UNLIT_TILES_CELL_PX;
}

void hg_unlit_tiles_finish(struct hg_gpu *gpu, struct hg_unlit_tiles *tiles)
{
    hg_gpu_buffer_destroy(gpu, &tiles->head);
    hg_gpu_buffer_destroy(gpu, &tiles->cells);
    hg_gpu_buffer_destroy(gpu, &tiles->levels);
    tiles->seen = 0;
}

// Words of the flags of all cells, followed by runs of cells. At most every second cell starts a
// run.
static uint64_t cell_words(const struct hg_gpu_image *depth)
{
    const uint64_t words = (uint64_t)cells_along(depth->width) * cells_along(depth->height);
    return (words + 1) / 2 * 2;
}

static enum hg_status reserve(struct hg_unlit_tiles *tiles, struct hg_gpu *gpu,
    const struct hg_gpu_image *depth, uint32_t atlas_px, struct hg_error *err)
{
    const uint64_t words = cell_words(depth), rows = cells_along(depth->height);
    const uint64_t runs = (words + rows) / 2 + 1, side = atlas_px / HG_UNLIT_TILES_TEXELS;
    enum hg_status status = HG_OK;
    if (tiles->head.handle == VK_NULL_HANDLE)
        status = hg_gpu_buffer_create(gpu, HG_GPU_BUFFER_READBACK, sizeof(struct hg_gpu_unlit_head),
            "unlit head", &tiles->head, err);
    if (status == HG_OK)
        status = hg_gpu_buffer_reserve(
            gpu, HG_GPU_BUFFER_DEVICE, 4 * words + 8 * runs, "unlit tiles", &tiles->cells, err);
    const uint64_t before = tiles->levels.size_bytes;
    if (status == HG_OK) // 1 + 1/4 + ... < 4/3
        status = hg_gpu_buffer_reserve(gpu, HG_GPU_BUFFER_DEVICE, side * side * 4 * 4 / 3 + 4,
            "unlit levels", &tiles->levels, err);
    if (tiles->levels.size_bytes != before)
        tiles->seen = 0;
    return status;
}

static struct hg_gpu_unlit push_of(
    const struct hg_unlit_tiles *tiles, const struct hg_gpu_image *depth, uint32_t atlas_px)
{
    return (struct hg_gpu_unlit){.head = tiles->head.address,
        .cells = tiles->cells.address,
        .runs = tiles->cells.address + 4 * cell_words(depth),
        .levels = tiles->levels.address,
        .width = depth->width,
        .height = depth->height,
        .columns = cells_along(depth->width),
        .rows = cells_along(depth->height),
        .atlas_px = atlas_px};
}

static enum hg_status dispatch(struct hg_pass *pass, const struct hg_gpu_pipeline_params *params,
    const struct hg_gpu_unlit *push, const uint32_t groups[2], struct hg_error *err)
{
    const enum hg_status status = hg_gpu_cmd_pipeline(pass->cmd, params, err);
    if (status != HG_OK)
        return status;
    hg_gpu_cmd_push(pass->cmd, push, sizeof *push);
    vkCmdDispatch(hg_gpu_cmd_handle(pass->cmd), groups[0], groups[1], 1);
    return HG_OK;
}

// The pyramid of all maps that are in use.
static enum hg_status make_levels(struct hg_pass *pass, struct hg_lighting *lighting, bool coarse,
    struct hg_gpu_unlit push, struct hg_error *err)
{
    uint32_t count;
    const struct hg_shadow_map *maps = hg_lighting_shadow_maps(lighting, &count);
    enum hg_status status = HG_OK;
    for (uint32_t level = 0; level < HG_UNLIT_TILES_LEVELS; level++) {
        const uint32_t texels = HG_UNLIT_TILES_TEXELS << level;
        const struct hg_gpu_pipeline_params params = {
            .compute = "unlit_tiles_level.comp", .spec = {level == 0}, .spec_count = 1};
        for (uint32_t i = 0; i < count && status == HG_OK; i++) {
            if (coarse && maps[i].refines)
                continue;
            push.level = level;
            push.first_x = (uint32_t)maps[i].gpu.rect_px.x / texels;
            push.first_y = (uint32_t)maps[i].gpu.rect_px.y / texels;
            push.side = (uint32_t)maps[i].gpu.size_px / texels;
            const uint32_t groups[2] = {(push.side + 7) / 8, (push.side + 7) / 8};
            status = dispatch(pass, &params, &push, groups, err);
        }
        hg_gpu_memory_barrier(pass->cmd);
    }
    return status;
}

static enum hg_status find(struct hg_pass *pass, struct hg_unlit_tiles *tiles,
    struct hg_lighting *lighting, bool coarse, const struct hg_gpu_unlit *push,
    struct hg_error *err)
{
    const uint64_t revision = hg_lighting_atlas_revision(lighting);
    enum hg_status status = HG_OK;
    if (tiles->seen != revision || (tiles->coarse && !coarse)) {
        status = make_levels(pass, lighting, coarse, *push, err);
        tiles->seen = status == HG_OK ? revision : 0;
        tiles->coarse = coarse;
    }
    const uint32_t cells = push->columns * push->rows;
    const struct hg_gpu_pipeline_params finds = {.compute = "unlit_tiles_cells.comp",
        .spec = {0, pass->tables, pass->features},
        .spec_count = 3,
        .io = &depth_io};
    const struct hg_gpu_pipeline_params joins = {.compute = "unlit_tiles_runs.comp"};
    const uint32_t groups[2] = {(cells + HG_UNLIT_TILES_GROUP - 1) / HG_UNLIT_TILES_GROUP, 1};
    const uint32_t rows[2] = {(push->rows + 7) / 8, 1};
    if (status == HG_OK)
        status = dispatch(pass, &finds, push, groups, err);
    hg_gpu_memory_barrier(pass->cmd);
    if (status == HG_OK)
        status = dispatch(pass, &joins, push, rows, err);
    hg_gpu_memory_barrier(pass->cmd);
    return status;
}

enum hg_status hg_unlit_tiles_find(struct hg_pass *pass, struct hg_unlit_tiles *tiles,
    struct hg_lighting *lighting, bool coarse, struct hg_gpu_image *depth, struct hg_error *err)
{
    const struct depth_inputs inputs = {.depth = {.image = depth}};
    const uint32_t atlas_px = hg_lighting_image_shadow(lighting)->width;
    enum hg_status status = reserve(tiles, pass->gpu, depth, atlas_px, err);
    if (status == HG_OK)
        status = hg_pass_bind(pass, &depth_io, &inputs, sizeof inputs, err);
    if (status != HG_OK)
        return status;
    const struct hg_gpu_unlit push = push_of(tiles, depth, atlas_px);
    hg_gpu_memory_barrier(pass->cmd); // the sample before may still read
    status = find(pass, tiles, lighting, coarse, &push, err);
    return status;
}

enum hg_status hg_unlit_tiles_mark(struct hg_pass *pass, const struct hg_unlit_tiles *tiles,
    struct hg_gpu_image *depth, struct hg_error *err)
{
    const VkCommandBuffer cmd = hg_gpu_cmd_handle(pass->cmd);
    const struct hg_gpu_pipeline_params params = {.vertex = "unlit_tiles_mark.vert",
        .depth = VK_FORMAT_D32_SFLOAT,
        .depth_compare = VK_COMPARE_OP_LESS, // surfaces, not the background
        .depth_write = true,
        .topology = VK_PRIMITIVE_TOPOLOGY_TRIANGLE_LIST};
    const struct hg_gpu_rendering rendering = {.depth = {.image = depth}};
    const struct hg_gpu_unlit push = push_of(tiles, depth, 0);
    const VkViewport view = {
        0.0f, 0.0f, (float)depth->width, (float)depth->height, HG_UNLIT_TILES_DEPTH, 1.0f};
    hg_gpu_cmd_begin_rendering(pass->cmd, &rendering);
    const enum hg_status status = hg_gpu_cmd_pipeline(pass->cmd, &params, err);
    if (status == HG_OK) {
        vkCmdSetViewport(cmd, 0, 1, &view);
        hg_gpu_cmd_push(pass->cmd, &push, sizeof push);
        vkCmdDrawIndirect(cmd, tiles->head.handle, 0, 1, 0);
    }
    hg_gpu_cmd_end_rendering(pass->cmd);
    return status;
}

float hg_unlit_tiles_share(const struct hg_unlit_tiles *tiles, const struct hg_gpu_image *depth)
{
    const struct hg_gpu_unlit_head *head = tiles->head.mapped;
    const float cells = (float)cells_along(depth->width) * (float)cells_along(depth->height);
    return head == NULL ? 0.0f : (float)head->unlit / cells;
}
