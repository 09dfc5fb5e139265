// edit_mesh.h - meshes that clients make from their own arrays.
// Floor 6, private to server/worker. Thread: the render thread. A handler answers its request.
#ifndef HG_SERVER_WORKER_EDIT_EDIT_MESH_H
#define HG_SERVER_WORKER_EDIT_EDIT_MESH_H

#include "server/worker/request.h"

void hg_handle_mesh_set(const struct request *r);

#endif
