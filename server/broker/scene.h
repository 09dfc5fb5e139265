// scene.h - scenes by name, shared by sessions, for as long as one holds them.
// Floor 6 (broker). Thread: the loop. A scene owns the journal from which a new worker gets it
// back.
#ifndef HG_BROKER_SCENE_H
#define HG_BROKER_SCENE_H

#include "server/broker/scene_journal.h"
#include "server/broker/worker_pool.h"

#define HG_SCENE_REPLAY_CHANNEL (UINT32_C(1) << 31) // | number of the scene

struct hg_shared_scene {
    struct hg_shared_scene *prev, *next;
    uint32_t number;
    char key[160];  // for the worker
    char name[129]; // empty: private
    struct hg_journal *journal;
    struct hg_link *link; // to its worker
    uint64_t revision;
    uint32_t sessions, ranges_used;
    bool in_worker;  // replayed; sessions are attached
    uint32_t deaths; // of the worker while this scene was replayed
};

struct hg_scene_table {
    const struct hg_worker_pool *pool;
    struct hg_upload_store *store;
    struct hg_shared_scene *first;
    uint32_t last_number;
};

// Finds or makes the scene; *existed. NULL: no memory.
struct hg_shared_scene *hg_shared_scene_join(
    struct hg_scene_table *table, struct hgp_str name, uint64_t session, bool *existed);
void hg_shared_scene_leave(struct hg_scene_table *table, struct hg_shared_scene *scene);
// On which it is replayed.
uint32_t hg_shared_scene_channel(const struct hg_shared_scene *scene);

#endif
