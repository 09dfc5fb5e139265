// build_queue.h - cluster hierarchies made in the background, or found in the store.
// Floor 2 (geometry). Thread: the render thread; one thread of its own does the work, on jobs.
#ifndef HG_RENDERER_LOD_BUILD_QUEUE_H
#define HG_RENDERER_LOD_BUILD_QUEUE_H

#include "renderer/lod/store.h"

struct hg_lod_build_queue;

struct hg_lod_built {
    uint64_t mesh, revision;
    uint32_t part;
    enum hg_status status; // HG_OK: one of the two is set
    struct hg_lod_stored stored;
    uint8_t *data;
    size_t size;
};

// store may be NULL; jobs and store are borrowed and must outlive it. HG_E_NOMEM.
enum hg_status hg_lod_build_queue_create(struct hg_store *store, struct hg_jobs *jobs,
    struct hg_lod_build_queue **out, struct hg_error *err) HG_MUST_CHECK;
void hg_lod_build_queue_destroy(struct hg_lod_build_queue *baker); // cancels; accepts NULL
// Queues a part, unless it is pending; its arrays and the mesh's name are copied. HG_E_NOMEM.
enum hg_status hg_lod_build_queue_add(struct hg_lod_build_queue *baker, const struct hg_mesh *mesh,
    uint64_t id, uint64_t revision, uint32_t index) HG_MUST_CHECK;
// Takes a result, waits for one at most until a time of hg_clock_now_ns, HG_COND_FOREVER = as long
// as it takes. False: none.
bool hg_lod_build_queue_take(
    struct hg_lod_build_queue *baker, uint64_t until_ns, struct hg_lod_built *out);
// Parts that were added and not taken.
uint32_t hg_lod_build_queue_pending(const struct hg_lod_build_queue *baker);

#endif
