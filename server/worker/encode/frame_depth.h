// frame_depth.h - the depth of what a frame shows, and the camera that made it, for clients that
// reproject it while the next one is under way.
// Floor 6, private to server/worker. Thread: the render thread. Reads what the newest step left.
#ifndef HG_SERVER_WORKER_ENCODE_FRAME_DEPTH_H
#define HG_SERVER_WORKER_ENCODE_FRAME_DEPTH_H

#include "server/worker/view/view_slot.h"

// Fills request->depth and the camera of the frame, where the subscription wants them and its
// client does not have those of this state yet. A frame whose depth cannot be read goes without.
void hg_frame_depth_attach(
    const struct session *session, struct view_slot *view, struct encode_request *request);

#endif
