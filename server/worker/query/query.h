// query.h - questions about views, scenes and images.
// Floor 6, private to server/worker. Thread: the render thread. A handler answers its request.
#ifndef HG_SERVER_WORKER_QUERY_QUERY_H
#define HG_SERVER_WORKER_QUERY_QUERY_H

#include "server/worker/request.h"

void hg_handle_pick(const struct request *r);
void hg_handle_bounds_query(const struct request *r);
void hg_handle_nodes_query(const struct request *r);
void hg_handle_stats_query(const struct request *r);
void hg_handle_info_query(const struct request *r);
void hg_handle_compare(const struct request *r);
void hg_handle_image_query(const struct request *r);

// Answer with what a task has found.
void hg_query_compared(const struct request *r, struct task *task);
void hg_query_image_examined(const struct request *r, struct task *task);

#endif
