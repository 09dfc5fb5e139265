// fingerprint.h - one hash for all of a scene that its pixels depend on.
// Floor 2, first room. Thread: the scene's. Reads image files; takes memory for what it remembers.
//
// Equal fingerprints mean equal content, wherever the files lie and whatever they are called, by
// whatever numbers the objects go, and on whichever machine. Meshes, materials and textures are hashed once per {id, revision};
// a new pose costs only its nodes. Image files above 64 MiB count by their size and 64 pieces of 64
// KiB.
#ifndef HG_RENDERER_SCENE_FINGERPRINT_H
#define HG_RENDERER_SCENE_FINGERPRINT_H

#include "renderer/scene/scene.h"

struct hg_fingerprint; // what has been hashed of one scene

struct hg_fingerprint *hg_fingerprint_create(void) HG_MUST_CHECK; // NULL: no memory
void hg_fingerprint_destroy(struct hg_fingerprint *fingerprint);  // accepts NULL

// Call after hg_scene_update. HG_E_NOMEM; HG_E_IO and the like when an image file cannot be read.
enum hg_status hg_fingerprint_scene(struct hg_fingerprint *fingerprint,
    const struct hg_scene *scene, uint8_t hash[32], struct hg_error *err) HG_MUST_CHECK;

#endif
