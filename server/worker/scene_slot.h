// scene_slot.h - scenes by key, shared by the sessions that name it.
// Floor 6, private to server/worker. Thread: the render thread.
#ifndef HG_SERVER_WORKER_SCENE_SLOT_H
#define HG_SERVER_WORKER_SCENE_SLOT_H

#include "renderer/scene/fingerprint.h"
#include "renderer/scene/scene.h"
#include "server/worker/render_state.h"

struct scene_slot {
    struct scene_slot *next;
    char *key;
    struct hg_scene *scene;
    uint32_t sessions;
    uint64_t lit_revision; // of the scene, that its default light is of; 0 = none
    bool dirty; // edits since the newest revision, inside an open batch
    uint32_t open_batches;
    uint64_t batch_started_ns;
    double time_s;                      // of the newest pose
    struct hg_fingerprint *fingerprint; // NULL until a frame key is requested
    uint8_t hash[32];                   // of what it held when a frame key was made last
};

// The scene of this key, made when there is none; one session more holds it. NULL: no memory.
struct scene_slot *hg_scene_slot_hold(struct render_state *s, struct hgp_str key);
void hg_scene_slot_release(struct render_state *s, struct scene_slot *slot);

// Makes a revision of what open batches changed so far, if they did: also when a view renders the
// scene all the same. What it keeps of the scene may be gone.
void hg_scene_slot_publish(struct scene_slot *slot);
// Its default light, where no environment was chosen, for the newest revision.
void hg_scene_slot_light(struct scene_slot *slot);
// Is an open batch to be waited for? Not one that has been left open for too long: *wait_ns is at
// most how long that is.
bool hg_scene_slot_in_batch(const struct scene_slot *slot, uint64_t *wait_ns);

#endif
