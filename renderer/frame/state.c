// state.c - see state.h.
#include "renderer/frame/state.h"

#include "renderer/frame/light/gi_view.h"

struct hg_picture_region hg_view_region(const struct hg_view_settings *settings)
{
    const struct hg_picture_region all = {0, 0, settings->width, settings->height};
    return settings->region.width > 0 ? settings->region : all;
}

struct hg_draw hg_view_draw(struct hg_view_state *view, const struct hg_draw_request *request)
{
    return (struct hg_draw){.context = view->context,
        .scene_gpu = view->scene_gpu,
        .lighting = view->lighting,
        .request = request,
        .targets = &view->targets,
        .culling = view->culling,
        .frame = &view->frame,
        .buffers = &view->buffers,
        .history = &view->history,
        .temporal = &view->motion.temporal,
        .reflections = &view->motion.reflections,
        .mirrors = &view->motion.mirrors,
        .clear_glass = &view->motion.glass,
        .accumulation = &view->accumulation,
        .blend = &view->blend,
        .unlit = &view->unlit,
        .stats = &view->stats,
        .settings_revision = view->settings_revision,
        .probes = {view->gi.field, hg_gi_view_id(view)},
        .gathered = view->gi.gathered ? &view->gi.gather.light : NULL,
        .glass =
            view->gi.gathered && view->gi.gather.glass.width > 0 ? &view->gi.gather.glass : NULL,
        .blocks = view->gi.gathered && view->gi.gather.blocks.counts != NULL &&
                          request->settings->debug == 0
                      ? &view->gi.gather.blocks
                      : NULL};
}
