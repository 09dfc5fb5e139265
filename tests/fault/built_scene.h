// built_scene.h - a scene with every kind of edit, and the picture that shows whether it is whole.
// Test code, for the fake worker.
#ifndef HG_TESTS_FAULT_BUILT_SCENE_H
#define HG_TESTS_FAULT_BUILT_SCENE_H

#include "tests/system/daemon.h"

// In the peer's open scene, with a view 1.
void built_scene_make(struct peer *p);
void built_scene_view(struct peer *p); // only its view
// A settled frame of view 1; `digest` is the hash of all that it shows.
void built_scene_frame(struct peer *p, struct hgp_frame *out, uint8_t digest[32]);

#endif
