// scene.h - loads an asset and holds it against what the headers of the scene room promise.
// Test code. One thread.
#ifndef HG_TESTS_FUZZ_SCENE_H
#define HG_TESTS_FUZZ_SCENE_H

#include "renderer/scene/load.h"

// Aborts when the result breaks a promise.
void fuzz_load(const struct hg_load_params *params);
// Loads a file that is alone: whatever else it names has the same bytes, and names with "missing"
// are missing. What becomes of it may have 64 MiB.
void fuzz_load_file(const char *name, const uint8_t *data, size_t size);
void fuzz_load_file_within(
    const char *name, const uint8_t *data, size_t size, uint64_t memory_limit_bytes);

#endif
