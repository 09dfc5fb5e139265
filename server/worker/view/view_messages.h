// view_messages.h - messages of views: parameters, cameras, frame requests.
// Floor 6, private to server/worker. Thread: the render thread. A handler answers its request.
#ifndef HG_SERVER_WORKER_VIEW_VIEW_MESSAGES_H
#define HG_SERVER_WORKER_VIEW_VIEW_MESSAGES_H

#include "server/worker/request.h"

void hg_handle_view_set(const struct request *r);
void hg_handle_view_close(const struct request *r);
void hg_handle_view_camera(const struct request *r);
void hg_handle_frame_request(const struct request *r);
void hg_handle_exposure_query(const struct request *r);
void hg_handle_frame_cancel(const struct request *r);
void hg_handle_subscribe(const struct request *r);
void hg_handle_credit(const struct request *r);
void hg_handle_taken(const struct request *r);
void hg_handle_delivered(const struct request *r);
void hg_handle_key_frame(const struct request *r);
void hg_handle_job_query(const struct request *r);

#endif
