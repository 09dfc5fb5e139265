// bake.h - `helio bake`: page packs and cluster files of the session's scene, in a private worker.
// Floor 6, private to server/worker. Thread: the render thread. A handler answers its request.
#ifndef HG_SERVER_WORKER_BAKE_H
#define HG_SERVER_WORKER_BAKE_H

#include "server/worker/request.h"

void hg_handle_bake(const struct request *r);

#endif
