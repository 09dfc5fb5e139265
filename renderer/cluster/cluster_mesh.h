// cluster_mesh.h - one baked part at run time, and the pool of its chunks on the device.
// Floor 2 (geometry). Thread: the render thread; reading and decoding happen on threads of the pool
// and on jobs. Private to the room.
//
// Chunks are in slots of one size, under the geometry budget, evicted by least recent use
// (renderer/residency). A chunk is resident only while the chunks of all parents of its groups are,
// as lod.h asks: parents are pinned by the children that are there. Chunks that one picture needs
// without their parents are there *loosely*: for other views they count as absent.
#ifndef HG_RENDERER_CLUSTER_CLUSTER_MESH_H
#define HG_RENDERER_CLUSTER_CLUSTER_MESH_H

#include "base/jobs.h"
#include "renderer/cluster/cluster_pool_stats.h"
#include "renderer/gpu/gpu.h"
#include "renderer/lod/store.h"
#include "shaders/shared/geometry.h"

struct hg_cluster_pool;

struct hg_chunk_state {
    uint32_t slot;           // HG_RESIDENCY_NONE: not resident
    uint32_t mark;           // hg_cluster_pool_mark
    uint32_t children;       // resident chunks that need this one, without loose ones
    uint32_t held;           // by cuts, resident or not: it is not evicted
    bool loose;              // without its parents
    const uint32_t *indices; // while resident, host memory
    const float *positions;  // likewise; NULL: the host cannot read them
    uint32_t *host_indices;  // where device memory is slow to read
    struct hg_gpu_part part; // its streams
};

// There with all that it needs.
static inline bool hg_chunk_is_bound(const struct hg_chunk_state *c)
{
    return c->slot != UINT32_MAX && !c->loose;
}

struct hg_cluster_mesh {
    struct hg_lod *lod;
    struct hg_lod_stored stored; // its source, or
    uint8_t *data;               // the whole file
    size_t size;
    uint32_t number;        // in keys of the pool, never used again
    uint32_t *parent_first; // [chunk_count + 1] into parents
    uint32_t *parents;      // chunks that must be resident
    struct hg_chunk_state *chunks;
    struct hg_gpu_buffer table; // struct hg_gpu_part per chunk, then the levels of their triangles
};

// Takes over data or stored (whichever is set). The root chunks are loaded and stay. HG_E_LIMIT
// (budget), HG_E_NOMEM, HG_E_HASH and HG_E_FORMAT (damaged), device errors.
enum hg_status hg_cluster_mesh_open(struct hg_cluster_pool *pool, struct hg_lod_stored *stored,
    uint8_t *data, size_t size, struct hg_cluster_mesh **out, struct hg_error *err) HG_MUST_CHECK;
// Address of the levels of its triangles, for debug views.
VkDeviceAddress hg_cluster_mesh_levels(const struct hg_cluster_mesh *mesh);
void hg_cluster_mesh_close(struct hg_cluster_pool *pool, struct hg_cluster_mesh *mesh);

// A chunk that a view would use, and how urgently (pixels of error).
struct hg_chunk_want {
    struct hg_cluster_mesh *mesh;
    uint32_t chunk;
    float priority;
};

// HG_E_NOMEM.
enum hg_status hg_cluster_pool_create(
    struct hg_gpu *gpu, struct hg_cluster_pool **out, struct hg_error *err) HG_MUST_CHECK;
void hg_cluster_pool_destroy(struct hg_cluster_pool *pool); // accepts NULL; meshes are closed
// Bytes that slots may take; 0 = unlimited. Call between frames: slots above it are given back, as
// far as no root chunk is in them, and what they held is loaded again when it is wanted.
void hg_cluster_pool_set_budget(struct hg_cluster_pool *pool, uint64_t bytes);
void hg_cluster_pool_stats(const struct hg_cluster_pool *pool, struct hg_cluster_pool_stats *out);

// A frame begins: chunks that threads have decoded come in. True when one did.
bool hg_cluster_pool_tick(struct hg_cluster_pool *pool);
void hg_cluster_pool_use(
    struct hg_cluster_pool *pool, struct hg_cluster_mesh *mesh, uint32_t chunk);
// A number that no chunk is marked with yet; accepts NULL.
uint32_t hg_cluster_pool_mark(struct hg_cluster_pool *pool);
// Starts to load what is wanted most. True when the pool is too small for all of it.
bool hg_cluster_pool_request(
    struct hg_cluster_pool *pool, const struct hg_chunk_want *wants, uint32_t count);
// Loads all of it now, coarse chunks first; loose: whether their parents are there or not.
// HG_E_AGAIN: no room beside what this frame uses. Other statuses as of opening.
enum hg_status hg_cluster_pool_load(struct hg_cluster_pool *pool, const struct hg_chunk_want *wants,
    uint32_t count, bool loose, struct hg_error *err) HG_MUST_CHECK;
// All that is there stays, but nothing keeps its parents any more: the next frame may replace
// whatever it does not use. What a view needs with its parents is bound again when it is loaded.
void hg_cluster_pool_loosen(struct hg_cluster_pool *pool);
// Keeps a chunk from being evicted (counted); a smaller budget may take it away all the same. What
// is held is let go by the number of its mesh, which may be closed.
void hg_cluster_pool_hold(
    struct hg_cluster_pool *pool, struct hg_cluster_mesh *mesh, uint32_t chunk);
void hg_cluster_pool_let_go(struct hg_cluster_pool *pool, uint32_t number, uint32_t chunk);
// Decodes a chunk to dst (hg_lod_chunk_layout). Thread-safe. Statuses as of opening.
enum hg_status hg_cluster_mesh_decode(const struct hg_cluster_mesh *mesh, uint32_t chunk,
    uint8_t *dst, struct hg_error *err) HG_MUST_CHECK;

#endif
