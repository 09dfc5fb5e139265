// governor.c - see governor.h.
#include "renderer/frame/quality/governor.h"

#include <math.h>
#include <string.h>

// A triangle takes as long to rasterise as so many pixels (docs/internals/performance.md).
#define TRIANGLE_PX 3.0f

// Visibility is of pixels and of triangles that the device draws: the share of the former.
static float share_of_pixels(const struct hg_view_state *view)
{
    const VkExtent2D drawn = view->motion.temporal.drawn;
    const float pixels = drawn.width > 0
                             ? (float)drawn.width * (float)drawn.height
                             : (float)view->settings.width * (float)view->settings.height;
    const uint64_t triangles = view->stats.triangles_drawn - view->stats.triangles_hosted;
    return pixels / (pixels + TRIANGLE_PX * (float)triangles);
}

static struct hg_quality_levers levers_of(const struct hg_view_state *view)
{
    const struct hg_view_settings *s = &view->settings;
    const struct hg_geometry *geometry = view->scene_gpu->geometry;
    const bool scales = s->temporal == HG_VIEW_TEMPORAL_AUTO && !(s->scale > 0.0f);
    return (struct hg_quality_levers){.scale = scales,
        .checkerboard = scales && !hg_geometry_blends(geometry),
        .error = hg_geometry_is_simplified(geometry)};
}

// Stages of the device run inside of the step.
void hg_governor_note(struct hg_view_state *view)
{
    static const struct {
        const char *name;
        enum hg_quality_part part;
    } parts[] = {{"probes", HG_QUALITY_RAYS}, {"cull", HG_QUALITY_TRIANGLES},
        {"host raster", HG_QUALITY_TRIANGLES}, {"skin", HG_QUALITY_TRIANGLES},
        {"visibility", HG_QUALITY_TRIANGLES}, {"shadow", HG_QUALITY_TRIANGLES},
        {"probe light", HG_QUALITY_PIXELS}, {"reflections", HG_QUALITY_PIXELS},
        {"reflection rays", HG_QUALITY_RAYS}, {"mirrors", HG_QUALITY_PIXELS},
        {"glass", HG_QUALITY_PIXELS}, {"shading", HG_QUALITY_SHADING},
        {"blend visibility", HG_QUALITY_PIXELS}, {"blend sort", HG_QUALITY_PIXELS},
        {"blend shading", HG_QUALITY_PIXELS}, {"unlit tiles", HG_QUALITY_PIXELS},
        {"motion", HG_QUALITY_PIXELS}, {"posed motion", HG_QUALITY_PIXELS}};
    const struct hg_view_stats *stats = &view->stats;
    float ms[HG_QUALITY_PARTS] = {0}, known = 0.0f, visibility_ms = 0.0f;
    for (uint32_t i = 0; i < stats->stage_count; i++)
        for (size_t k = 0; k < sizeof parts / sizeof parts[0]; k++) {
            const float stage_ms = (float)((double)stats->stages[i].ns * 1e-6);
            const bool is = strcmp(stats->stages[i].name, parts[k].name) == 0;
            ms[parts[k].part] += is ? stage_ms : 0.0f;
            known += is ? stage_ms : 0.0f;
            visibility_ms += is && strcmp(parts[k].name, "visibility") == 0 ? stage_ms : 0.0f;
        }
    const float of_pixels_ms = visibility_ms * share_of_pixels(view);
    ms[HG_QUALITY_TRIANGLES] -= of_pixels_ms;
    ms[HG_QUALITY_PIXELS] += of_pixels_ms;
    ms[HG_QUALITY_REST] = fmaxf((float)((double)stats->step_ns * 1e-6) - known, 0.0f);
    const struct hg_quality_levers levers = levers_of(view);
    hg_quality_note(&view->motion.quality, ms, hg_view_target_ms(view), &levers);
}

struct hg_quality_choice hg_governor_choice(const struct hg_view_state *view)
{
    const float target_ms = view->motion.still > 0 ? 0.0f : hg_view_target_ms(view);
    return hg_quality_choose(&view->motion.quality, target_ms);
}
