// view_look.h - messages about how a view shows the scene: clipping planes, overrides, variants.
// Floor 6, private to server/worker. Thread: the render thread. A handler answers its request.
#ifndef HG_SERVER_WORKER_VIEW_VIEW_LOOK_H
#define HG_SERVER_WORKER_VIEW_VIEW_LOOK_H

#include "server/worker/request.h"

void hg_handle_view_clip(const struct request *r);
void hg_handle_view_overrides(const struct request *r);
void hg_handle_view_variant(const struct request *r);

#endif
