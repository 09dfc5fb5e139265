// unlit_tiles.h - classifies tiles that no punctual light reaches, for a pipeline without
// lights. Floor 3. Thread: the render thread.
//
// On software rasterisers, branching over lights inside a shader saves little, but the depth test
// before it does. So surfaces are classified in cells of HG_UNLIT_TILES_CELL_PX before shading. A
// cell is unlit when the shadow maps of all lights that may reach its surfaces are nearer to the
// light everywhere, by a min/max pyramid over the shadow atlas. The test is conservative: pictures
// are byte-identical without it. Depths of surfaces in unlit tiles become HG_UNLIT_TILES_DEPTH, so
// that the depth test of shading (passes/shade.h) distinguishes the three kinds of pixels.
#ifndef HG_RENDERER_PASSES_UNLIT_TILES_H
#define HG_RENDERER_PASSES_UNLIT_TILES_H

#include "renderer/light/lighting.h"
#include "renderer/passes/pass.h"

// Zeroed = nothing yet.
struct hg_unlit_tiles {
    struct hg_gpu_buffer head, cells, levels;
    uint64_t seen; // hg_lighting_atlas_revision that `levels` were made of; 0 = none
    bool coarse;   // without the finer cascades
};

void hg_unlit_tiles_finish(struct hg_gpu *gpu, struct hg_unlit_tiles *tiles);
// Classifies the cells of `depth` for the pass's lights. Recorded after the shadow maps; coarse:
// these lack the finer cascades. HG_E_NOMEM, device errors.
enum hg_status hg_unlit_tiles_find(struct hg_pass *pass, struct hg_unlit_tiles *tiles,
    struct hg_lighting *lighting, bool coarse, struct hg_gpu_image *depth,
    struct hg_error *err) HG_MUST_CHECK;
// Moves their surfaces to HG_UNLIT_TILES_DEPTH (shaders/shared/unlit_tiles.h).
enum hg_status hg_unlit_tiles_mark(struct hg_pass *pass, const struct hg_unlit_tiles *tiles,
    struct hg_gpu_image *depth, struct hg_error *err) HG_MUST_CHECK;
// Share of cells that the newest picture had unlit, 0..1; after the batch was waited for.
float hg_unlit_tiles_share(const struct hg_unlit_tiles *tiles, const struct hg_gpu_image *depth);

#endif
