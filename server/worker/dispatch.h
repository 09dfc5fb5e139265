// dispatch.h - the render thread: takes messages in order, then lets views work in turn.
// Floor 6, private to server/worker.
#ifndef HG_SERVER_WORKER_DISPATCH_H
#define HG_SERVER_WORKER_DISPATCH_H

#include "server/worker/worker.h"

// Main function of the thread: struct worker, with its encoders. Ends once `stop` is set and it was
// woken, or the device is lost. Messages that are still in the inbox then take no effect.
void *hg_dispatch_main(void *worker);

#endif
