// demo.h - the built-in scene ("demo:"): made by code, the same bytes on every run.
// Floor 2, private to scene/. Any thread.
#ifndef HG_RENDERER_SCENE_DEMO_DEMO_H
#define HG_RENDERER_SCENE_DEMO_DEMO_H

#include "renderer/scene/load.h"

// A terrace at golden hour. Textures are drawn on `jobs` (may be NULL). HG_E_NOMEM.
enum hg_status hg_demo_create(uint32_t number, struct hg_jobs *jobs, struct hg_asset **out,
    struct hg_error *err) HG_MUST_CHECK;

#endif
