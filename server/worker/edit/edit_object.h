// edit_object.h - textures, materials, nodes, lights, cameras; batches of edits.
// Floor 6, private to server/worker. Thread: the render thread. A handler answers its request.
#ifndef HG_SERVER_WORKER_EDIT_EDIT_OBJECT_H
#define HG_SERVER_WORKER_EDIT_EDIT_OBJECT_H

#include "server/worker/request.h"

void hg_handle_texture_set(const struct request *r);
void hg_handle_material_set(const struct request *r);
void hg_handle_node_set(const struct request *r);
void hg_handle_light_set(const struct request *r);
void hg_handle_camera_set(const struct request *r);
void hg_handle_object_remove(const struct request *r);
void hg_handle_batch_begin(const struct request *r);
void hg_handle_batch_end(const struct request *r);

// The object with this id; made when the id is new and lies in the session's range. NULL: the
// request has been answered with the error.
struct hg_object *hg_edit_find_or_make(
    const struct request *r, enum hg_object_kind kind, uint64_t id, const char *message);

#endif
