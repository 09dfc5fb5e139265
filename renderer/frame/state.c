// state.c - see state.h.
#include "renderer/frame/state.h"

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
        .accumulation = &view->accumulation,
        .peeling = &view->peeling,
        .unlit = &view->unlit,
        .stats = &view->stats};
}
