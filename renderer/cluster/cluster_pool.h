// cluster_pool.h - what cluster_mesh.c needs of the pool. Private to the room.
#ifndef HG_RENDERER_CLUSTER_CLUSTER_POOL_H
#define HG_RENDERER_CLUSTER_CLUSTER_POOL_H

#include "renderer/cluster/cluster_mesh.h"
#include "renderer/residency/residency.h"

struct hg_gpu *hg_cluster_pool_gpu(const struct hg_cluster_pool *pool);
uint32_t hg_cluster_pool_next_number(struct hg_cluster_pool *pool);
// Raises the budget as far as `count` chunks need that must be resident: code that set it sees what
// is used and what that leaves.
void hg_cluster_pool_make_room(struct hg_cluster_pool *pool, uint32_t count);
// A resident chunk that is never evicted.
void hg_cluster_pool_pin(
    struct hg_cluster_pool *pool, struct hg_cluster_mesh *mesh, uint32_t chunk);
// Empties all slots of a mesh and waits for threads that read it.
void hg_cluster_pool_forget(struct hg_cluster_pool *pool, struct hg_cluster_mesh *mesh);

#endif
