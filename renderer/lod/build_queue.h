// build_queue.h - cluster hierarchies made in the background, or found in the store.
// Floor 2 (geometry). Thread: the render thread; one thread of its own does the work, on jobs.
#ifndef HG_RENDERER_LOD_BUILD_QUEUE_H
#define HG_RENDERER_LOD_BUILD_QUEUE_H

#include "renderer/lod/store.h"

struct hg_baker;

struct hg_baked {
    uint64_t mesh, revision;
    uint32_t part;
    enum hg_status status; // HG_OK: one of the two is set
    struct hg_lod_stored stored;
    uint8_t *data;
    size_t size;
};

// store may be NULL; jobs and store are borrowed and must outlive it. HG_E_NOMEM.
enum hg_status hg_baker_create(struct hg_store *store, struct hg_jobs *jobs, struct hg_baker **out,
    struct hg_error *err) HG_MUST_CHECK;
void hg_baker_destroy(struct hg_baker *baker); // cancels; accepts NULL
// Queues a part, unless it is pending; its arrays and the mesh's name are copied. HG_E_NOMEM.
enum hg_status hg_baker_add(struct hg_baker *baker, const struct hg_mesh *mesh, uint64_t id,
    uint64_t revision, uint32_t index) HG_MUST_CHECK;
// Takes a result, waits for one at most until a time of hg_clock_now_ns, HG_COND_FOREVER = as long as
// it takes. False: none.
bool hg_baker_take(struct hg_baker *baker, uint64_t until_ns, struct hg_baked *out);
// Parts that were added and not taken.
uint32_t hg_baker_pending(const struct hg_baker *baker);

#endif
