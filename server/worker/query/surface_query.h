// surface_query.h - questions about what a view shows at pixels of its newest frame.
// Floor 6, private to server/worker. Thread: the render thread. A handler answers its request.
#ifndef HG_SERVER_WORKER_QUERY_SURFACE_QUERY_H
#define HG_SERVER_WORKER_QUERY_SURFACE_QUERY_H

#include "server/worker/request.h"

void hg_handle_box_select(const struct request *r);
void hg_handle_surface_query(const struct request *r);
void hg_handle_measure(const struct request *r);

#endif
