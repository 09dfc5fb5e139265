// state.c - see state.h.
#include "renderer/frame/state.h"

void hg_view_add_stage(struct hg_view_state *view, const char *name, uint64_t ns)
{
    if (view->stage_count < HG_VIEW_MAX_STAGES)
        view->stages[view->stage_count++] = (struct hg_view_stage){name, ns};
}

enum hg_status hg_view_make_image(struct hg_view_state *view, VkFormat format, const char *name,
    struct hg_gpu_image *image, struct hg_error *err)
{
    const struct hg_gpu_image_params params = {.format = format,
        .width = view->settings.width,
        .height = view->settings.height,
        .attachment = true,
        .name = name};
    return image->handle != VK_NULL_HANDLE
               ? HG_OK
               : hg_gpu_image_create(view->context->gpu, &params, image, err);
}

float hg_view_error_px(const struct hg_view_state *view)
{
    const struct hg_tiled_accumulation *s = &view->stream;
    const float drawn =
        view->shown_error_px > 0.0f ? view->shown_error_px : view->settings.error_px;
    const float shown = drawn > s->shadow_error_px ? drawn : s->shadow_error_px;
    return s->uneven && s->has_fallback && s->fallback_error_px > shown ? s->fallback_error_px
                                                                        : shown;
}

const struct hg_tiled_accumulation_area *hg_view_area(const struct hg_view_state *view)
{
    const struct hg_tiled_accumulation *s = &view->stream;
    if (!s->exact || s->area_count == 0)
        return NULL;
    return s->behind ? &s->behind_areas[s->behind_count - 1] : &s->areas[s->area_count - 1];
}

uint32_t hg_view_first_sample(const struct hg_view_state *view)
{
    const struct hg_tiled_accumulation_area *area = hg_view_area(view);
    return area != NULL ? area->samples : view->samples;
}

void hg_view_mark_shadows(struct hg_view_state *view, bool stale)
{
    uint32_t count;
    struct hg_shadow_map *maps = hg_lighting_shadow_maps(view->lighting, &count);
    for (uint32_t i = 0; i < count; i++)
        maps[i].stale = stale;
}
