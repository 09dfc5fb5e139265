// checkpoint.h - films and histories of path-traced views that clients keep for later.
// Floor 6, private to server/worker. Thread: the render thread. A handler answers its request.
#ifndef HG_SERVER_WORKER_CHECKPOINT_H
#define HG_SERVER_WORKER_CHECKPOINT_H

#include "server/worker/request.h"

void hg_handle_checkpoint_query(const struct request *r);
void hg_handle_checkpoint_set(const struct request *r);

#endif
