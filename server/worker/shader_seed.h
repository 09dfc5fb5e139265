// shader_seed.h - compiled shaders in advance: made before a client's file was read, copied by
// workers into caches of their own. Compiled shaders are code, so no worker reads what another one
// that has met a client has written. Floor 6, private to server/worker.
#ifndef HG_SERVER_WORKER_SHADER_SEED_H
#define HG_SERVER_WORKER_SHADER_SEED_H

#include "renderer/renderer.h"

// Copies what is in the folder `seed` and not yet in CACHE/shaders. Before the sandbox is entered
// and the driver looks at the folder. What cannot be copied is compiled when it is needed.
void hg_shader_seed_copy(const char *seed, const char *cache_dir);
// Renders the built-in scene in all ordinary ways, small, so that the driver compiles and keeps
// what they need. HG_E_DEVICE, HG_E_NOMEM, and what rendering may say.
enum hg_status hg_shader_seed_compile(
    const struct hg_renderer_params *params, struct hg_error *err) HG_MUST_CHECK;

#endif
