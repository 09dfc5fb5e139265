// edit_load.h - assets, environments, poses and variants.
// Floor 6, private to server/worker. Thread: the render thread. A handler answers its request.
#ifndef HG_SERVER_WORKER_EDIT_EDIT_LOAD_H
#define HG_SERVER_WORKER_EDIT_EDIT_LOAD_H

#include "server/worker/request.h"

void hg_handle_asset_load(const struct request *r);
void hg_handle_asset_unload(const struct request *r);
void hg_handle_environment_set(const struct request *r);
void hg_handle_animation_set(const struct request *r);
void hg_handle_variant_set(const struct request *r);

// Apply what a task has read, and answer.
void hg_edit_asset_loaded(const struct request *r, struct task *task);
void hg_edit_environment_loaded(const struct request *r, struct task *task);

#endif
