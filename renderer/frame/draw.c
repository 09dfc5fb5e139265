// draw.c - see draw.h.
#include "renderer/frame/draw.h"

#include <string.h>

#include "renderer/frame/state.h"

void hg_view_stats_add_stage(struct hg_view_stats *stats, const char *name, uint64_t ns)
{
    if (stats->stage_count < HG_VIEW_MAX_STAGES)
        stats->stages[stats->stage_count++] = (struct hg_view_stage){name, ns};
}

void hg_view_stats_add_device(struct hg_view_stats *stats, const struct hg_gpu *gpu)
{
    struct hg_gpu_stage_time times[HG_GPU_MAX_STAGES];
    const uint32_t count = hg_gpu_stage_times(gpu, times);
    for (uint32_t i = 0; i < count; i++)
        hg_view_stats_add_stage(stats, times[i].name, times[i].ns);
}

VkExtent2D hg_draw_size(const struct hg_draw_request *request)
{
    const struct hg_view_settings *s = request->settings;
    return request->drawn.width > 0 ? request->drawn : (VkExtent2D){s->width, s->height};
}

struct hg_gpu_image *hg_draw_picture(const struct hg_draw *draw)
{
    return hg_draw_is(draw, HG_DRAW_CHECKERBOARD) ? &draw->targets->checkered
                                                  : &draw->targets->pixels[0];
}

struct hg_draw hg_draw_with(const struct hg_draw *draw, const struct hg_draw_request *request)
{
    struct hg_draw other = *draw;
    other.request = request;
    return other;
}

bool hg_draw_is(const struct hg_draw *draw, enum hg_draw_flag flag)
{
    return (draw->request->flags & (uint32_t)flag) != 0;
}

const struct hg_tiled_area *hg_draw_area(const struct hg_draw *draw)
{
    const struct hg_tiled_accumulation *s = draw->accumulation;
    if (!hg_draw_is(draw, HG_DRAW_EXACT) || s->areas.count == 0)
        return NULL;
    const struct hg_tiled_areas *stack =
        hg_draw_is(draw, HG_DRAW_BEHIND) ? &s->behind.areas : &s->areas;
    return &stack->items[stack->count - 1];
}

uint32_t hg_draw_first_sample(const struct hg_draw *draw)
{
    const struct hg_tiled_area *area = hg_draw_area(draw);
    return area != NULL ? area->samples : draw->accumulation->samples;
}

bool hg_draw_has_holes(const struct hg_draw *draw)
{
    return draw->scene_gpu->has_holes || hg_look_sees_through(draw->request->settings->look);
}

bool hg_draw_ground(const struct hg_draw *draw, float up[3], float *height)
{
    static const float ups[][3] = {
        {0, 0, 0}, {0, 1, 0}, {0, 0, 1}, {1, 0, 0}, {0, -1, 0}, {0, 0, -1}, {-1, 0, 0}};
    float low[3], high[3];
    const uint32_t ground = draw->request->settings->ground;
    memcpy(up, ups[ground], sizeof ups[ground]);
    *height = 0;
    if (ground == 0 || !hg_geometry_bounds(draw->scene_gpu->geometry, low, high))
        return false;
    for (int a = 0; a < 3; a++)
        *height += up[a] > 0 ? low[a] : up[a] < 0 ? -high[a] : 0;
    return true;
}

enum hg_status hg_draw_make_image(const struct hg_draw *draw, VkFormat format, const char *name,
    struct hg_gpu_image *image, struct hg_error *err)
{
    const VkExtent2D size = hg_draw_size(draw->request);
    const struct hg_gpu_image_params params = {.format = format,
        .width = size.width,
        .height = size.height,
        .attachment = true,
        .name = name};
    return image->handle != VK_NULL_HANDLE
               ? HG_OK
               : hg_gpu_image_create(draw->context->gpu, &params, image, err);
}
