// fake_scene.h - a scene kept as merged messages, with the renderer's rules about references.
// For the fake worker, and as the model that the broker's journal is compared with.
#ifndef HG_TESTS_SYSTEM_FAKE_SCENE_H
#define HG_TESTS_SYSTEM_FAKE_SCENE_H

#include "base/sha256.h"
#include "server/broker/connection/packet.h"

struct fake_object {
    struct fake_object *next;
    uint16_t type; // of the message that makes it
    uint64_t id;
    int64_t extra; // animation of a pose
    struct hg_packet *packet;
};

// Zero-initialised = empty.
struct fake_scene {
    struct fake_object *objects; // newest first
};

// Applies an edit. Objects that do not exist yet must have ids of the range (asset 0).
// HG_E_NOTFOUND, HG_E_EXISTS, HG_E_INVAL (cycle), HG_E_UNSUPPORTED (no edit): nothing changed.
enum hg_status fake_scene_apply(struct fake_scene *scene, struct hg_packet *packet,
    uint32_t first_id, uint32_t id_count) HG_MUST_CHECK;
struct fake_object *fake_scene_find(
    const struct fake_scene *scene, uint16_t type, uint64_t id, int64_t extra);
// Feeds everything that shows into `h`, whatever the order in which it came about.
void fake_scene_hash(const struct fake_scene *scene, struct hg_sha256 *h);
void fake_scene_finish(struct fake_scene *scene);

// Overlays the message on *slot (NULL: takes it).
void fake_merge(struct hg_packet **slot, struct hg_packet *packet);

#endif
