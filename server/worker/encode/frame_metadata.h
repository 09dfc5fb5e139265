// frame_metadata.h - what a frame says besides its pixels: its key, and in EXR files planes, camera
// and parameters.
// Floor 6, private to server/worker. Thread: the render thread. Reads what the newest step left.
#ifndef HG_SERVER_WORKER_ENCODE_FRAME_METADATA_H
#define HG_SERVER_WORKER_ENCODE_FRAME_METADATA_H

#include "server/worker/view/view_slot.h"

// Fills metadata, planes and mattes of a frame that is about to be encoded, and frame.job.
enum hg_status hg_frame_metadata_attach(struct render_state *s, struct session *session,
    struct view_slot *view, struct encode_request *request, struct hg_error *err) HG_MUST_CHECK;

#endif
